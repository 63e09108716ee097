"""Second derivatives of the forces between disks along a straight step, compiled: what bends a curved step.

While w = x_j − x_i + s E r is the relative motion of the ends of a bond, with parts w∥ along and w⊥ across its normal
n, its force f n changes by −k w∥ n + (f/r) w⊥, and at constant stiffness in second order by

    −(k + f/r)/r (|w⊥|² n + 2 w∥ w⊥) .
"""

import numpy as np

from jampetsc.packing.bond import (
    add_to_row,
    added,
    bond_vector,
    difference,
    displace,
    entry,
    inner,
    scaled,
    secant,
    subtract_from_row,
    tangent_ratio,
)
from jampetsc.packing.compiled import NUMBERS, compiled


@compiled(NUMBERS)
def add_curvature(pairs, places, strain, potential, flow, x, growth, on_disks):
    """Add second derivatives of forces to `on_disks` (N, D); returns that of ∂U/∂γ, see `time_step.StepForces`.

    flow: `Strain` of the affine flow of unit rate
    """
    i, j, r0, sigma = pairs.i, pairs.j, pairs.r0, pairs.sigma
    sheared = 0.0
    for p in range(len(i)):
        a, b = i[p], j[p]
        r = bond_vector(strain, entry(r0, p), difference(places, a, b, r0))
        distance = np.sqrt(inner(r, r))
        overlap = sigma[p] - distance
        if not overlap > 0.0:
            continue
        stiffness = secant(overlap, sigma[p], potential)
        k, push = tangent_ratio(overlap, sigma[p], potential) * stiffness, stiffness * overlap / distance
        affine, n = displace(flow, r), scaled(1.0 / distance, r)
        w = added(difference(x, a, b, r0), scaled(growth, affine))
        along = inner(n, w)
        across = added(w, scaled(-along, n))
        stiff = -(k + push) / distance
        bend = added(scaled(stiff * inner(across, across), n), scaled(2.0 * stiff * along, across))
        pull = added(scaled(-k * along, n), scaled(push, across))
        add_to_row(on_disks, b, bend)
        subtract_from_row(on_disks, a, bend)
        sheared -= inner(bend, affine) + 2.0 * inner(pull, displace(flow, w))
    return sheared
