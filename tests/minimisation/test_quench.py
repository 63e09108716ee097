"""Forces, Hessian and last digits of a quench, each against an independent calculation."""

import numpy as np
import pytest
from dense import NewtonSteps
from samples import lattice

from jampetsc.errors import ConvergenceError
from jampetsc.minimisation import newton, protocols
from jampetsc.minimisation.descent import Descent, Goal, stress_unit
from jampetsc.minimisation.hessian import Bonds, Pattern, border
from jampetsc.minimisation.minimise import minimise, relax, relax_to_fraction, settle
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import find_contacts, measure, net_forces
from jampetsc.packing.kernel import bond_forces
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import STIFFNESSES, Potential
from jampetsc.packing.strain import growth_and_shear
from jampetsc.packing.threads import Team
from jampetsc.petsc.hessian_solver import NewtonSolver

LAWS = [
    Potential(None, stiffness, 1.7, exponent) for exponent in (2.0, 2.25, 2.5) for stiffness in STIFFNESSES
]


def crowd(potential=None, n=40, phi=1.0, seed=3):
    """Disks at random places in a sheared cell, with neighbours through two images."""
    start = protocols.random_start(radii_of("bidisperse", n), phi, seed, potential or Potential())
    cell = np.array([[start.cell[0, 0] * 0.7, 0], [1.1, start.cell[1, 1] / 0.7]])
    return Packing.from_positions(start.positions, start.radii, cell, potential)


def moving_of(goal, free):
    """Which rows of `hessian_of` belong to the free disks and the strains that move."""
    return np.append(np.repeat(free, 2), [goal.pressure is not None, goal.shear])


def hessian_of(descent, every=False):
    """∂²H/∂(o, ε, g)², dense: of all disks and both strains or of the disks that are held and the strains that move.

    Made of the parts that `test_hessian_and_border_are_derivatives_of_the_forces` has.
    """
    point, whole, goal = newton.Point.of(descent), NewtonSteps(), descent.goal
    free = np.ones(descent.n, bool)
    pattern = Pattern(point.bonds.pairs, descent.n)
    whole.factorise(pattern.indptr, pattern.indices, pattern.fill(point.bonds, free))
    rows, corner = border(point.bonds, descent.n, descent.volume, goal.pressure or 0.0)
    matrix = np.block([[whole.matrix, rows.reshape(-1, 2)], [rows.reshape(-1, 2).T, corner]])
    kept = np.full(len(matrix), True) if every else moving_of(goal, ~measure(descent.disks).rattlers)
    return matrix[np.ix_(kept, kept)]


def evaluate(disks, offsets, strain=0.0, shear=0.0):
    """(U, forces, (Σ (f/r) r_x r_x, r_x r_y, r_y r_y)) from the compiled loop."""
    pairs = NeighbourList.build(disks, 0.4)
    forces = np.empty((disks.n, 2))
    law = disks.potential.constants
    box = growth_and_shear(strain, shear)
    energy, *virial = bond_forces(pairs, offsets, box, law, forces, None, None)[:4]
    return energy / disks.potential.exponent, forces, virial


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_hessian_and_border_are_derivatives_of_the_forces(law):
    disks, step, pressure = crowd(law), 1e-6, 0.05
    n = disks.n
    pairs = NeighbourList.build(disks, 0.4)
    bonds = Bonds.of(pairs, law)
    pattern = Pattern(pairs, n)
    free = np.ones(n, bool)
    dense = np.zeros((2 * n, 2 * n))
    rows = np.repeat(np.arange(2 * n), np.diff(pattern.indptr))
    dense[rows, pattern.indices] = pattern.fill(bonds, free)
    dense += np.triu(dense, 1).T
    mixed, corner = border(bonds, n, disks.volume, pressure)

    def drive(offsets, box):
        """−∂H/∂(o, ε, g), the generalised forces."""
        _, f, (wxx, wxy, wyy) = evaluate(disks, offsets, *box)
        area = disks.volume * np.exp(2 * box[0])
        along = np.exp(box[0]) * np.column_stack((f[:, 0], f[:, 1] + box[1] * f[:, 0]))
        # r_y of the deformed bond is e^ε times that of the frozen one, so ∂r/∂g = (r_y, 0).
        return np.concatenate((along.ravel(), [wxx + wyy - 2 * pressure * area, wxy]))

    for column in [*range(0, 2 * n, 7), 2 * n, 2 * n + 1]:
        change = np.zeros(2 * n + 2)
        change[column] = step
        ahead = drive(change[: 2 * n].reshape(n, 2), change[2 * n :])
        behind = drive(-change[: 2 * n].reshape(n, 2), -change[2 * n :])
        difference = -(ahead - behind) / (2 * step)
        if column < 2 * n:
            exact = np.concatenate((dense[:, column], mixed.reshape(2 * n, 2)[column]))
        else:
            exact = np.concatenate((mixed[..., column - 2 * n].ravel(), corner[column - 2 * n]))
        # Contacts that open or close within the step, and √δ of Hertzian ones, set the accuracy.
        assert np.abs(difference - exact).max() < 2e-4 * (1 + np.abs(exact).max())


