"""Velocities under contact damping by a KSP on all ranks: the resistance matrix of the contacts of one instant.

Every rank knows all disks and contacts and holds the rows of some disks. The matrix may be singular, with a
translation of each cluster of contacts free; right-hand sides are then consistent, and a Krylov method from the
last velocities finds a solution. Options have the prefix `flow_`.
"""

import numpy as np
from scipy.sparse import csr_array

from jampetsc.errors import ConvergenceError, named
from jampetsc.session import current
from jampetsc.solvers import stopped

PREFIX = "flow_"
DEFAULTS = {"ksp_type": "cg", "pc_type": "jacobi", "ksp_norm_type": "unpreconditioned"}


class ContactSolver:
    """Solves (A + s) u = b for one set of contacts after the other. Collective."""

    def __init__(self, tolerance: float):
        session = current()
        self.comm, self._petsc = session.comm, session.PETSc
        session.set_defaults({PREFIX + name: value for name, value in DEFAULTS.items()})
        session.set_defaults({PREFIX + "ksp_rtol": tolerance})
        self.ksp = self._petsc.KSP().create(session.comm)
        self.ksp.setOptionsPrefix(PREFIX)
        self.ksp.setInitialGuessNonzero(True)
        self.ksp.setFromOptions()

    def solve(self, graph, weights, hold, b, u) -> int:
        """Overwrite u (N, 2), the guess, with the solution for b (N, 2); returns iterations. See `flows.resistance`.

        u and b are the same on all ranks before, and u after. Raises ConvergenceError.
        """
        n = len(u)
        first, last = (n * rank // self.comm.size for rank in (self.comm.rank, self.comm.rank + 1))
        rows = _rows(graph, weights, hold, n, first, last)
        size = ((2 * (last - first), 2 * n), (2 * (last - first), 2 * n))
        index = self._petsc.IntType
        matrix = self._petsc.Mat().createAIJ(
            size, csr=(rows.indptr.astype(index), rows.indices.astype(index), rows.data), comm=self.comm
        )
        matrix.setOption(self._petsc.Mat.Option.SYMMETRIC, True)
        right = self._petsc.Vec().createWithArray(b[first:last].ravel(), comm=self.comm)
        local = u[first:last].ravel()
        solution = self._petsc.Vec().createWithArray(local, comm=self.comm)
        try:
            self.ksp.setOperators(matrix)
            self.ksp.solve(right, solution)
            reason = stopped.reason(self.ksp)
            if reason <= 0:
                raise ConvergenceError(
                    f"velocities not found by KSP (reason {reason}, {self.ksp.getIterationNumber()} iterations): "
                    f"choose another -flow_ksp_type or -flow_pc_type, or a larger {named('tolerance')}"
                )
            u[:] = np.concatenate(self.comm.allgather(solution.getArray())).reshape(n, 2)
        finally:
            for item in (matrix, right, solution):
                item.destroy()
        return self.ksp.getIterationNumber()

    def destroy(self) -> None:
        """Free the solver. Collective."""
        self.ksp.destroy()


def _rows(graph, weights, hold, n, first, last):
    """Rows of disks [first, last) of A + hold on interleaved (x, y), as a scipy CSR array."""
    start, column, normals, held = graph
    along, across = weights[0], weights[1]
    ends = slice(int(start[first]), int(start[last]))
    j = column[ends].astype(np.int64)
    a = np.repeat(np.arange(last - first), np.diff(start[first : last + 1].astype(np.int64)))
    block = np.broadcast_to(across * np.eye(2), (len(j), 2, 2)).copy()
    if len(normals):
        own = normals[ends]
        block += (along - across) * own[:, :, None] * own[:, None, :]
    diagonal = np.broadcast_to(hold * np.eye(2), (last - first, 2, 2)).copy()
    np.add.at(diagonal, a, block)
    # a disk that nothing holds, or a wall does: its right-hand side is zero, and so is then its velocity
    own = np.arange(last - first)
    still = ~diagonal.any(axis=(1, 2)) | (own + first < held)
    diagonal[still] = np.eye(2)
    block[(a + first < held) | (j < held)] = 0.0
    row = np.concatenate((a, own))[:, None, None] * 2 + np.arange(2)[None, :, None]
    col = np.concatenate((j, own + first))[:, None, None] * 2 + np.arange(2)[None, None, :]
    values = np.concatenate((-block, diagonal))
    shape = values.shape
    entries = (np.broadcast_to(row, shape).ravel(), np.broadcast_to(col, shape).ravel())
    matrix = csr_array((values.ravel(), entries), shape=(2 * (last - first), 2 * n))
    matrix.sum_duplicates()
    matrix.sort_indices()
    return matrix
