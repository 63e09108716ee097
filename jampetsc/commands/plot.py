"""`jampetsc plot`: pictures of sweeps, packings and displacement fields. Needs neither PETSc nor MPI."""

from jampetsc.errors import InputError
from jampetsc.jobs.kinds import PHASES
from jampetsc.words.pictures import PICTURES, choose, of_studies, open_files

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
  jampetsc plot modes.h5 --mode 1,2,5 --out modes.png            on the packing"""
AGAIN = True


def add_parser(subparsers):
    """Add `plot` to the command line."""
    parser = subparsers.add_parser(
        "plot", help="draw sweeps, packings and displacement fields", description=DESCRIPTION, epilog=EPILOG
    )
    parser.add_argument(
        "files", nargs="+", metavar="FILE", help="sweeps, or one packing, or the folder of a study"
    )
    parser.add_argument("--out", required=True, metavar="FILE", help="picture to write: .png, .pdf or .svg")
    parser.add_argument(
        "--kind",
        choices=PICTURES,
        help="what to draw (default: follows from the files and options)",
    )
    parser.add_argument(
        "--where",
        metavar="COLUMN=VALUE,…",
        help="of the folder of a study: the files whose rows in its table have these values",
    )
    parser.add_argument(
        "--statistic",
        choices=("mean", "median"),
        help="moduli, storage, loss, collapse of a study: what is drawn of its packings (default mean)",
    )
    parser.add_argument("--mu", type=float, metavar="MU", help="collapse: moduli over p^MU (default 0.5)")
    parser.add_argument(
        "--lambda",
        type=float,
        metavar="LAMBDA",
        help="collapse: frequency over p^LAMBDA (default 1; 0 leaves it)",
    )
    parser.add_argument(
        "--size-power", type=float, metavar="A", help="finite-size: eta0 over N^A against pN^2 (default 1)"
    )
    parser.add_argument(
        "--log-exponent",
        type=float,
        metavar="B",
        help="length: collapse of l (-ln p)^B against omega/p^(1/2) (default 0.65, as BT have it)",
    )
    parser.add_argument(
        "--omega",
        metavar="w1,w2,…",
        help="fields: at these frequencies (default: up to four); correlation: one at which to compare files",
    )
    parser.add_argument(
        "--packing", metavar="FILE", help="fields, response, mode: the packing, if it is not beside the file"
    )
    parser.add_argument(
        "--phase",
        choices=PHASES,
        help="fields: when the stress is at its peak and when it is zero (default, as BT Fig. 1), or in phase with the "
        "strain and with its rate",
    )
    parser.add_argument(
        "--total",
        action="store_true",
        default=None,
        help="fields: with the affine part, about the middle of the cell",
    )
    parser.add_argument("--mode", metavar="i,j,…", help="draw these modes, counted from 1, on the packing")
    parser.set_defaults(run=run)


def run(args, petsc_argv):
    """Draw the picture and print what it shows; returns 0. Raises InputError."""
    from jampetsc.plots.style import check_picture
    from jampetsc.words.files import refuse_repeated

    kinds = _asked_kinds(args)
    files, args.average = of_studies(args.files, kinds, args.where)
    check_picture(args.out, [*files, *filter(None, [args.packing])])
    held, items, kinds = open_files(files, kinds)
    kind = choose(kinds, held, files)
    refuse_repeated(files)
    print(f"{args.out}: {PICTURES[kind].draw(args, items)}")
    return 0


def _asked_kinds(args):
    """The kinds that --kind and the other options leave. Raises InputError if they leave none."""
    kinds = [args.kind] if args.kind else list(PICTURES)
    for option in dict.fromkeys(option for picture in PICTURES.values() for option in picture.options):
        value = getattr(args, option)
        if value is None:
            continue
        left = [kind for kind in kinds if option in PICTURES[kind].options]
        if not left:
            meant = [kind for kind, picture in PICTURES.items() if option in picture.options]
            raise InputError(
                f"--{option.replace('_', '-')} {value}: belongs to {' or '.join(meant)} pictures, "
                f"not to {' or '.join(kinds)}: leave it out"
            )
        kinds = left
    return kinds
