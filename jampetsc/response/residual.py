"""The residual of a Galerkin solution, and a bound on the error of G* that follows, whatever made the space.

With the quasistatic field x_qs, the rates λ_m, modes φ_m and loads h_m of `galerkin`

    x(s) = x_qs − s Σ_m h_m φ_m / (λ_m + s) ,    r(s) = k_γ + s b_γ + (K + sB) x(s) = R w(s) ,

    R = [k_γ + K x_qs ,  b_γ + B (x_qs − Σ h_m φ_m) ,  (K − λ_1 B) φ_1 , …] ,    w = (1, s, −s h_1/(λ_1 + s), …) ,

and |ΔG*| V ≤ √2 rᴴ(K + ωB)⁻¹r at s = iω (K and B are diagonal together, and |a + ib| ≥ (a + b)/√2 for a, b ≥ 0).
If all solves were exact, the columns of R would be multiples of one q (see `basis`). That is not relied upon: they are
computed contact by contact, and decomposed as

    r(iω) = Σ_k c_k v_k + e ,    |r| ≤ Σ_k |c_k| |v_k| + |e|    in the norm of (K + ωB)⁻¹ .

The energies vᵀ(K + sB)⁻¹v of a few directions v_k, the first of them q, follow from solves with the factors that exist.
For the rest e, which is due to inexact solves and rounding, a lower bound on K + sB is enough, a `ShiftBound`. Where
that is too coarse, another direction is split off from e. Both are carried from s to ω by

    (K + ωB)⁻¹ ≤ c (K + sB)⁻¹ ,    c = (λ_max + s)/(λ_max + ω)  for ω ≥ s ,    c = s/ω  for ω < s ,

with 0 ≤ K ≤ λ_max B, and energies interpolate between two shifts, because the inverse is operator convex.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from jampetsc.collective import on_root
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.response import tall
from jampetsc.response.assembly import ROW, Pencil
from jampetsc.response.certificate import EPSILON, ROUNDING
from jampetsc.response.compatibility import drag_of

SUMMED = 2.0 * EPSILON  # rounding of the sum over the contacts of a disk, relative to its terms
DIRECTIONS = 12  # at most; if these are not enough, the solves are too poor for the accuracy


def transfer(largest_rate: float, s, omega):
    """c with (K + ωB)⁻¹ ≤ c (K + sB)⁻¹ for s and ω of shapes that fit; λ_max may be infinite."""
    top = largest_rate
    above = (top + s) / (top + omega) if np.isfinite(top) else 1.0
    return np.where(omega >= s, above, s / omega)


def energy_between(largest_rate: float, energies: dict[float, float], omega):
    """Bound on vᵀ(K + ωB)⁻¹v, (M,), from bounds {s: vᵀ(K + sB)⁻¹v}."""
    at = np.array(sorted(energies))
    energy = np.array([energies[s] for s in at])
    best = np.min(energy[:, None] * transfer(largest_rate, at[:, None], omega), axis=0)
    between = (omega > at[0]) & (omega < at[-1])
    best[between] = np.minimum(best[between], np.interp(omega[between], at, energy))
    return best


def positive(energies: dict) -> dict:
    """The same {s: (e, left)}, if every energy e is finite and ≥ 0. Raises NotPositiveDefinite."""
    for s, (e, _) in energies.items():
        if not (np.isfinite(e) and e >= 0.0):
            raise NotPositiveDefinite(
                f"K + sB at s = {s:g} is not positive definite: it has an energy of {e:.1e}"
            )
    return energies


@dataclass(frozen=True, eq=False)
class ShiftBound:
    """K + sB ≥ least · D for a diagonal D, at one shift s."""

    shift: float
    diagonal: np.ndarray  # (n_local,) of D
    least: float
    rounding: np.ndarray  # (m + 2,) bound on the rounding of R's columns, in the norm of D⁻¹


@dataclass(frozen=True, eq=False)
class _Worst:
    """Where the bound is furthest above the allowed error: the rest e there is R of_columns − v of_directions."""

    omega: float
    of_columns: np.ndarray  # (m + 2,)
    of_directions: np.ndarray  # (k,)
    hopeless: bool  # the part of the bound from the known directions is too large by itself


class GalerkinResidual:
    """R and w of one Galerkin solution. Collective; arrays hold this rank's rows.

    columns   R, (n_local, m + 2)
    motions   (rows, 1 + m): of the contacts in x_qs, g included, and in the modes
    fields    x_qs (n_local,) and the modes (n_local, m)
    """

    def __init__(self, pencil: Pencil, motions, fields, rates, loads):
        self.pencil, c = pencil, pencil.compatibility
        self.rates, self.loads, self.motions = rates, loads, motions
        (quasistatic, mode_fields), still, modes = fields, motions[:, 0], motions[:, 1:]
        self._fast, self._flow = still - modes @ loads, quasistatic - mode_fields @ loads
        self._still, self._modes, self._mode_fields = still, modes, mode_fields
        self.columns = np.empty((len(rates) + 2, len(quasistatic))).T
        self.columns[:, 0] = c.forces(c.w_K * still) - c.force
        self.columns[:, 1] = c.forces(c.w_B * self._fast) + c.drag * self._flow
        for j, rate in enumerate(rates):
            forces = c.forces((c.w_K - rate * c.w_B) * modes[:, j])
            self.columns[:, j + 2] = forces - (rate * c.drag) * mode_fields[:, j]
        for column in self.columns.T:
            pencil.project(column)  # no net force but for rounding, which drag alone would not hold back

    def weights(self, omega):
        """w(iω), complex (m + 2, M)."""
        s = 1j * np.asarray(omega)
        return np.vstack((np.ones_like(s), s, -self.loads[:, None] * s / (self.rates[:, None] + s)))

    def rounding(self, s, diagonal):
        """Bound on the rounding of each column of R, (m + 2,), in the norm of D⁻¹.

        With D = `diagonal`, at least `reach(s)`: |D^(−½) |C|ᵀ|f||² ≤ ROW Σ f²/(|w_K| + s w_B) for forces f of contacts.
        """
        c = self.pencil.compatibility
        size = np.abs(c.w_K) + s * c.w_B
        inverse = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        of_K, of_both, of_B = inverse * c.w_K**2, inverse * c.w_K * c.w_B, inverse * c.w_B**2
        on_disks = c.drag**2 / diagonal
        sums = tall.squares(self._modes, np.array([of_K, of_both, of_B]))
        of_fields = tall.squares(self._mode_fields, on_disks[None])[0]
        rates = self.rates
        terms = np.empty(len(rates) + 2)
        terms[0] = of_K @ self._still**2 + (ROUNDING / SUMMED) ** 2 * np.sum(c.force_size**2 / diagonal)
        terms[1] = of_B @ self._fast**2 + on_disks @ self._flow**2
        terms[2:] = sums[0] - 2.0 * rates * sums[1] + rates**2 * (sums[2] + of_fields)
        return SUMMED * np.sqrt(ROW[self.pencil.dimension] * np.maximum(self.pencil.network.sum(terms), 0.0))


class ResidualBound:
    """Bound on √2 rᴴ(K + ωB)⁻¹r at frequencies ω (M,), from the factors that exist. Methods are collective.

    factors      `Factors` of the pencil
    q, energies  the direction that r has but for inexact solves, (n_local,), and its `Factors.energies`
    """

    def __init__(self, residual: GalerkinResidual, factors, q, energies, largest_rate: float, omega):
        self.residual, self.factors, self.omega = residual, factors, omega
        self.largest_rate = largest_rate
        self.pencil = residual.pencil
        self.network = self.pencil.network
        self.shift_bounds = [self._first_shift_bound()]
        self.directions = np.empty((len(q), 0))
        self._energies = []
        self._add_direction(q.copy(), energies)

    def _first_shift_bound(self):
        """Under drag on all unknowns K + sB ≥ s times the least; else from the factor of the middle shift."""
        top, least = float(self.omega[-1]), float(drag_of(self.network, self.pencil.law).min())
        if least:
            return self._shift_bound_from(top, np.ones(self.pencil.K.getLocalSize()[0]), top * least)
        shifts = sorted(self.factors.shifts)
        return self._shift_bound(shifts[len(shifts) // 2])

    def _shift_bound(self, s):
        diagonal = self.pencil.diagonal(s)
        if self.pencil.projects:
            diagonal = np.ones_like(diagonal)  # as `ShiftedFactor.least_eigenvalue` has it where it projects
        return self._shift_bound_from(s, diagonal, self.factors.least_eigenvalue(s))

    def _shift_bound_from(self, s, diagonal, least):
        reach = np.maximum(self.pencil.compatibility.reach(s), self.pencil.diagonal(s))
        stretch = self.network.max(reach / diagonal)
        return ShiftBound(s, diagonal, least, np.sqrt(stretch) * self.residual.rounding(s, reach))

    def _add_direction(self, v, energies) -> bool:
        """Add a direction; False if it is zero, which may be rounding without a net force."""
        self.pencil.project(v)
        if not self.network.sum(float(v @ v)):
            return False
        self.directions = np.column_stack((self.directions, v))
        self._energies.append(energies)
        return True

    def _inverse(self, lower, omega):
        """a with (K + ωB)⁻¹ ≤ a D⁻¹ for the D of a shift bound; infinite where its lower bound is zero."""
        with np.errstate(divide="ignore"):
            return transfer(self.largest_rate, lower.shift, omega) / np.float64(lower.least)

    def within(self, allowed):
        """The bound, (M,), sharpened until it is within `allowed` (M,), or as far as that is possible."""
        while True:
            bound, worst = self._evaluate(allowed)
            if worst is None or not self._sharpen(worst):
                return bound

    def _sharpen(self, worst):
        """Add a shift bound or a direction for the worst frequency; False if neither can help."""
        kept = {lower.shift for lower in self.shift_bounds}
        nearest = min(kept | set(self.factors.shifts), key=lambda s: abs(np.log(s / worst.omega)))
        if nearest not in kept:
            self.shift_bounds.append(self._shift_bound(nearest))
            return True
        if worst.hopeless or self.directions.shape[1] >= DIRECTIONS:
            return False
        v = self.residual.columns @ worst.of_columns - self.directions @ worst.of_directions
        return self._add_direction(v, positive(self.factors.energies(v)))

    def _evaluate(self, allowed):
        """(bound (M,), `_Worst` or None where it is within `allowed`)."""
        triangles = [self._triangle(lower) for lower in self.shift_bounds]
        diagonals = [self.pencil.diagonal(s) for s in self.factors.shifts]
        stretch = [
            [self.network.max(diagonal / lower.diagonal) for diagonal in diagonals]
            for lower in self.shift_bounds
        ]
        return on_root(self.network.comm, lambda: self._judge(triangles, stretch, allowed))

    def _triangle(self, lower):
        """The triangle T of the QR factorisation D^(−½) [v_1, …, R] = QT, on rank 0."""
        own = tall.triangle((self.directions, self.residual.columns), np.sqrt(lower.diagonal))
        parts = self.network.comm.gather(own)
        return None if parts is None else np.linalg.qr(np.vstack(parts), mode="r")

    def _judge(self, triangles, stretch, allowed):
        """The result of `_evaluate`, on rank 0.

        triangles   T for each shift bound
        stretch     for each shift bound, by shift: largest diagonal entry of K + sB over that of D
        """
        omega, k = self.omega, self.directions.shape[1]
        if not all(np.isfinite(triangle).all() for triangle in triangles):
            return np.full(len(omega), np.inf), None
        w = self.residual.weights(omega)
        norms = [self._norm(energies, stretch) for energies in self._energies]
        norms = np.array(norms).reshape(k, len(omega))
        proved, rest, parts = [], [], []
        for lower, triangle in zip(self.shift_bounds, triangles, strict=True):
            c = solve_triangular(triangle[:k, :k], triangle[:k, k:] @ w) if k else np.empty((0, len(omega)))
            e = triangle[k:, k:] @ w
            inverse = np.sqrt(self._inverse(lower, omega))
            with np.errstate(invalid="ignore"):  # 0 · ∞, where K + sB may be singular
                proved.append(np.sum(np.abs(c) * norms, axis=0) + (lower.rounding @ np.abs(w)) * inverse)
                rest.append(np.linalg.norm(e, axis=0) * inverse)
            parts.append(e)
        total = np.array(proved) + np.array(rest)
        best = np.argmin(np.nan_to_num(total, nan=np.inf, posinf=np.inf), axis=0)
        bound = np.sqrt(2.0) * np.take_along_axis(total, best[None], axis=0)[0] ** 2
        bound = np.nan_to_num(bound, nan=np.inf, posinf=np.inf)
        if np.all(bound <= allowed):
            return bound, None
        with np.errstate(divide="ignore", over="ignore"):
            i = int(np.argmax(bound / allowed))
        which = best[i]
        return bound, self._worst(
            omega[i], triangles[which], w[:, i], parts[which][:, i], proved[which][i], allowed[i]
        )

    def _norm(self, energies, stretch):
        """Bound on |v|, (M,), from (e, left) of `Cholesky.energy` at the shifts: ρᵀ(K + sB)⁻¹ρ by the shift bounds."""
        bounds = {}
        for number, (s, (e, left)) in enumerate(energies.items()):
            inverse = min(
                self._inverse(lower, s) * row[number]
                for lower, row in zip(self.shift_bounds, stretch, strict=True)
            )
            bounds[s] = e + left**2 * float(inverse)
        return np.sqrt(energy_between(self.largest_rate, bounds, self.omega))

    def _worst(self, omega, triangle, w, e, proved, allowed):
        """The direction in which e is largest, as a combination of the columns of R and of the directions."""
        k = self.directions.shape[1]
        _, _, axes = np.linalg.svd(np.column_stack((e.real, e.imag)), full_matrices=False)
        of_columns = axes[0, 0] * w.real + axes[0, 1] * w.imag
        of_directions = (
            solve_triangular(triangle[:k, :k], triangle[:k, k:] @ of_columns) if k else np.empty(0)
        )
        return _Worst(float(omega), of_columns, of_directions, bool(np.sqrt(2.0) * proved**2 > allowed))
