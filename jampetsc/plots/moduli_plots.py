"""G' and G'' against ω for sweeps and oscillations (BT Fig. 3a), and the critical collapse of sweeps (BT Fig. 3b)."""

from collections import Counter
from dataclasses import replace

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.patches import Patch

from jampetsc.analysis.power_laws import LAMBDA, MU, collapse, collapse_spread
from jampetsc.analysis.statistics import STATISTICS
from jampetsc.errors import InputError, about
from jampetsc.options.parameters import NUMBER, WORD, ValueType
from jampetsc.options.values import split_list
from jampetsc.plots.chosen_columns import chosen_properties, mixed_text
from jampetsc.plots.curves import (
    OSCILLATION,
    average_curves,
    curves_of,
    entries_of,
    group_curves,
    symbol_of,
)
from jampetsc.plots.page import draw_band, draw_guide
from jampetsc.plots.picture import count_text, option, picture, stress_unit
from jampetsc.plots.style import (
    DASHED,
    LOSS,
    OPEN,
    STORAGE,
    entry,
    has_chosen_colours,
    hidden,
    power_text,
    sequential,
)

_MAX_MARKED = 16  # frequencies up to which each has a marker
_LONG_CURVE_MARKERS = 8
_MAX_ENTRIES = 7  # values of one parameter in a legend; more get a colour bar
_BOTH = (STORAGE, LOSS)
MIN_PACKINGS = 6  # below which twice an error holds less than 92 % of cases
_FILES = ("sweep", "oscillate")
COLUMNS = ValueType(split_list, ",".join, metavar="COLUMN,…", python="column or list of columns")
STATISTIC = option(
    "statistic", WORD,
    "moduli, storage, loss, collapse, bulk, poisson: average over packings (default: none; of a study: mean)",
    choices=tuple(STATISTICS),
)  # fmt: skip
BY = option(
    "by", COLUMNS, "moduli, storage, loss, collapse, bulk, poisson, exponents: columns of a study, or attributes of "
    "files, by which curves differ (default: all that the study has set but seeds)", "COLUMN,…",
)  # fmt: skip
EXPONENTS = (
    option("mu", NUMBER, "collapse: exponent of p that divides moduli (default 0.5)", "MU", low=0, high=10),
    option("lambda", NUMBER, "collapse: exponent of p that divides frequencies (default 1)", "LAMBDA", low=0, high=10),
)  # fmt: skip


@picture("moduli", *_FILES, options=(STATISTIC, BY), mixed=True)
def plot_moduli(results, page, statistic=None, by=()):
    """G'/k (solid, filled) and G''/k (dashed, open) against ωτ₁; bands: bounds, or errors of the `statistic`.

    Oscillations at one frequency and several amplitudes are drawn against the amplitude.
    """
    return _draw_parts(results, page, statistic, by, _BOTH, "G' and G''")


@picture("storage", *_FILES, options=(STATISTIC, BY), mixed=True)
def plot_storage(results, page, statistic=None, by=()):
    """G'/k against ωτ₁."""
    return _draw_parts(results, page, statistic, by, (STORAGE,), "G'")


@picture("loss", *_FILES, options=(STATISTIC, BY), mixed=True)
def plot_loss(results, page, statistic=None, by=()):
    """G''/k against ωτ₁."""
    return _draw_parts(results, page, statistic, by, (LOSS,), "G''")


def _draw_parts(results, page, statistic, by, parts, words):
    along, x = _abscissa(results)
    curves, what, text = average_files(results, statistic, along, by)
    y = ",  ".join(f"{part}${stress_unit(results).over}$" for part in parts)
    _draw(page, curves, (x, y), None, r"\omega" if along == "omega" else None, what, parts)
    of = count_text(results) if not any(map(_oscillates, results)) else count_text(results, "file", "files")
    return f"{words} of {of}{text}"


def _oscillates(result):
    return getattr(result, "format", "") == OSCILLATION


