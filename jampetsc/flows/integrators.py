"""Time steps of steady shear, compiled: overdamped against drag, overdamped or implicit on contacts, and massive.

Positions are offsets o in the coordinates of the last pair list, γ_ref; g = γ − γ_ref; u is the non-affine
velocity in the laboratory, the same in every frame (Vågberg, thesis eqs. 4.1–4.5):

    ȯ = u − g u_y x̂,    u̇ = F/m − γ̇ u_y x̂  (SLLOD, 4.25)    or    F(u) = 0  without mass

A move takes g in the middle of its step: exact for constant u. Every function steps until `steps` are done, the
list is stale or something is wrong, and adds the terms of TALLY of each time step to `tally`. A step begins with
forces, from a list that is not stale, and ends with a move.

All are run by a `packing.threads.Team`, thread `me` of `threads`, each on its domains: it reads arrays of all disks and
writes rows of its own, where no other thread reads before the next barrier (`meet`). So a step takes one barrier, two
by Heun's method, besides the sums of a solve for velocities. All threads take the same decisions, from the same sums.
"""

from typing import NamedTuple

import numpy as np

from jampetsc.flows.clusters import centre_clusters_of, find_clusters_of, unite_clusters
from jampetsc.flows.resistance import Graph, Search, find_contacts_of, solve
from jampetsc.flows.step_kernels import (
    DONE,
    ITERATIONS,
    SUMMED,
    UNSET_PATH,
    UNSOLVED,
    add_terms,
    drift,
    find_own_domains,
    joint_status,
    kick,
    move,
    squares_of,
    update_inner_list,
    write_terms,
)  # fmt: skip
from jampetsc.packing.bond import simple_shear
from jampetsc.packing.compiled import FAST, compiled
from jampetsc.packing.kernel import block_room, domain_forces
from jampetsc.packing.threads import meet

ROUNDING = 1e-15  # of a force, relative


class ContactSolve(NamedTuple):
    """Contact graph and work arrays of a solve for velocities."""

    graph: Graph
    search: Search


@compiled(FAST, nogil=True)
def drag_steps(me, threads, counter, arrays, constants, like, steps):
    """Overdamped disks in a fluid, u = f/drag, by Euler or Heun: (status, steps done).

    like, here and below: a tuple of length D.
    """
    first, last, begin, stop = find_own_domains(me, threads, arrays)
    domains = range(first, last)
    disks, forces, u, o, ahead = arrays.pairs.disks, arrays.forces, arrays.u, arrays.o, arrays.ahead
    mobility, room, buffer, done, status = 1.0 / constants.drag, block_room(len(like)), 0, 0, DONE
    path, list_shear = UNSET_PATH, 0.0
    while done < steps and status == DONE:
        g = (constants.list_age + done) * constants.rate * constants.step
        middle, later = g + 0.5 * constants.rate * constants.step, g + constants.rate * constants.step
        path, list_shear = update_inner_list(arrays, constants, domains, o, g, path, list_shear)
        longest = 0.0
        for part in range(2 if constants.heun else 1):
            pairs, place, shear = (arrays.inner_pairs, o, g) if part == 0 else (arrays.pairs, ahead, later)
            sums = arrays.sums[buffer]
            for d in domains:
                rows = slice(disks[d], disks[d + 1])
                bonds = domain_forces(
                    pairs, d, place, simple_shear(shear), constants.potential, forces, None, None, room
                )
                forces[disks[d] : constants.wall_disks] = 0.0
                if part == 0:
                    far, longest, xy, squares = drift(
                        o[rows], forces[rows], mobility, middle, constants.step, u[rows], ahead[rows], like
                    )
                    write_terms(constants, bonds, xy, squares, sums[d])
                else:
                    f = forces[rows]
                    for a in range(len(f)):
                        f[a, 0] = 0.5 * (u[a + disks[d], 0] + mobility * f[a, 0])
                        f[a, 1] = 0.5 * (u[a + disks[d], 1] + mobility * f[a, 1])
                    if len(like) == 3:
                        for a in range(len(f)):
                            f[a, 2] = 0.5 * (u[a + disks[d], 2] + mobility * f[a, 2])
                    far, longest = move(o[rows], f, middle, constants.step, o[rows], like)
                sums[d, SUMMED], sums[d, SUMMED + 1] = far, longest
            meet(counter, threads)
            buffer = 1 - buffer
            status, longest = joint_status(constants, sums, later)
            if part == 0 and constants.heun and status != DONE:
                return status, done
            if part == 0 and me == 0:
                add_terms(constants, sums, arrays.tally)
        if not constants.heun:
            o, ahead = ahead, o
        done += 1
        path += longest
    if not constants.heun and done % 2:
        arrays.o[begin:stop] = arrays.ahead[begin:stop]
    return status, done


