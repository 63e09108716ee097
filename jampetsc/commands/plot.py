"""`jampetsc plot`: pictures of sweeps, packings and displacement fields. Needs neither PETSc nor MPI."""

from jampetsc.errors import InputError

DESCRIPTION = """\
Draw what the files hold: G' and G'' of one or many sweeps, their scaling collapse, relaxation spectra with
stress relaxation and creep, correlations of displacements and their length, a packing with its contacts and
forces, displacement fields of a sweep, quasistatic responses, or modes. Frequencies are shown in 1/τ₁,
moduli and pressures in k."""
EPILOG = """\
examples:
  jampetsc plot p1e-2.h5 p1e-3.h5 p1e-4.h5 --out moduli.png      G', G'' of three sweeps
  jampetsc plot p1e-2.h5 p1e-3.h5 p1e-4.h5 --kind collapse --out collapse.pdf
  jampetsc plot packing.h5 --out packing.svg
  jampetsc plot sweep.h5 --kind fields --omega 1e-6,1e-3,1 --out fields.png
  jampetsc plot correlation.h5 --out correlation.png             C(delta) at all its frequencies
  jampetsc plot stokes.h5 contact.h5 --omega 1e-3 --out compared.png
  jampetsc plot p1e-2.h5 p1e-3.h5 --kind length --out length.png  of correlations
  jampetsc plot q-p*.h5 --kind medians --out medians.png         of quasistatic files
  jampetsc plot modes.h5 --mode 1,2,5 --out modes.png            on the packing"""

KINDS = {  # what can be drawn -> of which files; the first that suits a file is what it shows by itself
    "moduli": ("sweep",),
    "collapse": ("sweep",),
    "fields": ("sweep",),
    "packing": ("packing",),
    "spectrum": ("spectrum", "sweep"),
    "correlation": ("correlation",),
    "length": ("correlation",),
    "medians": ("quasistatic",),
    "viscosities": ("quasistatic",),
    "response": ("quasistatic",),
    "modes": ("modes",),
    "mode": ("modes",),
    "states": ("modes",),
}
OPTIONS = {  # option -> the pictures it is for
    "mu": ("collapse",),
    "lambda": ("collapse",),
    "log_exponent": ("length",),
    "omega": ("fields", "correlation"),
    "packing": ("fields", "response", "mode"),
    "mode": ("mode",),
}


