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

A run that was killed goes on when the same command is given again. Many disks use several cores, with the same result
to the last bit; independent runs are faster side by side."""


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
        help="states to keep, evenly after --discard (0: also the start)",
    )
    run_.add_argument("--step", type=float, metavar="DT", help="time step (default: what suits the model)")
    run_.add_argument(
        "--tolerance", type=float, metavar="T", help="of the velocities of contact damping (default 1e-4)"
    )
    run_.add_argument("--last", metavar="FILE", help="write the last state as a packing, too")
    run_.add_argument(
        "--threads", type=int, metavar="T", help="at most so many (default: the cores there are)"
    )
    parser.set_defaults(run=run, check=check)


def check(args):
    """Raises InputError for words of a flow that begins, whatever its packing holds."""
    _check(args)
    check_start(args)
    if args.rate is None:
        raise InputError("--rate is missing: how fast to shear?")
    model_from(args)


def run(args, petsc_argv) -> int:
    """Shear and write."""
    from jampetsc import launcher, streams
    from jampetsc.contacts.threads import Team, cores

    _check(args)
    from jampetsc.flows import job as jobs
    from jampetsc.storage.outputs import check_output, check_place, is_same

    if args.start is not None and jobs.is_flow(args.start):
        _refuse_settled(args)
        job = jobs.continued(args.start, args.strain, args.out)
        inputs = [args.start]
    else:
        inputs = [*filter(None, (args.start, args.radii))]
        job = _fresh(args, jobs, inputs)
    if job.before and is_same(job.out, args.start):  # a flow file may go on in its own place
        check_place(job.out, jobs.FORMAT)
    else:
        check_output(job.out, jobs.FORMAT, inputs)
    if args.last is not None:
        check_output(args.last, "jampetsc-packing", inputs, [job.out])
    if launcher.several():
        streams.say(
            "jampetsc: note: one rank does one flow, with --threads; independent runs use more ranks\n"
        )
    print(jobs.summary(job, jobs.execute(job, args.last, Team(args.threads or cores()))))
    return 0


def _fresh(args, jobs, inputs):
    """The job of the words, from its beginning."""
    from jampetsc.storage.outputs import check_output

    check(args)
    if args.out is None:
        raise InputError("--out is missing: where to write the result?")
    check_output(args.out, jobs.FORMAT, inputs)
    disks, origin = start_of(args)
    return jobs.fresh(
        disks,
        origin,
        model_from(args, disks.potential.k),
        args.rate,
        args.strain,
        args.out,
        discard=args.discard,
        snapshots=args.snapshots or 0,
        step=args.step,
        tolerance=args.tolerance or 1e-4,
    )


def _check(args):
    """Raise InputError for numbers out of range."""
    from math import isfinite

    for name in ("rate", "strain", "step", "tolerance"):
        value = getattr(args, name)
        if value is not None and not (isfinite(value) and value > 0):
            raise InputError(f"--{name} {value:g}: must be positive")
    if args.rate is not None and args.rate > 1:
        raise InputError(f"--rate {args.rate:g}: must be at most 1, a strain of one per unit of time")
    if args.discard is not None and not 0 <= args.discard < args.strain:
        raise InputError(f"--discard {args.discard:g}: must lie in [0, --strain)")
    if args.threads is not None and args.threads < 1:
        raise InputError(f"--threads {args.threads}: must be at least 1")
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
        "threads",
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
