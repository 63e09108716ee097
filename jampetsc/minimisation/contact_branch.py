"""Equilibrium of a fixed set of contacts under a load, compiled: its forces, its tangent, and Newton's method on it.

Which pairs touch is given, not read off their overlaps: between two changes of contacts the positions x(γ) at rest are
then smooth, also a little beyond the changes, whose strains are roots of overlaps on that curve. A pair in the set has
the force f = s(max(δ, 0)) δ with the secant stiffness s of the potential: for a harmonic contact the same line where
δ < 0. With M = k n nᵀ − (f/r) (1 − n nᵀ) of a bond r = F (r0 + o_j − o_i), and moves u of disks in the laboratory,

    ∂²U/∂u∂u = K, blocks M,      −∂²U/∂u∂γ = b, on j: −M L r,      dx/dγ = K⁻¹ b,
    dδ/dγ = −n · (dx_j/dγ − dx_i/dγ + L r).

The cell is strained by F = 1 + γ G since the list, G the gradient of the load there, and L = G F⁻¹: L r = r_y x̂ in
simple shear.

Where K becomes singular γ turns back along the curve, and a coordinate s = φ · (x − x_0) with a given mode φ is the
parameter instead: K dx = F + b dγ with φ · dx = ds is solved with K + c φ φᵀ, which is definite at the turn.

Where all contacts of a disk begin at δ = 0, the stiffness of a potential with an exponent above 2 vanishes there. Such
starting contacts have a usual stiffness at that point, so that the disk has a tangent.

A contact of a disk that nothing holds bears no force: it moves that disk along its normal and stays at δ = 0, as if a
spring of a usual stiffness acted on that disk alone.
"""

import numpy as np

from jampetsc.minimisation.lbfgs_kernels import dot
from jampetsc.minimisation.ldl import factorise, solve
from jampetsc.minimisation.warm_start import diagonal_blocks, displace_disks
from jampetsc.packing.bond import (
    bond_vector,
    difference,
    displace,
    entry,
    exponent_of,
    gradient_over,
    inner,
    row,
    secant,
    strained,
    tangent_ratio,
)
from jampetsc.packing.compiled import NUMBERS, compiled, nested

OPEN_PAIR, BEARING, WEIGHTLESS, STARTING = map(np.int8, range(4))  # of a pair
MAX_LINEAR_STEPS = 400  # of conjugate gradients
# A contact of force ∝ δ^(α − 1) that loses it has (α − 2)/(α − 1) of its δ after each: a third if Hertzian.
MAX_NEWTON_STEPS = 20
NEWTON_TOLERANCE = 1e-3  # of the linear solves of a Newton step, relative
FORCE_ROUNDING = 4e-16  # of k σ of each contact: what rounding leaves of the force on a disk
PROGRESS = 0.5  # of the residual in a Newton step; less near rounding is the end
ROUNDING_RATIO = 30.0  # to rounding, up to which no progress is the end


def empty_point(pairs, n):
    """Arrays of `evaluate`: δ (M,), n (M, D), M (M, D, D), L r (M, D), F and b (N, D), rounding of |F| (N,)."""
    m, axes = len(pairs.i), len(pairs.r0)
    shapes = (m,), (m, axes), (m, axes, axes), (m, axes), (n, axes), (n, axes), (n,)
    return tuple(np.zeros(shape) for shape in shapes)


