"""Explicit steps of steepest descent x' = F(x) with many stages: Runge–Kutta–Chebyshev, of second order.

With s stages a step h is stable where h λ ≤ 0.65 s² for every eigenvalue λ of the Hessian: the cost of a step grows as
the root of its length, and no matrix is factorised. Formulas: Sommeijer, Shampine & Verwer, J. Comput. Appl. Math. 88
(1998) 315, with their damping ε = 2/13; here for the move Y_j − Y_0, from which Y_0 drops out. The error of a step is

    ⅘ (Y_s − Y_0) − ⅖ h (F(Y_0) + F(Y_s)).
"""

import math
from functools import cache

import numpy as np

from jampetsc.minimisation.warm_start import springs
from jampetsc.packing.compiled import FAST, NUMBERS, compiled
from jampetsc.packing.kernel import bond_forces

DAMPING = 2.0 / 13.0
STABLE = 2.0 / 3.0 * (1.0 - 2.0 / 15.0 * DAMPING)  # largest h λ of s stages, over s² − 1


def stages_for(length: float) -> int:
    """Least number of stages of a step h, length = h λ with the largest eigenvalue λ."""
    return max(2, math.ceil(math.sqrt(1.0 + length / STABLE)))


@cache
def coefficients(stages: int):
    """(4, s + 1): of stage j for the moves of stages j − 1 and j − 2, then for the forces of j − 1 and of the start."""
    w0 = 1.0 + DAMPING / stages**2
    value, slope, bend = np.zeros((3, stages + 1))  # of the Chebyshev polynomials T_j at w0
    value[:2], slope[1] = (1.0, w0), 1.0
    for j in range(2, stages + 1):
        value[j] = 2.0 * w0 * value[j - 1] - value[j - 2]
        slope[j] = 2.0 * value[j - 1] + 2.0 * w0 * slope[j - 1] - slope[j - 2]
        bend[j] = 4.0 * slope[j - 1] + 2.0 * w0 * bend[j - 1] - bend[j - 2]
    w1 = slope[stages] / bend[stages]
    b = np.full(stages + 1, bend[2] / slope[2] ** 2)
    b[2:] = bend[2:] / slope[2:] ** 2
    result = np.zeros((4, stages + 1))
    result[2, 1] = b[1] * w1
    result[0, 2:] = 2.0 * w0 * b[2:] / b[1:-1]
    result[1, 2:] = -b[2:] / b[:-2]
    result[2, 2:] = 2.0 * w1 * b[2:] / b[1:-1]
    result[3, 2:] = -(1.0 - b[1:-1] * value[1:-1]) * result[2, 2:]
    return result


@compiled(NUMBERS)
def chebyshev_step(pairs, o, forces, strain, potential, h, table, place, move, older, later):
    """(sums, error, move) of a step h from offsets o (N, D), where `forces` are.

    table    of `coefficients`
    place, move, older    (N, D), overwritten
    later    (N, D), to which the forces at the end are written; `sums` are of `bond_forces` there

    error: the largest component of the error of a place; the move (N, D) of the disks is one of the arrays given.
    """
    stages = table.shape[1] - 1
    for k in range(o.shape[0]):
        for c in range(o.shape[1]):
            older[k, c] = 0.0
            move[k, c] = table[2, 1] * h * forces[k, c]
            place[k, c] = o[k, c] + move[k, c]
    stage = 1
    while True:
        sums = bond_forces(pairs, place, strain, potential, later, None, None)
        if stage == stages:
            break
        stage += 1
        of_last, of_older = table[0, stage], table[1, stage]
        of_later, of_first = h * table[2, stage], h * table[3, stage]
        for k in range(o.shape[0]):
            for c in range(o.shape[1]):
                new = of_last * move[k, c] + of_older * older[k, c]
                new += of_later * later[k, c] + of_first * forces[k, c]
                older[k, c] = new
                place[k, c] = o[k, c] + new
        move, older = older, move
    error = 0.0
    for k in range(o.shape[0]):
        for c in range(o.shape[1]):
            off = 0.8 * move[k, c] - 0.4 * h * (forces[k, c] + later[k, c])
            if not abs(off) <= error:
                error = abs(off) if off == off else np.inf
    return sums, error, move


@compiled(FAST)
def eigenvalue_bound(pairs, o, strain, potential):
    """A bound on the eigenvalues of the Hessian at offsets o, without pre-stress, which lowers them.

    By (a − b)² ≤ 2a² + 2b² it is twice the largest norm of Σ k n nᵀ over the contacts of a disk, here by its rows.
    """
    stiffnesses, chosen = springs(pairs, o, strain, potential, 0.0, 0.0)
    axes = o.shape[1]
    own = np.zeros((o.shape[0], axes, axes))
    for p in range(len(chosen)):
        if chosen[p]:
            own[pairs.i[p]] += stiffnesses[p]
            own[pairs.j[p]] += stiffnesses[p]
    largest = 0.0
    for disk in range(o.shape[0]):
        for first in range(axes):
            total = 0.0
            for second in range(axes):
                total += abs(own[disk, first, second])
            largest = max(largest, total)
    return 2.0 * largest
