"""The packing as data: disks in a periodic, possibly sheared cell, with positions more precise than one double.

At low pressure an overlap (~ p) is far smaller than a coordinate (~ √N), so rounding coordinates to one
double would set the force residual (Vågberg, thesis sec. 4.7). Every coordinate is therefore a sum base +
offset: `base` is a multiple of GRID, so that differences of bases and cell vectors are exact, and `offset`
(|offset| ≤ GRID/2) carries the rest.
"""

import hashlib
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from jampetsc.errors import InputError
from jampetsc.packing.cell import cell_of, read_numbers
from jampetsc.packing.neighbours import fractional, vectors
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import Strain, displace

PLANE_TOLERANCE = 1e-8  # largest radii: spread of z within which centres lie in one plane
GRID = 2.0**-24  # exact for coordinates below 2**29; offsets are then resolved to 3e-24
PLACES = ("base", "offset", "cell_base", "cell_offset")  # arrays of `Packing` that change when disks move


def split(high, low=0.0):
    """(base, offset) of the number high + low: base on the grid, offset the exact remainder plus low."""
    base = np.round(np.asarray(high, float) / GRID) * GRID
    offset = (high - base) + low
    carry = np.round(offset / GRID) * GRID
    return base + carry, offset - carry


def join(base, offset):
    """(high, low) with high = the double nearest to base + offset and low what it cannot hold."""
    high = base + offset
    return high, offset - (high - base)