@compiled(FAST, forceinline=True)
def residual_at(pairs, d, o, g, constants, u, forces, rolling, room, like):
    """Net force m u̇ on the disks of domain d at velocities u into `forces`: bonds, drag and −m γ̇ u_y x̂ of SLLOD.

    Disks of walls have u̇ = 0. rolling: None, or (Ω, ρ, torques); see `domain_forces`, whose Sums it returns.
    """
    sums = domain_forces(
        pairs,
        d,
        o,
        simple_shear(g),
        constants.potential,
        forces,
        (u, constants.rate, constants.weights),
        rolling,
        room,
    )
    begin = pairs.disks[d]
    for a in range(begin, pairs.disks[d + 1]):
        forces[a, 0] -= constants.drag * u[a, 0] + constants.mass * constants.rate * u[a, 1]
        forces[a, 1] -= constants.drag * u[a, 1]
        if len(like) == 3:
            forces[a, 2] -= constants.drag * u[a, 2]
    forces[begin : constants.wall_disks] = 0.0
    if rolling is not None:
        rolling[2][begin : constants.wall_disks] = 0.0
    return sums


@compiled(FAST, nogil=True, forceinline=True)
def balance(me, threads, counter, arrays, constants, contacts, pairs, o, g, u, room, like):
    """Solve for u: velocities at which forces balance, or with a mass the velocities of a step of backward Euler.

    Returns (UNSOLVED or DONE, iterations), after a barrier.
    """
    first, last, _, _ = find_own_domains(me, threads, arrays)
    graph = contacts.graph
    for d in range(first, last):
        bonds = residual_at(pairs, d, o, g, constants, u, arrays.forces, None, room, like)
        # elastic forces follow from distances; squares of viscous ones are weights times dissipation
        elastic = (graph.disks[d + 1] - graph.disks[d]) * (ROUNDING * constants.largest_force) ** 2
        contacts.search.rounding[d] = elastic + ROUNDING**2 * max(constants.weights) * bonds.dissipation
        find_contacts_of(pairs, d, o, simple_shear(g), graph)
    hold = constants.drag + constants.mass / constants.step
    iterations = solve(
        me,
        threads,
        counter,
        graph,
        constants.weights,
        hold,
        arrays.forces,
        u,
        constants.tolerance,
        contacts.search,
        like,
    )
    # set to zero: mean u of each cluster, which no force determines without mass and drag; that of all disks with mass
    # and neither drag nor walls, which forces do not change
    free = constants.drag == 0.0 and constants.mass == 0.0
    if free:
        for d in range(first, last):
            find_clusters_of(graph, d, u, like)
    meet(counter, threads)
    if free and me == 0:
        unite_clusters(pairs, graph)
    elif me == 0 and constants.drag == 0.0 and constants.wall_disks == 0:
        for axis in range(len(like)):
            u[:, axis] -= np.mean(u[:, axis])
    meet(counter, threads)
    if free:
        for d in range(first, last):
            centre_clusters_of(graph, d, u, like)
        meet(counter, threads)
    return DONE if iterations >= 0 else UNSOLVED, iterations


