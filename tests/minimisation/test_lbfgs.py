"""L-BFGS, step by step: the compiled descents against their equations in plain numpy, over lists and memories."""

from collections import Counter

import numpy as np
import pytest
from sheared import crowd

from jampetsc.minimisation import lbfgs
from jampetsc.minimisation import warm_start as compiled
from jampetsc.minimisation.descent import MEMORY, Descent, Goal
from jampetsc.minimisation.ldl import solve
from jampetsc.minimisation.newton import Point
from jampetsc.minimisation.protocols import random_start
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import find_contacts, net_forces
from jampetsc.packing.neighbour_list import NeighbourList, is_stale, tuned_skin
from jampetsc.packing.packing import deformed
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import growth_and_shear, simple_shear
from jampetsc.packing.threads import Team


def two_loops(pairs, gradient, first):
    """−H g by Nocedal's recursion over pairs (s, y), the newest last; `first` of what is left between the loops."""
    q, shares = gradient.copy(), []
    for s, y in reversed(pairs):
        shares.append((s @ q) / (s @ y))
        q -= shares[-1] * y
    q = first(q)
    for (s, y), share in zip(pairs, reversed(shares), strict=True):
        q += (share - (y @ q) / (s @ y)) * s
    return -q


class Numpy:
    """`Descent.descend` without lists, passes, domains and rings: coordinates x = (o, √N ε, √N g) in one array."""

    def __init__(self, disks, goal, skin):
        self.goal, self.n, self.diameter = goal, disks.n, 2.0 * disks.radii.mean()
        self.pairs, self.skin, self.events = [], skin, Counter()
        self.fold(disks)

    def fold(self, disks):
        self.disks, self.x = disks, np.zeros(2 * self.n + 2)
        self.start = True

    def parts(self, x):
        return x[:-2].reshape(-1, 2), x[-2:] / np.sqrt(self.n)

    def now(self):
        offsets, box = self.parts(self.x)
        return deformed(self.disks, offsets, growth_and_shear(*box))

    def gradient(self):
        """∂H/∂x, from contacts of the disks as they are."""
        disks, (strain, shear) = self.now(), self.parts(self.x)[1]
        contacts = find_contacts(disks)
        forces = net_forces(disks.n, contacts)
        virial = (contacts.normal * contacts.force[:, None]).T @ contacts.r
        on_cell = np.zeros(2)
        if self.goal.pressure is not None:
            on_cell[0] = 2.0 * self.goal.pressure * disks.volume - np.trace(virial)
        if self.goal.shear:
            on_cell[1] = -virial[0, 1]
        on_disks = -np.exp(strain) * (forces @ np.array([[1.0, shear], [0.0, 1.0]]))
        return np.concatenate((on_disks.ravel(), on_cell / np.sqrt(self.n)))

    def forget_oldest(self):
        self.pairs = self.pairs[-4:]

    def descend(self, evaluations):
        left, softness = evaluations, 0.1 / self.disks.potential.k
        while left > 0:
            done, stale = self.with_list(left, softness)
            left -= done
            if stale:
                self.events["lists"] += 1
                self.skin = tuned_skin(self.skin, done, self.diameter)
                self.fold(self.now())

    def with_list(self, most, softness):
        done, tried = 0, None
        while True:
            g = self.gradient()
            done += 1
            if tried is not None:
                before, d, slope, length, shrinks = tried
                after = d @ g
                if after > -0.9 * slope and shrinks < 10 and done < most:
                    shorter = length * min(max(slope / (slope - after), 0.1), 0.9)
                    self.x = self.x + (shorter - length) * d
                    self.events["too far"] += 1
                    tried = before, d, slope, shorter, shrinks + 1
                    continue
                if length * (after - slope) > 0.0:
                    self.pairs = [*self.pairs, (length * d, g - before)][-5:]
                else:
                    self.events["bent down"] += 1
                    self.forget_oldest()
            if done >= most:
                return done, False
            d = -softness * g
            if self.pairs:
                s, y = self.pairs[-1]
                d = two_loops(self.pairs, g, lambda q, c=(s @ y) / (y @ y): c * q)
            slope = d @ g
            assert slope < 0.0
            moves, turned = self.parts(d)
            longest = np.abs(moves).max() / (0.1 * self.diameter)
            length = 1.0 / max(1.0, longest, np.abs(turned).max() / 0.01)
            self.events["cut short"] += length < 1.0
            here = self.x
            self.x = here + length * d
            offsets, box = self.parts(self.x)
            far = np.sqrt(2.0) * np.abs(offsets).max()
            if is_stale(far, growth_and_shear(*box), 2.0 * self.disks.radii.max(), self.skin):
                self.x = here
                self.forget_oldest()
                return done, True
            tried = g, d, slope, length, 0


