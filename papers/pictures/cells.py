"""The pressure of flows at φ_J in cells of several N."""

import numpy as np

import jampetsc
from jampetsc.plots.page import draw_points
from jampetsc.plots.style import GREY, PAGE, looks
from papers.claims.finite_cells import cells, larger_cells
from papers.claims.flow import PHI_J
from papers.pictures.shared import beside, drawn


@drawn("finite-size-flow")
def finite_cells(page, folder):
    """p at φ_J against γ̇ in cells of several N, and collapsed: p N^(y/2ν) against γ̇ N^(z/2)."""
    flows = jampetsc.load(folder).where(command="flow", phi=PHI_J)
    others = [beside(folder, name) for name in ("vagberg-flow-curves", "vagberg-fig5.1-slow")]
    larger = larger_cells(flows, *map(jampetsc.load, others)) if all(others) else ()
    found = cells(flows, *larger)[PHI_J]
    axes = page.panels(
        1,
        2,
        PAGE,
        2.9,
        log="xy",
        x=[r"$\dot\gamma$", r"$\dot\gamma N^{z/2}$"],
        y=["$p/k$", r"$p\,N^{y/2\nu}/k$"],
    )
    for n, look in looks(np.unique(found.n)):
        here = found.n == n
        for ax, points in zip(
            axes, ((found.rate, found.pressure, found.error), found.collapsed), strict=True
        ):
            values = (column[here] for column in points)
            draw_points(ax, *values, ls="none", ms=3.5, label=f"$N={n:.0f}$", **look)
    x = found.collapsed[0]
    line = np.geomspace(x.min(), x.max())
    axes[1].plot(line, found.curve(line), color=GREY, lw=0.8, zorder=1, label="fit")
    z, power = 2 * found.stretch.value, 2 * found.shrink.value
    axes[1].set_title(rf"$z={z:.2f}$, $y/\nu={power:.2f}$", loc="right", pad=3)
    page.legend(axes[0], first="lower right")
