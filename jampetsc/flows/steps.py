"""Time steps of steady shear, compiled: overdamped against drag, overdamped or implicit on contacts, and massive.

Positions are offsets o in the coordinates of the last pair list, γ_ref; g = γ − γ_ref; u is the non-affine
velocity in the laboratory, the same in every frame (Vågberg, thesis eqs. 4.1–4.5):

    ȯ = (u_x − g u_y, u_y),    u̇ = F/m − γ̇ u_y x̂  (SLLOD, 4.25)    or    F(u) = 0  without mass

A move takes g in the middle of its step: exact for constant u. Every function steps until `steps` are done, the
list is stale or something is wrong, and adds the terms of TALLY of each time step to `tally`. A step begins with
forces, from a list that is not stale, and ends with a move.

All are run by a `packing.threads.Team`, thread `me` of `threads`, each on its domains: it reads arrays of all disks and
writes rows of its own, where no other thread reads before the next barrier (`meet`). So a step takes one barrier, two
by Heun's method, besides those of a solve for velocities. All threads take the same decisions, from the same sums.
"""

from typing import NamedTuple

import numpy as np

from jampetsc.flows.clusters import centre_clusters_of, find_clusters_of, unite_clusters
from jampetsc.flows.moves import (
    DONE,
    ITERATIONS,
    SUMMED,
    UNSET_PATH,
    UNSOLVED,
    add_terms,
    drift,
    joint_status,
    kick,
    move,
    own_domains,
    renew_near_pairs,
    squares_of,
    write_terms,
)  # fmt: skip
from jampetsc.flows.resistance import Graph, Search, find_contacts_of, solve
from jampetsc.packing.compiled import FAST, compiled
from jampetsc.packing.domains import domain_forces
from jampetsc.packing.kernel import block_room
from jampetsc.packing.threads import meet

ROUNDING = 1e-15  # of a force, relative


class ContactSolve(NamedTuple):
    """Contact graph and work arrays of a solve for velocities."""

    graph: Graph
    search: Search


@compiled(FAST, nogil=True)
def drag_steps(me, threads, counter, space, task, steps):
    """Overdamped disks in a fluid, u = f/drag, by Euler or Heun: (status, steps done)."""
    first, last, begin, stop = own_domains(me, threads, space)
    mine = range(first, last)
    disks, forces, u, o, ahead = space.listed.disks, space.forces, space.u, space.o, space.ahead
    mobility, room, buffer, done, status = 1.0 / task.drag, block_room(), 0, 0, DONE
    moved, then = UNSET_PATH, 0.0
    while done < steps and status == DONE:
        g = (task.since + done) * task.rate * task.step
        middle, later = g + 0.5 * task.rate * task.step, g + task.rate * task.step
        moved, then = renew_near_pairs(space, task, mine, o, g, moved, then)
        longest = 0.0
        for part in range(2 if task.heun else 1):
            pairs, place, shear = (space.near, o, g) if part == 0 else (space.listed, ahead, later)
            sums = space.sums[buffer]
            for d in mine:
                own = slice(disks[d], disks[d + 1])
                bonds = domain_forces(pairs, d, place, 0.0, shear, task.law, forces, None, None, room)
                forces[disks[d] : task.held] = 0.0
                if part == 0:
                    far, longest, xy, squares = drift(
                        o[own], forces[own], mobility, middle, task.step, u[own], ahead[own]
                    )
                    write_terms(task, bonds, xy, squares, sums[d])
                else:
                    f = forces[own]
                    for a in range(len(f)):
                        f[a, 0] = 0.5 * (u[a + disks[d], 0] + mobility * f[a, 0])
                        f[a, 1] = 0.5 * (u[a + disks[d], 1] + mobility * f[a, 1])
                    far, longest = move(o[own], f, middle, task.step, o[own])
                sums[d, SUMMED], sums[d, SUMMED + 1] = far, longest
            meet(counter, threads)
            buffer = 1 - buffer
            status, longest = joint_status(task, sums, later)
            if part == 0 and task.heun and status != DONE:
                return status, done
            if part == 0 and me == 0:
                add_terms(task, sums, space.tally)
        if not task.heun:
            o, ahead = ahead, o
        done += 1
        moved += longest
    if not task.heun and done % 2:
        space.o[begin:stop] = space.ahead[begin:stop]
    return status, done


