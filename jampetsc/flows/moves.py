"""What time steps of steady shear are made of: what is constant, where disks are, moves of a domain's disks, sums."""

from typing import NamedTuple

import numpy as np

from jampetsc.core.compiled import FAST, NUMBERS, compiled
from jampetsc.core.domains import Domains, choose_near
from jampetsc.core.pairs import are_worn, is_stale

# Σ f_x r_y and Σ f·r of elastic and viscous bonds, Σ m u_x u_y and Σ m |u|², U, dissipation, iterations, steps
TALLY = ("elastic_xy", "elastic", "viscous_xy", "viscous", "kinetic_xy", "kinetic", "energy", "dissipation")
TALLY += ("iterations", "steps")
SUMMED = 8  # of them are sums over domains; each domain also has the farthest offset and the longest move
ITERATIONS, STEPS = (TALLY.index(name) for name in ("iterations", "steps"))
DONE, STALE, BLOWN_UP, UNSOLVED = range(4)
JUMP = 0.5  # σ_max: the longest move of one step; beyond it the step is unstable
FAR = 1e300  # moved so far, no pairs are near any more


class Task(NamedTuple):
    """What the steps from one list to the next are."""

    law: tuple  # `Potential.constants`
    weights: tuple  # (c_∥, c_⊥, c_s) of contacts
    drag: float
    mass: float
    rate: float
    background: float  # η_F V
    held: int  # the first so many disks keep u = 0
    listed: tuple  # (σ_max, skin of the list, that of the near pairs)
    step: float  # Δt
    heun: bool
    tolerance: float  # of velocities
    since: int  # steps since the list was made


class Space(NamedTuple):
    """Where disks are, and what goes with it."""

    listed: Domains
    near: Domains
    o: np.ndarray  # (N, 2)
    ahead: np.ndarray  # (N, 2) where they go next
    u: np.ndarray  # (N, 2)
    after: np.ndarray  # (2, N, 2) velocities at other times
    forces: np.ndarray  # (N, 2)
    sums: (
        np.ndarray
    )  # (2, D, SUMMED + 2) of a domain, for two meetings: some threads still read those of the last one
    seen: np.ndarray  # (TALLY,)


@compiled(False)
def move(o, u, g, dt, out):
    """out = o + dt (u_x − g u_y, u_y), all (n, 2); returns max |out| and the longest move, NaN where there is one."""
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


@compiled(NUMBERS, forceinline=True)
def drift(o, forces, mobility, g, dt, u, out):
    """u = mobility · forces, and out = o moved by it, (n, 2) each, in one pass: four would take half as long as forces.

    Returns (max |out|, longest move, NaN where there is one, Σ u_x u_y, Σ |u|²).
    """
    far = longest = xy = squares = 0.0
    for a in range(len(o)):
        ux, uy = mobility * forces[a, 0], mobility * forces[a, 1]
        dx, dy = dt * (ux - g * uy), dt * uy
        x, y = o[a, 0] + dx, o[a, 1] + dy
        u[a, 0], u[a, 1] = ux, uy
        out[a, 0], out[a, 1] = x, y
        xy += ux * uy
        squares += ux * ux + uy * uy
        reach, move = x * x + y * y, dx * dx + dy * dy
        far = reach if reach > far else far
        longest = move if move > longest else longest
    return np.sqrt(far), np.sqrt(longest) if squares == squares else np.nan, xy, squares


