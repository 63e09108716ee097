"""A packing with its disks, rattlers, contacts and forces."""

import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection

from jampetsc.contacts.state import find_contacts, measure, virial_pressure
from jampetsc.errors import InputError
from jampetsc.flows.walls import phi_between
from jampetsc.plots.periodic import disk_images, extent, frame_cell, segment_images, wrap
from jampetsc.plots.style import COLUMN, PAGE, figure, power_or_number, save

MANY = 5000  # disks beyond which vector files get the contents as pixels, and outlines go
_MEAN_WIDTH, _WIDEST = 0.09, 2.0  # width of the line of a mean force in mean diameters, and at most in points
_CAPTION, _HEADER = 0.38, 0.22  # inches
PANELS = 4  # snapshots side by side
_TALLEST = 2.5  # heights beyond this many widths are shrunk to fit


def plot_packing(disks, path) -> None:
    """Disks grey, rattlers hollow, contacts as lines whose width is proportional to the force.

    Contacts and disks that cross the boundary appear on both sides of the cell, cut at its edge.
    """
    state = measure(disks)
    rattlers = int(np.count_nonzero(state.rattlers))
    hollow = f"{rattlers} rattler{'' if rattlers == 1 else 's'}" if rattlers else ""
    caption = _caption(disks, state.contacts, state.pressure, state.coordination, hollow)
    _draw([("", disks, state.contacts, state.rattlers, caption)], path)


def touching(disks):
    """(all contacts, number of each disk's (N,), mask (N,) of those that have none and are not of a wall)."""
    contacts = find_contacts(disks)
    number = np.bincount(np.r_[contacts.i, contacts.j], minlength=disks.n)
    return contacts, number, (number == 0) & (np.arange(disks.n) >= disks.record.get("walls", 0))


def plot_flowing(panels, path) -> None:
    """Disks under shear, side by side: panels [(title, disks), …].

    Forces do not balance: every contact is drawn, and disks that touch nothing are hollow. As many disks as the record
    of a packing says, the first ones, are those of walls: dark. Raises InputError for more panels than fit.
    """
    if len(panels) > PANELS:
        raise InputError(f"{len(panels)} snapshots: one picture shows {PANELS}; choose some")
    drawn = []
    for title, disks in panels:
        contacts, number, alone = touching(disks)
        walls = disks.record.get("walls", 0)
        pressure = virial_pressure(contacts.force, contacts.distance, disks.area)
        hollow = f"{np.count_nonzero(alone)} without contact" if alone.any() else ""
        caption = _caption(disks, contacts, pressure, float(number[walls:].mean()), hollow)
        drawn.append((title, disks, contacts, alone, caption))
    _draw(drawn, path)


def _draw(panels, path):
    """Panels [(title, disks, contacts, mask of hollow disks, caption), …] side by side, in columns of one width."""
    count, largest = len(panels), max(disks.n for _, disks, *_ in panels)
    inches = COLUMN if count > 1 or largest <= MANY else PAGE
    sizes = [extent(disks.cell) for _, disks, *_ in panels]
    tall = inches * min(max(height / width for width, height in sizes), _TALLEST)
    header = _HEADER if any(title for title, *_ in panels) else 0.0
    whole = header + tall + _CAPTION
    with figure(count * inches, whole) as fig:
        for column, ((title, disks, contacts, hollow, caption), size) in enumerate(
            zip(panels, sizes, strict=True)
        ):
            points_per_length = 72 * 0.98 * min(inches / size[0], tall / size[1])
            left, middle = (column + 0.01) / count, (column + 0.5) / count
            ax = fig.add_axes((left, _CAPTION / whole, 0.98 / count, tall / whole))
            cell = frame_cell(ax, disks.cell)
            centres = wrap(disks.positions, disks.cell)
            shown = [
                _disks(ax, disks, centres, hollow),
                _forces(ax, disks, centres, contacts, points_per_length),
            ]
            for collection in filter(None, shown):
                collection.set_clip_path(cell)
                collection.set_rasterized(disks.n > MANY)
            fig.text(middle, 0.5 * _CAPTION / whole, caption, ha="center", va="center", linespacing=1.4)
            if title:
                fig.text(middle, 1 - 0.5 * header / whole, title, ha="center", va="center")
        save(fig, path)


def _disks(ax, disks, centres, hollow):
    rows, points = disk_images(centres, disks.radii, disks.cell)
    hollow = hollow[rows]
    faces = np.where(hollow[:, None], (1.0, 1.0, 1.0, 1.0), (0.88, 0.88, 0.88, 1.0))
    faces[rows < disks.record.get("walls", 0)] = (0.45, 0.45, 0.45, 1.0)
    diameters = 2 * disks.radii[rows]
    collection = EllipseCollection(
        diameters,
        diameters,
        np.zeros(len(rows)),
        units="xy",
        offsets=points,
        transOffset=ax.transData,
        facecolors=faces,
        edgecolors=np.where(hollow[:, None], (0.35, 0.35, 0.35, 1.0), (0.6, 0.6, 0.6, 1.0)),
        linewidths=0.3 if disks.n <= MANY else 0.1,
        zorder=1,
    )
    ax.add_collection(collection)
    return collection


def _forces(ax, disks, centres, contacts, points_per_length):
    """Contacts as lines, the mean force as wide as a fixed part of a disk; None without contacts."""
    if not len(contacts):
        return None
    rows, starts = segment_images(centres[contacts.i], contacts.r, disks.cell)
    mean_width = min(_WIDEST, _MEAN_WIDTH * 2 * np.mean(disks.radii) * points_per_length)
    collection = LineCollection(
        np.stack((starts, starts + contacts.r[rows]), axis=1),
        linewidths=mean_width * contacts.force[rows] / np.mean(contacts.force),
        colors="0.05",
        capstyle="round",
        zorder=2,
    )
    ax.add_collection(collection)
    return collection


def _caption(disks, contacts, pressure, coordination, hollow):
    walls = disks.record.get("walls", 0)
    parts = [f"$N={disks.n - walls}$", rf"$\phi={phi_between(disks, walls):.4f}$"]
    if len(contacts):
        parts += [
            f"$p/k={power_or_number(pressure / disks.potential.k)}$",
            f"$Z={coordination:.3f}$",
        ]
    lines = r"line width $\propto$ contact force" if len(contacts) else "no load-bearing contacts"
    return (
        "   ".join(parts)
        + f"\n{lines}"
        + (f";  hollow: {hollow}" if hollow else "")
        + (";  dark: walls" if walls else "")
    )
