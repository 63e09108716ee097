"""A rational Krylov space for K + sB: grown shift by shift, orthonormal in B, with its Galerkin residual.

Let x₀ = −(K + s₁B)⁻¹(k_γ + s₁b_γ) be the field at the first shift and g = b_γ + B x₀ the viscous force it
leaves. Then

    x(s) = x₀ − (s − s₁)(K + sB)⁻¹ g   exactly,

so the whole response is one resolvent applied to one vector. Where the load column has no viscous part, as of forces
or where only a fluid dissipates, the expansion starts at s₁ = ∞ instead, where x₀ = 0:

    x(s) = −(K + sB)⁻¹ g ,    g = k_γ .

The factor before the resolvent is called f(s) below, s − s₁ or 1. In the space that (K + s_jB)⁻¹, applied
again and again to g, spans (rational Krylov, Ruhe 1984) Galerkin's residual for that resolvent is a number
times one fixed vector,

    (K + sB) V y(s) − g = φ(s) q ,    φ(s) = Π_i (s − s_i) / (s + λ_i) ,

with s_i the shift of each step and λ_i the Ritz values: it vanishes at each shift as often as that was used. So
(K + sB)⁻¹q is the direction that is missing at s, and becomes the next vector: in exact arithmetic the one of Arnoldi's
recurrence, but without the cancellation that the recurrence suffers when a new vector is nearly in the space.
"""

import numpy as np

from jampetsc.collective import on_root
from jampetsc.response.assembly import ROW, Pencil
from jampetsc.response.certificate import EPSILON

BREAKDOWN = 1e-15  # a difference this small, relative to its terms, is rounding
NEW = 1e-5  # least part of a vector outside the space, relative to it, that has enough correct digits