@compiled(FAST, nogil=True)
def contact_steps(me, threads, counter, arrays, constants, like, contacts, steps):
    """Disks damped by contacts, implicit in the velocities: without mass by Euler or Heun, with mass by Euler.

    Returns (status, steps done).
    """
    first, last, begin, stop = find_own_domains(me, threads, arrays)
    domains = range(first, last)
    disks, o, ahead, u, after = arrays.pairs.disks, arrays.o, arrays.ahead, arrays.u, arrays.after[0]
    room = block_room(len(like))
    done, status = 0, DONE
    path, list_shear = UNSET_PATH, 0.0
    while done < steps and status == DONE:
        g = (constants.list_age + done) * constants.rate * constants.step
        middle, later = g + 0.5 * constants.rate * constants.step, g + constants.rate * constants.step
        path, list_shear = update_inner_list(arrays, constants, domains, o, g, path, list_shear)
        for part in range(2 if constants.heun else 1):
            pairs, place, shear, v = (
                (arrays.inner_pairs, o, g, u) if part == 0 else (arrays.pairs, ahead, later, after)
            )
            solved, iterations = balance(
                me, threads, counter, arrays, constants, contacts, pairs, place, shear, v, room, like
            )
            status = solved
            if status != DONE:
                break
            if part == 0 and me == 0:
                arrays.tally[ITERATIONS] += iterations
            if part == 0 and constants.heun:
                for d in domains:
                    rows = slice(disks[d], disks[d + 1])
                    far, longest = move(o[rows], u[rows], middle, constants.step, ahead[rows], like)
                    arrays.sums[0, d, SUMMED], arrays.sums[0, d, SUMMED + 1] = far, longest
                    after[rows] = u[rows]
                meet(counter, threads)
                status, _ = joint_status(constants, arrays.sums[0], later)
                if status != DONE:
                    break
        if status != DONE:
            break
        if constants.heun:
            for a in range(begin, stop):
                after[a, 0] = 0.5 * (u[a, 0] + after[a, 0])
                after[a, 1] = 0.5 * (u[a, 1] + after[a, 1])
                if len(like) == 3:
                    after[a, 2] = 0.5 * (u[a, 2] + after[a, 2])
        sums = arrays.sums[1]
        for d in domains:
            rows = slice(disks[d], disks[d + 1])
            bonds = domain_forces(
                arrays.inner_pairs,
                d,
                o,
                simple_shear(g),
                constants.potential,
                arrays.forces,
                (u, constants.rate, constants.weights),
                None,
                room,
            )
            write_terms(constants, bonds, *squares_of(u[rows], like), sums[d])
            velocity = after[rows] if constants.heun else u[rows]
            far, longest = move(o[rows], velocity, middle, constants.step, ahead[rows], like)
            sums[d, SUMMED], sums[d, SUMMED + 1] = far, longest
        meet(counter, threads)
        status, longest = joint_status(constants, sums, later)
        if me == 0:
            add_terms(constants, sums, arrays.tally)
        o, ahead = ahead, o
        done += 1
        path += longest
    if done % 2:
        arrays.o[begin:stop] = arrays.ahead[begin:stop]
    return status, done


class Turning(NamedTuple):
    """Spins Ω of disks that roll, (N,), in space (N, 3)."""

    spins: np.ndarray  # Ω half a step ago
    rates: np.ndarray  # Ω̇ one step ago
    radii: np.ndarray  # (N,)
    inertia: np.ndarray  # (N,)
    current_spins: np.ndarray  # work array: Ω now
    next_spins: np.ndarray  # work array: Ω at the next step
    torques: np.ndarray  # work array


