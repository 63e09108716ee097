"""L Lᵀ of a real symmetric PETSc matrix, to solve with it and to prove it positive definite.

CHOLMOD on one rank, MUMPS on more, unless the options say otherwise. With any options, a solve that returns is right:
its residual is computed and iterative refinement reduces it to rounding.

Whether a factorisation that succeeds also proves A > 0 depends on options that a user may override. L Lᵀ by dense
blocks (CHOLMOD's supernodal Cholesky) breaks down at the first pivot that is not positive. MUMPS accepts negative
pivots and counts them, if its options make it factorise the root front itself and neither replace pivots nor compress.
Others (the simplicial L D Lᵀ of CHOLMOD, PETSc's own, any iterative method) solve without proving anything. The
settings in force are read back from the solver.
"""

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.petsc import mumps, spin_split
from jampetsc.petsc.session import current

# PETSC_ERR_MAT_CH_ZRPVT, to which PETSc turns a breakdown of CHOLMOD, and MUMPS's INFOG(1)
NOT_POSITIVE_CODES = 81, -10, -40
# |b − A x| ≤ SOLVE_TOLERANCE (|A| |x| + |b|), within reach of a factor; its rounding ≤ ROUNDING_RATIO (|A| |x| + |b|)
SOLVE_TOLERANCE = 1e-14
ROUNDING_RATIO = 4.0 * float(np.finfo(float).eps)
MAX_REFINEMENTS = 40  # a solver of few digits needs some, one that does not halve the residual fails
CHOLESKY_DEFAULTS = {"ksp_type": "preonly", "pc_type": "cholesky"}
CHOLMOD_DEFAULTS = {
    "pc_factor_mat_solver_type": "cholmod",
    "mat_cholmod_factor": "SUPERNODAL",  # dense blocks, the fastest; L Lᵀ: a simplicial L D Lᵀ lets pivots < 0 pass
    "mat_cholmod_print": 0,  # a failure is an answer, not worth a warning
}
MUMPS_DEFAULTS = {
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_7": 2,  # approximate minimum fill
    "mat_mumps_icntl_13": 1,  # no ScaLAPACK at the root: pivots ≤ 0 are counted
}
# ICNTL with which the factor does not have the pivots of A, unless they have the value that stands first
MUMPS_SETTINGS = {19: (0, "Schur complement"), 31: (0, "discarded factors"), 35: (0, "block low-rank")}
PROOF_TRIALS, PROOF_STEPS, PROOF_TAU = 2, 2, 1e-3  # see `least_eigenvalue`


class NotPositiveDefinite(ConvergenceError):
    """The matrix has an eigenvalue that is not positive."""


def has_suitesparse() -> bool:
    """Whether PETSc was built with SuiteSparse."""
    # PETSc of Debian 12 and earlier knows the first name only, later ones the second
    return any(map(current().PETSc.Sys.hasExternalPackage, ("suitesparse", "cholmod")))


def fits_cholmod(matrix) -> bool:
    """Whether CHOLMOD can factorise this matrix: it lies on one rank, and PETSc was built with SuiteSparse."""
    return matrix.getComm().size == 1 and has_suitesparse()


