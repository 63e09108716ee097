"""Lowest eigenpairs of K without pinned unknowns: SLEPc's shift-invert Krylov–Schur, or LAPACK for a large part of the
spectrum.

On one rank K − σ is factorised by `block_inverse`. On several, for very many disks, and if the user gives an
option that begins with modes_st_, by MUMPS or CHOLMOD.

The shift σ < 0 lies just below the spectrum, so K − σ is positive definite; translations of connected pieces
are known and deflated. (With σ = 0 SLEPc would attach them to K as its null space.)
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh

from jampetsc import interrupts
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.petsc.cholesky import fits_cholmod
from jampetsc.petsc.session import current
from jampetsc.petsc.sparse_matrices import whole_matrix

PREFIX = "modes_"
# −σ in units of the contact stiffness: of the order of the softest modes. Nearer to zero, a mode of no energy
# would be amplified by 1/σ and its rounding drown the others.
SHIFT = 1e-7
# eigenpairs more than requested: the first shows whether a cluster of equal eigenvalues ends there
EXTRA_PAIRS = 2
# unknowns from which dense blocks are faster in the triangular solves of CHOLMOD
DENSE_SOLVE_UNKNOWNS = 30_000
DENSE_BLOCK_UNKNOWNS = 250_000  # unknowns from which dense blocks are faster in the factorisation as well
BASIS_RATIO = 2.5  # vectors of the basis for each eigenpair, with which SLEPc hardly ever restarts
MAX_LAPACK_UNKNOWNS = 8192  # unknowns up to which LAPACK finds all eigenpairs


@dataclass(frozen=True, eq=False)
class Eigenpairs:
    """The lowest eigenvalues of K, increasing, translations left out."""

    values: np.ndarray  # (m,)
    vectors: np.ndarray  # (m, unknowns_local), of unit length on all ranks together
    residuals: np.ndarray  # (m,) ‖K φ − λ φ‖, in units of k
    method: str
    iterations: int

    def __getitem__(self, rows) -> "Eigenpairs":
        """Some of them, or in another order."""
        chosen = {name: getattr(self, name)[rows] for name in ("values", "vectors", "residuals")}
        return replace(self, **chosen)


def translations(pencil):
    """Orthonormal translations of the connected pieces, (D pieces, unknowns_local), times √M with masses."""
    sizes = np.bincount(pencil.pieces.index) if pencil.mass is None else pencil.mass.total[:, 0]
    own_pieces = pencil.pieces.index[pencil.network.first : pencil.network.last]
    dimension = pencil.dimension
    moves = np.zeros((len(sizes), dimension, len(own_pieces), dimension))
    for axis in range(dimension):
        moves[own_pieces, axis, np.arange(len(own_pieces)), axis] = 1.0 / np.sqrt(sizes[own_pieces])
    return moves.reshape(dimension * len(sizes), -1) / pencil.mass_scale


def lowest(pencil, count: int, stiffness: float, excluded=None) -> Eigenpairs:
    """At least `count` of the lowest eigenpairs of K, and one more if there is one (see `EXTRA_PAIRS`). Collective.

    pencil      of K without pinned unknowns and without angles (law `UNDAMPED`); K is positive semi-definite; with
                masses as `mass_weighted` gives it
    stiffness   the largest contact stiffness, which sets the scale
    excluded    (l, unknowns_local) orthonormal eigenvectors that are not to be found again

    Raises InputError if K has fewer, ConvergenceError if they are not found.
    """
    moves = translations(pencil)
    available = pencil.unknowns - len(moves)
    if count > available:
        raise InputError(f"{count} modes: K has {available} besides its translations. Give a smaller number.")
    if 2 * (count + EXTRA_PAIRS) < available or excluded is not None:
        deflated = moves if excluded is None else np.vstack((moves, excluded))
        return _krylov(pencil, deflated, count + EXTRA_PAIRS, stiffness)
    if pencil.unknowns > MAX_LAPACK_UNKNOWNS:
        raise InputError(
            f"{count} of {available} modes: more than half the spectrum is found up to "
            f"{MAX_LAPACK_UNKNOWNS // pencil.dimension} particles. Give a smaller number."
        )
    return _dense(pencil, moves, min(count + EXTRA_PAIRS, available), stiffness)


class _BlockFactor:
    """(K − σ)⁻¹ of a matrix that lies on one rank, as a preconditioner that PETSc calls."""

    def __init__(self, matrix, shift):
        from jampetsc.petsc.hessian_solver import block_inverse  # compiled code, slow to load

        self._solve, self.stopped = block_inverse(matrix, shift), None
        if self._solve is None:
            raise ConvergenceError(
                "K − σ: not positive definite with σ just below zero, so K has negative modes"
            )

    def apply(self, pc, b, x):
        """x = (K − σ)⁻¹ b; after an exception, such as of a Ctrl-C, x = 0: SLEPc must end normally to be freed."""
        try:
            interrupts.check()
            if self.stopped is None:
                x.setArray(self._solve(b.getArray(readonly=True)))
                return
        except BaseException as error:
            self.stopped = error
        x.set(0.0)

    def stop(self, eps, iterations, limit, converged, requested):
        """SLEPc's usual test whether to restart; after an exception it does not."""
        reason = current().SLEPc.EPS.ConvergedReason
        if self.stopped is not None or converged >= requested:
            return reason.CONVERGED_TOL
        return reason.DIVERGED_ITS if iterations >= limit else reason.CONVERGED_ITERATING


