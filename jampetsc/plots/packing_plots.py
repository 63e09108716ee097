"""Packings, networks and snapshots of flows, with contacts and forces; drawing in a periodic, possibly sheared cell."""

import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.patches import Polygon

from jampetsc.errors import InputError, about
from jampetsc.flows.walls import phi_between
from jampetsc.io.disk_motion import snapshot
from jampetsc.io.packing_file import source_name
from jampetsc.packing.contacts import find_contacts, measure, virial_pressure
from jampetsc.packing.packing import require_plane
from jampetsc.plots.flow_plots import kind_of, labels_of
from jampetsc.plots.picture import picture
from jampetsc.plots.style import COLUMN, PAGE, hidden, number, power_or_number

DRAW_SPHERES = "Draw it in OVITO or ParaView: jampetsc export FILE --out FILE.xyz or FILE.vtp."
MAX_ASPECT = 2.5  # height over width of a cell; taller cells shrink
CAPTION_HEIGHT = 0.42  # inches above and below a panel
_SHIFTS = np.array([(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)])
MAX_VECTOR_DISKS = 5000  # beyond, vector files hold pixels and outlines are thin
_MEAN_WIDTH, _WIDEST = 0.09, 2.0  # width of the line of a mean force in mean diameters, and at most in points
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


def wrap(positions, cell):
    """Positions (N, 2) moved by cell vectors into the cell."""
    fractional = positions @ np.linalg.inv(cell)
    return (fractional - np.floor(fractional)) @ cell


def disk_images(centres, radii, cell):
    """(rows, centres) of all images of the disks that reach into the cell; `centres` (N, 2) lie in it."""
    inverse = np.linalg.inv(cell)
    reach = radii[:, None] * np.linalg.norm(inverse, axis=0)  # in fractional coordinates
    return _images(centres @ inverse - reach, centres @ inverse + reach, centres, cell)


def segment_images(start, vector, cell):
    """(rows, starts) of all images that may cross the cell of segments start → start + vector, (M, 2)."""
    inverse = np.linalg.inv(cell)
    ends = np.stack((start @ inverse, (start + vector) @ inverse))
    return _images(ends.min(axis=0), ends.max(axis=0), start, cell)


def _images(low, high, anchors, cell):
    """Images of fractional boxes [low, high] that overlap the unit square: their rows and shifted anchors."""
    rows, points = [], []
    for shift in _SHIFTS:
        seen = np.flatnonzero(((high + shift > 0) & (low + shift < 1)).all(axis=1))
        rows.append(seen)
        points.append(anchors[seen] + shift @ cell)
    return np.concatenate(rows), np.concatenate(points)


def frame_cells(page, cells, rows, width, linewidth=0.6) -> list:
    """[(axes, outline of its cell, at which `clip_artists` cuts its content)] of cells [(2, 2), …] in rows.

    No cell is higher than MAX_ASPECT times its width.
    """
    columns = len(cells) // rows
    ratio = max(cell[1, 1] / (abs(cell[0, 0]) + abs(cell[1, 0])) for cell in cells)
    height = rows * (width / columns * min(ratio, MAX_ASPECT) + CAPTION_HEIGHT)
    axes = np.ravel(page.panels(rows, columns, width, height, letters=False))
    return [(ax, _frame(ax, cell, linewidth)) for ax, cell in zip(axes, cells, strict=True)]


def lay_out(page, rows, note=0.0) -> None:
    """Give framed axes their place on paper, which widths of lines follow; `note`: inches of what stands below them.

    A figure loses the height that they do not need.
    """
    page.figure.draw_without_rendering()
    if page.is_new and page.size is None:
        heights = np.reshape([ax.get_tightbbox().height for ax in page.axes], (rows, -1)) / page.figure.dpi
        needed = (heights.max(axis=1) + 0.12).sum() + note
        page.figure.set_figheight(min(needed, page.figure.get_figheight()))
        page.figure.draw_without_rendering()
    page.laid_out = True


def _frame(ax, cell, linewidth):
    corners = np.array([(0.0, 0.0), cell[0], cell[0] + cell[1], cell[1]])
    outline = Polygon(corners, closed=True, fill=False, edgecolor="0.3", linewidth=linewidth, zorder=5)
    ax.add_patch(outline)
    margin = 0.01 * np.ptp(corners, axis=0)
    (x0, y0), (x1, y1) = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    ax.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", xticks=(), yticks=())
    ax.spines[:].set_visible(False)
    return outline


def clip_artists(outline, artists, rasterized=False) -> None:
    """Cut artists at an outline; they do not count for the layout."""
    for artist in artists:
        artist.set(clip_path=outline, in_layout=False, rasterized=rasterized)


def points_per_length(ax) -> float:
    """How long a unit of length is on paper, in points; of axes that are laid out."""
    ax.apply_aspect()
    (x0, _), (x1, _) = ax.transData.transform([(0, 0), (1, 0)])
    return (x1 - x0) * 72 / ax.figure.dpi