def add_parser(subparsers):
    """Add `plot` to the command line."""
    parser = subparsers.add_parser(
        "plot", help="draw sweeps, packings and displacement fields", description=DESCRIPTION, epilog=EPILOG
    )
    parser.add_argument("files", nargs="+", metavar="FILE", help="sweeps, or one packing")
    parser.add_argument("--out", required=True, metavar="FILE", help="picture to write: .png, .pdf or .svg")
    parser.add_argument(
        "--kind",
        choices=KINDS,
        help="what to draw (default: follows from the files and options)",
    )
    parser.add_argument("--mu", type=float, metavar="MU", help="collapse: moduli over p^MU (default 0.5)")
    parser.add_argument(
        "--lambda", type=float, metavar="LAMBDA", help="collapse: frequency over p^LAMBDA (default 1)"
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
    parser.add_argument("--mode", metavar="i,j,…", help="draw these modes, counted from 1, on the packing")
    parser.set_defaults(run=run)


def run(args, petsc_argv):
    """Draw the picture and print what it shows; returns 0. Raises InputError."""
    from jampetsc.plots.sources import open_files
    from jampetsc.plots.style import check_picture

    kinds = _asked_kinds(args)
    check_picture(args.out, [*args.files, *filter(None, [args.packing])])
    held, items = open_files(args.files)
    kind = next((name for name in kinds if held in KINDS[name]), kinds[0])
    if held not in KINDS[kind]:
        needed = {"packing": "a packing", "spectrum": "spectra or sweeps"}.get(kind, f"{KINDS[kind][0]}s")
        raise InputError(f"{args.files[0]}: is a {held} file: {kind} pictures need {needed}")
    if kind in ("fields", "response", "mode") and len(items) > 1:
        raise InputError(f"{len(items)} {held} files: {kind} pictures show one; plot them one by one")
    draw = {
        "moduli": _moduli,
        "collapse": _collapse,
        "fields": _fields,
        "packing": _packing,
        "spectrum": _spectrum,
        "correlation": _correlation,
        "length": _length,
        "medians": _medians,
        "viscosities": _viscosities,
        "response": _response,
        "modes": _modes,
        "mode": _mode,
        "states": _states,
    }[kind]
    shown = draw(args, items)
    print(f"{args.out}: {shown}")
    return 0


def _asked_kinds(args):
    """The kinds that --kind and the other options leave. Raises InputError if they leave none."""
    kinds = [args.kind] if args.kind else list(KINDS)
    for option, meant in OPTIONS.items():
        value = getattr(args, option)
        if value is None:
            continue
        left = [kind for kind in kinds if kind in meant]
        if not left:
            raise InputError(
                f"--{option.replace('_', '-')} {value}: belongs to {' or '.join(meant)} pictures, "
                f"not to {' or '.join(kinds)}: leave it out"
            )
        if "collapse" in left and not 0 < value < 10:
            raise InputError(f"--{option} {value:g}: must lie between 0 and 10")
        if "length" in left and not abs(value) < 10:
            raise InputError(f"--log-exponent {value:g}: must lie between -10 and 10")
        kinds = left
    return kinds


def _packing(args, items):
    from jampetsc.plots.packing import plot_packing

    plot_packing(items[0], args.out)
    return f"packing of {items[0].n} disks"


def _moduli(args, items):
    from jampetsc.plots.curves import curve_of
    from jampetsc.plots.moduli import plot_moduli

    plot_moduli([curve_of(item) for item in items], args.out)
    return f"G' and G'' of {_count(items)}"


def _collapse(args, items):
    from jampetsc.analysis.scaling import LAMBDA, MU, collapse_spread
    from jampetsc.plots.curves import curve_of
    from jampetsc.plots.moduli import plot_collapse

    mu, lam = (
        default if value is None else value
        for value, default in ((args.mu, MU), (vars(args)["lambda"], LAMBDA))
    )
    curves = [curve_of(item) for item in items]
    plot_collapse(curves, args.out, mu, lam)
    text = f"collapse of {_count(items)} with mu = {mu:g}, lambda = {lam:g}"
    try:
        spread = collapse_spread([(c.omega, c.G, c.pressure) for c in curves], mu, lam)
    except InputError:  # one sweep, or sweeps that share no scaled frequency: there is no spread to tell
        return text
    return f"{text}; they differ by {100 * spread:.2g} % (rms) below omega tau1 = 0.1"


def _fields(args, items):
    from jampetsc.plots.fields import plot_fields
    from jampetsc.storage.fields import chosen_frequencies, field_at, packing_of, particle_rows
    from jampetsc.words.frequencies import parse_omega

    (sweep,) = items
    fields = sweep.fields
    rows = chosen_frequencies(sweep, None if args.omega is None else parse_omega(args.omega))
    disks = packing_of(sweep, args.packing)
    particles = particle_rows(sweep, disks)
    omega = fields.omega[rows] * float(sweep.attributes.get("tau1", 1.0))
    displacement, rotation = zip(*(field_at(sweep, row) for row in rows), strict=True)
    rotation = None if fields.rotation is None else rotation
    plot_fields(disks, omega, displacement, rotation, particles, args.out)
    return f"displacement fields at omega tau1 = {', '.join(f'{w:g}' for w in omega)}"


def _spectrum(args, items):
    from jampetsc.plots.spectrum import plot_relaxation, spectrum_curve

    plot_relaxation([spectrum_curve(item) for item in items], args.out)
    return f"relaxation spectrum, G(t) and J(t) of {_count(items, 'spectrum', 'spectra')}"


def _correlation(args, items):
    from jampetsc.plots.correlation import correlation_curve, plot_comparison, plot_correlation
    from jampetsc.words.frequencies import parse_omega

    curves = [correlation_curve(item) for item in items]
    wanted = None if args.omega is None else parse_omega(args.omega)
    if wanted is not None and len(wanted) > 1:
        raise InputError(f"--omega {args.omega}: correlations are compared at one frequency")
    if len(curves) == 1 and wanted is None:
        plot_correlation(curves[0], args.out)
        return f"correlation at {len(curves[0].omega)} frequencies"
    omega = curves[0].omega.min() if wanted is None else wanted[0]
    plot_comparison(curves, omega, args.out)
    return f"correlation in {_count(items, 'file', 'files')} at omega tau1 = {omega:g}"


def _length(args, items):
    from jampetsc.analysis.correlations import LOG_EXPONENT, length_spread
    from jampetsc.plots.correlation import correlation_curve, plot_lengths

    curves = [correlation_curve(item) for item in items]
    exponent = LOG_EXPONENT if args.log_exponent is None else args.log_exponent
    plot_lengths(curves, args.out, exponent)
    text = f"correlation lengths of {_count(items, 'file', 'files')}"
    try:
        spread = length_spread([(c.omega, c.G, c.pressure, c.size) for c in curves], exponent)
    except InputError:  # one file, or files that share no scaled frequency
        return text
    return f"{text}; l (-ln p)^{exponent:g} differs by {100 * spread:.2g} % (rms) at equal omega/p^(1/2)"


def _medians(args, items):
    from jampetsc.plots.floppy import plot_medians

    plot_medians(items, args.out)
    return f"medians of floppy motion in {_count(items, 'file', 'files')}"


def _viscosities(args, items):
    from jampetsc.plots.floppy import plot_viscosities

    plot_viscosities(items, args.out)
    return f"eta0 and eta_inf against beta of {_count(items, 'file', 'files')}"


def _response(args, items):
    from jampetsc.plots.fields import plot_panels
    from jampetsc.storage.fields import packing_of

    (result,) = items
    fields = {"no pre-stress": "no_prestress/nonaffine", "pre-stress": "nonaffine"}
    if not result.attributes["prestress"]:
        fields = {"no pre-stress": "nonaffine"}
    panels = [(title, result[name]) for title, name in fields.items()]
    disks = packing_of(result, args.packing)
    plot_panels(disks, panels, result["particles"], args.out, r"u_{\rm na}/\gamma")
    return f"quasistatic response, {' and '.join(fields)}"


def _modes(args, items):
    from jampetsc.plots.vibrations import plot_modes

    plot_modes(items, args.out)
    return f"modes of {_count(items, 'packing', 'packings')}"


def _mode(args, items):
    from jampetsc.plots.fields import plot_panels
    from jampetsc.plots.vibrations import chosen_modes
    from jampetsc.storage.fields import packing_of

    (result,) = items
    panels = chosen_modes(result, args.mode or "1")
    disks = packing_of(result, args.packing)
    plot_panels(disks, panels, result["particles"], args.out, r"\varphi")
    return f"mode {args.mode or 1}"


def _states(args, items):
    from jampetsc.plots.vibrations import plot_states

    plot_states(items, args.out)
    return f"density of states of {_count(items, 'packing', 'packings')}"


def _count(items, one="sweep", many="sweeps"):
    return f"{len(items)} {one if len(items) == 1 else many}"
