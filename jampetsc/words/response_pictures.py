"""Pictures of packings and of their linear response: moduli, fields, spectra, correlations, floppy motion, modes."""

from collections import Counter

from jampetsc.errors import InputError
from jampetsc.words.picture import Picture, count, entering, within

PICTURES: dict[str, Picture] = {}
picture = entering(PICTURES)


@picture("moduli", "sweep")
def _moduli(args, items):
    from jampetsc.plots.curves import curve_of
    from jampetsc.plots.moduli import plot_moduli

    curves, band, text = _averaged(args, [curve_of(item) for item in items])
    plot_moduli(curves, args.out, band)
    return f"G' and G'' of {count(items)}{text}"


@picture("storage", "sweep")
def _storage(args, items):
    return _one_modulus(args, items, "STORAGE", "G'")


@picture("loss", "sweep")
def _loss(args, items):
    return _one_modulus(args, items, "LOSS", "G''")


def _one_modulus(args, items, part, words):
    from jampetsc.plots import style
    from jampetsc.plots.curves import curve_of
    from jampetsc.plots.moduli import plot_moduli

    curves, band, text = _averaged(args, [curve_of(item) for item in items])
    plot_moduli(curves, args.out, band, (getattr(style, part),))
    return f"{words} of {count(items)}{text}"


def _averaged(args, curves):
    """(curves, what their bands are, words): the means of an ensemble where a study is drawn."""
    if not args.average:
        return curves, "", ""
    from jampetsc.analysis.statistics import few_words
    from jampetsc.plots.averages import BAND, average_curves

    averages = average_curves(curves)
    fewest = min(Counter(str(curve.description) for curve in curves).values())
    negative = sum(bool((curve.G.real < 0).any()) for curve in curves)
    below = f"; G' < 0 somewhere in {negative} of them, which count like the others" if negative else ""
    return (
        averages,
        BAND,
        f", arithmetic means over packings with errors{below}{few_words(fewest, 'packing')}",
    )


@picture("collapse", "sweep", options=("mu", "lambda"))
def _collapse(args, items):
    from jampetsc.analysis.scaling import LAMBDA, MU, collapse_spread
    from jampetsc.plots.curves import curve_of
    from jampetsc.plots.moduli import plot_collapse

    mu, lam = within(args, "mu", 0, 10, MU), within(args, "lambda", 0, 10, LAMBDA)
    curves, band, averaged = _averaged(args, [curve_of(item) for item in items])
    plot_collapse(curves, args.out, mu, lam, band)
    text = f"collapse of {count(items)} with mu = {mu:g}, lambda = {lam:g}{averaged}"
    try:
        spread = collapse_spread([(c.omega, c.G, c.pressure) for c in curves], mu, lam)
    except InputError:  # one sweep, or sweeps that share no scaled frequency: there is no spread to tell
        return text
    return f"{text}; they differ by {100 * spread:.2g} % (rms) below omega tau1 = 0.1"


@picture("fields", "sweep", options=("omega", "packing"), single=True)
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


@picture("packing", "packing", single=True)
def _packing(args, items):
    from jampetsc.plots.packing import plot_packing

    plot_packing(items[0], args.out)
    return f"packing of {items[0].n} disks"


@picture("spectrum", "spectrum", "sweep")
def _spectrum(args, items):
    from jampetsc.plots.spectrum import plot_relaxation, spectrum_curve

    plot_relaxation([spectrum_curve(item) for item in items], args.out)
    return f"relaxation spectrum, G(t) and J(t) of {count(items, 'spectrum', 'spectra')}"


@picture("correlation", "correlation", options=("omega",))
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
    return f"correlation in {count(items, 'file', 'files')} at omega tau1 = {omega:g}"


@picture("length", "correlation", options=("log_exponent",))
def _length(args, items):
    from jampetsc.analysis.correlations import LOG_EXPONENT, length_spread
    from jampetsc.plots.correlation import correlation_curve, plot_lengths

    curves = [correlation_curve(item) for item in items]
    exponent = within(args, "log_exponent", -10, 10, LOG_EXPONENT)
    plot_lengths(curves, args.out, exponent)
    text = f"correlation lengths of {count(items, 'file', 'files')}"
    try:
        spread = length_spread([(c.omega, c.G, c.pressure, c.size) for c in curves], exponent)
    except InputError:  # one file, or files that share no scaled frequency
        return text
    return f"{text}; l (-ln p)^{exponent:g} differs by {100 * spread:.2g} % (rms) at equal omega/p^(1/2)"


@picture("medians", "quasistatic")
def _medians(args, items):
    from jampetsc.plots.floppy import plot_medians

    plot_medians(items, args.out)
    return f"medians of floppy motion in {count(items, 'file', 'files')}"


@picture("viscosities", "quasistatic")
def _viscosities(args, items):
    from jampetsc.plots.floppy import plot_viscosities

    plot_viscosities(items, args.out)
    return f"eta0 and eta_inf against beta of {count(items, 'file', 'files')}"


@picture("response", "quasistatic", options=("packing",), single=True)
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


@picture("modes", "modes")
def _modes(args, items):
    from jampetsc.plots.vibrations import plot_modes

    plot_modes(items, args.out)
    return f"modes of {count(items, 'packing', 'packings')}"


@picture("mode", "modes", options=("packing", "mode"), single=True)
def _mode(args, items):
    from jampetsc.plots.fields import plot_panels
    from jampetsc.plots.vibrations import chosen_modes
    from jampetsc.storage.fields import packing_of

    (result,) = items
    panels = chosen_modes(result, args.mode or "1")
    disks = packing_of(result, args.packing)
    plot_panels(disks, panels, result["particles"], args.out, r"\varphi")
    return f"mode {args.mode or 1}"


@picture("states", "modes")
def _states(args, items):
    from jampetsc.plots.vibrations import plot_states

    plot_states(items, args.out)
    return f"density of states of {count(items, 'packing', 'packings')}"
