"""The pressure above φ_J, of quasistatic shear and of random starts."""

import numpy as np

import jampetsc
from jampetsc.plots.page import draw_points
from jampetsc.plots.style import PAGE, hidden, looks
from papers.claims.above import rises
from papers.pictures.shared import drawn


@drawn("above-jamming")
def pressure_above(page, folder):
    """⟨p⟩ against φ − φ_J with φ_J of each fit, and over it, where y = 1 is level; lines: A (φ − φ_J)^y."""
    axes = page.panels(
        1, 2, PAGE, 2.9, log=["xy", "x"], x=r"$\phi-\phi_J$", y=["$p/k$", r"$p\,/\,k(\phi-\phi_J)$"]
    )  # fmt: skip
    found = rises(jampetsc.load(folder))
    for (name, n), look in looks(sorted(found)):
        rise = found[name, n]
        x = rise.phi - rise.phi_J.value
        line = np.geomspace(x[0], x[-1])
        face = {"markerfacecolor": "white"} if name == "RAND" else {}
        label = f"{name}, $N={n}$: $y={rise.y.value:.2f}({100 * rise.y.inflated:.0f})$"
        for ax, power in zip(axes, (0, 1), strict=True):
            draw_points(
                ax,
                x,
                rise.pressure / x**power,
                rise.error / x**power,
                ls="none",
                ms=3.5,
                label=label,
                **look | face,
            )
            ax.plot(
                line,
                rise.A * line ** (rise.y.value - power),
                color=look["color"],
                lw=0.9,
                label=hidden(label),
            )
    page.legend(axes[0], first="upper left")
