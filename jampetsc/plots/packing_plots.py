"""Packings, networks and snapshots of flows, with contacts and forces."""

import numpy as np
from matplotlib.collections import LineCollection

from jampetsc.errors import InputError, about, named
from jampetsc.flows.walls import phi_between
from jampetsc.io.disk_motion import snapshot
from jampetsc.io.packing_file import source_name
from jampetsc.options.parameters import NUMBER
from jampetsc.packing.contacts import find_contacts, measure, virial_pressure
from jampetsc.packing.packing import PARTICLES, require_plane
from jampetsc.plots.cell_drawing import (
    clip_artists,
    draw_disks,
    draw_forces,
    frame_cells,
    lay_out,
    segment_images,
    wrap,
)
from jampetsc.plots.flow_plots import kind_of, labels_of
from jampetsc.plots.picture import option, picture
from jampetsc.plots.sphere_drawing import draw_spheres
from jampetsc.plots.style import COLUMN, PAGE, hidden, number, power_or_number

DRAW_SPHERES = "Draw it in OVITO or ParaView: jampetsc export FILE --out FILE.xyz or FILE.vtp."
MAX_VECTOR_DISKS = 5000  # beyond, vector files hold pixels and outlines are thin
FORCE_WIDTH = 0.18  # of the line of a mean force, in mean radii
MAX_SNAPSHOTS = 4  # side by side
MAX_VECTOR_BONDS = 15000  # beyond, vector files hold pixels
REST_COLOUR, PUSH_COLOUR, PULL_COLOUR = (
    "0.15",
    "#b2182b",
    "#2166ac",
)  # colours of bonds without force, that push, that pull
NETWORK_LINE_WIDTH = 1.6  # points: of the largest force, and of bonds without any at half this width


def refuse_spheres(source) -> None:
    """Raise InputError for a packing or a network in three dimensions."""
    with about(source_name(source)):
        require_plane(source, DRAW_SPHERES)


HEIGHT = option(
    "height", NUMBER, "packing, minimum, snapshot: height of the slice of spheres over that of the cell (default 0.5)",
    "Z", low=0, high=1,
)  # fmt: skip


@picture("packing", "packing", single=True, options=(HEIGHT,))
def plot_packing(results, page, height=None):
    """Disks grey, rattlers hollow, contacts as lines whose width is proportional to the force.

    Contacts and disks that cross the boundary appear on both sides of the cell, cut at its edge. Of spheres a slice
    z = height·L_z is drawn in this way, beside a view of the cell, as `sphere_drawing.draw_spheres` says.

    Raises InputError for a height of disks.
    """
    (disks,) = results
    state = measure(disks)
    rattlers = int(np.count_nonzero(state.rattlers))
    hollow = f"{rattlers} rattler{'' if rattlers == 1 else 's'}" if rattlers else ""
    caption = _caption(disks, state.contacts, state.pressure, state.coordination, hollow)
    _draw(page, [("", disks, state.contacts, state.rattlers, caption)], height)
    return f"packing of {disks.n} {PARTICLES[disks.dimension]}"


@picture("minimum", "shear", single=True, options=(HEIGHT,))
def plot_minimum(results, page, height=None):
    """The last minimum of quasistatic shear, as `plot_packing`."""
    (result,) = results
    plot_packing.function([result.last], page, height)
    return f"{result.last.n} {PARTICLES[result.last.dimension]} at strain {result['strain'][-1]:.4g}"


@picture("snapshot", "flow", options=(HEIGHT,))
def plot_snapshots(results, page, height=None):
    """Disks under shear, side by side: the last snapshot of each file, and the first where it is the start.

    Spheres as in `plot_packing`, a row for each snapshot.

    Forces do not balance: every contact is drawn, and disks that touch nothing are hollow. Disks of
    walls, the first ones by the record of the packing, are dark. Raises InputError for more panels than fit.
    """
    titles = labels_of([kind_of(result) for result in results]) if len(results) > 1 else [""]
    panels, shown = [], []
    for title, result in zip(titles, results, strict=True):
        snapshot(result)  # there is one
        strain = result["snapshots/strain"]
        rows = (0, -1) if strain[0] == 0 else (-1,)
        for row in rows:
            disks, at = snapshot(result, row), rf"$\gamma={strain[row]:.4g}$" if len(rows) > 1 else ""
            panels.append(flow_panel(", ".join(filter(None, (title, at))), disks))
            shown.append(
                f"{disks.n - disks.record.get('walls', 0)} {PARTICLES[disks.dimension]} at strain {strain[row]:.4g}"
            )
    _draw(page, panels, height)
    return f"contacts of {', '.join(shown)}"


def find_touching(disks):
    """(all contacts, number of each disk's (N,), mask (N,) of disks without contacts that are not of a wall)."""
    contacts = find_contacts(disks)
    number = np.bincount(np.r_[contacts.i, contacts.j], minlength=disks.n)
    return contacts, number, (number == 0) & (np.arange(disks.n) >= disks.record.get("walls", 0))


