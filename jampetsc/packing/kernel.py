"""The bond kernel: forces, virial, energy and dissipation of all pairs of a list, in one compiled loop.

A bond is r = F (r0 + o_j − o_i) (see `neighbour_list`), n = r/|r|. Where disks have velocities, u the non-affine ones,
and spins Ω, their contact moves by

    ṙ = u_j − u_i + γ̇ r_y x̂,    a∥ = n·ṙ,    a⊥ = ṙ − n a∥,    a⊥ᶜ = a⊥ − (ρ_i Ω_i + ρ_j Ω_j) × n,

with r_y of the bond, never y_j − y_i, with which the flow would depend on the origin. Force on j:

    f = −V'(r) n  −  c_∥ a∥ n  −  c_⊥ a⊥ − c_s a⊥ᶜ,    torque on i and j: ρ c_s n × a⊥ᶜ,

and it dissipates c_∥ a∥² + c_⊥ a⊥² + c_s a⊥ᶜ². The three c are the damping law's weights times kτ₁. The viscous
virial f_a r_b is not symmetric; the part that does the work of shear is f_x r_y. In a plane Ω = Ω ẑ, and a⊥ and a⊥ᶜ are
numbers along t = ẑ × n.

Blocks of pairs go through three plain passes (gather, compute, scatter) without a branch: a contact is a factor
0 or 1. Loops over the neighbours of each disk lose most of their time to mispredicted loop ends. Where motion or
rolling is None, the code for it is not compiled; nor is that of another dimension than the list's, see `bond`.
"""

from typing import NamedTuple

import numpy as np

from jampetsc.packing.bond import (
    add_to_row,
    added,
    bond_vector,
    cross,
    difference,
    energy_term,
    entry,
    inner,
    put,
    scaled,
    secant,
    subtract_from_row,
    zero,
)
from jampetsc.packing.compiled import FAST, compiled, nested

BLOCK = 1024  # pairs worked on at a time: their temporaries stay in the first-level cache
# Rows of one array: with one array each, the compiler would have too many to prove that none overlaps another,
# and would not vectorise. In three dimensions the bonds are in it as well.
UX, UY, ROLL, END = (row_of_block * BLOCK for row_of_block in range(4))
UZ, ROLL_X, ROLL_Y, ROLL_Z, BX, BY, BZ, END_IN_SPACE = (row_of_block * BLOCK for row_of_block in range(2, 10))


class Sums(NamedTuple):
    """Sums over bonds; `dissipation` and all that follow are zero where motion is None, and those of z in a plane."""

    energy: float  # α U, α the exponent of the potential
    elastic_xx: float  # Σ f_x r_x of elastic forces,
    elastic_xy: float  # f_x r_y, …
    elastic_yy: float
    elastic_xz: float
    elastic_yz: float
    elastic_zz: float
    dissipation: float
    viscous_xx: float  # Σ f_x r_x of viscous forces, …
    viscous_xy: float
    viscous_yy: float
    viscous_zz: float


@nested(FAST, forceinline=True)
def elastic_trace(sums):
    """Σ f·r of elastic forces."""
    return sums.elastic_xx + sums.elastic_yy + sums.elastic_zz


def elastic_virial(sums: Sums, dimension: int):
    """Σ f_a r_b of elastic forces, (D, D), symmetric."""
    xy, xz, yz = sums.elastic_xy, sums.elastic_xz, sums.elastic_yz
    rows = (sums.elastic_xx, xy, xz), (xy, sums.elastic_yy, yz), (xz, yz, sums.elastic_zz)
    return np.array(rows)[:dimension, :dimension]


@nested(FAST, forceinline=True)
def viscous_trace(sums):
    """Σ f·r of viscous forces."""
    return sums.viscous_xx + sums.viscous_yy + sums.viscous_zz


