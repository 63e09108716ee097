"""A pair list seen from each disk: what Monte Carlo moves of one disk at a time need."""

from typing import NamedTuple

import numba
import numpy as np

from jampetsc.contacts.kernel import pair_energy
from jampetsc.contacts.pairs import PairList


class Around(NamedTuple):
    """Every pair of a `PairList` from both its ends; those of disk a are start[a] … start[a + 1] − 1."""

    start: np.ndarray  # (N + 1,)
    other: np.ndarray  # (2M,) the other disk
    bond: np.ndarray  # (2M, 2) r0 towards it
    sigma: np.ndarray  # (2M,)

    @classmethod
    def of(cls, pairs: PairList, n: int) -> "Around":
        """For a list of the pairs of n disks."""
        near, other = np.concatenate((pairs.i, pairs.j)), np.concatenate((pairs.j, pairs.i))
        order = np.argsort(near, kind="stable")
        start = np.concatenate(([0], np.cumsum(np.bincount(near, minlength=n))))
        bond = np.concatenate((pairs.r0.T, -pairs.r0.T))[order]
        return cls(
            start, other[order].astype(np.int64), bond, np.concatenate((pairs.sigma, pairs.sigma))[order]
        )


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def energy_of(a, x, y, around, o, law):
    """Σ V of disk a's contacts if its offset were (x, y), those of the others being o (N, 2)."""
    energy = 0.0
    for q in range(around.start[a], around.start[a + 1]):
        b = around.other[q]
        rx = around.bond[q, 0] + o[b, 0] - x
        ry = around.bond[q, 1] + o[b, 1] - y
        energy += pair_energy(rx, ry, around.sigma[q], law)
    return energy
