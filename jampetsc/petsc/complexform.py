"""K + iωB as one PETSc matrix, for real or complex scalars of the running PETSc.

With complex scalars it is stored as it is. With real ones an unknown takes two rows, its real and its imaginary part
next to each other, and each entry becomes a block:

    (K + iωB)(x + iy) = b + ic    ⇔    [[K, −ωB], [−ωB, −K]] (x, y) = (b, −c) .

That form is symmetric as well, indefinite, and twice as large; L D Lᵀ factorises both. Local parts of complex vectors
are numpy arrays here, the same for both forms.
"""

import numpy as np
from scipy.sparse import bsr_array

from jampetsc.petsc import mumps
from jampetsc.petsc.session import current
from jampetsc.petsc.sparse_matrices import diagonal_of, distributed_matrix


class ComplexForm:
    """K + iωB at one frequency after another, and its vectors, from PETSc matrices K, B of one pattern. Collective.

    A           PETSc.Mat; x and b are vectors that fit it
    magnitude   |diagonal of K + iωB| at the ω of the last `set`, (n_local,)
    """

    def __init__(self, K, B):
        if current().scalar_type == "complex":
            self._doubled, self._step = False, 1j
            self._K, self._B = K, B
        else:
            self._doubled, self._step = True, 1.0
            self._K = _blocks(K, [[1.0, 0.0], [0.0, -1.0]])
            self._B = _blocks(B, [[0.0, -1.0], [-1.0, 0.0]])
        self.A = self._K.duplicate(copy=True)
        self.x, self.b = self.A.createVecs()
        self._diagonals = [diagonal_of(matrix) for matrix in (K, B)]

    def set(self, omega: float) -> None:
        """A ← K + iωB."""
        same = current().PETSc.Mat.Structure.SAME_NONZERO_PATTERN
        self._K.copy(self.A, structure=same)
        self.A.axpy(self._step * omega, self._B, structure=same)
        of_K, of_B = self._diagonals
        self.magnitude = np.hypot(of_K, omega * of_B)

    def scale(self, d) -> None:
        """A ← D A D for the diagonal d (n_local,), real."""
        self.b.setArray(np.repeat(d, 2) if self._doubled else d)
        self.A.diagonalScale(self.b, self.b)

    def solve(self, ksp, right, what: str):
        """Solution (n_local,) of A x = right (n_local,) by `ksp`. Raises ConvergenceError if that fails."""
        self.b.setArray(np.conj(right).view(float) if self._doubled else right)
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
