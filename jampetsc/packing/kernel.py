"""The bond kernel: forces, virial, energy and dissipation of all pairs of a list, in one compiled loop.

A bond is r = F (r0 + o_j − o_i) (see `neighbour_list`), n = r/|r|, t = ẑ × n. Where disks have velocities, u the
non-affine ones, and spins Ω, their contact moves by

    ṙ = u_j − u_i + γ̇ r_y x̂,    a∥ = n·ṙ,    a⊥ = t·ṙ,    a⊥ᶜ = a⊥ − ρ_i Ω_i − ρ_j Ω_j,

with r_y of the bond, never y_j − y_i, with which the flow would depend on the origin. Force on j:

    f = −V'(r) n  −  c_∥ a∥ n  −  (c_⊥ a⊥ + c_s a⊥ᶜ) t,    torque on i and j: ρ c_s a⊥ᶜ,

and it dissipates c_∥ a∥² + c_⊥ a⊥² + c_s a⊥ᶜ². The three c are the damping law's weights times kτ₁. The viscous
virial f_a r_b is not symmetric; the part that does the work of shear is f_x r_y.

Blocks of pairs go through three plain passes (gather, compute, scatter) without a branch: a contact is a factor
0 or 1. Loops over the neighbours of each disk lose most of their time to mispredicted loop ends. Where motion or
rolling is None, the code for it is not compiled.
"""

from typing import NamedTuple

import numpy as np

from jampetsc.packing.bond import bond_vector, secant
from jampetsc.packing.compiled import FAST, compiled

BLOCK = 1024  # pairs worked on at a time: their temporaries stay in the first-level cache
# Rows of one array: with one array each, the compiler would have too many to prove that none overlaps another,
# and would not vectorise.
UX, UY, ROLL, END = (row * BLOCK for row in range(4))


class Sums(NamedTuple):
    """Sums over bonds; `dissipation` and all that follow are zero where motion is None."""

    energy: float  # α U, α the exponent of the potential
    elastic_xx: float  # Σ f_x r_x of elastic forces,
    elastic_xy: float  # f_x r_y,
    elastic_yy: float
    dissipation: float
    viscous_xx: float  # Σ f_x r_x of viscous forces,
    viscous_xy: float  # f_x r_y,
    viscous_yy: float


@compiled(FAST, forceinline=True)
def _block_forces(r0x, r0y, sigma, bx, by, moving, strain, law, motion, rolling):
    """Turn o_j − o_i in (bx, by) into the forces on j, for one block of pairs: no branches, no indices.

    With motion (bx, by) include r0: two arrays fewer, within the compiler's limit for proofs that none overlap.
    Rows UX, UY of `moving`: u_j − u_i; row ROLL: ρ_i Ω_i + ρ_j Ω_j, turned into c_s a⊥ᶜ.
    """
    if motion is not None:
        _, rate, (along_weight, across_weight, sliding_weight) = motion
    energy = wxx = wxy = wyy = 0.0
    dissipation = vxx = vxy = vyy = 0.0
    for q in range(len(sigma)):
        if motion is None:
            rx, ry = bond_vector(strain, r0x[q], r0y[q], bx[q], by[q])
        else:
            rx, ry = bond_vector(strain, 0.0, 0.0, bx[q], by[q])
        r = np.sqrt(rx * rx + ry * ry)
        d = sigma[q] - r
        d = d if d > 0.0 else 0.0
        f = secant(d, sigma[q], law) * d
        energy += f * d
        w = f / r
        wx = w * rx
        wy = w * ry
        wxx += wx * rx
        wxy += wx * ry
        wyy += wy * ry
        if motion is None:
            bx[q] = wx
            by[q] = wy
        else:
            touching = 1.0 if d > 0.0 else 0.0
            nx = rx / r
            ny = ry / r
            vx = moving[UX + q] + rate * ry
            vy = moving[UY + q]
            along = touching * (nx * vx + ny * vy)
            across = touching * (nx * vy - ny * vx)
            push = along_weight * along
            drag = across_weight * across
            dissipation += push * along + drag * across
            if rolling is not None:
                sliding = across - touching * moving[ROLL + q]
                rim = sliding_weight * sliding
                dissipation += rim * sliding
                drag += rim
                moving[ROLL + q] = rim
            px = drag * ny - push * nx
            py = -drag * nx - push * ny
            vxx += px * rx
            vxy += px * ry
            vyy += py * ry
            bx[q] = wx + px
            by[q] = wy + py
    return energy, wxx, wxy, wyy, dissipation, vxx, vxy, vyy


