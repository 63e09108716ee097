"""The matrix of a time step: K + B/h + μ of the disks and, if it is free, the strain, factorised.

The strain enters as γL, a length, a border (k, κ) of the matrix A of the disks. With A positive definite, the whole
matrix is if and only if the Schur complement κ + μ − kᵀA⁻¹k is positive. μ is about as small as that allows.
"""

import numpy as np

from jampetsc.laws.forms import CENTRAL_FORMS
from jampetsc.minimisation.hessian import Bonds, Pattern, gathered
from jampetsc.oscillation.dashpots import Dashpots, motion_rows
from jampetsc.oscillation.harmonic_preconditioner import FACTOR_PREFIX
from jampetsc.packing.contacts import both_ends, find_rattlers
from jampetsc.petsc.hessian_solver import NewtonSolver

# Least μ in units of k or, in a short step, of the stiffest dashpot over h: without it rounding would move free disks
# far. It changes the steps of Newton's method, not their limit.
MIN_SHIFT = 1e-10
# μ is divided by SHIFT_GROWTH for each new matrix, and multiplied by its square while that is not positive definite
SHIFT_GROWTH = 3.0
# Unknowns of a rattler that are held: moves, and of a disk its spin. A held spin would slow down spheres that roll
# about two opposite neighbours, where it is far larger than the move.
RATTLER_UNKNOWNS = 3


class StepMatrix:
    """The matrix of some `time_step.StepForces`. Vectors (unknowns + 1,) end with γL, 0 where the strain is imposed.

    factorisations: their number so far; pairs: the pair list of its pattern
    """

    def __init__(self, springs):
        self._solver = NewtonSolver(FACTOR_PREFIX, "the matrix of a time step", proves=False)
        self._n, self._dofs, self._rims = springs.n, springs.dofs, springs.rims
        self._stiffness, self._length, self._mu = springs.stiffness, springs.length, 0.0
        self._load = springs.load
        self.factorisations, self.pairs = 0, None

    def factorise(self, bonds: Bonds, dashpots: Dashpots, damping, drag, free: bool):
        """Factorise for the next `solve`.

        damping     (contacts, damped, damped) df/dz over h
        drag        (dofs,) of the fluid on each disk, over h
        free        whether the strain is unknown: that of a shear, whose flow does not turn disks in a fluid
        """
        n, d, pairs, every = self._n, self._dofs, bonds.pairs, np.ones(self._n, bool)
        weights = bonds.weights
        if pairs is not self.pairs:
            self.pairs, self._pattern = pairs, Pattern(pairs, n, d)
        elastic_rows, elastic_sheared = motion_rows(CENTRAL_FORMS, bonds, self._rims, d, self._load)
        blocks = (weights[:, :, None] * elastic_rows).swapaxes(1, 2) @ elastic_rows
        viscous, mixed, alone = dashpots.squares(damping)
        blocks[dashpots.touching] += viscous
        blocks = blocks[:, :d, :d], blocks[:, d:, d:], blocks[:, :d, d:]
        least = MIN_SHIFT * max(self._stiffness, float(np.abs(viscous).max(initial=0.0)))
        self._mu = max(self._mu / SHIFT_GROWTH, least)
        self._border = None
        values = self._pattern.sum(*blocks, every)
        values[self._pattern.diagonal] += drag + self._mu
        values[self._pattern.diagonal] += self._unheld(bonds, values)
        while True:
            self.factorisations += 1
            if self._solver.factorise(self._pattern.indptr, self._pattern.indices, values):
                if not free:
                    return
                elastic = np.einsum("cf,cfx,cf->cx", weights, elastic_rows, elastic_sheared)
                border = gathered(elastic, pairs.i, pairs.j, n) + gathered(mixed, dashpots.i, dashpots.j, n)
                self._border = border.ravel() / self._length
                corner = np.sum(weights * elastic_sheared**2) + np.sum(alone)
                self._response = self._solver.solve(self._border)
                self._schur = corner / self._length**2 + self._mu - self._border @ self._response
                if self._schur > least:
                    return
            values[self._pattern.diagonal] += (SHIFT_GROWTH**2 - 1.0) * self._mu
            self._mu *= SHIFT_GROWTH**2

    def solve(self, right):
        """Solution (unknowns + 1,) for a right-hand side (unknowns + 1,)."""
        x = self._solver.solve(right[:-1])
        if self._border is None:
            return np.append(x, 0.0)
        strain = (right[-1] - self._border @ x) / self._schur
        return np.append(x - strain * self._response, strain)

    def _unheld(self, bonds, values):
        """Stiffness added to rattlers that nothing holds, (N, dofs), else 0: more than the −f/r that pushes them aside.

        A rattler is held if it touches a disk of the backbone and its own block of the matrix is positive definite, as
        dashpots make it in short steps. Stiffness that is not there would let Newton's method converge linearly.
        """
        n, (i, j), touching = self._n, (bonds.pairs.i, bonds.pairs.j), bonds.overlap > 0.0
        ends = both_ends(i[touching], j[touching])
        rattlers = find_rattlers(n, *ends, bonds.dimension)
        attached = np.bincount(ends[0], ~rattlers[ends[1]], n) > 0
        least = np.full(n, -np.inf)
        least[rattlers] = np.linalg.eigvalsh(self._pattern.own_blocks(values, rattlers))[:, 0]
        unheld = rattlers & ~(attached & (least > self._mu))
        push = bonds.force / bonds.distance
        aside = gathered(np.column_stack((push, push)), i, j, n)
        return np.where(unheld[:, None] & (np.arange(self._dofs) < RATTLER_UNKNOWNS), 2.0 * aside, 0.0)