@pytest.mark.parametrize("goal", [Goal(), Goal(0.3), Goal(0.3, True), Goal(shear=True)], ids=str)
def test_disks_and_cell_are_solved_for_together(goal):
    """(H + μ) x = b, μ once for every disk in the corner of the cell; definite where all of H + μ is, never else."""
    disks, kinds = settle(crowd(n=16), 0.03), set()
    descent, n = Descent(disks, goal, Team()), disks.n
    point, matrix = newton.Point.of(descent), hessian_of(descent, every=True)
    forces, drive = np.random.default_rng(1).normal(size=(n, 2)), np.array([1.3, -0.7])
    for free in (np.ones(n, bool), np.arange(n) % 4 > 0):
        kept = moving_of(goal, free)
        for mu in np.geomspace(1e-3, 1.0, 12):
            damped = matrix + mu * np.diag(np.append(np.ones(2 * n), [n, n]))
            inner = damped[np.ix_(kept, kept)]
            free_disks = inner[: 2 * free.sum(), : 2 * free.sum()]
            definite, without_cell = (np.linalg.eigvalsh(part)[0] > 0 for part in (inner, free_disks))
            linear = newton.Linear(point, Pattern(point.bonds.pairs, n), NewtonSteps(), free, mu)
            assert linear.definite == definite
            if without_cell:
                both = np.append(np.repeat(free, 2), [False, False])
                moved = np.linalg.solve(free_disks, damped[both][:, -2:])
                bent = damped[-2:, -2:] - damped[-2:][:, both] @ moved
                assert linear.modulus == pytest.approx(bent[1, 1] / disks.volume, rel=1e-7, abs=1e-9)
            kinds.add((definite, without_cell))
            if definite:
                wanted = np.zeros(2 * n + 2)
                wanted[kept] = np.linalg.solve(inner, np.append(forces.ravel(), drive)[kept])
                move, strain = linear.solve(forces, drive)
                found = np.append(move.ravel(), strain)
                np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())
    assert {(True, True), (False, False)} <= kinds and ((False, True) in kinds) == goal.shear


def test_what_is_left_is_told_in_forces_and_stresses():
    disks = settle(crowd(n=24), 0.03)
    state = measure(disks)
    for goal in (Goal(), Goal(0.3), Goal(0.3, True)):
        left = newton.Point.of(Descent(disks, goal, Team())).residual
        assert left.force == pytest.approx(np.hypot(*net_forces(24, find_contacts(disks)).T).max())
        assert left.pressure == pytest.approx(abs(state.pressure - 0.3) if goal.pressure else 0.0)
        assert left.shear_stress == pytest.approx(abs(state.stress[0, 1]) if goal.shear else 0.0)


