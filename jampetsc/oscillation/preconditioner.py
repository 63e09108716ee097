"""Preconditioner of a Newton step: damping at its mean over the cycle, harmonic by harmonic.

With the damping forces eliminated, and the stiffness of each contact's damping replaced by its mean, B̄, harmonics
decouple:  (K/iΩ_k + B̄) y_k = r_k, or (A + iB̄) y = i r with A = K/Ω_k. Both matrices are symmetric and positive
semidefinite, so the block form

    (A, −B̄; B̄, A) ≈ (A, −B̄; B̄, A + 2B̄)                      (Axelsson, Neytcheva & Ahmad, Numer. Algor. 66, 811 (2014))

has all eigenvalues between ½ and 1 and costs two solves with the real, positive definite H = A + B̄. Harmonics whose
Ω differ by less than a factor SHARED use one factor of H. The strain is a border of H, eliminated.

Ranks share the harmonics: each factorises whole matrices H, for its own harmonics, alone.
"""

import itertools

import numpy as np
from scipy.sparse import csr_array

from jampetsc.collective import agreed
from jampetsc.mechanics.matrices import whole_matrix
from jampetsc.oscillation.cycle import Cycle
from jampetsc.oscillation.equations import Contacts
from jampetsc.petsc.cholesky import Cholesky, NotPositiveDefinite
from jampetsc.petsc.session import current

PREFIX = "osc_factor_"
SHARED = 1.5


class HarmonicPreconditioner:
    """For the equations of one cycle; `bordered` where the strain is unknown. Methods are collective."""

    def __init__(self, contacts: Contacts, cycle: Cycle, bordered: bool):
        self._contacts, self._cycle, self._bordered = contacts, cycle, bordered
        network, pencil = contacts.network, contacts.compatibility.pencil
        comm, count = network.comm, len(cycle.orders)
        ends = np.arange(comm.size + 1) * count // comm.size
        self._shares = [slice(*pair) for pair in itertools.pairwise(ends)]
        self._mine = self._shares[comm.rank]

        self._K = K = whole_matrix(pencil.K)
        size = K.shape[0]
        self._rows = np.repeat(np.arange(size), np.diff(K.indptr))
        keys = self._rows * size + K.indices
        felt, self._squares = contacts.squares()
        self._places = np.searchsorted(keys, felt[:, :, None] * size + felt[:, None, :])
        self._diagonal = np.searchsorted(keys, np.arange(size) * (size + 1))
        k_gamma = np.concatenate(comm.allgather(pencil.k_gamma.getArray().real)) / contacts.length
        self._border_K = np.append(k_gamma, pencil.k_gg / contacts.length**2)

        self._factor_of = []  # of each of this rank's harmonics
        for Omega in cycle.frequencies[self._mine]:
            near = self._factor_of and Omega <= SHARED * self._factor_of[-1].Omega
            self._factor_of.append(self._factor_of[-1] if near else _Factor(K, Omega))
        self._factors = list(dict.fromkeys(self._factor_of))

    def update(self, stiffness):
        """Factorise for mean stiffness (contacts, damped) of the damping.

        Raises NotPositiveDefinite, on all ranks, where K has negative modes that matter.
        """
        contacts = self._contacts
        weights = stiffness * contacts.roots**2
        local = weights.reshape(-1, 1, 1) * self._squares
        data = np.bincount(self._places.ravel(), local.ravel(), minlength=self._K.nnz)
        self._B = csr_array(
            (contacts.network.sum(data), self._K.indices, self._K.indptr), shape=self._K.shape
        )
        tensions = np.zeros((contacts.count, contacts.forms))
        tensions[:, contacts.damped] = weights
        forces, corner = contacts.forces((tensions.ravel() * contacts.g)[None])
        self._border_B = np.append(np.concatenate(contacts.network.comm.allgather(forces[0])), corner)
        with agreed(contacts.network.comm):
            for factor in self._factors:
                data = self._K.data / factor.Omega + self._B.data
                border = self._border_K / factor.Omega + self._border_B if self._bordered else None
                factor.factorise(data, data[self._diagonal], self._rows, border)

    def apply(self, v, rate):
        """Approximate solution (m, unknowns), (m,) for right-hand sides of these shapes, rate on all ranks."""
        comm = self._contacts.network.comm
        harmonics = 1j * self._cycle.harmonics(v)
        last = 1j * self._cycle.harmonics(rate)
        parts = comm.alltoall([harmonics[share] for share in self._shares])
        solved = self._solve(np.column_stack((*parts, last[self._mine])))
        ends = np.cumsum([0, *(part.shape[1] for part in parts)])
        back = [(solved[:, a:b], solved[:, -1]) for a, b in itertools.pairwise(ends)]
        parts = comm.alltoall(back)
        found, last = (np.concatenate(part) for part in zip(*parts, strict=True))
        return self._cycle.samples(found), self._cycle.samples(last)

    def _solve(self, right):
        """Of this rank's harmonics, all unknowns and the strain: (harmonics, size + 1)."""
        u = self._inverse(right.real + right.imag)
        Bu = np.empty_like(u)
        Bu[:, :-1] = (self._B @ u[:, :-1].T).T + u[:, -1:] * self._border_B[:-1]
        Bu[:, -1] = u @ self._border_B
        y = self._inverse(right.imag - Bu)
        return u - y + 1j * y

    def _inverse(self, right):
        solved = [factor.solve(one) for factor, one in zip(self._factor_of, right, strict=True)]
        return np.array(solved).reshape(right.shape)

    def destroy(self):
        """Free the factors."""
        for factor in self._factors:
            factor.destroy()


class _Factor:
    """H = K/Ω + B̄ with its border, factorised, scaled to a unit diagonal; of one rank."""

    def __init__(self, pattern, Omega: float):
        PETSc = current().PETSc
        self.Omega = Omega
        self._csr = pattern.indptr.astype(PETSc.IntType), pattern.indices.astype(PETSc.IntType)
        matrix = PETSc.Mat().createAIJ(pattern.shape, csr=(*self._csr, pattern.data), comm=PETSc.COMM_SELF)
        self._cholesky = Cholesky(matrix, PREFIX, f"K/Ω + B at Ω = {Omega:g}")
        self._right, self._solution = matrix.createVecs()

    def factorise(self, data, diagonal, rows, border):
        """Values of H, those on its diagonal, the row of each value, and the border or None."""
        matrix = self._cholesky.matrix
        if not (diagonal > 0.0).all():  # nan as well
            raise NotPositiveDefinite(f"{self._cholesky.what} is not positive definite")
        scale = 1.0 / np.sqrt(diagonal)
        self._scale, self._border = scale, border
        matrix.setValuesCSR(*self._csr, data * scale[rows] * scale[self._csr[1]])
        matrix.assemble()
        self._cholesky.factorise()
        if border is not None:
            self._response = self._inverse(border[:-1])
            self._corner = border[-1] - border[:-1] @ self._response

    def _inverse(self, right):
        self._right.setArray(self._scale * right)
        self._cholesky.ksp.solve(self._right, self._solution)
        return self._scale * self._solution.getArray()

    def solve(self, right):
        """Unknowns and, last, strain; without a border the strain is 0."""
        x = self._inverse(right[:-1])
        if self._border is None:
            return np.append(x, 0.0)
        strain = (right[-1] - self._border[:-1] @ x) / self._corner
        return np.append(x - strain * self._response, strain)

    def destroy(self):
        for item in (self._cholesky, self._right, self._solution):
            item.destroy()