def random_disks(n, phi, seed=1):
    return random_start(radii_of("bidisperse", n), phi, seed, Potential())


def apart(one, other):
    d = (one.positions - other.positions) @ np.linalg.inv(other.cell)
    return np.abs((d - np.round(d)) @ other.cell).max()


WAYS = [  # goal, N, φ, seed, evaluations, what happens on the way
    (Goal(), 16, 0.95, 7, 100, {"lists", "bent down", "too far"}),
    (Goal(), 40, 0.9, 1, 60, {"lists", "cut short", "too far"}),
    (Goal(), 16, 1.5, 1, 60, {"lists", "bent down", "too far"}),
    (Goal(0.05), 16, 0.85, 1, 60, {"lists", "too far"}),
    (Goal(1e-3, True), 16, 1.5, 1, 60, {"lists", "cut short", "too far"}),
    (Goal(5e-2, True), 300, 1.0, 4, 30, {"lists"}),  # more than one chunk of disks
    (Goal(1e-3, True), 4200, 0.9, 5, 8, {"lists"}),  # and more than one domain
]


@pytest.mark.parametrize(("goal", "n", "phi", "seed", "evaluations", "happens"), WAYS)
def test_a_descent_is_that_of_its_equations(goal, n, phi, seed, evaluations, happens):
    disks = random_start(radii_of("bidisperse", n), phi, seed, Potential(k=2.0))
    descent, off = Descent(disks, goal, Team()), 1e-5  # pairs are kept in single precision
    if evaluations == 100:  # so many with one list that more steps go too far than one step may be tried
        descent.skin, off = 2.0, 1e-3
        descent.fold()
    plain = Numpy(disks, goal, descent.skin)
    assert not descent.descend(0.0, 0.0, evaluations)
    plain.descend(evaluations)
    assert descent.evaluations == evaluations and happens <= set(+plain.events)
    assert evaluations != 100 or plain.events["too far"] > 10 + plain.events["lists"]
    found, wanted = descent.disks, plain.now()
    assert apart(found, disks) > 0.3 and apart(found, wanted) < off
    assert np.abs(found.cell - wanted.cell).max() < 1e-5


def test_a_descent_goes_on_with_what_it_remembers():
    """From one call to the next as within one; not after the disks were moved by something else."""
    disks = random_disks(40, 0.95)
    parts, moved = (Descent(disks, Goal(1e-2, True), Team()) for _ in range(2))
    plain = Numpy(disks, Goal(1e-2, True), parts.skin)
    for evaluations in (20, 1, 20, 20):
        parts.descend(0.0, 0.0, evaluations)
        plain.descend(evaluations)
    assert apart(parts.disks, plain.now()) < 1e-5
    moved.descend(0.0, 0.0, 40)
    moved.fold()
    moved.move(np.zeros((40, 2)), np.zeros(2))
    forgetful = Numpy(moved.disks, Goal(1e-2, True), moved.skin)
    moved.descend(0.0, 0.0, 5)
    forgetful.descend(5)
    assert apart(moved.disks, forgetful.now()) < 1e-6


@pytest.mark.parametrize("phi", [0.3, 6.0])
def test_what_is_remembered_of_a_move_is_the_move(phi):
    """To the last bit of single precision, whether it was made shorter or not."""
    descent = Descent(random_disks(40, phi), Goal(), Team())
    descent.descend(0.0, 0.0, 2)
    assert np.array_equal(descent.offsets, descent.offsets.astype(np.float32))
    assert (np.abs(descent.offsets).max() > 0.0999 * descent.diameter) == (phi > 0.5)


@pytest.mark.parametrize("strain", [0.05, 0.0, -0.05])
def test_forces_that_end_a_descent_are_those_of_the_strained_cell(strain):
    """√2 times the largest component, and what the cell is driven by, at its end and not beyond."""
    descent = Descent(random_disks(40, 1.0), Goal(0.05), Team())
    descent.offsets[:] = np.random.default_rng(1).normal(0, 0.02, (40, 2))
    descent.box[0] = strain
    point = Point.of(descent)
    force, drive = np.sqrt(2.0) * np.abs(point.forces).max(), np.abs(point.drive).max()
    assert not descent.descend(force * (1 - 1e-9), 1e300, 1)
    assert not descent.descend(1e300, drive * (1 - 1e-9), 1)
    assert descent.descend(force * (1 + 1e-9), drive * (1 + 1e-9), 1)