@pytest.mark.parametrize("law", LAWS, ids=str)
@pytest.mark.parametrize("length", [1.0, 3.0])
def test_a_usual_contact_carries_a_usual_force(law, length):
    """2 p d, at the pressure asked for, that of the goal, or a thousandth of what is of order one."""
    start = crowd(law, n=16)
    disks = Packing.from_positions(length * start.positions, length * start.radii, length * start.cell, law)
    d = length
    unit = stress_unit(disks)
    for goal, asked, pressure in (
        (Goal(), None, 1e-3 * unit),
        (Goal(0.02 * unit), None, 0.02 * unit),
        (Goal(0.02 * unit), 0.1 * unit, 0.1 * unit),
    ):
        overlap = Descent(disks, goal, Team()).usual_overlap(asked)
        assert law.force(overlap, d) == pytest.approx(2.0 * pressure * d)
    for some in (disks, crowd(law, n=4200)):  # in one domain, and in two
        found = Descent(some, Goal(), Team()).stiffest()
        assert found == pytest.approx(find_contacts(some).stiffness.max())


@pytest.mark.parametrize("strain", [(0.0, 0.3), (-0.2, 0.0), (0.0, 0.0)])
def test_a_list_serves_moves_until_it_is_stale(strain):
    descent = Descent(settle(crowd(n=24), 0.03), Goal(), Team())
    kept, steps = descent.pairs, 0
    while descent.pairs is kept:
        assert not descent.stale()
        moves = np.zeros((24, 2))
        moves[7] = 0.0 if any(strain) else 0.01
        descent.move(moves, 0.1 * np.array(strain))
        steps += 1
    assert 2 < steps < 20 and not descent.offsets.any() and not descent.box.any()


def test_newton_is_tried_at_ever_smaller_forces(monkeypatch):
    """Each a tenth of that before, the stress of the cell as small in proportion, as long as rounding leaves room."""
    asked, descend = [], Descent.descend

    def noted(descent, force, box_force, evaluations):
        asked.append((force, box_force / (2.0 * descent.volume)))
        return descend(descent, 1e-3, 1e-3, evaluations)

    monkeypatch.setattr(Descent, "descend", noted)
    monkeypatch.setattr(newton.Newton, "converge", lambda *_: False)
    start = crowd(n=16)
    disks = Packing.from_positions(2.0 * start.positions, 2.0 * start.radii, 2.0 * start.cell)
    for pressure in (1e-3, 1e-8):
        asked.clear()
        with pytest.raises(ConvergenceError, match="no minimum after"):
            minimise(disks, Goal(pressure), NewtonSteps())
        descent = Descent(disks, Goal(pressure), Team())
        least = newton.Limits(descent, 1e-10).at(newton.Point.of(descent), pressure).force
        wanted = 1e-5 * 10.0 ** -np.arange(20) * pressure * 2.0
        wanted = np.maximum(wanted[: 1 + np.argmax(wanted < 0.1 * least)], 0.5 * least)
        assert [force for force, _ in asked] == pytest.approx(wanted.tolist(), rel=1e-9, abs=0.0)
        assert [stress for _, stress in asked] == pytest.approx((wanted / 2.0).tolist(), rel=1e-9, abs=0.0)


def test_forces_are_small_at_the_pressure_that_is_left():
    """In a fixed cell it falls on the way down."""
    descent = Descent(crowd(n=24, phi=0.88), Goal(), Team())
    limits = newton.Limits(descent, 1e-10)
    before = newton.Point.of(descent).pressure
    pressure = relax_to_fraction(descent, 1e-3, limits)
    point = newton.Point.of(descent)
    assert pressure == point.pressure < 0.2 * before
    assert point.residual.force <= 2e-3 * pressure * descent.diameter


class NotedNewton(newton.Newton):
    """Newton's method that notes what it does: damping μ / p and forces where it factorises, forces where it searches.

    length   what each search is made to return, if not None
    """

    def __init__(self, descent, solver=None, length=None):
        super().__init__(descent, solver or NewtonSteps())
        self.length, self.damping, self.factorised, self.searched, self.pulls = length, [], [], [], []
        self.advances = 0

    def factorise(self, point, free, mu):
        self.damping.append(mu / point.pressure)
        self.factorised.append(point.residual.force)
        return super().factorise(point, free, mu)

    def search_along(self, point, step, length):
        self.searched.append(point.residual.force)
        return super().search_along(point, step, length) if self.length is None else (self.length, point)

    def advance(self, step, length):
        self.advances += 1
        return super().advance(step, length)

    def pull_after(self, mode, way):
        self.pulls.append((mode, way, super().pull_after(mode, way)))
        return self.pulls[-1][-1]


