"""What `jampetsc flow` is asked to do: the model, the disks to start from, and what a flow file goes on with."""

import math

from jampetsc.contacts.laws import OPTIONS, Law
from jampetsc.contacts.potentials import EXPONENTS, Potential
from jampetsc.errors import InputError
from jampetsc.flow.models import MODELS, Model
from jampetsc.packing.sizes import SIZES, radii_of
from jampetsc.words.law import law_from
from jampetsc.words.packtasks import FEWEST, LAST_SEED, MOST

PHIS = (0.1, 1.0)
SETTLED = 1e-6  # max |F| in k_e/d, to which a random start is relaxed
GIVEN_WITH_START = ("n", "phi", "seed", "sizes", "potential")
UNITS = "k_e = k_d = 1, diameter of the small disks 1"  # Vågberg, thesis sec. 4.1


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
            if getattr(args, name) is not None:
                raise InputError(f"--{name}: belongs to {args.start}; leave it out")
        return
    for name in ("n", "phi"):
        if getattr(args, name) is None:
            raise InputError(f"--{name} is missing: give --n and --phi, or a packing to start from")
    if not FEWEST <= args.n <= MOST:
        raise InputError(f"--n {args.n}: must lie in [{FEWEST}, {MOST}]")
    if not PHIS[0] <= args.phi <= PHIS[1]:
        raise InputError(f"--phi {args.phi:g}: must lie in [{PHIS[0]:g}, {PHIS[1]:g}]; disks jam near 0.84")
    if args.seed is not None and not 0 <= args.seed <= LAST_SEED:
        raise InputError(f"--seed {args.seed}: must lie in [0, {LAST_SEED}]")


def start_of(args, comm=None):
    """(disks, attributes that say where they come from). Collective. Raises InputError.

    Without a packing: random places, deep overlaps quenched away, in Vågberg's units: the smallest diameter is 1.
    """
    if args.start is not None:
        from jampetsc.storage.packing_file import read_identified

        disks, (name, digest) = read_identified(args.start, comm)
        return disks, {"packing": name, "packing_sha256": digest, "units": "those of the packing"}

    from jampetsc.packing.minimise import settle
    from jampetsc.packing.protocols import random_start

    sizes = args.sizes or SIZES[0]
    radii = radii_of(sizes, args.n)
    seed = 1 if args.seed is None else args.seed
    potential = Potential(args.potential or next(iter(EXPONENTS)), "inverse-square-diameter")
    start = random_start(radii * (0.5 / radii.min()), args.phi, seed, potential)
    return settle(start, SETTLED), {"seed": seed, "sizes": sizes, "units": UNITS}
