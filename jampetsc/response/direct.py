"""One complex solve per frequency: (K + iωB) x = −(k_γ + iω b_γ) with KSP, each certified.

K + iωB is one PETSc matrix. With complex scalars it is stored as it is. With real ones an unknown takes two rows, its
real and its imaginary part next to each other, and each entry becomes a block:

    (K + iωB)(x + iy) = b + ic    ⇔    [[K, −ωB], [−ωB, −K]] (x, y) = (b, −c) .

That form is symmetric as well, indefinite, and takes twice the memory; L D Lᵀ factorises both. Local parts of complex
vectors are numpy arrays, the same for both forms.

The matrix is scaled symmetrically to a unit diagonal first, since its θ block is of order ω and would be lost in
rounding otherwise. The symbolic factorisation is done once, because the pattern never changes. Options have the prefix
`freq_`.
"""

import contextlib

import numpy as np
from scipy.sparse import bsr_array

from jampetsc.errors import ConvergenceError, named
from jampetsc.petsc import mumps
from jampetsc.petsc.cholesky import least_singular_value
from jampetsc.petsc.session import current
from jampetsc.petsc.sparse_matrices import diagonal_of, distributed_matrix
from jampetsc.response.assembly import Pencil
from jampetsc.response.certificate import EPSILON, Certified, Functional, SingularBound
from jampetsc.response.factor_memory import require_memory

PREFIX = "freq_"
DEFAULTS = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",  # L D Lᵀ of a symmetric matrix, for complex scalars not L D Lᴴ
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_7": 2,  # approximate minimum fill: faster here than the orderings MUMPS would choose
}
REFINEMENTS = 40  # at most; one or two are usual, a loose iterative method needs more
DIGITS = 1e-12  # refinement stops where the bound is this small relative to G' and G'', or to rounding
ZERO_MODULUS_RATIO = 1e-14  # a modulus this small relative to that of affine motion is zero
PRECISE = 1e-8  # residual of a solve for a `SingularBound`, relative


class ComplexForm:
    """K + iωB at one frequency after another, and its vectors, from PETSc matrices K, B of one pattern. Collective.

    A           PETSc.Mat; x and b are vectors that fit it
    magnitude   at least |diagonal of A| at the ω of the last `set`, (n_local,)
    inertia     (n_local,) diagonal of M, for K + iωB − ω²M; None: overdamped
    """

    def __init__(self, K, B, inertia=None):
        if current().scalar_type == "complex":
            self._doubled, self._step = False, 1j
            self._K, self._B = K, B
        else:
            self._doubled, self._step = True, 1.0
            self._K = _blocks(K, [[1.0, 0.0], [0.0, -1.0]])
            self._B = _blocks(B, [[0.0, -1.0], [-1.0, 0.0]])
        self.A = self._K.duplicate(copy=True)
        self.x, self.b = self.A.createVecs()
        self._diagonals, self._inertia = [diagonal_of(matrix) for matrix in (K, B)], inertia

    def set(self, omega: float) -> None:
        """A ← K + iωB, or K + iωB − ω²M."""
        same = current().PETSc.Mat.Structure.SAME_NONZERO_PATTERN
        self._K.copy(self.A, structure=same)
        self.A.axpy(self._step * omega, self._B, structure=same)
        of_K, of_B = self._diagonals
        self.magnitude = np.hypot(of_K, omega * of_B)
        if self._inertia is not None:
            of_M = omega**2 * self._inertia
            self.magnitude += of_M
            self.b.setArray(np.ravel(np.column_stack((-of_M, of_M)[: 1 + self._doubled])))
            self.A.setDiagonal(self.b, current().PETSc.InsertMode.ADD_VALUES)

    def scale(self, d) -> None:
        """A ← D A D for the diagonal d (n_local,), real."""
        self.b.setArray(np.repeat(d, 2) if self._doubled else d)
        self.A.diagonalScale(self.b, self.b)

    def solve(self, ksp, right, what: str):
        """Solution (n_local,) of A x = right (n_local,) by `ksp`. Raises ConvergenceError if that fails."""
        self.b.setArray(np.conj(right, dtype=complex).view(float) if self._doubled else right)
        mumps.solve(ksp, self.b, self.x, what, "; try -options_file jampetsc:mumps")
        solution = self.x.getArray().copy()
        return solution.view(complex) if self._doubled else solution


