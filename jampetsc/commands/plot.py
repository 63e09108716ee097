"""`jampetsc plot`: pictures of sweeps, packings and displacement fields. Needs neither PETSc nor MPI."""

from jampetsc.errors import InputError

DESCRIPTION = """\
Draw what the files hold: G' and G'' of one or many sweeps, their scaling collapse, relaxation spectra with
stress relaxation and creep, correlations of displacements and their length, a packing with its contacts and
forces, displacement fields of a sweep, quasistatic responses, modes, or steady shear: series of one rate, flow
curves of several, snapshots, velocities and their correlation; quasistatic shear along the strain; the share of
samples that jam, f(phi), and their pressures, P(p). Frequencies are shown in 1/τ₁,
moduli and pressures in k."""
EPILOG = """\
examples:
  jampetsc plot p1e-2.h5 p1e-3.h5 p1e-4.h5 --out moduli.png      G', G'' of three sweeps
  jampetsc plot p1e-2.h5 p1e-3.h5 p1e-4.h5 --kind collapse --out collapse.pdf
  jampetsc plot packing.h5 --out packing.svg
  jampetsc plot sweep.h5 --kind fields --omega 1e-6,1e-3,1 --out fields.png      --total with the affine part
  jampetsc plot correlation.h5 --out correlation.png             C(delta) at all its frequencies
  jampetsc plot stokes.h5 contact.h5 --omega 1e-3 --out compared.png
  jampetsc plot p1e-2.h5 p1e-3.h5 --kind length --out length.png  of correlations
  jampetsc plot q-p*.h5 --kind medians --out medians.png         of quasistatic files
  jampetsc plot q-n*.h5 --kind finite-size --out sizes.png       eta0/N against pN^2
  jampetsc plot ensemble --kind exponents --out exponents.png    local exponents of G* and their limits
  jampetsc plot ensemble --kind collapse --out collapse.png      means over the packings of a study
  jampetsc plot ensemble --where law=stokes --out stokes.png     of those under Stokes drag
  jampetsc plot rd0-*.h5 --out flow.png                          flow curves of runs at several rates
  jampetsc plot rd0.h5 --kind snapshot --out snapshot.png        or velocities
  jampetsc plot f64.h5 f256.h5 --out f.png                       f(phi) of jam files, with errors
  jampetsc plot f64.h5 qs.h5 --kind pressures --out p.png        P(p), of quasistatic shear too
  jampetsc plot p.h5 --out collapse.png                          of `jampetsc collapse`, with residuals
  jampetsc plot modes.h5 --mode 1,2,5 --out modes.png            on the packing
  jampetsc plot rd0-*.h5 --size 7,4 --style paper.mplstyle --csv flow.csv --out flow.pdf"""


def add_parser(subparsers):
    """Add `plot` to the command line; which pictures there are it finds out when it is the command that is meant."""
    parser = subparsers.add_parser(
        "plot", help="draw sweeps, packings and displacement fields", description=DESCRIPTION, epilog=EPILOG
    )
    parser.add_argument(
        "files", nargs="+", metavar="FILE", help="sweeps, or one packing, or the folder of a study"
    )
    parser.add_argument("--out", required=True, metavar="FILE", help="picture to write: .png, .pdf or .svg")
    parser.add_argument(
        "--where",
        metavar="COLUMN=VALUE,…",
        help="of the folder of a study: the files whose rows in its table have these values",
    )
    parser.add_argument("--csv", metavar="FILE", help="write the numbers that are drawn, too: .csv")
    parser.add_argument("--size", metavar="W,H", help="width and height in inches")
    for name in ("xlim", "ylim"):
        parser.add_argument(
            f"--{name}", metavar="LOW:HIGH", help="of all panels, or with commas of each; nothing leaves one"
        )
    parser.add_argument(
        "--label",
        action="append",
        metavar="TEXT",
        help="replaces a word of the legend: give it again for the next",
    )
    parser.add_argument(
        "--style", metavar="FILE", help="style of matplotlib (.mplstyle) on top of the program's"
    )
    parser.set_defaults(run=run)
    parse = parser.parse_known_args

    def parse_known_args(*words, **more):
        _add_options_of_pictures(parser)
        parser.parse_known_args = parse
        return parse(*words, **more)

    parser.parse_known_args = parse_known_args


def _add_options_of_pictures(parser):
    from jampetsc.plots.draw import pictures

    what = "what to draw (default: follows from the files and options)"
    parser.add_argument("--kind", choices=pictures(), help=what)
    for option in dict.fromkeys(option for one in pictures().values() for option in one.options):
        words = {"help": option.help, "dest": option.name}
        words |= {"action": "store_true", "default": None} if option.type == "switch" else {
            "metavar": option.metavar, "choices": option.choices, "type": float if option.type == "number" else str
        }  # fmt: skip
        parser.add_argument("--" + option.name.replace("_", "-"), **words)


def run(args, petsc_argv):
    """Draw the picture and print what it shows; returns 0. Raises InputError."""
    from jampetsc.plots.draw import draw, pictures

    known = {option.name: option for picture in pictures().values() for option in picture.options}
    options = {name: _read(option, getattr(args, name)) for name, option in known.items()}
    chosen = {
        "size": _size(args.size), "xlim": _limits("xlim", args.xlim), "ylim": _limits("ylim", args.ylim),
        "label": args.label or (), "style": args.style,
    }  # fmt: skip
    _, drawn = draw(_given(args), args.kind, out=args.out, csv=args.csv, chosen=chosen, **options)
    print(f"{args.out}: {drawn.text}")
    return 0


def _given(args):
    """The files, of studies the rows that --where chooses."""
    from pathlib import Path

    from jampetsc.storage.ensemble import TABLE
    from jampetsc.storage.reader import load
    from jampetsc.words.files import wanted_of

    wanted = wanted_of(args.where)
    items = [
        load(path).where(**wanted) if wanted and (Path(path) / TABLE).exists() else path
        for path in args.files
    ]
    if wanted and items == args.files:
        raise InputError(
            f"--where {args.where}: chooses rows of a study, but {args.files[0]} is none: leave it out"
        )
    return items


def _read(option, word):
    """The value that an option's word means."""
    from jampetsc.words.frequencies import parse_omega

    if word is None or option.type not in ("frequencies", "integers"):
        return word
    if option.type == "frequencies":
        return parse_omega(word)
    try:
        return [int(part) for part in word.split(",")]
    except ValueError:
        raise InputError(f"--{option.name} {word}: write numbers with commas, such as 1,2,5") from None


def _size(text):
    if text is None:
        return None
    try:
        width, height = (float(word) for word in text.split(","))
    except ValueError:
        raise InputError(
            f"--size {text}: write the width and the height in inches, such as 3.4,2.9"
        ) from None
    if not (0.5 <= width <= 100 and 0.5 <= height <= 100):
        raise InputError(f"--size {text}: must be from 0.5 to 100 inches")
    return width, height


def _limits(name, text):
    if text is None:
        return None
    try:
        pairs = [tuple(float(one) for one in pair.split(":")) if pair else None for pair in text.split(",")]
    except ValueError:
        pairs = [()]
    if not all(pair is None or (len(pair) == 2 and pair[0] < pair[1]) for pair in pairs):
        raise InputError(f"--{name} {text}: write low:high, such as 1e-6:1; with commas for each panel")
    return pairs[0] if len(pairs) == 1 else pairs
