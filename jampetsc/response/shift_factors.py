"""The factorisations of a rational sweep, and the two ways to use ranks for them.

shared        one factorisation at a time, by all ranks: for matrices that fill more than the memory of one
side by side  every rank holds all of K + sB and factorises a shift of its own: no communication where the time goes
"""

import itertools
from types import SimpleNamespace

import numpy as np

from jampetsc.collective import agreed
from jampetsc.petsc import spin_split
from jampetsc.petsc.session import current
from jampetsc.petsc.shifted import PREFIX, ShiftedFactor, shifted
from jampetsc.response.assembly import Pencil
from jampetsc.response.factor_memory import factor_bytes, require_memory
from jampetsc.response.krylov_basis import RationalBasis, field_at

SAME_SHIFT = 1.5  # a factor within this ratio of the shift wanted serves instead of a new one
MOST_AT_ONCE = 4  # shifts at the same time; a sweep needs few, and where to put more would be guessed
# of the memory, by D, for factors: in two dimensions the basis and its projection take as much or more
FACTOR_MEMORY_SHARE = {2: 0.25, 3: 0.5}
# of spheres, from which on spins are left out of factors, as a sweep then takes no more time and less memory
MIN_SPLIT_UNKNOWNS = 90_000
MAX_SLIDING_RATIO = (
    10.0  # weight of sliding over that of normal motion, in K and in B, up to which iterations are few
)
ALONE_BYTES = factor_bytes(2, 400_000)  # of a factor, up to which every rank holds whole matrices


def side_by_side(ranks: int, factor_size: float, parallel: str) -> bool:
    """Whether each rank has shifts of its own: for "shifts", and for "auto" with few ranks and small factors."""
    small = ranks <= MOST_AT_ONCE and factor_size <= ALONE_BYTES
    return ranks > 1 and (parallel == "shifts" or (parallel == "auto" and small))


def splits_spins(pencil: Pencil) -> bool:
    """Whether K + sB is solved with by a factor of its displacements alone, see `spin_split`."""
    law, large = pencil.law, pencil.dimension == 3 and pencil.unknowns >= MIN_SPLIT_UNKNOWNS
    gains = large and law.sliding <= MAX_SLIDING_RATIO * law.normal
    gains &= pencil.network.tangential_stiffness <= MAX_SLIDING_RATIO
    return pencil.rolls and spin_split.is_requested(PREFIX, gains)


def factored_unknowns(pencil: Pencil) -> int:
    """Number of unknowns of which a factor of K + sB is made."""
    return pencil.network.n * pencil.dimension if splits_spins(pencil) else pencil.unknowns


