"""A network of bonds as data: all that the linear response needs, of a lattice, of another program, of a packing."""

import hashlib
import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.packing.cell import MAX_COORDINATE, SIDES, check_cell, read_numbers, reduced_basis
from jampetsc.packing.contacts import LinearBonds, measure, net_forces, stress_tensor, virial_pressure
from jampetsc.packing.geometry import geometry_of
from jampetsc.packing.neighbours import fractional, lengths, vectors
from jampetsc.packing.packing import Packing
from jampetsc.packing.particles import UNIT_BALL
from jampetsc.packing.potentials import MAX_STIFFNESS

MAX_IMAGE = 2**31  # cell vectors in a shortest vector of the lattice
NEAREST_TIE = 1e-9  # relative difference of two distances below which the nearest image is not unique


@dataclass(frozen=True, eq=False, init=False)
class Network:
    """N nodes and M bonds in a periodic cell (D = 2 or 3), for every function that takes a packing's linear response.

    positions   (N, D) places of the nodes, in the cell or out of it
    bonds       (M, 2) numbers of the two nodes of each bond, from 0
    cell        L, (Lx, Ly), (Lx, Ly, xy) with a₂ = (xy, Ly), rows (D, D) …, all forms that `Packing` takes
    stiffness   k of each bond, d²V/dr² > 0, one number or (M,)
    tension     T = dV/dr of each bond, one number or (M,): positive where the bond pulls (stretched), negative where
                it pushes; the force of a contact is f = −T
    images      (M, D) whole numbers of cell vectors: r = x_j − x_i + image · cell; None: the nearest image
    radii       (N,) of the nodes, only for damping laws under which they roll
    k           unit of stiffness: weights of a damping law count in k τ₁
    dimension   as of `Packing`: nodes with the same z are in a plane unless it is 3

    A bond adds k a∥² + (T/r) |a⊥|² to K (BT eq. 4). Nodes without bonds do not count. Lengths are in any unit.
    Arrays are never changed in place. Raises InputError for wrong shapes, values not finite, bonds of a node to
    itself, of no length or given twice, stiffness ≤ 0, and a nearest image that is not unique.
    """

    positions: np.ndarray  # (N, D)
    bonds: np.ndarray  # (M, 2) int64
    images: np.ndarray  # (M, D) int64
    cell: np.ndarray  # (D, D) rows a₁, a₂, …
    stiffness: np.ndarray  # (M,)
    tension: np.ndarray  # (M,)
    radii: np.ndarray | None  # (N,)
    k: float
    record: dict  # how it was made

    def __init__(
        self,
        positions,
        bonds,
        cell,
        stiffness=1.0,
        tension=0.0,
        images=None,
        radii=None,
        k=1.0,
        record=None,
        dimension=None,
    ):
        geometry = geometry_of(_positions(positions), cell, dimension)
        positions, cell = geometry.positions, geometry.cell
        check_cell(cell)
        bonds = _bonds(bonds, len(positions))
        if images is None:
            images = nearest_images(positions, bonds, cell)
        else:
            images = _whole_numbers("images", images)
            if images.ndim == 2 and images.shape[1] == 3 > positions.shape[1] and not images[:, 2].any():
                images = images[:, :2]
            if images.shape != (shape := (len(bonds), positions.shape[1])):
                raise InputError(f"images: shape {images.shape}, must be {shape}, one row for each bond.")
        _check_repeated(bonds, images)
        values = {
            "stiffness": _of_bonds("stiffness", stiffness, len(bonds)),
            "tension": _of_bonds("tension", tension, len(bonds)),
        }
        _check_stiffness("stiffness", values["stiffness"])
        k = _of_bonds("k", k, 1)
        _check_stiffness("k", k)
        self.__dict__.update(
            positions=positions,
            bonds=bonds,
            images=images,
            cell=cell,
            **values,
            radii=None if radii is None else _radii(radii, len(positions)),
            k=float(k[0]),
            record=dict(record or {}),
        )
        short = np.flatnonzero(~(self.linear_bonds.distance > 0.0))
        if len(short):
            raise InputError(
                f"{_bond(bonds, short[0])}: has no length. Move one of its nodes, or leave the bond out."
            )

    @classmethod
    def of_packing(cls, packing: Packing) -> "Network":
        """The contacts of a packing that bear load, with their stiffness, force and radii; rattlers have no bonds."""
        contacts = measure(packing).contacts
        gap = contacts.r - (packing.positions[contacts.j] - packing.positions[contacts.i])
        return cls(
            packing.positions,
            np.column_stack((contacts.i, contacts.j)),
            packing.cell,
            contacts.stiffness,
            -contacts.force,
            np.rint(fractional(gap, packing.cell)),
            packing.radii,
            packing.potential.k,
            {"protocol": "contacts of a packing"},
            packing.dimension,
        )

    def __repr__(self):
        return f"<network of {self.n} nodes and {len(self.bonds)} bonds>"

    @property
    def n(self) -> int:
        """Number of nodes N."""
        return len(self.positions)

    @property
    def dimension(self) -> int:
        """D, 2 or 3."""
        return self.positions.shape[1]

    @property
    def volume(self) -> float:
        """V = Lx Ly (Lz), an area in two dimensions."""
        return math.prod(np.diag(self.cell).tolist())

    @cached_property
    def linear_bonds(self) -> LinearBonds:
        """Its bonds with vectors r, lengths, forces and stiffnesses."""
        i, j = self.bonds.T
        r = (self.positions[j] - self.positions[i]) + vectors(self.images, self.cell)
        return LinearBonds(i, j, r, lengths(r), -self.tension, self.stiffness)

    @property
    def isolated(self):
        """Mask (N,) of the nodes without bonds."""
        return np.bincount(self.bonds.ravel(), minlength=self.n) == 0

    @property
    def pressure(self) -> float:
        """p = Σ f r/(D V)."""
        bonds = self.linear_bonds
        return virial_pressure(bonds.force, bonds.distance, self.volume, self.dimension)

    @property
    def stress(self):
        """σ = −Σ f r r/(|r| V), (D, D): compression is negative, p = −tr σ/D."""
        return stress_tensor(self.linear_bonds, self.volume)

    @property
    def imbalance(self) -> float:
        """Largest net force on a node over the mean |T| of the bonds; 0 without forces."""
        mean = float(np.mean(np.abs(self.tension)))
        return float(lengths(net_forces(self.n, self.linear_bonds)).max()) / mean if mean else 0.0

    @property
    def is_stable_by_construction(self) -> bool:
        """Whether no bond pushes, so that K is a sum of squares: it has no negative modes."""
        return bool((self.tension >= 0.0).all())

    @property
    def fingerprint(self) -> str:
        """sha256 of all that determines the response: nodes, bonds, cell, stiffness, forces, radii and k."""
        digest = hashlib.sha256(f"network {self.n} {len(self.bonds)} {self.k.hex()}".encode())
        for array in (self.bonds, self.images):
            digest.update(np.ascontiguousarray(array, "<i8"))
        for array in (self.positions, self.cell, self.stiffness, self.tension, self.radii):
            if array is not None:
                digest.update(np.ascontiguousarray(array + 0.0, "<f8"))  # + 0.0: -0 and 0 are one number
        return digest.hexdigest()

    def with_record(self, **entries) -> "Network":
        """The same network with `entries` added to the record."""
        return self.replace(record={**self.record, **entries})

    def diluted(self, keep: float, seed: int) -> "Network":
        """The network with the share `keep` of its bonds, chosen at random: round(keep M) of them, in their order.

        Of one seed, a higher share has all bonds of a lower one. Raises InputError for a share out of
        (0, 1], and where no bond is left.
        """
        if not 0.0 < keep <= 1.0:
            raise InputError(
                f"{named('keep')} {keep:g}: must lie in (0, 1]. Give the share of bonds that stay."
            )
        count = round(keep * len(self.bonds))
        if not count:
            raise InputError(f"{named('keep')} {keep:g}: leaves none of {len(self.bonds)} bonds. Raise it.")
        rows = np.sort(np.random.default_rng(seed).permutation(len(self.bonds))[:count])
        per_bond = {name: getattr(self, name)[rows] for name in ("bonds", "images", "stiffness", "tension")}
        return self.replace(**per_bond)

    def replace(self, **changes) -> "Network":
        """A network with other values of some fields, which are not checked, as `Packing.replace`."""
        network = object.__new__(Network)
        values = {name: getattr(self, name) for name in self.__dataclass_fields__}
        network.__dict__.update(values | changes)
        return network


