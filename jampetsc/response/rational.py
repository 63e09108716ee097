"""The whole spectrum from a handful of real factorisations, with a bound on the error at every frequency.

Galerkin's method on a rational Krylov space (see `basis`). With exact solves its residual would be f(iω) φ(iω) q,
so that

    |ΔG*| V ≤ √2 rᴴ(K + ωB)⁻¹r = √2 |f(iω) φ(iω)|² qᵀ(K + ωB)⁻¹q ,

and qᵀ(K + sB)⁻¹q costs one solve with a factor that exists. This estimate chooses the shifts: the next one goes where
it is furthest above the accuracy asked for. The final certificate rests on the true residual (see `residual`).
"""

from dataclasses import replace

import numpy as np

from jampetsc.collective import on_root
from jampetsc.errors import ConvergenceError, named
from jampetsc.petsc.session import current
from jampetsc.response.assembly import Pencil
from jampetsc.response.certificate import Certified
from jampetsc.response.compatibility import drag_of
from jampetsc.response.force_galerkin import solve_projected
from jampetsc.response.krylov_basis import RationalBasis
from jampetsc.response.residual import ResidualBound, energy_between, positive
from jampetsc.response.shift_factors import Factors, closest

VECTORS = 8  # made at a time with one factor: a solve is some twentieth of a factorisation
NEARBY = 20.0  # ratio of shifts within which a factor is used a second time instead of a new one
MOST_VECTORS = 240
MIN_SHIFT_RATIO = 30.0  # least ratio of shifts that are done at the same time
SMALLEST_SHIFT = 1e-14  # relative to the scale of rates: below it K + sB is K but for rounding
LARGEST_SHIFT = 1e6  # relative to the same: where B is singular, K would be rounding beside sB
# of the allowed error, for the estimate, after a certificate was larger than the estimate
ESTIMATE_SHARE = 0.5


