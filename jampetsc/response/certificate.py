"""G* of an approximate solution, and a bound on its error that holds whatever solver found the solution.

With s = iω, A = K + sB, c = k_γ + s b_γ and any trial field x, the modulus is the stationary value of

    G* V = k_γγ + s b_γγ + 2 cᵀx + xᵀA x ,    and its error is exactly   rᵀA⁻¹r ,   r = c + A x .

External forces f are the load c = −f without a corner, for which G* V = −fᵀA⁻¹f = −χ, the susceptibility.

r is computed contact by contact (see `compatibility`), and a bound on its rounding is added. How much A⁻¹ amplifies it
is bounded by a `SingularBound`, which also uses only the residuals of solves:

    |rᵀA⁻¹r| ≤ rᴴD⁻¹r / σ    if no singular value of D^(−½) A D^(−½) is below σ, for a diagonal D.

That does not need K ≥ 0. If K ≥ 0 (B ≥ 0 always), a SingularBound at ω serves at other frequencies ω' as well: K and B
can be diagonalised together, so S(ω)⁻¹ ≤ Re A⁻¹ − Im A⁻¹ for S = K + ωB, hence S(ω) ≥ (σ/√2) D; and

    |rᵀA(ω')⁻¹r| ≤ √2 rᴴS(ω')⁻¹r ≤ √2 max(1, ω/ω') rᴴS(ω)⁻¹r .

The stationary value is summed contact by contact as well, so that rounding of x, K and B changes it to second order
only.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.analysis.error_bounds import ZERO_PART_RATIO, storage_and_loss, zero_parts
from jampetsc.errors import ConvergenceError, named
from jampetsc.response.assembly import ROW, Pencil

EPSILON = float(np.finfo(float).eps)
# rounding of a contact's motion, relative to its terms: bond, distance, normal, products, sum; also of sums of forces
ROUNDING = 6.0 * EPSILON


@dataclass(frozen=True, eq=False)
class Certified:
    """G* at a frequency, or at (M,) of them, with bounds on what the equations left and rounding may change in it."""

    omega: object
    G: object  # complex
    error: object  # bound on |ΔG*| = |rᵀA⁻¹r| / V, rounding left out
    rounding: np.ndarray  # (…, 2) of G' and of G'', from the sums over contacts

    @property
    def bounds(self):
        """Bounds on |ΔG*|, |ΔG'| and |ΔG''|, each with its own rounding as G'' may be far smaller than |G*|, (…, 3)."""
        both = np.hypot(self.rounding[..., :1], self.rounding[..., 1:])
        return np.expand_dims(self.error, -1) + np.concatenate((both, self.rounding), axis=-1)

    @property
    def parts(self):
        """|G'| and |G''|, (…, 2)."""
        return np.abs(storage_and_loss(self.G))

    @property
    def vanishes(self):
        """Whether G' and G'' are zero to rounding and no work can tell more, (…, 2), see `zero_parts`."""
        return (self.parts <= self.rounding) & zero_parts(self.G, self.bounds[..., 1:])

    @property
    def relative(self):
        """Bounds on |ΔG'| and |ΔG''| relative to them, (…, 2); 0 where they vanish."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            relative = np.nan_to_num(self.bounds[..., 1:] / self.parts, nan=np.inf, posinf=np.inf)
        return np.where(self.vanishes, 0.0, relative)

    def within(self, accuracy: float):
        """Whether G' and G'' are each known to this, relative to them, or vanish, (…, 2); not where there is a nan."""
        return (self.bounds[..., 1:] <= accuracy * self.parts) | self.vanishes

    def is_met(self, accuracy: float, is_last: bool = False) -> bool:
        """Whether all of (M,) frequencies is known to `accuracy`. Raises ConvergenceError where it never will be.

        is_last   whether nothing is left that could make the error smaller
        """
        if self.within(accuracy).all():
            return True
        relative = self.relative
        worst = np.unravel_index(np.argmax(relative), relative.shape)
        if np.all(self.parts[worst[0]] <= self.rounding[worst[0]]):
            raise ConvergenceError(
                "nothing resists the load: G* is zero to rounding, as where no connected component of contacts "
                "reaches around the cell, or where a rotation dissipates nothing"
            )
        where = f"{('G′', 'G″')[worst[1]]} at ω = {self.omega[worst[0]]:g} is only certain to {relative[worst]:.1e}"
        if not relative[worst] < 1.0:
            value, limit = self.parts[worst], self.bounds[..., 1:][worst]
            where = f"{where.partition(' is ')[0]}, {value:.1e}, is not above its error of {limit:.1e}"
        if not np.all(self.rounding <= self.allowed(accuracy)):
            raise ConvergenceError(
                f"{where}, by rounding; {named('accuracy')} {accuracy:g} cannot be met here"
            )
        if is_last:
            raise ConvergenceError(
                f"{where}, by what the solves at the shifts leave; {named('accuracy')} {accuracy:g} cannot be "
                "met here"
            )
        return False

    def allowed(self, accuracy: float):
        """Bounds on |ΔG'| and |ΔG''| that are accepted, (…, 2): relative to them, below their rounding to |G*|."""
        of_zero = ZERO_PART_RATIO * np.abs(self.G)[..., None]
        return np.where(self.parts <= self.rounding, of_zero, accuracy * self.parts)

    def allowed_error(self, accuracy: float):
        """`error` that is accepted, (…), beside rounding; zero where rounding exceeds what is allowed."""
        return np.maximum((self.allowed(accuracy) - self.rounding).min(axis=-1), 0.0)