@compiled(NUMBERS, forceinline=True)
def evaluate(pairs, active, loose, o, g, gradient, potential, usual, point):
    """Fill in `point` at offsets o (N, D) and amplitude g of the load since the list; returns (U, dU/dg, p D V).

    active     (M,) int8, OPEN_PAIR, BEARING, WEIGHTLESS or STARTING
    loose      (N,) disks that nothing holds
    gradient   G, a `Strain`
    usual      stiffness of weightless and starting contacts
    """
    overlaps, normals, blocks, affine, forces, column, rounding = point
    i, j, r0, sigma = pairs.i, pairs.j, pairs.r0, pairs.sigma
    strain = strained(gradient, g)
    flow = gradient_over(gradient, strain)
    energy = work = trace = 0.0
    forces[:] = 0.0
    column[:] = 0.0
    rounding[:] = 0.0
    for q in range(len(i)):
        a, b = i[q], j[q]
        r = bond_vector(strain, entry(r0, q), difference(o, a, b, r0))
        distance = np.sqrt(inner(r, r))
        d = sigma[q] - distance
        overlaps[q] = d
        along = displace(flow, r)
        for x in range(len(r0)):
            normals[q, x], affine[q, x] = r[x] / distance, along[x]
        if active[q] == 0:
            continue
        depth = max(d, 0.0)
        bears = active[q] != 2
        if bears:
            stiffness = secant(depth, sigma[q], potential)
            f, k = stiffness * d, tangent_ratio(depth, sigma[q], potential) * stiffness
            if active[q] == 3:
                k = max(k, usual)
            energy += f * d
            work -= f * inner(r, along) / distance
            trace += f * distance
        else:
            f, k = usual * d, usual
        across = f / distance if bears else 0.0
        error = FORCE_ROUNDING * k * sigma[q]
        for x in range(len(r0)):
            for y in range(len(r0)):
                blocks[q, x, y] = (k + across) * normals[q, x] * normals[q, y]
            blocks[q, x, x] -= across
        for x in range(len(r0)):
            push, change = f * normals[q, x], -inner(row(blocks[q], x, r), along)
            if bears or loose[b]:
                forces[b, x] += push
                column[b, x] += change
            if bears or loose[a]:
                forces[a, x] -= push
                column[a, x] -= change
        rounding[a] += error
        rounding[b] += error
    return energy / exponent_of(potential), work, trace


@compiled(NUMBERS)
def factor_of_branch(order, pairs, active, blocks, shift):
    """(definite, factor) of K + shift (N,) by `ldl.factorise`, K of the pairs in `active`."""
    chosen = active != 0
    diagonal = diagonal_blocks(pairs.r0, pairs.i, pairs.j, blocks, chosen, shift)
    return factorise(order, pairs.i, pairs.j, blocks, chosen, diagonal)


@compiled(NUMBERS)
def push_loose(pairs, active, loose, blocks, moves, right):
    """Add to `right` (N, D) what weightless contacts do to loose disks as all disks make `moves` (N, D)."""
    i, j, axes = pairs.i, pairs.j, len(pairs.r0)
    for q in range(len(i)):
        if active[q] != 2:
            continue
        for x in range(axes):
            change = 0.0
            for y in range(axes):
                change -= blocks[q, x, y] * (moves[j[q], y] - moves[i[q], y])
            if loose[j[q]]:
                right[j[q], x] += change
            if loose[i[q]]:
                right[i[q], x] -= change


@compiled(NUMBERS)
def overlap_rates(pairs, point, moves, strain, rates):
    """dδ (M,) of all pairs into `rates` for moves (N, D) of the disks and a change of γ by `strain`."""
    normals, affine = point[1], point[3]
    i, j = pairs.i, pairs.j
    for q in range(len(i)):
        total = 0.0
        for x in range(moves.shape[1]):
            total += normals[q, x] * (strain * affine[q, x] + moves[j[q], x] - moves[i[q], x])
        rates[q] = -total


@nested(NUMBERS, forceinline=True)
def _multiply(pairs, active, blocks, shift, mode, weight, x, y):
    """y = (K + shift + weight φ φᵀ) x, (N, D) each; mode φ: of no disk where weight is unused."""
    i, j, axes = pairs.i, pairs.j, len(pairs.r0)
    for k in range(len(x)):
        for a in range(axes):
            y[k, a] = shift[k] * x[k, a]
    for q in range(len(i)):
        if active[q] == 0:
            continue
        low, high = i[q], j[q]
        for a in range(axes):
            f = 0.0
            for b in range(axes):
                f += blocks[q, a, b] * (x[high, b] - x[low, b])
            y[high, a] += f
            y[low, a] -= f
    if len(mode):
        along = weight * dot(mode.reshape(-1), x.reshape(-1))
        for k in range(len(x)):
            for a in range(axes):
                y[k, a] += along * mode[k, a]


