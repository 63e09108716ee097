"""Parts of the time steps of steady shear: their constants and arrays, moves of the disks of a domain, sums."""

from typing import NamedTuple

import numpy as np

from jampetsc.packing.bond import exponent_of, simple_shear
from jampetsc.packing.compiled import FAST, NUMBERS, compiled, nested
from jampetsc.packing.kernel import elastic_trace, viscous_trace
from jampetsc.packing.neighbour_list import NeighbourList, choose_inner_list, inner_list_is_stale, is_stale

# Σ f_x r_y and Σ f·r of elastic and viscous bonds, Σ m u_x u_y and Σ m |u|², energy U + kinetic, dissipation,
# iterations, steps
TALLY = ("elastic_xy", "elastic", "viscous_xy", "viscous", "kinetic_xy", "kinetic", "energy", "dissipation")
TALLY += ("iterations", "steps")
# the first ones, sums over domains; the last two columns of `StepArrays.sums`: max |o| and longest move of a domain
SUMMED = 8
ITERATIONS, STEPS = (TALLY.index(name) for name in ("iterations", "steps"))
DONE, STALE, BLOWN_UP, UNSOLVED = range(4)
MAX_MOVE_RATIO = 0.5  # in units of σ_max, longest move of a stable step
UNSET_PATH = 1e300  # as path where no inner list was made yet


class StepConstants(NamedTuple):
    """Constants of the time steps from one pair list to the next."""

    potential: tuple  # `Potential.constants`
    weights: tuple  # (c_∥, c_⊥, c_s) of contacts
    drag: float  # of a disk, force over velocity
    mass: float
    largest_force: float  # force of two disks at the same place
    rate: float
    background: float  # η_F kτ₁ V, viscosity of the fluid
    wall_disks: int  # number of disks, the first ones, that keep u = 0
    list_widths: tuple  # (σ_max, skin of the list, that of the inner list)
    step: float  # Δt
    heun: bool
    tolerance: float  # of velocities
    list_age: int  # steps from the list to the first of these


class StepArrays(NamedTuple):
    """Arrays that time steps read and write, shared by all threads."""

    pairs: NeighbourList  # of the neighbour list
    inner_pairs: NeighbourList  # of the inner list
    o: np.ndarray  # (N, D) offsets
    ahead: np.ndarray  # (N, D) offsets after the step, of the predictor or of the whole
    u: np.ndarray  # (N, D) non-affine velocities
    after: np.ndarray  # (2, N, D) velocities at other times
    forces: np.ndarray  # (N, D)
    sums: np.ndarray  # (2, domains, SUMMED + 2); two in turn: some threads still read the last ones
    tally: np.ndarray  # (TALLY,) sums over time steps


@compiled(False)
def move(o, u, g, dt, out, like):
    """out = o + dt (u_x − g u_y, u_y, u_z), all (n, D); returns max |out| and the longest move, NaN if any is.

    like, here and below: a tuple of length D.
    """
    far = longest = total = 0.0
    for a in range(len(o)):
        dx = dt * (u[a, 0] - g * u[a, 1])
        dy = dt * u[a, 1]
        x = o[a, 0] + dx
        y = o[a, 1] + dy
        out[a, 0] = x
        out[a, 1] = y
        if len(like) == 3:
            dz = dt * u[a, 2]
            z = o[a, 2] + dz
            out[a, 2] = z
            far = max(far, x * x + y * y + z * z)
            longest = max(longest, dx * dx + dy * dy + dz * dz)
            total += dz
        else:
            far = max(far, x * x + y * y)
            longest = max(longest, dx * dx + dy * dy)
        total += dx
    return np.sqrt(far), np.sqrt(longest) if total == total else np.nan


