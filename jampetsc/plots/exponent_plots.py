"""Local exponents with the limits that they approach: of G* against ω, of quasistatic quantities against p."""

import numpy as np

from jampetsc.analysis.power_laws import (
    CROSSOVER_SLOPE,
    Limit,
    critical_exponents,
    local_slope,
    low_frequency_limit,
    median_exponents,
)
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import InputError, about, named
from jampetsc.io.reader import SweepResult
from jampetsc.plots.chosen_columns import chosen_properties
from jampetsc.plots.curves import (
    Curve,
    curve_of,
    entries_of,
    group_curves,
    require_same_frequencies,
)
from jampetsc.plots.moduli_plots import BY
from jampetsc.plots.page import draw_band, draw_points
from jampetsc.plots.picture import count_text, picture, stress_unit
from jampetsc.plots.quasistatic_plots import (
    PRESTRESS,
    QUANTITIES,
    groups_of,
    handles_of,
    has_pressure,
    pressures_of,
    unstable,
    value_of,
    values_of,
)
from jampetsc.plots.style import GREY, LOSS, PAGE, STORAGE, hidden, looks

HEIGHT = 2.5  # inches of one row of panels
_MIN_PRESSURES = 2  # of a slope
MAX_FALL = 0.9  # of G′ over its value at twice the frequency, where it falls
_LIMITS = {
    "G0": ("G_0", 0.5),
    "eta0": (r"\eta_0", -0.5),
    "omega_star": (r"\omega^*", 1.0),
    **{f"{name}_median": value for name, value in QUANTITIES.items()},
}  # exponents of p: BT 14-17, 19-22
_PANELS = (  # what it is, limits that have a name, range, whether only above ω*
    (r"$\frac{1}{2}\,d\,\ln|G^{*2}-G_0^2|\,/\,d\,\ln\omega$", (0.5, 1.0), (0.2, 1.2), True),
    (r"$\arg(G^{*2}-G_0^2)\,/\,\pi$", (0.5,), (0.2, 1.0), True),
    (f"{LOSS}/{STORAGE}", (1.0,), (0.0, 2.5), True),
    (rf"$d\,\ln\,${LOSS}$\,/\,d\,\ln\omega$", (1.0, 0.5, CROSSOVER_SLOPE), (0.3, 1.1), False),
)


@picture("exponents", "sweep", "quasistatic", options=(BY,), suits=has_pressure)
def plot_exponents(results, page, by=()):
    """Of sweeps `draw_exponents`, against ω; of quasistatic files `draw_pressure_exponents`, against p.

    by   columns in which sweeps of different curves differ
    """
    if isinstance(results[0], Curve | SweepResult):
        return draw_exponents(chosen_properties([curve_of(result) for result in results], by), page)
    if by:
        raise InputError(f"{named('by')}: for sweeps. Choose quasistatic files with {named('where')}.")
    return draw_pressure_exponents(results, page)


