"""The factorisations of a rational sweep, and the two ways to use ranks for them.

Together     one factorisation at a time, distributed over all ranks: for matrices that fill more than one rank's memory
SideBySide   every rank holds all of K + sB and factorises a shift of its own: no communication where the time goes
"""

import itertools
from dataclasses import replace

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.mechanics.assembly import Pencil
from jampetsc.response.basis import NEW, RationalBasis
from jampetsc.session import current
from jampetsc.solvers.shifted import ShiftedFactor

SAME_SHIFT = 1.5  # a factor within this ratio of the shift wanted serves instead of a new one
MOST_AT_ONCE = 4  # more shifts at once than a sweep needs would be guesses
ALONE = 400_000  # unknowns up to which one rank is given whole matrices: a factor then takes about 1 GB


def make_factors(pencil: Pencil, parallel: str = "auto"):
    """SideBySide for "shifts", Together for "matrix"; for "auto" what suits the pencil and the ranks. Collective."""
    size = pencil.network.comm.size
    if parallel == "auto":
        parallel = "shifts" if 1 < size <= MOST_AT_ONCE and pencil.unknowns <= ALONE else "matrix"
    return SideBySide(pencil) if parallel == "shifts" and size > 1 else Together(pencil)


def _closest(factors, s):
    """The factor whose shift is within SAME_SHIFT of s, or None."""
    return next((factor for factor in factors if 1.0 / SAME_SHIFT < factor.s / s < SAME_SHIFT), None)


class Together:
    """One factor at a time on all ranks. Methods are collective."""

    width = 1  # shifts that are done at once

    def __init__(self, pencil: Pencil):
        self.pencil = pencil
        self.factors: list[ShiftedFactor] = []
        self.count = 0

    def factorise(self, shifts) -> None:
        """Have a factor for each of the shifts."""
        for s in shifts:
            if _closest(self.factors, s) is None:
                self.factors.append(ShiftedFactor(self.pencil, s))
                self.count += 1

    def start(self, s: float) -> RationalBasis:
        """The basis that starts from the field at shift s."""
        return RationalBasis.start(self.pencil, _closest(self.factors, s))

    def extend(self, basis: RationalBasis, shifts, count: int) -> None:
        """Add `count` vectors at each shift."""
        for s in shifts:
            basis.extend(_closest(self.factors, s), count)

    def energies(self, q) -> dict[float, float]:
        """qᵀ(K + sB)⁻¹q for every shift s at hand; q (n_local,)."""
        work = self.pencil.K.createVecRight()
        result = {}
        for factor in self.factors:
            work.setArray(q)
            factor.solve(work, work)
            result[factor.s] = self.pencil.network.sum(float(q @ work.getArray()))
        work.destroy()
        return result

    def destroy(self):
        """Free the factors."""
        for factor in self.factors:
            factor.destroy()


