"""What a picture shows of a periodic cell: all of it in two dimensions, a slice z = const in three."""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.io.disk_motion import radii_of
from jampetsc.options.parameters import NUMBER
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network
from jampetsc.plots.cell_drawing import visible_shares, wrap
from jampetsc.plots.picture import option

HEIGHT = option(
    "height", NUMBER, "packing, minimum, snapshot, network, fields, response, mode, velocities in three dimensions: "
    "height z of the slice over L_z (default 0.5; of a network that of the node nearest to it)", "Z", low=0, high=1,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Section:
    """M disks of a cell in the plane, folded into it: of a packing, or the sections of spheres by a plane.

    A plane z = height·L_z cuts a sphere and its images along z in disks of radius √(ρ² − h²), h the distance of the
    centre. The cell of the slice has the rows a₁, a₂ and begins at height·a₃.
    """

    cell: np.ndarray  # (2, 2)
    rows: np.ndarray  # (M,) of the packing or network
    positions: np.ndarray  # (M, D) of centres
    centres: np.ndarray  # (M, 2) on paper
    radii: np.ndarray  # (M,)
    thickness: float  # 2ρ of the largest sphere
    source: Packing | Network
    height: float | None  # None in two dimensions

    @property
    def title(self) -> str:
        """Which plane this is; empty in two dimensions."""
        return "" if self.height is None else rf"$z={self.height:.3g}\,L_z$"

    def contacts(self, contacts):
        """(rows, starts, vectors (K, 2)) of the contacts between centres of disks that are both in the section."""
        if self.height is None:
            return np.arange(len(contacts)), self.positions[contacts.i], contacts.r
        first, radii = _images_at(self.source, self.height)[:, contacts.i], self.source.radii
        second = first + contacts.r
        is_cut = (np.abs(first[..., 2]) < radii[contacts.i]) & (np.abs(second[..., 2]) < radii[contacts.j])
        image, row = np.nonzero(is_cut)
        return row, wrap(first[image, row, :2], self.cell), contacts.r[row, :2]

    def bonds(self, bonds):
        """(rows, starts, vectors (K, 2)) of bonds; of a slice their parts in a slab of its thickness, seen along z."""
        if self.height is None:
            return np.arange(len(bonds)), self.positions[bonds.i], bonds.r
        starts = _images_at(self.source, self.height)[:, bonds.i]
        half = 0.5 * self.thickness
        first, last = visible_shares(starts[..., 2:], bonds.r[:, 2:], -half, half)
        image, row = np.nonzero(last > first)
        first, last, r = first[image, row, None], last[image, row, None], bonds.r[row, :2]
        return row, wrap(starts[image, row, :2] + first * r, self.cell), (last - first) * r

    def members(self, particles):
        """Rows (m,) of the disks that are among particles (n,), and their rows there (m,), ascending."""
        numbers = np.full(self.source.n, -1)
        numbers[particles] = np.arange(len(particles))
        numbers = numbers[self.rows]
        shown = np.argsort(numbers, kind="stable")[np.count_nonzero(numbers < 0) :]
        return shown, numbers[shown]


def section_of(source, height=None, radii=None) -> Section:
    """The section of a packing or network that a picture shows.

    height   of the slice, z over L_z; None: ½, and of a network that of the node nearest to it, as lattices have layers
    radii    (N,) of the spheres that the plane cuts; None: as `radii_of`

    Raises InputError for a height in two dimensions, and where the plane cuts nothing.
    """
    radii = radii_of(source) if radii is None else radii
    if source.dimension == 2:
        if height is not None:
            raise InputError(
                f"{named('height')} {height:g}: of a slice in three dimensions, but the file has two. Leave it out."
            )
        places = wrap(source.positions, source.cell)
        return Section(source.cell, np.arange(source.n), places, places, radii, 0.0, source, None)
    if height is None:
        height = _layer_height(source) if isinstance(source, Network) else 0.5
    images = _images_at(source, height)
    squares = radii**2 - images[..., 2] ** 2
    image, rows = np.nonzero(squares > 0)
    if not len(rows):
        raise InputError(f"{named('height')} {height:g}: the slice cuts nothing. Give another height.")
    plane, places = source.cell[:2, :2], images[image, rows]
    places[:, :2] = wrap(places[:, :2], plane)
    cut_radii = np.sqrt(squares[image, rows])
    positions, thickness = places + height * source.cell[2], 2.0 * float(radii.max())
    return Section(plane, rows, positions, places[:, :2], cut_radii, thickness, source, height)


def _images_at(source, height):
    """Centres (3, N, 3) of three images of every sphere along a₃, from the point height·a₃ of the plane."""
    centres = wrap(source.positions, source.cell)
    return np.stack([centres + (shift - height) * source.cell[2] for shift in (-1, 0, 1)])


def _layer_height(network):
    heights = wrap(network.positions, network.cell)[:, 2] / network.cell[2, 2]
    return float(heights[np.abs(heights - 0.5).argmin()])
