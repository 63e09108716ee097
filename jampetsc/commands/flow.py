"""`jampetsc flow`: steady shear of soft disks, overdamped or massive."""

from jampetsc.errors import InputError
from jampetsc.flows.models import MODELS
from jampetsc.words.flowing import add_disks, check_start, model_from, start_of
from jampetsc.words.law import add_law

EPILOG = """examples
  jampetsc flow --n 1024 --phi 0.8433 --model RD0 --rate 1e-3 --strain 20 --out rd0.h5
  jampetsc flow packing.h5 --model CD0 --rate 1e-4 --strain 5 --out cd0.h5 --snapshots 100
  jampetsc flow --n 256 --phi 0.78 --model CDn --mass 1 --rate 1e-3 --strain 40 --out cdn.h5
  jampetsc flow rd0.h5 --strain 20                                 twenty more

A run that was killed goes on when the same command is given again. One run with contact damping and many disks may
use several ranks, or solvers of PETSc's with the prefix -flow_, e.g. -flow_pc_type gamg; independent runs are faster
side by side."""


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "flow",
        help="steady shear at a rate: stress, pressure, energy balance",
        description="Shear soft disks steadily under Lees–Edwards conditions (Vågberg's six models, or a damping law).",
        epilog=EPILOG,
    )
    parser.add_argument(
        "start", nargs="?", metavar="START", help="a packing to start from, or a flow file that goes on"
    )
    parser.add_argument("--rate", type=float, metavar="R", help="shear rate γ̇")
    parser.add_argument("--strain", type=float, required=True, metavar="S", help="how far to shear")
    parser.add_argument(
        "--out", metavar="FILE", help="result file (default for a flow file that goes on: itself)"
    )
    add_disks(parser).add_argument(
        "--walls", action="store_true", default=None, help="between sliding rough walls, rows of disks"
    )
    model = parser.add_argument_group("model")
    model.add_argument("--model", choices=MODELS, help="drag (RD) or contact damping (CD); 0: overdamped")
    model.add_argument("--mass", type=float, metavar="M", help="mass of every disk")
    model.add_argument("--quality", type=float, metavar="Q", help="Q = √(m k)/(k τ₁), instead of --mass")
    model.add_argument(
        "--friction", type=float, metavar="D", help="drag δ beside contact damping (default: its limit zero)"
    )
    add_law(parser, None)
    run_ = parser.add_argument_group("run")
    run_.add_argument(
        "--discard", type=float, metavar="S", help="strain before the means (default 1, at most half)"
    )
    run_.add_argument(
        "--snapshots",
        type=int,
        metavar="K",
        help="states to keep, evenly after --discard (0: also the start); a run that goes on keeps the spacing",
    )
    run_.add_argument(
        "--snapshot-every", type=float, metavar="S", help="strain between them, instead of --snapshots"
    )
    run_.add_argument(
        "--snapshot-spacing",
        choices=("even", "log"),
        help="log: K states at strains since --discard that grow by a factor, for mean square displacements",
    )
    run_.add_argument("--step", type=float, metavar="DT", help="time step (default: what suits the model)")
    run_.add_argument(
        "--tolerance", type=float, metavar="T", help="of the velocities of contact damping (default 1e-4)"
    )
    run_.add_argument("--last", metavar="FILE", help="write the last state as a packing, too")
    parser.set_defaults(run=run, check=check, takes_petsc=_may_solve)


def _may_solve(args):
    """Whether the run may have velocities to solve for, so that PETSc has something to do."""
    from jampetsc.contacts.laws import damping_law

    return args.model not in ("RD0", "RD") and (args.law is None or damping_law(args.law).damps_contacts)


def check(args):
    """Raises InputError for words of a flow that begins, whatever its packing holds."""
    _check(args)
    check_start(args)
    if args.rate is None:
        raise InputError("--rate is missing: how fast to shear?")
    model_from(args)