def test_damping_goes_where_steps_are_full():
    """Threefold smaller after each; but for a floor as long as forces are not small."""
    disks = relax(crowd(n=24), Goal(0.05), 1e-5)
    for floor, near in ((0.0, newton.NEAR_MINIMUM_FORCE), (newton.MIN_DAMPING, 0.0)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(newton, "NEAR_MINIMUM_FORCE", near)
            descent = Descent(disks, Goal(0.05), Team())
            limits = newton.Limits(descent, 1e-14)
            walker = NotedNewton(descent)
            assert walker.converge(limits)
        point, damped = newton.Point.of(descent), walker.damping
        assert point.residual.within(limits.at(point, 0.05)) and 3 <= len(damped) <= 8
        wanted = np.maximum(newton.DAMPING * 0.3 ** np.arange(len(damped)), floor)
        assert damped == pytest.approx(wanted, rel=1e-3)


def test_damping_is_raised_until_a_hessian_is_definite():
    """Fourfold, and not from nothing; of a lattice that is no minimum."""
    walker = saddle(Goal())
    point, damped = newton.Point.of(walker.descent), walker.damping
    linear, mu = walker.factorise_definite(point, np.ones(16, bool), 0.0)
    assert linear.definite and walker.descent.effort.newton_steps == len(damped) > 2
    wanted = np.append(0.0, newton.MIN_DAMPING_AFTER_MODE * 4.0 ** np.arange(len(damped) - 1))
    assert damped == pytest.approx(wanted) and mu == pytest.approx(wanted[-1] * point.pressure)
    damped.clear()
    walker.factorise_definite(point, np.ones(16, bool), 1e-3 * point.pressure)
    assert damped == pytest.approx(1e-3 * 4.0 ** np.arange(len(damped)))


@pytest.mark.parametrize(
    ("length", "factor"), [(0.2, 3.0), (0.31, 1.0), (0.69, 1.0), (0.71, 0.3), (1.0, 0.3)]
)
def test_damping_follows_how_far_steps_go(monkeypatch, length, factor):
    """Threefold where the slope ends a step early, as it is in between."""
    monkeypatch.setattr(newton, "MAX_STEPS", 2)
    descent = Descent(settle(crowd(n=24), 0.03), Goal(), Team())
    walker = NotedNewton(descent, length=length)
    walker.converge(newton.Limits(descent, 1e-14))
    first, damped = newton.DAMPING, walker.damping
    while first != pytest.approx(damped[-1] / factor, rel=1e-9) and first < 1e3:
        first = max(4.0 * first, newton.MIN_DAMPING_AFTER_MODE)
    assert len(damped) > 2 and damped[-1] == pytest.approx(factor * first)


def test_newton_goes_on_while_rounding_lets_it():
    """Slopes are searched above rounding only; within what rounding leaves it ends where forces no longer halve."""
    descent = Descent(relax(crowd(n=24), Goal(0.05), 2e-5), Goal(0.05), Team())
    walker, limits = NotedNewton(descent), newton.Limits(descent, 1e-20)
    assert walker.converge(limits)
    forces, searched, point = walker.factorised, walker.searched, newton.Point.of(descent)
    last = point.residual.force
    assert last > 0.5 * forces[-1] and last <= limits.at(point, 0.05).force
    assert searched == [force for force in forces if force > newton.ROUNDING_FORCE * 0.05 * descent.diameter]


def test_a_pattern_is_that_of_the_list_there_is():
    descent = Descent(settle(crowd(n=16), 0.03), Goal(), Team())
    kept, free = newton.Newton(descent, NewtonSteps()), np.ones(16, bool)
    for shift in (0.0, 0.3):
        descent.move(np.random.default_rng(1).normal(0, shift, (16, 2)), np.zeros(2))
        descent.fold()
        point = newton.Point.of(descent)
        fresh = newton.Newton(descent, NewtonSteps())
        found, wanted = (
            n.factorise(point, free, 1e3).solve(point.forces, point.drive) for n in (kept, fresh)
        )
        for one, other in zip(found, wanted, strict=True):
            np.testing.assert_array_equal(one, other)


def saddle(goal):
    """A square lattice under pressure: no forces, and modes of negative curvature."""
    return NotedNewton(Descent(lattice(4, 0.9), goal, Team()))


@pytest.mark.parametrize("goal", [Goal(), Goal(0.1), Goal(0.1, True)], ids=str)
def test_a_saddle_is_left_where_it_is_steepest(goal):
    """Looks leave the disks where they were; then they are as far along the mode as it pulls most, or may go."""
    walker = saddle(goal)
    descent = walker.descent
    start = descent.disks
    assert walker.leave_saddle()
    mode, ways = walker.pulls[0][0], {way: pull for _, way, pull in walker.pulls}
    went = max(ways, key=ways.get)
    other = saddle(goal)
    other.pull_after(mode, went)
    assert np.abs(other.descent.disks.positions - start.positions).max() < 1e-13
    assert np.abs(other.descent.disks.cell - start.cell).max() < 1e-13
    other.advance(mode, went)
    assert ways[went] > 0
    np.testing.assert_allclose(descent.disks.positions, other.descent.disks.positions, rtol=0, atol=1e-12)
    np.testing.assert_allclose(descent.disks.cell, other.descent.disks.cell, rtol=0, atol=1e-12)
    longest = abs(2.0 * went) * np.hypot(*mode[0].T).max()
    assert longest > newton.MAX_NEWTON_MOVE * descent.diameter or ways[2.0 * went] <= ways[went]
    assert np.abs(descent.disks.positions - start.positions).max() > 1e-4


@pytest.mark.parametrize("goal", [Goal(), Goal(0.1), Goal(0.1, True)], ids=str)
def test_a_negative_mode_is_nearly_the_most_negative(goal):
    """Of the generalised eigenproblem where a strain weighs as much as all disks moved by it."""
    walker = saddle(goal)
    point, held, _ = newton.Point.of(walker.descent).load_bearing(walker.descent.disks)
    move, strain = walker.find_negative_mode(point, held)
    matrix, kept = hessian_of(walker.descent, every=True), moving_of(goal, held)
    scale = np.append(np.ones(32), [0.25] * 2)
    scaled = (matrix * np.outer(scale, scale))[np.ix_(kept, kept)]
    mode = (np.append(move.ravel(), strain) / scale)[kept]
    assert np.linalg.norm(mode) == pytest.approx(1.0)
    least = np.linalg.eigvalsh(scaled)[0]
    assert least <= mode @ scaled @ mode < 0.7 * least < 0


def test_held_disks_have_unit_rows():
    disks = crowd()
    pairs = NeighbourList.build(disks, 0.4)
    free = np.arange(disks.n) % 3 > 0
    pattern = Pattern(pairs, disks.n)
    values = pattern.fill(Bonds.of(pairs, disks.potential), free)
    rows = np.repeat(np.arange(2 * disks.n), np.diff(pattern.indptr))
    held = ~free[rows // 2] | ~free[pattern.indices // 2]
    assert np.array_equal(values[held], (rows == pattern.indices)[held].astype(float))


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_newton_reaches_rounding_where_plain_doubles_cannot():
    """At p = 1e-7 the residual is that of rounding r ~ d; rounded coordinates leave a far larger one."""
    n, pressure, rounding = 256, 1e-7, 2e-15
    start = protocols.random_start(radii_of("bidisperse", n), 0.86, 1, Potential())
    near = protocols.make_packing(start, protocols.Target(1e-4), NewtonSolver())
    disks = protocols.make_packing(near, protocols.Target(pressure), NewtonSolver(), fresh=False)
    state = measure(disks)
    assert state.max_force <= rounding
    assert abs(state.pressure / pressure - 1) < 1e-9
    rounded = Packing.from_positions(disks.positions, disks.radii, disks.cell, disks.potential)
    assert measure(rounded).max_force > rounding
    # A cell as large as that of 1e5 disks: the same bonds, coordinates 2⁸ farther out.
    far = disks.replace(base=disks.base + 256.0)
    assert measure(far).max_force <= rounding
    rounded = Packing.from_positions(far.positions, far.radii, far.cell, far.potential)
    assert measure(rounded).max_force > 10 * rounding
