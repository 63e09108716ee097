"""Time steps of steady shear, compiled: overdamped against drag, overdamped or implicit on contacts, and massive.

Positions are offsets o in the coordinates of the last pair list, γ_ref; g = γ − γ_ref; u is the non-affine
velocity in the laboratory, the same in every frame (Vågberg, thesis eqs. 4.1–4.5):

    ȯ = (u_x − g u_y, u_y),    u̇ = F/m − γ̇ u_y x̂  (SLLOD, 4.25)    or    F(u) = 0  without mass

A move takes g in the middle of its step: exact for constant u. Every function steps until `steps` are done, the
list is stale or something is wrong, and adds what it sees to `tally`, whose entries are the sums over time
steps of TALLY. All begin with the forces at a list that is not stale and end with a move.
"""

import numba
import numpy as np

from jampetsc.contacts.kernel import FAST, NUMBERS, bond_forces
from jampetsc.contacts.pairs import FAR, is_stale, nearest
from jampetsc.flows.resistance import centre_clusters, contact_graph, solve

# Σ f_x r_y and Σ f·r of elastic and viscous bonds, Σ m u_x u_y and Σ m |u|², U, dissipation, iterations, steps
TALLY = ("elastic_xy", "elastic", "viscous_xy", "viscous", "kinetic_xy", "kinetic", "energy", "dissipation")
TALLY += ("iterations", "steps")
DONE, STALE, BLOWN_UP, UNSOLVED = range(4)
JUMP = 0.5  # σ_max: the longest move of one step; beyond it the step is unstable


@numba.njit(cache=True, fastmath=False, error_model="numpy")
def move(o, u, g, dt, out):
    """out = o + dt (u_x − g u_y, u_y), all (N, 2); returns max |out| and the longest move, NaN where there is one."""
    far = longest = total = 0.0
    for a in range(len(o)):
        dx = dt * (u[a, 0] - g * u[a, 1])
        dy = dt * u[a, 1]
        x = o[a, 0] + dx
        y = o[a, 1] + dy
        out[a, 0] = x
        out[a, 1] = y
        far = max(far, x * x + y * y)
        longest = max(longest, dx * dx + dy * dy)
        total += dx
    return np.sqrt(far), np.sqrt(longest) if total == total else np.nan


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def note(tally, sums, alpha, u, mass, drag, rate, background):
    """Add one instant to the tally; sums: of `bond_forces`; background = η_F V."""
    xy = squares = 0.0
    for a in range(len(u)):
        xy += u[a, 0] * u[a, 1]
        squares += u[a, 0] * u[a, 0] + u[a, 1] * u[a, 1]
    add(tally, sums, alpha, xy, squares, mass, drag, rate, background)


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def add(tally, sums, alpha, xy, squares, mass, drag, rate, background):
    """As `note`, with Σ u_x u_y and Σ |u|²."""
    fluid = background * rate
    tally[0] += sums[2]
    tally[1] += sums[1] + sums[3]
    tally[2] += sums[7] - fluid
    tally[3] += sums[6] + sums[9]
    tally[4] += mass * xy
    tally[5] += mass * squares
    tally[6] += sums[0] / alpha + 0.5 * mass * squares
    tally[7] += sums[5] + drag * squares + fluid * rate
    tally[9] += 1.0


@numba.njit(cache=True, fastmath=NUMBERS, error_model="numpy")
def drift(o, forces, mobility, g, dt, u):
    """u = mobility · forces, and o moved by it, (N, 2) each, in one pass: four would take as long as half the forces.

    Returns (max |o|, longest move, NaN where there is one, Σ u_x u_y, Σ |u|²).
    """
    far = longest = xy = squares = 0.0
    for a in range(len(o)):
        ux, uy = mobility * forces[a, 0], mobility * forces[a, 1]
        dx, dy = dt * (ux - g * uy), dt * uy
        x, y = o[a, 0] + dx, o[a, 1] + dy
        u[a, 0], u[a, 1] = ux, uy
        o[a, 0], o[a, 1] = x, y
        xy += ux * uy
        squares += ux * ux + uy * uy
        reach, move = x * x + y * y, dx * dx + dy * dy
        far = reach if reach > far else far
        longest = move if move > longest else longest
    return np.sqrt(far), np.sqrt(longest) if squares == squares else np.nan, xy, squares