@compiled(NUMBERS, forceinline=True)
def respond(pairs, active, blocks, shift, factor, mode, weight, b, x, tolerance):
    """Improve x (N, D) to (K + shift + weight φ φᵀ) x = b by conjugate gradients with `factor`; returns the steps.

    To |residual| ≤ tolerance |b|; −1 where a direction of negative curvature shows up.
    """
    r, z, p, q = np.empty_like(b), np.empty_like(b), np.zeros_like(b), np.empty_like(b)
    work = np.empty_like(b)
    _multiply(pairs, active, blocks, shift, mode, weight, x, r)
    for k in range(len(b)):
        for a in range(b.shape[1]):
            r[k, a] = b[k, a] - r[k, a]
    flat_r, flat_z, flat_p, flat_q, flat_x = (
        r.reshape(-1), z.reshape(-1), p.reshape(-1), q.reshape(-1), x.reshape(-1),
    )  # fmt: skip
    limit = tolerance * tolerance * dot(b.reshape(-1), b.reshape(-1))
    previous = 1.0
    for step in range(MAX_LINEAR_STEPS):
        if dot(flat_r, flat_r) <= limit:
            return step
        solve(factor, r, z, work)
        product = dot(flat_r, flat_z)
        share = product / previous if step else 0.0
        for c in range(len(flat_p)):
            flat_p[c] = flat_z[c] + share * flat_p[c]
        _multiply(pairs, active, blocks, shift, mode, weight, p, q)
        curvature = dot(flat_p, flat_q)
        if not curvature > 0.0:
            return -1
        length = product / curvature
        for c in range(len(flat_p)):
            flat_x[c] += length * flat_p[c]
            flat_r[c] -= length * flat_q[c]
        previous = product
    return MAX_LINEAR_STEPS


@compiled(NUMBERS, forceinline=True)
def remove_drift(loose, x):
    """Take the mean of the backbone out of its moves x (N, D), where rounding over the shift of K puts it.

    Loose disks would be left behind.
    """
    count = 0
    for k in range(len(x)):
        count += not loose[k]
    for a in range(x.shape[1]):
        total = 0.0
        for k in range(len(x)):
            if not loose[k]:
                total += x[k, a]
        for k in range(len(x)):
            if not loose[k]:
                x[k, a] -= total / count


@compiled(NUMBERS)
def correct(pairs, active, loose, gradient, potential, scalars, shift, factor, mode, point, o, moved):
    """Newton's method from offsets o (N, D) to equilibrium; returns (success, g, evaluations, sums).

    gradient  G, a `Strain`
    scalars   (amplitude g, usual stiffness, weight c, goal of s, its tolerance)
    mode      φ (N, D), with s = φ · moved; of no disk where g is fixed
    point     `empty_point`, of the end
    moved     (N, D), to which moves in the laboratory are added

    sums are as in `evaluate`.
    """
    g, usual, weight, goal, short = scalars
    forces, column, rounding = point[4], point[5], point[6]
    right, first, second = np.empty_like(forces), np.zeros_like(forces), np.zeros_like(forces)
    last = np.inf
    sides = 2 if len(mode) else 1
    for step in range(MAX_NEWTON_STEPS + 1):
        sums = evaluate(pairs, active, loose, o, g, gradient, potential, usual, point)
        # In units of what rounding leaves or, of contacts that lose their force, what linear solves do.
        largest, floor = 0.0, NEWTON_TOLERANCE * np.max(rounding)
        for k in range(len(forces)):
            square = 0.0
            for a in range(forces.shape[1]):
                square += forces[k, a] * forces[k, a]
            if square > 0.0:
                ratio = np.sqrt(square) / max(rounding[k], floor)
                if not ratio <= largest:
                    largest = ratio
        rest = goal - dot(mode.reshape(-1), moved.reshape(-1)) if len(mode) else 0.0
        if not largest < np.inf:
            return False, g, step + 1, sums
        if abs(rest) <= short and (
            largest <= 1.0 or (largest > PROGRESS * last and largest <= ROUNDING_RATIO)
        ):
            return True, g, step + 1, sums
        if step == MAX_NEWTON_STEPS or (step > 3 and largest > 2.0 * last):
            return False, g, step + 1, sums
        last = largest
        for side in range(sides):
            if side == 0:
                right[:] = forces
                first[:] = 0.0
                if len(mode):
                    right += weight * rest * mode
            else:
                right[:] = column
                first, second = second, first
            if (
                respond(pairs, active, point[2], shift, factor, mode, weight, right, first, NEWTON_TOLERANCE)
                < 0
            ):
                return False, g, step + 1, sums
        change = 0.0
        if len(mode):  # `first` is K⁻¹ b, `second` K⁻¹ (F + c φ rest)
            change = (rest - dot(mode.reshape(-1), second.reshape(-1))) / dot(
                mode.reshape(-1), first.reshape(-1)
            )
            second += change * first
            first, second = second, first
        remove_drift(loose, first)
        displace_disks(o, moved, first, 1.0, strained(gradient, g), pairs.r0)
        g += change
    return False, g, MAX_NEWTON_STEPS, sums
