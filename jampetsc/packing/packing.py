"""The packing as data: disks or spheres in a periodic cell, how they were made, and what is measured of them."""

import hashlib
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from jampetsc.errors import InputError
from jampetsc.packing.cell import MAX_COORDINATE, check_cell, read_numbers
from jampetsc.packing.contacts import Contacts, State, find_contacts, measure
from jampetsc.packing.geometry import geometry_of
from jampetsc.packing.neighbours import fractional, upright, vectors
from jampetsc.packing.particles import GRID, UNIT_BALL, Particles, join, split
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import Strain, displace

PARTICLES = {2: "disks", 3: "spheres"}
# by dimension, packing fractions at which minima are looked for
MINIMISED_PHIS = {2: (0.8, 1.5), 3: (0.6, 1.2)}
PLACES = ("base", "offset", "cell_base", "cell_offset")  # arrays of `Packing` that change when disks move
PROVED_BY = "Cholesky of K with pre-stress, without rattlers, one disk pinned"
PROOF_ATTRIBUTES = ("negative_modes", "negative_modes_counted_by", "proof_fingerprint")


@dataclass(frozen=True, eq=False, init=False)
class Packing(Particles):
    """N soft disks or spheres in a periodic cell of D = 2 or 3 dimensions, for every function that takes a packing.

    positions   (N, D) centres, in the cell or out of it. (N, 3) are disks where z is the same for all, to single
                precision, whatever the cell
    radii       (N,)
    cell        with (N, 2): L, (Lx, Ly), (Lx, Ly, xy) with a₂ = (xy, Ly), rows a₁ = (Lx, 0) and a₂ (2, 2); with (N, 3):
                L, (Lx, Ly, Lz), (Lx, Ly, Lz, xy, xz, yz) with a₂ = (xy, Ly, 0) and a₃ = (xz, yz, Lz), all of them
                lengths, or lower triangular rows (3, 3); an object with Lx, Ly, … such as freud.box.Box, whose tilts
                are ratios; any tilt, periodic in all axes
    potential   harmonic, hertzian, or power with an `exponent`; stiffness: constant or inverse-square-diameter; k > 0,
                see `packing.potentials`
    dimension   2: disks, z is left out; 3: spheres, in one plane as well; None: as z says

    Lengths are in any unit; p and moduli then in that of k, in 3D over that of length. The record holds phi, pressure,
    energy and max_force as computed here. Arrays are float64 and never changed in place. Raises InputError for wrong
    shapes, values not finite, radii ≤ 0, a cell of no volume or less wide than a disk, or two centres at one place.
    """

    record: dict  # how it was made: pressure, phi, seed, protocol, …
    images: np.ndarray | None  # (N, D) numbers of cell vectors by which each disk was wrapped, if counted

    def __init__(
        self,
        positions,
        radii,
        cell,
        potential="harmonic",
        stiffness="constant",
        k=1.0,
        dimension=None,
        exponent=None,
    ):
        positions, radii, k = (
            read_numbers(name, values)
            for name, values in (("positions", positions), ("radii", radii), ("k", k))
        )
        geometry = geometry_of(positions, cell, dimension)
        if k.ndim:
            raise InputError(f"k of shape {k.shape}: must be one number")
        potential = Potential(potential, stiffness, float(k), exponent)
        exact = Packing.from_positions(
            geometry.positions, radii, geometry.cell, potential
        ).with_measurements()
        self.__dict__.update(exact.__dict__)

    def __repr__(self):
        pressure = f", pressure = {self.record['pressure']:.6g}" if "pressure" in self.record else ""
        return f"<{self.n} {PARTICLES[self.dimension]}, {self.potential}, phi = {self.phi:.6g}{pressure}>"

    @classmethod
    def from_positions(
        cls, positions, radii, cell, potential=None, *, positions_low=None, cell_low=None, record=None
    ):
        """A packing of coordinates (N, D), radii (N,) and cell rows (D, D), with what its file says of it as `record`.

        positions_low, cell_low: parts of the coordinates and rows that one double does not hold. Raises InputError
        for wrong shapes, values that are not finite, radii ≤ 0 or a cell of no volume.
        """
        # all in C order: for another layout all loops over disks would be compiled again
        positions, radii, cell = (np.asarray(a, float, "C") for a in (positions, radii, cell))
        n = len(radii) if radii.ndim == 1 else 0
        dimension = len(cell) if cell.ndim else 0
        shapes = (n, dimension), (dimension, dimension)
        if n == 0 or dimension not in UNIT_BALL or (positions.shape, cell.shape) != shapes:
            raise InputError(
                f"positions {positions.shape}, radii {radii.shape}, cell {cell.shape}: need (N, D), (N,) and (D, D), "
                "D = 2 or 3"
            )
        low = np.zeros(positions.shape) if positions_low is None else np.asarray(positions_low, float)
        cell_rest = np.zeros(cell.shape) if cell_low is None else np.asarray(cell_low, float)
        if low.shape != positions.shape or cell_rest.shape != cell.shape:
            raise InputError(
                f"positions_low {low.shape}, cell_low {cell_rest.shape}: shapes of positions and cell"
            )
        for name, array in (
            ("positions", positions),
            ("radii", radii),
            ("positions_low", low),
            ("cell_low", cell_rest),
        ):
            if not np.isfinite(array).all():
                row = int(np.argwhere(~np.isfinite(array))[0][0])
                raise InputError(
                    f"{name}[{row}] = {array[row]}: must be finite; was the file written completely?"
                )
        if (radii <= 0).any():
            row = int(np.argmax(radii <= 0))
            raise InputError(f"radii[{row}] = {radii[row]}: must be positive")
        check_cell(cell)
        if np.abs(positions).max() > MAX_COORDINATE:
            raise InputError(
                "positions: beyond 2^28 units of length. Scale them to particles of size about one."
            )
        (base, offset), (cell_base, cell_offset) = split(positions, low), split(cell, cell_rest)
        packing = cls._of_fields(
            base=base,
            offset=offset,
            radii=radii,
            cell_base=cell_base,
            cell_offset=cell_offset,
            potential=potential or Potential(),
            record=dict(record or {}),
            images=None,
        )
        if 2 * radii.max() > packing.period:
            raise InputError(
                f"cell that repeats at a distance of {packing.period:.6g} with a particle of diameter "
                f"{2 * radii.max():.6g}: a particle would touch its own image; use more particles"
            )
        return packing

    def replace(self, **changes) -> "Packing":
        """A packing with other values of some fields, which are not checked.

        `dataclasses.replace` would call the constructor, which takes positions.
        """
        values = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        if unknown := changes.keys() - values.keys():
            raise TypeError(f"replace: no fields {unknown}")
        return self._of_fields(**values | changes)

    @classmethod
    def _of_fields(cls, **values):
        packing = object.__new__(cls)
        packing.__dict__.update(values)  # a frozen dataclass refuses to set attributes
        return packing

    @property
    def unwrapped(self):
        """Coordinates that do not jump where a disk leaves the cell, x + k₁ a₁ + k₂ a₂ … with `images` k, (N, D).

        Raises InputError where images are not counted.
        """
        if self.images is None:
            raise InputError("unwrapped positions: images are not counted; the snapshots of a flow have them")
        return self.positions + self.images @ self.cell

    def contacts(self) -> Contacts:
        """All overlaps, those that bear no load included: `Contacts` of i, j, r, overlap, force, …"""
        return find_contacts(self)

    @cached_property
    def _state(self) -> State:
        return measure(self)

    @property
    def pressure(self) -> float:
        """p = Σ f r/(D V) over all overlaps."""
        return self._state.pressure

    @property
    def stress(self):
        """σ = −Σ f r r/(|r| V), (D, D): compression is negative, p = −tr σ/D."""
        return self._state.stress

    @property
    def coordination(self) -> float:
        """Z = 2N_c/n of the contacts that bear load, n disks without rattlers."""
        return self._state.coordination

    @property
    def rattlers(self):
        """Mask (N,) of disks with fewer than D + 1 loaded contacts, found by removing such disks until none is left."""
        return self._state.rattlers

    @property
    def fingerprint(self) -> str:
        """sha256 of all that determines the forces: coordinates to the last bit, radii, cell and potential.

        The same for a packing in a file, however a coordinate is divided between base and offset.
        """
        digest = hashlib.sha256(f"{self.potential.identity} {self.n}".encode())
        for array in (*join(self.base, self.offset), self.radii, *join(self.cell_base, self.cell_offset)):
            digest.update(np.ascontiguousarray(array + 0.0, "<f8"))  # + 0.0: -0 and 0 are one number
        return digest.hexdigest()

    def with_record(self, **entries) -> "Packing":
        """The same packing with `entries` added to the record."""
        return self.replace(record={**self.record, **entries})

    def with_measurements(self) -> "Packing":
        """The same packing with phi, pressure, energy and max_force in its record. Raises InputError as `measure`."""
        state = self._state
        return self.with_record(
            pressure=state.pressure, energy=state.energy, phi=self.phi, max_force=state.max_force
        )

    def folded(self) -> "Packing":
        """The same packing in the equivalent cell with the least tilts, a2 → a2 − m a1 …, every disk inside it.

        Whole cell vectors are subtracted, so that no bond changes by more than the rounding of offsets.
        """
        whole = upright(self.cell)[1].astype(float)
        cell_base, cell_offset = vectors(whole, self.cell_base), vectors(whole, self.cell_offset)
        image = np.floor(fractional(self.positions, cell_base + cell_offset))
        base, offset = self.base - vectors(image, cell_base), self.offset - vectors(image, cell_offset)
        images = self.images
        if images is not None:  # k₁ a₁ + k₂ a₂ … in vectors of the new cell
            images = (images @ np.rint(np.linalg.inv(whole)) + image).astype(int)
        cell = {"cell_base": cell_base, "cell_offset": cell_offset}
        return self.replace(base=base, offset=offset, images=images, **cell)

    def reordered(self, order) -> "Packing":
        """The same packing with its disks in another order."""
        arrays = {
            entry.name: getattr(self, entry.name)
            for entry in fields(self)
            if not entry.name.startswith("cell")
        }
        return self.replace(**{name: a[order] for name, a in arrays.items() if isinstance(a, np.ndarray)})


