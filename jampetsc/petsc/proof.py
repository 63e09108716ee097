"""What a factorisation proves by its success, which depends on options that a user may override.

L Lᵀ by dense blocks (CHOLMOD's supernodal Cholesky) breaks down at the first pivot that is not positive. MUMPS lets
negative pivots pass and counts them, if told to handle the root itself and neither to replace nor to compress
anything. Others (the simplicial L D Lᵀ of CHOLMOD, PETSc's own, any iterative method) solve without proving anything.
What is in force is read back from the solver.
"""

from jampetsc.petsc.session import current

# ICNTL with which the pivots are not those of A, unless they have the value that stands first
MUMPS_SETTINGS = {19: (0, "Schur complement"), 31: (0, "discarded factors"), 35: (0, "block low-rank")}


def doubt(ksp, null_pivots: bool = False) -> str:
    """Why the signs of the pivots of this KSP's factor say nothing, in a few words; empty where they do. After `setUp`.

    null_pivots   whether MUMPS may detect null pivots, which it replaces: the caller looks at how many there were
    """
    prefix, pc = ksp.getOptionsPrefix(), ksp.getPC()
    given = current().PETSc.Options(prefix)
    if ksp.getType() != "preonly":
        return f"-{prefix}ksp_type {ksp.getType()} is not preonly"
    if pc.getType() != "cholesky":
        return f"-{prefix}pc_type {pc.getType()} is not cholesky"
    if given.getBool("ksp_reuse_preconditioner", False):
        return f"-{prefix}ksp_reuse_preconditioner keeps the factor of another matrix"
    solver = pc.getFactorSolverType()
    if solver == "cholmod":
        return _doubt_cholmod(prefix, given)
    if solver == "mumps":
        return _doubt_mumps(prefix, pc.getFactorMatrix(), ksp.getComm().size, null_pivots)
    return f"-{prefix}pc_factor_mat_solver_type {solver} does not show the signs of its pivots"


def _doubt_cholmod(prefix, given):
    """CHOLMOD cannot be asked; it has read the same database."""
    kind = given.getString("mat_cholmod_factor", "AUTO")
    if kind.upper() != "SUPERNODAL":
        return f"-{prefix}mat_cholmod_factor {kind} lets negative pivots pass"
    if given.getReal("mat_cholmod_dbound", 0.0) != 0.0:
        return f"-{prefix}mat_cholmod_dbound replaces small pivots"
    return ""


def _doubt_mumps(prefix, factor, ranks, null_pivots):
    for number, (wanted, what) in MUMPS_SETTINGS.items():
        if factor.getMumpsIcntl(number) != wanted:
            return f"-{prefix}mat_mumps_icntl_{number} {factor.getMumpsIcntl(number)}: {what}"
    if ranks > 1 and factor.getMumpsIcntl(13) != 1:
        return f"-{prefix}mat_mumps_icntl_13 {factor.getMumpsIcntl(13)} leaves out the pivots of the root"
    if factor.getMumpsIcntl(24) != 0 and not null_pivots:
        return f"-{prefix}mat_mumps_icntl_24 {factor.getMumpsIcntl(24)} replaces null pivots"
    if factor.getMumpsCntl(4) >= 0.0:
        return f"-{prefix}mat_mumps_cntl_4 {factor.getMumpsCntl(4):g} replaces small pivots"
    return ""
