"""L-BFGS: the compiled steps down to a minimum of the enthalpy, with the cell as one or two more coordinates.

Coordinates are the offsets o of the disks since their pairs were listed and, where the cell moves, its strain ε and
shears g in units that make them about as stiff as a disk: x = (o, √N d ε, √N d g). With f the net contact forces,
F = e^ε (1 + g) of `strain.cell_strain` and W = Σ (f/r) r rᵀ,

    ∂H/∂o = −Fᵀ f,    ∂H/∂ε = −(tr W − D p V),    ∂H/∂g_xy = −W_xy + g_yz W_xz,    H = U + p V,

∂H/∂g_xz = −W_xz and ∂H/∂g_yz = −W_yz. A plane has no z.

The direction is that of the two-loop recursion (Nocedal, Math. Comput. 35, 773 (1980)), carried out on inner products
alone, which the loops of `lbfgs_kernels` sum over all disks, in two passes per step. Energies are not used: slopes stay
accurate down to the rounding of forces, differences of energies do not.
"""

from typing import NamedTuple

import numpy as np

from jampetsc.minimisation.lbfgs_kernels import LbfgsArrays, adjust, is_sheared, measure, step
from jampetsc.packing.bond import box_strain
from jampetsc.packing.compiled import compiled, nested
from jampetsc.packing.elementary import exp
from jampetsc.packing.kernel import block_room
from jampetsc.packing.neighbour_list import is_stale
from jampetsc.packing.threads import meet

STRETCH = 0.01  # no side of the cell changes by more than this fraction in one step
UPHILL = 0.9  # a step after which the slope is more than this against it was too long
SHRINKS = 10  # times a step is made shorter

MORE, CONVERGED, STALE = range(3)


class LbfgsProblem(NamedTuple):
    """The potential, what moves, and when to stop."""

    potential: tuple  # `Potential.constants`
    moving: tuple  # of bool: which of ε and the shears move
    push: float  # p V at ε = 0
    scale: float  # √N d: ε and shears times this are lengths, as moves of disks are
    reach: float  # longest move of a disk in one step
    stretch: float  # largest change of a strain of the cell in one step
    widest: float  # diameter of the largest disk
    skin: float  # of the pair list
    softness: float  # first step, in units of the gradient: about 0.1 / contact stiffness
    force: float  # largest force allowed
    box_force: float  # largest |∂H| of each strain allowed
    steps: int  # force evaluations


@compiled(False)
def collect_sums(space, task, total, box_gradient):
    """Sums over all domains into `total`, the gradient of the cell into `box_gradient`; g·g and products complete."""
    rows = len(space.box_pairs)
    total[:] = 0.0
    for d in range(len(space.sums)):
        for s in range(len(total)):
            if s != rows + 2:
                total[s] += space.sums[d, s]
            else:
                total[s] = max(total[s], space.sums[d, s])
    growth = exp(space.box[0])
    box_gradient[:] = 0.0
    dimension = space.offsets.shape[1]
    if task.moving[0]:
        push = dimension * task.push * growth * growth
        if dimension == 3:
            push *= growth
        box_gradient[0] = -(total[rows + 3] - push) / task.scale
    if task.moving[1]:
        if dimension == 3:
            box_gradient[1] = -(total[rows + 4] - space.box[3] * total[rows + 5]) / task.scale
            box_gradient[2] = -total[rows + 5] / task.scale
            box_gradient[3] = -total[rows + 6] / task.scale
        else:
            box_gradient[1] = -total[rows + 4] / task.scale
    for b in range(len(space.box)):
        for row in range(rows):
            total[row] += space.box_pairs[row, b] * box_gradient[b]
        total[rows + 1] += box_gradient[b] * box_gradient[b]


@compiled(False)
def find_direction(total, products, count, head, memory, softness, coefficients):
    """Fill in the coefficients of the direction, of the rows of the pairs and last of the gradient.

    Returns its slope, and the number of pairs to keep: none if they led uphill.
    """
    rows = 2 * memory
    sy, yy = products[0], products[1]
    coefficients[:] = 0.0
    slope = 0.0
    if count > 0:
        alpha = np.zeros(memory)
        delta = np.zeros(memory)
        for back in range(count):
            a = (head - 1 - back) % memory
            rest = total[2 * a]
            for newer in range(back):
                b = (head - 1 - newer) % memory
                rest -= alpha[b] * sy[a, b]
            alpha[a] = rest / sy[a, a]
        newest = (head - 1) % memory
        gamma = sy[newest, newest] / yy[newest, newest]
        for back in range(count - 1, -1, -1):
            a = (head - 1 - back) % memory
            rest = total[2 * a + 1]
            for other in range(count):
                b = (head - 1 - other) % memory
                rest -= alpha[b] * yy[a, b]
            rest *= gamma
            for older in range(count - 1, back, -1):
                b = (head - 1 - older) % memory
                rest += delta[b] * sy[b, a]
            delta[a] = alpha[a] - rest / sy[a, a]
        slope = -gamma * total[rows + 1]
        coefficients[rows] = -gamma
        for back in range(count):
            a = (head - 1 - back) % memory
            coefficients[2 * a] = -delta[a]
            coefficients[2 * a + 1] = gamma * alpha[a]
            slope += coefficients[2 * a] * total[2 * a] + coefficients[2 * a + 1] * total[2 * a + 1]
    if slope >= 0.0:
        coefficients[:] = 0.0
        coefficients[rows] = -softness
        return -softness * total[rows + 1], 0
    return slope, count


