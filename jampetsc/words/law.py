"""The options that choose a damping law, shared by every command that needs one."""

from jampetsc.contacts.laws import KINDS, Law
from jampetsc.errors import InputError

BELONGS_TO = {"beta": "contact", "no_rotations": "contact", "eta_f": "stokes"}


def add_law_options(parser) -> None:
    """Add --law and what goes with it to an argparse parser."""
    group = parser.add_argument_group("damping law")
    group.add_argument(
        "--law", choices=KINDS, default="contact", help="contact damping (default) or Stokes drag"
    )
    group.add_argument(
        "--beta", type=float, metavar="BETA", help="transverse to normal contact damping, ≥ 0 (default 1)"
    )
    group.add_argument("--no-rotations", action="store_true", help="disks do not roll (contact law)")
    group.add_argument(
        "--eta-f", type=float, metavar="ETA", help="fluid viscosity in units of k τ₁, ≥ 0 (Stokes, default 1)"
    )
    group.add_argument(
        "--no-prestress", action="store_true", help="drop the f/r term of K (BT: 'without pre-stress')"
    )
    group.add_argument("--tau1", type=float, default=1.0, metavar="TIME", help="damping time τ₁ (default 1)")


def add_damping_options(parser) -> None:
    """Add the options of power-law damping; only commands that follow frequencies can have them."""
    group = parser.add_argument_group(
        "power-law damping",
        "viscous force of a contact ∝ |Δu̇|^A, treated by an equivalent linear damping (an approximation)",
    )
    group.add_argument("--alpha", type=float, metavar="A", help="exponent of the damping force (1 is linear)")
    group.add_argument(
        "--stress", type=float, metavar="S", help="amplitude of the shear stress in units of k, with --alpha"
    )


def damping_from(args):
    """The EquivalentDamping of parsed arguments, or None for linear damping. Raises InputError."""
    if args.alpha is None and args.stress is None:
        return None
    if args.alpha is None:
        raise InputError(f"--stress {args.stress:g}: belongs to power-law damping: give --alpha too")
    if args.stress is None:
        raise InputError(
            f"--alpha {args.alpha:g}: power-law damping depends on the amplitude: give --stress, in units of k"
        )
    if args.law != "contact":
        raise InputError(f"--alpha {args.alpha:g}: belongs to --law contact, not to {args.law}; leave it out")
    from jampetsc.analysis.equivalent_damping import EquivalentDamping

    return EquivalentDamping(args.alpha, args.stress)


def law_from(args) -> Law:
    """The Law of parsed arguments. Raises InputError for an option that belongs to the other law."""
    for name, kind in BELONGS_TO.items():
        if getattr(args, name) not in (None, False) and args.law != kind:
            raise InputError(
                f"--{name.replace('_', '-')}: belongs to --law {kind}, not to --law {args.law}; leave it out"
            )
    given = {name: getattr(args, name) for name in ("beta", "eta_f") if getattr(args, name) is not None}
    return Law(
        kind=args.law,
        rotations=not args.no_rotations,
        prestress=not args.no_prestress,
        tau1=args.tau1,
        **given,
    )
