"""Steady shear: every law against dense numpy, its identities, invariances and order of convergence."""

from dataclasses import replace

import numpy as np
import pytest
import sheared
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from sheared import ROWS, crowd, shear

from jampetsc.errors import ConvergenceError, InputError
from jampetsc.flows import step_kernels
from jampetsc.flows.flow_run import define_flow, run_flow
from jampetsc.flows.steady_shear import SteadyShear
from jampetsc.laws.damping import Law
from jampetsc.laws.flow_models import Model, Scheme, scheme_for
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential

LIKE = (np.zeros(1),) * 2  # a tuple of the types of the loops, for which they are compiled already


def test_the_mean_velocity_of_a_cluster_is_that_of_the_flow():
    thin = crowd(phi=0.55)
    run, contacts = shear("CD0", thin, rate=0.03, tolerance=1e-14), find_contacts(thin)
    velocities = run.nonaffine_velocities()
    links = coo_array((np.ones(len(contacts)), (contacts.i, contacts.j)), shape=(thin.n, thin.n))
    number, cluster = connected_components(links, directed=False)
    assert 5 < number < thin.n
    for one in range(number):
        assert np.abs(velocities[cluster == one].mean(0)).max() < 1e-14
    survey = run.survey()
    assert survey["clusters"] == number and survey["largest_cluster"] == np.bincount(cluster).max()
    assert survey["contact_number"] == 2 * len(contacts) / thin.n
    assert survey["deepest_overlap"] == pytest.approx(np.max(contacts.overlap / contacts.sigma), rel=1e-12)


def history(run, rows=20, steps=10):
    """(σ, p) of consecutive pieces of a run."""
    found = []
    for _ in range(rows):
        run.tally[:] = 0
        run.advance(steps)
        found.append([run.tally[0] + run.tally[2] + run.tally[4], run.tally[1] + run.tally[3]])
    return np.array(found)


@pytest.mark.parametrize("name", ["RD0", "CD0"])
def test_a_factor_of_the_damping_only_rescales_time(name):
    """V sec. 4.5.2: z of RD0, k_d z as one number; by a power of two, so that rounding is the same."""
    disks, law = crowd(), ROWS[name][0]
    runs = []
    for factor in (1.0, 4.0):
        scheme = Scheme(0.1 * factor, "heun", 1e-13)
        runs.append(SteadyShear(disks, Model(replace(law, tau1=factor)), 0.01 / factor, scheme))
    reference, slow = map(history, runs)
    np.testing.assert_allclose(slow, reference, rtol=1e-12)


@pytest.mark.parametrize("name", ["RD0", "CD0"])
def test_stress_does_not_depend_on_origin_images_tilt_or_skin(name):
    disks, step = crowd(aspect=1.0, tilt=0.45), 0.1
    reference = history(shear(name, disks, step=step))
    cell = disks.cell
    rng = np.random.default_rng(0)
    shifted = disks.replace(base=disks.base + np.array([3.25, -7.5]))
    images = rng.integers(-2, 3, (disks.n, 2)).astype(float)
    shift, rest = images @ disks.cell_base, images @ disks.cell_offset
    moved = disks.replace(base=disks.base + shift, offset=disks.offset + rest)
    sideways = np.array([[1.0, 0.0], [-1.0, 1.0]])
    tilted = disks.replace(cell_base=sideways @ disks.cell_base, cell_offset=sideways @ disks.cell_offset)
    assert tilted.cell[1, 0] < 0 < cell[1, 0]
    wide = shear(name, disks, step=step)
    wide.skin = 0.9
    wide.list(wide.reference)
    runs = {"origin": shifted, "images": moved, "tilt": tilted}
    for what, start in runs.items():
        change = np.abs(history(shear(name, start, step=step)) / reference - 1).max()
        assert change < 1e-11, what
    assert np.abs(history(wide, 20) / reference - 1).max() < 1e-11


