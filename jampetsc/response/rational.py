"""The whole spectrum from a handful of real factorisations, with a bound on the error at every frequency.

Galerkin's method on a rational Krylov space (see `basis`). With residual r(iω) = f(iω) φ(iω) q the error of
G* obeys

    |ΔG*| V ≤ √2 rᴴ(K + ωB)⁻¹r = √2 |f(iω) φ(iω)|² qᵀ(K + ωB)⁻¹q ,

and qᵀ(K + sB)⁻¹q costs one solve with a factor at hand. From there to ω, with 0 ≤ K ≤ λ_max B:

    (K + ωB)⁻¹ ≤ c (K + sB)⁻¹ ,    c = (λ_max + s)/(λ_max + ω)  for ω ≥ s ,    c = s/ω  for ω < s ,

and between two shifts, because the inverse is operator convex, interpolation holds as well. The next shift
goes where the bound is furthest from what was asked for.
"""

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.mechanics.assembly import Pencil, largest_entry
from jampetsc.mechanics.compatibility import Compatibility
from jampetsc.response.basis import RationalBasis
from jampetsc.response.factors import make_factors
from jampetsc.response.galerkin import Galerkin

VECTORS = 4  # per factorisation: a solve is some twentieth of one, and more than a few vectors at one shift help little
MOST_VECTORS = 240
APART = 30.0  # shifts that are done at the same time differ by this ratio at least
SMALLEST_SHIFT = 1e-12  # relative to the largest rate: below it K + sB is K to a Cholesky factorisation
LARGEST_SHIFT = 1e6  # relative to the same: where B is singular, K would be rounding beside sB