def nearest_images(positions, bonds, cell):
    """Whole numbers of cell vectors (M, D) with which each bond is shortest. Raises InputError where two are equal.

    The nearest image lies among 3^D in a reduced cell, with the shortest vectors of its lattice.
    """
    reduced, basis = reduced_basis(cell)
    if np.abs(basis).max() > MAX_IMAGE:
        raise InputError("cell: too oblique for nearest images. Give images, or another cell of the lattice.")
    gap = positions[bonds[:, 1]] - positions[bonds[:, 0]]
    centre = -np.rint(gap @ np.linalg.inv(reduced))
    shifts = centre[:, None, :] + np.array(list(itertools.product(SIDES, repeat=len(cell))))
    images = gap[:, None, :] + shifts @ reduced
    distances = lengths(images.reshape(-1, len(cell))).reshape(images.shape[:2])
    order = np.argsort(distances, axis=1)
    first, second = np.take_along_axis(distances, order[:, :2], axis=1).T
    ties = np.flatnonzero(second - first <= NEAREST_TIE * second)
    if len(ties):
        raise InputError(
            f"{_bond(bonds, ties[0])}: two images are equally near ({first[ties[0]]:g}). Give images, or a larger cell."
        )
    nearest = np.take_along_axis(shifts, order[:, :1, None], axis=1)[:, 0]
    return np.rint(nearest @ basis.astype(float)).astype(np.int64)