@compiled(FAST, forceinline=True)
def residual_at(pairs, d, o, g, task, u, forces, rolling, room):
    """Net force m u̇ on the disks of domain d at velocities u into `forces`: bonds, drag and −m γ̇ u_y x̂ of SLLOD.

    Held disks have u̇ = 0. rolling: None, or (Ω, ρ, torques), each (N,); see `bond_forces`, whose Sums it returns.
    """
    sums = domain_forces(pairs, d, o, 0.0, g, task.law, forces, (u, task.rate, task.weights), rolling, room)
    begin = pairs.disks[d]
    for a in range(begin, pairs.disks[d + 1]):
        forces[a, 0] -= task.drag * u[a, 0] + task.mass * task.rate * u[a, 1]
        forces[a, 1] -= task.drag * u[a, 1]
    forces[begin : task.held] = 0.0
    if rolling is not None:
        rolling[2][begin : task.held] = 0.0
    return sums


@compiled(FAST, nogil=True, forceinline=True)
def balance(me, threads, counter, space, task, contacts, pairs, o, g, u, room):
    """Solve for u: velocities at which forces balance, or with a mass those of a step of backward Euler.

    Returns (UNSOLVED or DONE, iterations), after a barrier.
    """
    first, last, _, _ = own_domains(me, threads, space)
    graph = contacts.graph
    for d in range(first, last):
        bonds = residual_at(pairs, d, o, g, task, u, space.forces, None, room)
        # elastic forces follow from distances; squares of viscous ones are weights times dissipation
        elastic = (graph.disks[d + 1] - graph.disks[d]) * (ROUNDING * task.strongest) ** 2
        contacts.search.rounding[d] = elastic + ROUNDING**2 * max(task.weights) * bonds.dissipation
        find_contacts_of(pairs, d, o, g, graph)
    hold = task.drag + task.mass / task.step
    iterations = solve(
        me, threads, counter, graph, task.weights, hold, space.forces, u, task.tolerance, contacts.search
    )
    # set to zero: mean u of each cluster, which no force determines without mass and drag; that of all disks with mass
    # and neither drag nor walls, which forces do not change
    free = task.drag == 0.0 and task.mass == 0.0
    if free:
        for d in range(first, last):
            find_clusters_of(graph, d, u)
    meet(counter, threads)
    if free and me == 0:
        unite_clusters(pairs, graph)
    elif me == 0 and task.drag == 0.0 and task.held == 0:
        for axis in range(2):
            u[:, axis] -= np.mean(u[:, axis])
    meet(counter, threads)
    if free:
        for d in range(first, last):
            centre_clusters_of(graph, d, u)
        meet(counter, threads)
    return DONE if iterations >= 0 else UNSOLVED, iterations


@compiled(FAST, nogil=True)
def contact_steps(me, threads, counter, space, task, contacts, steps):
    """Disks damped by contacts, implicit in the velocities: without mass by Euler or Heun, with mass by Euler.

    Returns (status, steps done).
    """
    first, last, begin, stop = own_domains(me, threads, space)
    mine = range(first, last)
    disks, o, ahead, u, after = space.listed.disks, space.o, space.ahead, space.u, space.after[0]
    room = block_room()
    done, status = 0, DONE
    moved, then = UNSET_PATH, 0.0
    while done < steps and status == DONE:
        g = (task.since + done) * task.rate * task.step
        middle, later = g + 0.5 * task.rate * task.step, g + task.rate * task.step
        moved, then = renew_near_pairs(space, task, mine, o, g, moved, then)
        for part in range(2 if task.heun else 1):
            pairs, place, shear, v = (
                (space.near, o, g, u) if part == 0 else (space.listed, ahead, later, after)
            )
            solved, iterations = balance(
                me, threads, counter, space, task, contacts, pairs, place, shear, v, room
            )
            status = solved
            if status != DONE:
                break
            if part == 0 and me == 0:
                space.tally[ITERATIONS] += iterations
            if part == 0 and task.heun:
                for d in mine:
                    own = slice(disks[d], disks[d + 1])
                    far, longest = move(o[own], u[own], middle, task.step, ahead[own])
                    space.sums[0, d, SUMMED], space.sums[0, d, SUMMED + 1] = far, longest
                    after[own] = u[own]
                meet(counter, threads)
                status, _ = joint_status(task, space.sums[0], later)
                if status != DONE:
                    break
        if status != DONE:
            break
        if task.heun:
            for a in range(begin, stop):
                after[a, 0] = 0.5 * (u[a, 0] + after[a, 0])
                after[a, 1] = 0.5 * (u[a, 1] + after[a, 1])
        sums = space.sums[1]
        for d in mine:
            own = slice(disks[d], disks[d + 1])
            bonds = domain_forces(
                space.near, d, o, 0.0, g, task.law, space.forces, (u, task.rate, task.weights), None, room
            )
            write_terms(task, bonds, *squares_of(u[own]), sums[d])
            velocity = after[own] if task.heun else u[own]
            far, longest = move(o[own], velocity, middle, task.step, ahead[own])
            sums[d, SUMMED], sums[d, SUMMED + 1] = far, longest
        meet(counter, threads)
        status, longest = joint_status(task, sums, later)
        if me == 0:
            add_terms(task, sums, space.tally)
        o, ahead = ahead, o
        done += 1
        moved += longest
    if done % 2:
        space.o[begin:stop] = space.ahead[begin:stop]
    return status, done