class SideBySide:
    """A shift per rank. Methods are collective.

    Each rank grows a short Krylov chain of its own from the residual of the basis; together the chains span
    what they would have one after the other (parallel rational Krylov, Berljafa & Güttel 2017).
    """

    def __init__(self, pencil: Pencil):
        self.pencil = pencil
        self.comm = pencil.network.comm
        self.width = min(self.comm.size, MOST_AT_ONCE)
        self.count = 0
        self.rows = np.array(self.comm.allgather(pencil.K.getLocalSize()[0]))
        self.whole = _whole(pencil, self._gather)
        self.mine: list[ShiftedFactor] = []
        self.all: list[tuple[float, int]] = []  # (shift, rank that has its factor)

    def _gather(self, local):
        whole = np.empty(self.rows.sum(), local.dtype)
        self.comm.Allgatherv(np.ascontiguousarray(local), (whole, self.rows))
        return whole

    def _owner(self, s):
        return next((rank for at, rank in self.all if 1.0 / SAME_SHIFT < at / s < SAME_SHIFT), None)

    def factorise(self, shifts) -> None:
        """Have a factor for each of the shifts; up to `width` of them take the time of one."""
        new = [s for s in shifts if self._owner(s) is None]
        for s, rank in zip(new, itertools.cycle(range(self.width)), strict=False):
            self.all.append((s, rank))
            self.count += 1
        failure = None
        for s, rank in self.all[len(self.all) - len(new) :]:
            if rank == self.comm.rank:
                try:
                    self.mine.append(ShiftedFactor(self.whole, s))
                except ConvergenceError as error:
                    failure = error
        failures = [error for error in self.comm.allgather(failure) if error is not None]
        if failures:
            raise failures[0]

    def start(self, s: float) -> RationalBasis:
        """The basis that starts from the field at shift s."""
        owner = self._owner(s)
        x0 = first = None
        if owner == self.comm.rank:
            basis = RationalBasis.start(self.whole, _closest(self.mine, s))
            x0, first = basis.x0, basis.first
            basis.destroy()
        first = self.comm.bcast(first, root=owner)
        return RationalBasis(self.pencil, first, self._scatter(x0, owner))

    def extend(self, basis: RationalBasis, shifts, count: int) -> None:
        """Add `count` vectors at each shift; the chains grow at the same time."""
        source = self._gather(basis.residual())
        if basis.complete:
            return
        owners = [self._owner(s) for s in shifts]
        chains = {
            s: self._chain(_closest(self.mine, s), source, count)
            for s, owner in zip(shifts, owners, strict=True)
            if owner == self.comm.rank
        }
        for s, owner in zip(shifts, owners, strict=True):
            mine = chains.get(s)
            at, length = self.comm.bcast(
                (_closest(self.mine, s).s, len(mine)) if mine is not None else None, root=owner
            )
            for step in range(count):
                vector = mine[step] if mine is not None and step < length else None
                if step < length and basis.append(self._scatter(vector, owner), at):
                    continue
                # The chains overlap here: what is new is what the residual of all of them asks for.
                source = self._gather(basis.residual())
                if basis.complete:
                    return
                vector = self._solve(_closest(self.mine, s), source) if owner == self.comm.rank else None
                if not basis.append(self._scatter(vector, owner), at):
                    basis.complete = True
                    return

    def _solve(self, factor, source):
        """(K + sB)⁻¹ of a whole vector with a factor of this rank."""
        x = self.whole.K.createVecRight()
        x.setArray(source)
        factor.solve(x, x)
        solution = x.getArray().copy()
        x.destroy()
        return solution

    def _chain(self, factor, source, count):
        """(K + sB)⁻¹ applied to `source`, then to B times the vector before; each orthonormal in B to the others.

        Ends early where nothing new is found, but for rounding.
        """
        image = self.whole.K.createVecRight()
        x = self.whole.K.createVecRight()
        chain, images = [], []
        for _ in range(count):
            w = self._solve(factor, source)
            x.setArray(w)
            self.whole.B.mult(x, image)
            before = w @ image.getArray()
            for vector, dual in zip(chain, images, strict=True):
                w -= (dual @ w) * vector
            x.setArray(w)
            self.whole.B.mult(x, image)
            if self.whole.law.dofs == 3:
                image.getArray()[2::3] = 0.0  # no torques, see `RationalBasis`
            length2 = w @ image.getArray()
            if not length2 > NEW**2 * before:
                break
            chain.append(w / np.sqrt(length2))
            images.append(image.getArray() / np.sqrt(length2))
            source = images[-1]
        x.destroy()
        image.destroy()
        return chain

    def _scatter(self, whole, owner):
        """This rank's rows of a vector that `owner` has whole."""
        local = np.empty(self.rows[self.comm.rank])
        send = None if whole is None else (np.ascontiguousarray(whole), self.rows)
        self.comm.Scatterv(send, local, root=owner)
        return local

    def energies(self, q) -> dict[float, float]:
        """qᵀ(K + sB)⁻¹q for every shift s at hand; q (n_local,)."""
        whole = self._gather(q)
        work = self.whole.K.createVecRight()
        mine = {}
        for factor in self.mine:
            work.setArray(whole)
            factor.solve(work, work)
            mine[factor.s] = float(whole @ work.getArray())
        work.destroy()
        return {s: energy for part in self.comm.allgather(mine) for s, energy in part.items()}

    def destroy(self):
        """Free the factors and the copy of the pencil."""
        for factor in self.mine:
            factor.destroy()
        self.whole.destroy()


def _whole(pencil: Pencil, gather) -> Pencil:
    """A copy of the pencil that this rank has to itself. Collective."""
    PETSc = current().PETSc
    K, B = (matrix.getRedundantMatrix(pencil.network.comm.size) for matrix in (pencil.K, pencil.B))
    vectors = (
        PETSc.Vec().createWithArray(gather(vector.getArray()), comm=PETSc.COMM_SELF)
        for vector in (pencil.k_gamma, pencil.b_gamma)
    )
    alone = replace(pencil.network, comm=PETSc.COMM_SELF.tompi4py(), first=0, last=pencil.network.n)
    return replace(pencil, network=alone, K=K, B=B, **dict(zip(("k_gamma", "b_gamma"), vectors, strict=True)))