@compiled(False)
def block_room():
    """Temporary arrays of `add_forces` for a block of pairs.

    Loops in several threads make them once, not at each step: numba counts the allocations of all threads in one
    variable, and passing that between cores costs a tenth of a time step of 4096 disks.
    """
    return np.empty(BLOCK), np.empty(BLOCK), np.empty(END)


@compiled(FAST, forceinline=True)
def add_forces(pairs, first, middle, last, o, strain, law, forces, motion, rolling, room):
    """Add the forces of pairs first … last − 1 to `forces` (N, 2), from `middle` on only those on i; returns the Sums.

    A pair that acts on i only is listed again from its other side, and counts half. Arguments as for
    `domain_forces`.
    """
    i, j, r0, sigma = pairs
    r0x, r0y = r0[0], r0[1]
    bx, by, moving = room
    k, hertzian, scaled = law
    if motion is not None:
        ux, uy, rolled = moving[UX:UY], moving[UY:ROLL], moving[ROLL:END]
        u = motion[0]
    if rolling is not None:
        spin, radii, torques = rolling
    energy = wxx = wxy = wyy = 0.0
    dissipation = vxx = vxy = vyy = 0.0
    begin, turn, stop = np.uint64(first), np.uint64(middle), np.uint64(last)
    while begin < stop:
        both = begin < turn
        weight = 1.0 if both else 0.5
        end = min(begin + np.uint64(BLOCK), turn if both else stop)
        for p in range(begin, end):
            a = i[p]
            b = j[p]
            dx = o[b, 0] - o[a, 0]
            dy = o[b, 1] - o[a, 1]
            if motion is not None:
                dx += r0x[p]
                dy += r0y[p]
                ux[p - begin] = u[b, 0] - u[a, 0]
                uy[p - begin] = u[b, 1] - u[a, 1]
            if rolling is not None:
                rolled[p - begin] = radii[a] * spin[a] + radii[b] * spin[b]
            bx[p - begin] = dx
            by[p - begin] = dy
        block = slice(begin, end)
        inside = slice(0, end - begin)
        arrays = r0x[block], r0y[block], sigma[block], bx[inside], by[inside], moving
        # With a flag that is no constant the compiler computes the root of a Hertzian law for every law.
        if hertzian:
            sums = _block_forces(*arrays, strain, (k, True, scaled), motion, rolling)
        else:
            sums = _block_forces(*arrays, strain, (k, False, scaled), motion, rolling)
        energy += weight * sums[0]
        wxx += weight * sums[1]
        wxy += weight * sums[2]
        wyy += weight * sums[3]
        if motion is not None:
            dissipation += weight * sums[4]
            vxx += weight * sums[5]
            vxy += weight * sums[6]
            vyy += weight * sums[7]
        if both:
            for p in range(begin, end):
                a = i[p]
                b = j[p]
                wx = bx[p - begin]
                wy = by[p - begin]
                forces[b, 0] += wx
                forces[b, 1] += wy
                forces[a, 0] -= wx
                forces[a, 1] -= wy
                if rolling is not None:
                    torques[a] += radii[a] * rolled[p - begin]
                    torques[b] += radii[b] * rolled[p - begin]
        else:
            for p in range(begin, end):
                a = i[p]
                forces[a, 0] -= bx[p - begin]
                forces[a, 1] -= by[p - begin]
                if rolling is not None:
                    torques[a] += radii[a] * rolled[p - begin]
        begin = end
    return Sums(energy, wxx, wxy, wyy, dissipation, vxx, vxy, vyy)


@compiled(FAST, forceinline=True)
def domain_forces(domains, d, o, strain, law, forces, motion, rolling, room):
    """Net forces on the disks of domain d of a `NeighbourList` into their rows of `forces`; returns the domain's Sums.

    o         (N, 2) offsets
    strain    `Strain` of the cell since the list
    law       `potential.constants`
    motion    None, or (u (N, 2), γ̇, (c_∥, c_⊥, c_s)): damped contacts
    rolling   None, or (Ω (N,), ρ (N,), torques (N,)): with spins; torques are overwritten
    room      see `block_room`
    """
    own = slice(domains.disks[d], domains.disks[d + 1])
    forces[own] = 0.0
    if rolling is not None:
        rolling[2][own] = 0.0
    pairs = domains.i, domains.j, domains.r0, domains.sigma
    ends = domains.begin[d], domains.across[d], domains.end[d]
    return add_forces(pairs, *ends, o, strain, law, forces, motion, rolling, room)


@compiled(FAST, forceinline=True)
def bond_forces(pairs, o, strain, law, forces, motion, rolling):
    """Net forces of a `NeighbourList` of one domain into `forces` (N, 2); returns their Sums. See `domain_forces`."""
    return domain_forces(pairs, np.int64(0), o, strain, law, forces, motion, rolling, block_room())
