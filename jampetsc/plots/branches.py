"""Collapse of flows near jamming in two branches, as in Vågberg's Fig. 5.1: O/γ̇^(y/zν) against |φ − φ_J|/γ̇^(1/zν)."""

import numpy as np

from jampetsc.errors import InputError
from jampetsc.plots.page import points
from jampetsc.plots.picture import picture
from jampetsc.plots.scaling import SYMBOLS
from jampetsc.plots.style import GREY, PAGE, hidden, looks, number

HEIGHT = 4.0  # inches


@picture("branches", "collapse", single=True)
def plot_branches(results, page):
    """Filled above φ_J, hollow below it, a colour for each rate; lines: the fitted f₀. Corrections are taken off.

    Raises InputError for a collapse with the size, which has no rates.
    """
    (result,) = results
    a = result.attributes
    if a["scaling"] != "rate":
        raise InputError(f"{result.path}: is a collapse of sizes: branches are of rates; draw it as scaling")
    rate, x = result["rate"], result["x"]
    unit = rate ** (float(a["y"]) / float(a["znu"]))
    y, error = (result["value"] - result["correction"]) / unit, result["error"] / unit
    symbol = SYMBOLS[str(a["observable"])]
    ax = page.panels(1, 1, PAGE, HEIGHT)
    ax.set(xlabel=r"$|\phi-\phi_J|\,\dot\gamma^{-1/z\nu}$", ylabel=rf"${symbol}\,\dot\gamma^{{-y/z\nu}}$")
    ax.set(xscale="log", yscale="log")
    scales = np.unique(rate)
    for one, look in zip(scales, looks(len(scales)), strict=True):
        for side, face in ((1, look["color"]), (-1, "white")):
            here, label = (rate == one) & (side * x > 0), rf"${number(one)}$"
            if (y[here] > 0).any():
                label = label if side > 0 else hidden(f"{label}, below phi_J")
                points(
                    ax,
                    np.abs(x[here]),
                    y[here],
                    error[here],
                    ls="none",
                    markerfacecolor=face,
                    label=label,
                    **look,
                )
    kept = ax.dataLim.frozen()
    for side in (-1, 1):
        along = side * result["curve/x"] > 0
        ax.plot(np.abs(result["curve/x"][along]), result["curve/f0"][along], color=GREY, lw=0.9, zorder=1)
    ax.dataLim.set(kept)
    told = rf"$\phi_J={float(a['phi_J']):.4f}$, $y={float(a['y']):.3g}$, $z\nu={float(a['znu']):.3g}$"
    ax.set_title(told, loc="right", pad=3)
    page.legend(ax, title="$\\dot\\gamma$; hollow: $\\phi<\\phi_J$")
    return f"two branches of the {a['observable']} at {len(result['x'])} points"