@nested(False)
def _adjust_box(box, move, ratio, scale):
    for b in range(len(box)):
        box[b] += (ratio - 1.0) * move[b] / scale
        move[b] *= ratio


@compiled(False, nogil=True)
def descend(me, threads, counter, domains, space, task, count, head):
    """Steps of L-BFGS by thread `me` of `threads`, until the forces are small, the list stale, or `steps` are done.

    counter: for `meet`. count, head: how many pairs are remembered, and where the next one goes. Every thread makes the
    same decisions from the same numbers. Returns (status, evaluations, count, head).
    """
    rows = len(space.box_pairs)
    memory = rows // 2
    number = len(domains.across)
    first, last = me * number // threads, (me + 1) * number // threads
    products, box, box_pairs = space.products.copy(), space.box.copy(), space.box_pairs.copy()
    own = LbfgsArrays(
        space.offsets, box, space.forces, space.pairs, box_pairs, products, space.sums, space.reaches
    )
    total, previous = np.zeros(space.sums.shape[1]), np.zeros(space.sums.shape[1])
    strains, axes = len(box), space.offsets.shape[1]
    diagonal = np.sqrt(float(axes))  # of a cube, in its sides
    pull, pull_before = np.zeros(strains), np.zeros(strains)  # gradient of the cell
    coefficients, move = np.zeros(rows + 1), np.zeros(strains)
    factors, room = np.zeros(2), block_room(axes)
    status, evaluations = MORE, 0
    # which forces, and which pair they complete; plain numbers would have types of their own
    current, slot = np.int64(0), np.int64(-1)
    slope = length = lower = lower_slope = 0.0
    shrinks = 0  # of the step that is tried
    while True:
        factors[current] = 1.0 if is_sheared(box, domains.r0) else exp(box[0])
        for d in range(first, last):
            measure(domains, d, own, task, factors, current, slot, room, domains.r0)
        meet(counter, threads)
        if slot >= 0:
            box_pairs[2 * head + 1] = 0.0  # of the cell y is known with all sums only
        collect_sums(own, task, total, pull)
        evaluations += 1
        if slot >= 0:
            after = total[2 * head] / length
            if after > -UPHILL * slope and shrinks < SHRINKS and evaluations < task.steps:
                share = min(max(lower_slope / (lower_slope - after), 0.1), 0.9)
                shorter = lower + share * (length - lower)
                _adjust_box(box, move, shorter / length, task.scale)
                for d in range(first, last):
                    adjust(domains, d, own, shorter / length, head, domains.r0)
                box_pairs[2 * head] = move
                length = shorter
                shrinks += 1
                meet(counter, threads)
                continue
            # The new pair: its products with the others follow from products of the two gradients.
            for b in range(strains):
                change = pull[b] - pull_before[b]
                box_pairs[2 * head + 1, b] = change
                total[rows] += change * change
                total[2 * head + 1] += change * pull[b]
            s_y = total[2 * head] - length * slope
            if s_y > 0.0:
                for back in range(min(count, memory - 1)):
                    a = (head - 1 - back) % memory
                    products[0, a, head] = total[2 * a] - previous[2 * a]
                    products[1, a, head] = products[1, head, a] = total[2 * a + 1] - previous[2 * a + 1]
                products[0, head, head] = s_y
                products[1, head, head] = total[rows]
                head = (head + 1) % memory
                count = min(count + 1, memory)
            else:
                count = min(count, memory - 1)
        top = total[rows + 2] * factors[current] / exp(box[0])
        box_force = task.scale * np.max(np.abs(pull))
        if diagonal * top <= task.force and box_force <= task.box_force:
            status = CONVERGED
            break
        if evaluations >= task.steps:
            break
        slope, count = find_direction(total, products, count, head, memory, task.softness, coefficients)
        for b in range(strains):
            move[b] = coefficients[rows] * pull[b]
            for row in range(rows):
                move[b] += coefficients[row] * box_pairs[row, b]
            box[b] += move[b] / task.scale
        for d in range(first, last):
            step(domains, d, own, current, factors[current], coefficients, head, room, domains.r0)
        meet(counter, threads)
        longest = far = 0.0
        for d in range(number):
            longest = max(longest, space.reaches[d, 0])
            far = max(far, space.reaches[d, 1])
        turned = np.max(np.abs(move)) / task.scale
        length = min(1.0, task.reach / max(longest, 1e-300), task.stretch / max(turned, 1e-300))
        if length < 1.0:
            _adjust_box(box, move, length, task.scale)
            for d in range(first, last):
                space.reaches[d, 2] = adjust(domains, d, own, length, head, domains.r0)
            meet(counter, threads)
            far = 0.0
            for d in range(number):
                far = max(far, space.reaches[d, 2])
        if is_stale(diagonal * far, box_strain(box, domains.r0), task.widest, task.skin):
            _adjust_box(box, move, 0.0, task.scale)
            for d in range(first, last):
                adjust(domains, d, own, 0.0, head, domains.r0)
            count = min(count, memory - 1)  # its s has taken the place of the oldest
            status = STALE
            break
        box_pairs[2 * head] = move
        previous[:] = total
        pull_before[:] = pull
        lower, lower_slope, shrinks = 0.0, slope, 0
        current, slot = 1 - current, head
    if me == 0:
        space.products[:] = products
        space.box[:] = box
        space.box_pairs[:] = box_pairs
    return status, evaluations, count, head
