"""Collapse of an observable near jamming, with residuals and the drift of every parameter (Vågberg, thesis ch. 5)."""

import numpy as np

from jampetsc.errors import InputError
from jampetsc.plots.page import draw_points, limits_kept
from jampetsc.plots.picture import picture
from jampetsc.plots.style import GREY, PAGE, hidden, looks, number

HEIGHTS = (3.0, 1.4, 1.9)  # inches of collapse, residuals and drift
ASYMPTOTE_START = 0.7  # of the largest argument
DRIFT_RANGE = 6.0  # of the axis about the best value, in typical changes or errors
SYMBOLS = {"pressure": "p", "shear_stress": r"\sigma", "jammed": "f"}
_PARAMETER_SYMBOLS = {"phi_J": r"\phi_J", "y": "y", "znu": r"z\nu", "nu": r"\nu", "omega": r"\omega"}


def rescaled_values(result):
    """(b, O/b^(y/κ) without its corrections, its error): b is the rate, κ = zν; of sizes 1/L and ν."""
    attributes = result.attributes
    b, kappa = (result["rate"], "znu") if attributes["scaling"] == "rate" else (1 / result["size"], "nu")
    unit = b ** (float(attributes["y"]) / float(attributes[kappa]))
    return b, (result["value"] - result["correction"]) / unit, result["error"] / unit


@picture("scaling", "collapse", single=True)
def plot_scaling(results, page):
    """O/b^(y/κ) against x with f₀, corrections taken off; residuals in standard errors; parameters against the cut."""
    (result,) = results
    names = str(result.attributes["fitted"]).split(",")
    if len(names) != result["drift/parameters"].shape[1] or not _PARAMETER_SYMBOLS.keys() >= set(names):
        raise InputError(
            f"{result.path}: attribute fitted: not a name for each parameter. Make the file again."
        )
    mosaic = [["top"] * len(names), ["middle"] * len(names), names]
    top, middle, *drifts = page.mosaic(mosaic, PAGE, sum(HEIGHTS), HEIGHTS)
    middle.sharex(top)
    _draw_collapse(page, top, middle, result)
    for column, (ax, name) in enumerate(zip(drifts, names, strict=True)):
        _draw_drift(ax, result, name, column)
    return f"collapse of the {result.attributes['observable']} at {len(result['x'])} points"


def _draw_collapse(page, top, middle, result):
    attributes, x, (b, left, bars) = result.attributes, result["x"], rescaled_values(result)
    sized = attributes["scaling"] == "size"
    residuals = (result["value"] - result["leading"] - result["correction"]) / result["error"]
    top.plot(result["curve/x"], result["curve/f0"], color=GREY, lw=0.9, zorder=1, label=hidden("f0"))
    if (left > 0).all() and left.max() > 5 * left.min():
        top.set_yscale("log")
    middle.axhline(0, color=GREY, lw=0.6)
    scales = np.unique(b)
    for scale, look in looks(scales):
        here = b == scale
        label = f"${result['N'][here][0]:.0f}$" if sized else f"${number(scale)}$"
        draw_points(top, x[here], left[here], bars[here], ls="none", ms=3, label=label, **look)
        middle.plot(x[here], residuals[here], ls="none", ms=3, label=hidden(label), **look)
    symbol = SYMBOLS.get(attributes["observable"], "O")
    power = r"L^{y/\nu}" if sized else r"\dot\gamma^{-y/z\nu}"
    minus = rf"({symbol} - \mathrm{{corr.}})" if attributes["corrections"] else symbol
    span = r"L^{1/\nu}" if sized else r"\dot\gamma^{-1/z\nu}"
    top.set_ylabel(rf"${minus}\,{power}$")
    middle.set(xlabel=rf"$x=(\phi-\phi_J)\,{span}$", ylabel="residual / error")
    top.set_title(
        rf"$\chi^2/\mathrm{{dof}}={float(attributes['chi2']) / float(attributes['dof']):.3g}$",
        loc="right",
        pad=3,
    )
    columns = 2 if len(scales) > 5 else 1
    page.legend(top, title="$N$" if sized else r"$\dot\gamma$", ncol=columns)


