"""Packings with their disks, contacts and forces: as a file has them, in snapshots of a flow, at the end of shear."""

import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection

from jampetsc.errors import InputError
from jampetsc.flows.walls import phi_between
from jampetsc.io.disk_motion import snapshot
from jampetsc.packing.contacts import find_contacts, measure, virial_pressure
from jampetsc.plots.periodic import (
    disk_images,
    framed,
    lay_out,
    points_per_length,
    segment_images,
    within,
    wrap,
)
from jampetsc.plots.picture import picture
from jampetsc.plots.shearing import kind_of, labels_of
from jampetsc.plots.style import COLUMN, PAGE, hidden, power_or_number

MANY = 5000  # disks beyond which vector files get the contents as pixels, and outlines go
_MEAN_WIDTH, _WIDEST = 0.09, 2.0  # width of the line of a mean force in mean diameters, and at most in points
PANELS = 4  # snapshots side by side


@picture("packing", "packing", single=True)
def plot_packing(results, page):
    """Disks grey, rattlers hollow, contacts as lines whose width is proportional to the force.

    Contacts and disks that cross the boundary appear on both sides of the cell, cut at its edge.
    """
    (disks,) = results
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

    Forces do not balance: every contact is drawn, and disks that touch nothing are hollow. As many disks as the record
    of a packing says, the first ones, are those of walls: dark. Raises InputError for more panels than fit.
    """
    titles = labels_of([kind_of(result) for result in results]) if len(results) > 1 else [""]
    panels, shown = [], []
    for title, result in zip(titles, results, strict=True):
        snapshot(result)  # there is one
        strain = result["snapshots/strain"]
        rows = (0, -1) if strain[0] == 0 else (-1,)
        for row in rows:
            disks, at = snapshot(result, row), rf"$\gamma={strain[row]:.4g}$" if len(rows) > 1 else ""
            panels.append(flowing(", ".join(filter(None, (title, at))), disks))
            shown.append(f"{disks.n - disks.record.get('walls', 0)} disks at strain {strain[row]:.4g}")
    _draw(page, panels)
    return f"contacts of {', '.join(shown)}"


def touching(disks):
    """(all contacts, number of each disk's (N,), mask (N,) of those that have none and are not of a wall)."""
    contacts = find_contacts(disks)
    number = np.bincount(np.r_[contacts.i, contacts.j], minlength=disks.n)
    return contacts, number, (number == 0) & (np.arange(disks.n) >= disks.record.get("walls", 0))


def flowing(title, disks):
    """A panel of disks that are not at rest."""
    contacts, number, alone = touching(disks)
    walls = disks.record.get("walls", 0)
    pressure = virial_pressure(contacts.force, contacts.distance, disks.area)
    hollow = f"{np.count_nonzero(alone)} without contact" if alone.any() else ""
    caption = _caption(disks, contacts, pressure, float(number[walls:].mean()), hollow)
    return title, disks, contacts, alone, caption


def _draw(page, panels):
    """Panels [(title, disks, contacts, mask of hollow disks, caption), …] side by side, in columns of one width."""
    if len(panels) > PANELS:
        raise InputError(f"{len(panels)} snapshots: one picture shows {PANELS}; choose some")
    count, largest = len(panels), max(disks.n for _, disks, *_ in panels)
    width = count * (COLUMN if count > 1 or largest <= MANY else PAGE)
    axes = framed(page, [disks.cell for _, disks, *_ in panels], 1, width)
    for (ax, _), (title, *_, caption) in zip(axes, panels, strict=True):
        ax.set_title(title)
        ax.set_xlabel(caption, linespacing=1.4)
    lay_out(page, 1)
    for (ax, outline), (_, disks, contacts, hollow, _) in zip(axes, panels, strict=True):
        centres = wrap(disks.positions, disks.cell)
        drawn = [_disks(disks, centres, hollow, ax)]
        if len(contacts):
            drawn.append(_forces(ax, disks, centres, contacts))
        within(outline, drawn, rasterized=disks.n > MANY)


def _disks(disks, centres, hollow, ax):
    rows, places = disk_images(centres, disks.radii, disks.cell)
    hollow = hollow[rows]
    faces = np.where(hollow[:, None], (1.0, 1.0, 1.0, 1.0), (0.88, 0.88, 0.88, 1.0))
    faces[rows < disks.record.get("walls", 0)] = (0.45, 0.45, 0.45, 1.0)
    edges = np.where(hollow[:, None], (0.35, 0.35, 0.35, 1.0), (0.6, 0.6, 0.6, 1.0))
    width = 0.3 if disks.n <= MANY else 0.1
    return circles(ax, places, 2 * disks.radii[rows], facecolors=faces, edgecolors=edges, linewidths=width)


def circles(ax, places, diameters, **look) -> EllipseCollection:
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
