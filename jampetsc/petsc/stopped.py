"""Why a KSP stopped, the same on all ranks: where the preconditioner of one rank fails, the others are not told."""

from jampetsc.petsc.session import current


def reason(ksp) -> int:
    """PETSc's reason of the last solve, the worst of all ranks; negative where it failed. Collective."""
    return min(ksp.getComm().tompi4py().allgather(ksp.getConvergedReason()))


def name(code: int) -> str:
    """PETSc's name of a reason."""
    reasons = current().PETSc.KSP.ConvergedReason
    return next((name for name in dir(reasons) if getattr(reasons, name) == code), str(code))
