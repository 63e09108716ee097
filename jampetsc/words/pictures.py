"""What `jampetsc plot --kind` can draw: of which files each picture is, which options it takes, what it tells."""

from collections.abc import Callable
from dataclasses import dataclass

from jampetsc.errors import InputError
from jampetsc.words.files import files_named


@dataclass(frozen=True)
class Picture:
    """A kind of picture. `draw(args, items)` draws the opened files and returns what it shows, in words."""

    draw: Callable
    of: tuple[str, ...]  # what files it needs: packing, sweep, …
    options: tuple[str, ...]  # options of the command that it takes, besides --out
    single: bool  # one file at a time
    mixed: bool  # files of several of these formats at once


COMMANDS = {  # format -> the command, where they have two names
    "correlation": "correlate",
    "velocity-correlation": "correlate",
    "packing": "pack",
}
PICTURES: dict[str, Picture] = {}  # a file shows by itself the first that suits it and the options given


def picture(kind: str, *of: str, options=(), single: bool = False, mixed: bool = False):
    """Decorator that enters a function into PICTURES."""

    def enter(draw):
        PICTURES[kind] = Picture(draw, of, tuple(options), single, mixed)
        return draw

    return enter


def open_files(paths, kinds):
    """What the files hold, and the kinds that show all of it: ("packing", [Disks], […]), ….

    Raises InputError for a mixture that none of the kinds shows, and for several packings.
    """
    from jampetsc.contacts.disks import Disks
    from jampetsc.storage.reader import load

    found = [load(path) for path in paths]
    held = ["packing" if isinstance(item, Disks) else item.format.removeprefix("jampetsc-") for item in found]
    other = next((n for n, kind in enumerate(held) if kind != held[0]), None)
    together = [k for k in kinds if PICTURES[k].mixed and set(held) <= set(PICTURES[k].of)]
    if other is not None and not together:
        hint = "; the packing of a sweep goes with --packing" if "packing" in held else ""
        raise InputError(
            f"{paths[0]} is a {_noun(held[0])}, {paths[other]} a {_noun(held[other])}: "
            f"one picture shows one or the other{hint}"
        )
    if held[0] == "packing" and len(paths) > 1:
        raise InputError(f"{len(paths)} packings: one picture shows one packing; plot them one by one")
    return held[0], found, kinds if other is None else together


def of_studies(paths, kinds, where=None) -> tuple[list[str], bool]:
    """`files_named`: of the folder of a study those that one of the kinds can show. Raises InputError if none can."""

    def chosen(path, done, here):
        suited = [_shown(done, PICTURES[kind]) for kind in kinds]
        found = next((rows for rows, kind in zip(suited, kinds, strict=True) if fits(rows, kind)), None)
        if found is None:
            held = ", ".join(sorted(set(done["command"].tolist()))) or "nothing"
            what = " or ".join(kinds) if len(kinds) < len(PICTURES) else "a"
            hint = "; of those that show a single file, name the file" if any(r.rows for r in suited) else ""
            raise InputError(f"{path}: a study with {held}{here}: nothing for {what} picture{hint}")
        return found

    return files_named(paths, where, chosen)


def _shown(done, picture):
    """The rows of a study whose files a kind of picture shows: of those not `mixed` the first format that is there."""
    made = [COMMANDS.get(name, name) for name in picture.of]
    if not picture.mixed:
        made = [next((command for command in made if command in done["command"].tolist()), made[0])]
    return done.where(command=made)


def fits(rows, kind) -> bool:
    """Whether a kind of picture shows so many files."""
    return rows.rows == 1 or (rows.rows > 1 and not PICTURES[kind].single)


def choose(kinds, held: str, paths) -> str:
    """The picture to draw of files that hold this, out of those that the options leave.

    Raises InputError where none of them shows such files, or not so many.
    """
    kind = next((name for name in kinds if held in PICTURES[name].of), kinds[0])
    if held not in PICTURES[kind].of:
        needed = " or ".join(_plural(what) for what in PICTURES[kind].of)
        raise InputError(f"{paths[0]}: is a {held} file: {kind} pictures need {needed}")
    if PICTURES[kind].single and len(paths) > 1:
        raise InputError(f"{len(paths)} {held} files: {kind} pictures show one; plot them one by one")
    return kind


