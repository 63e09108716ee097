"""The factorisations of a rational sweep, and the two ways to use ranks for them.

Distributed  one factorisation at a time, distributed over all ranks: for matrices that fill more than one rank's memory
SideBySide   every rank holds all of K + sB and factorises a shift of its own: no communication where the time goes
"""

import itertools

import numpy as np

from jampetsc.collective import agreed
from jampetsc.linear.basis import RationalBasis, field_at
from jampetsc.mechanics.assembly import Pencil
from jampetsc.petsc.session import current
from jampetsc.petsc.shifted import ShiftedFactor, shifted

SAME_SHIFT = 1.5  # a factor within this ratio of the shift wanted serves instead of a new one
MOST_AT_ONCE = 4  # shifts at the same time; a sweep needs few, and where to put more would be guessed
SHARE = 0.25  # of the memory, for factors: the basis and its projection take as much or more
BYTES = 60.0  # of a factor and its matrix per n log₂ n, n unknowns: 60 to 61 at N = 32768 to 900 000
ALONE = 400_000  # unknowns up to which every rank holds whole matrices: a factor then takes about 1 GB


def make_factors(pencil: Pencil, parallel: str = "auto"):
    """SideBySide for "shifts", Distributed for "matrix"; "auto" chooses by number of unknowns and ranks. Collective."""
    size = pencil.network.comm.size
    if parallel == "auto":
        parallel = "shifts" if 1 < size <= MOST_AT_ONCE and pencil.unknowns <= ALONE else "matrix"
    return SideBySide(pencil) if parallel == "shifts" and size > 1 else Distributed(pencil)


def most_held(pencil: Pencil) -> int:
    """How many factors of K + sB, shared by all ranks, fit into SHARE of the memory: at least one. Collective."""
    n = pencil.unknowns
    room = SHARE * pencil.network.sum(current().memory())
    return max(1, int(room / (BYTES * n * np.log2(n))))


def _named(s):
    return f"K + sB at s = {s:g}"


def _new_factor(pencil, s):
    """The factor of K + sB."""
    project = pencil.project if pencil.law.holds_translations else None
    return ShiftedFactor(shifted(pencil.K, pencil.B, s), _named(s), project)


def closest(shifts, s):
    """The first of the shifts that is within SAME_SHIFT of s, or None."""
    return next((at for at in shifts if 1.0 / SAME_SHIFT < at / s < SAME_SHIFT), None)


class Distributed:
    """One factor at a time on all ranks. Methods are collective.

    As many are kept as fit into `SHARE` of the memory; others are freed, and made again when they are needed.
    """

    width = 1  # number of shifts factorised at the same time

    def __init__(self, pencil: Pencil):
        self.pencil = pencil
        self.shifts: list[float] = []  # of all factors, freed ones included
        self._held: dict[float, ShiftedFactor] = {}  # factors in memory, the one used last at the end
        self._most = most_held(pencil)

    def _factor(self, s):
        """The factor of K + sB."""
        factor = self._held.pop(s, None)
        if factor is None and len(self._held) == self._most:
            factor = self._held.pop(next(iter(self._held)))
            factor.renew(self.pencil.K, self.pencil.B, s, _named(s))
        self._held[s] = factor or _new_factor(self.pencil, s)
        return self._held[s]

    def factorise(self, shifts) -> None:
        """Make sure that each shift has a factor near it."""
        for s in shifts:
            if closest(self.shifts, s) is None:
                self._factor(s)
                self.shifts.append(s)

    def field(self, s: float):
        """(shift, x): the field x (n_local,) at the shift next to s that there is a factor of, see `field_at`."""
        s = closest(self.shifts, s)
        return s, field_at(self.pencil, self._factor(s), s)

    def extend(self, basis: RationalBasis, shifts, count: int) -> None:
        """Add `count` vectors at each shift."""
        for s in shifts:
            at = closest(self.shifts, s)
            basis.extend(self._factor(at), at, count)

    def energies(self, v) -> dict[float, tuple[float, float]]:
        """vᵀ(K + sB)⁻¹v for every shift s there is, as `ShiftedFactor.energy` has it; v (n_local,)."""
        rhs = self.pencil.K.createVecRight()
        rhs.setArray(v)
        held = list(self._held)  # first, before they make room for the others
        found = {s: self._factor(s).energy(rhs) for s in sorted(self.shifts, key=lambda s: s not in held)}
        return {s: found[s] for s in self.shifts}

    def least_eigenvalue(self, s: float) -> float:
        """That of K + sB scaled to a unit diagonal, see `Cholesky.least_eigenvalue`; s one of `shifts`."""
        return self._factor(s).least_eigenvalue()


