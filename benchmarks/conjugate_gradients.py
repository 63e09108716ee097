"""Nonlinear conjugate gradients: the minimiser of both works, which speeds and states are compared with.

Polak–Ribière, with restarts (Vågberg, thesis sec. 4.7), on the compiled forces of jampetsc.
"""

import numpy as np

from jampetsc.packing.compiled import FAST, compiled
from jampetsc.packing.kernel import bond_forces
from jampetsc.packing.neighbour_list import NeighbourList, is_stale
from jampetsc.packing.packing import deformed
from jampetsc.packing.strain import UNSTRAINED


@compiled(FAST, cache=False)
def conjugate_gradients(pairs, listed, law, o, f, d, state, goal, most):
    """Steps of Polak–Ribière with a secant along each direction; state = (slope before, |F|² before, last length).

    Returns (there, evaluations); not there: the list is stale, or `most` are spent.
    """
    n = len(o)
    trial, ahead = np.empty_like(o), np.empty_like(f)
    bond_forces(pairs, o, UNSTRAINED, law, f, None, None)
    evaluations = 1
    fresh = state[1] == 0.0
    while evaluations < most:
        top = 0.0
        for k in range(n):
            top = max(top, f[k, 0] ** 2 + f[k, 1] ** 2)
        if top <= goal * goal:
            return True, evaluations
        if fresh:
            d[:] = f
            fresh = False
        slope = np.sum(f * d)
        if slope <= 0.0:
            d[:] = f
            slope = np.sum(f * d)
        length = state[2]
        for k in range(n):
            for axis in range(2):
                trial[k, axis] = o[k, axis] + length * d[k, axis]
        bond_forces(pairs, trial, UNSTRAINED, law, ahead, None, None)
        evaluations += 1
        end = np.sum(ahead * d)
        if abs(end) > 0.1 * slope:  # to where the secant of the slope ends
            better = length * min(max(slope / (slope - end), 0.1), 10.0) if slope > end else 2.0 * length
            for k in range(n):
                for axis in range(2):
                    trial[k, axis] = o[k, axis] + better * d[k, axis]
            bond_forces(pairs, trial, UNSTRAINED, law, ahead, None, None)
            evaluations += 1
            length = better
        state[2] = length
        turn = max(np.sum(ahead * (ahead - f)) / np.sum(f * f), 0.0)
        far = 0.0
        for k in range(n):
            for axis in range(2):
                o[k, axis] = trial[k, axis]
                f[k, axis] = ahead[k, axis]
                d[k, axis] = f[k, axis] + turn * d[k, axis]
            far = max(far, o[k, 0] ** 2 + o[k, 1] ** 2)
        if is_stale(np.sqrt(far), UNSTRAINED, listed[0], listed[1]):
            break
    state[1] = 1.0
    return False, evaluations


def conjugate(disks, goal, most):
    """(disks, evaluations) of nonlinear CG, to max |F| ≤ goal or until `most` are spent."""
    widest, evaluations = 2.0 * float(disks.radii.max()), 0
    d, f, state = np.empty((disks.n, 2)), np.empty((disks.n, 2)), np.array([0.0, 0.0, 0.5])
    while evaluations < most:
        pairs, o = NeighbourList.build(disks, 0.4), np.zeros((disks.n, 2))
        there, more = conjugate_gradients(
            pairs, (widest, 0.4), disks.potential.constants, o, f, d, state, goal, most - evaluations
        )
        evaluations += more
        disks = deformed(disks, o, UNSTRAINED)
        if there:
            break
    return disks, evaluations