def _blocks(matrix, block):
    """A real matrix with each entry replaced by itself times a (2, 2) block."""
    indptr, indices, values = matrix.getValuesCSR()
    rows, columns = matrix.getLocalSize()[0], matrix.getSize()[1]
    blocks = values[:, None, None] * np.array(block)
    csr = bsr_array((blocks, indices, indptr), shape=(2 * rows, 2 * columns)).tocsr()  # keeps explicit zeros
    return distributed_matrix(matrix.getComm().tompi4py(), csr, csr.data)


class FrequencySolver:
    """K + iωB for one frequency after another. Every method is collective.

    positive_semidefinite   whether K is known to be: a `SingularBound` then also serves at other frequencies
    loads                   whose responses are solved with one factor; the load of the pencil if not given
    trials                  a `Trial` for each load, of the last `solve`
    """

    def __init__(self, pencil: Pencil, positive_semidefinite: bool = False, loads=None):
        self.pencil, self.positive_semidefinite = pencil, positive_semidefinite
        self.functionals = [Functional(pencil.under(load)) for load in loads or [pencil.load]]
        self.functional = self.functionals[0]
        session = current()
        # complex numbers, or twice as many real unknowns
        require_memory(
            pencil.network, pencil.unknowns, PREFIX, 2.0 if session.scalar_type == "complex" else 4.0
        )
        self.form = ComplexForm(pencil.K, pencil.B, pencil.inertia)
        self.ksp = mumps.make_ksp(pencil.network.comm, PREFIX, DEFAULTS)
        self.ksp.setOperators(self.form.A)
        # whether the factor of an earlier frequency serves until it no longer converges
        self.reuse = session.PETSc.Options(PREFIX).getBool("ksp_reuse_preconditioner", False)
        self.singular_bound, self.trials = None, []
        self.iterations = 0
        self.factorisations = 0

    @property
    def x(self):
        """The field of the first load in the last `solve`, complex (n_local,)."""
        return self.trials[0].x if self.trials else None

    def solve(self, omega: float, accuracy: float) -> Certified:
        """G* of the first load at ω with its bound, see `solve_loads`."""
        return self.solve_loads(omega, accuracy)[0]

    def solve_loads(self, omega: float, accuracy: float) -> list[Certified]:
        """G* of each load at ω with its bound; the fields stay in `trials`.

        Raises ConvergenceError with the solver's reason where a bound is not ≤ accuracy for each of G' and G''.
        """
        self.iterations = 0
        if self.reuse and self.factorisations:
            self.form.set(omega)
            self.form.scale(self.scale)  # as the matrix of the factor was
            self._prepare(omega)
            with contextlib.suppress(ConvergenceError):
                return self._solve_each(omega, accuracy)
        self._factorise(omega)
        return self._solve_each(omega, accuracy)

    def _solve_each(self, omega, accuracy):
        self.trials = []
        return [self._refine(omega, accuracy, functional) for functional in self.functionals]

    def _factorise(self, omega):
        """A ← D (K + iωB) D with a unit diagonal, and its factor."""
        self.form.set(omega)
        self.scale = 1.0 / np.sqrt(self.form.magnitude)
        self.form.scale(self.scale)
        pc = self.ksp.getPC()
        pc.setReusePreconditioner(False)
        self.factorisations += mumps.factorise(self.ksp, self.form.A, f"K + iωB at ω = {omega:g}")
        pc.setReusePreconditioner(self.reuse)
        self._prepare(omega)

    def _prepare(self, omega):
        """With masses, prepare solves for moves that inertia alone resists."""
        mass = self.pencil.mass
        if mass is not None:
            self._moves = mass.move_correction(lambda right: self._solve_pinned(omega, right), -(omega**2))

    def _apply_inverse(self, omega, right):
        """A⁻¹ right to the accuracy of the KSP, scaling undone."""
        solution = self._solve_pinned(omega, right)
        if self.pencil.mass is not None:
            solution = self._moves.correct(solution)
        self.pencil.project(solution)
        return solution

    def _solve_pinned(self, omega, right):
        solution = self.form.solve(self.ksp, self.scale * right, f"ω = {omega:g}")
        self.iterations += self.ksp.getIterationNumber()
        if self.pencil.network.sum(np.count_nonzero(~np.isfinite(solution))):
            raise ConvergenceError(f"ω = {omega:g}: KSP returned NaN or Inf. Give another options file.")
        solution *= self.scale
        return solution

    def _refine(self, omega, accuracy, functional):
        """x ← x − A⁻¹(c + A x) from x = 0, until the bound is met or what is left does not shrink any more."""
        if self.singular_bound is None or not self.positive_semidefinite:
            self.singular_bound = self._find_singular_bound(omega)
        x = np.zeros(self.pencil.K.getLocalSize()[0], complex)
        trial, result = functional.trial(omega, x), None
        for _ in range(REFINEMENTS):
            x = x - self._apply_inverse(omega, trial.left)
            trial = functional.trial(omega, x)
            previous, result = result, functional.certify(trial, self.singular_bound)
            if result.error <= (enough := _enough(result)):
                break
            if previous is not None and not result.error < 0.25 * previous.error:  # nan and inf as well
                break
        if not result.error <= enough and self.singular_bound.omega != omega:
            self.singular_bound = self._find_singular_bound(omega)
            result = functional.certify(trial, self.singular_bound)
        self.trials.append(trial)
        if not result.within(accuracy).all():
            affine = functional.affine_modulus(omega)
            is_rounding = np.all(result.parts <= result.bounds[1:])
            if is_rounding and abs(result.G) + result.error < ZERO_MODULUS_RATIO * affine:
                raise ConvergenceError(
                    f"ω = {omega:g}: nothing resists the load: G* is zero to rounding, where affine motion would have "
                    f"{affine:.2g}, as of particles that are not at rest: quench them (pack from)"
                )
            _, storage, loss = result.bounds
            raise ConvergenceError(
                f"ω = {omega:g}: G' = {result.G.real:.3e} only known to {storage:.1e}, G'' = {result.G.imag:.3e} to "
                f"{loss:.1e} after refinement: the matrix is too ill-conditioned for this solver, or "
                f"{named('accuracy')} too "
                "strict"
            )
        return result

    def restore(self, omega: float, least: float) -> None:
        """Use the `SingularBound` that an earlier run has found."""
        self.form.set(omega)
        self.singular_bound = SingularBound(omega, self._diagonal(), least)

    def _diagonal(self):
        """That of a `SingularBound` at the frequency of the form; without a minimum that of K may be negative."""
        magnitude = self.form.magnitude
        return np.ones_like(magnitude) if self.pencil.projects else magnitude

    def _find_singular_bound(self, omega) -> SingularBound:
        """A `SingularBound` at ω, from solves with random right-hand sides."""
        diagonal = self._diagonal()
        root, first = np.sqrt(diagonal), self.pencil.K.getOwnershipRange()[0]
        generator = np.random.default_rng(first)

        def start():
            x = generator.standard_normal(2 * len(root)).view(complex)
            pins = self.pencil.pins - first
            x[pins[(pins >= 0) & (pins < len(x))]] = 0.0  # K and B do not act on what is pinned
            self.pencil.project(x)
            return x

        def step(x):
            right = root * x
            size, left, y = self.functional.norm(right, diagonal), np.inf, np.zeros_like(right)
            rest = right
            for _ in range(REFINEMENTS):
                y = y + self._apply_inverse(omega, rest)
                trial = self.functional.trial(omega, y, strain=0.0)
                rest = right - trial.left
                previous, left = left, self.functional.norm(rest, diagonal)
                if left <= PRECISE * size or not left <= 0.5 * previous:
                    break
            left += self.functional.rounding(trial, omega, diagonal) + EPSILON * size
            return root * y, left, self.functional.norm(root * y, 1.0)

        return SingularBound(omega, diagonal, least_singular_value(start, step))


def _enough(result: Certified) -> float:
    """An error so small that there is nothing to gain from a smaller one."""
    return max(DIGITS * result.parts.min(), result.rounding.min())
