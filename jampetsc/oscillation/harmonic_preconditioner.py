"""Preconditioner of a Newton step: one system for each harmonic, with the damping at its mean over the cycle.

With the damping forces eliminated and df/dz of each contact replaced by its mean, which gives B̄, harmonics decouple:
(K/iΩ_k + B̄) y_k = r_k, or (A + iB̄) y = i r with A = K/Ω_k. Both matrices are symmetric and positive semidefinite, so
the block form

    (A, −B̄; B̄, A) ≈ (A, −B̄; B̄, A + 2B̄)                      (Axelsson, Neytcheva & Ahmad, Numer. Algor. 66, 811 (2014))

has preconditioned eigenvalues between ½ and 1 and costs two solves with the real, positive definite H = A + B̄.
Harmonics whose Ω differ by less than MAX_FREQUENCY_RATIO use one factor of H. The strain, as γL, is the last unknown.

The harmonics are distributed over the ranks: each factorises whole matrices H, for its own harmonics, alone.
"""

import itertools

import numpy as np
from scipy.sparse import bmat, csr_array

from jampetsc.collective import agreed
from jampetsc.oscillation.cycle_equations import ContactMotions
from jampetsc.oscillation.half_cycle import Cycle
from jampetsc.petsc.cholesky import Cholesky, NotPositiveDefinite
from jampetsc.petsc.session import current
from jampetsc.petsc.sparse_matrices import whole_matrix
from jampetsc.response.factor_memory import require_memory

FACTOR_PREFIX = "osc_factor_"
MAX_FREQUENCY_RATIO = 1.5  # largest ratio of the Ω of harmonics that use one factor


class HarmonicPreconditioner:
    """For the equations of one cycle; `bordered` where the strain is unknown. Methods are collective."""

    def __init__(self, contacts: ContactMotions, cycle: Cycle, bordered: bool):
        self._contacts, self._cycle = contacts, cycle
        comm, pencil = contacts.network.comm, contacts.pencil
        ends = np.arange(comm.size + 1) * len(cycle.orders) // comm.size
        self._shares = [slice(*pair) for pair in itertools.pairwise(ends)]
        self._mine = self._shares[comm.rank]

        n, L = pencil.unknowns, contacts.length
        k = bordered * np.concatenate(comm.allgather(pencil.k_gamma.getArray().real)) / L
        column = csr_array((k, (np.arange(n), np.zeros(n, int))), shape=(n, 1))
        corner = csr_array([[pencil.k_gg / L**2 if bordered else 1.0]])
        # bordered K, as every rank has it
        self.K = K = csr_array(bmat([[whole_matrix(pencil.K), column], [column.T, corner]], format="csr"))
        K.sort_indices()
        felt, self._squares = contacts.squares(bordered * contacts.g)
        keys = np.repeat(np.arange(n + 1), np.diff(K.indptr)) * (n + 1) + K.indices
        self._places = np.searchsorted(keys, felt[:, :, None] * (n + 1) + felt[:, None, :])

        self._factor_of = []  # of each of this rank's harmonics
        for Omega in cycle.frequencies[self._mine]:
            near = self._factor_of and Omega <= MAX_FREQUENCY_RATIO * self._factor_of[-1].Omega
            self._factor_of.append(self._factor_of[-1] if near else _Factor(K, Omega))
        self._factors = list(dict.fromkeys(self._factor_of))
        count = contacts.network.sum(len(self._factors))
        require_memory(contacts.network, pencil.unknowns, FACTOR_PREFIX, count)

    def update(self, stiffness):
        """Factorise for `stiffness` (contacts, damped), the mean diagonal of df/dz.

        Raises NotPositiveDefinite, on all ranks, if K has negative modes that make an H indefinite.
        """
        contacts, K = self._contacts, self.K
        local = (stiffness * contacts.roots**2).reshape(-1, 1, 1) * self._squares
        data = np.bincount(self._places.ravel(), local.ravel(), minlength=K.nnz)
        self._B = csr_array((contacts.network.sum(data), K.indices, K.indptr), shape=K.shape)
        with agreed(contacts.network.comm):
            for factor in self._factors:
                factor.factorise(csr_array((K.data / factor.Omega + self._B.data, K.indices, K.indptr)))

    def apply(self, v, rate):
        """Approximate solution (m, unknowns), (m,) for right-hand sides of these shapes; `rate` is on all ranks."""
        comm = self._contacts.network.comm
        harmonics = 1j * self._cycle.harmonics(v)
        last = 1j * self._cycle.harmonics(rate)
        parts = comm.alltoall([harmonics[share] for share in self._shares])
        solved = self._solve(np.column_stack((*parts, last[self._mine])))
        ends = np.cumsum([0, *(part.shape[1] for part in parts)])
        back = [(solved[:, a:b], solved[:, -1]) for a, b in itertools.pairwise(ends)]
        parts = comm.alltoall(back)
        unknowns, strain = (np.concatenate(part) for part in zip(*parts, strict=True))
        return self._cycle.samples(unknowns), self._cycle.samples(strain)

    def _solve(self, right):
        """Solve for this rank's harmonics: all unknowns and the strain, (harmonics, unknowns + 1)."""
        u = self._inverse(right.real + right.imag)
        y = self._inverse(right.imag - (self._B @ u.T).T)
        return u - y + 1j * y

    def _inverse(self, right):
        solved = [factor.solve(row) for factor, row in zip(self._factor_of, right, strict=True)]
        return np.array(solved).reshape(right.shape)


class _Factor:
    """H = K/Ω + B̄ on one rank, scaled to a unit diagonal and factorised."""

    def __init__(self, pattern, Omega: float):
        PETSc = current().PETSc
        self.Omega = Omega
        self._csr = pattern.indptr.astype(PETSc.IntType), pattern.indices.astype(PETSc.IntType)
        matrix = PETSc.Mat().createAIJ(pattern.shape, csr=(*self._csr, pattern.data), comm=PETSc.COMM_SELF)
        self._cholesky = Cholesky(matrix, FACTOR_PREFIX, f"K/Ω + B at Ω = {Omega:g}")
        self._right, self._solution = matrix.createVecs()

    def factorise(self, H):
        """Factorise H, a csr_array, for the next `solve`s."""
        matrix, diagonal = self._cholesky.matrix, H.diagonal()
        if not (diagonal > 0.0).all():  # nan as well
            raise NotPositiveDefinite(f"{self._cholesky.what} is not positive definite")
        self._scale = scale = 1.0 / np.sqrt(diagonal)
        matrix.setValuesCSR(*self._csr, H.data * np.repeat(scale, np.diff(H.indptr)) * scale[H.indices])
        matrix.assemble()
        self._cholesky.factorise()

    def solve(self, right):
        """H⁻¹ times a vector."""
        self._right.setArray(self._scale * right)
        self._cholesky.ksp.solve(self._right, self._solution)
        return self._scale * self._solution.getArray()