@picture("packing", "packing", single=True)
def plot_packing(results, page):
    """Disks grey, rattlers hollow, contacts as lines whose width is proportional to the force.

    Contacts and disks that cross the boundary appear on both sides of the cell, cut at its edge.
    """
    (disks,) = results
    refuse_spheres(disks)
    state = measure(disks)
    rattlers = int(np.count_nonzero(state.rattlers))
    hollow = f"{rattlers} rattler{'' if rattlers == 1 else 's'}" if rattlers else ""
    caption = _caption(disks, state.contacts, state.pressure, state.coordination, hollow)
    _draw(page, [("", disks, state.contacts, state.rattlers, caption)])
    return f"packing of {disks.n} disks"


@picture("minimum", "shear", single=True)
def plot_minimum(results, page):
    """The last minimum of quasistatic shear, as `plot_packing`."""
    (result,) = results
    plot_packing.function([result.last], page)
    return f"{result.last.n} disks at strain {result['strain'][-1]:.4g}"


@picture("snapshot", "flow")
def plot_snapshots(results, page):
    """Disks under shear, side by side: the last snapshot of each file, and the first where it is the start.

    Forces do not balance: every contact is drawn, and disks that touch nothing are hollow. Disks of
    walls, the first ones by the record of the packing, are dark. Raises InputError for more panels than fit.
    """
    for result in results:
        refuse_spheres(snapshot(result))
    titles = labels_of([kind_of(result) for result in results]) if len(results) > 1 else [""]
    panels, shown = [], []
    for title, result in zip(titles, results, strict=True):
        snapshot(result)  # there is one
        strain = result["snapshots/strain"]
        rows = (0, -1) if strain[0] == 0 else (-1,)
        for row in rows:
            disks, at = snapshot(result, row), rf"$\gamma={strain[row]:.4g}$" if len(rows) > 1 else ""
            panels.append(flow_panel(", ".join(filter(None, (title, at))), disks))
            shown.append(f"{disks.n - disks.record.get('walls', 0)} disks at strain {strain[row]:.4g}")
    _draw(page, panels)
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


def _draw(page, panels):
    """Panels [(title, disks, contacts, mask of hollow disks, caption), …] side by side, in columns of one width."""
    if len(panels) > MAX_SNAPSHOTS:
        raise InputError(f"{len(panels)} snapshots: one picture shows {MAX_SNAPSHOTS}. Choose some.")
    count, largest = len(panels), max(disks.n for _, disks, *_ in panels)
    width = count * (COLUMN if count > 1 or largest <= MAX_VECTOR_DISKS else PAGE)
    axes = frame_cells(page, [disks.cell for _, disks, *_ in panels], 1, width)
    for (ax, _), (title, *_, caption) in zip(axes, panels, strict=True):
        ax.set_title(title)
        ax.set_xlabel(caption, linespacing=1.4)
    lay_out(page, 1)
    for (ax, outline), (_, disks, contacts, hollow, _) in zip(axes, panels, strict=True):
        centres = wrap(disks.positions, disks.cell)
        drawn = [_disks(disks, centres, hollow, ax)]
        if len(contacts):
            drawn.append(_forces(ax, disks, centres, contacts))
        clip_artists(outline, drawn, rasterized=disks.n > MAX_VECTOR_DISKS)


def _disks(disks, centres, hollow, ax):
    rows, places = disk_images(centres, disks.radii, disks.cell)
    hollow = hollow[rows]
    faces = np.where(hollow[:, None], (1.0, 1.0, 1.0, 1.0), (0.88, 0.88, 0.88, 1.0))
    faces[rows < disks.record.get("walls", 0)] = (0.45, 0.45, 0.45, 1.0)
    edges = np.where(hollow[:, None], (0.35, 0.35, 0.35, 1.0), (0.6, 0.6, 0.6, 1.0))
    width = 0.3 if disks.n <= MAX_VECTOR_DISKS else 0.1
    return draw_circles(
        ax, places, 2 * disks.radii[rows], facecolors=faces, edgecolors=edges, linewidths=width
    )


def draw_circles(ax, places, diameters, **look) -> EllipseCollection:
    """Circles (M,) at places (M, 2), drawn on `ax`."""
    look |= {"offsets": places, "transOffset": ax.transData, "label": hidden("disks"), "zorder": 1}
    drawn = EllipseCollection(diameters, diameters, np.zeros(len(places)), units="xy", **look)
    return ax.add_collection(drawn, autolim=False)


def _forces(ax, disks, centres, contacts):
    """Contacts as lines, the mean force as wide as a fixed part of a disk."""
    scale = points_per_length(ax)
    rows, starts = segment_images(centres[contacts.i], contacts.r, disks.cell)
    mean_width = min(_WIDEST, _MEAN_WIDTH * 2 * np.mean(disks.radii) * scale)
    segments = np.stack((starts, starts + contacts.r[rows]), axis=1)
    widths = mean_width * contacts.force[rows] / np.mean(contacts.force)
    look = {"colors": "0.05", "capstyle": "round", "zorder": 2, "label": hidden("contacts")}
    return ax.add_collection(LineCollection(segments, linewidths=widths, **look), autolim=False)


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
