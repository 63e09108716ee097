"""Creates a KSP and factorises; explains failures, and repeats a MUMPS factorisation that ran out of workspace."""

import re

from jampetsc import interrupts
from jampetsc.errors import ConvergenceError, named
from jampetsc.petsc.session import current

# INFOG(1): some work array was too small; ICNTL(14) enlarges them
WORKSPACE_CODES = (-8, -9, -14, -15, -17, -20)
MEMORY_CODES = (-13, -19)  # INFOG(1): the memory of the machine, or the limit ICNTL(23), is used up
SINGULAR_CODES = (-10,)
OUT_OF_CORE_CODES = (-90,)
PETSC_MEMORY = 55  # PETSC_ERR_MEM
CHOLMOD_MEMORY = re.compile(r"CHOLMOD .*status -[23]\b")  # out of memory, too large
DEFAULT_WORKSPACE = 20  # MUMPS's default of ICNTL(14): per cent of workspace beyond its estimate
MAX_ATTEMPTS = 5  # with ICNTL(14) doubled each time


class FactorisationError(ConvergenceError):
    """A factorisation that failed; `code` is MUMPS's INFOG(1)."""

    def __init__(self, message, code=None):  # of copies from other ranks `code` is set later
        super().__init__(message)
        self.code = code


def failure_code(pc):
    """INFOG(1) of a failed MUMPS factorisation of this PC, 0 where it succeeded, None where MUMPS was not used."""
    factorises = pc.getType() in ("cholesky", "lu") and pc.getFactorSolverType() == "mumps"
    return pc.getFactorMatrix().getMumpsInfog(1) if factorises else None


def negative_pivots(pc) -> int:
    """Number of negative pivots of a MUMPS factorisation of this PC, 0 where MUMPS was not used."""
    return 0 if failure_code(pc) is None else pc.getFactorMatrix().getMumpsInfog(12)


def factored(ksp) -> list:
    """The PCs of a KSP that is set up which have factors: its own, or its blocks' PCs."""
    pc = ksp.getPC()
    return [block.getPC() for block in pc.getFieldSplitSubKSP()] if pc.getType() == "fieldsplit" else [pc]


def make_ksp(comm, prefix: str, defaults: dict):
    """A PETSc.KSP with the options of this prefix, `defaults` where the user gives none. Collective."""
    current().set_defaults({prefix + name: value for name, value in defaults.items()})
    current().free_dropped(comm)
    ksp = current().PETSc.KSP().create(comm)
    ksp.setOptionsPrefix(prefix)
    ksp.setFromOptions()
    return ksp


def factorise(ksp, matrix, what: str) -> int:
    """Set up `ksp` for `matrix`; where MUMPS ran out of workspace, with more (ICNTL(14) doubled). Collective.

    Returns the number of attempts. Raises FactorisationError naming `what`, and PETSc.Error for other errors.
    A Ctrl-C is raised before, see `interrupts`.
    """
    interrupts.check()
    attempt = 1
    while True:
        ksp.setOperators(matrix)
        try:
            ksp.setUp()
            for pc in (pcs := factored(ksp)):
                pc.setUp()
        except current().PETSc.Error as error:
            if error.ierr == PETSC_MEMORY or CHOLMOD_MEMORY.search(str(error)):
                prefix = ksp.getOptionsPrefix()
                raise FactorisationError(
                    f"factorisation of {what}: out of memory. Use more ranks or nodes, or have the factor on disk with "
                    f"-{prefix}pc_factor_mat_solver_type mumps -{prefix}mat_mumps_icntl_22 1.",
                    MEMORY_CODES[0],
                ) from None
            raise
        code = min(failure_code(pc) or 0 for pc in pcs)
        if code >= 0:  # positive codes are warnings
            return attempt
        if code not in WORKSPACE_CODES or attempt == MAX_ATTEMPTS or pcs[0] != ksp.getPC():
            raise _explain(code, what)
        option = f"{ksp.getOptionsPrefix()}mat_mumps_icntl_14"
        options = current().PETSc.Options()
        options.setValue(option, max(DEFAULT_WORKSPACE, 2 * options.getInt(option, DEFAULT_WORKSPACE)))
        ksp.reset()  # its PC stays broken after such a failure until it is reset
        ksp.setFromOptions()
        attempt += 1


def solve(ksp, rhs, out, what: str, remedy: str = "") -> None:
    """out ← the solution of `ksp` for rhs, PETSc vectors. Collective.

    Raises ConvergenceError with PETSc's reason if it failed on any rank: PETSc does not tell all ranks of a
    preconditioner that fails on one. A Ctrl-C is raised before, see `interrupts`.
    """
    interrupts.check()
    ksp.solve(rhs, out)
    reason = min(ksp.getComm().tompi4py().allgather(ksp.getConvergedReason()))
    if reason < 0:
        reasons = current().PETSc.KSP.ConvergedReason
        name = next((name for name in dir(reasons) if getattr(reasons, name) == reason), reason)
        raise ConvergenceError(
            f"{what}: KSP stopped with {name} after {ksp.getIterationNumber()} iterations{remedy}"
        )


def _explain(code, what):
    """The error to raise for a factorisation of `what` that failed with this INFOG(1)."""
    shown = f"MUMPS INFOG(1) = {code}"
    if code in WORKSPACE_CODES or code in MEMORY_CODES:
        remedy = f"out of memory ({shown}). Use more ranks or nodes, or -options_file jampetsc:low_memory."
    elif code in OUT_OF_CORE_CODES:
        remedy = f"files of MUMPS not written ({shown}). Free space in, or set, MUMPS_OOC_TMPDIR."
    elif code in SINGULAR_CODES:
        remedy = f"singular matrix ({shown}). See info with {named('matrices')}: is the packing a minimum?"
    else:
        remedy = f"the solver reports {shown}"
    return FactorisationError(f"factorisation of {what}: {remedy}", code)
