"""The minimiser: gradient, directions, staleness, proof and saddles, each against an independent calculation."""

import itertools

import numpy as np
import pytest
from dense import Reference
from numba import typeof
from samples import bridge, lattice, physics
from test_quench import LAWS, NotedNewton, hessian_of

from jampetsc.errors import ConvergenceError
from jampetsc.minimisation import descent as descent_module
from jampetsc.minimisation import fire, minimise, protocols
from jampetsc.minimisation import newton as newton_module
from jampetsc.minimisation.descent import Descent, Effort, Goal
from jampetsc.minimisation.fire import fire_descent
from jampetsc.minimisation.minimise import relax
from jampetsc.minimisation.newton import Imbalance, Limits, Newton, Point
from jampetsc.minimisation.sizes import radii_of
from jampetsc.minimisation.warm_start import is_minimum
from jampetsc.packing import contacts as state
from jampetsc.packing.contacts import find_contacts, measure
from jampetsc.packing.neighbour_list import NeighbourList, borders, is_stale
from jampetsc.packing.packing import Packing, deformed, proved_minimum
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import UNSTRAINED, growth_and_shear
from jampetsc.packing.threads import Team
from jampetsc.petsc.hessian_solver import NewtonSolver


def one_rank(test):
    """A test on PETSc to which more ranks add nothing."""
    return pytest.mark.scalar("real")(pytest.mark.most_ranks(1)(test))


def random_disks(n, phi=0.9, seed=1, potential=None):
    return protocols.random_start(radii_of("bidisperse", n), phi, seed, potential or Potential())


def enthalpy(disks, pressure=0.0):
    contacts = find_contacts(disks)
    return np.sum(disks.potential.energy(contacts.overlap, contacts.sigma)) + pressure * disks.volume


def displaced(law, pressure):
    """A descent in the middle of its way, sheared and strained since its list was made."""
    descent = Descent(random_disks(40, 1.0, 3, law), Goal(pressure, True), Team())
    descent.offsets[:] = np.random.default_rng(1).normal(0, 0.02, (40, 2))
    descent.box[:] = 0.01, -0.02
    return descent


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_a_point_is_driven_down_the_enthalpy(law):
    pressure, h = 0.05, 1e-6
    descent = displaced(law, pressure)
    point, here = Point.of(descent), descent.disks
    moves, still = np.random.default_rng(2).normal(size=(here.n, 2)), np.zeros((here.n, 2))
    for move, strain in [(moves, np.zeros(2)), *((still, e) for e in np.eye(2))]:
        ahead, behind = (
            enthalpy(deformed(here, s * move, growth_and_shear(*(s * strain))), pressure) for s in (h, -h)
        )
        wanted = (ahead - behind) / (2 * h)
        assert -point.along((move, strain)) == pytest.approx(wanted, rel=1e-5, abs=1e-5)


def test_a_move_is_one_of_the_disks_where_they_are():
    descent = displaced(Potential(), 0.05)
    here = descent.disks
    moves, strain = np.random.default_rng(5).normal(0, 1e-3, (here.n, 2)), np.array([1e-3, -2e-3])
    wanted = deformed(here, moves, growth_and_shear(*strain))
    for _ in range(2):  # within the list, and with a new one
        descent.move(moves, strain)
        assert np.abs(descent.disks.positions - wanted.positions).max() < 1e-14
        assert np.abs(descent.disks.cell - wanted.cell).max() < 1e-14
        descent.move(-moves, -strain)
        descent.fold()
        here = descent.disks
        wanted = deformed(here, moves, growth_and_shear(*strain))


def test_domains_are_of_one_type_however_many():
    """Numba would compile the descent, ten seconds of it, once more for the first large packing."""
    one, several = (typeof(NeighbourList.build(random_disks(n, 0.3), 0.1, borders(n))) for n in (16, 4100))
    assert one == several


def test_any_number_of_threads_takes_the_same_way():
    disks = random_disks(6500)
    ends = [relax(disks, Goal(1e-2, True), 6e-3, team=Team(threads)) for threads in (1, 2, 3)]
    for end in ends[1:]:
        for name in ("base", "offset", "cell_base", "cell_offset"):
            assert np.array_equal(getattr(ends[0], name), getattr(end, name))


