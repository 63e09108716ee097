"""Displacement fields u(ω) of sheared packings as arrows (BT Fig. 1), rotations as colour."""

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize

from jampetsc.errors import InputError
from jampetsc.plots.periodic import disk_images, extent, frame_cell, segment_images, wrap
from jampetsc.plots.style import COLUMN, PAGE, figure, number, power_or_number, save

ARROWS = 1600  # at most so many in a panel, evenly spread
COLUMNS = 5  # frequencies in one picture
INSTANTS = {  # phase -> (what of a complex field, its name), in two rows
    "strain": ((np.real, "Re ${}$"), (np.imag, "Im ${}$")),
    "stress": ((np.real, "${}$ at peak stress"), (lambda u: -np.imag(u), "${}$ at zero stress")),
}
_REACH = 1.6  # length of a long arrow (90th percentile), in distances between arrows
_STEPS = (1, 1.5, 2, 3, 5, 7)  # factors between arrows and displacements, times powers of ten
_RANGE = 2.0  # rotations are coloured up to so many times their rms
_SMALL = 7.5  # points


def plot_fields(
    disks, omega, displacement, rotation, particles, path, phase="strain", symbol=r"\tilde u"
) -> None:
    """A field at two instants of its cycle, side by side for one ω, in two rows for more.

    omega (F,) in 1/τ₁; displacement (F, n, 2) complex, per strain amplitude, in the phase of the strain or stress;
    rotation (F, n) complex or None; particles (n,) rows of `disks`; symbol: of the displacement, in TeX.
    phase "strain": Re and Im, in phase with the strain and with its rate; "stress": Re and −Im, when the stress is at
    its peak and a quarter of a period later, when it is zero (BT). Below each panel stands how many times the field its
    arrows are.
    Raises InputError for more frequencies than fit.
    """
    if len(omega) > COLUMNS:
        raise InputError(f"{len(omega)} frequencies: one picture holds {COLUMNS}; choose some with --omega")
    page = _Page(disks.cell, len(omega), rotation is not None, len(particles) > ARROWS)
    with figure(page.width, page.height) as fig:
        picture = _Picture(disks, particles, page.points_per_length)
        for f, w in enumerate(omega):
            for part, (take, name) in enumerate(INSTANTS[phase]):
                ax = fig.add_axes(page.box(f, part))
                words = picture.draw(
                    ax,
                    take(displacement[f]),
                    None if rotation is None else take(rotation[f]),
                    rf"{symbol}/\gamma",
                )
                page.annotate(
                    ax, f, part, name.format(symbol), rf"$\omega\tau_1={power_or_number(w)}$", words
                )
        if rotation is not None:
            bar = fig.colorbar(
                ScalarMappable(Normalize(-_RANGE, _RANGE), _colours()), cax=fig.add_axes(page.bar_box)
            )
            bar.set_ticks((-_RANGE, 0, _RANGE))
            bar.ax.set_title(r"$\theta/\theta_{\rm rms}$", fontsize=9, pad=5)
            bar.ax.tick_params(length=2, labelsize=_SMALL)
        if picture.note:
            fig.text(0.5, 0.01, picture.note, ha="center", va="bottom", fontsize=_SMALL)
        save(fig, path)


def plot_panels(disks, panels, particles, path, symbol) -> None:
    """Real fields on the packing, side by side: panels [(title, field (n, 2)), …], `symbol` their name in
    TeX.

    particles (n,) rows of `disks`. Below each panel stands how many times the field its arrows are.
    Raises InputError for more panels than fit.
    """
    if len(panels) > COLUMNS:
        raise InputError(f"{len(panels)} fields: one picture holds {COLUMNS}; choose fewer")
    page = _Row(disks.cell, len(panels), len(particles) > ARROWS)
    with figure(page.width, page.height) as fig:
        picture = _Picture(disks, particles, page.points_per_length)
        for column, (title, field) in enumerate(panels):
            ax = fig.add_axes(page.box(column))
            words = picture.draw(ax, field, None, symbol)
            ax.set_title(title, pad=3)
            below = {"transform": ax.transAxes, "ha": "center", "va": "top", "fontsize": _SMALL}
            ax.text(0.5, -0.04 / page.panel[1], words, **below)
        if picture.note:
            fig.text(0.5, 0.01, picture.note, ha="center", va="bottom", fontsize=_SMALL)
        save(fig, path)