class Cholesky:
    """A matrix and its factor, with options of their own prefix. Collective on the ranks of the matrix.

    matrix   PETSc.Mat, real and symmetric; `factorise` uses the values that it has at the time
    what     its name in messages
    project  projects local parts of solutions, in place, onto a space that holds them except for rounding
    spins    rows of this rank that are spins, to factorise the others alone, see `spin_split`
    doubt    why the last `factorise` does not prove that the matrix is positive definite; empty if it does
    """

    def __init__(self, matrix, prefix: str, what: str, project=None, spins=None):
        self.matrix, self.prefix, self.what, self.project = matrix, prefix, what, project
        option = current().PETSc.Mat.Option
        for property in (option.SYMMETRIC, option.SPD):
            matrix.setOption(property, True)
        defaults = CHOLESKY_DEFAULTS | (CHOLMOD_DEFAULTS if fits_cholmod(matrix) else MUMPS_DEFAULTS)
        if spins is not None:
            defaults = spin_split.split_defaults(defaults)
        self.ksp = mumps.make_ksp(matrix.getComm(), prefix, defaults)
        if spins is not None:
            spin_split.split(self.ksp, matrix, spins)
        self._residual, self._step = matrix.createVecs()
        self.doubt = "nothing has been factorised"

    def factorise(self) -> None:
        """Factorise; the symbolic analysis is kept while the pattern stays the same.

        Raises NotPositiveDefinite, and ConvergenceError when it fails for another reason. The factor is not usable
        then.
        """
        petsc = current().PETSc
        self.doubt = "nothing has been factorised"
        try:
            mumps.factorise(self.ksp, self.matrix, self.what)
            # with the option SPD, MUMPS accepts negative pivots
            definite = not any(map(mumps.negative_pivots, mumps.factored(self.ksp)))
        except (petsc.Error, mumps.FactorisationError) as error:
            code = error.code if isinstance(error, mumps.FactorisationError) else error.ierr
            if code not in NOT_POSITIVE_CODES:
                raise
            definite = False
        if not definite:
            raise NotPositiveDefinite(f"{self.what} is not positive definite")
        self._norm = self.matrix.norm(petsc.NormType.INFINITY)  # bounds |A|, as A is symmetric
        self.doubt = doubt(self.ksp)

    def solve(self, rhs, out) -> float:
        """out ← A⁻¹ rhs, two PETSc vectors, refined until only rounding is left of the residual. Collective.

        Returns a bound on |rhs − A out|, rounding included. Raises ConvergenceError if the solver fails or refinement
        does not reduce the residual far enough.
        """
        self._apply(rhs, out)
        error = np.inf
        for _ in range(MAX_REFINEMENTS):
            residual, size = self._compute_residual(rhs, out)
            previous, error = error, residual / size if residual else 0.0
            if error <= SOLVE_TOLERANCE:
                return residual + ROUNDING_RATIO * size
            if not error <= 0.5 * previous:  # nan as well
                break
            self._apply(self._residual, self._step)
            out.axpy(1.0, self._step)
        raise ConvergenceError(
            f"solve with {self.what}: a residual of {error:.0e} is left and refinement does not remove it. Choose a "
            f"better solver with the options that begin with -{self.prefix}."
        )

    def _apply(self, rhs, out):
        mumps.solve(self.ksp, rhs, out, f"solve with {self.what}")
        if self.project is not None:
            self.project(out.getArray())

    def _compute_residual(self, rhs, x):
        """(|b − A x|, |A| |x| + |b|); the residual b − A x stays in `_residual`."""
        self.matrix.mult(x, self._residual)
        self._residual.aypx(-1.0, rhs)
        return self._residual.norm(), self._norm * x.norm() + rhs.norm()

    def energy(self, rhs) -> tuple[float, float]:
        """(e, residual): bᵀA⁻¹b = e + ρᵀA⁻¹ρ of a PETSc vector b = `rhs`, with |ρ| ≤ residual. Collective.

        For x with A x = b − ρ: bᵀA⁻¹b = xᵀA x + 2 xᵀρ + ρᵀA⁻¹ρ = xᵀb + xᵀρ + ρᵀA⁻¹ρ, exactly. Raises as `solve`.
        """
        x = rhs.duplicate()
        residual = self.solve(rhs, x)
        e = x.dot(rhs) + x.dot(self._residual)
        return float(e), residual

    def prove(self) -> bool:
        """Whether the last `factorise` proves that the matrix is positive definite. Collective.

        Its options must allow that (see `doubt`), and a solve with a random right-hand side must succeed. `doubt`
        says why it does not.
        """
        if self.doubt:
            return False
        x, b = self.matrix.createVecs()
        b.setArray(
            np.random.default_rng(self.matrix.getOwnershipRange()[0]).standard_normal(b.getLocalSize())
        )
        try:
            self.solve(b, x)
        except ConvergenceError as error:
            self.doubt = str(error)
        return not self.doubt


