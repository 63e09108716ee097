"""Probes: forces on the particles that bear load instead of a strain, and what follows from how these move.

With the forces f of unit amplitude the field is x = (K + iωB)⁻¹f, the susceptibility χ = fᵀx, a length over a force. No
force acts on spins, and a uniform background on each connected component takes its net force away.

    wave:1,0:transverse     f_i = e cos k·x_i and e sin k·x_i with k = 2π cell⁻¹n, n in cell vectors, |e| = 1 across k;
    wave:2,1:longitudinal   or e along k. χ(k) = Σ χ over cos and sin /n, in 3D the mean of both polarisations
    wave:…+wave:…           several waves at once
    point:7, point:3,7      a unit force on one particle along each axis, χ the mean over the axes
    points:100, points:100:5  the same for each of a sample of 100 particles, of a seed (0)
    array (N, D)            any forces, from python

n is the number of particles that bear load, in χ(k) and in n/V, so that for a wave, with the weight w_d of drag,

    G(k, ω) = (n/V)/(k²χ)  →  G*(ω) + iω (n/V) w_d/k²  for k → 0, longitudinal M*_xx in place of G* ,

with G* of simple shear, M*_xx of one axis, w_d in units of kτ₁, and without what the viscosity η_F of the fluid adds to
G*: no force moves the fluid. Of the symmetric loads with a pressure p, G* = C_xyxy − p/2. Where a packing is not
isotropic it is 1/(A⁻¹)_ee of A_ab = C_ab + iω (n/V) w_d/k² δ_ab, C between the strains E = e_a k̂.
"""

import hashlib
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jampetsc.errors import InputError, named

TRANSVERSE, LONGITUDINAL = "transverse", "longitudinal"
MAX_WAVE_NUMBER = 10_000  # cell vectors, along each axis
MAX_POINTS = 10_000
GRAMMAR = "wave:1,0:transverse, wave:2,1:longitudinal, point:7 or points:100"


@dataclass(frozen=True, eq=False)
class ProbedParticles:
    """Particles that bear load on this rank, and the numbers of all."""

    positions: np.ndarray  # (m, D) of this rank's
    numbers: np.ndarray  # (m,) theirs in the packing
    bearing: np.ndarray  # (n,) of all ranks, increasing
    cell: np.ndarray  # (D, D)
    count: int  # N, of all particles


@dataclass(frozen=True)
class Wave:
    """Forces of a plane wave, transverse or longitudinal."""

    numbers: tuple[int, ...]  # n
    polarisation: str

    def __post_init__(self):
        if len(self.numbers) not in (2, 3):
            raise InputError(
                f"{named('load')} {self}: {len(self.numbers)} numbers of cell vectors. Give one for each axis."
            )
        if not any(self.numbers) or max(map(abs, self.numbers)) > MAX_WAVE_NUMBER:
            raise InputError(
                f"{named('load')} {self}: numbers of cell vectors must not all be zero, nor exceed {MAX_WAVE_NUMBER}"
            )

    def __str__(self):
        return f"wave:{','.join(map(str, self.numbers))}:{self.polarisation}"

    @property
    def dimension(self) -> int:
        """D of the packings that it fits."""
        return len(self.numbers)

    def vector(self, cell):
        """k (D,) in a cell (D, D), whose rows are its vectors: k·a_j = 2πn_j."""
        return 2.0 * np.pi * np.linalg.solve(cell, np.array(self.numbers, float))

    def polarisations(self, cell):
        """Unit vectors e, (1, D), in 3D two where it is transverse."""
        along = self.vector(cell)
        along /= np.linalg.norm(along)
        if self.polarisation == LONGITUDINAL:
            return along[None]
        # the rows of the complement, whichever turn about k they have
        return np.linalg.svd(along[None])[2][1:]

    def columns(self, particles: ProbedParticles):
        """As `Waves.columns`, of this wave."""
        phase = particles.positions @ self.vector(particles.cell)
        size = 2.0 + 4.0 * np.abs(particles.positions) @ np.abs(
            self.vector(particles.cell)
        )  # the phase rounds
        sizes = np.repeat(size[:, None], self.dimension, axis=1)
        for direction in self.polarisations(particles.cell):
            for wave in (np.cos(phase), np.sin(phase)):
                yield wave[:, None] * direction, sizes


