"""V's figures 4.6, 4.7 and 5.1."""

from pathlib import Path

import numpy as np

from jampetsc.io.disk_motion import six_fold_order, snapshot
from jampetsc.plots.cell_drawing import disk_images, draw_circles, wrap
from jampetsc.plots.flow_plots import CURVE_HEIGHT, ORDERS, flow_curves, plot_flow
from jampetsc.plots.page import draw_band, draw_points, draw_power_law, limits_kept
from jampetsc.plots.style import GREY, PAGE, entry, hidden, looks, number
from papers.pictures.shared import drawn, results

PHI_J, Y, ZNU = 0.8433, 1.1, 3.5  # of Vågberg
MIN_ASYMPTOTIC_X = 0.5  # of points on an asymptote
SLOPE = Y / ZNU  # of p at φ_J
SIZES = (("monodisperse", "Fig. 4.6, one size"), ("bidisperse", "Fig. 4.7, two sizes"))


@drawn("vagberg-fig4.6-4.7")
def configurations(page, folder):
    """Disks of one size and of two at the start and the end of shear, and their order |⟨ψ₆⟩| over the strain."""
    names = [["a", "b", "order"], ["c", "d", "order"]]
    a, b, order, c, d = page.mosaic(names, PAGE, 4.3, (1, 1))
    styles = dict(looks(sizes for sizes, _ in SIZES))
    for (sizes, words), pair in zip(SIZES, ((a, b), (c, d)), strict=True):
        runs = results(folder, command="flow", sizes=sizes)
        for ax, row in zip(pair, (0, -1), strict=True):
            _configuration(ax, snapshot(runs[0], row))
            strain = runs[0]["snapshots/strain"][row]
            ax.set_title(rf"{words}, $\gamma={strain:.3g}$", loc="right", pad=3, fontsize=8)
        strain, values = runs[0]["snapshots/strain"], np.array([six_fold_order(run)[1] for run in runs])
        colour = styles[sizes]["color"]
        draw_band(order, strain, values.min(0), values.max(0), f"{sizes}, all runs", color=colour)
        order.plot(strain, values.mean(0), color=colour, lw=1.6, label=sizes)
    order.set(xlabel=r"$\gamma$", ylabel=ORDERS[1], ylim=(0.0, 1.0), xlim=(0.0, strain[-1]))
    page.legend(order, title=f"mean and range of {len(runs)} runs", first="upper right")


def _configuration(ax, disks):
    """Disks of a cell, cut at the edge of the picture; large ones are darker."""
    rows, places = disk_images(wrap(disks.positions, disks.cell), disks.radii, disks.cell)
    radii = disks.radii[rows]
    faces = np.where(radii > disks.radii.min(), "0.62", "0.85")
    draw_circles(ax, places, 2 * radii, facecolors=faces, edgecolors="0.3", linewidths=0.3)
    sides = disks.cell[0, 0], disks.cell[1, 1]
    ax.set(xlim=(0.0, sides[0]), ylim=(0.0, sides[1]), aspect="equal", xticks=(), yticks=())


@drawn("vagberg-fig5.1")
def branches(page, folder):
    """p/γ̇^(y/zν) against |φ − φ_J|/γ̇^(1/zν) with V's φ_J, y and zν, and the slopes y and y − zν of large arguments."""
    places = [place for place in (Path(folder), Path(folder) / "wide") if (place / "table.csv").exists()]
    curves = flow_curves([run for place in places for run in results(place, command="flow")])
    rows = [(kind[1], *row) for kind, curve in curves.items() for row in zip(*curve["pressure"], strict=True)]
    phi, rate, p, error = np.transpose(rows)
    x, unit = (phi - PHI_J) / rate ** (1 / ZNU), rate ** (Y / ZNU)
    y, error = p / unit, error / unit
    labels = {"x": r"$|\phi-\phi_J|\,\dot\gamma^{-1/z\nu}$", "y": r"$p\,\dot\gamma^{-y/z\nu}$"}
    ax = page.panels(1, 1, 5.4, 4.2, **labels, log="xy")
    for shown_rate, look in looks(np.unique(rate)):
        for side, face in ((1, {"label": f"${number(shown_rate)}$"}), (-1, {"markerfacecolor": "white"})):
            here = (rate == shown_rate) & (side * x > 0) & (p > 0)
            face = {"label": hidden(f"{shown_rate:g}, below phi_J")} | face
            draw_points(ax, np.abs(x[here]), y[here], error[here], ls="none", **look | face)
    for side, slope, name in ((1, Y, "y"), (-1, Y - ZNU, r"y-z\nu")):
        far = (side * x > MIN_ASYMPTOTIC_X) & (p > 0) & (np.abs(phi - PHI_J) < 0.05)
        if not far.any():
            continue
        level = np.exp(np.mean(np.log(y[far]) - slope * np.log(np.abs(x[far]))))
        line = np.array([0.12, 1.2 * np.abs(x[side * x > 0]).max()])
        with limits_kept(ax):
            ax.plot(line, level * line**slope, color=GREY, lw=0.9, ls="--", zorder=1, label=hidden(name))
        middle = line[0] ** 0.35 * line[1] ** 0.65
        look = {"textcoords": "offset points", "ha": "right", "va": "bottom" if side > 0 else "top"}
        ax.annotate(rf"slope ${name}={slope:.1f}$", (middle, level * middle**slope), (-6, 2 * side), **look)
    ax.set_title(rf"$\phi_J={PHI_J}$, $y={Y}$, $z\nu={ZNU}$ (V's)", loc="right", pad=3)
    page.legend(ax, title="$\\dot\\gamma$; hollow: $\\phi<\\phi_J$", first="lower left")


@drawn("models-at-phi_J")
@drawn("flow-curves-at-phi_J")
def at_phi_J(page, folder):
    """Flow curves at φ_J as `jampetsc plot --kind flow` draws them, with the slope y/zν of V in (b) and (e)."""
    axes = page.panels(2, 3, PAGE, 2 * CURVE_HEIGHT)
    plot_flow(results(folder, command="flow", phi=PHI_J), ax=axes)
    for points in axes[1].containers:
        draw_power_law(axes[1], *points.lines[0].get_data(), SLOPE)
    axes[4].axhline(SLOPE, color=GREY, lw=0.8, ls=":", zorder=0)
    # on axes of its own `plot_flow` has put the legend on data
    title = axes[0].get_legend().get_title().get_text()
    handles = axes[0].get_legend_handles_labels()[0]
    handles.append(entry(rf"$y/z\nu={SLOPE:.3f}$ (V)", GREY, lw=0.8, ls=":"))
    page.legend(axes[0], handles, title, fontsize=7.5, handlelength=1.2, labelspacing=0.2)