@pytest.mark.parametrize("goal", [None, Goal(), Goal(1e-3), Goal(1e-3, True)], ids=str)
def test_no_touching_pair_is_ever_unlisted(goal, monkeypatch):
    """The list holds after any number of steps; short ones use its skin up to the last, in every direction."""
    monkeypatch.setattr(descent_module, "MAX_MOVE", 5e-4)
    descent = Descent(random_disks(300), goal or Goal(), Team())
    rng = np.random.default_rng(1)
    widest = 2.0 * descent.disks.radii.max()
    used = []
    for _ in range(40):
        descent.skin = 0.02
        descent.fold()
        steps = int(rng.integers(1, 80))
        if goal is None:
            fire_descent(descent, 0.0, steps)
        else:
            descent.descend(0.0, 0.0, steps)
        far = np.hypot(*descent.offsets.T).max()
        assert not is_stale(far, growth_and_shear(*descent.box), widest, descent.skin)
        used.append(2.0 * far / descent.skin)
        listed = set(zip(descent.pairs.i.tolist(), descent.pairs.j.tolist(), strict=True))
        contacts = find_contacts(descent.disks)
        assert set(zip(contacts.i.tolist(), contacts.j.tolist(), strict=True)) <= listed
    assert max(used) > 0.6  # the skin was needed


def test_what_is_proved_are_the_contacts_that_bear_load(monkeypatch):
    monkeypatch.setattr(state, "MIN_FORCE_RATIO", 0.4)  # of p d: many contacts carry less
    disks = random_disks(100, 1.0)
    bearing = measure(disks)
    point, held, _ = Point.of(Descent(disks, Goal(), Team())).load_bearing(disks)
    assert 50 < len(bearing.contacts) < len(find_contacts(disks)) - 10
    assert np.count_nonzero(point.bonds.stiffness) == len(bearing.contacts)
    pinned = np.argmin(bearing.rattlers)
    assert not held[pinned]
    held[pinned] = True
    assert np.array_equal(held, ~bearing.rattlers)


def test_every_part_of_a_residual_counts():
    limits = Imbalance(force=1.0, pressure=2.0, shear_stress=3.0)
    assert limits.within(limits)
    for part in ("force", "pressure", "shear_stress"):
        worse = limits._replace(**{part: 3.5})
        assert not worse.within(limits) and limits.within(worse)


@one_rank
@pytest.mark.parametrize("goal", [Goal(), Goal(0.02), Goal(0.02, True)], ids=str)
def test_a_saddle_without_any_force_is_left(goal):
    disks, effort = lattice(spacing=0.9), Effort()
    found = minimise.minimise(disks, goal, NewtonSolver(), effort=effort)
    assert effort.saddles >= 1
    modes = np.linalg.eigvalsh(hessian_of(Descent(found.disks, goal, Team())))
    assert modes[2] > 0 and abs(modes[:2]).max() < 1e-12
    exact = Reference(found.disks, physics(rotations=False))
    assert found.modulus == pytest.approx(exact.modulus(0.0).real, rel=1e-5)
    assert enthalpy(found.disks, goal.pressure or 0.0) < enthalpy(disks, goal.pressure or 0.0)


@one_rank
@pytest.mark.parametrize(
    ("pressure", "trusting", "least", "most", "limit"),
    [
        (1e-3, False, 0.0, 1e-13, "tolerance"),
        (1e-3, True, 0.0, 1e-13, "tolerance"),
        (1e-6, False, 1e-16, 3e-15, "rounding"),
    ],
)
def test_the_proof_is_of_the_very_disks_and_what_rounding_leaves_is_said(
    monkeypatch, pressure, trusting, least, most, limit
):
    """Convergence is not taken on trust: where Newton's method says so at once, forces are small all the same."""
    if trusting:
        monkeypatch.setattr(Newton, "converge", lambda newton, limits: True)
    found = minimise.minimise(random_disks(64), Goal(pressure), NewtonSolver())
    assert proved_minimum(found.disks)
    rounded = 1e-16  # of forces summed in another order
    assert measure(found.disks).max_force <= found.max_force + rounded
    assert least < found.max_force <= most and found.limit == limit