class SideBySide:
    """A shift per rank. Methods are collective; what fails on one rank is raised on all.

    Each rank grows a short Krylov chain of its own from the residual of the basis; together the chains span
    what they would have one after the other (parallel rational Krylov, Berljafa & Güttel 2017).
    """

    def __init__(self, pencil: Pencil):
        self.pencil = pencil
        self.comm = pencil.network.comm
        self.width = min(self.comm.size, MOST_AT_ONCE)
        self.rows = np.array(self.comm.allgather(pencil.K.getLocalSize()[0]))
        self.whole = pencil.gathered()
        self.mine: dict[float, ShiftedFactor] = {}
        self.owner: dict[float, int] = {}  # rank that has the factor of a shift

    @property
    def shifts(self) -> list[float]:
        """Shifts of the present factors."""
        return list(self.owner)

    def _gather(self, local):
        whole = np.empty(self.rows.sum(), local.dtype)
        self.comm.Allgatherv(np.ascontiguousarray(local), (whole, self.rows))
        return whole

    def _scatter(self, whole, owner):
        """This rank's rows of a vector that `owner` has whole."""
        local = np.empty(self.rows[self.comm.rank])
        send = None if whole is None else (np.ascontiguousarray(whole), self.rows)
        self.comm.Scatterv(send, local, root=owner)
        return local

    def factorise(self, shifts) -> None:
        """Make sure that each shift has a factor near it; up to `width` new ones are made at the same time."""
        new = [s for s in shifts if closest(self.owner, s) is None]
        self.owner |= dict(zip(new, itertools.cycle(range(self.width)), strict=False))
        with agreed(self.comm):
            for s in new:
                if self.owner[s] == self.comm.rank:
                    self.mine[s] = _new_factor(self.whole, s)

    def field(self, s: float):
        """(shift, x): the field x (n_local,) at the shift next to s that there is a factor of, see `field_at`."""
        s = closest(self.owner, s)
        x = self._by_owner(s, lambda factor: field_at(self.whole, factor, s))
        return s, self._scatter(x, self.owner[s])

    def extend(self, basis: RationalBasis, shifts, count: int) -> None:
        """Add `count` vectors at each shift; the chains grow at the same time."""
        q, more = basis.residual()
        if basis.complete or not more:
            basis.complete = True
            return
        shifts = [closest(self.owner, s) for s in shifts]
        source = self._gather(q)
        with agreed(self.comm):
            chains = {s: self._chain(s, source, count) for s in shifts if s in self.mine}
        for s in shifts:
            chain = chains.get(s, [])
            length = self.comm.bcast(len(chain), root=self.owner[s])
            for step in range(count):
                vector = chain[step] if step < len(chain) else None
                if step < length and basis.append(self._scatter(vector, self.owner[s]), s):
                    continue
                # The chains overlap here: what is new is what the residual of all of them asks for.
                q, more = basis.residual()
                if not more or not basis.append(self._solve(s, q), s):
                    basis.complete = True
                    return

    def _solve(self, s, right):
        """(K + sB)⁻¹ of a distributed vector, by the rank that has the factor."""
        whole = self._gather(right)
        x = self._by_owner(s, lambda factor: self._solve_whole(factor, whole))
        return self._scatter(x, self.owner[s])

    def _by_owner(self, s, action):
        """What a function finds with the factor of s, on the rank that has it; None on the others."""
        with agreed(self.comm):
            return action(self.mine[s]) if s in self.mine else None

    def _solve_whole(self, factor, source):
        x = self.whole.K.createVecRight()
        x.setArray(source)
        factor.solve(x, x)
        return x.getArray()

    def _chain(self, s, source, count):
        """Vectors (m, unknowns): (K + sB)⁻¹ applied to `source`, then to B times the vector before, orthonormal in B.

        Ends early where nothing new is found, but for rounding.
        """
        basis = RationalBasis(self.whole, np.inf, np.zeros(len(source)))
        for _ in range(count):
            if not basis.append(self._solve_whole(self.mine[s], source), s):
                break
            source = basis.images[-1]
        return basis.vectors

    def energies(self, v) -> dict[float, tuple[float, float]]:
        """vᵀ(K + sB)⁻¹v for every shift s at hand, as `ShiftedFactor.energy` has it; v (n_local,)."""
        rhs = current().PETSc.Vec().createWithArray(self._gather(v), comm=current().PETSc.COMM_SELF)
        with agreed(self.comm):
            mine = {s: factor.energy(rhs) for s, factor in self.mine.items()}
        return {s: energy for part in self.comm.allgather(mine) for s, energy in part.items()}

    def least_eigenvalue(self, s: float) -> float:
        """That of K + sB scaled to a unit diagonal, see `Cholesky.least_eigenvalue`; s a shift at hand."""
        found = self._by_owner(s, lambda factor: factor.least_eigenvalue())
        return self.comm.bcast(found, root=self.owner[s])
