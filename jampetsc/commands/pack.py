"""`jampetsc pack`: make packings at a pressure or a packing fraction, one or an ensemble."""

import sys
import time

from jampetsc.collective import by_rank_0, own_cores
from jampetsc.contacts.potentials import EXPONENTS, STIFFNESSES
from jampetsc.errors import ConvergenceError, JampetscError
from jampetsc.packing.sizes import SIZES
from jampetsc.words.packtasks import complete, entries, plan, radii_for, request_of, starter

EPILOG = """examples
  jampetsc pack --n 1024 --pressure 1e-4 --seed 1 --out p1e-4.h5
  jampetsc pack --n 1024 --pressure 1e-5 --from p1e-4.h5 --out p1e-5.h5
  mpirun -n 4 jampetsc pack --n 1024 --pressure 1e-2,1e-3 --seeds 1:20 --out out/p{pressure}-{seed}.h5

One packing is made by one rank, with all the cores that are its own; several are shared among the ranks. The same
seed gives the same packing to the last bit, whatever the number of threads and ranks.

Options of the Newton steps have the prefix -newton_, e.g. -newton_pc_factor_mat_solver_type mumps."""


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "pack",
        help="make a packing, or an ensemble",
        description="Make packings of soft disks: minima of enthalpy at given p, of energy at given φ.",
        epilog=EPILOG,
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
    how.add_argument(
        "--threads",
        type=int,
        metavar="T",
        help="of each rank (default: the cores it may use, shared with the node's other ranks at work)",
    )
    parser.set_defaults(run=run, check=check, takes_petsc=lambda args: True)


def check(args):
    """(radii, tasks): the disks of a random start, and a task per packing. Raises InputError."""
    return radii_for(args), plan(args)


def run(args, petsc_argv) -> int:
    """Make what is not there yet. Collective; every rank makes its own packings."""
    from jampetsc import session as door
    from jampetsc.storage.outputs import check_output
    from jampetsc.storage.packing_file import FORMAT, read_identified

    radii, tasks = check(args)
    for task in tasks:
        check_output(task.path, FORMAT, filter(None, [args.source, args.radii]))
    session = door.start(scalar="real", petsc_argv=petsc_argv)
    radii = session.comm.bcast(radii)  # of one rank for all: the file may have been replaced
    source, identity = None, None
    if args.source:
        source, identity = read_identified(args.source, session.comm)
        tasks = plan(args, source.potential.k)
    start = starter(args, radii, source)
    request = request_of(args, identity)
    pending = by_rank_0(
        session.comm,
        lambda: [task for task in tasks if not complete(task, request, args.overwrite, args.source)],
    )
    from jampetsc.contacts.threads import Team
    from jampetsc.solvers import local
    from jampetsc.solvers.rehearsal import rehearse

    rehearse(local.rehearse)
    solver = local.NewtonSolver()
    if session.rank == 0 and len(pending) < len(tasks):
        print(f"{len(tasks) - len(pending)} of {len(tasks)} packings are there already", flush=True)
    if session.rank == 0 and 0 < len(pending) < session.size:
        idle = session.size - len(pending)
        print(f"one rank makes a packing: {idle} of {session.size} ranks have nothing to do", flush=True)
    mine = pending[session.rank :: session.size]
    team = Team(args.threads or own_cores(session.comm, bool(mine)))
    failures = _make(mine, start, request, solver, team, session)
    failures = [failure for some in session.comm.allgather(failures) for failure in some]
    if len(tasks) == 1 and failures:
        raise failures[0][1]
    if failures:
        names = "; ".join(f"{path}: {error}" for path, error in failures)
        raise ConvergenceError(
            f"{len(failures)} of {len(tasks)} packings failed, the others are on disk: {names}"
        )
    return 0


def _make(tasks, start, request, solver, team, session):
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
                    fresh=fresh,
                    team=team,
                    effort=effort,
                )
                disks = disks.with_record(**entries(task, request))
                write_packing(task.path, disks)
            except ConvergenceError as error:
                remedy = "use another --seed, or a larger --tolerance"
                failures.append((str(task.path), ConvergenceError(f"{error}: {remedy}")))
                continue
            except JampetscError as error:
                failures.append((str(task.path), error))
                continue
            bar.write(_summary(task.path, disks, time.perf_counter() - began))
            sys.stdout.flush()
            bar.update()
    return failures


def _summary(path, disks, seconds) -> str:
    record = disks.record
    residual = record["max_force"] / (record["pressure"] * 2.0 * float(disks.radii.mean()))
    missed = bool(residual > record["tolerance"])
    note = f"\n  max|F|/(p d) = {residual:.1e} is what rounding leaves, more than --tolerance {record['tolerance']:g}"
    return (
        f"{path}: N = {disks.n}, p = {record['pressure']:.6g}, phi = {record['phi']:.6f}, "
        f"Z = {record['coordination']:.4f}, "
        f"{record['rattlers']} rattlers, max|F|/p = {record['max_force'] / record['pressure']:.1e}, "
        f"{record['evaluations']} force evaluations, {seconds:.2f} s{note * missed}"
    )