def doubt(ksp, null_pivots: bool = False) -> str:
    """Why the signs of the pivots of this KSP's factor prove nothing, in a few words; empty if they do. After `setUp`.

    null_pivots   whether MUMPS may detect and replace null pivots: the caller checks how many there were
    """
    prefix, pc = ksp.getOptionsPrefix(), ksp.getPC()
    options = current().PETSc.Options(prefix)
    if ksp.getType() != "preonly":
        return f"-{prefix}ksp_type {ksp.getType()} is not preonly"
    if pc.getType() != "cholesky":
        return f"-{prefix}pc_type {pc.getType()} is not cholesky"
    if options.getBool("ksp_reuse_preconditioner", False):
        return f"-{prefix}ksp_reuse_preconditioner keeps the factor of another matrix"
    solver = pc.getFactorSolverType()
    if solver == "cholmod":
        return _doubt_cholmod(prefix, options)
    if solver == "mumps":
        return _doubt_mumps(prefix, pc.getFactorMatrix(), ksp.getComm().size, null_pivots)
    return f"-{prefix}pc_factor_mat_solver_type {solver} does not show the signs of its pivots"


def _doubt_cholmod(prefix, options):
    """CHOLMOD's settings cannot be read back; it has read them from the same database."""
    kind = options.getString("mat_cholmod_factor", "AUTO")
    if kind.upper() != "SUPERNODAL":
        return f"-{prefix}mat_cholmod_factor {kind} lets negative pivots pass"
    if options.getReal("mat_cholmod_dbound", 0.0) != 0.0:
        return f"-{prefix}mat_cholmod_dbound replaces small pivots"
    return ""


def _doubt_mumps(prefix, factor, ranks, null_pivots):
    for number, (required, what) in MUMPS_SETTINGS.items():
        if factor.getMumpsIcntl(number) != required:
            return f"-{prefix}mat_mumps_icntl_{number} {factor.getMumpsIcntl(number)}: {what}"
    if ranks > 1 and factor.getMumpsIcntl(13) != 1:
        return f"-{prefix}mat_mumps_icntl_13 {factor.getMumpsIcntl(13)} leaves out the pivots of the root"
    if factor.getMumpsIcntl(24) != 0 and not null_pivots:
        return f"-{prefix}mat_mumps_icntl_24 {factor.getMumpsIcntl(24)} replaces null pivots"
    if factor.getMumpsCntl(4) >= 0.0:
        return f"-{prefix}mat_mumps_cntl_4 {factor.getMumpsCntl(4):g} replaces small pivots"
    return ""


def least_eigenvalue(start, step, trials: int = PROOF_TRIALS) -> float:
    """A lower bound on the smallest |λ| of a symmetric A, wrong with a probability of one in a million. Collective.

    start   () → a vector of independent standard normal numbers in the space on which A acts
    step    vector x → (y with A y = x − ρ, a bound on the residual |ρ|, rounding included, |y|)

    Only the residuals of the solves are used, so this holds for any solver. Let u be the eigenvector of that λ, x₀ a
    start and A x_k = x_{k−1} − ρ_k. Then

        u·x₀ = λᵐ u·x_m + Σ_k λ^{k−1} u·ρ_k ,    |u·x₀| ≤ |λ|ᵐ |x_m| + Σ_k |λ|^{k−1} |ρ_k| .

    |u·x₀| < τ has the probability 0.8 τ, and (0.8 τ)² in two trials. Otherwise one of the m terms with a power of |λ|
    is at least (τ − |ρ₁|)/m. The bound is zero if the residuals are too large.
    """
    least = np.inf
    for _ in range(trials):
        x, factors = start(), []  # of |λ|⁰, |λ|¹, …
        for _ in range(PROOF_STEPS):
            x, residual, size = step(x)
            factors.append(residual)
        factors.append(size)
        share = max(PROOF_TAU - factors[0], 0.0) / PROOF_STEPS
        least = min(least, *((share / factors[k]) ** (1.0 / k) for k in range(1, PROOF_STEPS + 1)))
    return float(least)


def least_singular_value(start, step) -> float:
    """`least_eigenvalue` of a complex symmetric A: a lower bound on its smallest singular value σ. Collective.

    start, step   as for `least_eigenvalue`, of complex vectors; normal numbers of unit variance in both parts

    A = U Σ Uᵀ (Takagi), so A ū = σu, and uᴴx_{k−1} = σ uᵀy_k + uᴴρ_k for A y_k = x_{k−1} − ρ_k; so x_k = ȳ_k.
    |uᴴx₀| < τ has the probability τ²/2, so one trial suffices.
    """

    def turned(x):
        y, residual, size = step(x)
        return np.conj(y), residual, size

    return least_eigenvalue(start, turned, trials=1)
