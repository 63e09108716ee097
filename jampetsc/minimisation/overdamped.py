"""Steepest descent x' = F(x) of disks in a fixed cell: the overdamped dynamics, to the minimum that it leads to.

Short time steps h, as in avalanches where contacts open and close, are explicit (`chebyshev`), and cost less than a
factor of the Hessian. Long ones follow the linearly implicit Euler method (Hairer & Wanner, Solving Ordinary
Differential Equations II, 1996, sec. IV.9), which is stable for any h, and never steps over a saddle:

    (1/h + K) a = F(x),    x' = x + a,    (1/h + K) a' = F(x'),    error ½ (a' − a).

The step follows the error, and the energy decreases in each; it does not grow just after one that failed (Hairer,
Nørsett & Wanner, Solving Ordinary Differential Equations I, 1993, sec. II.4). 1/h + K is factorised at each step; where
it is not definite, disks leave a saddle faster than the step resolves, and the step is shorter.
"""

import math

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.minimisation.chebyshev import chebyshev_step, coefficients, eigenvalue_bound, stages_for
from jampetsc.minimisation.ldl import solve
from jampetsc.minimisation.warm_start import factor_of_hessian, is_minimum
from jampetsc.packing.contacts import typical_force
from jampetsc.packing.kernel import bond_forces
from jampetsc.packing.neighbour_list import ListedPacking
from jampetsc.packing.neighbours import lengths, longest

MAX_TIME_STEPS = 20_000
ERROR_RATIO = 0.1  # of the overlap of a typical contact: largest error of the place of a disk in one step
MAX_STAGES = 80  # of an explicit step; as many forces take longer than a factor of the Hessian and its solves
SKIN = 0.1  # mean diameters, of a list: disks hardly move
SAFETY, MIN_RATIO, MAX_RATIO = 0.8, 0.2, 4.0  # of a step to its predecessor
# Rises of the energy that are rounding: relative; and of Σ f r, as overlaps are differences of distances and radii.
ENERGY_ROUNDING, DISTANCE_ROUNDING = 1e-12, 1e-15
MIN_STEP = 1e-12  # in units of 1 / stiffness
FIRST_STEP = 0.1  # in units of 1 / stiffness
ORDER_GAP = 0.1  # mean diameters: the order of elimination is found as if pairs with a smaller gap touched


class OverdampedDescent(ListedPacking):
    """Disks on their way down; `time` and `steps` count in units of 1/k of the drag 1, and `evaluations` forces."""

    def __init__(self, disks, solver, stiffness: float, overlap: float):
        self.solver, self.stiffness = solver, stiffness
        self.largest_error = ERROR_RATIO * overlap
        self.step, self.time, self.steps, self.evaluations = FIRST_STEP / stiffness, 0.0, 0, 0
        super().__init__(disks, SKIN)
        self._forces, self._later, *self._room = np.zeros((5, *self.offsets.shape))
        self._sums = self._evaluate(self.offsets, self._forces)

    def list(self, disks):
        """See `ListedPacking`."""
        super().list(disks)
        pairs = self.pairs
        near = lengths(np.stack(pairs.r0, axis=1)) < pairs.sigma + ORDER_GAP * self.diameter
        self.order = self.solver.order(disks.n, pairs.i[near], pairs.j[near])

    def _evaluate(self, offsets, forces):
        self.evaluations += 1
        return bond_forces(self.pairs, offsets, self.cell_strain, self._potential, forces, None, None)

    @property
    def _potential(self):
        return self.reference.potential.constants

    def relax(self, tolerance: float, separated_pressure: float):
        """Follow the descent to a minimum with max |F| ≤ tolerance p d^(D−1), or until no disks touch; the disks there.

        Raises ConvergenceError after MAX_TIME_STEPS.
        """
        cross_section, axes = typical_force(self.reference, 1.0), self.offsets.shape[1]
        while self.steps < MAX_TIME_STEPS:
            pressure = self._virial / (axes * self.reference.volume)
            if pressure < separated_pressure:
                return self.disks
            largest = longest(self._forces)
            if largest <= tolerance * pressure * cross_section and is_minimum(
                self.order, self.pairs, self.offsets, 0.0, self._potential, self.stiffness, largest
            ):
                return self.disks
            if not self._advance():  # rounding alone is left
                return self.disks
        raise ConvergenceError(f"steepest descent: no minimum after {self.steps} time steps")

    @property
    def _virial(self):
        return self._sums.elastic_xx + self._sums.elastic_yy + self._sums.elastic_zz

    def _advance(self) -> bool:
        """One time step with an error of at most `largest_error`, in which the energy falls; whether there is one."""
        growth = MAX_RATIO
        rounding = ENERGY_ROUNDING * self._sums.energy + DISTANCE_ROUNDING * self._virial
        largest = eigenvalue_bound(self.pairs, self.offsets, self.cell_strain, self._potential)
        while self.step * self.stiffness > MIN_STEP:
            stages = stages_for(self.step * largest)
            if stages <= MAX_STAGES:
                sums, error, move = self._explicit(stages)
                order = 2
            else:
                sums, error, move = self._implicit()
                order = 1
            is_stale = self.stale(longest(self.offsets + move))
            if is_stale and self.offsets.any():  # once more with a new list, as a contact may be missing
                self.fold()
                self._sums = self._evaluate(self.offsets, self._forces)
                continue
            ratio = SAFETY * (self.largest_error / max(error, 1e-300)) ** (1.0 / (order + 1))
            if error <= self.largest_error and sums.energy <= self._sums.energy + rounding and not is_stale:
                self.offsets += move
                self._sums, self._forces, self._later = sums, self._later, self._forces
                self.time += self.step
                self.steps += 1
                self.step *= min(ratio, growth)
                return True
            self.step *= max(min(ratio, 0.5), MIN_RATIO)
            growth = 1.0
        return False

    def _explicit(self, stages):
        """(sums, error, move) of a step with these stages."""
        self.evaluations += stages
        return chebyshev_step(
            self.pairs, self.offsets, self._forces, self.cell_strain, self._potential,
            self.step, coefficients(stages), *self._room, self._later,
        )  # fmt: skip

    def _implicit(self):
        """(sums, error, move) of an implicit step; the error is infinite where the matrix is not definite."""
        definite, factor = factor_of_hessian(
            self.order, self.pairs, self.offsets, 0.0, self._potential, 1.0 / self.step, 0.0
        )
        move, later, work = self._room
        if not definite:
            move[:] = 0.0
            return self._sums, math.inf, move
        solve(factor, self._forces, move, work)
        sums = self._evaluate(self.offsets + move, self._later)
        solve(factor, self._later, later, work)
        return sums, 0.5 * float(np.max(np.abs(later - move))), move
