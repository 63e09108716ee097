"""`jampetsc shear`: quasistatic shear, the energy's minimum after every small step of strain."""

from jampetsc.errors import InputError
from jampetsc.words.flowing import add_disks, check_start, start_of

MOST = 1e8  # steps
EPILOG = """examples
  jampetsc shear --n 64 --phi 0.845 --step 1e-3 --strain 8 --out qs.h5
  jampetsc shear packing.h5 --step 1e-3 --strain 1 --out qs.h5

A run that was killed goes on when the same command is given again. Options of the Newton steps of its quenches have the
prefix -newton_."""


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "shear",
        help="quasistatic shear: affine step, minimise, repeat",
        description="Shear soft disks in small affine steps, each followed to the minimum of the energy (Vågberg 4.7).",
        epilog=EPILOG,
    )
    parser.add_argument("start", nargs="?", metavar="START", help="a packing to start from")
    parser.add_argument(
        "--step", type=float, required=True, metavar="DG", help="strain of one step, at most 0.1"
    )
    parser.add_argument("--strain", type=float, required=True, metavar="S", help="how far to shear")
    parser.add_argument("--out", required=True, metavar="FILE", help="result file")
    add_disks(parser)
    run_ = parser.add_argument_group("run")
    run_.add_argument(
        "--discard", type=float, metavar="S", help="strain before the means (default 1, at most half)"
    )
    run_.add_argument(
        "--tolerance", type=float, default=1e-6, metavar="T", help="max|F|/(p d) of a minimum (default 1e-6)"
    )
    run_.add_argument("--last", metavar="FILE", help="write the last state as a packing, too")
    run_.add_argument(
        "--threads", type=int, metavar="T", help="of quenches, at most (default: the cores there are)"
    )
    parser.set_defaults(run=run, check=check, takes_petsc=lambda args: True)


def run(args, petsc_argv) -> int:
    """Shear and write."""
    from jampetsc import session
    from jampetsc.storage.outputs import check_output

    check(args)
    inputs = [*filter(None, (args.start, args.radii))]
    check_output(args.out, "jampetsc-shear", inputs)
    if args.last is not None:
        check_output(args.last, "jampetsc-packing", inputs, [args.out])
    running = session.start("real", petsc_argv)
    if running.size > 1:
        raise InputError(f"shear on {running.size} ranks: one run is one process; `jampetsc study` runs many")
    from jampetsc.flows import slowjob
    from jampetsc.solvers import local
    from jampetsc.solvers.rehearsal import rehearse

    rehearse(local.rehearse)
    disks, origin = start_of(args)
    print(slowjob.run(args, disks, origin, local.NewtonSolver()))
    return 0


def check(args):
    """Raise InputError for numbers out of range."""
    check_start(args)
    if args.threads is not None and args.threads < 1:
        raise InputError(f"--threads {args.threads}: must be at least 1")
    if not 0 < args.step <= 0.1:
        raise InputError(f"--step {args.step:g}: must lie in (0, 0.1]")
    if not args.step <= args.strain <= 1e4:
        raise InputError(f"--strain {args.strain:g}: must lie in [--step, 1e4]")
    if args.strain / args.step > MOST:
        raise InputError(
            f"--step {args.step:g}: {args.strain / args.step:.2g} steps, at most {MOST:.0e}: give a larger one"
        )
    if args.discard is not None and not 0 <= args.discard < args.strain:
        raise InputError(f"--discard {args.discard:g}: must lie in [0, --strain)")
    if not 1e-13 <= args.tolerance <= 1e-2:
        raise InputError(f"--tolerance {args.tolerance:g}: must lie in [1e-13, 1e-2]")
