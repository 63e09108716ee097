"""The matrix of a time step: K + B/h + μ of the disks and, if it is free, the strain, factorised.

The strain enters as γL, a length, a border (k, κ) of the matrix A of the disks. With A positive definite, the whole
matrix is if and only if the Schur complement κ + μ − kᵀA⁻¹k is positive. μ is about as small as that allows.
"""

import numpy as np

from jampetsc.minimisation.hessian import Pattern, gathered
from jampetsc.minimisation.warm_start import springs
from jampetsc.oscillation.dashpots import Dashpots
from jampetsc.oscillation.harmonic_preconditioner import FACTOR_PREFIX
from jampetsc.packing.compiled import NUMBERS, compiled
from jampetsc.packing.contacts import both_ends, find_rattlers
from jampetsc.petsc.hessian_solver import HessianSolver

# Least μ in units of k or, in a short step, of the stiffest dashpot over h: without it rounding would move free disks
# far. It changes the steps of Newton's method, not their limit.
MIN_SHIFT = 1e-10
# μ is divided by SHIFT_GROWTH for each new matrix, and multiplied by its square while that is not positive definite
SHIFT_GROWTH = 3.0
# largest diameters: the order of elimination is found as if pairs with a smaller gap touched, to serve for many steps
ORDER_GAP = 0.05
# Unknowns of a rattler that are held: moves, and of a disk its spin. A held spin would slow down spheres that roll
# about two opposite neighbours, where it is far larger than the move.
RATTLER_UNKNOWNS = 3


class StepMatrix:
    """The matrix of some `time_step.StepForces`. Vectors (unknowns + 1,) end with γL, 0 where the strain is imposed.

    factorisations: their number so far; pairs: the pair list of its pattern
    """

    def __init__(self, forces):
        self._solver = HessianSolver(FACTOR_PREFIX, "the matrix of a time step", proves=False)
        self._n, self._dofs, self._diameter = forces.n, forces.dofs, forces.largest
        self._stiffness, self._length, self._mu = forces.stiffness, forces.length, 0.0
        self._load = forces.load
        self.factorisations, self.pairs = 0, None

    def factorise(self, state, dashpots: Dashpots, damping, drag, free: bool):
        """Factorise for the next `solve`, at a `time_step.DiskState`.

        damping     (contacts, damped, damped) df/dz over h
        drag        (dofs,) of the fluid on each disk, over h
        free        whether the strain is unknown: that of a shear, whose flow does not turn disks in a fluid
        """
        n, d, pairs = self._n, self._dofs, state.pairs
        if pairs is not self.pairs:
            self.pairs, self._pattern = pairs, Pattern(pairs, n, d)
            near = state.bonds.overlap > -ORDER_GAP * self._diameter
            self._elimination = self._solver.order(n, pairs.i[near], pairs.j[near])
        elastic, touching = springs(*state.geometry, 0.0, 1.0)
        viscous = dashpots.squares(damping)
        least = MIN_SHIFT * max(self._stiffness, float(np.abs(viscous).max(initial=0.0)))
        self._mu = max(self._mu / SHIFT_GROWTH, least)
        self._border = None
        values = self._pattern.sum(*_sum_blocks(elastic, dashpots.touching, viscous), np.ones(n, bool))
        values[self._pattern.diagonal] += drag + self._mu
        values[self._pattern.diagonal] += self._unheld(state, touching, values)
        while True:
            self.factorisations += 1
            pattern = self._pattern.indptr, self._pattern.indices
            if self._solver.factorise(*pattern, values, d, self._elimination):
                if not free:
                    return
                corner = self._set_border(state.bonds, elastic, dashpots, damping)
                self._response = self._solver.solve(self._border)
                self._schur = corner + self._mu - self._border @ self._response
                if self._schur > least:
                    return
            values[self._pattern.diagonal] += (SHIFT_GROWTH**2 - 1.0) * self._mu
            self._mu *= SHIFT_GROWTH**2

    def _set_border(self, bonds, elastic, dashpots, damping) -> float:
        """Set the border k of the matrix, of γL, and return κ."""
        n, motion = self._n, self._load.imposed(bonds.r.T)
        pull = np.einsum("cab,cb->ca", elastic, motion)
        mixed, alone = dashpots.border(damping)
        border = gathered(mixed, dashpots.i, dashpots.j, n)
        border[:, : bonds.dimension] += bonds.on_disks(pull.T, n)
        self._border = border.ravel() / self._length
        return (float(np.vdot(pull, motion)) + float(np.sum(alone))) / self._length**2

    def solve(self, right):
        """Solution (unknowns + 1,) for a right-hand side (unknowns + 1,)."""
        x = self._solver.solve(right[:-1])
        if self._border is None:
            return np.append(x, 0.0)
        strain = (right[-1] - self._border @ x) / self._schur
        return np.append(x - strain * self._response, strain)

    def _unheld(self, state, touching, values):
        """Stiffness added to rattlers that nothing holds, (N, dofs), else 0: more than the −f/r that pushes them aside.

        A rattler is held if it touches a disk of the backbone and its own block of the matrix is positive definite, as
        dashpots make it in short steps. Stiffness that is not there would let Newton's method converge linearly.
        """
        n, pairs, stiffness = self._n, state.pairs, np.zeros((self._n, self._dofs))
        ends = both_ends(pairs.i[touching], pairs.j[touching])
        rattlers = find_rattlers(n, *ends, len(pairs.r0))
        attached = np.bincount(ends[0], ~rattlers[ends[1]], n) > 0
        maybe_held = rattlers & attached
        least = np.linalg.eigvalsh(self._pattern.own_blocks(values, maybe_held))[:, 0]
        rattlers[maybe_held] = least <= self._mu  # those left are not held
        if rattlers[ends[0]].any():  # nothing pushes the others
            push = state.bonds.force / state.bonds.distance
            aside = gathered(np.column_stack((push, push)), pairs.i, pairs.j, n)
            stiffness[:, :RATTLER_UNKNOWNS] = np.where(rattlers[:, None], 2.0 * aside, 0.0)
        return stiffness


@compiled(NUMBERS)
def _sum_blocks(elastic, touching, viscous):
    """Blocks (M, dofs, dofs) of springs (M, D, D) and, at the pairs `touching`, of dashpots (contacts, 2 dofs, 2 dofs).

    In the rows of i: with i; of j: with j; of i: with j.
    """
    axes, d = elastic.shape[1], viscous.shape[1] // 2
    shape = len(elastic), d, d
    on_i, on_j, across = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for p in range(len(elastic)):
        for x in range(axes):
            for y in range(axes):
                on_i[p, x, y] = on_j[p, x, y] = elastic[p, x, y]
                across[p, x, y] = -elastic[p, x, y]
    for c in range(len(touching)):
        p = touching[c]
        for x in range(d):
            for y in range(d):
                on_i[p, x, y] += viscous[c, x, y]
                on_j[p, x, y] += viscous[c, d + x, d + y]
                across[p, x, y] += viscous[c, x, d + y]
    return on_i, on_j, across