@dataclass(frozen=True)
class Waves:
    """Forces of one plane wave, or of several at once."""

    waves: tuple[Wave, ...]

    @classmethod
    def read(cls, text: str) -> "Waves":
        """Of waves with + between them. Raises ValueError."""
        waves = []
        for words in (word.split(":") for word in text.split("+")):
            if len(words) != 3 or words[0] != "wave" or words[2] not in (TRANSVERSE, LONGITUDINAL):
                raise ValueError
            waves.append(Wave(whole_numbers(words[1]), words[2]))
        return cls(tuple(waves))

    def __post_init__(self):
        if len({wave.dimension for wave in self.waves}) > 1:
            raise InputError(
                f"{named('load')} {self}: waves of two and of three numbers. Give waves of one dimension."
            )
        if len(set(self.waves)) < len(self.waves):
            raise InputError(f"{named('load')} {self}: a wave twice. Give each once.")

    def __str__(self):
        return "+".join(map(str, self.waves))

    @property
    def dimension(self) -> int:
        """D of the packings that they fit."""
        return self.waves[0].dimension

    @property
    def has_columns(self) -> bool:
        """Whether arrays have a column for each."""
        return len(self.waves) > 1

    def vectors(self, cell):
        """k of each, (W, D)."""
        return np.array([wave.vector(cell) for wave in self.waves])

    def columns(self, particles: ProbedParticles):
        """(forces (m, D), sizes (m, D)) of each right-hand side; what rounds in a force is some ε of its size."""
        for wave in self.waves:
            yield from wave.columns(particles)

    def weights(self, particles: ProbedParticles):
        """Of the right-hand sides in the χ of each wave, (W, L)."""
        counts = [len(wave.polarisations(particles.cell)) for wave in self.waves]
        rows = np.repeat(np.eye(len(counts)) / counts, 2 * np.array(counts), axis=1)
        return rows / len(particles.bearing)

    def modulus_factors(self, particles: ProbedParticles):
        """(n/V)/k² of each wave, (W,): G(k, ω) = factor/χ."""
        k2 = np.sum(self.vectors(particles.cell) ** 2, axis=1)
        return len(particles.bearing) / (abs(np.linalg.det(particles.cell)) * k2)


@dataclass(frozen=True)
class PointForces:
    """A unit force on single particles one after another: on particles of these numbers, or on a sample of `count`."""

    particles: tuple[int, ...] = ()
    count: int = 0
    seed: int = 0

    dimension: ClassVar = None  # fits any
    has_columns: ClassVar = True

    @classmethod
    def read(cls, text: str) -> "PointForces":
        """Of point:LIST. Raises ValueError."""
        _, numbers = text.split(":")
        return cls(whole_numbers(numbers))

    @classmethod
    def read_sample(cls, text: str) -> "PointForces":
        """Of points:COUNT or points:COUNT:SEED. Raises ValueError."""
        count, seed = (*map(int, text.split(":")[1:]), 0)[:2]
        if text.count(":") > 2:
            raise ValueError
        return cls((), count, seed)

    def __post_init__(self):
        numbers = self.particles
        if len(set(numbers)) < len(numbers):
            raise InputError(f"{named('load')} {self}: a particle twice. Give each once.")
        if min(numbers, default=0) < 0 or self.seed < 0:
            raise InputError(f"{named('load')} {self}: particles and seeds must be at least 0")
        if not 1 <= (len(numbers) or self.count) <= MAX_POINTS:
            raise InputError(f"{named('load')} {self}: must be from 1 to {MAX_POINTS} particles")

    def __str__(self):
        if self.particles:
            return f"point:{','.join(map(str, self.particles))}"
        return f"points:{self.count}" + (f":{self.seed}" if self.seed else "")

    def chosen(self, particles: ProbedParticles):
        """Numbers of the particles, (P,). Raises InputError for those that there are not."""
        if self.count > len(particles.bearing):
            raise InputError(
                f"{named('load')} {self}: {len(particles.bearing)} particles bear load. Give a smaller number."
            )
        if self.count:
            sample = np.random.default_rng(self.seed).choice(particles.bearing, self.count, replace=False)
            return np.sort(sample)
        chosen = np.array(self.particles)
        if len(missing := chosen[chosen >= particles.count]):
            raise InputError(
                f"{named('load')} {self}: particle {missing[0]} of {particles.count}, which are counted from 0. Give "
                "another one."
            )
        if len(loose := np.setdiff1d(chosen, particles.bearing)):
            raise InputError(
                f"{named('load')} {self}: particle {loose[0]} bears no load and holds no force. Give another one."
            )
        return chosen

    def columns(self, particles: ProbedParticles):
        """As `Waves.columns`, for each particle one along each axis."""
        shape = particles.positions.shape
        for number in self.chosen(particles):
            for axis in range(shape[1]):
                forces = np.zeros(shape)
                forces[particles.numbers == number, axis] = 1.0
                yield forces, forces

    def weights(self, particles: ProbedParticles):
        """Of the right-hand sides in the χ of each particle, (P, L)."""
        dimension = len(particles.cell)
        return np.kron(np.eye(len(self.chosen(particles))), np.full((1, dimension), 1.0 / dimension))


