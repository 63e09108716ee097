"""L-BFGS: the compiled steps down to a minimum of the enthalpy, with the cell as one or two more coordinates.

Coordinates are the offsets o of the disks since their pairs were listed and, where the cell moves, its strain ε and
shear g in units that make them about as stiff as a disk: x = (o, √N ε, √N g). With f the net contact forces,
F = e^ε [[1, g], [0, 1]] and W = Σ (f/r) r rᵀ,

    ∂H/∂o = −Fᵀ f,    ∂H/∂ε = −(W_xx + W_yy − 2 p V),    ∂H/∂g = −W_xy,    H = U + p V.

The direction is that of the two-loop recursion (Nocedal, Math. Comput. 35, 773 (1980)), carried out on the inner
products alone: per step one pass over the pairs (s, y) makes the direction and moves, and another one, after the
forces, stores y and takes the products with the new gradient; one sum over all disks for each. No energies: slopes
stay accurate down to the rounding of forces, differences of energies do not.

The pairs are kept in single precision; a stored s is exactly the move that was made.
"""

from typing import NamedTuple

import numba
import numpy as np

from jampetsc.contacts.domains import GRAIN, domain_forces
from jampetsc.contacts.kernel import FAST
from jampetsc.contacts.pairs import is_stale
from jampetsc.contacts.threads import meet

CHUNK = 2 * GRAIN  # coordinates worked on at a time
STRETCH = 0.01  # no side of the cell changes by more than this fraction in one step
UPHILL = 0.9  # a step after which the slope is more than this against it was too long
SHRINKS = 10  # times a step is made shorter

MORE, CONVERGED, STALE = range(3)


class Space(NamedTuple):
    """Where the minimisation is, and what it remembers; rows are padded to N' = a multiple of GRAIN disks."""

    offsets: np.ndarray  # (N', 2)
    box: np.ndarray  # (2,) ε and g
    forces: np.ndarray  # (2, N', 2): at this point and at the one before
    pairs: np.ndarray  # (N'/GRAIN · 2m · CHUNK,) float32: per chunk the rows s_0, y_0, s_1, y_1, …
    box_pairs: np.ndarray  # (2m, 2) their parts that belong to ε and g
    products: np.ndarray  # (2, m, m): s_a · y_b for a no newer than b; y_a · y_b
    sums: np.ndarray  # (D, 2m + 6) each domain's share of the sums over disks
    reaches: np.ndarray  # (D, 3) each domain's longest move and offset