def bytes_of_factor(pencil: Pencil) -> float:
    """Bytes of a factor of K + sB, about."""
    unknowns = factored_unknowns(pencil)
    return factor_bytes(pencil.dimension, unknowns, max(1, unknowns // pencil.network.n))


def most_held(pencil: Pencil) -> int:
    """How many factors of K + sB, shared by all ranks, fit into SHARE of the memory: at least one. Collective."""
    room = FACTOR_MEMORY_SHARE[pencil.dimension] * pencil.network.sum(current().memory())
    return max(1, int(room / bytes_of_factor(pencil)))


def _named(s):
    return f"K + sB at s = {s:g}"


def _new_factor(pencil, s):
    """The factor of K + sB."""
    project = pencil.project if pencil.projects else None
    spins = pencil.spins if splits_spins(pencil) else None
    return ShiftedFactor(shifted(pencil.K, pencil.B, s, pencil.inertia), _named(s), project, spins)


def closest(shifts, s):
    """The first of the shifts that is within SAME_SHIFT of s, or None."""
    return next((at for at in shifts if 1.0 / SAME_SHIFT < at / s < SAME_SHIFT), None)


class Factors:
    """Factors of K + sB at some shifts. Methods are collective; what fails on one rank is raised on all.

    Of those that all ranks share as many are kept as fit into `FACTOR_MEMORY_SHARE` of the memory; others are freed,
    and made again when they are needed. Side by side each rank grows a short Krylov chain of its own from
    the residual of the basis; together they span what they would have one after the other (parallel rational Krylov,
    Berljafa & Güttel 2017).

    parallel   "shifts" (side by side), "matrix" (shared) or "auto"
    width      number of shifts factorised at the same time
    held       {shift: `ShiftedFactor`} of those in this rank's memory, the one used last at the end
    """

    def __init__(self, pencil: Pencil, parallel: str = "auto"):
        self.pencil, self.comm = pencil, pencil.network.comm
        self._alone = side_by_side(self.comm.size, bytes_of_factor(pencil), parallel)
        self.width = min(self.comm.size, MOST_AT_ONCE) if self._alone else 1
        self.rows = np.array(self.comm.allgather(pencil.K.getLocalSize()[0]))
        with agreed(self.comm):
            self.whole = pencil.gathered() if self._alone else pencil  # what is factorised
            require_memory(self.whole.network, factored_unknowns(pencil), PREFIX)
        self.owner: dict[float, int] = {}  # rank that has the factor of a shift; 0 if all share it
        self._least: dict[float, float] = {}  # least eigenvalues, which do not depend on the load
        self.held: dict[float, ShiftedFactor] = {}
        self._most = np.inf if self._alone else most_held(pencil)

    @property
    def shifts(self) -> list[float]:
        """Shifts of all factors, freed ones included."""
        return list(self.owner)

    def _is_mine(self, s):
        return not self._alone or self.owner[s] == self.comm.rank

    def factor(self, s):
        """The factor of K + sB at one of `shifts`."""
        factor = self.held.pop(s, None)
        if factor is None and len(self.held) == self._most:
            factor = self.held.pop(next(iter(self.held)))
            factor.renew(self.whole.K, self.whole.B, s, _named(s), self.whole.inertia)
        self.held[s] = factor or _new_factor(self.whole, s)
        return self.held[s]

    def _by_owner(self, s, action):
        """What a function finds with the factor of s, on the ranks that have it; None on the others."""
        with agreed(self.comm):
            return action(self.factor(s)) if self._is_mine(s) else None

    def _gather(self, local):
        """All rows of a vector, as the factors have them."""
        if not self._alone:
            return local
        whole = np.empty(self.rows.sum(), local.dtype)
        self.comm.Allgatherv(np.ascontiguousarray(local), (whole, self.rows))
        return whole

    def _scatter(self, whole, owner):
        """This rank's rows of a vector that `owner` has whole."""
        if not self._alone:
            return whole
        local = np.empty(self.rows[self.comm.rank])
        send = None if whole is None else (np.ascontiguousarray(whole), self.rows)
        self.comm.Scatterv(send, local, root=owner)
        return local

    def factorise(self, shifts) -> None:
        """Make sure that each shift has a factor near it; up to `width` new ones are made at the same time."""
        new = [s for s in shifts if closest(self.owner, s) is None]
        self.owner |= dict(zip(new, itertools.cycle(range(self.width)), strict=False))
        with agreed(self.comm):
            for s in filter(self._is_mine, new):
                self.factor(s)

    def field(self, pencil: Pencil, s: float):
        """(shift, x): the field x (n_local,) at the shift next to s that there is a factor of, see `field_at`.

        pencil   with the load; its K and B are as in the factors
        """
        s = closest(self.owner, s)
        columns = SimpleNamespace(k_gamma=self._column(pencil.k_gamma), b_gamma=self._column(pencil.b_gamma))
        x = self._by_owner(s, lambda factor: field_at(columns, factor, s))
        return s, self._scatter(x, self.owner[s])

    def _column(self, vector):
        """All entries of a load column, as the factors have them."""
        if not self._alone:
            return vector
        whole = self.whole.K.createVecRight()
        whole.setArray(self._gather(vector.getArray()))
        return whole

    def extend(self, basis: RationalBasis, shifts, count: int) -> None:
        """Add `count` vectors at each shift; side by side their chains grow at the same time."""
        shifts = [closest(self.owner, s) for s in shifts]
        if not self._alone:
            for s in shifts:
                basis.extend(self.factor(s), s, count)
            return
        q, more = basis.residual()
        if basis.complete or not more:
            basis.complete = True
            return
        source = self._gather(q)
        with agreed(self.comm):
            chains = {s: self._chain(s, source, count) for s in filter(self._is_mine, shifts)}
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
            if not basis.append(self._solve_whole(self.factor(s), source), s):
                break
            source = basis.images[-1]
        return basis.vectors

    def energies(self, v) -> dict[float, tuple[float, float]]:
        """vᵀ(K + sB)⁻¹v for each of `shifts`, as `ShiftedFactor.energy` has it; v (n_local,)."""
        rhs = self.whole.K.createVecRight()
        rhs.setArray(self._gather(v))
        kept = list(self.held)  # first, before they make room for the others
        own = sorted(filter(self._is_mine, self.shifts), key=lambda s: s not in kept)
        with agreed(self.comm):
            energies = {s: self.factor(s).energy(rhs) for s in own}
        current().free_dropped(self.comm)  # vectors of the solves, of which a certificate may need many
        every = {s: energy for part in self.comm.allgather(energies) for s, energy in part.items()}
        return {s: every[s] for s in self.shifts}

    def least_eigenvalue(self, s: float) -> float:
        """That of K + sB scaled to a unit diagonal, see `cholesky.least_eigenvalue`; s one of `shifts`."""
        if s not in self._least:
            least = self._by_owner(s, lambda factor: factor.least_eigenvalue())
            self._least[s] = self.comm.bcast(least, root=self.owner[s])
        return self._least[s]