def test_unwrapped_coordinates_are_continuous():
    """Disks that do not touch follow the affine flow, however often they are folded; others never jump."""
    cell = np.array([[1.0, 0.0], [0.3, 2.0]])
    start = Packing.from_positions([[0.9, 0.3], [-0.4, 1.1], [0.2, 1.7]], [0.1, 0.1, 0.1], cell)
    layers = shear("RD0", start, rate=0.05, step=0.2, method="euler")
    crowded = shear("CD0", crowd(32, tilt=0.0), rate=0.05, step=0.2, method="euler")
    before, low = crowded.disks.unwrapped, crowded.disks.positions.min()
    for _ in range(73):
        for run in (layers, crowded):
            run.advance(10)
        affine = start.positions + layers.strain * start.positions[:, 1:] * [1.0, 0.0]
        np.testing.assert_allclose(layers.disks.unwrapped, affine, rtol=0, atol=1e-12)
        now, (width, height) = crowded.disks.unwrapped, np.diag(crowded.disks.cell)
        tilt, y = crowded.disks.cell[1, 0], crowded.disks.positions[:, 1]
        turns = (crowded.strain * height - tilt) / width
        assert abs(tilt) <= width / 2 * (1 + 1e-12) and abs(turns - round(turns)) < 1e-9
        assert -1e-9 <= y.min() and y.max() <= height + 1e-9
        assert np.hypot(*(now - before - 0.1 * before[:, 1:] * [1.0, 0.0]).T).max() < 1.5
        before = now
    assert layers.strain == pytest.approx(7.3) and round(turns) >= 3
    assert layers.disks.images[:, 0].max() >= 7 and np.abs(crowded.disks.images).max() >= 4
    disks = crowded.disks
    again = Packing.from_positions(disks.unwrapped, disks.radii, disks.cell).folded().positions
    np.testing.assert_allclose(again, disks.positions, atol=1e-10)
    assert low >= 0.0
    with pytest.raises(InputError, match="images are not counted"):
        _ = start.unwrapped


@pytest.mark.parametrize("name", ["RD0", "CD0", "CD", "rolling"])
def test_a_run_continues_from_a_state_to_the_last_bit(name):
    """With its tally, its tuned skin, and whether the run had begun."""
    one, other = shear(name, rate=0.1), shear(name, rate=0.1)
    fresh = one.state()
    other.restore(fresh)
    assert not other.has_started
    one.advance(201)
    kept = one.state()
    assert kept["skin"] != fresh["skin"] and kept["rebuilds"] and kept["started"] and kept["list_age"]
    other.restore(kept)
    for steps in (0, 101):
        one.advance(steps)
        other.advance(steps)
        now, found = one.state(), other.state()
        assert found.keys() == now.keys() == kept.keys()
        for entry, value in now.items():
            assert np.array_equal(found[entry], value), entry
    assert not np.array_equal(kept["offsets"], one.offsets)  # a copy


@pytest.mark.parametrize("name", ["RD0", "CD0", "RD"])
def test_steps_that_are_far_too_long_are_an_error(name):
    run = shear(name, step=50.0)
    with pytest.raises(ConvergenceError, match="smaller step"):
        run.advance(1000)


