"""Collapse of an observable near jamming, with residuals and the drift of every parameter (Vågberg, thesis ch. 5)."""

import numpy as np

from jampetsc.plots.logaxes import set_ticks
from jampetsc.plots.style import GREY, MARKERS, PAGE, colours, figure, letter_panels, number, save

HEIGHTS = (3.0, 1.4, 1.9)  # inches of collapse, residuals and drift
REACH = 6.0  # from the best value in sight, in typical changes or errors: beyond, a fit has lost its way
SYMBOLS = {"pressure": "p", "shear_stress": r"\sigma", "jammed": "f"}
_NAMES = {"phi_J": r"\phi_J", "y": "y", "znu": r"z\nu", "nu": r"\nu", "omega": r"\omega"}


def plot_scaling(result, path) -> None:
    """O/b^(y/κ) against x with f₀, corrections taken off; residuals in standard errors; parameters against the cut."""
    a = result.attributes
    sized = a["scaling"] == "size"
    b = 1 / result["size"] if sized else result["rate"]
    kappa = "nu" if sized else "znu"
    unit = b ** (float(a["y"]) / float(a[kappa]))
    value, error = result["value"], result["error"]
    left = (value - result["correction"]) / unit
    residuals = (value - result["leading"] - result["correction"]) / error
    names = str(a["fitted"]).split(",")
    scales = np.unique(b)
    with figure(PAGE, sum(HEIGHTS), layout="constrained") as fig:
        grid = fig.add_gridspec(3, len(names), height_ratios=HEIGHTS)
        top = fig.add_subplot(grid[0, :])
        middle = fig.add_subplot(grid[1, :], sharex=top)
        top.plot(result["curve/x"], result["curve/f0"], color=GREY, lw=0.9, zorder=1)
        middle.axhline(0, color=GREY, lw=0.6)
        for scale, colour, marker in zip(scales, colours(len(scales)), MARKERS * len(scales), strict=False):
            here = b == scale
            look = {"color": colour, "marker": marker, "ls": "none", "ms": 3}
            x = result["x"][here]
            label = f"${1 / scale**2:.0f}$" if sized else f"${number(scale)}$"
            top.errorbar(x, left[here], error[here] / unit[here], elinewidth=0.6, label=label, **look)
            middle.plot(x, residuals[here], **look)
        symbol = SYMBOLS[str(a["observable"])]
        power = r"L^{y/\nu}" if sized else r"\dot\gamma^{-y/z\nu}"
        minus = rf"({symbol} - \mathrm{{corr.}})" if a["corrections"] else symbol
        top.set(ylabel=rf"${minus}\,{power}$")
        if (left > 0).all() and left.max() > 5 * left.min():
            top.set_yscale("log")
        top.legend(title="$N$" if sized else r"$\dot\gamma$", ncol=2 if len(scales) > 5 else 1)
        span = r"L^{1/\nu}" if sized else r"\dot\gamma^{-1/z\nu}"
        middle.set(xlabel=rf"$x=(\phi-\phi_J)\,{span}$", ylabel="residual / error")
        top.set_title(
            rf"$\chi^2/\mathrm{{dof}}={float(a['chi2']) / float(a['dof']):.3g}$", loc="right", pad=3
        )
        drifts = [fig.add_subplot(grid[2, column]) for column in range(len(names))]
        for column, (ax, name) in enumerate(zip(drifts, names, strict=True)):
            y, bars = result["drift/parameters"][:, column], result["drift/errors"][:, column]
            known = np.isfinite(bars)
            look = {"color": "0.1", "marker": "o", "ms": 3}
            cut = result["drift/cut"]
            ax.errorbar(cut[known], y[known], bars[known], capsize=1.5, elinewidth=0.6, **look)
            ax.plot(cut[~known], y[~known], ls="none", mfc="white", **look)  # the data do not tell it
            best, own = float(a[name]), float(np.nan_to_num(a[f"{name}_error"]))
            bars = np.nan_to_num(bars)
            ax.axhspan(best - own, best + own, color="0.85", lw=0)
            ax.set(xscale="log", xlabel="smallest $N$" if sized else r"largest $\dot\gamma$")
            ends = np.log10(result["drift/cut"].min()) - 0.1, np.log10(result["drift/cut"].max()) + 0.1
            ax.set_xlim(10 ** ends[0], 10 ** ends[1])
            if sized:  # N spans less than two decades; of rates there is room for whole ones alone
                set_ticks(ax.xaxis, *ends)
            ax.set_ylabel(f"${_NAMES[name]}$")
            reach = REACH * max(np.median(np.abs(y - best)), np.median(bars), own)
            low, high = min((y - bars).min(), best - own), max((y + bars).max(), best + own)
            ax.set_ylim(max(low - 0.1 * own, best - reach), min(high + 0.1 * own, best + reach))
        letter_panels([top, middle, *drifts])
        save(fig, path)
