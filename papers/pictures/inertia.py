"""The start of flow of heavy disks beside the response in time of sweeps with masses."""

import numpy as np
from scipy.integrate import cumulative_trapezoid

from jampetsc.plots.style import PAGE, colours, hidden
from papers.pictures.shared import drawn, results

POINTS = 4000  # of time
SHOWN = 6  # rows of a flow for each point that is drawn


@drawn("inertia-start")
def start_of_flow(page, folder):
    """[σ(t) − σ(0)]/γ of flows, points, and (η + ∫₀ᵗ G dt)/t of sweeps, lines; their difference."""
    flows, sweeps = (
        {run.attributes["mass"]: run for run in results(folder, command=name)} for name in ("flow", "sweep")
    )
    axes = page.panels(
        1, 2, PAGE, 2.7, log=["xy", "x"], x=r"$t/\tau_1$", y=[r"$[\sigma(t)-\sigma(0)]/k\gamma$", "difference / %"]
    )  # fmt: skip
    for (mass, sweep), color in zip(sorted(sweeps.items()), colours(len(sweeps)), strict=True):
        flow = flows[mass]
        rate, start = flow.attributes["rate"], flow["start/shear_stress"][0]
        time, stress = flow["strain"] / rate, flow["shear_stress"].sum(axis=1)
        grid = np.linspace(0.0, time[-1], POINTS)
        viscosity = sweep.reduced_inertia.b_gg.item()
        strained = viscosity + cumulative_trapezoid(sweep.stress_relaxation(grid), grid, initial=0.0)
        means = cumulative_trapezoid(strained, grid, initial=0.0)
        edges = np.append(0.0, time)
        expected = np.diff(np.interp(edges, grid, means)) / np.diff(edges)
        middle, found = 0.5 * (edges[1:] + edges[:-1]), (stress - start) / rate
        label = f"$Q={np.sqrt(mass):g}$"
        axes[0].plot(grid[1:], strained[1:] / grid[1:], color=color, lw=0.9, label=hidden(f"{label}, sweep"))
        few = np.unique(np.geomspace(1, len(middle), len(middle) // SHOWN).astype(int)) - 1
        axes[0].plot(
            middle[few], (found / middle)[few], color=color, ls="none", marker="o", ms=2.5, label=label
        )
        axes[1].plot(middle, 100.0 * (found / expected - 1.0), color=color, lw=0.8, label=hidden(label))
    page.legend(axes[0])