@compiled(NUMBERS, forceinline=True)
def kick(o, forces, predicted, task, g, u, a_last, after, out):
    """Accelerations into a_last, u half a step on, and out = o moved by it, (n, 2) each, in one pass.

    forces: of bonds; `predicted`: the velocities now; `after`: those predicted for the next step. Returns as `drift`,
    the sums of the velocities now.
    """
    drag, mass, rate, dt = task.drag, task.mass, task.rate, task.step
    far = longest = xy = squares = total = 0.0
    for a in range(len(o)):
        px, py = predicted[a, 0], predicted[a, 1]
        ax, ay = (forces[a, 0] - drag * px) / mass - rate * py, (forces[a, 1] - drag * py) / mass
        ux, uy = u[a, 0] + dt * ax, u[a, 1] + dt * ay
        dx, dy = dt * (ux - g * uy), dt * uy
        x, y = o[a, 0] + dx, o[a, 1] + dy
        after[a, 0], after[a, 1] = ux + 0.5 * dt * ax, uy + 0.5 * dt * ay
        a_last[a, 0], a_last[a, 1] = ax, ay
        u[a, 0], u[a, 1] = ux, uy
        out[a, 0], out[a, 1] = x, y
        xy += px * py
        squares += px * px + py * py
        total += dx
        reach, move = x * x + y * y, dx * dx + dy * dy
        far = reach if reach > far else far
        longest = move if move > longest else longest
    return np.sqrt(far), np.sqrt(longest) if total == total else np.nan, xy, squares


@compiled(FAST, forceinline=True)
def squares_of(u):
    """(Σ u_x u_y, Σ |u|²) of u (n, 2)."""
    xy = squares = 0.0
    for a in range(len(u)):
        xy += u[a, 0] * u[a, 1]
        squares += u[a, 0] * u[a, 0] + u[a, 1] * u[a, 1]
    return xy, squares


@compiled(FAST, forceinline=True)
def note(task, sums, xy, squares, seen):
    """What one domain has of an instant into `seen`; sums: of its bonds, xy and squares: see `squares_of`."""
    alpha = 2.5 if task.law[1] else 2.0
    seen[0] = sums.elastic_xy
    seen[1] = sums.elastic_xx + sums.elastic_yy
    seen[2] = sums.viscous_xy
    seen[3] = sums.viscous_xx + sums.viscous_yy
    seen[4] = task.mass * xy
    seen[5] = task.mass * squares
    seen[6] = sums.energy / alpha + 0.5 * task.mass * squares
    seen[7] = sums.dissipation + task.drag * squares


@compiled(False)
def tell(task, sums, seen):
    """Add what all domains have noted, sums (D, SUMMED + 2), to `seen`, and what the fluid behind the disks has."""
    fluid = task.background * task.rate
    for s in range(SUMMED):
        total = 0.0
        for d in range(len(sums)):
            total += sums[d, s]
        seen[s] += total
    seen[2] -= fluid
    seen[7] += fluid * task.rate
    seen[STEPS] += 1.0


@compiled(False)
def verdict_of(far, longest, g, listed):
    """What a move means for the list: listed = (σ_max, its skin, that of its near pairs)."""
    if not longest <= JUMP * listed[0]:
        return BLOWN_UP
    return STALE if is_stale(far, 0.0, g, listed[0], listed[1]) else DONE


@compiled(False)
def reached(task, sums, g):
    """(`verdict_of` the moves of all domains, the longest one)."""
    far = longest = 0.0
    for d in range(len(sums)):
        far = max(far, sums[d, SUMMED])
        move = sums[d, SUMMED + 1]
        longest = longest if move <= longest or longest != longest else move  # NaN stays
    return verdict_of(far, longest, g, task.listed), longest


@compiled(False)
def own_domains(me, threads, space):
    """(first, last + 1) of the domains of thread `me`, and its disks likewise."""
    disks = space.listed.disks
    number = len(disks) - 1
    first, last = me * number // threads, (me + 1) * number // threads
    return first, last, disks[first], disks[last]


@compiled(False)
def with_near(space, task, mine, o, g, moved, then):
    """Near pairs that serve at offsets o and shear g; (moved, then) as in `core.pairs.are_worn`, FAR at first."""
    largest, _, skin = task.listed
    if not are_worn(moved, g, then, largest, skin):
        return moved, then
    for d in mine:
        choose_near(space.listed, d, o, g, skin, space.near)
    return 0.0, g