def _abscissa(results):
    """(abscissa of G*, its label): "omega", or "amplitude" if that alone varies."""
    if all(_oscillates(result) and len(result["omega"]) == 1 for result in results):
        imposed = {result.attributes["control"] for result in results}
        if len(imposed) == 1 and max(len(result["amplitude"]) for result in results) > 1:
            return "amplitude", {
                "strain": r"$\gamma_0$",
                "stress": rf"$\sigma_0{stress_unit(results).over}$",
            }[imposed.pop()]
    return "omega", r"$\omega\tau_1$"


@picture("collapse", "sweep", options=(*EXPONENTS, STATISTIC, BY))
def plot_collapse(results, page, statistic=None, by=(), mu=MU, **more):
    """G'/p^μ and G''/p^μ against ω/p^λ, for ωτ₁ ≤ 1 where criticality ends; p in units of k.

    λ = 0 leaves the frequency as it is, and all of it, as where sliding costs nothing (BT Fig. 4a).

    Raises InputError if a sweep's pressure is unknown or not positive, or it has no frequency up to 1/τ₁.
    """
    lam = more.get("lambda", LAMBDA)  # a keyword of python
    curves, what, averages = average_files(results, statistic, by=by)
    unit = stress_unit(results)
    p = f"(p{unit.over})"
    x = rf"$\omega\tau_1\,/\,{power_text(p, lam)}$" if lam else r"$\omega\tau_1$"
    y = rf"{STORAGE}, {LOSS}  $[\,{unit.name}\,{power_text(p, mu)}\,]$"
    critical, symbol = (mu / lam, "x") if lam else (None, r"\omega")
    _draw(page, [_scaled(curve, mu, lam) for curve in curves], (x, y), critical, symbol, what, _BOTH)
    text = f"collapse of {count_text(results)} with mu = {mu:g}, lambda = {lam:g}{averages}"
    try:
        spread = collapse_spread([(c.omega, c.G, c.pressure) for c in curves], mu, lam)
    except InputError:  # one sweep, or sweeps that share no scaled frequency, have no spread
        return text
    return f"{text}; they differ by {float(f'{100 * spread:.2g}'):g} % (rms) below omega tau1 = 0.1"


def average_files(results, statistic, along="omega", by=()):
    """(curves, name of their bands, words) of sweeps, or of means or medians over sweeps that differ in the packing.

    by   columns in which averages differ; (): all but seeds
    """
    curves = chosen_properties([curve for result in results for curve in curves_of(result, along)], by)
    if statistic is None:
        return curves, "", ""
    fewest = min(Counter(str(curve.description) for curve in curves).values())
    negative = sum(bool((curve.G.real < 0).any()) for curve in curves)
    below = f"; G' < 0 somewhere in {negative} of them, which count like the others" if negative else ""
    words = {"mean": "arithmetic means", "median": "medians"}[statistic]
    what = f"{statistic}, 68 % interval" + (
        f"\n{STORAGE} < 0 in {negative} of {len(curves)}" if negative else ""
    )
    text = f", {words} over packings with errors{below}"
    if fewest < MIN_PACKINGS:
        rough = "no error" if fewest < 2 else "rough errors: twice the error holds less than 92 % of cases"
        text += f"; {fewest} packing{'s' * (fewest != 1)} only: {rough}"
    mixed = mixed_text(curves)
    return average_curves(curves, statistic), what, text + (f"; over {mixed}" if mixed else "")


def _scaled(curve, mu, lam):
    if curve.pressure is None:
        raise InputError(f"{curve.name}: attribute pressure: missing. For a collapse run the sweep again.")
    low = curve.omega <= (1.0 if lam else np.inf)
    if not low.any():
        lowest = f"lowest frequency {curve.omega[0]:g}"
        raise InputError(f"{curve.name}: {lowest}, above 1/τ₁. For a collapse sweep lower frequencies.")
    with about(curve.name):
        x, g = collapse(curve.omega[low], curve.G[low], curve.pressure, mu, lam)
    return replace(curve, omega=x, G=g, bounds=curve.bounds[..., low] / curve.pressure**mu)