def flow_panel(title, disks):
    """A panel of disks that are not at rest."""
    contacts, number, alone = find_touching(disks)
    walls = disks.record.get("walls", 0)
    pressure = virial_pressure(contacts.force, contacts.distance, disks.volume, disks.dimension)
    hollow = f"{np.count_nonzero(alone)} without contact" if alone.any() else ""
    caption = _caption(disks, contacts, pressure, float(number[walls:].mean()), hollow)
    return title, disks, contacts, alone, caption


def _draw(page, panels, height=None):
    """Panels [(title, disks, contacts, mask of hollow disks, caption), …] side by side, in columns of one width.

    height   of the slice, of spheres (default ½)
    """
    if len(panels) > MAX_SNAPSHOTS:
        raise InputError(f"{len(panels)} snapshots: one picture shows {MAX_SNAPSHOTS}. Choose some.")
    dimensions = {disks.dimension for _, disks, *_ in panels}
    if len(dimensions) > 1:
        raise InputError("snapshots: of disks and of spheres. Draw them in two pictures.")
    if dimensions == {3}:
        draw_spheres(page, panels, 0.5 if height is None else height)
        return
    if height is not None:
        raise InputError(
            f"{named('height')} {height:g}: a slice of spheres, but these are disks. Leave it out."
        )
    count, largest = len(panels), max(disks.n for _, disks, *_ in panels)
    width = count * (COLUMN if count > 1 or largest <= MAX_VECTOR_DISKS else PAGE)
    axes = frame_cells(page, [disks.cell for _, disks, *_ in panels], 1, width)
    for (ax, _), (title, *_, caption) in zip(axes, panels, strict=True):
        ax.set_title(title)
        ax.set_xlabel(caption, linespacing=1.4)
    lay_out(page, 1)
    for (ax, outline), (_, disks, contacts, hollow, _) in zip(axes, panels, strict=True):
        centres, count = wrap(disks.positions, disks.cell), disks.n
        walls = np.arange(count) < disks.record.get("walls", 0)
        rim = 0.3 if count <= MAX_VECTOR_DISKS else 0.1
        drawn = [draw_disks(ax, centres, disks.radii, hollow, walls, disks.cell, rim)]
        if len(contacts):
            forces, width = contacts.force / np.mean(contacts.force), FORCE_WIDTH * np.mean(disks.radii)
            drawn.append(draw_forces(ax, centres[contacts.i], contacts.r, forces, width, disks.cell))
        clip_artists(outline, drawn, rasterized=count > MAX_VECTOR_DISKS)


def _caption(disks, contacts, pressure, coordination, hollow):
    walls = disks.record.get("walls", 0)
    parts = [f"$N={disks.n - walls}$", rf"$\phi={phi_between(disks, walls):.4f}$"]
    below = [r"line width $\propto$ contact force" if len(contacts) else "no load-bearing contacts"]
    if len(contacts):
        parts += [f"$p/k={power_or_number(pressure / disks.potential.k)}$", f"$Z={coordination:.3f}$"]
    below += [f"hollow: {hollow}"] * bool(hollow) + ["dark: walls"] * bool(walls)
    return "   ".join(parts) + "\n" + ";  ".join(below)


@picture("network", "network", single=True)
def plot_network(results, page):
    """Bonds as lines; red pushes, blue pulls, as wide as the force, where bonds have forces.

    Bonds that cross the boundary appear on both sides of the cell, cut at its edge.
    """
    (network,) = results
    refuse_spheres(network)
    bonds = network.linear_bonds
    width = COLUMN if len(bonds) <= MAX_VECTOR_BONDS else PAGE
    ((ax, outline),) = frame_cells(page, [network.cell], 1, width)
    ax.set_xlabel(_network_caption(network), linespacing=1.4)
    lay_out(page, 1)
    start = wrap(network.positions, network.cell)[bonds.i]
    rows, starts = segment_images(start, bonds.r, network.cell)
    style = {"capstyle": "round", "zorder": 2, "label": hidden("bonds")}
    segments = np.stack((starts, starts + bonds.r[rows]), axis=1)
    drawn = LineCollection(
        segments, linewidths=_bond_widths(bonds)[rows], colors=_bond_colours(bonds)[rows], **style
    )
    ax.add_collection(drawn, autolim=False)
    clip_artists(outline, [drawn], rasterized=len(bonds) > MAX_VECTOR_BONDS)
    return f"network of {network.n} nodes and {len(bonds)} bonds"


def _bond_widths(bonds):
    largest = np.abs(bonds.force).max()
    return (
        np.full(len(bonds), NETWORK_LINE_WIDTH / 2)
        if not largest
        else NETWORK_LINE_WIDTH * np.abs(bonds.force) / largest
    )


def _bond_colours(bonds):
    return np.array([PULL_COLOUR, REST_COLOUR, PUSH_COLOUR])[np.sign(bonds.force).astype(int) + 1]


def _network_caption(network):
    parts = [f"$N={network.n}$", f"{len(network.bonds)} bonds"]
    if not network.tension.any():
        return "   ".join(parts)
    parts.append(f"$p/k={number(network.pressure / network.k)}$")
    return "   ".join(parts) + "\nred pushes, blue pulls;  line width $\\propto$ force"