@one_rank
@pytest.mark.parametrize(
    ("patches", "after"),
    [
        ([(minimise, "MAX_EVALUATIONS", 20), (minimise, "SLICE", 10)], "30 force evaluations and 0 saddles"),
        ([(Newton, "converge", lambda *_: False)], r"\d+ force evaluations and 0 saddles"),
        *(
            ([(minimise, "MAX_SADDLES", most), (Newton, "prove", lambda _: None),
              (Newton, "leave_saddle", lambda _: True)],
             rf"\d+ force evaluations and {most} saddles: max\|F\|/\(p d\) = ")
            for most in (0, 2)
        ),
    ],
)  # fmt: skip
def test_no_minimum_is_an_error_in_words_of_physics(monkeypatch, patches, after):
    """Also of Newton's method that never converges, and of saddles without end."""
    for patch in patches:
        monkeypatch.setattr(*patch)
    with pytest.raises(ConvergenceError, match=rf"^no minimum after {after}") as raised:
        minimise.minimise(random_disks(64), Goal(1e-3), NewtonSolver())
    assert "--" not in str(raised.value) and "\n" not in str(raised.value)


def test_limits_are_what_was_asked_for_or_what_rounding_leaves():
    def limits(disks, pressure, goal=1e-3):
        descent = Descent(disks, Goal(goal), Team())
        return Limits(descent, 1e-10).at(Point.of(descent), pressure)

    for pressure, force, stress in ((1e-3, 1e-13, 1e-13), (1e-7, 3e-15, 4e-17)):
        found = limits(random_disks(100), pressure)
        assert (found.force, found.pressure) == pytest.approx((force, stress), rel=1e-12, abs=0.0)
        assert found.shear_stress == found.pressure
    disks = random_disks(100)
    wide = Packing.from_positions(3.0 * disks.positions, 3.0 * disks.radii, 3.0 * disks.cell)
    found = limits(wide, 1e-3)
    assert (found.force, found.pressure) == pytest.approx((3e-13, 1e-13), rel=1e-12, abs=0.0)
    soft = relax(random_disks(100, potential=Potential("hertzian")), Goal(1e-6), 1e-6)
    assert limits(soft, 1e-6, 1e-6).force < 3e-16  # rounding of bonds moves the forces of soft contacts less


def searched(length, along=1.0, seed=3):
    """(Newton, its start, step, what its search returns) for a step along the forces; the end is `length` of it."""
    descent = Descent(random_disks(40, 1.0, seed), Goal(0.05), Team())
    newton = NotedNewton(descent)
    start = Point.of(descent)
    step = along * start.forces, np.zeros(2)
    before = descent.disks.positions
    found = newton.search_along(start, step, length)
    assert np.abs(descent.disks.positions - before - found[0] * step[0]).max() < 1e-12
    return newton, start, step, found


def test_a_search_ends_where_the_slope_is_small(monkeypatch):
    """Beyond the minimum along the forces it is turned back unless nearly level there; downhill all is gone."""
    _, start, step, (length, point) = searched(0.05)
    assert length == 0.05 and point.along(step) > 0
    _, start, step, (length, point) = searched(2.0)
    assert length == 2.0 and -newton_module.SLOPE_RATIO * start.along(step) <= point.along(step) < 0
    monkeypatch.setattr(newton_module, "SLOPE_RATIO", 0.05)
    _, start, step, (length, point) = searched(2.0)
    assert 0.2 < length < 2.0 and abs(point.along(step)) <= 0.05 * start.along(step)


def test_a_search_that_finds_no_such_place_ends(monkeypatch):
    monkeypatch.setattr(newton_module, "SLOPE_RATIO", 0.0)
    newton, start, step, (length, point) = searched(2.0)
    assert newton.advances == 1 + newton_module.MAX_SEARCH_POINTS and 0.05 < length < 2.0
    assert abs(point.along(step)) < 1e-2 * start.along(step)


