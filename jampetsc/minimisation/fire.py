"""FIRE: damped dynamics, for the first relaxation of a random start in its cell.

A random start is far from any minimum, and the path decides which minimum is found: L-BFGS, with its long steps, gives
denser packings (φ + 0.0004 at p = 1e-4, N = 1024) than motion that follows the forces.

Bitzek et al., PRL 97, 170201 (2006), in the form of Guénolé et al., Comput. Mater. Sci. 175, 109584 (2020).
"""

from typing import NamedTuple

import numpy as np

from jampetsc.minimisation.descent import Descent
from jampetsc.minimisation.lbfgs import CONVERGED, MORE, STALE
from jampetsc.packing.compiled import FAST, compiled, nested
from jampetsc.packing.kernel import block_room, domain_forces
from jampetsc.packing.neighbour_list import is_stale
from jampetsc.packing.strain import UNSTRAINED
from jampetsc.packing.threads import meet

STEP = 0.5  # largest time step, in units of √(m/k): the stiffest mode, ω² ≈ 8–12 k/m, is stable up to 0.6
DELAY = 20  # steps downhill before the time step grows
MIXING = 0.1
SLICE = 2000  # evaluations between two adjustments of the skin


class Motion(NamedTuple):
    """Disks in motion; rows as in `lbfgs_kernels.LbfgsArrays`."""

    offsets: np.ndarray  # (N', D)
    velocities: np.ndarray  # (N', D)
    forces: np.ndarray  # (N', D)
    sums: np.ndarray  # (D, 4) each domain's max |F component|, f · v, f · f, v · v
    reaches: np.ndarray  # (D,) each domain's longest offset


class Clock(NamedTuple):
    """Time step, share of the velocity turned into the force, and steps downhill since the last one uphill."""

    step: float
    mixing: float
    downhill: int


@nested(FAST, forceinline=True)
def _sums(f, v, sums):
    top = fv = ff = vv = 0.0
    for q in range(len(f)):
        size = abs(f[q])
        top = size if size > top else top
        fv += f[q] * v[q]
        ff += f[q] * f[q]
        vv += v[q] * v[q]
    sums[0], sums[1], sums[2], sums[3] = top, fv, ff, vv


@nested(FAST, forceinline=True)
def _move(o, v, f, keep, push, step, back):
    """v ← keep v + push f, o ← o + step v − back v_old; returns max |o|."""
    far = 0.0
    for q in range(len(o)):
        old = v[q]
        new = keep * old + push * f[q]
        here = o[q] + step * new - back * old
        v[q] = new
        o[q] = here
        size = abs(here)
        far = size if size > far else far
    return far


@compiled(False, nogil=True)
def _fall(me, threads, counter, domains, motion, potential, skin, force, steps, clock, longest):
    """Steps of FIRE by thread `me` of `threads` until max |F| ≤ force, a stale list, or `steps` are done.

    longest: largest time step. Returns (status, evaluations, clock).
    """
    number = len(domains.across)
    first, last = me * number // threads, (me + 1) * number // threads
    o, v, f = motion.offsets.reshape(-1), motion.velocities.reshape(-1), motion.forces.reshape(-1)
    axes = motion.offsets.shape[1]
    diagonal = np.sqrt(float(axes))  # of a cube, in its sides: |F| ≤ diagonal · max |F component|
    step, mixing, downhill = clock
    status, done, room = MORE, 0, block_room(axes)
    while done < steps:
        for d in range(first, last):
            domain_forces(domains, d, motion.offsets, UNSTRAINED, potential, motion.forces, None, None, room)
            here = slice(axes * domains.disks[d], axes * domains.disks[d + 1])
            _sums(f[here], v[here], motion.sums[d])
        meet(counter, threads)
        done += 1
        top = fv = ff = vv = 0.0
        for d in range(number):
            top = max(top, motion.sums[d, 0])
            fv += motion.sums[d, 1]
            ff += motion.sums[d, 2]
            vv += motion.sums[d, 3]
        if diagonal * top <= force:
            status = CONVERGED
            break
        if fv > 0.0:
            downhill += 1
            if downhill > DELAY:
                step = min(1.1 * step, longest)
                mixing *= 0.99
            keep, push, back = 1.0 - mixing, step + mixing * np.sqrt(vv / ff), 0.0
        else:  # go half a step back, stop, and start again more slowly
            back = 0.5 * step
            step, mixing, downhill = max(0.5 * step, 0.02 * longest), MIXING, 0
            keep, push = 0.0, step
        for d in range(first, last):
            here = slice(axes * domains.disks[d], axes * domains.disks[d + 1])
            motion.reaches[d] = _move(o[here], v[here], f[here], keep, push, step, back)
        meet(counter, threads)
        far = 0.0
        for d in range(number):
            far = max(far, motion.reaches[d])
        if is_stale(diagonal * far, UNSTRAINED, 0.0, skin):
            status = STALE
            break
    return status, done, Clock(step, mixing, downhill)


def fire_descent(descent: Descent, force: float, evaluations: int) -> bool:
    """Move the disks of `descent` in their cell until max |F| ≤ force; False if `evaluations` did not suffice."""
    shape = descent.space.offsets.shape
    number = descent.domains.number
    motion = Motion(
        descent.space.offsets, np.zeros(shape), np.zeros(shape), np.zeros((number, 4)), np.zeros(number)
    )
    clock = None
    budget = descent.evaluations + evaluations
    while True:
        longest = STEP / np.sqrt(descent.stiffest())
        clock = clock or Clock(0.2 * longest, MIXING, 0)
        status, done, clock = descent.team.run(
            _fall,
            number,
            *(descent.domains, motion, descent.potential.constants, descent.skin, float(force)),
            *(min(SLICE, budget - descent.evaluations), clock, longest),
        )
        descent.served(done, status == STALE)
        if status == CONVERGED or descent.evaluations >= budget:
            return status == CONVERGED