@dataclass(frozen=True, eq=False, init=False)
class Packing:
    """N soft disks in a periodic cell, for every function that takes a packing.

    positions   (N, 2) centres, in the cell or out of it; (N, 3) where all z are the same
    radii       (N,)
    cell        L, (Lx, Ly), (Lx, Ly, xy) with a₂ = (xy Ly, Ly), rows a₁ = (Lx, 0) and a₂ (2, 2), or an object with
                Lx, Ly and xy such as freud.box.Box; any tilt, periodic in x and y
    potential   harmonic or hertzian; stiffness: constant or inverse-square-diameter; k > 0, see `packing.potentials`

    Lengths are in any unit, p and moduli then in that of k. The record holds phi, pressure, energy and max_force as
    computed here. Arrays are float64 and never changed in place. Raises InputError for wrong shapes, values not
    finite, radii ≤ 0, a cell of no area or less wide than a disk, centres with different z, or two at one place.
    """

    base: np.ndarray  # (N, 2) coordinates, multiples of GRID
    offset: np.ndarray  # (N, 2) remainder
    radii: np.ndarray  # (N,)
    cell_base: np.ndarray  # (2, 2) rows a1 = (Lx, 0), a2 = (γ Ly, Ly), multiples of GRID
    cell_offset: np.ndarray  # (2, 2)
    potential: Potential
    record: dict  # how it was made: pressure, phi, seed, protocol, …
    images: np.ndarray | None  # (N, 2) numbers of cell vectors by which each disk was wrapped, if counted

    def __init__(self, positions, radii, cell, potential="harmonic", stiffness="constant", k=1.0):
        positions, radii, k = (
            read_numbers(name, values)
            for name, values in (("positions", positions), ("radii", radii), ("k", k))
        )
        if positions.ndim == 2 and positions.shape[1] == 3:
            thickness = np.ptp(positions[:, 2]) if len(positions) else 0.0
            if not thickness <= PLANE_TOLERANCE * np.max(radii, initial=0.0):
                raise InputError(f"centres spread by {thickness:.6g} in z: packings are two-dimensional here")
            positions = positions[:, :2]
        if k.ndim:
            raise InputError(f"k of shape {k.shape}: must be one number")
        law = Potential(potential, stiffness, float(k))
        exact = Packing.from_positions(positions, radii, cell_of(cell), law).with_measurements()
        self.__dict__.update(exact.__dict__)

    def __repr__(self):
        pressure = f", pressure = {self.record['pressure']:.6g}" if "pressure" in self.record else ""
        return f"<{self.n} disks, {self.potential.kind}, phi = {self.phi:.6g}{pressure}>"

    @classmethod
    def from_positions(
        cls, positions, radii, cell, potential=None, *, positions_low=None, cell_low=None, record=None
    ):
        """A packing of coordinates (N, 2), radii (N,) and cell rows (2, 2), with what its file says of it as `record`.

        positions_low, cell_low: parts of the coordinates and rows that one double does not hold. Raises InputError
        for wrong shapes, values that are not finite, radii ≤ 0 or a cell of no area.
        """
        # all in C order: for another layout all loops over disks would be compiled again
        positions, radii, cell = (np.asarray(a, float, "C") for a in (positions, radii, cell))
        n = len(radii) if radii.ndim == 1 else 0
        if n == 0 or positions.shape != (n, 2) or cell.shape != (2, 2):
            raise InputError(
                f"positions {positions.shape}, radii {radii.shape}, cell {cell.shape}: need (N, 2), (N,) and (2, 2)"
            )
        low = np.zeros((n, 2)) if positions_low is None else np.asarray(positions_low, float)
        cell_rest = np.zeros((2, 2)) if cell_low is None else np.asarray(cell_low, float)
        if low.shape != positions.shape or cell_rest.shape != cell.shape:
            raise InputError(
                f"positions_low {low.shape}, cell_low {cell_rest.shape}: shapes of positions and cell"
            )
        for name, array in (
            ("positions", positions),
            ("radii", radii),
            ("cell", cell),
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
        if cell[0, 1] != 0 or cell[0, 0] <= 0 or cell[1, 1] <= 0:
            raise InputError(f"cell {cell.tolist()}: need rows (Lx, 0) and (γ Ly, Ly) with Lx, Ly > 0")
        if np.abs(positions).max() > 2.0**28 or np.abs(cell).max() > 2.0**28:
            raise InputError(
                "positions or cell beyond 2^28 in units of length: scale them to disks of size about one"
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
                f"cell that repeats at a distance of {packing.period:.6g} with a disk of diameter "
                f"{2 * radii.max():.6g}: a disk would touch its own image; use more disks"
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
    def n(self) -> int:
        """Number of disks N."""
        return len(self.radii)

    @property
    def positions(self):
        """Coordinates rounded to one double, (N, 2)."""
        return self.base + self.offset

    @property
    def unwrapped(self):
        """Coordinates that do not jump where a disk leaves the cell, x + k₁ a₁ + k₂ a₂ with `images` k, (N, 2).

        Raises InputError where images are not counted.
        """
        if self.images is None:
            raise InputError("unwrapped positions: images are not counted; the snapshots of a flow have them")
        return self.positions + self.images @ self.cell

    @property
    def cell(self):
        """Cell rows rounded to one double, (2, 2)."""
        return self.cell_base + self.cell_offset

    @property
    def area(self) -> float:
        """V = Lx Ly."""
        cell = self.cell
        return float(cell[0, 0] * cell[1, 1])

    @property
    def period(self) -> float:
        """Distance between a disk and its nearest image: the shortest vector of the lattice.

        Lagrange's reduction: subtract m times the shorter vector from the longer, m the nearest integer, until m = 0.
        """
        short, long = sorted(self.cell, key=lambda vector: vector @ vector)
        while (
            (square := short @ short) > 0
            and (turns := np.round(short @ long / square))
            and np.isfinite(turns)
        ):
            short, long = sorted((short, long - turns * short), key=lambda vector: vector @ vector)
        return float(np.hypot(*short))

    @property
    def phi(self) -> float:
        """Packing fraction Σ π ρ² / V, overlaps counted twice (the field's convention)."""
        return float(np.pi * np.sum(self.radii**2) / self.area)

    def contacts(self):
        """All overlaps, those that bear no load included: `Contacts` of i, j, r, overlap, force, …"""
        from jampetsc.packing.contacts import find_contacts

        return find_contacts(self)

    def minimise(self, **options) -> "Packing":
        """A proved minimum of the energy in this cell, reached from these positions; `options` as for `jampetsc.pack`.

        Collective. Raises as `jampetsc.pack`, which takes packing fractions between 0.8 and 1.5.
        """
        import jampetsc

        return jampetsc.pack(from_=self, phi=self.phi, **options)

    @cached_property
    def _state(self):
        from jampetsc.packing.contacts import measure

        return measure(self)

    @property
    def pressure(self) -> float:
        """p = Σ f r/(2V) over all overlaps."""
        return self._state.pressure

    @property
    def stress(self):
        """σ = −Σ f r r/(|r| V), (2, 2): compression is negative, p = −tr σ/2."""
        return self._state.stress

    @property
    def coordination(self) -> float:
        """Z = 2N_c/n of the contacts that bear load, n disks without rattlers."""
        return self._state.coordination

    @property
    def rattlers(self):
        """Mask (N,) of disks with fewer than three loaded contacts, found by removing such disks until none is left."""
        return self._state.rattlers

    @property
    def fingerprint(self) -> str:
        """sha256 of all that determines the forces: coordinates to the last bit, radii, cell and potential.

        The same for a packing in a file, however a coordinate is divided between base and offset.
        """
        law = f"{self.potential.kind} {self.potential.stiffness} {float(self.potential.k).hex()} {self.n}"
        digest = hashlib.sha256(law.encode())
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
        """The same packing in the equivalent cell with tilt |γ| ≤ ½ Lx/Ly, a2 → a2 − m a1, every disk inside it.

        Whole cell vectors are subtracted, so that no bond changes by more than the rounding of offsets.
        """
        turns = np.round(self.cell[1, 0] / self.cell[0, 0])
        whole = np.array([[1.0, 0.0], [-turns, 1.0]])
        cell_base, cell_offset = vectors(whole, self.cell_base), vectors(whole, self.cell_offset)
        image = np.floor(fractional(self.positions, cell_base + cell_offset))
        base, offset = self.base - vectors(image, cell_base), self.offset - vectors(image, cell_offset)
        images = self.images
        if images is not None:  # k₁ a₁ + k₂ a₂ in vectors of the new cell, whose a₂ is the old one less m a₁
            images = (images @ [[1.0, 0.0], [turns, 1.0]] + image).astype(int)
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
    cell_base, cell_offset = _deformed(packing.cell_base, packing.cell_offset, np.zeros((2, 2)), strain)
    places = {"base": base, "offset": offset, "cell_base": cell_base, "cell_offset": cell_offset}
    # not `replace`: velocities of a snapshot are not those of the deformed packing
    return Packing._of_fields(
        **{entry.name: getattr(packing, entry.name) for entry in fields(Packing)} | places
    )


def _deformed(base, offset, moves, strain):
    """(base, offset) of x + o + E (x + o), all (N, 2)."""
    low = offset + moves
    x, y = (base + low).T
    low += np.column_stack(displace(strain, x, y))
    carry = GRID * np.rint(low / GRID)
    return base + carry, low - carry
