"""Packings, networks and snapshots of flows, with contacts and forces."""

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb

from jampetsc.errors import InputError
from jampetsc.flows.walls import phi_between
from jampetsc.io.disk_motion import snapshot
from jampetsc.packing.contacts import find_contacts, measure, virial_pressure
from jampetsc.packing.packing import PARTICLES
from jampetsc.plots.cell_drawing import (
    MAX_VECTOR_BONDS,
    clip_artists,
    disk_images,
    draw_circles,
    draw_disks,
    draw_forces,
    frame_cells,
    lay_out,
    segment_images,
)
from jampetsc.plots.cell_view import VIEW_NOTE, CellView, frame_slices
from jampetsc.plots.flow_kinds import kind_of, labels_of
from jampetsc.plots.picture import STRESS_UNITS, picture
from jampetsc.plots.sections import HEIGHT, section_of
from jampetsc.plots.sphere_drawing import SphereView
from jampetsc.plots.style import COLUMN, PAGE, hidden, number, power_or_number

MAX_VECTOR_DISKS = 5000  # beyond, vector files hold pixels and outlines are thin
FORCE_WIDTH = {2: 0.18, 3: 0.1}  # D -> of the line of a mean force, in mean radii
MAX_SNAPSHOTS = 4  # side by side
REST_COLOUR, PUSH_COLOUR, PULL_COLOUR = (
    "0.15",
    "#b2182b",
    "#2166ac",
)  # colours of bonds without force, that push, that pull
NETWORK_LINE_WIDTH = 1.6  # points: of the largest force, and of bonds without any at half this width
NODE_SIZE = 0.12  # diameter of a node of a slice, in mean bond lengths


@picture("packing", "packing", single=True, options=(HEIGHT,))
def plot_packing(results, page, height=None):
    """Disks grey, rattlers hollow, contacts as lines whose width is proportional to the force.

    Contacts and disks that cross the boundary appear on both sides of the cell, cut at its edge.

    Of spheres a slice z = height·L_z is drawn in this way: disks in which it cuts spheres, and the contacts between two
    of these, seen along z, as wide as their whole force. Beside it stands a view of the spheres whose centres are in
    the cell, along an oblique direction without perspective, darker with the depth behind the faces of the cell.
    Hollow spheres are white there, and a dashed line is the edge of the slice.

    Raises InputError for a height of disks.
    """
    (disks,) = results
    state = measure(disks)
    rattlers = int(np.count_nonzero(state.rattlers))
    hollow = f"{rattlers} rattler{'' if rattlers == 1 else 's'}" if rattlers else ""
    caption = _caption(disks, state.contacts, state.pressure, state.coordination, hollow)
    draw_panels(page, [("", disks, state.contacts, state.rattlers, caption)], height)
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
    draw_panels(page, panels, height)
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


def draw_panels(page, panels, height=None) -> None:
    """Panels [(title, disks, contacts, mask of hollow disks, caption), …] side by side, in columns of one width.

    height   of the slice, of spheres (default ½)

    Raises InputError for more panels than one picture shows, and for disks beside spheres.
    """
    if len(panels) > MAX_SNAPSHOTS:
        raise InputError(f"{len(panels)} snapshots: one picture shows {MAX_SNAPSHOTS}. Choose some.")
    dimensions = {disks.dimension for _, disks, *_ in panels}
    if len(dimensions) > 1:
        raise InputError("snapshots: of disks and of spheres. Draw them in two pictures.")
    sections = [section_of(disks, height) for _, disks, *_ in panels]
    views = [SphereView(disks) for _, disks, *_ in panels if disks.dimension == 3]
    if views:
        axes, view_axes = frame_slices(page, sections, views)
    else:
        count, largest = len(panels), max(disks.n for _, disks, *_ in panels)
        width = count * (COLUMN if count > 1 or largest <= MAX_VECTOR_DISKS else PAGE)
        axes, view_axes = frame_cells(page, [section.cell for section in sections], 1, width), []
    for (ax, _), section, (title, *_, caption) in zip(axes, sections, panels, strict=True):
        ax.set_title(", ".join(filter(None, (title, section.title))))
        ax.set_xlabel(caption, linespacing=1.4)
    for ax, (_, _, _, hollow, _) in zip(view_axes, panels, strict=False):
        notes = "dashed: slice" + (";  white: hollow in the slice" if hollow.any() else "")
        ax.set_xlabel(f"{VIEW_NOTE}\n{notes}", linespacing=1.4)
    lay_out(page, len(views) or 1)
    for (ax, outline), section, (_, disks, contacts, hollow, _) in zip(axes, sections, panels, strict=True):
        walls = _wall_mask(disks)
        many, rows = len(section.rows) > MAX_VECTOR_DISKS, section.rows
        masks, rim = (hollow[rows], walls[rows]), 0.1 if many else 0.3
        drawn = [draw_disks(ax, section.centres, section.radii, *masks, section.cell, rim)]
        if len(contacts):
            rows, starts, vectors = section.contacts(contacts)
            forces = contacts.force[rows] / np.mean(contacts.force)
            width = FORCE_WIDTH[disks.dimension] * np.mean(disks.radii)
            drawn.append(draw_forces(ax, starts, vectors, forces, width, section.cell))
        clip_artists(outline, drawn, rasterized=many)
    for ax, view, section, (_, disks, _, hollow, _) in zip(view_axes, views, sections, panels, strict=False):
        view.draw(ax, hollow, _wall_mask(disks), section.height)