@numba.njit(cache=True, fastmath=NUMBERS, error_model="numpy")
def kick(o, forces, predicted, physics, g, dt, u, a_last):
    """Accelerations into a_last, u half a step to now and half a step on, and o moved by it, (N, 2) each, in one pass.

    forces: of bonds; physics: of `massive_steps`. `predicted` holds the velocities now, and then those at the next
    step. Returns as `drift`, the sums of the velocities now.
    """
    drag, mass, rate = physics[0], physics[1], physics[2]
    far = longest = xy = squares = total = 0.0
    for a in range(len(o)):
        px, py = predicted[a, 0], predicted[a, 1]
        ax, ay = (forces[a, 0] - drag * px) / mass - rate * py, (forces[a, 1] - drag * py) / mass
        ux, uy = u[a, 0] + dt * ax, u[a, 1] + dt * ay
        dx, dy = dt * (ux - g * uy), dt * uy
        x, y = o[a, 0] + dx, o[a, 1] + dy
        predicted[a, 0], predicted[a, 1] = ux + 0.5 * dt * ax, uy + 0.5 * dt * ay
        a_last[a, 0], a_last[a, 1] = ax, ay
        u[a, 0], u[a, 1] = ux, uy
        o[a, 0], o[a, 1] = x, y
        xy += px * py
        squares += px * px + py * py
        total += dx
        reach, move = x * x + y * y, dx * dx + dy * dy
        far = reach if reach > far else far
        longest = move if move > longest else longest
    return np.sqrt(far), np.sqrt(longest) if total == total else np.nan, xy, squares


