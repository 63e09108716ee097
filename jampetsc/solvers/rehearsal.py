"""Mistakes in PETSc's options found before the work: each solver of a run is set up on a small matrix first.

So an option that is needed late in the run is known to be right, and one that nothing will ever read is refused
at once. A user who gives no options spends no time on this.
"""

import numpy as np

from jampetsc.session import current

ORDER = 512  # rows at least: enough for a multigrid method of the user's to have levels
ROWS = 8  # per rank at least


def rehearse(*solvers) -> None:
    """Set up each of the solvers for a small positive definite matrix. Collective.

    solvers   functions of the matrix, a PETSc.Mat on all ranks, that set up as the run will do later

    Raises InputError for an option of the user that none of them asks for, and for a value that PETSc refuses.
    """
    session = current()
    if not session.options_given():
        return
    matrix = _matrix(session)
    try:
        with session.rehearsal():
            for solver in solvers:
                solver(matrix)
    finally:
        matrix.destroy()


def _matrix(session):
    """The second difference, 2 on the diagonal and −1 beside it."""
    size = max(ORDER, ROWS * session.size)
    matrix = session.PETSc.Mat().createAIJ((size, size), nnz=3, comm=session.comm)
    for row in range(*matrix.getOwnershipRange()):
        columns = np.arange(max(row - 1, 0), min(row + 2, size), dtype=session.PETSc.IntType)
        matrix.setValues([row], columns, np.where(columns == row, 2.0, -1.0))
    matrix.assemble()
    matrix.setOption(session.PETSc.Mat.Option.SYMMETRIC, True)
    return matrix