def draw_exponents(curves, page) -> str:
    """Four exponents that approach Δ = ½ between ω* and 1/τ₁, for each group of sweeps (`critical_exponents`).

    Panels: ½ d ln|G*² − G₀²|/d ln ω and arg(G*² − G₀²)/π, both above ω* only; G''/G', 1 in the critical regime;
    d ln G''/d ln ω, which passes ¾ where that ends. Means over the packings of a group, each with its own G₀, and
    errors as bands. Networks without force whose G' falls to the lowest frequency have G₀ = 0. Raises InputError where
    frequencies differ, or do not begin in the quasistatic limit.
    """
    title, groups = group_curves(curves, labels=page.file_labels(len(curves)))
    names = [label for label, *_ in _PANELS]
    axes = page.panels(2, 2, PAGE, 2 * HEIGHT, x=r"$\omega\tau_1$", y=names, log="x", sharex=True)
    for ax, (_, levels, limits, _) in zip(axes, _PANELS, strict=True):
        ax.set_ylim(limits)
        for level in levels:
            ax.axhline(level, color=GREY, linewidth=0.8, linestyle=":", zorder=1)
    without_modulus = 0
    for group in groups:
        omega, samples, limits = group.curves[0].omega, [], []
        require_same_frequencies(group.curves)
        for curve in group.curves:
            G, limit = curve.G, _limit_of(curve)
            limits.append(limit)
            without_modulus += limit.modulus == 0.0
            slopes = critical_exponents(omega, G, limit.modulus)
            samples.append((*slopes, G.imag / G.real, local_slope(omega, G.imag)))
        modulus, viscosity = np.mean([(limit.modulus, limit.viscosity) for limit in limits], axis=0)
        above = omega > modulus / viscosity  # ω* of their mean
        for ax, values, (_, _, _, limited) in zip(axes, np.swapaxes(samples, 0, 1), _PANELS, strict=True):
            shown = above if limited else slice(None)
            mean, error = mean_with_error(values[:, shown])
            ax.plot(omega[shown], mean, color=group.colour, ls=group.dash, label=hidden(group.label))
            draw_band(ax, omega[shown], mean - error, mean + error, group.label, color=group.colour)
    page.legend(axes[0], entries_of(groups, lambda group: {"ls": group.dash}), title)
    text = f"local exponents of G* against omega of {count_text(curves)}"
    if without_modulus:
        text += f"; with G0 = 0 in {without_modulus} of them, networks without force whose G' falls to the lowest omega"
    return text


def _limit_of(curve) -> Limit:
    """G₀ and η₀ of a sweep; G₀ = 0 of a network without force whose G′ falls with ω, as critical and floppy ones do.

    A lower frequency would not show another modulus. Raises InputError for a sweep that begins too high.
    """
    with about(curve.name):
        try:
            return low_frequency_limit(curve.omega, curve.G)
        except InputError:
            higher = curve.omega >= 2.0 * curve.omega[0]
            falls = higher.any() and 0.0 <= curve.G.real[0] < MAX_FALL * curve.G.real[higher][0]
            if curve.pressure or not falls:
                raise
    return Limit(0.0, float(curve.G.imag[0] / curve.omega[0]))


def draw_pressure_exponents(results, page) -> str:
    """d ln X/d ln p between neighbouring pressures against p/k, with the limits of BT 14-17 and 19-21.

    X is G₀, η₀, ω* = G₀/η₀, and the medians of |Δu∥|, |Δu⊥| and |u_na| over contacts or disks. Filled: without
    pre-stress; open: with. Medians over the packings of one pressure and N, of which G₀ < 0 under pre-stress counts
    like any other; errors are errors of medians. Raises InputError for fewer than two pressures.
    """
    every = pressures_of(results)
    groups = {size: levels for size, levels in groups_of(results).items() if len(levels) >= _MIN_PRESSURES}
    if not groups:
        raise InputError(f"{results[0].path}: one pressure alone. For local exponents give files at several.")
    styles = dict(looks(groups))
    names = [rf"$d\,\ln {symbol}\,/\,d\,\ln p$" for symbol, _ in _LIMITS.values()]
    axes = page.panels(2, 3, PAGE, 2 * HEIGHT, x=f"$p{stress_unit(results).over}$", y=names, log="x")
    for ax, (name, (_, limit)) in zip(axes, _LIMITS.items(), strict=True):
        ax.axhline(limit, color=GREY, linewidth=0.8, linestyle=":", zorder=1)
        for size, levels in groups.items():
            for prefix, words, face in PRESTRESS:
                drawn = median_exponents(np.array(list(levels)), values_of(levels, value_of, name, prefix))
                draw_points(ax, *drawn, label=hidden(f"$N={size}$, {words}"), **styles[size], **face)
        ax.set(xlim=(min(every), max(every)), ylim=(limit - 0.5, limit + 0.5))
    page.legend(axes[2], handles_of(styles), groups=len(styles))
    of = count_text(results, "file", "files")
    return f"local exponents of G0, eta0 and omega* against p of {of}{unstable(results)}"