@picture("moduli", "sweep")
def _moduli(args, items):
    from jampetsc.plots.curves import curve_of
    from jampetsc.plots.moduli import plot_moduli

    curves, band, text = _averaged(args, [curve_of(item) for item in items])
    plot_moduli(curves, args.out, band)
    return f"G' and G'' of {_count(items)}{text}"


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
    return f"{words} of {_count(items)}{text}"


def _averaged(args, curves):
    """(curves, what their bands are, words): the means of an ensemble where a study is drawn."""
    if not args.average:
        return curves, "", ""
    from jampetsc.plots.averages import BAND, average_curves

    averages = average_curves(curves)
    negative = sum(bool((curve.G.real < 0).any()) for curve in curves)
    below = f"; G' < 0 somewhere in {negative} of them, which count like the others" if negative else ""
    return averages, BAND, f", arithmetic means over packings with bootstrap errors{below}"


@picture("collapse", "sweep", options=("mu", "lambda"))
def _collapse(args, items):
    from jampetsc.analysis.scaling import LAMBDA, MU, collapse_spread
    from jampetsc.plots.curves import curve_of
    from jampetsc.plots.moduli import plot_collapse

    mu, lam = _within(args, "mu", 0, 10, MU), _within(args, "lambda", 0, 10, LAMBDA)
    curves, band, averaged = _averaged(args, [curve_of(item) for item in items])
    plot_collapse(curves, args.out, mu, lam, band)
    text = f"collapse of {_count(items)} with mu = {mu:g}, lambda = {lam:g}{averaged}"
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
    return f"relaxation spectrum, G(t) and J(t) of {_count(items, 'spectrum', 'spectra')}"


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
    return f"correlation in {_count(items, 'file', 'files')} at omega tau1 = {omega:g}"


@picture("length", "correlation", options=("log_exponent",))
def _length(args, items):
    from jampetsc.analysis.correlations import LOG_EXPONENT, length_spread
    from jampetsc.plots.correlation import correlation_curve, plot_lengths

    curves = [correlation_curve(item) for item in items]
    exponent = _within(args, "log_exponent", -10, 10, LOG_EXPONENT)
    plot_lengths(curves, args.out, exponent)
    text = f"correlation lengths of {_count(items, 'file', 'files')}"
    try:
        spread = length_spread([(c.omega, c.G, c.pressure, c.size) for c in curves], exponent)
    except InputError:  # one file, or files that share no scaled frequency
        return text
    return f"{text}; l (-ln p)^{exponent:g} differs by {100 * spread:.2g} % (rms) at equal omega/p^(1/2)"


@picture("medians", "quasistatic")
def _medians(args, items):
    from jampetsc.plots.floppy import plot_medians

    plot_medians(items, args.out)
    return f"medians of floppy motion in {_count(items, 'file', 'files')}"


@picture("viscosities", "quasistatic")
def _viscosities(args, items):
    from jampetsc.plots.floppy import plot_viscosities

    plot_viscosities(items, args.out)
    return f"eta0 and eta_inf against beta of {_count(items, 'file', 'files')}"


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
    return f"modes of {_count(items, 'packing', 'packings')}"


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
    return f"density of states of {_count(items, 'packing', 'packings')}"


@picture("flow", "flow")
def _flow(args, items):
    from jampetsc.plots.flowcurves import plot_flow_curves
    from jampetsc.plots.shearing import plot_series

    rates = {float(item.attributes["rate"]) for item in items}
    if len(rates) > 1:
        plot_flow_curves(items, args.out)
        return f"flow curves of {_count(items, 'run', 'runs')} at {len(rates)} rates"
    plot_series(items, args.out)
    return f"stress and pressure of {_count(items, 'run', 'runs')} over the strain"


