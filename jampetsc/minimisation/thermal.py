"""Disks at a temperature: Metropolis Monte Carlo moves of one disk at a time, and slow cooling.

A move of a disk chosen at random, by up to `reach` along each axis, is accepted with probability min(1, e^(−ΔU/T));
states then have the Boltzmann weight e^(−U/T), as long as `reach` is not changed (Metropolis et al., J. Chem. Phys. 21,
1087 (1953)). T is in units of energy (k_B = 1). One sweep is N moves.
"""

from typing import NamedTuple

import numpy as np

from jampetsc import interrupts
from jampetsc.packing.bond import added, bond_vector, inner, pair_energy, row, scaled, set_row
from jampetsc.packing.compiled import compiled, nested
from jampetsc.packing.contacts import both_ends
from jampetsc.packing.elementary import exp
from jampetsc.packing.neighbour_list import ListedPacking, NeighbourList, is_stale
from jampetsc.packing.packing import Packing
from jampetsc.packing.strain import UNSTRAINED

SKIN = 0.5  # of the pair list, in mean diameters
LONGEST = 0.25  # reach, in skins: a move from a new list never makes it stale
ACCEPTED = 0.4  # acceptance rate that tuning `reach` aims at
# `Potential.energy_limit` of the temperature in units of k at which cooling ends: overlaps are then a tenth of a per
# mille of σ
COLD = 1e-8


class Around(NamedTuple):
    """Every pair of a half list from both its ends; the ones of disk a are start[a] … start[a + 1] − 1."""

    start: np.ndarray  # (N + 1,)
    other: np.ndarray  # (2M,) the other disk
    bond: np.ndarray  # (2M, D) r0 towards it
    sigma: np.ndarray  # (2M,)

    @classmethod
    def of(cls, pairs: NeighbourList, n: int) -> "Around":
        """For a list of the pairs of n disks."""
        near, other = both_ends(pairs.i, pairs.j)
        order = np.argsort(near, kind="stable")
        start = np.concatenate(([0], np.cumsum(np.bincount(near, minlength=n))))
        bond = np.concatenate((np.stack(pairs.r0, axis=1), -np.stack(pairs.r0, axis=1)))[order]
        return cls(start, other[order].astype(np.int64), bond, np.tile(pairs.sigma, 2)[order])


@compiled(False)
def energy_of(a, place, around, o, potential):
    """Σ V of disk a's contacts if its offset were `place`, a tuple, with offsets o (N, D) of the others."""
    energy = 0.0
    for q in range(around.start[a], around.start[a + 1]):
        b = around.other[q]
        separation = added(row(o, b, place), scaled(-1.0, place))
        r = bond_vector(UNSTRAINED, row(around.bond, q, place), separation)
        energy += pair_energy(r, around.sigma[q], potential)
    return energy


@nested(False)
def _offered(o, a, reach, draw, like):
    """Offset that disk a would have after a move by the random numbers of `draw`; like: a tuple of length D."""
    if len(like) == 3:
        return (
            o[a, 0] + reach * (2.0 * draw[1] - 1.0),
            o[a, 1] + reach * (2.0 * draw[2] - 1.0),
            o[a, 2] + reach * (2.0 * draw[3] - 1.0),
        )
    return o[a, 0] + reach * (2.0 * draw[1] - 1.0), o[a, 1] + reach * (2.0 * draw[2] - 1.0)


@compiled(False)
def _moves(around, potential, o, temperature, reach, stale, draws, like):
    """Moves by the random numbers draws (M, D + 2) until all are done or one would make the list stale.

    stale = (largest σ, skin); like: a tuple of length D. Returns (moves done, moves taken).
    """
    last = draws.shape[1] - 1
    accepted = 0
    for m in range(len(draws)):
        a = min(int(draws[m, 0] * len(o)), len(o) - 1)
        place = _offered(o, a, reach, draws[m], like)
        if is_stale(np.sqrt(inner(place, place)), UNSTRAINED, stale[0], stale[1]):
            return m, accepted
        change = energy_of(a, place, around, o, potential) - energy_of(
            a, row(o, a, like), around, o, potential
        )
        if change <= 0.0 or draws[m, last] < exp(-change / temperature):
            set_row(o, a, place)
            accepted += 1
    return len(draws), accepted


class Thermal(ListedPacking):
    """N disks in a fixed cell that make Monte Carlo moves, with random numbers from a generator.

    `reach` may be set; `sweep(…, tune=True)` keeps the acceptance rate near ACCEPTED.
    """

    def __init__(self, disks: Packing, generator):
        super().__init__(disks, SKIN)
        self.generator = generator
        self.reach = LONGEST * self.skin

    def list(self, disks):
        """See `ListedPacking`."""
        super().list(disks.folded())
        self._around = Around.of(self.pairs, disks.n)

    def sweep(self, temperature: float, tune: bool = False) -> float:
        """One sweep at this temperature; returns the acceptance rate. A Ctrl-C is raised before, see `interrupts`."""
        interrupts.check()
        left = self.generator.random((len(self.offsets), self.reference.dimension + 2))
        potential, accepted = self.reference.potential.constants, 0
        while len(left):
            stale = self.largest, self.skin
            attempted, newly_accepted = _moves(
                self._around, potential, self.offsets, temperature, self.reach, stale, left, self.pairs.r0
            )
            accepted += newly_accepted
            left = left[attempted:]
            if len(left):
                self.fold()
        share = accepted / len(self.offsets)
        if tune:
            longest = LONGEST * self.skin
            self.reach = min(longest, self.reach * exp(share - ACCEPTED))
        return share


def annealed(disks: Packing, temperature: float, rate: float, sweeps: int, generator) -> Packing:
    """Disks after `sweeps` at a temperature, then cooled: ln T falls by `rate` per sweep until T = COLD k."""
    thermal, cold = Thermal(disks, generator), disks.potential.energy_limit(COLD) * disks.potential.k
    for _ in range(sweeps):
        thermal.sweep(temperature, tune=True)
    current = temperature
    while current > cold:
        current *= exp(-rate)
        thermal.sweep(current, tune=True)
    return thermal.disks.folded()