@nested(FAST, forceinline=True)
def _block_forces(r0, sigma, b, moving, strain, potential, motion, rolling):
    """Turn o_j − o_i in b into the forces on j, for one block of pairs: no branches, no indices.

    With motion, and in three dimensions, b includes r0: fewer arrays, within the compiler's limit for proofs that none
    overlap. Rows UX, … of `moving`: u_j − u_i; rows ROLL, …: ρ_i Ω_i + ρ_j Ω_j, turned into c_s n × a⊥ᶜ.
    """
    if motion is not None:
        _, rate, (along_weight, across_weight, sliding_weight) = motion
    energy = wxx = wxy = wyy = wxz = wyz = wzz = 0.0
    dissipation = vxx = vxy = vyy = vzz = 0.0
    for q in range(len(sigma)):
        if len(r0) == 3:
            bond = bond_vector(strain, zero(r0), (moving[BX + q], moving[BY + q], moving[BZ + q]))
        elif motion is None:
            bond = bond_vector(strain, entry(r0, q), entry(b, q))
        else:
            bond = bond_vector(strain, zero(r0), entry(b, q))
        r = np.sqrt(inner(bond, bond))
        d = sigma[q] - r
        d = d if d > 0.0 else 0.0
        f = secant(d, sigma[q], potential) * d
        energy += energy_term(f, d, sigma[q], potential)
        w = scaled(f / r, bond)
        wxx += w[0] * bond[0]
        wxy += w[0] * bond[1]
        wyy += w[1] * bond[1]
        if len(r0) == 3:
            wxz += w[0] * bond[2]
            wyz += w[1] * bond[2]
            wzz += w[2] * bond[2]
        if motion is None:
            force = w
        else:
            touching = 1.0 if d > 0.0 else 0.0
            if len(r0) == 3:
                n = bond[0] / r, bond[1] / r, bond[2] / r
                v = moving[UX + q] + rate * bond[1], moving[UY + q], moving[UZ + q]
                along = touching * inner(n, v)
                push = along_weight * along
                across = added(scaled(touching, v), scaled(-along, n))
                drag = scaled(across_weight, across)
                dissipation += push * along + inner(drag, across)
                if rolling is not None:
                    turning = moving[ROLL_X + q], moving[ROLL_Y + q], moving[ROLL_Z + q]
                    sliding = added(across, scaled(-touching, cross(turning, n)))
                    rim = scaled(sliding_weight, sliding)
                    dissipation += inner(rim, sliding)
                    drag = added(drag, rim)
                    moving[ROLL_X + q], moving[ROLL_Y + q], moving[ROLL_Z + q] = cross(n, rim)
                p = scaled(-1.0, added(scaled(push, n), drag))
                vzz += p[2] * bond[2]
            else:
                n = bond[0] / r, bond[1] / r
                v = moving[UX + q] + rate * bond[1], moving[UY + q]
                along = touching * inner(n, v)
                push = along_weight * along
                across = touching * (n[0] * v[1] - n[1] * v[0])
                drag = across_weight * across
                dissipation += push * along + drag * across
                if rolling is not None:
                    sliding = across - touching * moving[ROLL + q]
                    rim = sliding_weight * sliding
                    dissipation += rim * sliding
                    drag += rim
                    moving[ROLL + q] = rim
                p = drag * n[1] - push * n[0], -drag * n[0] - push * n[1]
            vxx += p[0] * bond[0]
            vxy += p[0] * bond[1]
            vyy += p[1] * bond[1]
            force = added(w, p)
        if len(r0) == 3:
            moving[BX + q], moving[BY + q], moving[BZ + q] = force
        else:
            put(b, q, force)
    return energy, wxx, wxy, wyy, wxz, wyz, wzz, dissipation, vxx, vxy, vyy, vzz


@compiled(False)
def block_room(dimension):
    """Temporary arrays of `add_forces` for a block of pairs.

    Loops in several threads make them once, not at each step: numba counts the allocations of all threads in one
    variable, and passing that between cores costs a tenth of a time step of 4096 disks.
    """
    return np.empty(BLOCK), np.empty(BLOCK), np.empty(END_IN_SPACE if dimension == 3 else END)


@nested(FAST, forceinline=True)
def _bonds_of_block(room, r0):
    """D arrays for the vectors of a block."""
    bx, by, moving = room
    if len(r0) == 3:
        return moving[BX:BY], moving[BY:BZ], moving[BZ:END_IN_SPACE]
    return bx, by


@nested(FAST, forceinline=True)
def _velocities_of_block(moving, r0):
    """D arrays for u_j − u_i of a block."""
    if len(r0) == 3:
        return moving[UX:UY], moving[UY:UZ], moving[UZ:ROLL_X]
    return moving[UX:UY], moving[UY:ROLL]


@nested(FAST, forceinline=True)
def _part(arrays, begin, end):
    """Entries begin … end − 1 of D arrays."""
    if len(arrays) == 3:
        return arrays[0][begin:end], arrays[1][begin:end], arrays[2][begin:end]
    return arrays[0][begin:end], arrays[1][begin:end]


@nested(FAST, forceinline=True)
def _gather_rolling(moving, q, a, b, spin, radii, like):
    """ρ_a Ω_a + ρ_b Ω_b of pair q into `moving`."""
    if len(like) == 3:
        for axis in range(3):
            moving[ROLL_X + axis * BLOCK + q] = radii[a] * spin[a, axis] + radii[b] * spin[b, axis]
    else:
        moving[ROLL + q] = radii[a] * spin[a] + radii[b] * spin[b]


@nested(FAST, forceinline=True)
def _add_torque(torques, a, radius, moving, q, like):
    """Add ρ c_s n × a⊥ᶜ of pair q to the torque on disk a."""
    if len(like) == 3:
        for axis in range(3):
            torques[a, axis] += radius * moving[ROLL_X + axis * BLOCK + q]
    else:
        torques[a] += radius * moving[ROLL + q]