@dataclass(frozen=True, eq=False)
class SingularBound:
    """No singular value of D^(−½) (K + iωB) D^(−½) is below σ, see `least_singular_value`."""

    omega: float
    diagonal: np.ndarray  # (n_local,) of D
    least: float  # σ

    def reach(self, omega: float) -> float:
        """a with |rᵀ(K + iωB)⁻¹r| ≤ a rᴴD⁻¹r; at frequencies other than its own only if K ≥ 0."""
        if not self.least > 0.0:
            return float("inf")
        return (1.0 if omega == self.omega else 2.0 * max(1.0, self.omega / omega)) / self.least


@dataclass(frozen=True, eq=False)
class Trial:
    """A trial field at strain γ, and its residual. Arrays hold this rank's part, complex."""

    omega: float
    x: np.ndarray  # (n_local,)
    motions: np.ndarray  # (rows,) a = C x + γ g
    strain: float  # γ
    left: np.ndarray  # (n_local,) r = γ c + A x
    centred: np.ndarray | None = None  # (n_local,) with masses: x without moves that inertia alone resists


class Functional:
    """G*, residual and bound of trial fields of one pencil. All methods are collective."""

    def __init__(self, pencil: Pencil):
        self.pencil, self.network, self.mass = pencil, pencil.network, pencil.mass
        c = self.compatibility = pencil.compatibility
        self.affine = np.sqrt(c.affine_sizes)

    def affine_modulus(self, omega) -> float:
        """The size of G* if all motion were affine: the sum of the sizes of what contacts contribute."""
        elastic, viscous = self.affine**2
        return float(elastic + omega * viscous) / self.network.volume

    def trial(self, omega, x, strain: float = 1.0) -> Trial:
        """The trial field x (n_local,), complex, with its motions and residual."""
        c = self.compatibility
        a = c.motions(x) + strain * c.g
        left = c.forces((c.w_K + 1j * omega * c.w_B) * a) + 1j * omega * c.drag * x - strain * c.force
        centred = None
        if self.mass is not None:
            centred = self.mass.centred(x)
            left -= omega**2 * self.mass.pinned_diagonal * centred
        self.pencil.project(left)  # no net force but for rounding, which drag alone would not hold back
        return Trial(omega, x, a, strain, left, centred)

    def norm(self, forces, diagonal) -> float:
        """|f| of forces (n_local,) in the norm of D⁻¹."""
        return inverse_norm(self.network, forces, diagonal)

    def rounding(self, trial: Trial, omega: float, diagonal) -> float:
        """Bound on the rounding of a trial's residual, in the norm of D⁻¹; ω and D of a `SingularBound`.

        With D(ω) = `reach(ω)` and forces f of contacts |D(ω)^(−½) |C|ᵀ|f||² ≤ ROW Σ f²/(|w_K| + ω w_B).
        The sum of f = w a is rounded, and so is a = C x + γ g in it.
        """
        c, x2 = self.compatibility, _squares(trial.x)
        trial_sizes, bound_sizes = (np.abs(c.w_K) + at * c.w_B for at in (trial.omega, omega))
        forces2 = (c.w_K**2 + (trial.omega * c.w_B) ** 2) * _squares(trial.motions)
        forces2 = np.divide(forces2, bound_sizes, out=np.zeros_like(bound_sizes), where=bound_sizes > 0.0)
        local = [
            np.sum(forces2),
            c.reach(trial.omega) @ x2,
            trial_sizes @ (trial.strain * c.g_size) ** 2,
            np.sum(((trial.omega * c.drag) ** 2 * x2 + (trial.strain * c.force_size) ** 2) / diagonal),
        ]
        if self.mass is not None:
            (terms,) = trial.omega**2 * self.mass.diagonal * self.mass.terms(np.sqrt(x2)[None])
            local[-1] += np.sum(terms**2 / diagonal)
        of_sums, of_x, of_g, on_disks = self.network.sum(np.array(local))
        stretch = self.network.max(c.reach(omega) / diagonal)
        of_motions = (
            max(1.0, trial.omega / omega) * (np.sqrt(ROW[self.network.dimension] * of_x) + np.sqrt(of_g)) ** 2
        )
        return float(
            ROUNDING * np.sqrt(ROW[self.network.dimension] * stretch * (of_sums + of_motions) + on_disks)
        )

    def certify(self, trial: Trial, lower: SingularBound) -> Certified:
        """G* of a trial at amplitude 1, with its bound."""
        left = self.norm(trial.left, lower.diagonal) + self.rounding(trial, lower.omega, lower.diagonal)
        error = float(lower.reach(trial.omega) * left**2 / self.network.volume)
        return replace(self.evaluate(trial), error=error)

    def evaluate(self, trial: Trial) -> Certified:
        """G* of a trial at amplitude 1 and its rounding; the bound on what the equations left is infinite."""
        omega = trial.omega
        (K_rr, K_ii, K_ri), (B_rr, B_ii, B_ri), sizes, noise = self._sums(trial)
        elastic, viscous = complex(K_rr - K_ii, 2.0 * K_ri), complex(B_rr - B_ii, 2.0 * B_ri)
        work, work_size = self._work(trial)
        # Real and imaginary parts are kept apart: at low frequency they differ by many decades.
        (e_Kr, e_Ki, e_Br, e_Bi), (d_Kr, d_Ki, d_Br, d_Bi) = sizes, noise
        storage = e_Kr * (e_Kr + d_Kr) + e_Ki * (e_Ki + d_Ki)
        storage += omega * (2.0 * e_Br * e_Bi + e_Br * d_Bi + e_Bi * d_Br)
        loss = 2.0 * e_Kr * e_Ki + e_Kr * d_Ki + e_Ki * d_Kr
        loss += omega * (e_Br * (e_Br + d_Br) + e_Bi * (e_Bi + d_Bi))
        if self.mass is not None:
            (rr, ii, ri), (e_r, e_i), (d_r, d_i) = self.inertia(trial)
            elastic -= omega**2 * complex(rr - ii, 2.0 * ri)
            storage += omega**2 * (e_r * (e_r + d_r) + e_i * (e_i + d_i))
            loss += omega**2 * (2.0 * e_r * e_i + e_r * d_i + e_i * d_r)
        volume = self.network.volume
        return Certified(
            omega=float(omega),
            G=(elastic - 2.0 * work + 1j * omega * viscous) / volume,
            error=np.inf,
            rounding=2.0 * (EPSILON * np.array((storage, loss)) + ROUNDING * work_size) / volume,
        )

    def _work(self, trial):
        """fᵀx of the external forces, complex, and sums of the sizes of its real and imaginary parts, (2,)."""
        c, parts = self.compatibility, np.array((trial.x.real, trial.x.imag))
        (real, imaginary), sizes = self.network.sum(np.array((parts @ c.force, np.abs(parts) @ c.force_size)))
        return complex(real, imaginary), sizes

    def _sums(self, trial):
        """Σ w a² of the real, imaginary and mixed parts of a trial in K and in B, their sizes and their noise.

        sizes   (4,) roots of the sums of sizes, in K of the real and imaginary parts, then in B
        noise   (4,) root of the sum of squares of what rounding can do to the motions in them, in 2ε
        """
        c = self.compatibility
        a, field = trial.motions, trial.x
        parts = np.array([a.real**2, a.imag**2, a.real * a.imag])
        squares = field.real**2, field.imag**2, field.real * field.imag
        drag, reach_K, reach_B = np.array([c.drag, c.reach_K, c.reach_B]) @ np.transpose(squares)
        local = parts @ c.w_K, parts @ c.w_B + drag, parts @ c.size_K, np.append(reach_K[:2], reach_B[:2])
        of_K, of_B, (abs_rr, abs_ii, _), reach = map(self.network.sum, local)
        of_B[0] += c.drag_gg
        # Evaluating a is off by 2ε|C||x|, see `Compatibility.reach`. The coefficients are off by a few ε; they
        # multiply relative motions, and g. The rest is Cauchy and Schwarz.
        sizes = np.sqrt([abs_rr, abs_ii, of_B[0], of_B[1]])
        noise = 7.0 * sizes + 2.0 * np.sqrt(ROW[self.network.dimension] * reach)
        noise[::2] += 4.0 * self.affine
        return of_K, of_B, sizes, noise

    def inertia(self, trial):
        """As `_sums` for xᵀM̂x: its real, imaginary and mixed parts, sizes (2,) and noise (2,)."""
        x, mass = trial.centred, self.mass
        reach = mass.terms(np.abs((trial.x.real, trial.x.imag))) ** 2
        parts = np.array([x.real**2, x.imag**2, x.real * x.imag, *reach])
        sums, reach = np.split(self.network.sum(parts @ mass.diagonal), [3])
        sizes = np.sqrt(sums[:2])
        return sums, sizes, 7.0 * sizes + 4.0 * np.sqrt(reach)

    def field_bound(self, certified: Certified, x, lower: SingularBound) -> float:
        """Bound on the error of the field x that was certified, see `field_bound`.

        Without masses an estimate where K is not ≥ 0. With them ‖e‖² ≤ ROW eᴴ reach e, and eᴴDe ≤ rᴴD⁻¹r/σ².
        """
        omega, energy = certified.omega, certified.error * self.network.volume
        squared = 2.0 * np.sqrt(2.0) * energy  # ≥ 2 rᴴS⁻¹r, by S ≥ (σ/√2) D
        if self.mass is not None:
            stretch = self.network.max(self.compatibility.reach(omega) / lower.diagonal)
            squared = ROW[self.network.dimension] * stretch * lower.reach(omega) * energy
        return field_bound(self.pencil, omega, x, squared)