class _Row:
    """Panels in one row; lengths in inches, boxes in fractions of the figure."""

    top, below, gap = 0.2, 0.2, 0.06

    def __init__(self, cell, count, noted):
        self.width = COLUMN if count <= 2 else PAGE
        wide = (self.width - self.gap * (count + 1)) / count
        width, height = extent(cell)
        self.panel = wide, wide * min(height / width, _Page.tallest)
        self.bottom = self.below * (2 if noted else 1)
        self.height = self.top + self.panel[1] + self.bottom
        self.points_per_length = 72 * min(self.panel[0] / width, self.panel[1] / height)

    def box(self, column):
        """Axes of panel number `column`."""
        left = self.gap + column * (self.panel[0] + self.gap)
        return (
            left / self.width,
            self.bottom / self.height,
            self.panel[0] / self.width,
            self.panel[1] / self.height,
        )


class _Page:
    """Where the panels lie; lengths in inches, boxes in fractions of the figure."""

    top, below, side, gap, bar = (
        0.2,
        0.2,
        0.18,
        0.06,
        0.42,
    )  # header, line below a panel, row names, …, colour bar
    tallest = 2.5  # cells higher than this many widths are shrunk to fit

    def __init__(self, cell, count, coloured, noted):
        self.single = count == 1
        columns, self.rows = (2, 1) if self.single else (count, 2)
        self.side = 0.0 if self.single else self.side
        self.width = COLUMN if columns == 2 else PAGE
        free = self.width - self.side - self.gap * (columns + 1) - (self.bar if coloured else 0.0)
        width, height = extent(cell)
        self.panel = free / columns, free / columns * min(height / width, self.tallest)
        self.height = (
            self.top
            + self.rows * (self.panel[1] + self.below)
            + (self.rows - 1) * self.gap
            + (self.below if noted else 0.0)
        )
        self.points_per_length = 72 * min(self.panel[0] / width, self.panel[1] / height)

    def box(self, f, part):
        """Axes of frequency number f and part 0 (Re) or 1 (Im)."""
        column, row = (part, 0) if self.single else (f, part)
        left = self.side + self.gap + column * (self.panel[0] + self.gap)
        bottom = self.height - self.top - (row + 1) * self.panel[1] - row * (self.below + self.gap)
        return self._fractions(left, bottom, *self.panel)

    @property
    def bar_box(self):
        """Axes of the colour bar."""
        tall = min(1.4, self.panel[1])
        middle = (
            self.height
            - self.top
            - self.rows * self.panel[1] / 2
            - (self.rows - 1) * (self.below + self.gap) / 2
        )
        return self._fractions(self.width - self.bar + 0.1, middle - tall / 2 - 0.08, 0.08, tall)

    def _fractions(self, left, bottom, width, height):
        return left / self.width, bottom / self.height, width / self.width, height / self.height

    def annotate(self, ax, f, part, component, frequency, words):
        """Write what a panel shows: ω above a column, component beside a row, scales below the panel."""
        ax.text(
            0.5, -0.04 / self.panel[1], words, transform=ax.transAxes, ha="center", va="top", fontsize=_SMALL
        )
        if self.single:
            ax.set_title(f"{component},  {frequency}", pad=3)
        elif part == 0:
            ax.set_title(frequency, pad=3)
        if not self.single and f == 0:
            place = {"transform": ax.transAxes, "ha": "right", "va": "center", "rotation": 90}
            ax.text(-0.05 / self.panel[0], 0.5, component, fontsize=9, **place)