class RationalSweep:
    """Grows a basis for one pencil until the bound is met at all frequencies asked for. All methods are collective.

    When no shifts are left, `certificate` has what was found.

    omega (M,) increasing; accuracy: relative, allowed in G' and in G'' each; parallel as for `Factors`; factors: of the
    same K and B, made for another load, which this sweep uses and adds to.
    """

    def __init__(
        self, pencil: Pencil, omega, accuracy: float, parallel: str = "auto", factors: Factors | None = None
    ):
        self.pencil, self.accuracy = pencil, accuracy
        self.comm = pencil.network.comm
        self.omega = self.comm.bcast(np.asarray(omega, float))
        self.largest_rate = largest_rate(pencil)
        # sets the scale of the shifts: at most the largest rate, as K ≤ λ_max B
        self.rate = max(of_K / of_B for of_K, of_B in pencil.largest_of_kinds if of_B)
        self.factors = factors or Factors(pencil, parallel)
        self.basis: RationalBasis | None = None
        self.missing = None  # (q, its energies at the shifts at hand), of the basis as it is
        self.certificate: Certified | None = None  # the last of `_certified`, of the solution `galerkin`:
        self._certified, self.galerkin = 0, None

    @property
    def factorisations(self) -> int:
        """Factorisations made."""
        return len(self.factors.shifts)

    def restore(self, first, x0, vectors, shifts, owner: dict, certificate=None) -> None:
        """Continue from the basis of an earlier run: x₀, vectors (m, n_local) and their shifts (m,).

        owner         as in `Factors`: shifts of its factors, which are made again and so certify whatever basis this is
        certificate   the last one of that run, which steers where this one goes
        """
        basis = RationalBasis(self.pencil, first, x0)
        for vector, shift in zip(vectors, shifts, strict=True):
            basis.append(vector, shift)
        self.factors.owner |= owner
        self._set_basis(basis)
        self._renew_estimate()
        self.certificate, self._certified = certificate, int(certificate is not None)

    def next_shifts(self) -> list[float]:
        """The shifts of the next factorisations, as many as are done at once; none when all is certified.

        Raises ConvergenceError where the accuracy cannot be met.
        """
        while not (shifts := on_root(self.comm, self._choose)):
            self._certified += 1
            with current().stage("projection"):
                self.galerkin = solve_projected(self.basis)
                self.certificate = self._certify(self.galerkin)
            if on_root(self.comm, self._is_met):
                break
        return shifts

    def _choose(self):
        """The next shifts; none where the estimate meets the accuracy everywhere."""
        if self.basis is None:
            return self._spread([self._clip(self.omega[0])])
        ratio = self._ratio()
        worst = int(np.argmax(ratio))
        is_exhausted = self.basis.complete or self.basis.size >= MOST_VECTORS
        if ratio[worst] <= 1.0:
            return self._for_certificate()
        if is_exhausted and self.certificate is None:
            return []  # which tells a part that vanishes
        if is_exhausted:
            raise ConvergenceError(
                f"the bound on the error of G* stays at {ratio[worst]:.1e} times what "
                f"{named('accuracy')} {self.accuracy:g} "
                f"allows at ω = {self.omega[worst]:g} after {self.factorisations} factorisations"
            )
        shifts = []
        candidates = self._clip(self.omega)
        while len(shifts) < self.factors.width and ratio.max() > 1.0:
            shifts.append(self._serving(float(candidates[np.argmax(ratio)])))
            ratio[
                (candidates > shifts[-1] / MIN_SHIFT_RATIO) & (candidates < shifts[-1] * MIN_SHIFT_RATIO)
            ] = 0.0
        return shifts

    def _serving(self, shift):
        """The nearest shift whose factor was used only once, if it is near `shift`; else `shift`."""
        near = [
            s
            for s in self.factors.shifts
            if 1.0 / NEARBY < s / shift < NEARBY and self.basis.shifts.count(s) < 2 * VECTORS
        ]
        return min(near, key=lambda s: abs(np.log(s / shift)), default=shift)

    def _for_certificate(self):
        """The shift where the certificate is worst, unless a factor is near it."""
        if self.certificate is None:
            return []
        worst = np.argmax(np.max(self.certificate.relative, axis=1))
        shift = float(self._clip(self.omega[worst]))
        return [] if closest(self.factors.shifts, shift) else [shift]

    def _spread(self, shifts):
        """Extend a first shift to as many as are done at once, evenly spread in log ω."""
        more = np.geomspace(shifts[0], self._clip(self.omega[-1]), self.factors.width + 1)[1:]
        return [
            *shifts,
            *(float(s) for s in more[::-1][: self.factors.width - 1] if s > MIN_SHIFT_RATIO * shifts[0]),
        ]

    def _clip(self, omega):
        return np.clip(omega, SMALLEST_SHIFT * self.rate, min(self.largest_rate, LARGEST_SHIFT * self.rate))

    def add_shifts(self, shifts, fewer: int = 0) -> None:
        """Factorise K + sB at each shift, or use a factor close to it, extend the basis and renew the estimate.

        fewer   vectors at each shift than VECTORS
        """
        self.factors.factorise(shifts)
        if self.basis is None:
            first, x0 = np.inf, np.zeros(self.pencil.K.getLocalSize()[0])
            # where B is singular, what it does not act on is in the first field
            starts_at_infinity = self.pencil.exerts_forces and np.isfinite(self.largest_rate)
            if not (self.pencil.drags_alone or starts_at_infinity):
                first, x0 = self.factors.field(self.pencil, shifts[0])
            self._set_basis(RationalBasis(self.pencil, first, x0))
        self.factors.extend(self.basis, shifts, VECTORS - fewer)
        self._renew_estimate()

    def _renew_estimate(self):
        """Compute what is missing in the basis as it is."""
        q, more = self.basis.residual()
        self.basis.complete |= not more
        self.missing = q, positive(self.factors.energies(q))

    def _set_basis(self, basis):
        self.basis = basis
        c = self.pencil.compatibility
        motions = c.motions(basis.x0) + c.g
        local = [c.w_K @ motions**2, c.dissipation(motions, basis.x0)]
        self._still = self.pencil.network.sum(np.array(local))
        self._still[1] += c.drag_gg

    def worst(self) -> float:
        """Largest ratio of the estimated to the allowed error; done when ≤ 1."""
        return float(np.max(self._ratio()))

    def _ratio(self):
        """Estimated over allowed error, (M,), for the present G' and G''."""
        G, error = self._modulus(), self._steering_bound()
        allowed = self.accuracy * np.minimum(np.abs(G.real), np.abs(G.imag))
        if self.certificate is not None:
            allowed = ESTIMATE_SHARE * self.certificate.allowed_error(self.accuracy)
        ratio = np.full(len(allowed), np.inf)
        np.divide(error, allowed, out=ratio, where=allowed > 0.0)
        ratio[np.isnan(ratio)] = np.inf
        return np.where((error == 0.0) & (allowed == 0.0), 0.0, ratio)  # nothing dissipates, exactly

    def _modulus(self):
        """The present estimate of G*, (M,)."""
        basis, s = self.basis, 1j * self.omega
        rates, rotation = np.linalg.eigh(basis.K)
        loads = rotation.T @ basis.t
        relaxed = np.sum(loads**2 / (rates + s[:, None]), axis=1)
        return (
            self._still[0] + s * self._still[1] - basis.factor(s) ** 2 * relaxed
        ) / self.pencil.network.volume

    def _steering_bound(self):
        """Bound on |ΔG*|, (M,), if the residual were exactly r = f φ q."""
        energies = {s: e for s, (e, _) in self.missing[1].items()}
        size = np.abs(self.basis.factor(1j * self.omega)) ** 2 * self.basis.phi(self.omega)
        best = energy_between(self.largest_rate, energies, self.omega)
        return np.sqrt(2.0) * size * best / self.pencil.network.volume

    def _certify(self, galerkin) -> Certified:
        """G* of Galerkin's solution in the space as it is, with its bounds."""
        G, rounding = on_root(
            self.comm, lambda: (galerkin.spectrum.modulus(self.omega), galerkin.rounding(self.omega))
        )
        bound = ResidualBound(galerkin.residual(), self.factors, *self.missing, self.largest_rate, self.omega)
        area = self.pencil.network.volume
        bare = Certified(self.omega, G, np.zeros(len(G)), rounding)
        error = bound.within(area * on_root(self.comm, lambda: bare.allowed_error(self.accuracy))) / area
        return replace(bare, error=error)

    def _is_met(self):
        """Whether the certificate is good enough. Raises ConvergenceError where it will never be."""
        is_last = self._certified > 1 and not self._for_certificate()
        return self.certificate.is_met(self.accuracy, is_last)

    def error_at(self, omega: float) -> float:
        """Bound on |ΔG*| at one of the frequencies, rounding left out."""
        return float(self.certificate.error[np.searchsorted(self.omega, omega)])