@compiled(FAST, nogil=True)
def massive_steps(me, threads, counter, arrays, constants, like, turning, steps):
    """Massive disks by velocity Verlet, one force per step, taken at the predicted velocity: (status, steps done).

    u is the velocity half a step ago; `forces` has the acceleration one step ago; turning: None, or a Turning.
    """
    first, last, begin, stop = find_own_domains(me, threads, arrays)
    domains = range(first, last)
    dt, forces, u, o, ahead = constants.step, arrays.forces, arrays.u, arrays.o, arrays.ahead
    disks, buffer, done, status = arrays.pairs.disks, 0, 0, DONE
    predicted, after, room = arrays.after[0], arrays.after[1], block_room(len(like))
    for a in range(begin, stop):
        for axis in range(len(like)):
            predicted[a, axis] = u[a, axis] + 0.5 * dt * forces[a, axis]
    if turning is not None:
        spin, spin_last, inertia, current_spins, next_spins, torques = (
            turning.spins, turning.rates, turning.inertia, turning.current_spins, turning.next_spins,
            turning.torques,
        )  # fmt: skip
        if len(like) == 3:
            current_spins[begin:stop] = spin[begin:stop] + 0.5 * dt * spin_last[begin:stop]
        else:
            for a in range(begin, stop):
                current_spins[a] = spin[a] + 0.5 * dt * spin_last[a]
    meet(counter, threads)
    path, list_shear = UNSET_PATH, 0.0
    while done < steps and status == DONE:
        g = (constants.list_age + done) * constants.rate * dt
        path, list_shear = update_inner_list(arrays, constants, domains, o, g, path, list_shear)
        sums = arrays.sums[buffer]
        for d in domains:
            rows = slice(disks[d], disks[d + 1])
            motion = predicted, constants.rate, constants.weights
            if turning is None:
                bonds = domain_forces(
                    arrays.inner_pairs, d, o, simple_shear(g), constants.potential, forces, motion, None, room
                )
            else:
                rolling = current_spins, turning.radii, torques
                bonds = domain_forces(
                    arrays.inner_pairs,
                    d,
                    o,
                    simple_shear(g),
                    constants.potential,
                    forces,
                    motion,
                    rolling,
                    room,
                )
            forces[disks[d] : constants.wall_disks] = 0.0
            far, longest, xy, squares = kick(
                o[rows], forces[rows], predicted[rows], constants, g + 0.5 * constants.rate * dt,
                u[rows], after[rows], ahead[rows], like,
            )  # fmt: skip
            write_terms(constants, bonds, xy, squares, sums[d])
            sums[d, SUMMED], sums[d, SUMMED + 1] = far, longest
            if turning is not None:
                torques[disks[d] : constants.wall_disks] = 0.0
                if len(like) == 3:
                    for a in range(disks[d], disks[d + 1]):
                        for axis in range(3):
                            sums[d, 6] += 0.5 * inertia[a] * current_spins[a, axis] * current_spins[a, axis]
                            spin_last[a, axis] = torques[a, axis] / inertia[a]
                            spin[a, axis] += dt * spin_last[a, axis]
                            next_spins[a, axis] = spin[a, axis] + 0.5 * dt * spin_last[a, axis]
                else:
                    for a in range(disks[d], disks[d + 1]):
                        sums[d, 6] += 0.5 * inertia[a] * current_spins[a] * current_spins[a]
                        spin_last[a] = torques[a] / inertia[a]
                        spin[a] += dt * spin_last[a]
                        next_spins[a] = spin[a] + 0.5 * dt * spin_last[a]
        meet(counter, threads)
        status, longest = joint_status(constants, sums, g + constants.rate * dt)
        if me == 0:
            add_terms(constants, sums, arrays.tally)
        o, ahead, predicted, after, buffer = ahead, o, after, predicted, 1 - buffer
        if turning is not None:
            current_spins, next_spins = next_spins, current_spins
        done += 1
        path += longest
    if done % 2:
        arrays.o[begin:stop] = arrays.ahead[begin:stop]
    return status, done