def deformed(packing: Packing, offsets, strain: Strain) -> Packing:
    """The packing at F (x + o), F = 1 + E of `strain`.

    Only the change is rounded, never the coordinates: base + (offset + o) + E (x + o).
    """
    base, offset = _deformed(packing.base, packing.offset, offsets, strain)
    cell_base, cell_offset = _deformed(packing.cell_base, packing.cell_offset, 0.0, strain)
    places = {"base": base, "offset": offset, "cell_base": cell_base, "cell_offset": cell_offset}
    # not `replace`: velocities of a snapshot are not of the deformed packing
    return Packing._of_fields(
        **{entry.name: getattr(packing, entry.name) for entry in fields(Packing)} | places
    )


def _deformed(base, offset, moves, strain):
    """(base, offset) of x + o + E (x + o), all (N, D)."""
    low = offset + moves
    low += np.column_stack(displace(strain, (base + low).T))
    carry = GRID * np.rint(low / GRID)
    return base + carry, low - carry


def with_proof(disks: Packing) -> Packing:
    """The packing with the proof in its record, for one of which K was factorised as `PROVED_BY` says."""
    return disks.with_record(**dict(zip(PROOF_ATTRIBUTES, (0, PROVED_BY, disks.fingerprint), strict=True)))


def proved_minimum(disks: Packing) -> bool:
    """Whether K with pre-stress of this very packing was proved to have no negative modes."""
    entries = [str(disks.record.get(name)) for name in PROOF_ATTRIBUTES]
    return entries == ["0", PROVED_BY, disks.fingerprint]
