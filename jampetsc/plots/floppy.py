"""Floppy motion against pressure (BT Fig. 5) and the viscosities against β (BT Fig. 4, inset), of quasistatic
files.
"""

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from jampetsc.analysis.statistics import median_interval
from jampetsc.contacts.laws import having
from jampetsc.errors import InputError
from jampetsc.plots.logaxes import place_legend, set_log_axes
from jampetsc.plots.style import COLUMN, GREY, MARKERS, colours, figure, power_or_number, save
from jampetsc.plots.units import units_of

HEIGHT = 2.9  # inches
BARE = "no_prestress"
QUANTITIES = {  # attribute -> (symbol, exponent expected, BT eqs. 19-21)
    "normal": (r"|\Delta u_\parallel|", 0.25),
    "transverse": (r"|\Delta u_\perp|", -0.25),
    "nonaffine": (r"|u_{\rm na}|", -0.25),
}
_DASHES = (0, (4, 1.6))


def pressures_of(results):
    """p/k of each file, (F,). Raises InputError where it is not positive."""
    found = []
    for result in results:
        pressure = units_of(result).pressure
        if pressure is None or not pressure > 0:
            known = "is not recorded" if pressure is None else f"{pressure:g}"
            raise InputError(f"{result.path}: pressure {known}: must be positive on a log axis")
        found.append(float(f"{pressure:.6g}"))
    return np.array(found)


def groups_of(results) -> dict:
    """{(N, p/k): rows of `results`}, of files that differ in the packing alone, small N and low pressure first."""
    found = {}
    for row, (result, pressure) in enumerate(zip(results, pressures_of(results), strict=True)):
        found.setdefault((int(result.attributes.get("particle_count", 0)), pressure), []).append(row)
    return dict(sorted(found.items()))


def plot_medians(results, path) -> None:
    """Medians of |Δu∥|, |Δu⊥| and |u_na| per unit strain against p/k, with slopes ±1/4 (BT eqs. 19-21).

    Filled: without pre-stress; open: with. Small points are files, lines run through the medians of those of
    one pressure and N; where each has several, bands are 68 % intervals of these medians by resampling the files.
    """
    groups = groups_of(results)
    sizes = sorted({size for size, _ in groups})
    shades = colours(len(QUANTITIES))
    with figure(COLUMN, HEIGHT, layout="constrained") as fig:
        ax = fig.add_subplot(xlabel="$p/k$", ylabel="median per unit strain")
        lines, handles, band, single = [], [], [], False
        for (name, (symbol, slope)), shade, mark in zip(QUANTITIES.items(), shades, MARKERS, strict=False):
            one_size = {"marker": mark} if len(sizes) == 1 else {}
            handles.append(Line2D([], [], label=f"${symbol}$", color=shade, markeredgewidth=0.7, **one_size))
            for size, marker in zip(sizes, [mark] if len(sizes) == 1 else _cycle(len(sizes)), strict=True):
                levels = np.array([level for n, level in groups if n == size])
                look = {"color": shade, "marker": marker, "markeredgewidth": 0.7}
                guide = None
                for prefix, face, dash in ((f"{BARE}_", shade, "-"), ("", "white", _DASHES)):
                    samples = [
                        np.array(
                            [value_of(results[row], f"{name}_median", prefix) for row in groups[size, level]]
                        )
                        for level in levels
                    ]
                    if not np.isfinite(np.concatenate(samples)).any():
                        continue
                    medians = np.array([np.nanmedian(some) for some in samples])
                    ax.plot(levels, medians, linestyle=dash, markerfacecolor=face, **look)
                    band = draw_intervals(ax, levels, samples, shade) or band
                    if max(map(len, samples)) > 1:
                        p, y = np.repeat(levels, [len(some) for some in samples]), np.concatenate(samples)
                        ax.plot(p, y, ".", color=shade, markersize=2, markeredgewidth=0)
                        single = True
                    lines.append((levels, medians))
                    guide = medians if guide is None else guide
                if size == sizes[-1]:
                    middle = np.exp(
                        np.mean(np.log(guide)) + slope * (np.log(levels) - np.mean(np.log(levels)))
                    )
                    ax.plot(levels, middle, ":", color=GREY, linewidth=0.8, zorder=1)
        set_log_axes(ax, lines)
        if len(sizes) > 1:
            handles += [
                Line2D([], [], color="0.2", marker=marker, ls="none", label=f"$N={size}$")
                for size, marker in zip(sizes, _cycle(len(sizes)), strict=True)
            ]
        handles += [
            Line2D([], [], color="0.2", marker="o", label="no pre-stress"),
            Line2D([], [], color="0.2", marker="o", mfc="white", linestyle=_DASHES, label="pre-stress"),
            Line2D([], [], color=GREY, linestyle=":", linewidth=0.8, label=r"$p^{\pm 1/4}$"),
        ]
        if single:
            handles.append(Line2D([], [], color="0.2", marker=".", ms=2, ls="none", label="single files"))
        place_legend(fig, ax, "", handles + band, lines)
        save(fig, path)


