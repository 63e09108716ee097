"""What `jampetsc pack` is asked to make: a task per packing, where each starts, and which are there already."""

import re
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from jampetsc.contacts.potentials import Potential
from jampetsc.errors import InputError
from jampetsc.packing.sizes import SIZES, radii_of
from jampetsc.storage.regular import open_regular

SMALLEST, LARGEST = 1e-6, 1e6  # radius
FEWEST, MOST = 16, 10_000_000
PRESSURES = (1e-8, 1.0)
PHIS = (0.8, 1.5)
TOLERANCES = (1e-13, 1e-4)
MOST_THREADS = 256
MANY = 1_000_000  # packings in one run
LAST_SEED = 2**63 - 1  # what a file can record


@dataclass(frozen=True)
class Task:
    """One packing to make."""

    path: Path
    seed: int | None  # None: from a file
    target: object  # protocols.Target


def plan(args, k=1.0) -> list[Task]:
    """The packings asked for; k: of the packing to start from. Raises InputError for values out of range."""
    from jampetsc.packing.protocols import Target

    if not TOLERANCES[0] <= args.tolerance <= TOLERANCES[1]:
        raise InputError(
            f"--tolerance {args.tolerance:g}: must lie in [{TOLERANCES[0]:g}, {TOLERANCES[1]:g}]"
        )
    if args.threads is not None and not 1 <= args.threads <= MOST_THREADS:
        raise InputError(f"--threads {args.threads}: must lie in [1, {MOST_THREADS}]")
    if args.phi is not None:
        if not PHIS[0] <= args.phi <= PHIS[1]:
            raise InputError(
                f"--phi {args.phi:g}: must lie in [{PHIS[0]:g}, {PHIS[1]:g}]; disks jam near 0.84"
            )
        if args.stabilise == "shear":
            raise InputError("--stabilise shear: needs --pressure; at fixed --phi the cell does not move")
        targets = {"": Target(phi=args.phi, tolerance=args.tolerance)}
    else:
        targets = {
            word: Target(
                k * _pressure(word, args.pressure), stabilise=args.stabilise, tolerance=args.tolerance
            )
            for word in args.pressure.split(",")
        }
    seeds = [None] if args.source else _seeds(args)
    for field, values in (("{seed}", seeds), ("{pressure}", targets)):
        if len(values) > 1 and field not in args.out:
            raise InputError(f"--out {args.out}: one name for {len(values)} packings: put {field} into it")
    meaningless = {"{seed}": args.source and "--from", "{pressure}": args.phi is not None and "--phi"}
    for field in re.findall(r"\{[^{}]*\}?|\}", args.out):
        if field not in meaningless:
            raise InputError(
                f"--out {args.out}: {field} stands for nothing: only {{seed}} and {{pressure}} do"
            )
        if meaningless[field]:
            raise InputError(f"--out {args.out}: {field} has no meaning with {meaningless[field]}")
    return [
        Task(Path(args.out.replace("{seed}", str(seed)).replace("{pressure}", word)), seed, target)
        for seed in seeds
        for word, target in targets.items()
    ]


def _pressure(word, text) -> float:
    """The value of one of the words in `text`. Raises InputError."""
    try:
        value = float(word)
    except ValueError:
        raise InputError(
            f"--pressure {word or text}: must be a number, or several with commas between"
        ) from None
    if not PRESSURES[0] <= value <= PRESSURES[1]:
        raise InputError(f"--pressure {word}: must lie in [{PRESSURES[0]:g}, {PRESSURES[1]:g}]")
    return value


def _seeds(args):
    """The seeds, increasing. Raises InputError."""
    if args.seeds is None:
        return _in_range([1 if args.seed is None else args.seed])
    return seeds_of(args.seeds)


def seeds_of(text: str):
    """The seeds that `FIRST:LAST` stands for, both included. Raises InputError."""
    try:
        first, last = (int(word) for word in text.split(":"))
    except ValueError:
        raise InputError(f"--seeds {text}: must be FIRST:LAST, for instance 1:20") from None
    if last < first:
        raise InputError(f"--seeds {text}: the last must not be below the first")
    if last - first >= MANY:
        raise InputError(f"--seeds {text}: {last - first + 1} packings: at most {MANY} at a time")
    return _in_range(range(first, last + 1))


def _in_range(seeds):
    for seed in (seeds[0], seeds[-1]):
        if not 0 <= seed <= LAST_SEED:
            raise InputError(f"--seed {seed}: must lie in [0, {LAST_SEED}]")
    return seeds