def inverse_norm(network, forces, diagonal) -> float:
    """(fᴴD⁻¹f)^½ of forces (n_local,) and a diagonal D (n_local,). Collective."""
    return float(np.sqrt(network.sum(np.sum(_squares(forces) / diagonal))))


def _squares(values):
    """|z|² of complex or real z."""
    return values.real**2 + values.imag**2


def tensor_at(functionals, trials, results) -> tuple:
    """C (L, L), complex, and bounds on |ΔC|, |ΔC'|, |ΔC''|, (L, L, 3), of several loads at one frequency. Collective.

    With any trial fields the bilinear form C_EE′ V = Σ w a_E a_E′ is off by r_EᵀA⁻¹r_E′, exactly; by Cauchy and Schwarz
    that is at most the root of the product of both bounds on r_EᵀA⁻¹r_E.

    functionals, trials, results   one for each load: `Functional`, `Trial` and `Certified`
    """
    first, omega, volume = functionals[0], trials[0].omega, functionals[0].network.volume
    c = first.compatibility
    weights = c.w_K + 1j * omega * c.w_B
    motions, fields = (np.array([getattr(trial, name) for trial in trials]) for name in ("motions", "x"))
    C = (motions * weights) @ motions.T + 1j * omega * (fields * c.drag) @ fields.T
    mass, of_inertia = first.mass, None
    if mass is not None:
        centred = np.array([trial.centred for trial in trials])
        C -= omega**2 * (centred * mass.diagonal) @ centred.T
    loads = [functional.pencil.load for functional in functionals]
    fluid = np.array([[c.fluid_gg(load, other) for other in loads] for load in loads])
    C = (first.network.sum(C) + 1j * omega * fluid) / volume
    sums = [functional._sums(trial)[2:] for functional, trial in zip(functionals, trials, strict=True)]
    # (L, 4) each: of the real and imaginary parts in K, then in B
    sizes, noise = (np.array([pair[part] for pair in sums]) / np.sqrt(volume) for part in (0, 1))
    in_K, in_B = ((sizes[:, part], noise[:, part]) for part in (slice(0, 2), slice(2, 4)))
    if mass is not None:
        pairs = zip(functionals, trials, strict=True)
        parts = [functional.inertia(trial)[1:] for functional, trial in pairs]
        of_inertia = tuple(np.array([part[which] for part in parts]) / np.sqrt(volume) for which in (0, 1))
    bounds = pair_bounds([result.error for result in results], in_K, in_B, omega, 4.0 * EPSILON, of_inertia)
    diagonal = np.arange(len(loads))
    C[diagonal, diagonal] = [result.G for result in results]
    bounds[diagonal, diagonal] = [result.bounds for result in results]
    return C, bounds