class RationalBasis:
    """x₀ and V for one pencil, with B V and the projected K. All methods are collective; arrays hold this rank's rows.

    first     s₁, infinite where x₀ is zero; x0 (n_local,) as `field_at` makes it
    complete  whether the space holds the response to rounding
    """

    def __init__(self, pencil: Pencil, first: float, x0):
        self.pencil, self.first, self.x0 = pencil, first, x0
        self._vector = pencil.K.createVecRight()
        if np.isinf(first):
            self.g = pencil.k_gamma.getArray().copy()
        else:
            self.g = self._without_torque(self.pencil.times(pencil.B, x0) + pencil.b_gamma.getArray())
        # How large the terms were that g is the sum of, as a norm.
        of_K, of_B = pencil.largest
        largest, gg = (of_K, pencil.k_gg) if np.isinf(first) else (of_B, pencil.b_gg)
        row = ROW[pencil.dimension]
        terms = row * largest * np.sqrt(self._sum(x0 @ x0)) + np.sqrt(row * largest * abs(gg))
        # No force is left where nothing moves against the strain (crystals), or where B is proportional to K
        # (Kelvin and Voigt): then x₀ is the answer at every frequency.
        self.complete = not np.sqrt(self._sum(self.g @ self.g)) > BREAKDOWN * terms
        self._V, self._BV = np.empty((8, len(x0))), np.empty((8, len(x0)))  # a row per vector
        self.K = np.empty((0, 0))  # Vᵀ K V
        self.t = np.empty(0)  # Vᵀ g
        self.shifts = []  # one per vector
        self._rates = np.empty(0)

    @property
    def size(self) -> int:
        """Number m of vectors."""
        return len(self.shifts)

    @property
    def vectors(self):
        """Vᵀ, (m, n_local)."""
        return self._V[: self.size]

    @property
    def images(self):
        """(B V)ᵀ without torques, (m, n_local)."""
        return self._BV[: self.size]

    def extend(self, factor, s: float, count: int) -> None:
        """Add up to `count` vectors with the factor of K + sB; fewer when the space becomes complete."""
        for _ in range(count):
            q, more = self.residual()
            if self.complete or not more:
                self.complete = True
                return
            self._vector.setArray(q)
            factor.solve(self._vector, self._vector)
            self.complete = not self.append(self._vector.getArray().copy(), s)

    def append(self, w, s) -> bool:
        """Add the direction of w (n_local,), made with shift s; False if that was not done. Collective.

        A vector is refused, because it would spoil φ, if its part outside the space has few correct digits, or if it
        dissipates so little that its B-norm is rounding.
        """
        m = self.size
        V = self.vectors
        length = None
        for _ in range(2):  # twice is enough (Kahan); once leaves rounding of the large components
            Bw = self.pencil.times(self.pencil.B, w)
            overlaps = self._sum(np.append(V @ Bw, w @ Bw))
            length = length or overlaps[-1]
            w = w - overlaps[:-1] @ V
        Bw = self.pencil.times(self.pencil.B, w)
        norm2 = self._sum(w @ Bw)
        if not norm2 > max(
            NEW**2 * length, EPSILON * ROW[self.pencil.dimension] * self._sum(self.pencil.diagonals[1] @ w**2)
        ):
            return False
        if m == len(self._V):
            self._V, self._BV = (np.concatenate((a, np.empty_like(a))) for a in (self._V, self._BV))
        self._V[m] = w / np.sqrt(norm2)
        self._BV[m] = self._without_torque(Bw) / np.sqrt(norm2)
        self.shifts.append(s)
        w = self._V[m]
        row = self._sum(np.append(self.vectors @ self.pencil.times(self.pencil.K, w), w @ self.g))
        self.K, self.t = bordered(self.K, row[:-1]), np.append(self.t, row[-1])
        return True

    def _sum(self, values):
        return self.pencil.network.sum(values)

    def _without_torque(self, force):
        """A viscous force with its torques set to zero, which they are but for rounding.

        Where K does not act on angles the disks turn such that no torque is left, at any s; a solve at small s
        would amplify the rounding by 1/s.
        """
        if self.pencil.rolls and not self.pencil.network.turns_elastically:
            force.reshape(-1, self.pencil.dofs)[:, self.pencil.dimension :] = 0.0
        return force

    def factor(self, s):
        """f(s), what stands before the resolvent."""
        return np.ones_like(s) if np.isinf(self.first) else s - self.first

    @property
    def rates(self):
        """Ritz values λ (m,) ≥ 0."""
        if len(self._rates) != self.size:
            self._rates = np.maximum(np.linalg.eigvalsh(self.K), 0.0)
        return self._rates

    def residual(self):
        """(q, more): the fixed direction of Galerkin's residual, (n_local,), up to its sign. Collective.

        Formed at the real shift where |φ| is largest: what rounding does to the forces there is divided by
        |φ|, so that φ(s) q is right to the rounding of forces at every s. `more` is whether q is more than that
        rounding.
        """
        if not self.size:
            return self.g, not self.complete
        s, y, log = on_root(self.pencil.network.comm, self._trial)
        field, viscous = y @ self.vectors, s * (y @ self.images)
        force = self.pencil.times(self.pencil.K, field) + viscous - self.g
        terms = np.sqrt(self._sum(np.array([a @ a for a in (field, viscous, self.g, force)])))
        more = not terms[3] <= BREAKDOWN * (
            ROW[self.pencil.dimension] * self.pencil.largest[0] * terms[0] + terms[1] + terms[2]
        )
        return force * np.exp(-log), more

    def _trial(self):
        """(s, y(s), log |φ(s)|) for the real shift s where |φ| is largest; (K + sB) V y = g in the space."""
        ends = [*self.shifts, *self.rates[self.rates > 0]]
        trial = np.geomspace(1e-3 * min(ends), 1e3 * max(ends), 1000)
        size = self._log_phi(trial)
        best = int(np.argmax(size))
        s = trial[best]
        return s, np.linalg.solve(self.K + s * np.eye(self.size), self.t), size[best]

    def phi(self, omega):
        """|φ(iω)|², (M,), by its product formula: relatively exact however small it is."""
        return np.exp(2.0 * self._log_phi(1j * np.asarray(omega, float)))

    def _log_phi(self, s):
        """log |φ(s)|, (M,); φ = 1 without vectors."""
        s = s[:, None]
        with np.errstate(divide="ignore"):  # φ = 0 at a shift
            return np.sum(np.log(np.abs(s - self.shifts)) - np.log(np.abs(s + self.rates)), axis=1)


def bordered(matrix, row):
    """A symmetric matrix (m, m) with one more row and column (m + 1,)."""
    larger = np.empty((len(row), len(row)))
    larger[:-1, :-1], larger[-1], larger[:, -1] = matrix, row, row
    return larger


def field_at(pencil, factor, s: float):
    """x(s) = −(K + sB)⁻¹(k_γ + s b_γ), (n_local,), with the factor of K + sB. Collective.

    pencil   an object with k_gamma and b_gamma
    """
    x = pencil.k_gamma.duplicate()
    pencil.k_gamma.copy(x)
    x.axpy(s, pencil.b_gamma)
    factor.solve(x, x)  # with refinement, since everything that follows starts from this field
    return -x.getArray()
