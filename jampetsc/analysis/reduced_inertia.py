"""G*(ω), G(t) and J(t) with inertia from a pencil of second order that was projected on a few vectors."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import expm

from jampetsc.analysis.transient import MAX_GROWTH

POINTS_PER_OCTAVE = 24  # of times
STEADY = 1e-6  # growth within all times that is rounding


def solve_second_order(K, B, omega: float, columns):
    """(K + sB + s²)⁻¹ columns (m, L), s = iω, for K and B (m, m), scaled to a unit diagonal about."""
    s, size = 1j * omega, np.abs(np.diag(K)) + omega * np.abs(np.diag(B)) + omega**2
    scale = 1.0 / np.sqrt(size)
    matrix = (K + s * B + s**2 * np.eye(len(K))) * np.outer(scale, scale)
    return scale[:, None] * np.linalg.solve(matrix, scale[:, None] * columns)


@dataclass(frozen=True, eq=False)
class ReducedInertia:
    """C*(ω) of L loads in a space of m vectors, orthonormal in the mass matrix, eigenvectors of K in it.

    With s = iω, c_E(s) = k_E + s b_E and all of it over V,

        C_EE′(ω) = k_EE′ + s b_EE′ − c_E(s)ᵀ (Ω² + sB + s²)⁻¹ c_E′(s) .
    """

    stiffness: np.ndarray  # (m,) Ω², in 1/time²
    damping: np.ndarray  # (m, m) B, in 1/time
    k: np.ndarray  # (L, m) elastic load column over √V
    b: np.ndarray  # (L, m) viscous load column over √V
    k_gg: np.ndarray  # (L, L) of affine motion, in k
    b_gg: np.ndarray  # (L, L) the same, in kτ₁

    def modulus(self, omega):
        """C*(ω), complex, (…, L, L) for omega (…)."""
        flat = np.ravel(np.asarray(omega, float))
        values = []
        for at in flat:
            s = 1j * at
            column = (self.k + s * self.b).T
            solved = solve_second_order(np.diag(self.stiffness), self.damping, at, column)
            values.append(self.k_gg + s * self.b_gg - column.T @ solved)
        return np.array(values).reshape((*np.shape(omega), *self.k_gg.shape))

    def stress_relaxation(self, time):
        """G(t) after a step of each strain, (…, L, L), for times (…) > 0; without the Dirac part of `b_gg`.

        The step moves the vectors by ÿ + Bẏ + Ω²y = −k − b δ(t), so that y = 0 and ẏ = −b right after it, and

            G(t) = k_γγ + kᵀy(t) + bᵀẏ(t) .
        """
        system = self.relaxing()
        values = [system.at(at) for at in np.ravel(np.asarray(time, float))]
        return np.array(values).reshape((*np.shape(time), *self.k_gg.shape))

    def relaxing(self) -> "LinearSystem":
        """(y, ẏ, γ) after a step of strain."""
        m, loads = len(self.stiffness), len(self.k_gg)
        generator = np.zeros((2 * m + loads,) * 2)
        generator[:m, m : 2 * m] = np.eye(m)
        generator[m : 2 * m, :m], generator[m : 2 * m, m : 2 * m] = -np.diag(self.stiffness), -self.damping
        generator[m : 2 * m, 2 * m :] = -self.k.T
        start = np.vstack((np.zeros((m, loads)), -self.b.T, np.eye(loads)))
        return LinearSystem(generator, start, np.hstack((self.k, self.b, self.k_gg)))

    def creeping(self) -> "LinearSystem":
        """(y, ẏ, γ, σ) after a step of stress of one load: y obeys ÿ + Bẏ + Ω²y = −kγ − bγ̇, and γ

            b_γγ γ̇ + k_γγ γ + kᵀy + bᵀẏ = σ ,

        which where b_γγ, and with it b, is zero gives γ itself.
        """
        m = len(self.stiffness)
        strain, stress, velocities = 2 * m, 2 * m + 1, slice(m, 2 * m)
        generator = np.zeros((2 * m + 2,) * 2)
        generator[: strain + 1, : strain + 1] = self.relaxing().generator
        balance = np.concatenate((-self.k[0], -self.b[0], -self.k_gg[0], [1.0]))  # b_γγ γ̇
        if self.b_gg.item() > 0.0:
            generator[strain] = balance / self.b_gg.item()
            generator[velocities] -= np.outer(self.b[0], generator[strain])
            output = np.eye(2 * m + 2)[strain]
        else:
            output = balance / self.k_gg.item()
            output[strain] = 0.0
            generator[:, strain] = 0.0
            generator[velocities] -= np.outer(self.k[0], output)
        return LinearSystem(generator, np.eye(2 * m + 2)[:, stress:], output[None])

    def transient(self, slowest: float, fastest: float) -> "OscillatingTransient":
        """G(t) and J(t) of one load for times from 1/fastest to 1/slowest, of frequencies at which G* is known.

        Where G₀ < 0 creep diverges, and ends early.
        """
        first, last, creeping = 1.0 / fastest, 1.0 / slowest, self.creeping()
        growth = float(np.linalg.eigvals(creeping.generator).real.max())
        growth = growth if growth * last > STEADY else 0.0
        creep = creeping.series(first, max(first, min(last, MAX_GROWTH / growth if growth else last)))
        return OscillatingTransient(*self.relaxing().series(first, last), *creep, growth)


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """output · x with ẋ = generator · x from x(0) = start."""

    generator: np.ndarray  # (n, n)
    start: np.ndarray  # (n, L)
    output: np.ndarray  # (L, n)

    def at(self, time: float):
        """The output (L, L)."""
        return self.output @ (expm(self.generator * time) @ self.start)

    def series(self, first: float, last: float):
        """(times (t,), output (t,)) from `first` to `last`, POINTS_PER_OCTAVE evenly in each doubling of time."""
        edges = np.geomspace(first, last, int(np.ceil(np.log2(last / first))) + 1)
        state = expm(self.generator * first) @ self.start
        times, values = [first], [(self.output @ state).item()]
        for low, high in pairwise(edges):
            step = (high - low) / POINTS_PER_OCTAVE
            propagator = expm(self.generator * step)
            for number in range(1, POINTS_PER_OCTAVE + 1):
                state = propagator @ state
                times.append(low + number * step)
                values.append((self.output @ state).item())
        return np.array(times), np.array(values)


@dataclass(frozen=True, eq=False)
class OscillatingTransient:
    """Response in time with inertia. G lacks the Dirac part of b_γγ."""

    time: np.ndarray  # (n,)
    G: np.ndarray  # (n,) stress relaxation
    creep_time: np.ndarray  # (n',): ends early where creep diverges
    J: np.ndarray  # (n',) creep compliance
    growth_rate: float  # of creep, 0 where it is stable

    @property
    def arrays(self) -> dict:
        """{name: array} as files hold them."""
        return {
            "stress/time": self.time,
            "stress/G": self.G,
            "creep/time": self.creep_time,
            "creep/J": self.J,
        }

    @property
    def numbers(self) -> dict:
        """{name: value} as files hold them."""
        return {"growth_rate": self.growth_rate}