def pair_bounds(errors, in_K, in_B, omega, unit: float, in_M=None):
    """Bounds on |ΔC|, |ΔC'| and |ΔC''| between L loads at frequencies (…), (…, L, L, 3).

    errors      (…, L) bounds on |rᵀA⁻¹r| / V of each load
    in_K, in_B  (sizes, noise), each (…, L, 2): of the real and the imaginary part of the motions of a load the root of
                Σ w a² / V, and what rounding can do to it in units of `unit`
    omega       (…)
    in_M        the same of Σ m |x|² / V, with masses
    """

    def products(part, first, second):
        size, noise = ((values[..., first], values[..., second]) for values in part)
        return outer(*size) + 0.5 * (outer(size[0], noise[1]) + outer(noise[0], size[1]))

    def outer(first, second):
        return first[..., :, None] * second[..., None, :]

    real, imaginary = 0, 1
    even = [products(part, real, real) + products(part, imaginary, imaginary) for part in (in_K, in_B)]
    odd = [products(part, real, imaginary) + products(part, imaginary, real) for part in (in_K, in_B)]
    omega, roots = np.asarray(omega)[..., None, None], np.sqrt(errors)
    storage, loss = even[0] + omega * odd[1], odd[0] + omega * even[1]
    if in_M is not None:
        storage = storage + omega**2 * (products(in_M, real, real) + products(in_M, imaginary, imaginary))
        loss = loss + omega**2 * (products(in_M, real, imaginary) + products(in_M, imaginary, real))
    rounding = unit * np.stack((np.hypot(storage, loss), storage, loss), axis=-1)
    return outer(roots, roots)[..., None] + rounding


