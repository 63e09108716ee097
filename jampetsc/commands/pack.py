"""`jampetsc pack`: make packings at a pressure or a packing fraction, one or an ensemble."""

import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from jampetsc.errors import ConvergenceError, InputError, JampetscError
from jampetsc.packing.potentials import EXPONENTS, STIFFNESSES, Potential
from jampetsc.packing.sizes import SIZES, radii_of

FEWEST, MOST = 16, 10_000_000
PRESSURES = (1e-8, 1.0)
PHIS = (0.8, 1.5)
TOLERANCES = (1e-13, 1e-4)

EPILOG = """examples
  jampetsc pack --n 1024 --pressure 1e-4 --seed 1 --out p1e-4.h5
  jampetsc pack --n 1024 --pressure 1e-5 --from p1e-4.h5 --out p1e-5.h5
  mpirun -n 4 jampetsc pack --n 1024 --pressure 1e-2,1e-3 --seeds 1:20 --out out/p{pressure}-{seed}.h5

Options of the Newton steps have the prefix -newton_, e.g. -newton_pc_factor_mat_solver_type mumps."""


@dataclass(frozen=True)
class Task:
    """One packing to make."""

    path: Path
    seed: int | None  # None: from a file
    target: object  # protocols.Target


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "pack",
        help="make a packing, or an ensemble",
        description="Make packings of soft disks: minima of enthalpy at given p, of energy at given φ.",
        epilog=EPILOG,
        allow_abbrev=False,
    )
    what = parser.add_argument_group("what")
    what.add_argument("--n", type=int, metavar="N", help="number of disks")
    aim = what.add_mutually_exclusive_group(required=True)
    aim.add_argument("--pressure", metavar="P[,P…]", help="pressure p = Σ f r / (2V) in units of k")
    aim.add_argument("--phi", type=float, metavar="PHI", help="packing fraction, instead of a pressure")
    what.add_argument("--potential", choices=EXPONENTS, help="(default harmonic)")
    what.add_argument(
        "--stiffness", choices=STIFFNESSES, help="convention of the contact stiffness (default constant)"
    )
    what.add_argument("--sizes", choices=SIZES, help="bidisperse: 1:1.4, half and half (default)")
    what.add_argument(
        "--radii", metavar="FILE", help="text file of radii, one per disk, instead of --n and --sizes"
    )
    what.add_argument(
        "--stabilise",
        choices=("volume", "shear"),
        default="volume",
        help="shear: also relax the shear of the cell",
    )
    what.add_argument(
        "--tolerance", type=float, default=1e-10, metavar="T", help="max|F|/(p d) and |Δp|/p (default 1e-10)"
    )
    how = parser.add_argument_group("from where, and to where")
    start = how.add_mutually_exclusive_group()
    start.add_argument("--seed", type=int, metavar="S", help="of the random start (default 1)")
    start.add_argument("--seeds", metavar="A:B", help="an ensemble, A to B included, shared among the ranks")
    start.add_argument("--from", dest="source", metavar="FILE", help="change the pressure of this packing")
    how.add_argument(
        "--out", required=True, metavar="FILE", help="packing file; {seed} and {pressure} are replaced"
    )
    parser.set_defaults(run=run, takes_petsc=lambda args: True)


def run(args, petsc_argv) -> int:
    """Make what is not there yet. Collective; every rank makes its own packings."""
    from jampetsc import session as door
    from jampetsc.storage.atomic import check_writable

    tasks = plan(args)
    start = _starter(args)
    request = _request(args)
    pending = [task for task in tasks if not _complete(task, request)]
    for task in pending:
        check_writable(task.path)
    session = door.start(scalar="real", petsc_argv=petsc_argv)
    pending = session.comm.bcast(pending)
    from jampetsc.mechanics.newtonsolver import NewtonSolver

    solver = NewtonSolver()
    solver.factorise(*_identity())
    session.check_options()
    if session.rank == 0 and len(pending) < len(tasks):
        print(f"{len(tasks) - len(pending)} of {len(tasks)} packings are there already", flush=True)
    failures = _make(pending[session.rank :: session.size], start, request, solver, session)
    failures = [failure for some in session.comm.allgather(failures) for failure in some]
    if len(tasks) == 1 and failures:
        raise failures[0][1]
    if failures:
        names = "; ".join(f"{path}: {error}" for path, error in failures)
        raise ConvergenceError(
            f"{len(failures)} of {len(tasks)} packings failed, the others are on disk: {names}"
        )
    return 0


def plan(args) -> list[Task]:
    """The packings asked for. Raises InputError for values out of range."""
    from jampetsc.packing.protocols import Target

    if not TOLERANCES[0] <= args.tolerance <= TOLERANCES[1]:
        raise InputError(
            f"--tolerance {args.tolerance:g}: must lie in [{TOLERANCES[0]:g}, {TOLERANCES[1]:g}]"
        )
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
            word: Target(_pressure(word), stabilise=args.stabilise, tolerance=args.tolerance)
            for word in args.pressure.split(",")
        }
    seeds = [None] if args.source else _seeds(args)
    for field, values in (("{seed}", seeds), ("{pressure}", targets)):
        if len(values) > 1 and field not in args.out:
            raise InputError(f"--out {args.out}: one name for {len(values)} packings: put {field} into it")
    if args.source and "{seed}" in args.out:
        raise InputError(f"--out {args.out}: {{seed}} has no meaning with --from")
    return [
        Task(Path(args.out.replace("{seed}", str(seed)).replace("{pressure}", word)), seed, target)
        for seed in seeds
        for word, target in targets.items()
    ]