def test_a_direction_uphill_is_not_taken():
    """As rounding may leave it: down the gradient instead, and what led there is forgotten."""
    total, products = np.zeros(2 * MEMORY + 6), np.ones((2, MEMORY, MEMORY))
    total[0], total[1], total[2 * MEMORY + 1] = 1.0, 10.0, 1.0  # s·g, y·g and g·g that no s, y and g have
    coefficients = np.full(2 * MEMORY + 1, 7.0)
    slope, kept = lbfgs.find_direction(total, products, 1, 1, MEMORY, 0.3, coefficients)
    assert (slope, kept) == (-0.3, 0)
    assert coefficients.tolist() == [0.0] * (2 * MEMORY) + [-0.3]


class Following:
    """`follow` without compiled code: offsets o at shear g of a list, moves (x, y) of the laboratory."""

    def __init__(self, disks, pairs, shear, inverse):
        self.disks, self.pairs, self.shear, self.inverse = disks, pairs, shear, inverse
        self.o, self.moved = np.zeros((disks.n, 2)), np.zeros((disks.n, 2))
        self.kept, self.events = [], Counter()

    def forces(self):
        return net_forces(
            self.disks.n, find_contacts(deformed(self.disks, self.o, simple_shear(self.shear)))
        ).ravel()

    def go(self, d, length):
        step = length * d.reshape(-1, 2)
        self.moved = self.moved + step
        self.o = self.o + np.column_stack((step[:, 0] - self.shear * step[:, 1], step[:, 1]))

    def descend(self, most, reach, softness):
        f, evaluations = self.forces(), 1
        while evaluations < most:
            first = self.inverse
            if first is None:
                c = softness
                if self.kept:
                    s, y = self.kept[-1]
                    c = (s @ y) / (y @ y)
                first = lambda q, c=c: c * q  # noqa: E731
            d = two_loops(self.kept, -f, first)
            slope = f @ d
            assert slope > 0.0
            length = min(1.0, reach / np.hypot(*d.reshape(-1, 2).T).max())
            self.events["cut short"] += length < 1.0
            old, done = f, 0.0
            for _ in range(8):
                self.go(d, length - done)
                done = length
                f = self.forces()
                evaluations += 1
                end = f @ d
                if end >= -0.5 * slope:
                    break
                self.events["too far"] += 1
                length *= max(slope / (slope - end), 0.1)
            if slope - end > 1e-12 * slope:
                self.kept = [*self.kept, (length * d, old - f)][-8:]
            else:
                self.events["bent down"] += 1
        return evaluations


@pytest.mark.parametrize(
    ("factored", "seed", "reach", "misled", "happens"),
    [
        (True, 1, 0.01, False, {"cut short", "bent down", "too far"}),
        (True, 2, 0.3, False, {"too far"}),
        (False, 2, 0.3, False, {"too far"}),
        (True, 2, 0.3, True, set()),  # what is remembered leads uphill: it is forgotten
    ],
)
def test_a_minimum_is_followed_as_the_equations_say(factored, seed, reach, misled, happens):
    disks, shear, n = crowd(n=16, phi=0.95, seed=seed), 0.1, 16
    pairs, law, still = NeighbourList.build(disks, 3.0), disks.potential.constants, np.zeros((16, 2))
    factor, inverse = compiled.NO_FACTOR[2], None
    if factored:
        order = np.arange(n, dtype=np.uint32)
        factor = compiled.factor_of(order, pairs, still, shear, law, 1e-3, 1e-2, 0.5)

        def inverse(q):
            x = np.empty((n, 2))
            solve(factor, q.reshape(n, 2), x, np.empty((n, 2)))
            return x.ravel()

    plain = Following(disks, pairs, shear, inverse)
    o, moved, forces = np.zeros((n, 2)), np.zeros((n, 2)), np.empty((n, 2))
    memory = compiled.nothing_remembered((n, 2))
    if misled:
        (s, _), product, count, _ = memory
        s[0] = plain.forces()
        product[0], count[:] = -1e-9, (1, 1)
    scalars = (1.4, 3.0, disks.volume, shear, 0.0, 0.0, -1.0, 1.2, reach, 0.5, 40)
    status, evaluations, _ = compiled.follow(pairs, law, scalars, factor, memory, o, moved, forces)
    assert status == compiled.SPENT and evaluations == plain.descend(40, reach, 0.5)
    assert happens <= set(+plain.events) and np.abs(plain.o).max() > 0.1
    np.testing.assert_allclose(o, plain.o, atol=1e-10)
    np.testing.assert_allclose(moved, plain.moved, atol=1e-10)
    np.testing.assert_allclose(forces.ravel(), plain.forces(), atol=1e-10)
