"""Pictures of packings and of their linear response: moduli, fields, spectra, correlations, floppy motion, modes."""

from collections import Counter

from jampetsc.errors import InputError
from jampetsc.jobs.kinds import PHASES
from jampetsc.words.picture import Picture, count, entering, within

PICTURES: dict[str, Picture] = {}
picture = entering(PICTURES)


@picture("moduli", "sweep", options=("statistic",))
def _moduli(args, items):
    from jampetsc.plots.curves import curve_of
    from jampetsc.plots.moduli import plot_moduli

    curves, band, text = _averaged(args, [curve_of(item) for item in items])
    plot_moduli(curves, args.out, band)
    return f"G' and G'' of {count(items)}{text}"


@picture("storage", "sweep", options=("statistic",))
def _storage(args, items):
    return _one_modulus(args, items, "STORAGE", "G'")


@picture("loss", "sweep", options=("statistic",))
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
    """(curves, what their bands are, words): the means or medians of an ensemble where a study is drawn."""
    if not args.average and args.statistic:
        raise InputError(
            f"--statistic {args.statistic}: is taken over the packings of a study: give its folder"
        )
    if not args.average:
        return curves, "", ""
    from jampetsc.analysis.statistics import few_words
    from jampetsc.plots.averages import BANDS, average_curves

    statistic = args.statistic or "mean"
    averages = average_curves(curves, statistic)
    fewest = min(Counter(str(curve.description) for curve in curves).values())
    negative = sum(bool((curve.G.real < 0).any()) for curve in curves)
    below = f"; G' < 0 somewhere in {negative} of them, which count like the others" if negative else ""
    words = {"mean": "arithmetic means", "median": "medians"}[statistic]
    band = BANDS[statistic] + (f"\n$G$\u2032 < 0 in {negative} of {len(curves)}" if negative else "")
    return averages, band, f", {words} over packings with errors{below}{few_words(fewest, 'packing')}"


@picture("collapse", "sweep", options=("mu", "lambda", "statistic"))
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


@picture("fields", "sweep", options=("omega", "packing", "phase", "total"), single=True)
def _fields(args, items):
    import numpy as np

    from jampetsc.plots.fields import plot_fields
    from jampetsc.plots.periodic import wrap
    from jampetsc.storage.fields import chosen_frequencies, field_at, packing_of, particle_rows, phase_factor
    from jampetsc.words.frequencies import parse_omega

    (sweep,) = items
    fields = sweep.fields
    rows = chosen_frequencies(sweep, None if args.omega is None else parse_omega(args.omega))
    disks = packing_of(sweep, args.packing)
    particles = particle_rows(sweep, disks)
    omega = fields.omega[rows] * float(sweep.attributes.get("tau1", 1.0))
    phase = args.phase or PHASES[0]
    affine = np.zeros((len(particles), 2))
    if args.total:  # u_x = γ y, y from the middle of the cell
        affine[:, 0] = wrap(disks.positions, disks.cell)[particles, 1] - 0.5 * disks.cell[1, 1]
    turns = [phase_factor(sweep, fields.omega[row], phase) for row in rows]
    found = [field_at(sweep, row) for row in rows]
    displacement = [turn * (affine + field) for turn, (field, _) in zip(turns, found, strict=True)]
    rotation = None
    if fields.rotation is not None:
        rotation = [turn * spin for turn, (_, spin) in zip(turns, found, strict=True)]
    symbol = "u" if args.total else r"\tilde u"
    plot_fields(disks, omega, displacement, rotation, particles, args.out, phase, symbol)
    kind = "total" if args.total else "non-affine"
    told = ", ".join(f"{w:g}" for w in omega)
    return f"{kind} displacement fields at omega tau1 = {told}, in phase with the {phase}"


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

    curves = _of_one_phase(items, [correlation_curve(item) for item in items])
    wanted = None if args.omega is None else parse_omega(args.omega)
    if len(curves) == 1 and (wanted is None or len(wanted) > 1):
        curve = curves[0] if wanted is None else curves[0].at(curves[0].rows(wanted))
        plot_correlation(curve, args.out)
        return f"correlation at {len(curve.omega)} frequencies, in phase with the {curve.phase}"
    omega = [curves[0].omega.min()] if wanted is None else wanted
    plot_comparison(curves, omega, args.out)
    told = ", ".join(f"{w:g}" for w in omega)
    return f"correlation in {count(items, 'file', 'files')} at omega tau1 = {told}, in phase with the {curves[0].phase}"


def _of_one_phase(items, curves):
    """The curves, their roots comparable. Raises InputError where real parts are in phase with different things."""
    for item, curve in zip(items, curves, strict=True):
        if curve.phase != curves[0].phase:
            raise InputError(
                f"{item.path}: in phase with the {curve.phase}, {curves[0].name} with the {curves[0].phase}: "
                "choose one (of a study with --where phase=stress)"
            )
    return curves


@picture("length", "correlation", options=("log_exponent",))
def _length(args, items):
    from jampetsc.analysis.correlations import LOG_EXPONENT, length_spread, medium_collapse, stokes_collapse
    from jampetsc.plots.correlation import correlation_curve, plot_lengths

    curves = _of_one_phase(items, [correlation_curve(item) for item in items])
    exponent = within(args, "log_exponent", -10, 10, LOG_EXPONENT)
    plot_lengths(curves, args.out, exponent)
    text = f"correlation lengths of {count(items, 'file', 'files')}, in phase with the {curves[0].phase}"
    try:
        printed = [(c.omega, c.G, c.size, c.pressure, exponent) for c in curves]
        text += (
            f"; l (-ln p)^{exponent:g} differs by {100 * length_spread(printed, stokes_collapse):.2g} % (rms)"
        )
        text += " at equal omega/p^(1/2)"
        if all(c.modulus is not None for c in curves):
            medium = length_spread([(c.omega, c.G, c.size, c.modulus) for c in curves], medium_collapse)
            text += f", l by {100 * medium:.2g} % at equal |G*|/omega"
    except InputError:  # one file, or files that share no scaled frequency
        pass
    return text


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


@picture("exponents", "sweep", "quasistatic")
def _exponents(args, items):
    from jampetsc.plots.curves import curve_of
    from jampetsc.plots.exponents import plot_exponents, plot_pressure_exponents

    if items[0].format.endswith("sweep"):
        plot_exponents([curve_of(item) for item in items], args.out)
        return f"local exponents of G* against omega of {count(items)}"
    plot_pressure_exponents(items, args.out)
    return f"local exponents of G0, eta0 and omega* against p of {count(items, 'file', 'files')}{_unstable(items)}"


def _unstable(items):
    """How many of the files have G₀ < 0 under pre-stress, in words."""
    negative = sum(item.attributes["G0"] < 0 for item in items if item.attributes["prestress"])
    return f"; G0 < 0 in {negative} of them, which count like the others" if negative else ""


@picture("finite-size", "quasistatic", options=("size_power",))
def _finite_size(args, items):
    from jampetsc.plots.finite_size import POWER, plot_finite_size

    power = within(args, "size_power", 0, 10, POWER)
    plot_finite_size(items, args.out, power)
    return f"eta0/N^{power:g} against pN^2 of {count(items, 'file', 'files')}{_unstable(items)}"


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


@picture("lowest-modes", "modes")
def _lowest_modes(args, items):
    from jampetsc.plots.lowmodes import plot_lowest

    plot_lowest(items, args.out)
    return f"what the lowest modes carry of slow shear, of {count(items, 'packing', 'packings')}"


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
