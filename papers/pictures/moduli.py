"""BT's figures 1 and 4, local exponents of figure 3, and η₀ with over without pre-stress."""

from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.patches import Patch

import jampetsc
from jampetsc.analysis.power_laws import local_slope
from jampetsc.analysis.statistics import log_median
from jampetsc.io.disk_motion import field_at, packing_of, particle_rows, phase_factor
from jampetsc.packing.contacts import measure
from jampetsc.packing.neighbours import lengths
from jampetsc.plots.cell_drawing import draw_circles, wrap
from jampetsc.plots.moduli_plots import average_files, plot_collapse, plot_moduli
from jampetsc.plots.page import draw_guide, draw_points
from jampetsc.plots.quasistatic_plots import plot_viscosities
from jampetsc.plots.style import (
    GREY,
    LOSS,
    OPEN,
    PAGE,
    STORAGE,
    colours,
    entry,
    hidden,
    looks,
    power_or_number,
)
from papers.claims.moduli import curves_of, median_curve
from papers.pictures.shared import beside, drawn, results

WINDOW = 26.0  # side of the part of a packing in mean diameters
INSET = (0.02, 0.555, 0.34, 0.40)  # left, bottom, width and height in the panel, above G' at low ω
ARROWS = 16  # along the cell
ARROW_LENGTH = 1.5  # 90th percentile, in distances between arrows
INTERVAL = Patch(facecolor="0.2", alpha=0.25, label="68 % interval")


@drawn("bt-fig1")
def moduli_and_packing(page, folder):
    """G' and G'' with slopes ½ and 1; inset: a part of the first packing."""
    sweeps = results(folder, command="sweep")
    ax = page.panels(1, 1, 5.2, 4.2)
    several = len(sweeps) > 1
    plot_moduli(sweeps, ax=ax, **({"statistic": "median"} if several else {}))
    (curve,), *_ = average_files(sweeps, "median")
    draw_guide(ax, curve.omega, curve.G.imag, 0.5, r"\omega", True)
    n, p = (sweeps[0].attributes[name] for name in ("particle_count", "pressure"))
    packings = f"{len(sweeps)} packings" if several else "one packing"
    title = rf"$N={n}$, $p/k={power_or_number(p)}$, $\beta=1$, {packings}"
    ax.set_title(title, loc="right", pad=3)
    page.legend(ax, _parts())
    _part(ax.inset_axes(INSET), packing_of(sweeps[0]))


@drawn("bt-fig1-fields")
def fields(page, folder):
    """Non-affine displacements of the first packing at zero and at peak stress, at each frequency that has a field."""
    sweep, *_ = results(folder, command="sweep")
    disks, frequencies = packing_of(sweep), sweep.fields.omega
    axes = page.panels(2, len(frequencies), PAGE, 5.2)
    moments = (("zero", lambda u: -u.imag), ("peak", np.real))
    for n, (ax, (when, omega)) in enumerate(zip(axes, product(dict(moments), frequencies), strict=True)):
        turn = phase_factor(sweep, omega, "stress")
        _arrows(ax, sweep, disks, n % len(frequencies), turn, dict(moments)[when])
        ax.set_title(rf"$\omega\tau_1={power_or_number(omega)}$, {when} stress", loc="right", pad=3)


def _parts():
    """Entries of G' and G'' in a legend."""
    return [entry(STORAGE, marker="o"), entry(LOSS, marker="o", mew=0.7, **OPEN)]


def _part(ax, disks):
    """Disks, rattlers hollow, and contacts in a square in the middle of the cell."""
    state, centres = measure(disks), wrap(disks.positions, disks.cell)
    middle, side = 0.5 * disks.cell.sum(0), WINDOW * 2 * disks.radii.mean()
    near = (np.abs(centres - middle) < 0.5 * side + disks.radii.max() * 2).all(axis=1)
    faces = np.where(state.rattlers[near], "white", "0.88")
    draw_circles(ax, centres[near], 2 * disks.radii[near], facecolors=faces, edgecolors="0.6", linewidths=0.3)
    seen = near[state.contacts.i]
    starts = centres[state.contacts.i[seen]]
    lines = np.stack((starts, starts + state.contacts.r[seen]), axis=1)
    widths = 0.6 * state.contacts.force[seen] / state.contacts.force.mean()
    look = {"colors": "0.05", "capstyle": "round", "label": hidden("contacts")}
    ax.add_collection(LineCollection(lines, linewidths=widths, **look), autolim=False)
    edges = [(x - 0.5 * side, x + 0.5 * side) for x in middle]
    ax.set(xlim=edges[0], ylim=edges[1], aspect="equal", xticks=(), yticks=())
    words = f"{WINDOW:g} of {np.sqrt(disks.volume) / (2 * disks.radii.mean()):.0f} diameters"
    ax.set_title(words, fontsize=7.5, pad=2)


