"""Collapse of flows near jamming in two branches, as in Vågberg's Fig. 5.1: O/γ̇^(y/zν) against |φ − φ_J|/γ̇^(1/zν)."""

import numpy as np

from jampetsc.errors import InputError
from jampetsc.plots.logaxes import place_legend, set_log_axes
from jampetsc.plots.scaling import SYMBOLS
from jampetsc.plots.style import GREY, MARKERS, PAGE, colours, figure, number, save

HEIGHT = 4.0  # inches


def plot_branches(result, path) -> None:
    """Filled above φ_J, hollow below it, a colour for each rate; lines: the fitted f₀. Corrections are taken off.

    Raises InputError for a collapse with the size, which has no rates.
    """
    a = result.attributes
    if a["scaling"] != "rate":
        raise InputError(f"{result.path}: is a collapse of sizes: branches are of rates; take --kind scaling")
    rate, x = result["rate"], result["x"]
    unit = rate ** (float(a["y"]) / float(a["znu"]))
    y, error = (result["value"] - result["correction"]) / unit, result["error"] / unit
    scales = np.unique(rate)
    with figure(PAGE, HEIGHT, layout="constrained") as fig:
        ax = fig.subplots()
        for side in (-1, 1):
            along = side * result["curve/x"] > 0
            ax.plot(np.abs(result["curve/x"][along]), result["curve/f0"][along], color=GREY, lw=0.9, zorder=1)
        drawn = []
        for one, colour, marker in zip(scales, colours(len(scales)), MARKERS * len(scales), strict=False):
            for side, face, label in ((1, colour, rf"${number(one)}$"), (-1, "white", None)):
                here = (rate == one) & (side * x > 0) & (y > 0)
                if here.any():
                    drawn.append((np.abs(x[here]), y[here]))
                    look = {"color": colour, "marker": marker, "ls": "none", "markerfacecolor": face}
                    ax.errorbar(*drawn[-1], error[here], elinewidth=0.6, label=label, **look)
        set_log_axes(ax, drawn)
        symbol = SYMBOLS[str(a["observable"])]
        ax.set(
            xlabel=r"$|\phi-\phi_J|\,\dot\gamma^{-1/z\nu}$",
            ylabel=rf"${symbol}\,\dot\gamma^{{-y/z\nu}}$",
        )
        told = rf"$\phi_J={float(a['phi_J']):.4f}$, $y={float(a['y']):.3g}$, $z\nu={float(a['znu']):.3g}$"
        ax.set_title(told, loc="right", pad=3)
        handles, _ = ax.get_legend_handles_labels()
        place_legend(fig, ax, "$\\dot\\gamma$; hollow: $\\phi<\\phi_J$", handles, drawn)
        save(fig, path)