@dataclass(frozen=True, eq=False)
class Forces:
    """Any forces on particles; known by a hash of their array, which a file has, but not its name."""

    array: np.ndarray | None  # (N, D); None: of a file
    digest: str

    has_columns: ClassVar = False

    @classmethod
    def of(cls, array) -> "Forces":
        """Of an array (N, D). Raises InputError where it holds no forces."""
        try:
            array = np.array(array, float)
        except (TypeError, ValueError):
            raise InputError(f"{named('load')}: forces must be numbers") from None
        if not np.isfinite(array).all() or not array.any():
            raise InputError(f"{named('load')}: forces must be finite, and not all zero")
        return cls(array, hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()[:16])

    @classmethod
    def read(cls, text: str) -> "Forces":
        """Of the name that `__str__` gives. Raises ValueError."""
        _, digest = text.split(":")
        if len(digest) != 16 or int(digest, 16) < 0:
            raise ValueError
        return cls(None, digest)

    def __str__(self):
        return f"forces:{self.digest}"

    @property
    def dimension(self) -> int | None:
        """D."""
        return None if self.array is None else self.array.shape[1]

    def columns(self, particles: ProbedParticles):
        """As `Waves.columns`, one. Raises InputError for a wrong number of forces, or forces that nothing holds."""
        if self.array is None:
            raise InputError(
                f"{named('load')} {self}: the name of forces in a file. Give their array, in python."
            )
        if len(self.array) != particles.count:
            raise InputError(
                f"{named('load')}: {len(self.array)} forces for {particles.count} particles. Give one for each."
            )
        loose = np.setdiff1d(np.flatnonzero(self.array.any(axis=1)), particles.bearing)
        if len(loose):
            raise InputError(
                f"{named('load')}: particle {loose[0]} bears no load and holds no force. Set the forces on such "
                "particles to zero."
            )
        forces = self.array[particles.numbers]
        yield forces, np.abs(forces)

    def weights(self, particles: ProbedParticles):
        """Of the right-hand side in χ, (1, 1)."""
        return np.ones((1, 1))


READERS = {
    "wave": Waves.read,
    "point": PointForces.read,
    "points": PointForces.read_sample,
    "forces": Forces.read,
}


def read_probe(text: str) -> Waves | PointForces | Forces | None:
    """The probe of a text in the grammar above; None where it does not begin as one. Raises InputError."""
    kind, colon, _ = text.partition(":")
    if not colon or kind not in READERS:
        return None
    try:
        return READERS[kind](text)
    except InputError:
        raise
    except ValueError:
        raise InputError(f"{named('load')} {text}: not a probe. Give one such as {GRAMMAR}.") from None


def whole_numbers(text: str) -> tuple[int, ...]:
    """The whole numbers between commas. Raises ValueError."""
    return tuple(int(word) for word in text.split(","))