class Wrong:
    """A solver whose factors exist and whose solutions are `value` everywhere."""

    def __init__(self, value):
        self.value = value

    def factorise(self, *_):
        return True

    def solve(self, b):
        return np.full(len(b), self.value)


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_steps_that_are_none_end_newton(value):
    descent = Descent(random_disks(40, 1.0, 3), Goal(), Team())
    before = descent.disks.positions
    assert not Newton(descent, Wrong(value)).converge(Limits(descent, 1e-10))
    assert np.array_equal(descent.disks.positions, before)


class Soft(Wrong):
    """A solver whose Hessian is that of springs of stiffness 1/`value`."""

    def solve(self, b):
        return self.value * b


def test_no_step_is_longer_than_its_reach(monkeypatch):
    """However soft the Hessian is said to be: a tenth of a mean diameter, for the disk that goes farthest."""
    descent, moved, move = Descent(random_disks(40, 1.0, 3), Goal(), Team()), [], Descent.move

    def noted(descent, moves, strain):
        moved.append(np.hypot(*moves.T).max())
        move(descent, moves, strain)

    monkeypatch.setattr(Descent, "move", noted)
    Newton(descent, Soft(1e6)).converge(Limits(descent, 1e-10))
    assert moved[0] == pytest.approx(newton_module.MAX_NEWTON_MOVE * descent.diameter)


def test_disks_that_nothing_holds_prove_no_minimum():
    newton = Newton(Descent(random_disks(40, 0.3), Goal(), Team()), Wrong(0.0))
    assert newton.prove() is None and not newton.leave_saddle()


@one_rank
def test_a_minimum_is_no_saddle():
    """No mode of negative curvature is found where there is none."""
    found = minimise.minimise(random_disks(64), Goal(1e-2), NewtonSolver())
    descent = Descent(found.disks, Goal(1e-2), Team())
    before = descent.disks.positions
    assert not Newton(descent, NewtonSolver()).leave_saddle()
    assert np.array_equal(descent.disks.positions, before)


@one_rank
def test_a_saddle_is_left_as_far_as_it_goes_downhill():
    """Shorter and shorter where the first try is not downhill, and not at all where none is."""

    class Steep(NotedNewton):
        """What is farther than a share of the first try is uphill."""

        downhill = 1e-3

        def pull_after(self, mode, way):
            pull = super().pull_after(mode, way)
            return pull if abs(way) < self.downhill * abs(self.pulls[0][1]) else -1.0

    newton = Steep(Descent(lattice(spacing=0.9), Goal(), Team()), NewtonSolver())
    before = newton.descent.disks.positions
    assert newton.leave_saddle()
    asked = [abs(way) for _, way, _ in newton.pulls]
    assert asked[:8] == pytest.approx(asked[0] * np.repeat([1.0, 0.1, 0.01, 0.001], 2))
    assert 0 < np.abs(newton.descent.disks.positions - before).max() < 1e-3
    newton = Steep(Descent(lattice(spacing=0.9), Goal(), Team()), NewtonSolver())
    newton.downhill, before = 0.0, newton.descent.disks.positions
    assert not newton.leave_saddle()
    np.testing.assert_allclose(newton.descent.disks.positions, before, rtol=0, atol=1e-13)


@one_rank
@pytest.mark.parametrize("dimension", (2, 3))
def test_a_particle_that_two_others_press_between_them_is_at_a_saddle(dimension):
    """Its two contacts hold it along one line only, though K without it and them is definite."""
    solver = NewtonSolver()
    descent = Descent(bridge(dimension), Goal())
    newton, limits = Newton(descent, solver), Limits(descent, 1e-10)
    newton.converge(limits)  # which leaves the symmetric place after more steps, as it is a saddle
    saddle = measure(descent.disks)
    every = find_contacts(descent.disks)
    assert saddle.rattlers[0] and every.force[(every.i == 0) | (every.j == 0)].min() > 0.1 * saddle.pressure
    assert saddle.max_force < 1e-6 * saddle.pressure and newton.prove() is None
    assert not is_minimum(
        np.arange(descent.n, dtype=np.uint32), descent.pairs, descent.offsets, 0.0,
        descent.disks.potential.constants, 1.0, saddle.max_force,
    )  # fmt: skip
    effort = Effort()
    end = minimise.minimise(bridge(dimension), Goal(), solver, effort=effort)
    state_there = measure(end.disks)
    assert effort.saddles == 1 and state_there.energy < saddle.energy and proved_minimum(end.disks)
    assert not state_there.rattlers[0] and len(state_there.contacts) == len(find_contacts(end.disks))