class Turning(NamedTuple):
    """Spins Ω of disks that roll, each (N,)."""

    spins: np.ndarray  # Ω half a step ago
    rates: np.ndarray  # Ω̇ one step ago
    radii: np.ndarray
    inertia: np.ndarray
    now: np.ndarray  # work arrays: Ω now,
    after: np.ndarray  # at the next step,
    torques: np.ndarray


@compiled(FAST, nogil=True)
def massive_steps(me, threads, counter, space, task, turning, steps):
    """Massive disks by velocity Verlet, one force per step, taken at the predicted velocity: (status, steps done).

    u is the velocity half a step ago; `forces` has the acceleration one step ago; turning: None, or a Turning.
    """
    first, last, begin, stop = own_domains(me, threads, space)
    mine = range(first, last)
    dt, forces, u, o, ahead = task.step, space.forces, space.u, space.o, space.ahead
    disks, held, buffer, done, status = space.listed.disks, task.held, 0, 0, DONE
    predicted, after, room = space.after[0], space.after[1], block_room()
    for a in range(begin, stop):
        for axis in range(2):
            predicted[a, axis] = u[a, axis] + 0.5 * dt * forces[a, axis]
    if turning is not None:
        spin, spin_last, inertia, now, then_on, torques = (
            turning.spins, turning.rates, turning.inertia, turning.now, turning.after, turning.torques,
        )  # fmt: skip
        for a in range(begin, stop):
            now[a] = spin[a] + 0.5 * dt * spin_last[a]
    meet(counter, threads)
    moved, then = UNSET_PATH, 0.0
    while done < steps and status == DONE:
        g = (task.since + done) * task.rate * dt
        moved, then = renew_near_pairs(space, task, mine, o, g, moved, then)
        sums = space.sums[buffer]
        for d in mine:
            own = slice(disks[d], disks[d + 1])
            motion = predicted, task.rate, task.weights
            if turning is None:
                bonds = domain_forces(space.near, d, o, 0.0, g, task.law, forces, motion, None, room)
            else:
                rolling = now, turning.radii, torques
                bonds = domain_forces(space.near, d, o, 0.0, g, task.law, forces, motion, rolling, room)
            forces[disks[d] : held] = 0.0
            far, longest, xy, squares = kick(
                o[own], forces[own], predicted[own], task, g + 0.5 * task.rate * dt,
                u[own], after[own], ahead[own],
            )  # fmt: skip
            write_terms(task, bonds, xy, squares, sums[d])
            sums[d, SUMMED], sums[d, SUMMED + 1] = far, longest
            if turning is not None:
                torques[disks[d] : held] = 0.0
                for a in range(disks[d], disks[d + 1]):
                    sums[d, 6] += 0.5 * inertia[a] * now[a] * now[a]
                    spin_last[a] = torques[a] / inertia[a]
                    spin[a] += dt * spin_last[a]
                    then_on[a] = spin[a] + 0.5 * dt * spin_last[a]
        meet(counter, threads)
        status, longest = joint_status(task, sums, g + task.rate * dt)
        if me == 0:
            add_terms(task, sums, space.tally)
        o, ahead, predicted, after, buffer = ahead, o, after, predicted, 1 - buffer
        if turning is not None:
            now, then_on = then_on, now
        done += 1
        moved += longest
    if done % 2:
        space.o[begin:stop] = space.ahead[begin:stop]
    return status, done