def draw_intervals(ax, x, samples, shade) -> list:
    """Where the medians of M samples lie, a band over x (M,); its legend entry, if each has the three that it takes."""
    known = [sample[np.isfinite(sample)] for sample in samples]
    if not all(len(sample) > 2 for sample in known):
        return []
    low, high = np.transpose([median_interval(sample) for sample in known])
    ax.fill_between(x, low, high, color=shade, alpha=0.25, linewidth=0)
    return [Patch(facecolor="0.2", alpha=0.25, label="68 % interval")]


def value_of(result, name, prefix=f"{BARE}_"):
    """An attribute without pre-stress (this prefix) or with it (""); nan where the file has none."""
    attributes = result.attributes
    if not attributes.get("prestress", True):  # such a run has only the one, under the plain names
        return attributes[name] if prefix else np.nan
    return attributes[f"{prefix}{name}"]


def plot_viscosities(results, path) -> None:
    """η₀ (filled) and η_∞ (open) in kτ₁ against β, a colour for each pressure and N; with the scans over β of the
    files.

    Raises InputError for files of another law.
    """
    for result in results:
        if result.attributes.get("law") not in having("beta"):
            raise InputError(
                f"{result.path}: law {result.attributes.get('law')}: has no beta; give contact damping"
            )
    groups = groups_of(results)
    several = len({size for size, _ in groups}) > 1
    with figure(COLUMN, HEIGHT, layout="constrained") as fig:
        ax = fig.add_subplot(xlabel=r"$\beta$", ylabel=r"$\eta_0,\ \eta_\infty\ [k\tau_1]$")
        lines, handles, band = [], [], []
        looks = zip(groups.items(), colours(len(groups)), _cycle(len(groups)), strict=True)
        for ((size, level), rows), shade, marker in looks:
            files = [results[row] for row in rows]
            points = np.array([row for one in files for row in _rows(one)])
            betas = np.unique(points[:, 0])
            medians = np.array([np.median(points[points[:, 0] == beta, 1:], axis=0) for beta in betas])
            look = {"color": shade, "marker": marker, "markeredgewidth": 0.7}
            for column, face, dash in ((0, shade, "-"), (1, "white", _DASHES)):
                ax.plot(betas, medians[:, column], linestyle=dash, markerfacecolor=face, **look)
                samples = [points[points[:, 0] == beta, 1 + column] for beta in betas]
                band = draw_intervals(ax, betas, samples, shade) or band
                lines.append((betas, medians[:, column]))
            label = f"${power_or_number(level)}$" + (f", $N={size}$" if several else "")
            handles.append(Line2D([], [], label=label, **look))
        set_log_axes(ax, lines)
        handles += [
            Line2D([], [], color="0.2", marker="o", label=r"$\eta_0$"),
            Line2D([], [], color="0.2", marker="o", mfc="white", linestyle=_DASHES, label=r"$\eta_\infty$"),
        ]
        place_legend(fig, ax, "$p/k$", handles + band, lines)
        save(fig, path)


def _cycle(count):
    return [MARKERS[n % len(MARKERS)] for n in range(count)]


def _rows(result):
    """(β, η₀, η_∞) in kτ₁, the file's own and its scan's, β > 0."""
    attributes = result.attributes
    units = units_of(result)
    unit = units.k * units.tau1
    rows = [(attributes["beta"], attributes["eta0"] / unit, attributes["eta_inf"] / unit)]
    if "beta_scan/beta" in result:
        scan = (result[f"beta_scan/{name}"] for name in ("beta", "eta0", "eta_inf"))
        rows += [(beta, eta0 / unit, eta_inf / unit) for beta, eta0, eta_inf in zip(*scan, strict=True)]
    return sorted({row for row in rows if row[0] > 0})