def field_bound(pencil: Pencil, omega: float, x, squared: float, size: float = 0.0) -> float:
    """Bound on the relative error ‖x − exact‖ / ‖x‖ of a field in the energy norm ‖x‖² = xᴴ(K + ωB) x. Collective.

    x        non-affine field (n_local,), complex
    squared  bound on ‖x − exact‖² from the residual r = c + A x. With e = A⁻¹r and S = K + ωB,
             ‖e‖² = eᴴS e ≤ √2 |eᴴA e| = √2 |eᴴr| when e itself is known, and from there, by Cauchy and
             Schwarz, √2 |eᴴr| ≤ √2 ‖e‖ (rᴴS⁻¹r)^½, so ‖e‖² ≤ 2 rᴴS⁻¹r, when only the energy of r is
    size     (xᴴDx)^½, D = `reach(ω)`, of the terms that x was summed from, if larger than that of x: for its rounding

    Translations and gear modes have no energy and do not count. Where K has negative modes this is not a bound.
    """
    c, network = pencil.compatibility, pencil.network
    a = np.abs(c.motions(x)) ** 2
    x2 = np.abs(x) ** 2
    local = np.array([(c.w_K + omega * c.w_B) @ a + omega * c.drag @ x2, c.reach(omega) @ x2])
    energy, norm2 = network.sum(local)
    if energy == 0.0:  # a crystal: nothing moves against the strain
        return 0.0 if squared == 0.0 else float("inf")
    rounding = 4.0 * EPSILON * np.sqrt(ROW[network.dimension]) * max(np.sqrt(norm2), size)
    return float((np.sqrt(abs(squared)) + rounding) / np.sqrt(abs(energy)))