@picture("strain", "shear")
def _strain(args, items):
    from jampetsc.plots.slowly import plot_slow_shear

    plot_slow_shear(items, args.out)
    return f"energy, stress, pressure and coordination of {_count(items, 'run', 'runs')} over the strain"


@picture("phi", "flow")
def _phi(args, items):
    from jampetsc.plots.flowcurves import plot_against_phi

    plot_against_phi(items, args.out)
    return f"stress, pressure and coordination of {_count(items, 'run', 'runs')} against phi"


@picture("snapshot", "flow")
def _snapshot(args, items):
    from jampetsc.plots.packing import plot_flowing
    from jampetsc.plots.shearing import kind_of, labels_of, last_snapshot

    titles = labels_of([kind_of(item) for item in items]) if len(items) > 1 else [""]
    panels = [(title, last_snapshot(item)) for title, item in zip(titles, items, strict=True)]
    plot_flowing(panels, args.out)
    shown = [
        f"{disks.n - disks.record.get('walls', 0)} disks at strain {item['snapshots/strain'][-1]:.4g}"
        for (_, disks), item in zip(panels, items, strict=True)
    ]
    return f"contacts of {', '.join(shown)}"


@picture("minimum", "shear", single=True)
def _minimum(args, items):
    from jampetsc.plots.packing import plot_packing
    from jampetsc.plots.slowly import last_minimum

    disks = last_minimum(items[0])
    plot_packing(disks, args.out)
    return f"{disks.n} disks at strain {items[0]['strain'][-1]:.4g}"


@picture("velocities", "flow", single=True)
def _velocities(args, items):
    import numpy as np

    from jampetsc.plots.fields import plot_panels
    from jampetsc.plots.shearing import last_snapshot

    (result,) = items
    disks = last_snapshot(result)
    field = result["snapshots/velocities"][-1] / float(result.attributes["rate"])
    strain = result["snapshots/strain"][-1]
    plot_panels(disks, [(rf"$\gamma={strain:.4g}$", field)], np.arange(disks.n), args.out, r"u/\dot\gamma")
    return f"non-affine velocities at strain {strain:.4g}"


@picture("lanes", "velocity-correlation", "flow")
def _lanes(args, items):
    from jampetsc.plots.shearing import plot_lanes

    plot_lanes(items, args.out)
    return f"g_y of {_count(items, 'file', 'files')}"


@picture("fraction", "jam", "shear", mixed=True)
def _fraction(args, items):
    from jampetsc.plots.jamming import plot_fraction

    plot_fraction(items, args.out)
    return f"f(phi), the share of samples that jam, of {_count(items, 'file', 'files')}"


@picture("pressures", "jam", "shear", mixed=True)
def _pressures(args, items):
    from jampetsc.plots.jamming import plot_pressures

    plot_pressures(items, args.out)
    return f"P(p) of the jammed samples of {_count(items, 'file', 'files')}"


@picture("phi_J", "jam")
def _jamming_densities(args, items):
    from jampetsc.plots.jamming import plot_jamming_densities

    plot_jamming_densities(items, args.out)
    return f"distribution of phi_J of {_count(items, 'file', 'files')}"


@picture("scaling", "collapse", single=True)
def _scaling(args, items):
    from jampetsc.plots.scaling import plot_scaling

    (result,) = items
    plot_scaling(result, args.out)
    return f"collapse of the {result.attributes['observable']} at {len(result['phi'])} points"


def _count(items, one="sweep", many="sweeps"):
    return f"{len(items)} {one if len(items) == 1 else many}"


def _plural(word):
    return {"packing": "a packing", "spectrum": "spectra"}.get(word, f"{_noun(word)}s")


def _noun(word):
    return (
        f"{word} file"
        if word in ("modes", "quasistatic", "flow", "shear", "jam", "velocity-correlation", "collapse")
        else word
    )


def _within(args, option, low, high, default):
    """The value of an option. Raises InputError unless it lies between low and high."""
    value = vars(args)[option]
    if value is not None and not low < value < high:
        raise InputError(f"--{option.replace('_', '-')} {value:g}: must lie between {low} and {high}")
    return default if value is None else value