def radii_for(args):
    """Radii (N,) of the disks of a random start, None with --from. Raises InputError for what does not go together.

    Looks at the files that are named, not yet into a packing.
    """
    if args.source:
        from jampetsc.storage.packing_file import check_packing

        for name in ("potential", "stiffness", "sizes", "radii"):
            if getattr(args, name) is not None:
                raise InputError(f"--{name}: belongs to the packing {args.source}; leave it out with --from")
        check_packing(args.source)
        return None
    if args.n is None and not args.radii:
        raise InputError("--n is missing: how many disks? (or --radii FILE, or --from FILE)")
    return radii_asked(args)


def radii_asked(args):
    """Radii (N,) of --radii, or of --n and --sizes with mean diameter 1. Raises InputError."""
    if args.radii and (args.n is not None or args.sizes):
        raise InputError(
            f"--radii {args.radii}: gives number and sizes of the disks; leave out --n and --sizes"
        )
    radii = _read_radii(args.radii) if args.radii else None
    n = args.n if radii is None else len(radii)
    if not FEWEST <= n <= MOST:
        raise InputError(
            f"{'--n' if radii is None else args.radii}: {n} disks: must lie in [{FEWEST}, {MOST}]"
        )
    return radii_of(args.sizes or SIZES[0], n) if radii is None else radii


def sizes_told(args) -> str:
    """What a file says about the sizes of the disks."""
    return f"radii of {Path(args.radii).name}" if args.radii else args.sizes or SIZES[0]


def starter(args, radii, source):
    """Function of (seed, target) that gives the disks to begin with, from `radii` or the packing `source`.

    Raises InputError for a packing that cannot be begun with.
    """
    from jampetsc.packing.protocols import random_start, start_phi

    if source is not None:
        return _from_packing(args, source)
    potential = Potential(args.potential or "harmonic", args.stiffness or "constant")
    return lambda seed, target: random_start(radii, target.phi or start_phi(target.pressure), seed, potential)


def _from_packing(args, source):
    from jampetsc.contacts.pairs import deformed
    from jampetsc.contacts.state import measure

    disks = replace(source, record={})
    if args.n not in (None, disks.n):
        raise InputError(f"--n {args.n}: {args.source} has {disks.n} disks; leave --n out with --from")
    if args.phi is None and measure(disks).pressure <= 0:
        raise InputError(
            f"{args.source}: no disks touch, so there is no pressure to change: use --phi, or a random start"
        )
    still = np.zeros((disks.n, 2))
    return lambda seed, target: (
        disks if target.phi is None else deformed(disks, still, 0.5 * np.log(disks.phi / target.phi), 0.0)
    )


def _read_radii(path):
    try:
        with open_regular(path) as file, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of an empty file, which is refused below
            radii = np.loadtxt(file, dtype=float, ndmin=1, max_rows=MOST + 1)
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path}: cannot be read as radii ({' '.join(str(error).split())}): give one number per line"
        ) from None
    if radii.ndim != 1 or not (np.isfinite(radii).all() and (radii > 0).all()):
        raise InputError(f"{path}: radii must be positive numbers, one per line")
    if len(radii) and not SMALLEST <= radii.min() <= radii.max() <= LARGEST:
        raise InputError(
            f"{path}: radii from {radii.min():g} to {radii.max():g}: must lie in [{SMALLEST:g}, {LARGEST:g}]; choose "
            "another unit of length"
        )
    return radii


def request_of(args, identity) -> dict:
    """What a file must say to be what is asked for, beyond its target and seed; identity: of --from, or None."""
    entries = {"stabilise": args.stabilise, "tolerance": args.tolerance}
    if identity is not None:
        return entries | dict(zip(("source", "source_sha256"), identity, strict=True))
    return entries | {
        "sizes": sizes_told(args),
        "requested_n": args.n or 0,
        "requested_potential": args.potential or "harmonic",
        "requested_stiffness": args.stiffness or "constant",
    }


def entries(task, request) -> dict:
    aim = (
        {"requested_phi": task.target.phi}
        if task.target.phi
        else {"requested_pressure": task.target.pressure}
    )
    return request | aim | ({} if task.seed is None else {"seed": task.seed})


def complete(task, request, overwrite=False, source=None) -> bool:
    """Whether the file is there already. Raises InputError if it holds something else that is not to be replaced.

    source   the file of --from, which packings of older versions know by its bytes
    """
    from jampetsc.storage.packing_file import is_known_as, read_packing

    if not task.path.exists():
        return False
    found = read_packing(task.path).record
    for name, value in entries(task, request).items():
        if found.get(name) != value and not (
            name == "source_sha256" and is_known_as(source, found.get(name))
        ):
            if overwrite:
                return False
            raise InputError(
                f"{task.path}: is there already with {name} = {found.get(name)}, not {value}: "
                "choose another --out, or give --overwrite to replace it"
            )
    return True