def run(args, petsc_argv) -> int:
    """Shear and write. Collective."""
    from jampetsc import launcher, session, streams
    from jampetsc.collective import by_rank_0

    _check(args)
    running = None
    if _may_solve(args) and (petsc_argv or launcher.several()):
        running = session.start("real", petsc_argv)
        if running.size == 1 and not petsc_argv:  # a rank that works alone
            running = None
    comm = running and running.comm
    from jampetsc.flows import job as jobs
    from jampetsc.storage.outputs import check_output, check_place, is_same

    if args.start is not None and by_rank_0(comm, lambda: jobs.is_flow(args.start)):
        _refuse_settled(args)
        job = by_rank_0(comm, lambda: jobs.continued(args.start, args.strain, args.out))
        inputs = [args.start]
    else:
        inputs = [*filter(None, (args.start, args.radii))]
        job = _fresh(args, jobs, comm, inputs)
    if job.before and is_same(job.out, args.start):  # a flow file may go on in its own place
        by_rank_0(comm, lambda: check_place(job.out, jobs.FORMAT))
    else:
        by_rank_0(comm, lambda: check_output(job.out, jobs.FORMAT, inputs))
    if args.last is not None:
        by_rank_0(comm, lambda: check_output(args.last, "jampetsc-packing", inputs, [job.out]))
    if launcher.several() and running is None:
        streams.say(
            f"jampetsc: note: {job.model} has nothing to solve for: one rank does it; independent runs use more\n"
        )
    means = jobs.execute(job, args.last, _together(job, running))
    if running is None or running.rank == 0:
        print(jobs.summary(job, means))
    return 0


def _together(job, running):
    """What finds velocities with PETSc where it was started. Raises InputError where there is nothing to find."""
    if running is None:
        return None
    if not job.solves:
        raise InputError(
            f"{job.model} by {job.scheme.method}: has nothing to solve for: leave PETSc's options and mpirun out"
        )
    from jampetsc.flows.together import Together
    from jampetsc.solvers import resistance
    from jampetsc.solvers.rehearsal import rehearse

    rehearse(resistance.rehearse)
    return Together(resistance.ContactSolver(job.scheme.tolerance))


def _fresh(args, jobs, comm, inputs):
    """The job of the words, from its beginning."""
    from jampetsc.collective import by_rank_0
    from jampetsc.storage.outputs import check_output

    check(args)
    if args.out is None:
        raise InputError("--out is missing: where to write the result?")
    by_rank_0(comm, lambda: check_output(args.out, jobs.FORMAT, inputs))
    disks, origin = start_of(args, comm)
    return jobs.fresh(
        disks,
        origin,
        model_from(args, disks.potential.k),
        args.rate,
        args.strain,
        args.out,
        discard=args.discard,
        snapshots=args.snapshots or 0,
        every=args.snapshot_every,
        spacing=args.snapshot_spacing or "even",
        step=args.step,
        tolerance=args.tolerance or 1e-4,
    )


def _check(args):
    """Raise InputError for numbers out of range."""
    from math import isfinite

    for name in ("rate", "strain", "step", "tolerance", "snapshot_every"):
        value = getattr(args, name)
        if value is not None and not (isfinite(value) and value > 0):
            raise InputError(f"--{name.replace('_', '-')} {value:g}: must be positive")
    if args.snapshot_every is not None and (args.snapshots is not None or args.snapshot_spacing == "log"):
        raise InputError("--snapshot-every: leave out --snapshots and --snapshot-spacing log")
    if args.snapshot_spacing is not None and not args.snapshots:
        raise InputError("--snapshot-spacing: how many? give --snapshots")
    if args.rate is not None and args.rate > 1:
        raise InputError(f"--rate {args.rate:g}: must be at most 1, a strain of one per unit of time")
    if args.discard is not None and not 0 <= args.discard < args.strain:
        raise InputError(f"--discard {args.discard:g}: must lie in [0, --strain)")
    if args.snapshots is not None and args.snapshots < 0:
        raise InputError(f"--snapshots {args.snapshots}: must not be negative")
    if args.tolerance is not None and not 1e-14 <= args.tolerance <= 0.1:
        raise InputError(f"--tolerance {args.tolerance:g}: must lie in [1e-14, 0.1]")


def _refuse_settled(args):
    """A flow file has its settings: InputError for words that would change them."""
    kept = (
        "start",
        "strain",
        "out",
        "last",
        "overwrite",
        "quiet",
        "tau1",
        "command",
        "run",
        "check",
        "takes_petsc",
    )
    for name, value in vars(args).items():
        if name not in kept and value is not None:
            raise InputError(
                f"--{name.replace('_', '-')}: {args.start} goes on as it was begun; leave it out (or start anew)"
            )