@one_rank
def test_a_minimum_that_hangs_on_a_weak_contact_is_left_for_another(monkeypatch):
    """Proofs leave out what bears less than a share of p d, here so large that it decides in some of these packings."""
    monkeypatch.setattr(state, "MIN_FORCE_RATIO", 0.015)
    monkeypatch.setattr(protocols, "MAX_SHAKES", 8)
    target = protocols.Target(1e-5)
    for seed in range(1, 60):
        start, effort = random_disks(32, protocols.start_phi(1e-5), seed), Effort()
        disks = protocols.make_packing(start, target, NewtonSolver(), effort=effort)
        if effort.shakes:
            break
    assert proved_minimum(disks) and measure(disks).max_force <= 1e-10
    assert disks.record["protocol"].endswith(", then p = 1e-05" + effort.shakes * ", then shaken")
    monkeypatch.setattr(protocols, "MAX_SHAKES", effort.shakes - 1)
    with pytest.raises(ConvergenceError, match="and 0 saddles"):
        protocols.make_packing(start, target, NewtonSolver())


def test_relaxing_goes_on_until_it_is_there(monkeypatch):
    """In as many slices as it takes; all evaluations are counted, on top of those before."""
    monkeypatch.setattr(minimise, "SLICE", 7)
    reports = []
    effort = Effort(evaluations=100, report=lambda effort: reports.append(effort.evaluations))
    disks = relax(random_disks(64), Goal(1e-2), 1e-5, effort=effort)
    assert len(reports) > 5 and all(more > before for before, more in itertools.pairwise(reports))
    assert reports[0] == 107 and effort.evaluations == reports[-1]
    contacts = find_contacts(disks)
    assert np.hypot(*state.net_forces(disks.n, contacts).T).max() <= 1.001e-5
    assert abs(measure(disks).pressure - 1e-2) <= 1.001e-5  # force / d, with d = 1


def test_disks_on_the_same_spot_and_coordinates_that_are_lost_are_an_error():
    disks = random_disks(64)
    places = disks.positions[[0, *range(63)]]
    with pytest.raises(ConvergenceError, match="same spot"):
        relax(Packing.from_positions(places, disks.radii, disks.cell), Goal(), 1e-3)
    for spoil in ("offsets", "box"):
        descent = Descent(random_disks(16), Goal(1e-2), Team())
        getattr(descent, spoil)[:] = np.nan
        with pytest.raises(ConvergenceError, match="forces are not finite: do two particles lie on the same"):
            descent.served(1, False)


def test_a_list_is_made_anew_where_it_is_stale_or_its_skin_ill_chosen(monkeypatch):
    descent = Descent(random_disks(16), Goal(), Team())
    kept, skin = descent.pairs, descent.skin
    descent.served(5, False)
    assert descent.pairs is kept and descent.evaluations == 5  # too early to judge the skin
    descent.served(5, True)
    assert descent.pairs is not kept and descent.skin > skin
    kept, skin = descent.pairs, descent.skin
    descent.served(descent_module.STEPS, False)
    assert descent.pairs is not kept and descent.skin < skin
    assert descent.evaluations == 10 + descent_module.STEPS


def test_evaluations_are_not_exceeded(monkeypatch):
    monkeypatch.setattr(descent_module, "STEPS", 30)
    monkeypatch.setattr(fire, "SLICE", 30)
    descent = Descent(random_disks(64), Goal(1e-2), Team())
    for more in (1, 7, 100):
        before = descent.evaluations
        assert not descent.descend(1e-14, 1e-14, more)
        assert descent.evaluations == before + more
    other = Descent(random_disks(64), Goal(), Team())
    assert not fire_descent(other, 1e-14, 100) and other.evaluations == 100


