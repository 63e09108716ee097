"""The largest rearrangement of quasistatic shear: D²min on the particles as they were before it."""

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm

from jampetsc.errors import InputError, named
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential
from jampetsc.plots.cell_drawing import clip_artists, disk_images, draw_circles, frame_cells, lay_out
from jampetsc.plots.packing_plots import MAX_VECTOR_DISKS
from jampetsc.plots.picture import MEAN_DIAMETER, picture
from jampetsc.plots.sections import HEIGHT, section_of
from jampetsc.plots.style import COLUMN, hidden, number

DECADES = 2  # of D²min below its largest value, that have colours
MIN_LARGEST = 1e-30  # mean diameters squared: largest D²min below which particles have not moved


def has_rearrangement(result) -> bool:
    """Whether D²min of a drop is stored."""
    return "events/d2min" in result


@picture("d2min", "shear", options=(HEIGHT,), single=True, suits=has_rearrangement)
def plot_rearrangement(results, page, height=None):
    """D²min of the particles in the largest drop of the energy, over the square of the mean diameter, in colour.

    Particles are where they were before it, white those without neighbours. D²min_i is the least mean over neighbours
    j of |u_j − u_i − J r_ij|², u the displacements, J any matrix (Falk & Langer, PRE 57, 7192 (1998)); neighbours have
    a gap below half a mean diameter. The colours have DECADES decades; smaller values have the palest one.

    Of spheres a slice z = height·L_z. Raises InputError for files without D²min, and for a height of disks.
    """
    (result,) = results
    if not has_rearrangement(result):
        raise InputError(
            f"{result.path}: no D²min of a drop. Shear with {named('events')} and {named('d2min')}, through an "
            "instability."
        )
    disks = Packing.from_positions(
        result["events/positions"],
        result["state/radii"],
        result["events/cell"],
        Potential.of_record(result.attributes),
    )
    section, diameter = section_of(disks, height), 2.0 * float(np.mean(disks.radii))
    values = np.ma.masked_invalid(result["events/d2min"] / diameter**2)
    largest = max(float(values.max()), MIN_LARGEST)
    scale = {"norm": LogNorm(10.0**-DECADES * largest, largest, clip=True), "cmap": _colours()}
    ((ax, outline),) = frame_cells(page, [section.cell], 1, COLUMN)
    strain = float(result["events/strain"][result["events/largest"]])
    ax.set_title(", ".join(filter(None, (rf"$\gamma={strain:.6g}$", section.title))), pad=3)
    ax.set_xlabel(
        rf"participation {number(result['events/participation'][result['events/largest']])}", fontsize=9
    )
    label = rf"$D^2_{{\rm min}}/{MEAN_DIAMETER[disks.dimension]}^2$"
    page.figure.colorbar(
        ScalarMappable(**scale), ax=page.axes, label=label, shrink=0.7, pad=0.02, extend="min"
    )
    lay_out(page, 1)
    images, places = disk_images(section.centres, section.radii, section.cell)
    look = scale | {"array": values[section.rows][images], "edgecolors": "0.6", "linewidths": 0.2}
    drawn = draw_circles(ax, places, 2 * section.radii[images], label=hidden("d2min"), **look)
    clip_artists(outline, [drawn], rasterized=len(section.rows) > MAX_VECTOR_DISKS)
    return f"D2min of the drop at strain {strain:.6g}, at most {largest:.3g} squares of a diameter"


def _colours():
    """Pale to dark, monotonic in grey scale; white for particles without neighbours."""
    return matplotlib.colormaps["magma_r"].with_extremes(bad="white")