def _pressure(word) -> float:
    try:
        value = float(word)
    except ValueError:
        raise InputError(f"--pressure {word}: must be a number, or several with commas between") from None
    if not PRESSURES[0] <= value <= PRESSURES[1]:
        raise InputError(f"--pressure {word}: must lie in [{PRESSURES[0]:g}, {PRESSURES[1]:g}]")
    return value


def _seeds(args) -> list[int]:
    if args.seeds is None:
        seeds = [1 if args.seed is None else args.seed]
    else:
        try:
            first, last = (int(word) for word in args.seeds.split(":"))
        except ValueError:
            raise InputError(f"--seeds {args.seeds}: must be FIRST:LAST, for instance 1:20") from None
        if last < first:
            raise InputError(f"--seeds {args.seeds}: the last must not be below the first")
        seeds = list(range(first, last + 1))
    if seeds[0] < 0:
        raise InputError(f"--seed {seeds[0]}: must not be negative")
    return seeds


def _starter(args):
    """Function of (seed, target) that gives the disks to begin with. Raises InputError for bad input."""
    from jampetsc.packing.protocols import random_start, start_phi

    if args.source:
        return _from_packing(args)
    if args.radii:
        if args.n is not None or args.sizes:
            raise InputError(
                f"--radii {args.radii}: gives number and sizes of the disks; leave out --n and --sizes"
            )
        radii = _read_radii(args.radii)
    else:
        if args.n is None:
            raise InputError("--n is missing: how many disks? (or --radii FILE, or --from FILE)")
        radii = None
    n = args.n if radii is None else len(radii)
    if not FEWEST <= n <= MOST:
        raise InputError(
            f"{'--n' if radii is None else args.radii}: {n} disks: must lie in [{FEWEST}, {MOST}]"
        )
    radii = radii_of(args.sizes or SIZES[0], n) if radii is None else radii
    potential = Potential(args.potential or "harmonic", args.stiffness or "constant")
    return lambda seed, target: random_start(radii, target.phi or start_phi(target.pressure), seed, potential)


def _from_packing(args):
    from jampetsc.packing.contacts import measure
    from jampetsc.packing.forces import deformed
    from jampetsc.storage.packing_file import read_packing

    for name in ("potential", "stiffness", "sizes", "radii"):
        if getattr(args, name) is not None:
            raise InputError(f"--{name}: belongs to the packing {args.source}; leave it out with --from")
    disks = replace(read_packing(args.source), record={})
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
        radii = np.loadtxt(path, dtype=float, ndmin=1)
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path}: cannot be read as radii ({' '.join(str(error).split())}): give one number per line"
        ) from None
    if radii.ndim != 1 or not (np.isfinite(radii).all() and (radii > 0).all()):
        raise InputError(f"{path}: radii must be positive numbers, one per line")
    return radii


def _request(args) -> dict:
    """What a file must say to be what is asked for, beyond its target and seed."""
    entries = {"stabilise": args.stabilise, "tolerance": args.tolerance}
    if args.source:
        from jampetsc.storage.packing_file import packing_identity

        name, digest = packing_identity(args.source)
        return entries | {"source": name, "source_sha256": digest}
    return entries | {
        "sizes": f"radii of {Path(args.radii).name}" if args.radii else args.sizes or SIZES[0],
        "requested_n": args.n or 0,
        "requested_potential": args.potential or "harmonic",
        "requested_stiffness": args.stiffness or "constant",
    }


def _entries(task, request) -> dict:
    aim = (
        {"requested_phi": task.target.phi}
        if task.target.phi
        else {"requested_pressure": task.target.pressure}
    )
    return request | aim | ({} if task.seed is None else {"seed": task.seed})


def _complete(task, request) -> bool:
    """Whether the file is there already. Raises InputError if it holds something else."""
    from jampetsc.storage.packing_file import read_packing

    if not task.path.exists():
        return False
    found = read_packing(task.path).record
    for name, value in _entries(task, request).items():
        if found.get(name) != value:
            raise InputError(
                f"{task.path}: is there already with {name} = {found.get(name)}, not {value}: "
                "remove it, or choose another --out"
            )
    return True


def _make(tasks, start, request, solver, session):
    """Make this rank's packings; returns [(path, error)] of those that failed."""
    from tqdm import tqdm

    from jampetsc.packing.protocols import Effort, make_packing
    from jampetsc.storage.packing_file import write_packing

    failures = []
    # disable=None: a bar on a terminal only, and of rank 0 only.
    with tqdm(total=len(tasks), unit="packing", leave=False, disable=True if session.rank else None) as bar:
        for task in tasks:
            began = time.perf_counter()
            effort = Effort(report=lambda e: bar.set_postfix_str(f"{e.stage}, max|F|/p = {e.residual:.0e}"))
            fresh = task.seed is not None
            try:
                disks = make_packing(
                    start(task.seed, task.target),
                    task.target,
                    solver,
                    seed=task.seed or 0,
                    fresh=fresh,
                    effort=effort,
                )
                disks = disks.with_record(**_entries(task, request))
                write_packing(task.path, disks)
            except JampetscError as error:
                failures.append((str(task.path), error))
                continue
            bar.write(_summary(task.path, disks, time.perf_counter() - began))
            sys.stdout.flush()
            bar.update()
    return failures


def _summary(path, disks, seconds) -> str:
    record = disks.record
    return (
        f"{path}: N = {disks.n}, p = {record['pressure']:.6g}, phi = {record['phi']:.6f}, "
        f"Z = {record['coordination']:.4f}, "
        f"{record['rattlers']} rattlers, max|F|/p = {record['max_force'] / record['pressure']:.1e}, "
        f"{record['evaluations']} force evaluations, {seconds:.2f} s"
    )


def _identity():
    """A matrix of order two to set the solver up with, so that unknown options show before the work."""
    return np.array([0, 1, 2], np.int32), np.array([0, 1], np.int32), np.ones(2)