def _bond(bonds, row):
    return f"bond {row}, of nodes {bonds[row, 0]} and {bonds[row, 1]}"


def _check_finite(name, values):
    if not np.isfinite(values).all():
        row = np.argwhere(~np.isfinite(values))[0]
        raise InputError(f"{name}[{', '.join(map(str, row))}]: {values[tuple(row)]}, must be finite.")


def _positions(values):
    positions = read_numbers("positions", values)
    if positions.ndim != 2 or positions.shape[1] not in UNIT_BALL or not len(positions):
        raise InputError(f"positions: shape {positions.shape}, must be (N, 2) or (N, 3).")
    _check_finite("positions", positions)
    if np.abs(positions).max() > MAX_COORDINATE:
        raise InputError("positions: beyond 2^28 units of length. Scale them to bonds of length about one.")
    return positions


def _whole_numbers(name, values):
    numbers = read_numbers(name, values)
    _check_finite(name, numbers)
    if (numbers != np.rint(numbers)).any() or np.abs(numbers).max(initial=0.0) > 2.0**53:
        raise InputError(f"{name}: must be whole numbers.")
    return numbers.astype(np.int64)


def _bonds(values, n):
    bonds = _whole_numbers("bonds", values)
    if bonds.ndim != 2 or bonds.shape[1] != 2 or not len(bonds):
        raise InputError(
            f"bonds: shape {bonds.shape}, must be (M, 2) with at least one bond: two nodes of each."
        )
    wrong = np.flatnonzero(((bonds < 0) | (bonds >= n)).any(axis=1))
    if len(wrong):
        raise InputError(
            f"{_bond(bonds, wrong[0])}: nodes are numbered from 0 to {n - 1}. Correct the number."
        )
    alone = np.flatnonzero(bonds[:, 0] == bonds[:, 1])
    if len(alone):
        raise InputError(
            f"{_bond(bonds, alone[0])}: joins a node to itself or to its image. Leave it out, or take a larger cell."
        )
    return bonds


def _check_repeated(bonds, images):
    """Raise InputError where a bond is listed twice, from the same or from its other end."""
    turned = bonds[:, 0] > bonds[:, 1]
    keys = np.where(turned[:, None], np.hstack((bonds[:, ::-1], -images)), np.hstack((bonds, images)))
    order = np.lexsort(keys.T)
    same = np.flatnonzero((keys[order][1:] == keys[order][:-1]).all(axis=1))
    if len(same):
        first, second = sorted(order[same[0] : same[0] + 2])
        raise InputError(f"{_bond(bonds, second)}: is bond {first} again. Give each bond once.")


def _of_bonds(name, values, count):
    values = read_numbers(name, values)
    if values.shape not in ((), (count,)):
        shape_text = f"one number or ({count},), one for each bond" if count > 1 else "one number"
        raise InputError(f"{name}: shape {values.shape}, must be {shape_text}.")
    _check_finite(name, np.atleast_1d(values))
    return np.broadcast_to(values, (count,)).copy()


def _check_stiffness(name, values):
    wrong = np.flatnonzero(~((values >= 1.0 / MAX_STIFFNESS) & (values <= MAX_STIFFNESS)))
    if len(wrong):
        raise InputError(
            f"{name}[{wrong[0]}]: {values[wrong[0]]:g}, must be positive, from {1.0 / MAX_STIFFNESS:g} to "
            f"{MAX_STIFFNESS:g}."
        )


def _radii(values, n):
    radii = read_numbers("radii", values)
    if radii.shape != (n,):
        raise InputError(f"radii: shape {radii.shape}, must be ({n},), one for each node.")
    _check_finite("radii", radii)
    if (radii <= 0).any():
        row = int(np.argmax(radii <= 0))
        raise InputError(f"radii[{row}]: {radii[row]:g}, must be positive.")
    return radii
