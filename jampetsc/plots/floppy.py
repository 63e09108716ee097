"""Floppy motion against pressure (BT Fig. 5) and the viscosities against β (BT Fig. 4, inset), of quasistatic
files.
"""

import numpy as np
from matplotlib.patches import Patch

from jampetsc.analysis.statistics import median_interval
from jampetsc.core.laws import having
from jampetsc.errors import InputError
from jampetsc.plots.logaxes import power_law
from jampetsc.plots.page import band
from jampetsc.plots.picture import count, picture
from jampetsc.plots.style import GREY, OPEN, entry, hidden, looks, power_or_number
from jampetsc.plots.units import units_of

BARE = "no_prestress"
QUANTITIES = {  # attribute -> (symbol, exponent expected, BT eqs. 19-21)
    "normal": (r"|\Delta u_\parallel|", 0.25),
    "transverse": (r"|\Delta u_\perp|", -0.25),
    "nonaffine": (r"|u_{\rm na}|", -0.25),
}
PRESTRESS = (  # prefix of attributes, what it means, how it is drawn on top of a colour and a marker
    (f"{BARE}_", "no pre-stress", {}),
    ("", "pre-stress", OPEN),
)


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


@picture("medians", "quasistatic")
def plot_medians(results, page):
    """Medians of |Δu∥|, |Δu⊥| and |u_na| per unit strain against p/k, with slopes ±1/4 (BT eqs. 19-21).

    Filled: without pre-stress; open: with. Small points are files, lines run through the medians of those of
    one pressure and N; where each has several, bands are 68 % intervals of these medians by resampling the files.
    """
    groups = groups_of(results)
    sizes = sorted({size for size, _ in groups})
    ax = page.panels()
    ax.set(xlabel="$p/k$", ylabel="median per unit strain", xscale="log", yscale="log")
    markers = [look["marker"] for look in looks(len(sizes))]
    handles, bands, single = [], [], False
    for (name, (symbol, slope)), look in zip(QUANTITIES.items(), looks(len(QUANTITIES)), strict=True):
        handles.append(entry(f"${symbol}$", **(look if len(sizes) == 1 else {"color": look["color"]})))
        for size, marker in zip(sizes, [look["marker"]] if len(sizes) == 1 else markers, strict=True):
            levels, guide = np.array([level for n, level in groups if n == size]), None
            for prefix, words, face in PRESTRESS:
                samples = values_of(results, groups, size, value_of, f"{name}_median", prefix)
                if not np.isfinite(np.concatenate(samples)).any():
                    continue
                label = f"${symbol}$, $N={size}$, {words}"
                medians, drawn = draw_medians(ax, levels, samples, look | {"marker": marker} | face, label)
                bands = drawn or bands
                if max(map(len, samples)) > 1:
                    p, y = np.repeat(levels, [len(some) for some in samples]), np.concatenate(samples)
                    dots = {"markersize": 2, "markeredgewidth": 0, "label": hidden(f"{label}, single files")}
                    ax.plot(p, y, ".", color=look["color"], **dots)
                    single = True
                guide = medians if guide is None else guide
            if size == sizes[-1]:
                power_law(ax, levels, guide, slope)
    styles = {size: {"marker": marker, "ls": "none"} for size, marker in zip(sizes, markers, strict=True)}
    handles += handles_of(styles if len(sizes) > 1 else {})
    handles.append(entry(r"$p^{\pm 1/4}$", GREY, linestyle=":", linewidth=0.8))
    if single:
        handles.append(entry("single files", marker=".", ms=2, ls="none"))
    page.legend(ax, handles + bands)
    return f"medians of floppy motion in {count(results, 'file', 'files')}"


def values_of(results, groups, size, value, *more) -> list:
    """value(result, *more) of the files of each pressure of one N, [(files,), …]."""
    return [
        np.array([value(results[row], *more) for row in rows]) for (n, _), rows in groups.items() if n == size
    ]


def handles_of(styles) -> list:
    """Legend entries of sizes, {N: how it is drawn}, and of what is drawn without pre-stress and with it."""
    sizes = [entry(f"$N={size}$", **look) for size, look in styles.items()]
    return sizes + [entry(words, marker="o", mew=0.7, **face) for _, words, face in PRESTRESS]


def draw_medians(ax, x, samples, look, name) -> tuple:
    """(medians (M,), legend entries) of M samples over x (M,): a line, and a band where the medians lie.

    The band is drawn, and has an entry, if each sample has the three values that it takes.
    """
    known = [sample[np.isfinite(sample)] for sample in samples]
    medians = np.array([np.median(sample) if len(sample) else np.nan for sample in known])
    ax.plot(x, medians, **{"markeredgewidth": 0.7, "label": hidden(name)} | look)
    if not all(len(sample) > 2 for sample in known):
        return medians, []
    band(ax, x, *np.transpose([median_interval(sample) for sample in known]), name, color=look["color"])
    return medians, [Patch(facecolor="0.2", alpha=0.25, label="68 % interval")]


def value_of(result, name, prefix=f"{BARE}_"):
    """An attribute without pre-stress (this prefix) or with it (""); nan where the file has none."""
    attributes = result.attributes
    if not attributes.get("prestress", True):  # such a run has only the one, under the plain names
        return attributes[name] if prefix else np.nan
    return attributes[f"{prefix}{name}"]


def unstable(results) -> str:
    """How many of quasistatic files have G₀ < 0 under pre-stress, in words."""
    negative = sum(result.attributes["G0"] < 0 for result in results if result.attributes["prestress"])
    return f"; G0 < 0 in {negative} of them, which count like the others" if negative else ""


@picture("viscosities", "quasistatic")
def plot_viscosities(results, page):
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
    ax = page.panels()
    ax.set(xlabel=r"$\beta$", ylabel=r"$\eta_0,\ \eta_\infty\ [k\tau_1]$", xscale="log", yscale="log")
    handles, bands = [], []
    columns = ((r"$\eta_0$", {}), (r"$\eta_\infty$", OPEN))
    for ((size, level), rows), look in zip(groups.items(), looks(len(groups)), strict=True):
        points = np.array([row for one in rows for row in _rows(results[one])])
        betas = np.unique(points[:, 0])
        label = f"${power_or_number(level)}$" + (f", $N={size}$" if several else "")
        handles.append(entry(label, **look))
        for column, (symbol, face) in enumerate(columns, 1):
            samples = [points[points[:, 0] == beta, column] for beta in betas]
            bands = draw_medians(ax, betas, samples, look | face, f"{symbol}, {label}")[1] or bands
    handles += [entry(symbol, marker="o", mew=0.7, **face) for symbol, face in columns]
    page.legend(ax, handles + bands, "$p/k$")
    return f"eta0 and eta_inf against beta of {count(results, 'file', 'files')}"


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
