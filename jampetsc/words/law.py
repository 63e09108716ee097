"""The options that choose a damping law, shared by every command that needs one."""

from jampetsc.contacts.laws import DEFAULT, FAMILIES, OPTIONS, Law, Physics, damping_law, having
from jampetsc.errors import InputError


def add_law_options(parser) -> None:
    """Add --law and what goes with it, and --no-prestress, to an argparse parser."""
    group = add_law(parser, DEFAULT)
    group.add_argument(
        "--no-prestress",
        dest="prestress",
        action="store_false",
        help="drop the f/r term of K (BT: 'without pre-stress')",
    )


def add_law(parser, default):
    """Add --law, with this default or None, and what goes with it to an argparse parser; returns their group."""
    group = parser.add_argument_group("damping law")
    labels = " or ".join(f"{family.label} ({name})" for name, family in FAMILIES.items())
    told = f"; default {default}" if default else ""
    group.add_argument("--law", choices=FAMILIES, default=default, help=f"{labels}{told}")
    for name in OPTIONS:
        owners = having(name)
        option = FAMILIES[owners[0]].options[name]
        belongs = f"--law {' or '.join(owners)}"
        if isinstance(option.default, bool):
            group.add_argument(
                f"--no-{name}",
                dest=name,
                action="store_false",
                default=None,
                help=f"{option.meaning} ({belongs})",
            )
        else:
            group.add_argument(
                f"--{name.replace('_', '-')}",
                type=float,
                metavar=name.upper(),
                help=f"{option.meaning} ({belongs}, default {option.default:g})",
            )
    group.add_argument("--tau1", type=float, default=1.0, metavar="TIME", help="damping time τ₁ (default 1)")
    return group


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


def damping_from(args, law: Law):
    """The EquivalentDamping of parsed arguments, or None for linear damping. Raises InputError."""
    if args.alpha is None and args.stress is None:
        return None
    if args.alpha is None:
        raise InputError(f"--stress {args.stress:g}: belongs to power-law damping: give --alpha too")
    if args.stress is None:
        raise InputError(
            f"--alpha {args.alpha:g}: power-law damping depends on the amplitude: give --stress, in units of k"
        )
    if not law.damps_contacts:
        owners = [name for name in FAMILIES if damping_law(name).damps_contacts]
        raise InputError(
            f"--alpha {args.alpha:g}: belongs to --law {' or '.join(owners)}, not to {law.family}; leave it out"
        )
    from jampetsc.analysis.equivalent_damping import EquivalentDamping

    return EquivalentDamping(law.exponent, args.stress)


def physics_from(args) -> Physics:
    """Law and pre-stress of parsed arguments. Raises InputError for an option that belongs to another law."""
    return Physics(law_from(args), args.prestress)


def law_from(args) -> Law:
    """The law of parsed arguments. Raises InputError for an option that belongs to another law."""
    given = {name: getattr(args, name) for name in OPTIONS if getattr(args, name) is not None}
    alpha = getattr(args, "alpha", None)  # only some commands have it
    return damping_law(args.law, tau1=args.tau1, exponent=1.0 if alpha is None else alpha, **given)


def words_of(physics: Physics) -> list[str]:
    """The options that mean it: what `physics_from` makes the same of."""
    law = physics.law
    words = ["--law", law.family, "--tau1", repr(law.tau1)]
    for name, value in law.options:
        if value is False:
            words.append(f"--no-{name}")
        elif value is not True:
            words += [f"--{name.replace('_', '-')}", repr(value)]
    return words + ([] if physics.prestress else ["--no-prestress"])