@nested(FAST, forceinline=True)
def add_forces(pairs, first, middle, last, o, strain, potential, forces, motion, rolling, room):
    """Add the forces of pairs first … last − 1 to `forces` (N, D), from `middle` on only those on i; returns the Sums.

    A pair that acts on i only is listed again from its other side, and counts half. Arguments as for
    `domain_forces`.
    """
    i, j, r0, sigma = pairs
    b, moving = _bonds_of_block(room, r0), room[2]
    in_space = len(r0) == 3
    if motion is not None:
        velocities = _velocities_of_block(moving, r0)
        u = motion[0]
    if rolling is not None:
        spin, radii, torques = rolling
    energy = wxx = wxy = wyy = wxz = wyz = wzz = 0.0
    dissipation = vxx = vxy = vyy = vzz = 0.0
    begin, turn, stop = np.uint64(first), np.uint64(middle), np.uint64(last)
    while begin < stop:
        both = begin < turn
        weight = 1.0 if both else 0.5
        end = min(begin + np.uint64(BLOCK), turn if both else stop)
        for p in range(begin, end):
            own = i[p]
            other = j[p]
            moved = difference(o, own, other, r0)
            if motion is not None:
                put(velocities, p - begin, difference(u, own, other, r0))
            if rolling is not None:
                _gather_rolling(moving, p - begin, own, other, spin, radii, r0)
            if motion is not None or in_space:
                moved = added(moved, entry(r0, p))
            put(b, p - begin, moved)
        inside = np.uint64(0), end - begin
        arrays = _part(r0, begin, end), sigma[begin:end], _part(b, inside[0], inside[1]), moving
        # With a flag that is not constant the compiler computes the root of a Hertzian potential for every one.
        if len(potential) != 3:
            sums = _block_forces(*arrays, strain, potential, motion, rolling)
        elif potential[1]:
            sums = _block_forces(*arrays, strain, (potential[0], True, potential[2]), motion, rolling)
        else:
            sums = _block_forces(*arrays, strain, (potential[0], False, potential[2]), motion, rolling)
        energy += weight * sums[0]
        wxx += weight * sums[1]
        wxy += weight * sums[2]
        wyy += weight * sums[3]
        if in_space:
            wxz += weight * sums[4]
            wyz += weight * sums[5]
            wzz += weight * sums[6]
            vzz += weight * sums[11]
        if motion is not None:
            dissipation += weight * sums[7]
            vxx += weight * sums[8]
            vxy += weight * sums[9]
            vyy += weight * sums[10]
        if both:
            for p in range(begin, end):
                own = i[p]
                other = j[p]
                force = entry(b, p - begin)
                add_to_row(forces, other, force)
                subtract_from_row(forces, own, force)
                if rolling is not None:
                    _add_torque(torques, own, radii[own], moving, p - begin, r0)
                    _add_torque(torques, other, radii[other], moving, p - begin, r0)
        else:
            for p in range(begin, end):
                own = i[p]
                subtract_from_row(forces, own, entry(b, p - begin))
                if rolling is not None:
                    _add_torque(torques, own, radii[own], moving, p - begin, r0)
        begin = end
    return Sums(energy, wxx, wxy, wyy, wxz, wyz, wzz, dissipation, vxx, vxy, vyy, vzz)


@nested(FAST, forceinline=True)
def domain_forces(domains, d, o, strain, potential, forces, motion, rolling, room):
    """Net forces on the disks of domain d of a `NeighbourList` into their rows of `forces`; returns the domain's Sums.

    o           (N, D) offsets
    strain      `Strain` of the cell since the list
    potential   `Potential.constants`
    motion      None, or (u (N, D), γ̇, (c_∥, c_⊥, c_s)): damped contacts
    rolling     None, or (Ω, ρ (N,), torques): with spins; Ω and torques (N,), in three dimensions (N, 3); torques are
                overwritten
    room        see `block_room`
    """
    own = slice(domains.disks[d], domains.disks[d + 1])
    forces[own] = 0.0
    if rolling is not None:
        rolling[2][own] = 0.0
    pairs = domains.i, domains.j, domains.r0, domains.sigma
    ends = domains.begin[d], domains.across[d], domains.end[d]
    return add_forces(pairs, *ends, o, strain, potential, forces, motion, rolling, room)


@compiled(FAST, forceinline=True)
def bond_forces(pairs, o, strain, potential, forces, motion, rolling):
    """Net forces of a `NeighbourList` of one domain into `forces` (N, D); returns their Sums. See `domain_forces`."""
    return domain_forces(
        pairs, np.int64(0), o, strain, potential, forces, motion, rolling, block_room(forces.shape[1])
    )