@pytest.mark.parametrize("name", ["RD0", "CD0"])
def test_a_perfect_crystal_flows(name):
    """Forces cancel but for rounding, and against drag nothing is dissipated: neither is an error."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(4), np.arange(4)))
    places, cell = np.column_stack((x + 0.5 * (y % 2), np.sqrt(0.75) * y)), np.diag([4.0, np.sqrt(12.0)])
    disks = Packing.from_positions(0.95 * places, np.full(16, 0.5), 0.95 * cell)
    means = run_flow(define_flow(disks, Model(ROWS[name][0]), 1e-2, 0.5)).means
    assert means.pressure.mean > 0.01
    note = "no energy is dissipated: every particle follows the affine flow, as in a perfect crystal"
    assert np.isnan(means.energy_balance) == (note in means.warnings()) == (name == "RD0")


def test_velocities_that_are_not_found_are_an_error():
    run = shear("CD0", crowd(16), rate=1e-30, tolerance=0.0)  # less than rounding leaves,
    run.largest_force = 0.0  # of which this run does not know
    with pytest.raises(ConvergenceError, match="velocities not found to 0: raise tolerance"):
        run.advance(1)


@pytest.mark.parametrize(
    "name, mass, rate, step, method",
    [
        (
            "RD",
            0.01,
            1e-4,
            0.25,
            "backward Euler",
        ),  # light disks, damped in all directions: they follow forces,
        ("CDn", 0.01, 1e-4, 1e-3, "verlet"),  # else they fly and collide
        ("CDt", 0.01, 1e-4, 1e-3, "verlet"),
        ("RD0", 0.0, 1e-3, 0.2, "euler"),
        ("CD0", 0.0, 1e-3, 0.5, "euler"),
        ("CD0", 0.0, 1e-2, 0.5, "heun"),
        ("RD0", 0.0, 0.5, 0.01, "heun"),  # no more strain than 5e-3 in a step
        ("CD", 1.0, 1e-3, 0.1, "verlet"),
        ("CD", 0.25, 1e-3, 0.025, "verlet"),
        ("CD", 0.04, 1e-3, 0.25, "backward Euler"),  # Q = 0.2
        ("rolling", 0.01, 1e-3, 0.1 * 0.01 / 2.4, "verlet"),  # spins are not implicit
    ],
)
def test_the_time_step_suits_the_model(name, mass, rate, step, method):
    """k_e = k_d = 1, smallest diameter 1: as docs/theory/units.md says."""
    scheme = scheme_for(Model(ROWS[name][0], mass), crowd(), rate)
    assert scheme.method == method and scheme.step == pytest.approx(step)
    assert scheme_for(Model(ROWS[name][0], mass), crowd(), rate, step=0.07).step == 0.07


@pytest.mark.parametrize(
    ("weights", "more", "says"),
    [
        ({"drag": 1.0}, {"mass": -1.0}, "mass -1: must lie"),
        ({"drag": 1.0}, {"mass": float("nan")}, "mass nan: must lie"),
        ({"drag": 1.0}, {"mass": float("inf")}, "mass inf: must lie"),
        ({"normal": 1.0, "transverse": 1.0}, {"background_drag": -1e-9}, "background_drag -1e-09: must lie"),
        (
            {"normal": 1.0, "transverse": 1.0},
            {"background_drag": float("nan")},
            "background_drag nan: must lie",
        ),
        ({"drag": 1.0, "exponent": 0.5}, {}, "alpha 0.5: not supported, flow has linear damping"),
        (
            {"normal": 1.0, "sliding": 1.0},
            {"background_drag": 0.1},
            "particles that roll .* no contact damps: give mass",
        ),
        ({"normal": 1.0, "sliding": 1.0}, {}, "no overdamped limit.* because particles that roll"),
        ({"normal": 1.0}, {}, "no overdamped limit.* because damping of one direction only"),
        ({"transverse": 1.0}, {}, "no overdamped limit.* because damping of one direction only"),
        ({"drag": 1.0}, {"background_drag": 0.1}, "an option of contact damping, not of some"),
    ],
)
def test_models_that_are_refused(weights, more, says):
    with pytest.raises(InputError, match=says):
        Model(Law("some", **weights), **more)


def test_a_direction_that_no_contact_damps_may_be_damped_by_friction_or_drag():
    assert Model(Law("some", normal=1.0), background_drag=0.1).drag == 0.1
    assert Model(Law("some", normal=1.0, drag=0.2)).drag == 0.2
    assert Model(Law("some", normal=1.0, transverse=1.0)).mass == 0.0


@pytest.mark.parametrize("exponent", [2.0, 2.5, 4.0])
def test_time_steps_are_the_same_in_any_unit_of_length(exponent):
    small = crowd(16, phi=0.9).replace(potential=Potential(exponent=exponent))
    large = Packing.from_positions(8.0 * small.positions, 8.0 * small.radii, 8.0 * small.cell)
    for k in (1.0, 3.0):  # of contacts as stiff
        stiff, soft = (
            Potential(exponent=exponent, k=k),
            Potential(exponent=exponent, k=k * 8.0 ** (2.0 - exponent)),
        )
        steps = [
            scheme_for(Model(ROWS["RD0"][0]), small.replace(potential=stiff), 1e-4).step,
            scheme_for(Model(ROWS["RD0"][0]), large.replace(potential=soft), 1e-4).step,
        ]
        assert steps[1] == pytest.approx(8.0 ** (2.0 - exponent) * steps[0])  # kτ₁ over stiffness


def test_time_steps_depend_on_k_tau1_and_the_potential():
    """With forces 4 times as large, damping times twice as long, and Hertzian disks, 3/2 times as stiff."""
    disks = crowd()
    stiff = disks.replace(potential=replace(disks.potential, k=4.0))
    for name in ("RD0", "CD0", "unequal"):
        law, _ = ROWS[name]
        step = scheme_for(Model(law), disks, 1e-4).step
        assert scheme_for(Model(law), stiff, 1e-4).step == pytest.approx(step)  # k τ₁ / k
        slower = Model(replace(law, tau1=2.0 * law.tau1))
        assert scheme_for(slower, disks, 1e-4).step == pytest.approx(2 * step)
        hertzian = disks.replace(potential=Potential("hertzian", disks.potential.stiffness))
        assert scheme_for(Model(law), hertzian, 1e-4).step == pytest.approx(step / 1.5)
    for given, m, wanted in ((disks, 0.5, 0.05), (stiff, 0.4, 0.01), (stiff, 10.0, 0.1 * np.sqrt(2.5))):
        flying = scheme_for(Model(Law("some", normal=1.0), m), given, 1e-4)
        assert (flying.method, flying.step) == ("verlet", pytest.approx(wanted))  # m/c and √(m/k)
    for tau1, rate, method in ((1.0, 4.9e-3, "euler"), (1.0, 5.1e-3, "heun"), (2.0, 2.6e-3, "heun")):
        for given in (disks, stiff):
            assert scheme_for(Model(Law("some", drag=1.0, tau1=tau1)), given, rate).method == method
    weak = Model(Law("some", normal=1.0, transverse=0.3))
    assert scheme_for(weak, disks, 1e-4).step == pytest.approx(0.3 * 0.5)  # set by the weaker one
    braked = Model(Law("some", normal=1.0, transverse=0.3, drag=3.0), 0.01)
    assert scheme_for(braked, disks, 1e-4).step == pytest.approx(0.25 * 3.0)  # set by the strongest one
    larger = Packing.from_positions(2 * disks.positions, 2 * disks.radii, 2 * disks.cell, disks.potential)
    assert scheme_for(Model(ROWS["RD0"][0]), larger, 1e-4).step == pytest.approx(4 * 0.2)  # k_e/d²


def test_coordination_is_a_mean_over_disks_that_move():
    disks = crowd(16, phi=0.9)
    contacts = find_contacts(disks)
    run = SteadyShear(disks, Model(ROWS["RD0"][0]), 0.02, Scheme(0.05, "euler", 1e-6), wall_disks=4)
    free = np.count_nonzero(contacts.i >= 4) + np.count_nonzero(contacts.j >= 4)
    assert run.survey()["contact_number"] == free / 12


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_nan_and_inf_count_as_blown_up(bad):
    """Comparisons with NaN are all false, so it is found in sums."""
    listed = 1.0, 0.5, 0.1
    for where in ((0, 0), (3, 0), (3, 1)):
        o, good = np.zeros((4, 2)), np.full((4, 2), 1e-3)
        u = good.copy()
        u[where] = bad
        task, room = shear("CD").step_constants(), np.empty((4, 4, 2))
        found = [
            step_kernels.move(o.copy(), u, 0.1, 0.1, np.empty_like(o), LIKE),
            step_kernels.drift(o, u, 1.0, 0.1, 0.1, *room[:2], LIKE)[:2],
            step_kernels.kick(o, good.copy(), good, task, 0.1, u.copy(), *room[:2], LIKE)[:2],
        ]
        for far, longest in found:
            assert step_kernels.status_of(far, longest, 0.0, listed) == step_kernels.BLOWN_UP
            sums = np.zeros((3, step_kernels.SUMMED + 2))  # of one domain of three
            sums[1, -2:] = far, longest
            assert step_kernels.joint_status(task, sums, 0.0)[0] == step_kernels.BLOWN_UP
    far, longest = step_kernels.move(o, good, 0.1, 0.1, np.empty_like(o), LIKE)
    assert step_kernels.status_of(far, longest, 0.0, listed) == step_kernels.DONE


def test_a_step_in_which_a_disk_would_jump_is_divided():
    """It has the velocities of four steps a quarter as long, and their means."""
    disks, model = crowd(24, phi=0.9), Model(ROWS["CD0"][0])
    long, short = (SteadyShear(disks, model, 0.3, Scheme(step, "heun", 1e-13)) for step in (2.0, 0.5))
    long.advance(1)
    short.advance(4)
    assert (long.substeps, short.substeps, long.steps) == (4, 0, 1)
    assert long.nonaffine_velocities() == pytest.approx(short.nonaffine_velocities(), abs=1e-12)
    assert long.tally == pytest.approx(short.tally / 4, abs=1e-12)
    again = SteadyShear(disks, model, 0.3, long.scheme)
    again.restore(long.state())
    assert again.substeps == 4


def test_status_of_a_step():
    """More than half of the largest σ is a jump; a list is stale by its own rule; a jump comes before that."""
    listed, done, stale, jump = (1.2, 0.5, 0.1), step_kernels.DONE, step_kernels.STALE, step_kernels.BLOWN_UP
    for far, longest, status in (
        (0.1, 0.6, done), (0.1, 0.6001, jump), (0.25, 0.1, done), (0.2501, 0.1, stale), (0.3, 0.7, jump),
        (0.1, np.nan, jump),
    ):  # fmt: skip
        assert step_kernels.status_of(far, longest, 0.0, listed) == status
    assert (
        step_kernels.status_of(0.0, 0.0, 0.8, listed)
        == step_kernels.status_of(0.0, 0.0, -0.8, listed)
        == step_kernels.STALE
    )


def test_starts_of_soft_disks_overlap_by_half_at_most():
    for share in (0.499, 0.5, 0.501):
        disks = Packing.from_positions([[0.0, 0.0], [1.2 * (1 - share), 0.0]], [0.5, 0.7], 6.0 * np.eye(2))
        if share <= 0.5:
            assert define_flow(disks, sheared.model("RD0"), 1e-2, 0.5).disks is disks
            continue
        with pytest.raises(
            InputError,
            match=r"two particles overlap by 50\.1 % of their distance at contact \(at most 50 %\)",
        ):
            define_flow(disks, sheared.model("RD0"), 1e-2, 0.5)


def one_pair(overlap, k=1.0):
    """A flow, not yet run, of 16 disks of which two overlap and no others touch."""
    places = 3.0 * np.array([[a, b] for a in range(4) for b in range(4)], float)
    places[1] = places[0] + [1.0 - overlap, 0.0]
    disks = Packing.from_positions(places, np.full(16, 0.5), 12.0 * np.eye(2), Potential(k=k))
    return define_flow(disks, sheared.model("RD0"), 1e-2, 0.02, discard=0.0)


def test_disks_that_touch_a_little_flow():
    """One pair whose pressure is far above a millionth of γ̇kτ₁, and far below a millionth of k."""
    assert 1e-8 < 0.2 * run_flow(one_pair(1e-4)).means.pressure.mean < 1e-7  # γ̇kτ₁ = 0.01


@pytest.mark.parametrize("k", [1.0, 1e9])
def test_disks_that_do_not_touch_are_an_error_for_any_k(k):
    """One pair that overlaps by 1e-9 at the start presses with 1e-9 γ̇kτ₁ or so: that is no flow."""
    with pytest.raises(ConvergenceError, match=r"no two particles touched within the strain of 0\.02"):
        run_flow(one_pair(1e-9, k))