class Task(NamedTuple):
    """What is sought, and where to stop."""

    law: tuple  # `Potential.constants`
    moving: tuple  # (bool, bool): which of ε and g move
    push: float  # p V at ε = 0
    scale: float  # √N
    reach: float  # longest move of a disk in one step
    widest: float  # diameter of the largest disk
    skin: float  # of the pair list
    softness: float  # first step, in units of the gradient: about 0.1 / contact stiffness
    force: float  # largest force allowed
    box_force: float  # largest |∂H/∂ε| and |∂H/∂g| allowed
    steps: int  # force evaluations


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", forceinline=True)
def _dot(a, b):
    total = 0.0
    for q in range(len(a)):
        total += a[q] * b[q]
    return total


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", forceinline=True)
def _square(f, peaks):
    """f · f; peaks ← max(peaks, |f|) place by place, which compilers turn into wide instructions and a single
    maximum not."""
    total = 0.0
    for q in range(len(f)):
        total += f[q] * f[q]
        size = abs(f[q])
        peaks[q] = size if size > peaks[q] else peaks[q]
    return total


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _peaks(f, peaks):
    for q in range(len(f)):
        size = abs(f[q])
        peaks[q] = size if size > peaks[q] else peaks[q]


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", forceinline=True)
def _change(new, factor_new, old, factor_old, y):
    """y ← g_new − g_old, in single precision; returns y · y and y · f_new."""
    square = product = 0.0
    for q in range(len(y)):
        y[q] = factor_old * old[q] - factor_new * new[q]
        here = np.float64(y[q])
        square += here * here
        product += here * new[q]
    return square, product


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", forceinline=True)
def _add_pair(sum_, c_s, s, c_y, y):
    for q in range(len(sum_)):
        sum_[q] += c_s * s[q] + c_y * y[q]


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _scaled(f, c, out):
    for q in range(len(out)):
        out[q] = c * f[q]


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _move(direction, s, o):
    """s ← direction in single precision, o ← o + s."""
    for q in range(len(o)):
        s[q] = direction[q]
        o[q] += np.float64(s[q])


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _rescale(ratio, s, o):
    """The last move s made longer by `ratio`, in s and in o; returns max |o|."""
    far = 0.0
    for q in range(len(o)):
        old = np.float64(s[q])
        s[q] = ratio * old
        here = o[q] + (np.float64(s[q]) - old)
        o[q] = here
        size = abs(here)
        far = size if size > far else far
    return far


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", forceinline=True)
def _shear(f, growth, shear):
    """f ← Fᵀ f, f (n, 2)."""
    for q in range(len(f)):
        f[q, 1] = growth * (f[q, 1] + shear * f[q, 0])
        f[q, 0] = growth * f[q, 0]


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", forceinline=True)
def _measure(domains, d, space, task, factors, now, slot):
    """Forces of domain d, the change of its gradient into pair `slot` (unless −1), and its share of all sums."""
    strain, shear = space.box[0], space.box[1]
    fresh = space.forces[now]
    _, wxx, wxy, wyy = domain_forces(domains, d, space.offsets, strain, shear, task.law, fresh)
    first, last = domains.disks[d], domains.disks[d + 1]
    if shear != 0.0:
        _shear(fresh[first:last], np.exp(strain), shear)
    rows = len(space.box_pairs)
    new = fresh.reshape(-1)
    old = space.forces[1 - now].reshape(-1)
    sums = space.sums[d]
    sums[:] = 0.0
    peaks = np.zeros(CHUNK)
    for chunk in range(first // GRAIN, last // GRAIN):
        here = slice(chunk * CHUNK, (chunk + 1) * CHUNK)
        base = chunk * rows * CHUNK
        f = new[here]
        if slot >= 0:
            y = space.pairs[base + (2 * slot + 1) * CHUNK : base + (2 * slot + 2) * CHUNK]
            square, product = _change(f, factors[now], old[here], factors[1 - now], y)
            sums[rows] += square
            sums[2 * slot + 1] += product
        for row in range(rows):
            if row != 2 * slot + 1:
                sums[row] += _dot(space.pairs[base + row * CHUNK : base + (row + 1) * CHUNK], f)
        sums[rows + 1] += _square(f, peaks)
    sums[rows + 2] = peaks.max()
    for row in range(rows):
        sums[row] *= -factors[now]
    sums[rows + 1] *= factors[now] * factors[now]
    sums[rows + 3] = wxx + wyy
    sums[rows + 4] = wxy


@numba.njit(cache=True, error_model="numpy")
def _collect(space, task, total, box_gradient):
    """Sums over all domains into `total`, the gradient of the cell into `box_gradient`; g·g and products complete."""
    rows = len(space.box_pairs)
    total[:] = 0.0
    for d in range(len(space.sums)):
        for s in range(len(total)):
            if s != rows + 2:
                total[s] += space.sums[d, s]
            else:
                total[s] = max(total[s], space.sums[d, s])
    growth = np.exp(space.box[0])
    box_gradient[0] = box_gradient[1] = 0.0
    if task.moving[0]:
        box_gradient[0] = -(total[rows + 3] - 2.0 * task.push * growth * growth) / task.scale
    if task.moving[1]:
        box_gradient[1] = -total[rows + 4] / task.scale
    for b in range(2):
        for row in range(rows):
            total[row] += space.box_pairs[row, b] * box_gradient[b]
        total[rows + 1] += box_gradient[b] * box_gradient[b]


@numba.njit(cache=True, error_model="numpy")
def _direction(total, products, count, head, memory, softness, coefficients):
    """Coefficients of the direction, for the pairs' rows and last for the gradient.

    Returns its slope, and how many pairs are remembered: none any more if they led uphill.
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


@numba.njit(cache=True, fastmath=FAST, error_model="numpy", forceinline=True)
def _step(domains, d, space, now, factor, coefficients, head):
    """Move the disks of domain d along the direction, which becomes the s of pair `head`."""
    rows = len(space.box_pairs)
    f = space.forces[now].reshape(-1)
    o = space.offsets.reshape(-1)
    direction = np.empty(CHUNK)
    longest, far = np.zeros(CHUNK, np.float32), np.zeros(CHUNK)
    for chunk in range(domains.disks[d] // GRAIN, domains.disks[d + 1] // GRAIN):
        here = slice(chunk * CHUNK, (chunk + 1) * CHUNK)
        base = chunk * rows * CHUNK
        _scaled(f[here], -factor * coefficients[rows], direction)
        for row in range(0, rows, 2):
            if coefficients[row] != 0.0 or coefficients[row + 1] != 0.0:
                s = space.pairs[base + row * CHUNK : base + (row + 1) * CHUNK]
                y = space.pairs[base + (row + 1) * CHUNK : base + (row + 2) * CHUNK]
                _add_pair(direction, coefficients[row], s, coefficients[row + 1], y)
        s = space.pairs[base + 2 * head * CHUNK : base + (2 * head + 1) * CHUNK]
        _move(direction, s, o[here])
        _peaks(s, longest)
        _peaks(o[here], far)
    space.reaches[d, 0], space.reaches[d, 1] = longest.max(), far.max()


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _adjust(domains, d, space, ratio, head):
    """The last move, the s of pair `head`, made longer by `ratio` for the disks of domain d; returns max |o|."""
    rows = len(space.box_pairs)
    o = space.offsets.reshape(-1)
    far = 0.0
    for chunk in range(domains.disks[d] // GRAIN, domains.disks[d + 1] // GRAIN):
        base = (chunk * rows + 2 * head) * CHUNK
        here = slice(chunk * CHUNK, (chunk + 1) * CHUNK)
        far = max(far, _rescale(ratio, space.pairs[base : base + CHUNK], o[here]))
    return far


@numba.njit(cache=True, error_model="numpy")
def _adjust_box(box, move, ratio, scale):
    for b in range(2):
        box[b] += (ratio - 1.0) * move[b] / scale
        move[b] *= ratio


@numba.njit(cache=True, nogil=True, error_model="numpy")
def descend(me, threads, counter, domains, space, task, count, head):
    """Steps of L-BFGS by thread `me` of `threads`, until the forces are small, the list stale, or `steps` are done.

    counter: for `meet`. count, head: how many pairs are remembered, and where the next one goes. Every thread
    decides everything from the same numbers. Returns (status, evaluations, count, head).
    """
    rows = len(space.box_pairs)
    memory = rows // 2
    number = len(domains.across)
    first, last = me * number // threads, (me + 1) * number // threads
    products, box, box_pairs = space.products.copy(), space.box.copy(), space.box_pairs.copy()
    own = Space(space.offsets, box, space.forces, space.pairs, box_pairs, products, space.sums, space.reaches)
    total, before = np.zeros(rows + 6), np.zeros(rows + 6)
    pull, pull_before = np.zeros(2), np.zeros(2)  # gradient of the cell
    coefficients, move = np.zeros(rows + 1), np.zeros(2)
    factors = np.ones(2)
    status, evaluations = MORE, 0
    # which forces, and which pair they complete; plain numbers would have types of their own
    now, slot = np.int64(0), np.int64(-1)
    slope = length = lower = lower_slope = 0.0
    shrinks = 0  # of the step that is tried
    while True:
        factors[now] = np.exp(box[0]) if box[1] == 0.0 else 1.0
        for d in range(first, last):
            _measure(domains, d, own, task, factors, now, slot)
        meet(counter, threads)
        if slot >= 0:
            box_pairs[2 * head + 1] = 0.0  # of the cell y is known with all sums only
        _collect(own, task, total, pull)
        evaluations += 1
        if slot >= 0:
            after = total[2 * head] / length
            if after > -UPHILL * slope and shrinks < SHRINKS and evaluations < task.steps:
                share = min(max(lower_slope / (lower_slope - after), 0.1), 0.9)
                shorter = lower + share * (length - lower)
                _adjust_box(box, move, shorter / length, task.scale)
                for d in range(first, last):
                    _adjust(domains, d, own, shorter / length, head)
                box_pairs[2 * head] = move
                length = shorter
                shrinks += 1
                meet(counter, threads)
                continue
            # The new pair: its products with the others follow from those of the two gradients.
            for b in range(2):
                change = pull[b] - pull_before[b]
                box_pairs[2 * head + 1, b] = change
                total[rows] += change * change
                total[2 * head + 1] += change * pull[b]
            s_y = total[2 * head] - length * slope
            if s_y > 0.0:
                for back in range(min(count, memory - 1)):
                    a = (head - 1 - back) % memory
                    products[0, a, head] = total[2 * a] - before[2 * a]
                    products[1, a, head] = products[1, head, a] = total[2 * a + 1] - before[2 * a + 1]
                products[0, head, head] = s_y
                products[1, head, head] = total[rows]
                head = (head + 1) % memory
                count = min(count + 1, memory)
            else:
                count = min(count, memory - 1)
        top = total[rows + 2] * factors[now] / np.exp(box[0])
        box_force = task.scale * max(abs(pull[0]), abs(pull[1]))
        if np.sqrt(2.0) * top <= task.force and box_force <= task.box_force:
            status = CONVERGED
            break
        if evaluations >= task.steps:
            break
        slope, count = _direction(total, products, count, head, memory, task.softness, coefficients)
        for b in range(2):
            move[b] = coefficients[rows] * pull[b]
            for row in range(rows):
                move[b] += coefficients[row] * box_pairs[row, b]
            box[b] += move[b] / task.scale
        for d in range(first, last):
            _step(domains, d, own, now, factors[now], coefficients, head)
        meet(counter, threads)
        longest = far = 0.0
        for d in range(number):
            longest = max(longest, space.reaches[d, 0])
            far = max(far, space.reaches[d, 1])
        turned = max(abs(move[0]), abs(move[1])) / task.scale
        length = min(1.0, task.reach / max(longest, 1e-300), STRETCH / max(turned, 1e-300))
        if length < 1.0:
            _adjust_box(box, move, length, task.scale)
            for d in range(first, last):
                space.reaches[d, 2] = _adjust(domains, d, own, length, head)
            meet(counter, threads)
            far = 0.0
            for d in range(number):
                far = max(far, space.reaches[d, 2])
        if is_stale(np.sqrt(2.0) * far, box[0], box[1], task.widest, task.skin):
            _adjust_box(box, move, 0.0, task.scale)
            for d in range(first, last):
                _adjust(domains, d, own, 0.0, head)
            count = min(count, memory - 1)  # its s has taken the place of the oldest
            status = STALE
            break
        box_pairs[2 * head] = move
        before[:] = total
        pull_before[:] = pull
        lower, lower_slope, shrinks = 0.0, slope, 0
        now, slot = 1 - now, head
    if me == 0:
        space.products[:] = products
        space.box[:] = box
        space.box_pairs[:] = box_pairs
    return status, evaluations, count, head