def _arrows(ax, sweep, disks, row, turn, part):
    """Non-affine displacements, means over ARROWS² parts of the cell; below, their rms over that of the affine part."""
    centres = wrap(disks.positions, disks.cell)[particle_rows(sweep, disks)]
    nonaffine = part(turn * np.array(field_at(sweep, row)[0]))
    affine = part(turn * (centres[:, 1] - 0.5 * disks.cell[1, 1]))
    share = np.sqrt(np.sum(nonaffine**2) / np.sum(affine**2))
    places = np.floor(centres @ np.linalg.inv(disks.cell) * ARROWS).astype(int)
    filled, owners, counts = np.unique(places, axis=0, return_inverse=True, return_counts=True)
    sums = [np.bincount(owners.ravel(), weights=column) for column in nonaffine.T]
    u, spacing = np.transpose(sums) / counts[:, None], np.sqrt(disks.volume) / ARROWS
    factor = ARROW_LENGTH * spacing / np.quantile(lengths(u), 0.9)
    look = {
        "angles": "xy",
        "scale_units": "xy",
        "scale": 1.0,
        "width": 0.004,
        "pivot": "middle",
        "headwidth": 3.5,
        "headlength": 4,
    }
    ax.quiver(*(((filled + 0.5) / ARROWS) @ disks.cell).T, *(factor * u).T, label=hidden("arrows"), **look)
    edges = [(0.0, side) for side in disks.cell.sum(0)]
    ax.set(xlim=edges[0], ylim=edges[1], aspect="equal", xticks=(), yticks=())
    ax.set_xlabel(rf"rms $u_{{\rm na}}={share:.2g}$ of the affine part", fontsize=8)


@drawn("bt-fig4a")
def no_sliding_damping(page, folder):
    """β = 0 with and without pre-stress: moduli over p^½ against the frequency as it is."""
    axes = page.panels(1, 2, PAGE, 3.1, sharey=True)
    for ax, prestress, words in zip(axes, (1, 0), ("pre-stress", "no pre-stress"), strict=True):
        sweeps = results(folder, command="sweep", beta=0.0, prestress=prestress)
        plot_collapse(sweeps, ax=ax, statistic="median", mu=0.5, **{"lambda": 0.0})
        ax.set_title(rf"$\beta=0$, {words}", loc="right", pad=3)
    axes[1].set_ylabel("")


@drawn("bt-fig4b")
def sliding_damping(page, folder):
    """Moduli at p = 1e-4 for all β, and the viscosities of the inset."""
    axes = page.panels(1, 2, PAGE, 3.1)
    sweeps = results(folder, command="sweep", pressure=1e-4, prestress=1)
    plot_moduli(sweeps, ax=axes[0], statistic="median")
    axes[0].set_title(rf"$N={sweeps[0].attributes['particle_count']}$, $p/k=10^{{-4}}$", loc="right", pad=3)
    page.legend(axes[0], [entry(r"$\beta=0$", GREY), *_parts(), INTERVAL])
    plot_viscosities(results(folder, command="quasistatic", pressure=1e-4), ax=axes[1])
    (colour,) = colours(1)
    names = ((r"$\eta_0$", {}), (r"$\eta_\infty$", OPEN))
    handles = [entry(name, colour, marker="o", mew=0.7, **face) for name, face in names]
    page.legend(axes[1], [*handles, INTERVAL], first="upper left")


@drawn("bt-viscosity-ratio")
def with_over_without(page, folder):
    """R = η₀ with over without pre-stress of each packing, medians with their errors, against pN²: one curve."""
    ratios = {}
    largest = Path(folder) / "largest"
    for place in filter(None, (folder, largest if largest.exists() else None, beside(folder, "bt-fig3"))):
        rows = jampetsc.load(place).where(command="quasistatic", law="contact", state="done")
        for key, part in rows.groups(["n", "pressure"]):
            ratio = part["eta0"] / part["no_prestress_eta0"]
            levels = ratios.setdefault(key["n"], {})
            if len(ratio) > len(
                levels.get(key["pressure"], ())
            ):  # both folders have the packings of the first seeds
                levels[key["pressure"]] = ratio
    ax = page.panels(1, 1, 4.6, 3.2, x="$N^2p/k$", y=r"$\eta_0$ with over without pre-stress", log="xy")
    ax.axhline(1.0, color=GREY, lw=0.6, ls=":")
    for (n, levels), look in looks(sorted(ratios.items())):
        p = np.array(sorted(levels))
        middle, error = np.transpose([log_median(levels[pressure]) for pressure in p])
        factor = np.exp(error)
        bars = np.exp(middle) * np.array([1 - 1 / factor, factor - 1])
        draw_points(ax, p * n**2, np.exp(middle), bars, label=f"$N={n:.0f}$", lw=0.7, **look)
    page.legend(ax, title="medians, standard errors", first="upper left")


@drawn("bt-fig3-exponents")
def local_exponents(page, folder):
    """d ln G′/d ln ω and d ln G″/d ln ω of medians over packings against ω/p, β = 1 with pre-stress."""
    names = [
        r"$\mathrm{d}\ln G^{\prime}/\mathrm{d}\ln\omega$",
        r"$\mathrm{d}\ln G^{\prime\prime}/\mathrm{d}\ln\omega$",
    ]
    axes = page.panels(1, 2, PAGE, 2.9, x=r"$\omega\tau_1\,k/p$", y=names, log="x")
    sweeps = jampetsc.load(folder).where(command="sweep", state="done", rotations=1, prestress=1)
    groups = dict(curves_of(sweeps))
    for p, look in looks(sorted(groups)):
        omega, G = median_curve(groups[p])
        for ax, part in zip(axes, (G.real, G.imag), strict=True):
            ax.plot(
                omega / p,
                local_slope(omega, part),
                color=look["color"],
                lw=1.0,
                label=f"${power_or_number(p)}$",
            )
    for ax in axes:
        ax.axhline(0.5, color=GREY, lw=0.6, ls=":", zorder=0)
    page.legend(axes[0], title="$p/k$", first="upper left")
