"""What `jampetsc flow` is asked to do: the model, the disks to start from, and what a flow file goes on with."""

import math

from jampetsc.contacts.laws import LARGEST, OPTIONS, Law
from jampetsc.contacts.potentials import EXPONENTS, Potential
from jampetsc.errors import InputError
from jampetsc.flows.models import MODELS, Model
from jampetsc.packing.sizes import SIZES
from jampetsc.words.law import law_from
from jampetsc.words.packtasks import LAST_SEED, radii_asked, sizes_told

PHIS = (0.1, 1.0)
SETTLED = 1e-6  # max |F| in k_e/d, to which a random start is relaxed
GIVEN_WITH_START = ("n", "phi", "seed", "sizes", "radii", "potential", "walls")
UNITS = "k_e = k_d = 1, diameter of the small disks 1"  # Vågberg, thesis sec. 4.1
OWN_UNITS = "k_e = k_d = 1, length as of the radii given"


def add_disks(parser):
    """Add what disks a start that is no file has; returns their group."""
    disks = parser.add_argument_group("disks, where START is no file: smallest diameter 1, k_e = k_d = 1")
    disks.add_argument("--n", type=int, metavar="N", help="number of disks")
    disks.add_argument("--phi", type=float, metavar="PHI", help="packing fraction")
    disks.add_argument("--seed", type=int, metavar="S", help="of the random start (default 1)")
    disks.add_argument("--sizes", choices=SIZES, help="bidisperse: 1:1.4, half and half (default)")
    disks.add_argument(
        "--radii", metavar="FILE", help="text file of radii, one per disk, instead of --n and --sizes"
    )
    disks.add_argument("--potential", choices=EXPONENTS, help="(default harmonic)")
    return disks


def model_from(args, k=1.0) -> Model:
    """The model of parsed arguments: a row of MODELS, or a law; k: of the disks. Raises InputError."""
    named = args.model is not None
    given = [name for name in ("law", *OPTIONS) if getattr(args, name) is not None]
    if named == (args.law is not None) or (named and given):
        word = f"--{given[0].replace('_', '-')}" if given else ""
        raise InputError(
            f"--model {args.model} and {word}: give one of them"
            if named
            else f"--model is missing: {', '.join(MODELS)}, or --law with its options"
        )
    if args.mass is not None and args.quality is not None:
        raise InputError(f"--quality {args.quality:g}: --mass says the same; leave one out")
    for name in ("mass", "quality", "friction", "tau1"):
        if getattr(args, name) is not None and LARGEST < getattr(args, name) < math.inf:
            raise InputError(f"--{name} {getattr(args, name):g}: must be at most {LARGEST:g}")
    if named:
        law, massive = MODELS[args.model]
        law = Law(**{**vars(law), "tau1": args.tau1})
        if massive and args.mass is None and args.quality is None:
            raise InputError(f"--model {args.model}: give its --mass, or --quality")
        if not massive and (args.mass is not None or args.quality is not None):
            raise InputError(
                f"--model {args.model}: is overdamped; leave --mass out, or take {args.model[:-1]}"
            )
    else:
        law = law_from(args)
    mass = args.mass
    if args.quality is not None:
        if not (math.isfinite(args.quality) and args.quality > 0):
            raise InputError(f"--quality {args.quality:g}: must be positive")
        mass = args.quality**2 * k * law.tau1**2
    if mass is not None and not (math.isfinite(mass) and mass > 0):
        limit = "" if named and args.model in ("RD", "CD") else "; it has no overdamped limit"
        other = f"; the overdamped limit is --model {args.model}0" if named and not limit else limit
        raise InputError(f"--mass {mass:g}: must be positive{other}")
    return Model(law, mass or 0.0, args.friction or 0.0, args.model or "")


def check_start(args) -> None:
    """Raise InputError for words about the start that do not go together or are out of range."""
    if args.start is not None:
        for name in GIVEN_WITH_START:
            if getattr(args, name, None) is not None:
                raise InputError(f"--{name}: belongs to {args.start}; leave it out")
        return
    for name in ("n", "phi"):
        if getattr(args, name) is None and not (name == "n" and args.radii):
            raise InputError(f"--{name} is missing: give --n and --phi, or a packing to start from")
    radii_asked(args)
    if not PHIS[0] <= args.phi <= PHIS[1]:
        raise InputError(f"--phi {args.phi:g}: must lie in [{PHIS[0]:g}, {PHIS[1]:g}]; disks jam near 0.84")
    if args.seed is not None and not 0 <= args.seed <= LAST_SEED:
        raise InputError(f"--seed {args.seed}: must lie in [0, {LAST_SEED}]")


def start_of(args, comm=None):
    """(disks, attributes that say where they come from). Collective. Raises InputError.

    Without a packing: random places, deep overlaps quenched away, in Vågberg's units: the smallest diameter is 1, but
    where radii are given.
    `walls` in the attributes is the number of disks, the first ones, that make up the walls.
    """
    if args.start is not None:
        from jampetsc.storage.packing_file import read_identified

        disks, (name, digest) = read_identified(args.start, comm)
        return disks, {"packing": name, "packing_sha256": digest, "units": "those of the packing"}

    from jampetsc.collective import by_rank_0
    from jampetsc.packing.minimise import settle
    from jampetsc.packing.protocols import random_start

    radii = by_rank_0(comm, lambda: radii_asked(args))
    if not args.radii:
        radii = radii * (0.5 / radii.min())
    seed = 1 if args.seed is None else args.seed
    potential = Potential(args.potential or next(iter(EXPONENTS)), "inverse-square-diameter")
    origin = {"seed": seed, "sizes": sizes_told(args), "units": OWN_UNITS if args.radii else UNITS}
    if getattr(args, "walls", None):
        from jampetsc.flows.walls import between_walls

        disks, held = between_walls(radii, args.phi, seed, potential)
        return disks, origin | {"walls": held}
    return settle(random_start(radii, args.phi, seed, potential), SETTLED), origin
