"""The matrix of a time step: K + B/h + μ of disks and, where it is free, of the strain, factorised.

The strain enters as γL, L = √V, a border (k, κ) of the disks' matrix A: its Schur complement κ + μ − kᵀA⁻¹k is positive
if and only if the whole is positive definite, as A is. μ is no larger than it takes for that.
"""

import numpy as np

from jampetsc.core.pairs import PairList
from jampetsc.core.state import both_ends, find_rattlers
from jampetsc.minimise.hessian import Bonds, Pattern
from jampetsc.oscillation.dashpots import Dashpots, gathered, motion_rows
from jampetsc.petsc.local import NewtonSolver

# of k or, in a short step, of what is stiffest: least μ on the diagonal, for what nothing holds, which rounding would
# move far; it changes steps, not where they end
HELD = 1e-10
RAISED = 3.0


class StepMatrix:
    """Of one packing; vectors (unknowns + 1,) have γL at their end, 0 where the strain is imposed.

    unit         stiffness of a contact, roughly
    length       L
    """

    def __init__(self, prefix: str, unit: float, length: float):
        self._solver = NewtonSolver(prefix, "the matrix of a time step", proves=False)
        self._unit, self._length, self._mu = unit, length, 0.0
        self.factorisations = 0

    def list(self, pairs: PairList, radii, dofs: int):
        """From now on the bonds are those of this list; radii in the length that turns are multiplied by."""
        self._pairs, self._n, self._dofs = pairs, len(radii), dofs
        self._rims = (radii[pairs.i], radii[pairs.j]) if dofs == 3 else None
        self._pattern = Pattern(pairs, len(radii), dofs)

    def factorise(self, bonds: Bonds, dashpots: Dashpots, damping, free: bool):
        """Factorise for the next `solve`.

        damping     (contacts, damped, damped) df/dz over h
        free        whether the strain is unknown
        """
        rows, sheared = motion_rows(bonds.normal.T, bonds.r[1], self._rims)
        springs = np.column_stack((bonds.stiffness, -bonds.force / bonds.distance))
        blocks = np.einsum("cf,cfx,cfy->cxy", springs, rows[:, :2], rows[:, :2])
        viscous, mixed, alone = dashpots.squares(damping)
        blocks[dashpots.touching] += viscous
        d, every, loose = self._dofs, np.ones(self._n, bool), self._loose(bonds)
        blocks = blocks[:, :d, :d], blocks[:, d:, d:], blocks[:, :d, d:]
        held = HELD * max(self._unit, float(np.abs(viscous).max(initial=0.0)))
        self._mu = max(self._mu / RAISED, held)
        self._border = None
        while True:
            self.factorisations += 1
            values = self._pattern.sum(*blocks, every)
            values[self._pattern.diagonal] += self._mu + loose
            if self._solver.factorise(self._pattern.indptr, self._pattern.indices, values):
                if not free:
                    return
                elastic = np.einsum("cf,cfx,cf->cx", springs, rows[:, :2], sheared[:, :2])
                border = gathered(elastic, self._pairs.i, self._pairs.j, self._n)
                border += gathered(mixed, dashpots.i, dashpots.j, self._n)
                self._border = border.ravel() / self._length
                corner = np.sum(springs * sheared[:, :2] ** 2) + np.sum(alone)
                self._response = self._solver.solve(self._border)
                self._schur = corner / self._length**2 + self._mu - self._border @ self._response
                if self._schur > held:
                    return
            self._mu *= RAISED**2

    def solve(self, right):
        """(unknowns + 1,) for such a right-hand side."""
        x = self._solver.solve(right[:-1])
        if self._border is None:
            return np.append(x, 0.0)
        strain = (right[-1] - self._border @ x) / self._schur
        return np.append(x - strain * self._response, strain)

    def _loose(self, bonds):
        """What holds disks that contacts do not, (N, 1): more than the −f/r that pushes them aside."""
        touching = bonds.overlap > 0.0
        i, j = both_ends(self._pairs.i[touching], self._pairs.j[touching])
        push = bonds.force / bonds.distance
        aside = np.bincount(self._pairs.i, push, minlength=self._n)
        aside += np.bincount(self._pairs.j, push, minlength=self._n)
        return np.where(find_rattlers(self._n, i, j), 2.0 * aside, 0.0)[:, None]

    def destroy(self):
        """Free the factor."""
        self._solver.destroy()
