"""Contacts of a packing: bond vectors rounded once, overlaps, forces, rattlers, pressure and stress."""

from dataclasses import dataclass, fields
from itertools import combinations_with_replacement

import numpy as np

from jampetsc.errors import InputError
from jampetsc.packing.neighbours import lengths, neighbour_pairs, vectors
from jampetsc.packing.particles import Particles

# a contact that carries less than this fraction of p·d only just touches and does not count
MIN_FORCE_RATIO = 1e-6
FORCE_ROUNDING = 1e-14  # … nor does one whose force may be rounding alone, in units of stiffness · d
MAX_SIZE_RATIO = 1e3  # of diameters, up to which the smallest or largest particles raise that
LOAD_RATIO = 10.0  # of max |F|: a force on particles that nothing holds is a load where it is larger
IMBALANCE = {2: "max|F|/(p d)", 3: "max|F|/(p d²)"}  # by dimension, see `imbalance`
BALANCED = 1e-4  # largest max |F| / (p d^(D−1)) of forces that are called balanced; `pack` leaves 1e-10


@dataclass(frozen=True, eq=False)
class LinearBonds:
    """M bonds, structure of arrays. Bond vectors point from i to j: r = x_j − x_i + image · cell."""

    i: np.ndarray  # (M,)
    j: np.ndarray  # (M,)
    r: np.ndarray  # (M, D) bond vector
    distance: np.ndarray  # (M,) |r|
    force: np.ndarray  # (M,) f = −dV/dr, positive in compression
    stiffness: np.ndarray  # (M,) d²V/dr², the k of BT eq. 4

    def __len__(self):
        return len(self.i)

    def __getitem__(self, selection):
        """The bonds of a mask or an index array."""
        return type(self)(*(getattr(self, f.name)[selection] for f in fields(self)))

    @property
    def force_per_length(self):
        """f/r, (M,): what pre-stress takes from the stiffness across a bond (BT eq. 4)."""
        return self.force / self.distance

    @property
    def normal(self):
        """n = r/|r|, (M, D)."""
        return self.r / self.distance[:, None]

    @property
    def weight_rounding(self):
        """What rounding of the input may do to k and to f/r, in units of ε, (M, 2): nothing, where they are given."""
        return np.zeros((len(self), 2))


@dataclass(frozen=True, eq=False)
class Contacts(LinearBonds):
    """M contacts: bonds of overlapping disks."""

    overlap: np.ndarray  # (M,) δ = ρ_i + ρ_j − |r| > 0
    sigma: np.ndarray  # (M,) ρ_i + ρ_j

    @property
    def weight_rounding(self):
        """What rounding may do to k and to f/r, in units of ε, (M, 2): an overlap is off by ε σ."""
        excess = self.stiffness * self.overlap / self.force - 1.0  # α − 2
        along = self.stiffness * np.abs(excess) * self.sigma / self.overlap
        return np.column_stack((along, self.stiffness * self.sigma / self.distance))


def bond_vectors(disks: Particles, i, j, image):
    """x_j − x_i + image · cell, (M, D), rounded once: the bases cancel exactly, the offsets are tiny."""
    shift_base, shift_offset = vectors(image, disks.cell_base), vectors(image, disks.cell_offset)
    coarse = (disks.base[j] - disks.base[i]) + shift_base
    return coarse + ((disks.offset[j] - disks.offset[i]) + shift_offset)


def find_contacts(disks: Particles, rows=None) -> Contacts:
    """All overlapping pairs, just touching ones included; `rows` as for `neighbour_pairs`."""
    i, j, image = neighbour_pairs(
        disks.positions, disks.radii, disks.cell, skin=1e-9 * disks.radii.max(), rows=rows
    )
    r = bond_vectors(disks, i, j, image)
    distance = lengths(r)
    sigma = disks.radii[i] + disks.radii[j]
    overlap = sigma - distance
    touching = overlap > 0
    i, j, r, distance, sigma, overlap = (a[touching] for a in (i, j, r, distance, sigma, overlap))
    potential = disks.potential
    return Contacts(
        i,
        j,
        r,
        distance,
        potential.force(overlap, sigma),
        potential.contact_stiffness(overlap, sigma),
        overlap,
        sigma,
    )


def pair_keys(pairs, n: int):
    """A whole number for each pair i, j of n particles, (M,), the same for the same two particles."""
    i, j = pairs.i.astype(np.int64), pairs.j.astype(np.int64)
    return np.minimum(i, j) * n + np.maximum(i, j)


def force_threshold(disks: Particles, pressure: float) -> float:
    """Force above which a contact counts: max(1e-6 p d^(D−1), 1e-14 k d), d the mean diameter, k the unit of stiffness.

    The second one is less for exponents above 5/2, see `Potential.force_limit`.

    In place of k d half of k σ of the largest or smallest disks counts where that is more, up to MAX_SIZE_RATIO k d.
    Disks that only just touch carry no load, yet would add their stiffness to K and shift G* by per cents.
    """
    d, of_size = 2.0 * float(np.mean(disks.radii)), _force_of_rounding
    ends = (of_size(disks.potential, 2.0 * float(end)) for end in (disks.radii.min(), disks.radii.max()))
    of_mean = of_size(disks.potential, d)
    rounding = max(of_mean, 0.5 * min(max(ends), MAX_SIZE_RATIO * of_mean))
    least = disks.potential.force_limit(FORCE_ROUNDING) * rounding
    return max(MIN_FORCE_RATIO * pressure * d ** (disks.dimension - 1), least)


def _force_of_rounding(potential, sigma: float) -> float:
    """k σ of a contact of this length: what a relative change of its length does to the force, with the unit of k."""
    scale = float(potential.scale(np.array(sigma)))
    return potential.k * (sigma / scale) / scale * potential.reach(sigma)


