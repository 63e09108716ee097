"""Finite-size scaling of η₀ (BT Fig. 8): η₀/N^a against pN², and √p (η₀ − η_F) against N, of quasistatic files."""

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter

from jampetsc.analysis.finite_size import FEWEST, logarithm_of_size
from jampetsc.analysis.statistics import bootstrap
from jampetsc.errors import InputError
from jampetsc.plots.floppy import BARE, draw_intervals, groups_of, value_of
from jampetsc.plots.logaxes import set_log_axes
from jampetsc.plots.style import (
    GREY,
    MARKERS,
    PAGE,
    colours,
    exponent_text,
    figure,
    letter_panels,
    power_or_number,
    power_text,
    save,
)
from jampetsc.plots.units import units_of

HEIGHT = 3.0  # inches
POWER = 1.0  # a, of contact damping (BT)
LARGE = 30.0  # pN² from which on a packing counts as large
CRITICAL = 2e-3  # p/k up to which √p η₀ does
_DASHES = (0, (4, 1.6))


def plot_finite_size(results, path, power=POWER) -> None:
    """η₀/N^a against pN² with the slope −a/2 of what does not depend on N: medians over packings, 68 % intervals.

    Filled: without pre-stress; open: with. Under a law with a fluid a second panel has η₀ − η_F; the last √p (η₀ − η_F)
    without pre-stress against N where pN² > LARGE and p/k < CRITICAL, means with their errors, and A + B ln N for each
    pressure with enough sizes. power is a.

    Raises InputError for files of several laws, and where pressures are not positive.
    """
    _require_one_law(results)
    groups = groups_of(results)
    fluid = any(fluid_of(result) > 0 for result in results)
    symbols = [r"\eta_0"] + [r"(\eta_0-\eta_F)"] * fluid
    sizes = sorted({size for size, _ in groups})
    looks = dict(zip(sizes, zip(colours(len(sizes)), MARKERS, strict=False), strict=False))
    with figure(PAGE, HEIGHT if fluid else 0.9 * HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(1, 1 + len(symbols))
        for ax, symbol, subtracted in zip(axes, symbols, (False, True), strict=False):
            _draw_collapse(ax, results, groups, looks, power, subtracted)
            ax.set(xlabel="$N^2p/k$", ylabel=rf"${symbol}\,/\,{power_text('N', power)}$ $[k\tau_1]$")
        _draw_sizes(axes[-1], results, groups, symbols[-1])
        handles = [
            Line2D([], [], color=shade, marker=marker, label=f"$N={size}$")
            for size, (shade, marker) in looks.items()
        ]
        handles += [
            Line2D([], [], color="0.2", marker="o", label="no pre-stress"),
            Line2D([], [], color="0.2", marker="o", mfc="white", linestyle=_DASHES, label="pre-stress"),
            Line2D([], [], color=GREY, linestyle="--", label=f"slope ${exponent_text(-power / 2)}$"),
        ]
        axes[0].legend(handles=handles, loc="lower left", handlelength=1.8)
        letter_panels(axes)
        save(fig, path)


def _require_one_law(results):
    law = results[0].attributes.get("law")
    for result in results:
        if result.attributes.get("law") != law:
            raise InputError(
                f"{result.path}: law {result.attributes.get('law')}, {results[0].path.name} has {law}: "
                "finite-size pictures show one; choose by --where law=…"
            )


def fluid_of(result) -> float:
    """η_F of a quasistatic file, 0 under a law without a fluid."""
    return float(result.attributes.get("eta0_fluid", 0.0))


def viscosity_of(result, prefix=f"{BARE}_", subtracted=False) -> float:
    """η₀ in kτ₁ without pre-stress (this prefix) or with it (""), less η_F if subtracted."""
    units = units_of(result)
    eta0 = value_of(result, "eta0", prefix) - (fluid_of(result) if subtracted else 0.0)
    return eta0 / (units.k * units.tau1)


def _draw_collapse(ax, results, groups, looks, power, subtracted):
    lines, bare = [], []
    for size, (shade, marker) in looks.items():
        levels = np.array([level for n, level in groups if n == size])
        x = levels * size**2
        for prefix, face, dash in ((f"{BARE}_", shade, "-"), ("", "white", _DASHES)):
            samples = [
                np.array([viscosity_of(results[row], prefix, subtracted) for row in groups[size, level]])
                / size**power
                for level in levels
            ]
            y = np.array([np.median(sample) for sample in samples])
            if not np.isfinite(y).any():
                continue
            ax.plot(
                x, y, color=shade, marker=marker, markerfacecolor=face, linestyle=dash, linewidth=0.8,
                markeredgewidth=0.7,
            )  # fmt: skip
            draw_intervals(ax, x, samples, shade)
            lines.append((x, y))
            if prefix:
                bare.append((x, y))
    set_log_axes(ax, lines)
    x, y = np.concatenate(bare, axis=1)
    large = x > LARGE
    if large.any():
        level = np.exp(np.mean(np.log(y[large] * x[large] ** (power / 2))))
        guide = np.array([1.0, x.max()])
        ax.plot(guide, level * guide ** (-power / 2), "--", color=GREY, linewidth=0.8, zorder=1)


def large_points(groups):
    """[(N, p/k)] of `groups_of` that are large and near jamming: pN² > LARGE, p/k < CRITICAL."""
    return [(size, level) for size, level in groups if level * size**2 > LARGE and level < CRITICAL]


def scaled_by_pressure(results, rows) -> tuple[float, float]:
    """(mean, standard error) of √p (η₀ − η_F) without pre-stress over files of one pressure, k = τ₁ = 1."""
    scaled = [
        np.sqrt(units_of(results[r]).pressure) * viscosity_of(results[r], subtracted=True) for r in rows
    ]
    return tuple(float(value) for value in bootstrap(scaled))


def _draw_sizes(ax, results, groups, symbol):
    points = large_points(groups)
    levels = sorted({level for _, level in points})
    for level, shade, marker in zip(levels, colours(len(levels)), MARKERS, strict=False):
        n = np.array([size for size, p in points if p == level])
        y, error = np.transpose([scaled_by_pressure(results, groups[size, level]) for size in n])
        label = f"${power_or_number(level)}$"
        ax.errorbar(n, y, error, color=shade, marker=marker, linestyle="none", elinewidth=0.7, label=label)
        known = np.isfinite(error) & (error > 0)
        if known.sum() >= FEWEST:
            line = logarithm_of_size(n[known], y[known], error[known])
            ax.plot(n, line.constant + line.slope * np.log(n), color=shade, linewidth=0.8, zorder=1)
    sizes = sorted({size for size, _ in points})
    if points:
        ax.legend(title="$p/k$", loc="lower right")
    ax.set(xscale="log", xlabel="$N$", ylabel=rf"$(p/k)^{{1/2}}\,{symbol}$ $[k\tau_1]$")
    ax.xaxis.set_major_locator(FixedLocator(sizes))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"${value:g}$"))
    ax.xaxis.set_minor_locator(FixedLocator([]))
    ax.set_ylim(0.0, None)
