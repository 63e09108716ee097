"""`jampetsc trade`: what speed costs in accuracy, measured on the user's own packing and machine."""

from jampetsc.errors import InputError
from jampetsc.words.law import add_law_options, physics_from

DEFAULT_OMEGA = "1e-10:1e4:141"
GROUPS = ("accuracy", "method", "physics", "frequencies")
DESCRIPTION = """\
Run the choices there are for one packing, each as a sweep in processes of its own, and compare them with
the tightest certified rational sweep: time, memory, factorisations, errors of G' and of G'', critical
slopes. Writes a table (CSV) and a picture of time against error beside it (.png), and recommends settings
by stated rules.

  accuracy     --accuracy 1e-2 ... 1e-10 of the rational sweep
  method       --method direct with MUMPS and with the options files
  physics      rotations, pre-stress, Stokes drag instead of contact damping: deviation from the law given
  frequencies  few frequencies solved one by one, and interpolation between them"""
EPILOG = """\
examples:
  jampetsc trade packing.h5 --out trade.csv
  jampetsc trade packing.h5 --out trade.csv --choices accuracy,physics --ensemble --beta 0.1
  jampetsc trade packing.h5 --out trade.csv --ranks 2 --choices method --options-files mine.opts

Times mean something on a machine that does nothing else."""


def add_parser(subparsers):
    """Register the command."""
    parser = subparsers.add_parser(
        "trade", help="measure what speed costs in accuracy", description=DESCRIPTION, epilog=EPILOG
    )
    parser.add_argument("packing", metavar="PACKING", help="packing file")
    parser.add_argument(
        "--out", required=True, metavar="FILE", help="table, .csv; the picture goes beside it as .png"
    )
    parser.add_argument(
        "--choices",
        default=",".join(GROUPS),
        metavar="LIST",
        help=f"what to vary (default {','.join(GROUPS)})",
    )
    parser.add_argument(
        "--ensemble",
        action="store_true",
        help="also: one big packing against 4 of N/4 and 16 of N/16 disks, which are made for it",
    )
    parser.add_argument(
        "--omega",
        default=DEFAULT_OMEGA,
        metavar="LOW:HIGH:COUNT|LIST",
        help=f"frequencies, a logarithmic grid or a list (default {DEFAULT_OMEGA})",
    )
    parser.add_argument(
        "--ranks", type=int, metavar="N", help="run every choice under mpirun -n N (default: without mpirun)"
    )
    parser.add_argument(
        "--options-files",
        nargs="+",
        metavar="FILE",
        help="options files for --method direct (default: jampetsc:iterative, superlu_dist and low_memory)",
    )
    add_law_options(parser)
    parser.set_defaults(run=run)


def run(args, petsc_argv) -> int:
    """Measure, write both files, print table and advice. Raises JampetscError only if the reference fails."""
    from pathlib import Path

    from jampetsc.shipped_files import located
    from jampetsc.speed_accuracy.measure import Request, measure

    groups = _groups(args.choices)
    out = Path(args.out)
    if out.suffix.lower() != ".csv":
        raise InputError(f"--out {args.out}: give it the ending .csv; the picture gets .png")
    if args.ranks is not None and not 1 <= args.ranks <= 100_000:
        raise InputError(f"--ranks {args.ranks}: must be 1 or more")
    options_files = args.options_files and [located(name) for name in args.options_files]
    for path in options_files or ():
        if not Path(path).is_file():
            raise InputError(f"--options-files {path}: no such file")
    request = Request(
        packing=args.packing,
        physics=physics_from(args),
        omega=args.omega,
        ranks=args.ranks,
        groups=groups,
        ensemble=args.ensemble,
        options_files=options_files,
    )
    print(measure(request, out))
    return 0


def _groups(text):
    words = text.split(",")
    for word in words:
        if word not in GROUPS:
            raise InputError(f"--choices {text}: {word!r} is none of {', '.join(GROUPS)}")
    return words
