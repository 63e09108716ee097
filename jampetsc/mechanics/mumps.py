"""What a failed factorisation says, in words, and the one failure that more workspace cures."""

from jampetsc.errors import ConvergenceError

WORKSPACE = (-8, -9, -14, -15, -17, -20)  # INFOG(1): some work array was too small; ICNTL(14) enlarges them
MEMORY = (-13, -19)  # INFOG(1): the machine, or the limit ICNTL(23), has no more
SINGULAR = (-10,)
OUT_OF_CORE = (-90,)


def failure(pc):
    """INFOG(1) of a failed MUMPS factorisation of this PC, 0 where it succeeded, None where MUMPS was not used."""
    if pc.getFactorSolverType() != "mumps":
        return None
    return pc.getFactorMatrix().getMumpsInfog(1)


def explain(code, what: str) -> ConvergenceError:
    """The error to raise for a factorisation of `what` that failed with this INFOG(1)."""
    if code in WORKSPACE or code in MEMORY:
        remedy = (
            f"out of memory (MUMPS INFOG(1) = {code}); use more ranks or nodes, or -options_file options/low_memory.opts"
        )
    elif code in OUT_OF_CORE:
        remedy = "MUMPS could not write its files (INFOG(1) = -90); free space in, or set, MUMPS_OOC_TMPDIR"
    elif code in SINGULAR:
        remedy = "the matrix is singular (MUMPS INFOG(1) = -10); is the packing a minimum? see `jampetsc info --matrices`"
    else:
        remedy = f"the solver reports {f'MUMPS INFOG(1) = {code}' if code else 'a failed factorisation'}"
    return ConvergenceError(f"factorisation of {what}: {remedy}")
