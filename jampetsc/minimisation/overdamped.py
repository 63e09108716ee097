"""Steepest descent x' = F(x) of disks in a fixed cell: the overdamped dynamics, to the minimum that it leads to.

Time steps h follow the linearly implicit Euler method (Hairer & Wanner, Solving Ordinary Differential Equations
II, 1996, sec. IV.9), which is stable for any h, and never steps over a saddle:

    (1/h + K) a = F(x),    x' = x + a,    (1/h + K) a' = F(x'),    error ½ (a' − a).

The step follows the error, and the energy decreases in each; it does not grow just after one that failed (Hairer,
Nørsett & Wanner, Solving Ordinary Differential Equations I, 1993, sec. II.4). 1/h + K is factorised at each step; where
it is not definite, disks leave a saddle faster than the step resolves, and the step is shorter.
"""

import math

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.minimisation.ldl import solve
from jampetsc.minimisation.warm_start import factor_of_hessian, is_minimum, moved_on
from jampetsc.packing.contacts import typical_force
from jampetsc.packing.kernel import bond_forces
from jampetsc.packing.neighbour_list import ListedPacking
from jampetsc.packing.neighbours import lengths

MAX_TIME_STEPS = 20_000
ERROR_RATIO = 0.1  # of the overlap of a typical contact: largest error of the place of a disk in one step
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
        self.longest = ERROR_RATIO * overlap
        self.step, self.time, self.steps, self.evaluations = FIRST_STEP / stiffness, 0.0, 0, 0
        super().__init__(disks)

    def list(self, disks):
        """See `ListedPacking`."""
        super().list(disks)
        pairs = self.pairs
        near = lengths(np.stack(pairs.r0, axis=1)) < pairs.sigma + ORDER_GAP * self.diameter
        self.order = self.solver.order(disks.n, pairs.i[near], pairs.j[near])

    def _forces(self, offsets, forces):
        self.evaluations += 1
        return bond_forces(
            self.pairs, offsets, self.cell_strain, self.reference.potential.constants, forces, None, None
        )

    def relax(self, tolerance: float, separated_pressure: float):
        """Follow the descent to a minimum with max |F| ≤ tolerance p d^(D−1), or until no disks touch; the disks there.

        Raises ConvergenceError after MAX_TIME_STEPS.
        """
        shape = self.offsets.shape
        forces, later, a, b, work, moved = (np.zeros(shape) for _ in range(6))
        cross_section, axes = typical_force(self.reference, 1.0), shape[1]
        potential, like = self.reference.potential.constants, self.pairs.r0
        sums = self._forces(self.offsets, forces)
        while self.steps < MAX_TIME_STEPS:
            virial = sums.elastic_xx + sums.elastic_yy + sums.elastic_zz
            pressure = virial / (axes * self.reference.volume)
            rounding = ENERGY_ROUNDING * sums.energy + DISTANCE_ROUNDING * virial
            if pressure < separated_pressure:
                return self.disks
            largest = float(np.sqrt(np.max(np.sum(forces * forces, axis=1))))
            if largest <= tolerance * pressure * cross_section and is_minimum(
                self.order, self.pairs, self.offsets, 0.0, potential, self.stiffness, largest
            ):
                return self.disks
            growth = MAX_RATIO
            while True:
                definite, factor = factor_of_hessian(
                    self.order, self.pairs, self.offsets, 0.0, potential, 1.0 / self.step, 0.0
                )
                ratio = MIN_RATIO
                if definite:
                    solve(factor, forces, a, work)
                    new = self._forces(self.offsets + a, later)
                    solve(factor, later, b, work)
                    error = 0.5 * float(np.max(np.abs(b - a)))
                    ratio = SAFETY * math.sqrt(self.longest / max(error, 1e-300))
                    falls = new.energy <= sums.energy + rounding
                    if error <= self.longest and falls:
                        break
                self.step *= max(min(ratio, 0.5), MIN_RATIO)
                growth = 1.0
                if not self.step * self.stiffness > MIN_STEP:  # rounding alone is left
                    return self.disks
            far = moved_on(self.offsets, self.cell_strain, a, moved, like)
            self.time += self.step
            self.steps += 1
            self.step *= min(ratio, growth)
            forces, later, sums = later, forces, new
            if self.stale(far):
                self.fold()
                sums, like = self._forces(self.offsets, forces), self.pairs.r0
        raise ConvergenceError(f"steepest descent: no minimum after {self.steps} time steps")