@compiled(NUMBERS, forceinline=True)
def drift(o, forces, mobility, g, dt, u, out, like):
    """u = mobility · forces, and out = o moved by it, (n, D) each.

    In one pass: four of them would take half as long as the forces. Returns (max |out|, longest move, NaN if any is,
    Σ u_x u_y, Σ |u|²).
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
        if len(like) == 3:
            uz = mobility * forces[a, 2]
            dz = dt * uz
            z = o[a, 2] + dz
            u[a, 2], out[a, 2] = uz, z
            squares += uz * uz
            reach += z * z
            move += dz * dz
        far = reach if reach > far else far
        longest = move if move > longest else longest
    return np.sqrt(far), np.sqrt(longest) if squares == squares else np.nan, xy, squares


@compiled(NUMBERS, forceinline=True)
def kick(o, forces, predicted, constants, g, u, after, out, like):
    """Move u from half a step before to half a step after now, out = o moved by it, (n, D) each.

    forces: of bonds, turned into accelerations; `predicted`: velocities now; `after`: those predicted for the next
    step. Returns the same as `drift`, with the sums of the velocities now.
    """
    drag, mass, rate, dt = constants.drag, constants.mass, constants.rate, constants.step
    far = longest = xy = squares = total = 0.0
    for a in range(len(o)):
        px, py = predicted[a, 0], predicted[a, 1]
        ax, ay = (forces[a, 0] - drag * px) / mass - rate * py, (forces[a, 1] - drag * py) / mass
        ux, uy = u[a, 0] + dt * ax, u[a, 1] + dt * ay
        dx, dy = dt * (ux - g * uy), dt * uy
        x, y = o[a, 0] + dx, o[a, 1] + dy
        after[a, 0], after[a, 1] = ux + 0.5 * dt * ax, uy + 0.5 * dt * ay
        forces[a, 0], forces[a, 1] = ax, ay
        u[a, 0], u[a, 1] = ux, uy
        out[a, 0], out[a, 1] = x, y
        xy += px * py
        squares += px * px + py * py
        total += dx
        reach, move = x * x + y * y, dx * dx + dy * dy
        if len(like) == 3:
            pz = predicted[a, 2]
            az = (forces[a, 2] - drag * pz) / mass
            uz = u[a, 2] + dt * az
            z = o[a, 2] + dt * uz
            after[a, 2], forces[a, 2], u[a, 2], out[a, 2] = uz + 0.5 * dt * az, az, uz, z
            squares += pz * pz
            reach += z * z
            move += dt * uz * dt * uz
            total += uz
        far = reach if reach > far else far
        longest = move if move > longest else longest
    return np.sqrt(far), np.sqrt(longest) if total == total else np.nan, xy, squares


@nested(FAST, forceinline=True)
def squares_of(u, like):
    """(Σ u_x u_y, Σ |u|²) of u (n, D)."""
    xy = squares = 0.0
    for a in range(len(u)):
        xy += u[a, 0] * u[a, 1]
        squares += u[a, 0] * u[a, 0] + u[a, 1] * u[a, 1]
        if len(like) == 3:
            squares += u[a, 2] * u[a, 2]
    return xy, squares


@nested(FAST, forceinline=True)
def write_terms(constants, bonds, xy, squares, row):
    """The terms of TALLY of one domain into `row`; bonds: Sums of its forces; xy, squares: see `squares_of`."""
    row[0] = bonds.elastic_xy
    row[1] = elastic_trace(bonds)
    row[2] = bonds.viscous_xy
    row[3] = viscous_trace(bonds)
    row[4] = constants.mass * xy
    row[5] = constants.mass * squares
    row[6] = bonds.energy / exponent_of(constants.potential) + 0.5 * constants.mass * squares
    row[7] = bonds.dissipation + constants.drag * squares


@nested(False)
def add_terms(constants, sums, tally):
    """Add a time step to `tally` (TALLY,): terms of all domains, sums (D, SUMMED + 2), and of the background fluid."""
    fluid = constants.background * constants.rate
    for s in range(SUMMED):
        total = 0.0
        for d in range(len(sums)):
            total += sums[d, s]
        tally[s] += total
    tally[2] -= fluid
    tally[7] += fluid * constants.rate
    tally[STEPS] += 1.0


@compiled(False)
def status_of(far, longest, g, list_widths):
    """BLOWN_UP, STALE or DONE after a move; far = max |o|; list_widths of `StepConstants`."""
    if not longest <= MAX_MOVE_RATIO * list_widths[0]:
        return BLOWN_UP
    return STALE if is_stale(far, simple_shear(g), list_widths[0], list_widths[1]) else DONE


@compiled(False)
def joint_status(constants, sums, g):
    """(`status_of` the moves of all domains, longest move), from sums (D, SUMMED + 2)."""
    far = longest = 0.0
    for d in range(len(sums)):
        far = max(far, sums[d, SUMMED])
        move = sums[d, SUMMED + 1]
        longest = longest if move <= longest or longest != longest else move  # NaN stays
    return status_of(far, longest, g, constants.list_widths), longest


@nested(False)
def find_own_domains(me, threads, arrays):
    """(first, last + 1) of the domains of thread `me`, and of their disks."""
    disks = arrays.pairs.disks
    number = len(disks) - 1
    first, last = me * number // threads, (me + 1) * number // threads
    return first, last, disks[first], disks[last]


@nested(False)
def update_inner_list(arrays, constants, domains, o, g, path, list_shear):
    """Make the inner list again if the present one may miss a contact at offsets o and shear g.

    path: of the disks since it was made, UNSET_PATH before the first time; list_shear: shear at which it was made.
    Returns (path, list_shear) of the inner list that serves now; see `inner_list_is_stale`.
    """
    largest, _, skin = constants.list_widths
    if not inner_list_is_stale(path, simple_shear(g), simple_shear(list_shear), largest, skin):
        return path, list_shear
    for d in domains:
        choose_inner_list(arrays.pairs, d, o, simple_shear(g), skin, arrays.inner_pairs)
    return 0.0, g