class RationalSweep:
    """Grows a basis for one pencil until the bound is met at all frequencies asked for. All methods are collective.

    omega (M,) increasing; accuracy: relative, allowed in G' and in G'' each; parallel as for `make_factors`.
    """

    def __init__(
        self, pencil: Pencil, compatibility: Compatibility, omega, accuracy: float, parallel: str = "auto"
    ):
        self.pencil, self.compatibility = pencil, compatibility
        self.omega, self.accuracy = np.asarray(omega, float), accuracy
        self.largest_rate = largest_rate(pencil)
        self.rate = self.largest_rate  # sets the scale of the shifts
        if not np.isfinite(self.rate):
            self.rate = largest_entry(pencil.K) / largest_entry(pencil.B)
        self.factors = make_factors(pencil, parallel)
        self.basis: RationalBasis | None = None
        self.error = np.full(len(self.omega), np.inf)

    @property
    def factorisations(self) -> int:
        """Factorisations made."""
        return self.factors.count

    def restore(self, first, x0, vectors, shifts) -> None:
        """Go on from the basis of an earlier run; its factors are gone, new ones certify it as well."""
        self._set_basis(RationalBasis.restore(self.pencil, first, x0, vectors, shifts))

    def next_shifts(self) -> list[float]:
        """Where the next factorisations belong, as many as are done at once; none when the bound is met everywhere."""
        if self.basis is None:
            return self._spread([self._clip(self.omega[0])])
        if not self.factors.count:
            return self._spread([self.basis.shifts[-1] if self.basis.size else self._clip(self.omega[0])])
        ratio = self._ratio()
        worst = int(np.argmax(ratio))
        if ratio[worst] <= 1.0:
            return []
        if self.basis.complete and not np.isfinite(ratio[worst]):
            raise ConvergenceError(
                f"G″ vanishes at ω = {self.omega[worst]:g}, so no relative accuracy can be met: nothing moves "
                "against the strain, and there is no fluid"
            )
        if self.basis.complete or self.basis.size >= MOST_VECTORS:
            raise ConvergenceError(
                f"the bound on the error of G* stays at {ratio[worst]:.1e} times what --accuracy {self.accuracy:g} "
                f"allows at ω = {self.omega[worst]:g} after {self.factorisations} factorisations"
            )
        shifts = []
        candidates = self._clip(self.omega)
        while len(shifts) < self.factors.width and ratio.max() > 1.0:
            shifts.append(float(candidates[np.argmax(ratio)]))
            ratio[(candidates > shifts[-1] / APART) & (candidates < shifts[-1] * APART)] = 0.0
        return shifts

    def _spread(self, shifts):
        """Complete a first guess to as many shifts as are done at once, evenly over the range."""
        more = np.geomspace(shifts[0], self._clip(self.omega[-1]), self.factors.width + 1)[1:]
        return [*shifts, *(float(s) for s in more[::-1][: self.factors.width - 1] if s > APART * shifts[0])]

    def _clip(self, omega):
        return np.clip(omega, SMALLEST_SHIFT * self.rate, min(self.largest_rate, LARGEST_SHIFT * self.rate))

    def add_shifts(self, shifts) -> None:
        """Factorise K + sB at each of them, or take a factor close by, extend the basis and renew the bound."""
        self.factors.factorise(shifts)
        if self.basis is None:
            self._set_basis(self.factors.start(shifts[0]))
        self.factors.extend(self.basis, shifts, VECTORS)
        self.error = self._error_bound()

    def _set_basis(self, basis):
        self.basis = basis
        c = self.compatibility
        squares = (c.motions(basis.x0) + c.g) ** 2
        drag = c.drag * (basis.x0 @ basis.x0)
        self._still = self.pencil.network.sum(np.array([c.w_K @ squares, c.w_B @ squares + drag]))
        self._still[1] += c.drag_gg

    def worst(self) -> float:
        """Largest ratio of the bound to what the accuracy allows; done when ≤ 1."""
        return float(np.max(self._ratio()))

    def _ratio(self):
        """Bound on the error over what the accuracy allows for the present estimate of G', G'': (M,)."""
        basis = self.basis
        s = 1j * self.omega
        rates, rotation = np.linalg.eigh(basis.K)
        loads = rotation.T @ basis.t
        relaxed = np.sum(loads**2 / (rates + s[:, None]), axis=1)
        G = (self._still[0] + s * self._still[1] - basis.factor(s) ** 2 * relaxed) / self.pencil.network.area
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.error / (self.accuracy * np.minimum(np.abs(G.real), np.abs(G.imag)))
        return np.nan_to_num(ratio, nan=0.0, posinf=np.inf)  # 0/0: nothing dissipates, exactly

    def _error_bound(self):
        """Bound on |ΔG*| from all factors at hand, (M,)."""
        q, omega, top = self.basis.residual(), self.omega, self.largest_rate
        energies = self.factors.energies(q)
        at = np.array(sorted(energies))
        energy = np.array([energies[s] for s in at])
        above = (top + at[:, None]) / (top + omega) if np.isfinite(top) else 1.0
        transfer = np.where(omega >= at[:, None], above, at[:, None] / omega)
        best = np.min(energy[:, None] * transfer, axis=0)
        between = (omega > at[0]) & (omega < at[-1])
        best[between] = np.minimum(best[between], np.interp(omega[between], at, energy))
        size = np.abs(self.basis.factor(1j * omega)) ** 2 * self.basis.phi(omega)
        return np.sqrt(2.0) * size * best / self.pencil.network.area

    def error_at(self, omega: float) -> float:
        """Bound on |ΔG*| at one of the frequencies, rounding left out."""
        return float(self.error[np.searchsorted(self.omega, omega)])

    def finish(self) -> tuple[Galerkin, np.ndarray, np.ndarray]:
        """(Galerkin, G* (M,), bounds (M, 3) on |ΔG*|, |ΔG'|, |ΔG''|), rounding included.

        Raises ConvergenceError where rounding alone exceeds the accuracy.
        """
        galerkin = Galerkin(self.basis, self.compatibility)
        G = galerkin.spectrum.modulus(self.omega)
        storage, loss = galerkin.rounding(self.omega)
        bounds = np.column_stack(
            (self.error + np.hypot(storage, loss), self.error + storage, self.error + loss)
        )
        relative = bounds[:, 1:] / np.abs(np.column_stack((G.real, G.imag)))
        if not np.all(relative <= 2.0 * self.accuracy):
            worst = np.unravel_index(np.argmax(np.nan_to_num(relative, nan=np.inf)), relative.shape)
            raise ConvergenceError(
                f"{('G′', 'G″')[worst[1]]} at ω = {self.omega[worst[0]]:g} is only certain to {relative[worst]:.1e}, "
                f"by rounding; --accuracy {self.accuracy:g} cannot be met here"
            )
        return galerkin, G, bounds

    def destroy(self):
        """Free factors and work vectors."""
        self.factors.destroy()
        if self.basis is not None:
            self.basis.destroy()


def largest_rate(pencil: Pencil) -> float:
    """λ_max with K ≤ λ_max B, infinite where B lets motions along the bonds pass. Collective.

    A contact has k (a∥)² in K, which pre-stress only lowers, and kτ₁ normal (a∥)² in B. With drag, K is at most
    the largest sum of absolute values in one of its rows, and B at least kτ₁ drag.
    """
    network, law = pencil.network, pencil.law
    limits = [np.inf]
    if law.normal:
        local = float(network.contacts.stiffness.max(initial=0.0))
        limits.append(network.max(local) / (network.damping(law) * law.normal))
    if law.drag:
        indptr, _, values = pencil.K.getValuesCSR()
        local = float(np.add.reduceat(np.abs(values), indptr[:-1]).max()) if len(values) else 0.0
        limits.append(network.max(local) / (network.damping(law) * law.drag))
    return min(limits)
