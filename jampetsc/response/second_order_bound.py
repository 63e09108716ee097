"""A bound on the error of G* with inertia, from factors at real shifts alone.

With Z(s) = K + sB + s²M̂, s = iω, a field x leaves the residual r = c + Z x and G* V is off by rᵀZ⁻¹r. For any θ with

    H = cos θ (K − ω²M̂) + sin θ ωB > 0 ,    |rᵀZ(iω)⁻¹r| ≤ rᴴH⁻¹r ,

since eᴴHe = Re(e^(−iθ) eᴴr) for e = Z⁻¹r. H needs no factor of its own, for H ≥ c Z(s) at a shift s > 0 gives

    |ΔG*| V ≤ rᴴZ(s)⁻¹r / c .

θ > π/2: with K ≤ λ_max B (`rational.largest_rate`), a = −cos θ,

    H ≥ (ω sin θ − a λ_max) B + a ω²M̂ ,    Z(s) ≤ (λ_max + s) B + s²M̂ ,

and c = a ω²/s² is largest with a = ω/(ω² + L²)^½, L = λ_max + (λ_max + s) ω²/s².

θ = π/4: below ω_c, if K + ω_c B − ν ω_c²M̂ ≥ 0, K + ωB ≥ ν ω ω_c M̂, so that √2 H ≥ (1 − ω/(νω_c)) (K + ωB). That
rests on one count of negative pivots (`DefinitenessTest`).
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.collective import on_root
from jampetsc.errors import ConvergenceError
from jampetsc.petsc.cholesky import least_eigenvalue
from jampetsc.petsc.inertia import ShiftedInertia
from jampetsc.petsc.session import current
from jampetsc.response.assembly import ROW, Pencil, assemble
from jampetsc.response.certificate import EPSILON, inverse_norm
from jampetsc.response.shift_factors import Factors

MARGIN = 2.0  # ν
MAX_REST = 1e-2  # of the allowed error, in what no direction holds
MAX_DIRECTIONS = 60
SPREAD = 1e-14  # of the largest weighted residual: smaller ones are rounding


@dataclass(frozen=True)
class Definiteness:
    """What is known of K, B and M̂ for H.

    largest_rate   λ_max with K ≤ λ_max B, may be infinite
    omega_c        K + ω_c B − ν ω_c²M̂ ≥ 0; 0 if no frequency is known
    """

    largest_rate: float
    omega_c: float = 0.0

    def transfer(self, omega, s):
        """c with H ≥ c Z(s) at ω, of shapes that fit; 0 where no H is known."""
        omega, s = np.asarray(omega, float), np.asarray(s, float)
        return np.maximum(self._of_damping(omega, s), self._of_stiffness(omega, s))

    def _of_damping(self, omega, s):
        """c for θ > π/2."""
        if not np.isfinite(self.largest_rate):
            return np.zeros(np.broadcast_shapes(omega.shape, s.shape))
        return self._angle(omega, s) * (omega / s) ** 2

    def _angle(self, omega, s):
        """a = −cos θ."""
        return omega / np.hypot(omega, self.largest_rate + (self.largest_rate + s) * (omega / s) ** 2)

    def _of_stiffness(self, omega, s):
        """c for θ = π/4."""
        if not self.omega_c:
            return np.zeros(np.broadcast_shapes(omega.shape, s.shape))
        resisted = np.minimum(s, self.omega_c)  # K + sB ≥ ν ω_c min(s, ω_c) M̂
        left = self._left(omega) * np.minimum(1.0, omega / s)
        return left / (1.0 + s**2 / (MARGIN * self.omega_c * resisted))

    def _left(self, omega):
        """What H has of K + ωB for θ = π/4, 0 above ω_c."""
        left = np.maximum(1.0 - omega / (MARGIN * self.omega_c), 0.0) / np.sqrt(2.0)
        return left * (omega <= self.omega_c)

    def energy_ratio(self, omega: float, s: float) -> float:
        """c with H ≥ c (K + ωB), for the θ whose `transfer` from s is larger; 0 where no H is known."""
        omega, s = np.float64(omega), np.float64(s)
        if self._of_stiffness(omega, s) >= self._of_damping(omega, s):
            return float(self._left(omega)) if self.omega_c else 0.0
        rate = self.largest_rate
        return float(self._angle(omega, s) * (rate + s) * (omega / s) ** 2 / (rate + omega))


class DefinitenessTest:
    """Tests K + ωB − νω²M̂ > 0 by counts of negative pivots, nothing pinned. Collective; needs the real build."""

    def __init__(self, pencil: Pencil):
        self._pins = len(pencil.pins)
        self._free = assemble(pencil.network, pencil.law, pinned=False)
        self._inertia = pencil.mass.diagonal

    def holds(self, omega: float) -> bool:
        """Whether it is proved at ω: as many eigenvalues are negative as moves that inertia alone resists."""
        free, inertia = self._free, self._inertia
        matrix = free.K.copy()
        matrix.axpy(omega, free.B, structure=current().PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        diagonal = matrix.getDiagonal()
        sizes = np.abs(diagonal.getArray()) + MARGIN * omega**2 * inertia
        diagonal.getArray()[:] -= MARGIN * omega**2 * inertia
        matrix.setDiagonal(diagonal)
        diagonal.setArray(1.0 / np.sqrt(sizes))
        matrix.diagonalScale(diagonal, diagonal)
        try:
            return ShiftedInertia(matrix, "K + ωB − 2ω²M").count_certified(0.0) == self._pins
        except ConvergenceError:
            return False


class MassiveShift:
    """Z(s) at one shift, solved with a factor of K + sB + s²M. Methods are collective."""

    def __init__(self, pencil: Pencil, factors: Factors, s: float):
        self.pencil, self.factors, self.shift, mass = pencil, factors, s, pencil.mass
        self._vector = pencil.K.createVecRight()
        self._moves = mass.move_correction(self._solve_pinned, s * s)
        size = pencil.diagonal(s) + s * s * mass.pinned_diagonal
        self.diagonal = np.ones_like(size) if pencil.projects else size  # D of a bound Z(s) ≥ least D
        self._reach = pencil.compatibility.reach(s) + s * s * mass.pinned_diagonal
        self._least = None

    def _solve_pinned(self, right):
        self._vector.setArray(right)
        self.factors.factor(self.shift).solve(self._vector, self._vector)
        return self._vector.getArray().copy()

    def solve(self, right):
        """Z(s)⁻¹ right, (n_local,)."""
        return self._moves.correct(self._solve_pinned(right))

    def apply(self, x):
        """Z(s) x, (n_local,)."""
        pencil, s = self.pencil, self.shift
        image = pencil.times(pencil.K, x) + s * pencil.times(pencil.B, x) + s * s * pencil.mass.apply(x)
        pencil.project(image)
        return image

    def residual(self, right, x):
        """(right − Z x, bound on its rounding in the norm of D⁻¹)."""
        sizes = self._reach * self.pencil.mass.terms(np.abs(x)[None])[0] + np.abs(right)
        rounding = 4.0 * EPSILON * ROW[self.pencil.dimension] * self.norm(sizes)
        return right - self.apply(x), rounding

    def norm(self, forces) -> float:
        """|f| of forces (n_local,), real or complex, in the norm of D⁻¹."""
        return inverse_norm(self.pencil.network, forces, self.diagonal)

    @property
    def least(self) -> float:
        """μ with Z(s) ≥ μD on the unknowns that are not pinned, see `cholesky.least_eigenvalue`."""
        if self._least is None:
            self._least = self._find_least()
        return self._least

    def _find_least(self):
        pencil, root = self.pencil, np.sqrt(self.diagonal)
        generator = np.random.default_rng(pencil.K.getOwnershipRange()[0])

        def start():
            x = np.where(pencil.mass.free, generator.standard_normal(len(root)), 0.0)
            pencil.project(x)
            return x

        def step(x):
            right = root * x
            y = self.solve(right)
            left, rounding = self.residual(right, y)
            y += self.solve(left)
            left, rounding = self.residual(right, y)
            size = np.sqrt(pencil.network.sum(float(y @ (self.diagonal * y))))
            return root * y, self.norm(left) + rounding, size

        return least_eigenvalue(start, step)

    def energies(self, residuals, rounding, weights):
        """Bounds on rᴴZ(s)⁻¹r, (F,), of complex residuals r (F, n_local).

        rounding   (F,) of the residuals, in the norm of D⁻¹
        weights    (F,) 1/(what is accurate enough), positive: what is far smaller is bounded by `least`
        """
        count, network = len(residuals), self.pencil.network
        if not self.least > 0.0:
            return np.full(count, np.inf)
        columns = np.concatenate((residuals.real, residuals.imag))  # (2F, n_local)
        scale = np.sqrt(np.tile(weights, 2) / self.least)
        gram = network.sum((columns / self.diagonal) @ columns.T) * np.outer(scale, scale)
        values, axes, rest, d = on_root(network.comm, lambda: _principal_directions(gram, count))
        norms = np.sqrt(rest / weights)
        norms += rounding / np.sqrt(self.least)
        if not d:
            return norms**2
        # columns = Σ_j shares_j directions_j, directions orthonormal in D⁻¹
        roots = np.sqrt(values[:d])
        directions = ((axes[:, :d] / roots).T * scale) @ columns
        shares = axes[:, :d] * roots / scale[:, None]
        solved = np.array([self.solve(direction) for direction in directions])
        left, noise = zip(*map(self.residual, directions, solved), strict=True)
        left = np.array(left)
        products = network.sum(np.array([directions @ solved.T, solved @ left.T]))
        energy = products[0] + products[1]
        energy = 0.5 * (energy + energy.T)
        unsolved = np.array([self.norm(part) for part in left]) + np.array(noise)
        parts = np.einsum("kj,ji,ki->k", shares, energy, shares)
        missed = (np.abs(shares) @ unsolved) ** 2 / self.least
        # what the residuals' rounding adds to 2 xᵀρ is below 2 |x|_Z |δρ|
        parts = np.maximum(parts, 0.0) + missed + 2.0 * np.sqrt(np.maximum(parts, 0.0) * missed)
        return (np.sqrt(parts[:count] + parts[count:]) + norms) ** 2


def _principal_directions(gram, count):
    """(values (d,), axes (2F, d), what they leave (F,), d): eigenvectors of weighted products (2F, 2F) that matter."""
    values, axes = np.linalg.eigh(gram)
    values, axes = values[::-1], axes[:, ::-1]
    kept = axes**2 * np.maximum(values, 0.0)  # (2F, 2F): what each direction holds of each column
    total = kept.sum(axis=1)
    rest = np.maximum(total[:, None] - np.cumsum(kept, axis=1), 0.0)
    rest = np.column_stack((total, rest)) + SPREAD * values[0]
    rest = rest[:count] + rest[count:]  # real and imaginary parts
    enough = np.flatnonzero(rest.max(axis=0) <= MAX_REST)
    significant = int(np.sum(values > SPREAD * values[0]))
    d = min(int(enough[0]) if len(enough) else 2 * count, MAX_DIRECTIONS, significant)
    return values[:d], axes[:, :d], rest[:, d], d