def fallen(disks, steps):
    """(positions, steps that were uphill) after so many of FIRE, by the equations and loops over all contacts."""
    longest = 0.5 / np.sqrt(disks.potential.k)
    step, mixing, downhill, uphill = 0.2 * longest, 0.1, 0, 0
    v = np.zeros((disks.n, 2))
    for _ in range(steps):
        f = state.net_forces(disks.n, find_contacts(disks))
        if np.vdot(f, v) > 0:
            downhill += 1
            if downhill > 20:
                step, mixing = min(1.1 * step, longest), 0.99 * mixing
            v = (1 - mixing) * v + mixing * np.linalg.norm(v) / np.linalg.norm(f) * f + step * f
            back = 0.0
        else:
            uphill += 1
            back, old = 0.5 * step, v
            step, mixing, downhill = max(0.5 * step, 0.02 * longest), 0.1, 0
            v = step * f
        move = step * v - (back * old if back else 0.0)
        disks = deformed(disks, move, UNSTRAINED)
    return disks.positions, uphill


@pytest.mark.parametrize(
    ("n", "steps", "k"),
    [(24, 1, 1.0), (24, 2, 1.0), (24, 19, 1.0), (24, 60, 16.0), (24, 200, 1.0), (4200, 80, 1.0)],
)
def test_fire_moves_as_its_equations_say(n, steps, k):
    """Also where what decides a step, power and sizes of forces and velocities, are sums over two domains."""
    disks = random_disks(n, 0.9, 5, Potential(k=k))
    descent = Descent(disks, Goal(), Team())
    assert descent.domains.number == 1 + (n > 4000)
    largest = np.sqrt(2.0) * np.abs(state.net_forces(n, find_contacts(disks))).max()
    assert not fire_descent(descent, 1e-300, steps)
    wanted, uphill = fallen(disks, steps)
    found = descent.disks
    apart = (found.positions - wanted) @ np.linalg.inv(disks.cell)
    assert np.abs((apart - np.round(apart)) @ disks.cell).max() < 1e-9
    assert uphill >= 1 + (steps > 100)  # the first one is: there is no velocity yet
    for share in (1 - 1e-9, 1 + 1e-9):
        assert fire_descent(Descent(disks, Goal(), Team()), share * largest, 1) == (share > 1)


@one_rank
def test_disks_that_barely_touch_are_jammed():
    """Above a pressure of 1e-11 k, below which they are apart."""
    for gap, k, jammed in (
        (4e-12, 1.0, False),
        (4e-12, 2.0**20, False),
        (1e-10, 1.0, True),
        (1e-10, 2.0**-9, True),
    ):
        row, column = np.divmod(np.arange(16), 4)
        rows = np.column_stack((column + 0.5 * (row % 2), np.sqrt(0.75) * row))
        cell = np.diag([4.0, np.sqrt(12.0)])
        disks = Packing.from_positions((1 - gap) * rows, np.full(16, 0.5), (1 - gap) * cell, Potential(k=k))
        found = minimise.minimise(disks, Goal(), NewtonSolver(), tolerance=1e-3)
        assert found.jammed == jammed == proved_minimum(found.disks)
        assert found.pressure == pytest.approx(np.sqrt(3.0) * k * gap, rel=1e-2)


@pytest.mark.parametrize("way", ["fire", "lbfgs"])
def test_every_force_is_as_small_as_was_asked(way):
    """Its length, not its larger component, whatever its direction: at every stage on the way down."""
    used = []
    for seed in range(1, 6):
        descent = Descent(random_disks(16, 0.95, seed), Goal(), Team())
        for force in np.geomspace(0.1, 1e-4, 10):
            there = fire_descent(descent, force, 5000) if way == "fire" else descent.descend(force, 1.0, 5000)
            forces = Point.of(descent).forces
            assert there and np.hypot(*forces.T).max() <= force * (1 + 1e-9)
            used.append(np.sqrt(2.0) * np.abs(forces).max() / force)
    assert max(used) > 0.97