def typical_force(disks: Particles, pressure: float) -> float:
    """p d^(D−1), d the mean diameter."""
    return pressure * (2.0 * float(np.mean(disks.radii))) ** (disks.dimension - 1)


def virial_pressure(force, distance, volume: float, dimension: int) -> float:
    """p = Σ f r / (D V) of contacts that are each listed once, (M,) and (M,)."""
    return float(np.sum(force * distance)) / (dimension * volume)


def stress_tensor(contacts: LinearBonds, volume: float):
    """σ_ab = −Σ f r_a r_b / (|r| V), (D, D): compression is negative, p = −tr σ / D."""
    axes = contacts.r.T
    stress = np.empty((len(axes), len(axes)))
    for a, b in combinations_with_replacement(range(len(axes)), 2):
        virial = float(np.sum(contacts.force_per_length * axes[a] * axes[b]))
        stress[a, b] = stress[b, a] = -virial / volume
    return stress


def assigned_volumes(disks: Particles):
    """V_i = V ρ_i^D/Σ ρ_j^D, (N,): the part of the cell assigned to each disk, its own volume over φ. They add to V."""
    shares = disks.radii**disks.dimension
    return disks.volume * shares / np.sum(shares)


def disk_stresses(disks: Particles, contacts: Contacts):
    """Stress of every disk, σ_i = −1/(2V_i) Σ f r r/|r| over its contacts, (N, D, D), with V_i of `assigned_volumes`.

    Each of its two disks has half of a contact's virial: Σ V_i σ_i = σ V with σ of `stress_tensor`, exactly.
    """
    virial = contacts.force_per_length[:, None, None] * contacts.r[:, :, None] * contacts.r[:, None, :] / 2.0
    total = np.zeros((disks.n, *virial.shape[1:]))
    for end in (contacts.i, contacts.j):
        np.add.at(total, end, virial)
    return -total / assigned_volumes(disks)[:, None, None]


def find_rattlers(n: int, i, j, dimension: int, joined=lambda loose: loose):
    """Mask (N,) of disks with fewer than D + 1 contacts, found by removing such disks until none is left.

    i, j     disks of each contact (M,), every contact from both its ends (`both_ends`)
    joined   function that completes a mask (N,) which is right only for the disks whose contacts are given
    """
    rattler = np.zeros(n, bool)
    while True:
        alive = ~(rattler[i] | rattler[j])
        loose = joined(np.bincount(i[alive], minlength=n) < dimension + 1)
        if np.array_equal(loose, rattler):
            return rattler
        rattler = loose


def both_ends(i, j):
    """(i, j) of contacts that are listed once, seen from both ends, (2M,) each."""
    return np.concatenate((i, j)), np.concatenate((j, i))


def net_forces(n: int, contacts: Contacts):
    """Sum of contact forces on each disk, (N, D)."""
    pull = contacts.normal * contacts.force[:, None]
    forces = np.empty((n, pull.shape[1]))
    for axis in range(pull.shape[1]):
        forces[:, axis] = np.bincount(contacts.j, pull[:, axis], minlength=n)
        forces[:, axis] -= np.bincount(contacts.i, pull[:, axis], minlength=n)
    return forces


@dataclass(frozen=True, eq=False)
class State:
    """Static state of a packing: what `pack` records and `info` prints."""

    contacts: Contacts  # the load-bearing ones, between disks that are not rattlers
    rattlers: np.ndarray  # (N,) mask
    pressure: float  # p = Σ f r / (D V) over all overlaps
    energy: float  # U, total
    stress: np.ndarray  # (D, D)
    max_force: float  # largest net force on a disk that is not a rattler
    threshold: float  # force above which a contact counts

    def bears(self, contacts: Contacts):
        """Mask (M,) of those that bear load: above the threshold, between disks that are not rattlers."""
        loose = self.rattlers[contacts.i] | self.rattlers[contacts.j]
        return (contacts.force > self.threshold) & ~loose

    @property
    def coordination(self) -> float:
        """Z = 2 N_c / (N − N_rattlers)."""
        backbone = int(np.count_nonzero(~self.rattlers))
        return 2.0 * len(self.contacts) / backbone if backbone else 0.0


def measure(disks: Particles, every: Contacts | None = None) -> State:
    """Contacts, rattlers, p, U, stress and force residual of a packing. Raises InputError for disks at one place.

    every: all its contacts, if they were found already
    """
    every = find_contacts(disks) if every is None else every
    if not every.distance.all():
        pair = int(np.argmin(every.distance))
        raise InputError(
            f"particles {every.i[pair]} and {every.j[pair]} are in one place: a force has no direction there. Move one."
        )
    pressure = virial_pressure(every.force, every.distance, disks.volume, disks.dimension)
    threshold = force_threshold(disks, pressure)
    loaded = every[every.force > threshold]
    rattlers = find_rattlers(disks.n, *both_ends(loaded.i, loaded.j), disks.dimension)
    backbone = loaded[~(rattlers[loaded.i] | rattlers[loaded.j])]
    residual = net_forces(disks.n, every)[~rattlers]
    return State(
        contacts=backbone,
        rattlers=rattlers,
        pressure=pressure,
        energy=float(np.sum(disks.potential.energy(every.overlap, every.sigma))),
        stress=stress_tensor(every, disks.volume),
        max_force=float(lengths(residual).max()) if len(residual) else 0.0,
        threshold=threshold,
    )


def imbalance(disks: Particles, state: State) -> float:
    """max |F| / (p d^(D−1)) of a packing, with d its mean diameter; infinite at zero pressure."""
    size = typical_force(disks, state.pressure)
    return state.max_force / size if size > 0 else np.inf