class _Picture:
    """What all panels share: the packing, and which disks carry an arrow."""

    def __init__(self, disks, particles, points_per_length):
        self.disks, self.particles = disks, particles
        self.centres = wrap(disks.positions, disks.cell)
        self.images = disk_images(self.centres, disks.radii, disks.cell)
        self.arrows = _spread(self.centres[particles], disks.cell)
        self.spacing = np.sqrt(disks.area / max(len(self.arrows), 1))
        self.points = points_per_length
        few = len(self.arrows) < len(particles)
        self.note = f"arrows on {len(self.arrows)} of {len(particles)} disks" if few else ""

    def draw(self, ax, u, spin, symbol=r"\tilde u/\gamma"):
        """Draw one field u (n, 2) and its rotations (n,) or None; returns the scales in words."""
        outline = frame_cell(ax, self.disks.cell, linewidth=0.4)
        self._disks(ax, spin).set_clip_path(outline)
        factor = _factor(u, self.spacing)
        words = rf"arrows ${number(factor)}\,{symbol}$" if factor else f"${symbol}=0$"
        if factor:
            self._arrows(ax, factor * u[self.arrows]).set_clip_path(outline)
        if spin is not None:
            words += rf",  $\theta_{{\rm rms}}={number(_rms(spin))}\,\gamma$"
        return words

    def _arrows(self, ax, vectors):
        """Arrows that begin at their disks; one that leaves the cell goes on at the other side."""
        rows, starts = segment_images(self.centres[self.particles][self.arrows], vectors, self.disks.cell)
        thin = min(0.7, max(0.3, 0.07 * self.spacing * self.points))
        return ax.quiver(
            *starts.T,
            *vectors[rows].T,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            units="dots",
            width=thin * ax.figure.dpi / 72,
            headwidth=4,
            headlength=4.5,
            headaxislength=4,
            minlength=0.3,
            color="black",
            zorder=3,
        )

    def _disks(self, ax, spin):
        rows, points = self.images
        diameters = 2 * self.disks.radii[rows]
        colours = np.ones((self.disks.n, 4))
        if spin is not None:
            colours[self.particles] = _colours()(0.5 + spin / (2 * _RANGE * (_rms(spin) or 1.0)))
        collection = EllipseCollection(
            diameters,
            diameters,
            np.zeros(len(rows)),
            units="xy",
            offsets=points,
            transOffset=ax.transData,
            facecolors=colours[rows],
            edgecolors="0.72",
            linewidths=min(0.3, 0.03 * self.points),
            rasterized=self.disks.n > ARROWS,
            zorder=1,
        )
        ax.add_collection(collection)
        return collection


def _colours():
    """Diverging, told apart with any colour vision, and nowhere so dark that a black arrow drowns."""
    shades = 0.3 + 0.7 * matplotlib.colormaps["PuOr"](np.linspace(0.12, 0.88, 256))[:, :3]
    return LinearSegmentedColormap.from_list("PuOr-light", shades)


def _rms(values):
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def _factor(u, spacing):
    """How many times the field arrows are: round, long ones reach past the next; 0 if nothing moves."""
    long = float(np.quantile(np.hypot(u[:, 0], u[:, 1]), 0.9))
    if long == 0:
        return 0.0
    wanted = _REACH * spacing / long
    decade = 10.0 ** np.floor(np.log10(wanted))
    return decade * max(step for step in _STEPS if step <= wanted / decade * (1 + 1e-9))


def _spread(points, cell):
    """Rows of at most ARROWS points, one from each square of a grid over the cell; all if they are few."""
    if len(points) <= ARROWS:
        return np.arange(len(points))
    sides = np.hypot(cell[:, 0], cell[:, 1])
    shape = np.maximum(1, (sides / np.sqrt(np.prod(sides) / ARROWS)).astype(int))
    place = (points @ np.linalg.inv(cell)) % 1.0 * shape
    square = np.minimum(place.astype(int), shape - 1)
    off_centre = np.sum((place - square - 0.5) ** 2, axis=1)
    number_of = square[:, 0] * shape[1] + square[:, 1]
    order = np.lexsort((off_centre, number_of))
    _, first = np.unique(number_of[order], return_index=True)
    return np.sort(order[first])