def suits_blocks(pencil) -> bool:
    """Whether K lies on one rank, in blocks of 2×2 whose rows sum to zero, is not too large, and no option says how to
    factorise it.
    """
    whole = pencil.K.getComm().size == 1 and pencil.unknowns <= DENSE_BLOCK_UNKNOWNS and pencil.mass is None
    return whole and pencil.dimension == 2 and not current().has_options(PREFIX + "st_")


def _krylov(pencil, moves, count, stiffness):
    SLEPc = current().SLEPc
    deflated = [pencil.K.createVecRight() for _ in moves]
    for vector, move in zip(deflated, moves, strict=True):
        vector.setArray(move)
    eps, factor = _solver(pencil.K, count, stiffness), None
    if suits_blocks(pencil):
        st = eps.getST()
        st.setMatMode(SLEPc.ST.MatMode.SHELL)  # K − σ is not needed as a matrix
        pc = st.getKSP().getPC()
        pc.setType("python")
        factor = _BlockFactor(pencil.K, SHIFT * stiffness)
        pc.setPythonContext(factor)
        eps.setStoppingTest(factor.stop)
    eps.setDeflationSpace(deflated)
    try:
        eps.solve()
    finally:
        if factor and factor.stopped:
            raise factor.stopped
    converged, reason = eps.getConverged(), eps.getConvergedReason()
    if converged < count:
        raise ConvergenceError(
            f"SLEPc: {converged} of {count} modes found in {eps.getIterationNumber()} restarts (reason {reason}). "
            "Give a larger -modes_eps_ncv or -modes_eps_max_it."
        )
    values = np.array([eps.getEigenvalue(row).real for row in range(converged)])
    vector = pencil.K.createVecRight()
    vectors = np.empty((converged, vector.getLocalSize()))
    residuals = np.empty(converged)
    for row in range(converged):
        eps.getEigenvector(row, vector)
        vectors[row] = vector.getArray()
        residuals[row] = eps.computeError(row, SLEPc.EPS.ErrorType.ABSOLUTE)
    pairs = Eigenpairs(values, vectors, residuals, eps.getType(), eps.getIterationNumber())
    return pairs[np.argsort(values, kind="stable")]


def _solver(matrix, count, stiffness):
    """The EPS for `count` modes of a matrix, its options read."""
    session = current()
    SLEPc = session.SLEPc
    if SLEPc is None:
        raise InputError(
            "slepc4py: missing. Install it for the PETSc in use (Debian: python3-slepc4py-real)."
        )
    alone, small = fits_cholmod(matrix), matrix.getSize()[0] < DENSE_SOLVE_UNKNOWNS
    cholmod = {"st_mat_cholmod_factor": "SIMPLICIAL" if small else "SUPERNODAL"}
    defaults = {
        "eps_type": "krylovschur",
        "eps_tol": "1e-12",
        "eps_max_it": "300",
        "st_type": "sinvert",
        "st_ksp_type": "preonly",
        "st_pc_type": "cholesky",
        "st_pc_factor_mat_solver_type": "cholmod" if alone else "mumps",
        **(cholmod if alone else {"st_mat_mumps_icntl_7": "2"}),
    }
    session.set_defaults({PREFIX + name: value for name, value in defaults.items()})
    session.free_dropped(matrix.getComm())
    eps = SLEPc.EPS().create(matrix.getComm())
    eps.setOptionsPrefix(PREFIX)
    eps.setOperators(matrix)
    eps.setProblemType(SLEPc.EPS.ProblemType.HEP)
    eps.setDimensions(count, min(int(BASIS_RATIO * count) + 1, matrix.getSize()[0]))
    eps.setTarget(-SHIFT * stiffness)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    eps.setFromOptions()
    return eps


def _dense(pencil, moves, count, stiffness):
    """All of a small K by LAPACK, on rank 0."""
    comm = pencil.network.comm
    K, parts = whole_matrix(pencil.K), comm.allgather(moves)
    values = shares = None
    if comm.rank == 0:
        K, whole = K.toarray(), np.hstack(parts)
        # Translations are shifted above the spectrum: no absolute row sum of K is larger than the maximum used here.
        K += (2.0 * np.abs(K).sum(axis=1).max() + stiffness) * (whole.T @ whole)
        values, vectors = eigh(K, overwrite_a=True, driver="evd")
        values, ends = values[:count], np.cumsum([part.shape[1] for part in parts])
        shares = np.split(vectors[:, :count].T, ends[:-1], axis=1)
    values, vectors = comm.bcast(values), comm.scatter(shares)
    return Eigenpairs(values, vectors, _residuals(pencil.K, values, vectors), "lapack", 1)


def _residuals(K, values, vectors):
    """‖K φ − λ φ‖ of each pair, (m,). Collective."""
    x, y = K.createVecs()
    residuals = np.empty(len(values))
    for row, (value, vector) in enumerate(zip(values, vectors, strict=True)):
        x.setArray(vector)
        K.mult(x, y)
        y.axpy(-value, x)
        residuals[row] = y.norm()
    return residuals