@numba.njit(cache=True, fastmath=False)
def verdict_of(far, longest, g, listed):
    """What a move means for the list: listed = (σ_max, its skin, that of its near pairs)."""
    if not longest <= JUMP * listed[0]:
        return BLOWN_UP
    return STALE if is_stale(far, 0.0, g, listed[0], listed[1]) else DONE


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def drag_steps(pairs, listed, law, physics, clock, o, u, forces, heun, tally, steps):
    """Overdamped disks in a fluid, u = f/(k_d drag), by Euler or Heun.

    physics = (drag, mass, rate, η_F V, held): the first `held` disks keep u = 0; clock = (Δt, steps since the list
    was made). Returns (steps done, status).
    """
    drag, _, rate, background, held = physics
    dt, since = clock
    alpha = 2.5 if law[1] else 2.0
    ahead, u2 = np.empty_like(o), np.empty_like(u)
    near = pairs, FAR, 0.0
    for step in range(steps):
        g = (since + step) * rate * dt
        middle = g + 0.5 * rate * dt
        near = nearest(pairs, near, o, g, listed)
        sums = bond_forces(near[0], o, 0.0, g, law, forces, None, None)
        forces[:held] = 0.0
        if not heun:
            far, longest, xy, squares = drift(o, forces, 1.0 / drag, middle, dt, u)
            add(tally, sums, alpha, xy, squares, 0.0, drag, rate, background)
        else:
            for a in range(len(u)):
                u[a, 0] = forces[a, 0] / drag
                u[a, 1] = forces[a, 1] / drag
            far, longest = move(o, u, middle, dt, ahead)
            verdict = verdict_of(far, longest, g + rate * dt, listed)
            if verdict != DONE:
                return step, verdict
            bond_forces(pairs, ahead, 0.0, g + rate * dt, law, forces, None, None)
            forces[:held] = 0.0
            for a in range(len(u)):
                u2[a, 0] = 0.5 * (u[a, 0] + forces[a, 0] / drag)
                u2[a, 1] = 0.5 * (u[a, 1] + forces[a, 1] / drag)
            note(tally, sums, alpha, u, 0.0, drag, rate, background)
            far, longest = move(o, u2, middle, dt, o)
        near = near[0], near[1] + longest, near[2]
        verdict = verdict_of(far, longest, g + rate * dt, listed)
        if verdict != DONE:
            return step + 1, verdict
    return steps, DONE


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def residual_at(pairs, o, g, law, weights, physics, u, forces, rolling):
    """m u̇ at velocities u into `forces`, what is not balanced: bonds, drag and SLLOD's shift of momentum.

    Held disks have u̇ = 0. rolling: None, or (Ω, ρ, torques), each (N,); see `bond_forces`, whose sums it returns.
    """
    drag, mass, rate, _, held = physics
    sums = bond_forces(pairs, o, 0.0, g, law, forces, (u, rate, weights), rolling)
    for a in range(len(u)):
        forces[a, 0] -= drag * u[a, 0] + mass * rate * u[a, 1]
        forces[a, 1] -= drag * u[a, 1]
    forces[:held] = 0.0
    if rolling is not None:
        _, _, torques = rolling
        torques[:held] = 0.0
    return sums


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def centre(graph, physics, u):
    """What no force decides: mean u of each cluster without inertia and drag, of all disks with inertia alone."""
    drag, mass, _, _, held = physics
    if drag > 0.0:
        return
    if mass == 0.0:
        centre_clusters(graph, u)
        return
    if held > 0:
        return
    for axis in range(2):
        u[:, axis] -= np.mean(u[:, axis])


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def balance(pairs, o, g, law, weights, physics, dt, u, forces, tolerance):
    """Velocities at which forces balance, or that backward Euler gives a mass, into u; returns iterations."""
    residual_at(pairs, o, g, law, weights, physics, u, forces, None)
    graph = contact_graph(pairs, o, g, len(u), physics[4], weights[0] != weights[1])
    iterations = solve(graph, weights, physics[0] + physics[1] / dt, forces, u, tolerance)
    centre(graph, physics, u)
    return iterations


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def seen_and_moved(pairs, listed, law, weights, physics, dt, g, o, u, velocity, forces, tally):
    """The end of a step: note what there is at velocities u, and move by `velocity`: (verdict, the longest move)."""
    drag, mass, rate, background, _ = physics
    sums = bond_forces(pairs, o, 0.0, g, law, forces, (u, rate, weights), None)
    note(tally, sums, 2.5 if law[1] else 2.0, u, mass, drag, rate, background)
    far, longest = move(o, velocity, g + 0.5 * rate * dt, dt, o)
    return verdict_of(far, longest, g + rate * dt, listed), longest


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def contact_steps(pairs, listed, law, weights, physics, clock, o, u, forces, tolerance, heun, tally, steps):
    """Disks damped by contacts, implicit in the velocities: without mass by Euler or Heun, with mass by Euler.

    weights = (c_∥, c_⊥, 0); the rest as for `drag_steps`.
    """
    rate = physics[2]
    dt, since = clock
    ahead, u2 = np.empty_like(o), np.empty_like(u)
    near = pairs, FAR, 0.0
    for step in range(steps):
        g = (since + step) * rate * dt
        near = nearest(pairs, near, o, g, listed)
        iterations = balance(near[0], o, g, law, weights, physics, dt, u, forces, tolerance)
        if iterations < 0:
            return step, UNSOLVED
        tally[8] += iterations
        velocity = u
        if heun:
            far, longest = move(o, u, g + 0.5 * rate * dt, dt, ahead)
            verdict = verdict_of(far, longest, g + rate * dt, listed)
            if verdict != DONE:
                return step, verdict
            u2[:] = u
            iterations = balance(
                pairs, ahead, g + rate * dt, law, weights, physics, dt, u2, forces, tolerance
            )
            if iterations < 0:
                return step, UNSOLVED
            for a in range(len(u)):
                u2[a, 0] = 0.5 * (u[a, 0] + u2[a, 0])
                u2[a, 1] = 0.5 * (u[a, 1] + u2[a, 1])
            velocity = u2
        verdict, longest = seen_and_moved(
            near[0], listed, law, weights, physics, dt, g, o, u, velocity, forces, tally
        )
        near = near[0], near[1] + longest, near[2]
        if verdict != DONE:
            return step + 1, verdict
    return steps, DONE


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def massive_steps(pairs, listed, law, weights, physics, clock, o, u, a_last, forces, rolling, tally, steps):
    """Massive disks by velocity Verlet, one force per step, taken at the predicted velocity.

    u (N, 2) is the velocity half a step ago and a_last (N, 2) the acceleration one step ago.
    rolling: None, or (Ω half a step ago, Ω̇ one step ago, ρ, moments of inertia), each (N,).
    """
    drag, mass, rate, background, held = physics
    dt, since = clock
    alpha = 2.5 if law[1] else 2.0
    predicted = u + 0.5 * dt * a_last
    if rolling is None:
        spins = None
    else:
        spin, spin_last, radii, inertia = rolling
        turning, torques = np.empty_like(spin), np.empty_like(spin)
        spins = turning, radii, torques
    near = pairs, FAR, 0.0
    for step in range(steps):
        g = (since + step) * rate * dt
        if rolling is not None:
            for a in range(len(u)):
                turning[a] = spin[a] + 0.5 * dt * spin_last[a]
        near = nearest(pairs, near, o, g, listed)
        sums = bond_forces(near[0], o, 0.0, g, law, forces, (predicted, rate, weights), spins)
        forces[:held] = 0.0
        if rolling is not None:
            for a in range(len(u)):
                tally[6] += 0.5 * inertia[a] * turning[a] * turning[a]
            torques[:held] = 0.0
        far, longest, xy, squares = kick(o, forces, predicted, physics, g + 0.5 * rate * dt, dt, u, a_last)
        add(tally, sums, alpha, xy, squares, mass, drag, rate, background)
        if rolling is not None:
            for a in range(len(u)):
                spin_last[a] = torques[a] / inertia[a]
                spin[a] += dt * spin_last[a]
        near = near[0], near[1] + longest, near[2]
        verdict = verdict_of(far, longest, g + rate * dt, listed)
        if verdict != DONE:
            return step + 1, verdict
    return steps, DONE
