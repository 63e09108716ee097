"""Local exponents beside the limits that they approach: of G* against ω, of what slow shear gives against p."""

import numpy as np
from matplotlib.lines import Line2D

from jampetsc.analysis.scaling import BORDER, critical_exponents, local_slope, low_frequency_limit
from jampetsc.analysis.statistics import log_median, mean_with_error
from jampetsc.errors import InputError
from jampetsc.plots.curves import group_curves
from jampetsc.plots.floppy import BARE, QUANTITIES, groups_of, value_of
from jampetsc.plots.logaxes import set_ticks
from jampetsc.plots.style import GREY, LOSS, MARKERS, PAGE, STORAGE, colours, figure, letter_panels, save

HEIGHT = 2.5  # inches of one row of panels
_DASHES = (0, (4, 1.6))
_FEWEST = 2  # pressures that make a slope
_LIMITS = {
    "G0": ("G_0", 0.5),
    "eta0": (r"\eta_0", -0.5),
    "omega_star": (r"\omega^*", 1.0),
    **{f"{name}_median": known for name, known in QUANTITIES.items()},
}  # exponents of p: BT 14-17, 19-22


def plot_exponents(curves, path) -> None:
    """What becomes Δ = ½ of each group of sweeps between ω* and 1/τ₁, against ωτ₁ (`scaling.critical_exponents`).

    Panels: ½ d ln|G*² − G₀²|/d ln ω and arg(G*² − G₀²)/π, both above ω* only; G''/G', 1 in the critical regime;
    d ln G''/d ln ω, which passes ¾ where that ends. Means over the packings of a group, each with its own G₀, and
    errors as bands. Raises InputError for a sweep that does not begin in the quasistatic limit.
    """
    title, groups = group_curves(curves)
    labels = (
        r"$\frac{1}{2}\,d\,\ln|G^{*2}-G_0^2|\,/\,d\,\ln\omega$",
        r"$\arg(G^{*2}-G_0^2)\,/\,\pi$",
        f"{LOSS}/{STORAGE}",
        rf"$d\,\ln\,${LOSS}$\,/\,d\,\ln\omega$",
    )
    with figure(PAGE, 2 * HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(2, 2, sharex=True)
        for group in groups:
            omega, samples, above = exponent_samples(group.curves)
            for ax, values, limited in zip(axes.flat, samples, (True, True, True, False), strict=True):
                shown = above if limited else slice(None)
                mean, error = mean_with_error(values[:, shown])
                ax.plot(omega[shown], mean, color=group.colour)
                ax.fill_between(
                    omega[shown], mean - error, mean + error, color=group.colour, alpha=0.25, linewidth=0
                )
        limits = ((0.5, 1.0), (0.5,), (1.0,), (1.0, 0.5, BORDER))
        ranges = ((0.2, 1.2), (0.2, 1.0), (0.0, 2.5), (0.3, 1.1))
        for ax, label, levels, low_high in zip(axes.flat, labels, limits, ranges, strict=True):
            for level in levels:
                ax.axhline(level, color=GREY, linewidth=0.8, linestyle=":", zorder=1)
            ax.set(ylabel=label, ylim=low_high, xscale="log")
        for ax in axes[-1]:
            ax.set_xlabel(r"$\omega\tau_1$")
        axes[0, 0].legend(
            handles=[Line2D([], [], color=group.colour, label=group.label) for group in groups], title=title
        )
        letter_panels(axes.flat)
        save(fig, path)


def exponent_samples(curves):
    """(ωτ₁ (M,), four (curves, M) as in `plot_exponents`, (M,) whether ω is above ω* of their mean) of one group.

    Raises InputError where frequencies differ, or do not begin in the quasistatic limit.
    """
    omega = curves[0].omega
    for curve in curves:
        if len(curve.omega) != len(omega) or not np.allclose(curve.omega, omega, rtol=1e-9, atol=0):
            raise InputError(f"{curve.name}: other frequencies than {curves[0].name}: a mean needs the same")
    limits = [low_frequency_limit(curve.omega, curve.G) for curve in curves]
    powers = [
        critical_exponents(omega, curve.G, limit.modulus) for curve, limit in zip(curves, limits, strict=True)
    ]
    G = np.array([curve.G for curve in curves])
    slopes = np.array([local_slope(omega, one.imag) for one in G])
    mean = [np.mean([getattr(limit, name) for limit in limits]) for name in ("modulus", "viscosity")]
    samples = (
        np.array([one[0] for one in powers]),
        np.array([one[1] for one in powers]),
        G.imag / G.real,
        slopes,
    )
    return omega, samples, omega > mean[0] / mean[1]


def plot_pressure_exponents(results, path) -> None:
    """d ln X/d ln p between neighbouring pressures against p/k, with the limits of BT 14-17 and 19-21.

    X is G₀, η₀, ω* = G₀/η₀, and the medians of |Δu∥|, |Δu⊥| and |u_na| over contacts or disks. Filled: without
    pre-stress; open: with. Medians over the packings of one pressure and N, of which G₀ < 0 under pre-stress counts
    like any other; errors are those of medians. Raises InputError for fewer than two pressures.
    """
    groups = groups_of(results)
    sizes = [size for size in sorted({size for size, _ in groups}) if _pressures(groups, size) >= _FEWEST]
    if not sizes:
        raise InputError(f"{results[0].path}: one pressure: local exponents need files at several")
    with figure(PAGE, 2 * HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(2, 3).ravel()
        for ax, (name, (symbol, limit)) in zip(axes, _LIMITS.items(), strict=True):
            ax.axhline(limit, color=GREY, linewidth=0.8, linestyle=":", zorder=1)
            for size, shade, marker in zip(sizes, colours(len(sizes)), MARKERS, strict=False):
                levels = np.array([level for n, level in groups if n == size])
                for prefix, face, dash in ((f"{BARE}_", shade, "-"), ("", "white", _DASHES)):
                    samples = [
                        np.array([value_of(results[row], name, prefix) for row in groups[size, level]])
                        for level in levels
                    ]
                    middle, slope, error = local_exponents_of(levels, samples)
                    look = {"color": shade, "marker": marker, "markerfacecolor": face, "linestyle": dash}
                    draw_points(ax, middle, slope, error, **look)
            ax.set(xlabel="$p/k$", ylabel=rf"$d\,\ln {symbol}\,/\,d\,\ln p$", xscale="log")
            ax.set_ylim(limit - 0.5, limit + 0.5)
            low, high = np.log10([min(level for _, level in groups), max(level for _, level in groups)])
            ax.set_xlim(10**low, 10**high)
            set_ticks(ax.xaxis, low, high)
        looks = [
            (f"$N={size}$", shade, "-", shade) for size, shade in zip(sizes, colours(len(sizes)), strict=True)
        ]
        looks += [("no pre-stress", "0.2", "-", "0.2"), ("pre-stress", "0.2", _DASHES, "white")]
        handles = [
            Line2D([], [], color=colour, linestyle=dash, marker="o", mfc=face, mew=0.7, label=label)
            for label, colour, dash, face in looks
        ]
        axes[2].legend(handles=handles)
        letter_panels(axes)
        save(fig, path)


def draw_points(ax, x, y, error, **look):
    """Points (m,) with bars where they have an error; those that are no numbers are left out."""
    known = np.isfinite(y)
    bars = error[known] if np.isfinite(error[known]).all() else None
    ax.errorbar(x[known], y[known], bars, markeredgewidth=0.7, elinewidth=0.7, **look)


def _pressures(groups, size):
    return sum(n == size for n, _ in groups)


def local_exponents_of(levels, samples):
    """(middles, d ln X/d ln p, errors), (m − 1,) each, between neighbouring levels (m,); X: medians of m samples.

    Errors are those of the medians, nan for fewer than three values; nan where a median is not positive.
    """
    known = [
        log_median(one) if len(one) > 2 else (np.log(max(np.median(one), 0.0) or np.nan), np.nan)
        for one in samples
    ]
    logs, errors = np.transpose(known)
    steps = np.diff(np.log(levels))
    return np.sqrt(levels[1:] * levels[:-1]), np.diff(logs) / steps, np.hypot(errors[1:], errors[:-1]) / steps