def _wall_mask(disks):
    return np.arange(disks.n) < disks.record.get("walls", 0)


def _caption(disks, contacts, pressure, coordination, hollow):
    walls = disks.record.get("walls", 0)
    parts = [f"$N={disks.n - walls}$", rf"$\phi={phi_between(disks, walls):.4f}$"]
    below = [r"line width $\propto$ contact force" if len(contacts) else "no load-bearing contacts"]
    if len(contacts):
        over = STRESS_UNITS[disks.dimension].over
        if disks.dimension == 3 and disks.potential.stiffness != "constant":  # k is an energy
            over = r"\,d^3/k"
        parts += [f"$p{over}={power_or_number(pressure / disks.potential.k)}$", f"$Z={coordination:.3f}$"]
    below += [f"hollow: {hollow}"] * bool(hollow) + ["dark: walls"] * bool(walls)
    return "   ".join(parts) + "\n" + ";  ".join(below)


@picture("network", "network", single=True, options=(HEIGHT,))
def plot_network(results, page, height=None):
    """Bonds as lines; red pushes, blue pulls, as wide as the force, where bonds have forces.

    Bonds that cross the boundary appear on both sides of the cell, cut at its edge.

    In three dimensions a slab about z = height·L_z is drawn in this way, as thick as the mean length of a bond, with
    its nodes as dots and bonds cut at its faces. Beside it stands a view of all bonds, cut at the faces of the cell,
    whose colours fade with the depth behind these. A dashed line is the middle of the slab.

    Raises InputError for a height in two dimensions.
    """
    (network,) = results
    bonds = network.linear_bonds
    length = float(bonds.distance.mean())
    section = section_of(network, height, np.full(network.n, 0.5 * length))
    widths, colours = _bond_widths(bonds), _bond_colours(bonds)
    view = CellView(network.cell) if network.dimension == 3 else None
    if view is None:
        axes = frame_cells(page, [network.cell], 1, COLUMN if len(bonds) <= MAX_VECTOR_BONDS else PAGE)
    else:
        axes, (view_ax,) = frame_slices(page, [section], [view])
        view_ax.set_xlabel(f"{VIEW_NOTE}\ndashed: middle of the slab", linespacing=1.4)
    ((ax, outline),) = axes
    if view is not None:
        ax.set_title(rf"slab {section.title} $\pm\,\langle r\rangle/2$")
    ax.set_xlabel(_network_caption(network), linespacing=1.4)
    lay_out(page, 1)
    rows, starts, vectors = section.bonds(bonds)
    images, starts = segment_images(starts, vectors, section.cell)
    rows, vectors = rows[images], vectors[images]
    style = {"capstyle": "round", "zorder": 6, "label": hidden("bonds")}
    segments = np.stack((starts, starts + vectors), axis=1)
    drawn = [LineCollection(segments, linewidths=widths[rows], colors=colours[rows], **style)]
    ax.add_collection(drawn[0], autolim=False)
    if view is not None:
        size, look = (
            NODE_SIZE * length,
            {"facecolors": REST_COLOUR, "linewidths": 0, "zorder": 7, "label": hidden("nodes")},
        )
        _, places = disk_images(section.centres, np.full(len(section.rows), size / 2), section.cell)
        drawn.append(draw_circles(ax, places, np.full(len(places), size), **look))
        view.draw_bonds(view_ax, network.positions[bonds.i], bonds.r, widths, colours)
        view.draw_edges(view_ax, section.height)
    clip_artists(outline, drawn, rasterized=len(bonds) > MAX_VECTOR_BONDS)
    return f"network of {network.n} nodes and {len(bonds)} bonds"


def _bond_widths(bonds):
    largest = np.abs(bonds.force).max()
    return (
        np.full(len(bonds), NETWORK_LINE_WIDTH / 2)
        if not largest
        else NETWORK_LINE_WIDTH * np.abs(bonds.force) / largest
    )


def _bond_colours(bonds):
    shades = np.array([to_rgb(colour) for colour in (PULL_COLOUR, REST_COLOUR, PUSH_COLOUR)])
    return shades[np.sign(bonds.force).astype(int) + 1]


def _network_caption(network):
    parts = [f"$N={network.n}$", f"{len(network.bonds)} bonds"]
    if network.dimension == 3:
        parts.append(rf"$\langle r\rangle={network.linear_bonds.distance.mean():.3g}$")
    if not network.tension.any():
        return "   ".join(parts)
    parts.append(f"$p{STRESS_UNITS[network.dimension].over}={number(network.pressure / network.k)}$")
    return "   ".join(parts) + "\nred pushes, blue pulls;  line width $\\propto$ force"