def _draw(page, curves, labels, critical, symbol, what, parts):
    """critical: exponent of the regime between the crossovers, if it gets a guide as the viscous one does.

    symbol: of the base of the guides; None: no guides.
    """
    ax = page.panels(x=labels[0], y=labels[1], log="xy")
    labels = [] if what else page.file_labels(len(curves))
    title, groups = group_curves(curves, labels=labels)
    is_listed = has_chosen_colours() or labels or page.labels
    barred = [group.value for group in groups if group.value]
    if barred := barred if len(groups) > _MAX_ENTRIES and symbol_of(groups) and not is_listed else []:
        groups = [replace(group, marker="o") for group in groups]
    drawn = [_curve(ax, g, curve, n, parts) for n, g in enumerate(groups) for curve in g.curves]
    if not any(drawn):
        positive = "neither G' nor G''" if parts == _BOTH else "no modulus"
        raise InputError(
            f"{curves[0].name}: {positive} is positive at any frequency. Draw other files on log axes."
        )
    negative = sum(bool((curve.G.real <= 0).any()) for curve in curves)
    if negative and STORAGE in parts:  # unstable to shear, as small packings with pre-stress can be
        words = f"{STORAGE} ≤ 0 (not shown) in {negative} of {len(curves)} sweeps"
        ax.text(0.02, 0.98, words, transform=ax.transAxes, va="top", fontsize=7.5)
    if parts == _BOTH and symbol:
        # low pressure has the longest critical branch, high pressure the longest viscous one
        lowest, highest = groups[0].curves[0], groups[-1].curves[0]
        for curve, exponent, above in ((lowest, critical, True), (highest, 1.0, False)):
            if exponent:
                seen = page.visible_mask(curve.omega)
                draw_guide(ax, curve.omega[seen], curve.G.imag[seen], exponent, symbol, above)
    if barred:
        colours = ScalarMappable(LogNorm(min(barred), max(barred)), sequential())
        bar = page.figure.colorbar(colours, ax=ax, pad=0.02, aspect=30, label=symbol_of(groups))
        bar.ax.tick_params(which="both", length=2)
        title = ""
    named = [group for group in groups if not (barred and group.value)]
    look = {"markeredgewidth": 0.7}
    entries = entries_of(named, lambda group: {"marker": group.marker} | look) if named else []
    of_groups = len(entries)
    if len(parts) > 1:
        marked = {} if groups[0].parts else {"marker": "o", "mew": 0.7}  # where markers do not tell laws
        entries += [entry(STORAGE, **marked), entry(LOSS, **marked, **OPEN)]
    page.legend(
        ax,
        entries + ([Patch(facecolor="0.2", alpha=0.25, label=what)] if what else []),
        title,
        groups=of_groups,
    )


def _curve(ax, group, curve, number, shown_parts):
    """Draw one sweep; whether log axes can show anything of it."""
    solitary, is_drawn = len(group.curves) == 1, False
    parts = ((STORAGE, curve.G.real, "-", group.colour), (LOSS, curve.G.imag, DASHED, "white"))
    for (part, values, dash, face), bound in zip(parts, curve.bounds, strict=True):
        positive = values > 0
        if part not in shown_parts or not positive.any():
            continue
        is_drawn, name = True, f"{part}, {group.label}, {curve.name}"
        shown = np.where(positive, values, np.nan)
        ax.plot(
            curve.omega, shown, linestyle=dash, color=group.colour, marker=group.marker, markerfacecolor=face,
            markeredgewidth=0.7, markevery=_marker_rows(curve.omega, number), linewidth=1.1 if solitary else 0.7,
            alpha=1.0 if solitary else 0.8, label=hidden(name),
        )  # fmt: skip
        below, above = np.broadcast_to(bound, (2, len(values)))
        lower = np.maximum(values - below, 1e-12 * np.nanmin(shown))  # to the edge of the picture
        draw_band(ax, curve.omega, lower, values + above, name, where=positive, color=group.colour)
    return is_drawn


def _marker_rows(omega, number):
    """Rows that get a marker: all of a few; of many some, shifted so that markers of curves stay apart."""
    if len(omega) <= _MAX_MARKED:
        return list(range(len(omega)))
    phase = (0.5 + 0.37 * number) % 1.0
    targets = np.log(omega[0]) + (np.arange(_LONG_CURVE_MARKERS) + phase) / _LONG_CURVE_MARKERS * np.log(
        omega[-1] / omega[0]
    )
    return sorted({int(np.abs(np.log(omega) - w).argmin()) for w in targets})