def _draw_drift(ax, result, name, column):
    """A parameter against the cut, with its errors, and the band of the best value."""
    attributes, cut = result.attributes, result["drift/cut"]
    y, bars = result["drift/parameters"][:, column], result["drift/errors"][:, column]
    certain = np.isfinite(bars)
    ax.set_xscale("log")
    look = {"color": "0.1", "marker": "o", "ms": 3}
    draw_points(ax, cut[certain], y[certain], bars[certain], label=hidden(name), **look)
    ax.plot(
        cut[~certain], y[~certain], ls="none", mfc="white", label=hidden(f"{name}, without error"), **look
    )
    best, own_error = float(attributes[name]), float(np.nan_to_num(attributes[f"{name}_error"]))
    ax.axhspan(best - own_error, best + own_error, color="0.85", lw=0)
    sized = attributes["scaling"] == "size"
    ax.set(
        xlabel="smallest $N$" if sized else r"largest $\dot\gamma$", ylabel=f"${_PARAMETER_SYMBOLS[name]}$"
    )
    ax.set_xlim(cut.min() / 10**0.1, cut.max() * 10**0.1)
    bars = np.nan_to_num(bars)
    reach = DRIFT_RANGE * max(np.median(np.abs(y - best)), np.median(bars), own_error)
    low, high = min((y - bars).min(), best - own_error), max((y + bars).max(), best + own_error)
    low, high = max(low - 0.1 * own_error, best - reach), min(high + 0.1 * own_error, best + reach)
    if low < high:  # else there is a single value, without an error
        ax.set_ylim(low, high)


@picture("branches", "collapse", single=True)
def plot_branches(results, page):
    """The collapse in two branches (Vågberg, Fig. 5.1): O/γ̇^(y/zν), corrections taken off, against |φ − φ_J|/γ̇^(1/zν).

    Filled above φ_J, hollow below it, a colour for each rate; lines: the fitted f₀, dashed: slopes y and y − zν.
    Raises InputError for a collapse with the size, which has no rates.
    """
    (result,) = results
    attributes, x = result.attributes, result["x"]
    if attributes["scaling"] != "rate":
        raise InputError(f"{result.path}: a collapse of sizes, not of rates. Draw it as scaling.")
    rate, y, error = rescaled_values(result)
    scaled_y = rf"${SYMBOLS.get(attributes['observable'], 'O')}\,\dot\gamma^{{-y/z\nu}}$"
    ax = page.panels(1, 1, PAGE, 4.0, x=r"$|\phi-\phi_J|\,\dot\gamma^{-1/z\nu}$", y=scaled_y, log="xy")
    for single_rate, look in looks(np.unique(rate)):
        label = rf"${number(single_rate)}$"
        above = {"label": label, "markerfacecolor": look["color"]}
        below = {"label": hidden(f"{label}, below phi_J"), "markerfacecolor": "white"}
        for side, face in ((1, above), (-1, below)):
            here = (rate == single_rate) & (side * x > 0)
            if (y[here] > 0).any():
                draw_points(ax, np.abs(x[here]), y[here], error[here], ls="none", **look, **face)
    with limits_kept(ax):
        for side in (-1, 1):
            along = side * result["curve/x"] > 0
            curve = np.abs(result["curve/x"][along]), result["curve/f0"][along]
            ax.plot(*curve, color=GREY, lw=0.9, zorder=1)
    phi_J, exponent, znu = (float(attributes[name]) for name in ("phi_J", "y", "znu"))
    for side, slope, name in ((1, exponent, "y"), (-1, exponent - znu, r"y-z\nu")):
        draw_asymptote(ax, np.abs(x[side * x > 0]), y[side * x > 0], slope, name)
    title = rf"$\phi_J={phi_J:.4f}$, $y={exponent:.3g}$, $z\nu={znu:.3g}$"
    ax.set_title(title, loc="right", pad=3)
    page.legend(ax, title="$\\dot\\gamma$; hollow: $\\phi<\\phi_J$")
    return f"two branches of the {attributes['observable']} at {len(x)} points"


def draw_asymptote(ax, x, y, slope, name) -> None:
    """A dashed line of this slope and name through the points of largest x, of a branch (M,) of a collapse."""
    if not (y > 0).any():
        return
    last = np.flatnonzero(y > 0)[np.argmax(x[y > 0])]
    line = x[last] * np.array([ASYMPTOTE_START, 1.15])
    with limits_kept(ax):
        ax.plot(
            line,
            y[last] * (line / x[last]) ** slope,
            color=GREY,
            lw=0.9,
            ls="--",
            zorder=1,
            label=hidden(name),
        )
    look = {"textcoords": "offset points", "ha": "right", "va": "center", "color": "0.25"}
    ax.annotate(f"slope ${name}={slope:.2f}$", (x[last], y[last]), (-10, 0), **look)
