"""Finite-size scaling of η₀ (BT Fig. 8): η₀/N^a against pN², and √p (η₀ − η_F) against N, of quasistatic files.

One contact more or less than isostatic is felt where ΔZ ~ p^½ is of the order of 1/N, that is pN² ~ 1: there η₀/N^a is
constant below and falls as (pN²)^(−a/2) above, where η₀ ~ p^(−a/2) does not depend on N. Under Stokes drag it does:
random forces make an isotropic elastic medium move by ⟨|u_na|²⟩ ~ ∫d²k/k² from 2π/L to 1/d, so √p (η₀ − η_F) =
A + B ln N, which over a range of N looks like a = 1 + d ln(A + B ln N)/d ln N.
"""

import numpy as np
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import InputError, named
from jampetsc.plots.floppy import (
    BARE,
    draw_medians,
    drawn_of_both,
    groups_of,
    handles_of,
    unstable,
    value_of,
)
from jampetsc.plots.logaxes import limits_kept
from jampetsc.plots.page import points
from jampetsc.plots.picture import count, picture
from jampetsc.plots.style import GREY, PAGE, entry, exponent_text, looks, power_or_number, power_text
from jampetsc.plots.units import units_of

HEIGHT = 3.0  # inches
LARGE = 30.0  # pN² from which on a packing counts as large
CRITICAL = 2e-3  # p/k up to which √p η₀ does
FEWEST = 3  # sizes of a line in ln N


@picture("finite-size", "quasistatic")
def plot_finite_size(results, page):
    """As `draw_finite_size` with a = 1, the exponent of contact damping (BT)."""
    return draw_finite_size(results, page, 1.0)


def draw_finite_size(results, page, size_power) -> str:
    """η₀/N^a against pN², a = size_power, with the slope −a/2 of what does not depend on N: medians, 68 % intervals.

    Filled: without pre-stress; open: with. Under a law with a fluid a second panel has η₀ − η_F; the last √p (η₀ − η_F)
    without pre-stress against N where pN² > LARGE and p/k < CRITICAL, means with their errors, and A + B ln N for each
    pressure with enough sizes.

    Raises InputError for files of several laws, and where pressures are not positive.
    """
    law = results[0].attributes.get("law")
    for result in results:
        if result.attributes.get("law") != law:
            raise InputError(
                f"{result.path}: law {result.attributes.get('law')}, {results[0].path.name} has {law}: "
                f"finite-size pictures show one; choose by {named('where')} law=…"
            )
    groups = groups_of(results)
    fluid = any(fluid_of(result) > 0 for result in results)
    symbols = [r"\eta_0"] + [r"(\eta_0-\eta_F)"] * fluid
    styles = dict(looks(groups))
    y = [rf"${symbol}\,/\,{power_text('N', size_power)}$ $[k\tau_1]$" for symbol in symbols]
    axes = {
        "x": ["$N^2p/k$"] * len(symbols) + ["$N$"],
        "y": [*y, rf"$(p/k)^{{1/2}}\,{symbols[-1]}$ $[k\tau_1]$"],
        "log": ["xy"] * len(symbols) + ["x"],
    }
    axes = page.panels(1, 1 + len(symbols), PAGE, HEIGHT if fluid else 0.9 * HEIGHT, **axes)
    for ax, subtracted in zip(axes[:-1], (False, True), strict=False):
        _draw_collapse(ax, groups, styles, size_power, subtracted)
    _draw_sizes(page, axes[-1], groups)
    guide = entry(f"slope ${exponent_text(-size_power / 2)}$", GREY, linestyle="--")
    page.legend(axes[0], [*handles_of(styles), guide], first="lower left", handlelength=1.8)
    return f"eta0/N^{size_power:g} against pN^2 of {count(results, 'file', 'files')}{unstable(results)}"


def fluid_of(result) -> float:
    """η_F of a quasistatic file, 0 under a law without a fluid."""
    return float(result.attributes.get("eta0_fluid", 0.0))


def viscosity_of(result, subtracted, prefix=f"{BARE}_") -> float:
    """η₀ in kτ₁, less η_F if subtracted, without pre-stress (this prefix) or with it ("")."""
    units = units_of(result)
    eta0 = value_of(result, "eta0", prefix) - (fluid_of(result) if subtracted else 0.0)
    return eta0 / (units.k * units.tau1)


def _draw_collapse(ax, groups, styles, power, subtracted):
    bare = []
    for size, levels in groups.items():
        x, look = np.array(list(levels)) * size**2, {"linewidth": 0.8} | styles[size]
        for values, words, face, prefix in drawn_of_both(levels, viscosity_of, subtracted):
            samples = [value / size**power for value in values]
            y, _ = draw_medians(ax, x, samples, look | face, f"$N={size}$, {words}")
            if prefix:
                bare.append((x, y))
    x, y = np.concatenate(bare, axis=1)
    large = x > LARGE
    if large.any():
        level = np.exp(np.mean(np.log(y[large] * x[large] ** (power / 2))))
        guide = np.array([1.0, x.max()])
        with limits_kept(ax):
            ax.plot(guide, level * guide ** (-power / 2), "--", color=GREY, linewidth=0.8, zorder=1)


def _draw_sizes(page, ax, groups):
    large = {}  # {p/k: {N: (mean, error) of √p (η₀ − η_F)}}
    for size, levels in groups.items():
        for level, files in levels.items():
            if level * size**2 > LARGE and level < CRITICAL:
                scaled = [
                    np.sqrt(units_of(one).pressure) * viscosity_of(one, subtracted=True) for one in files
                ]
                large.setdefault(level, {})[size] = mean_with_error(scaled)
    for (level, sizes), look in looks(sorted(large.items())):
        n = np.array(list(sizes))
        y, error = np.transpose(list(sizes.values()))
        points(ax, n, y, error, linestyle="none", label=f"${power_or_number(level)}$", **look)
        known = np.isfinite(error) & (error > 0)
        if known.sum() >= FEWEST:
            slope, constant = np.polyfit(np.log(n[known]), y[known], 1, w=1.0 / error[known])
            ax.plot(n, constant + slope * np.log(n), color=look["color"], linewidth=0.8, zorder=1)
    ax.set_ylim(0.0, None)
    page.legend(ax, title="$p/k$", named=False)
    ax.xaxis.set_major_locator(FixedLocator(sorted({size for sizes in large.values() for size in sizes})))
    ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.xaxis.set_minor_locator(NullLocator())