def largest_rate(pencil: Pencil) -> float:
    """λ_max with K ≤ λ_max B, infinite where a motion that K resists is not damped. Collective.

    K and B are sums of squares of the same motions of bonds. Where a weight in K is positive (k of a∥, T/r of a⊥ where
    a bond pulls, that of a⊥ᶜ with tangential springs), the ratio of both weights bounds K; where it is negative (a bond
    pushes), leaving it out does. With drag D on all unknowns that K acts on, the largest sum of absolute values in a
    row of D^(−½) K D^(−½) bounds K as well.
    """
    network, c = pencil.network, pencil.compatibility
    resists = c.w_K > 0.0
    with np.errstate(divide="ignore", over="ignore"):
        limits = [network.max(c.w_K[resists] / c.w_B[resists])]
    drag = drag_of(network, pencil.law)
    acted_on = drag if network.turns_elastically else drag[: pencil.dimension]
    if least := float(acted_on.min()):
        root = np.ones(len(drag))
        root[: len(acted_on)] = np.sqrt(acted_on / least)
        indptr, columns, values = pencil.K.getValuesCSR()
        rows = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
        sizes = np.abs(values) / (root[rows % len(drag)] * root[columns % len(drag)])
        limits.append(network.max(np.add.reduceat(sizes, indptr[:-1])) / least)
    return min(limits)
