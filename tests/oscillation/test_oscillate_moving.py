"""Contacts that open and close: against the sweep, fixed contacts, flow's own steps, an ODE solver, and themselves."""

from functools import cache

import numpy as np
import pytest
from oscillations import steady_oscillation
from powerlaw import Opening
from samples import SAMPLES, bridge, isostatic, physics, published
from sheared import forces
from spheres import few_spheres
from sweeps import Sweep

from jampetsc.analysis import cycle_series
from jampetsc.errors import ConvergenceError
from jampetsc.jamming.stepwise_shear import StepwiseShear, measure_minimum
from jampetsc.minimisation.hessian import Bonds
from jampetsc.oscillation import adaptive_steps, dashpots, repeated_cycles, time_step
from jampetsc.oscillation.drive import Drive, Imposed, Moduli
from jampetsc.oscillation.moving_contacts import MovingContacts
from jampetsc.oscillation.repeated_cycles import START_STEPS, repeat_cycles
from jampetsc.oscillation.steady_oscillation import SteadyOscillation
from jampetsc.oscillation.time_step import STAGE
from jampetsc.packing.contacts import find_contacts, measure
from jampetsc.packing.strain import simple_shear
from jampetsc.petsc.hessian_solver import NewtonSolver
from jampetsc.petsc.session import current

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]  # a packing is one rank's own
SLIDING = physics(rotations=False).law


@cache
def shaken(omega, amplitude, steps=32, cycles=None, sample=published, stress=False, alpha=1.0, **options):
    """The Repeated of a sample under an imposed strain, or stress."""
    disks, law = sample(), physics(exponent=alpha, **options)
    oscillation = steady_oscillation(disks, law, START_STEPS)
    start = oscillation.start(Drive(omega, amplitude, stress))
    return repeat_cycles(disks, law.law, start, steps, cycles)[0]


def moving(step, scale, *more, law=SLIDING, disks=None):
    """A motion of the published packing or of other disks, without rotations unless told."""
    return MovingContacts(disks or published(), law, step, scale, *more)


@pytest.mark.parametrize(
    ("omega", "amplitude", "stress", "options"),
    [
        (1e-4, 1e-7, False, {"normal": 0.25, "beta": 3.0, "tau1": 2.0}),
        (3.0, 1e-7, False, {"rotations": False, "beta": 0.0}),
        (1e-4, 1e-8, True, {}),
    ],
)
def test_small_amplitudes_are_the_sweep(omega, amplitude, stress, options):
    sweep = Sweep(published(), physics(**options), np.array([omega]), 1e-8, current().comm).solved()
    G, bound = sweep.G[0], sweep.bounds[0, 0]
    found = shaken(omega, amplitude, stress=stress, **options)
    assert abs(found.G - G) <= found.error + bound
    assert found.error < 1e-2 * abs(G) and found.error < 0.2 * G.imag
    strain, loss = (amplitude / abs(G), G.imag) if stress else (amplitude, found.G.imag)
    assert found.work == pytest.approx(np.pi * loss * strain**2, rel=1e-2 if stress else 1e-6)
    assert abs(found.energy_balance) < 5e-3 and (not stress or abs(found.drift) < 1e-4 * strain)


@pytest.mark.parametrize(
    ("alpha", "omega", "amplitude", "stress"),
    [(0.5, 2e-10, 1e-8, True), (2 / 3, 1e-6, 1e-7, False), (1.5, 5.0, 1e-6, True)],
)
def test_small_amplitudes_are_fixed_contacts(alpha, omega, amplitude, stress):
    """Under a power law too, of any exponent; what is put in is dissipated."""
    weights = {"normal": 0.5, "beta": 1.5}
    fixed = steady_oscillation(published(), physics(exponent=alpha, **weights), 32)
    exact = fixed.solve(Drive(omega, amplitude, stress))
    found = shaken(omega, amplitude, 16, 3, stress=stress, alpha=alpha, **weights)
    assert abs(found.G - exact.G) <= found.error + exact.error
    assert found.error < 2e-2 * abs(exact.G) < 0.2 * exact.G.imag
    np.testing.assert_allclose(found.harmonics, exact.harmonics, atol=6e-3)
    for name in ("strain_waveform", "stress_waveform"):
        wave = getattr(exact, name)
        np.testing.assert_allclose(getattr(found, name), wave, atol=0.03 * wave.max(), err_msg=name)
    strain = amplitude / abs(found.G) if stress else amplitude
    assert found.work == pytest.approx(np.pi * found.G.imag * strain**2, rel=1e-6)
    assert abs(found.energy_balance) < 8e-3


def strained(motion, gamma, rate):
    """A step whose two stages end at these strains, and rates of strain."""
    return motion.advance([Imposed(*pair) for pair in zip(gamma, rate, strict=True)])


@pytest.mark.parametrize(
    ("alpha", "omega", "imposed"), [(0.5, 1e-5, {"stress": 2e-4}), (2 / 3, 1e-3, {"strain": 3e-3})]
)
def test_against_integration_in_time(alpha, omega, imposed):
    """From rest, contacts opening on the way: strain, stress and places are those that an ODE solver finds."""
    law, end, steps = physics(exponent=alpha, rotations=False), 1.8 / omega, 32
    exact = Opening(published(), law, omega, **imposed)
    Q, stress = exact.until(end)
    assert len(exact.counts) >= 3
    strain = imposed.get("strain", 3e-3)
    motion = moving(end / steps, strain, omega * strain, law=law.law)
    for n in range(steps):
        phase = omega * motion.step * (n + np.array([STAGE, 1.0]))
        if "stress" in imposed:
            last = motion.advance([Imposed(stress=imposed["stress"] * part) for part in np.sin(phase)])[1]
        else:
            last = strained(motion, strain * np.sin(phase), strain * omega * np.cos(phase))[1]
    moved = motion.disks.positions - published().positions
    moved -= np.round(moved @ np.linalg.inv(motion.disks.cell)) @ motion.disks.cell
    expected = Q[:-1].reshape(-1, 2) - published().positions
    assert motion.gamma == pytest.approx(Q[-1], rel=2e-3)
    assert last.stress == pytest.approx(stress, rel=2e-3)
    difference = moved - moved.mean(axis=0) - expected + expected.mean(axis=0)
    assert np.abs(difference).max() < 2e-3 * np.abs(expected).max()


def test_contacts_at_rest_are_soft_enough(monkeypatch):
    """Where the force of a contact begins to be linear in its velocity does not matter."""
    words = {"alpha": 0.5, "rotations": False}
    usual = shaken(2e-10, 1e-7, 16, 1, **words).G
    off = []
    for below in (0.3, 10.0 * dashpots.LINEAR_BELOW):
        monkeypatch.setattr(dashpots, "LINEAR_BELOW", below)
        off.append(abs(shaken.__wrapped__(2e-10, 1e-7, 16, 1, **words).G - usual))
    assert off[0] > 1e-4 * abs(usual) and off[1] < 1e-6 * abs(usual)


def test_what_newtons_method_leaves_of_the_forces_does_not_matter(monkeypatch):
    """Even with few steps, with which it leaves more: it is far below what the steps do."""
    usual = shaken(0.1, 2e-3, 16, 1, rotations=False)
    monkeypatch.setattr(repeated_cycles, "FORCE_TOLERANCE", 1e-9)
    exact = shaken.__wrapped__(0.1, 2e-3, 16, 1, rotations=False)
    assert exact.newton_steps > usual.newton_steps
    assert abs(exact.G - usual.G) < 1e-2 * usual.error


def test_rattlers_do_not_matter_where_they_touch_nothing():
    """Nothing holds them, and they have no say."""
    law = physics(rotations=False)
    sweep = Sweep(isostatic(), law, np.array([1e-3]), 1e-8, current().comm).solved()
    G = sweep.G[0]
    found = shaken(1e-3, 1e-9, 16, 3, sample=isostatic, rotations=False)
    assert abs(found.G - G) <= 2.0 * found.error < 0.05 * abs(G)


def test_order_of_the_steps():
    """While contacts stay, halving the steps takes off three quarters of the error."""
    runs = [shaken(0.1, 1e-5, steps, cycles=2, rotations=False).G for steps in (8, 16, 32)]
    assert 3.0 < abs(runs[1] - runs[0]) / abs(runs[2] - runs[1]) < 5.0


@pytest.mark.parametrize("rotations", [True, False])
def test_forces_balance_after_a_step(rotations):
    """Elastic and viscous forces of the contacts there are, at a state in which some have opened."""
    law, strain = physics(rotations=rotations).law, 1e-2
    motion = moving(0.02, strain, law=law)
    for step in range(40):
        strained(motion, strain * 0.02 * np.array([step + 0.3, step + 1.0]), np.full(2, strain))
    disks = motion.disks
    assert len(find_contacts(disks)) != len(find_contacts(published()))
    u, spins = motion.velocities[:, :2], motion.velocities[:, 2] if rotations else np.zeros(disks.n)
    elastic, viscous, torques, *_ = forces(disks, law, strain, u, spins)
    assert np.abs(elastic + viscous).max() < 2e-3 * strain < np.abs(viscous).max()
    assert np.abs(torques).max() < 2e-3 * strain


def sheared(motion, strain, steps):
    """The motion after a steady shear in so many steps."""
    for n in range(steps):
        ends = strain / steps * np.array([n + STAGE, n + 1.0])
        strained(motion, ends, np.full(2, strain / steps / motion.step))
    return motion


def test_no_contact_is_missed():
    """Lists are made anew in time: after a long shear all contacts are seen, and the cell is where it should be."""
    motion = sheared(moving(20.0, 1e-3), 0.6, 60)
    listed = motion.listed
    r = Bonds.of(motion.pairs, motion.disks.potential, motion.offsets, simple_shear(motion.gamma - listed))
    assert listed > 0.2  # not the first list
    assert np.count_nonzero(r.overlap > 0.0) == len(find_contacts(motion.disks))
    before, after = published().cell, motion.disks.cell
    turned = (after[1, 0] - before[1, 0] - 0.6 * before[1, 1]) / before[0, 0]
    assert turned == pytest.approx(round(turned), abs=1e-9) and motion.gamma == pytest.approx(0.6)


def test_slow_shear_goes_from_minimum_to_minimum():
    """Through events in which contacts open, disks come loose and K has negative modes; where steps are long."""
    motion = sheared(moving(1e6, 1e-3), 2e-2, 20)
    state = measure(motion.disks)
    assert state.max_force < 1e-4 * state.pressure
    slow = StepwiseShear(published(), 1e-3, NewtonSolver(), 1e-10)
    for _ in range(20):
        slow.advance()
    assert measure_minimum(slow.disks).shear_stress == pytest.approx(state.stress[0, 1], abs=1e-6)


def test_harmonics_of_a_cycle_without_its_creep():
    phase = 2.0 * np.pi * np.arange(1, 33) / 32
    creep = 0.2 + 0.7 * np.arange(1, 33) / 32
    values = 2.0 * np.sin(phase) + 0.5 * np.cos(phase) + 0.1 * np.sin(3.0 * phase) + creep
    words, first = (values, phase / (2.0 * np.pi), np.full(32, 1.0 / 32), 0.7), 2.0 + 0.5j
    for stress, G, strain in ((False, first / 3.0, 3.0), (True, 3.0 / first, abs(first))):
        found = Drive(1.0, 3.0, stress).moduli(*words)
        assert (found.G, found.strain) == pytest.approx((G, strain), rel=1e-13)
        np.testing.assert_allclose(found.harmonics * first, [-0.1, 0.0], atol=1e-14)
        assert found.work == pytest.approx(np.pi * found.G.imag * strain**2)


def test_what_cycles_still_change_is_in_the_error():
    """Also where the halves of the steps happen to agree: so fast that no cycle is like the one before."""
    found = shaken(10.0, 5e-2, 8, cycles=3, rotations=False)
    assert 0.05 * abs(found.G) < found.cycle_change < found.error and not found.repeats


def test_a_stress_that_shears_for_good_is_refused():
    """Above the yield stress no cycle comes back, and nothing waits for it."""
    with pytest.raises(ConvergenceError, match="packing: flows, its strain changes by"):
        shaken(1e-2, 1e-2, 16, 3, stress=True, rotations=False)


def test_any_amplitude():
    """Steps that disks could not take at once, from rest: linear response would take them through each other."""
    found = shaken(1.0, 0.6, 8, cycles=1, rotations=False)
    assert found.steps_taken > 4 + 8 and 0.1 < found.G.imag < 1.0 and abs(found.energy_balance) < 0.1


def test_steps_that_are_too_long_are_refused(monkeypatch):
    """Where they are not cut."""
    monkeypatch.setattr(adaptive_steps, "MAX_HALVINGS", 0)
    with pytest.raises(ConvergenceError, match="Give more steps"):
        shaken(1.0, 1.0, 16, cycles=3)


@pytest.mark.parametrize("rotations", [False, True])
@pytest.mark.parametrize("step", [1e-6, 1e-10])
def test_short_steps_do_not_carry_all_disks_away(step, rotations):
    """Nothing holds them together: of forces that are rounded they would go as far as disks move towards each other."""
    law = physics(rotations=rotations).law
    motion = moving(step, 1e-3, law=law)
    motion.displace(
        1e-4 * np.random.default_rng(1).normal(size=(16, 2)), np.zeros((16, law.dofs(2))), 0.0, 0.0
    )
    before = motion.offsets
    strained(motion, (0.0, 0.0), (0.0, 0.0))
    moved = motion.offsets - before
    assert np.abs(moved.mean(axis=0)).max() < 1e-3 * np.abs(moved - moved.mean(axis=0)).max()
    assert motion.matrix.factorisations == 1


def test_energy_that_the_shortest_steps_lose_is_told(monkeypatch):
    monkeypatch.setattr(adaptive_steps, "MAX_HALVINGS", 2)
    run, _ = run_of(1.0, 1e-3, 16)
    with pytest.raises(
        ConvergenceError, match=r"^energy error .* \d\.\de\+\d+ times .*\. Give more steps\.$"
    ):
        list(run.steps.over(0.0, 1.0, 1e-20))
    assert run.motion.step == 0.25


def run_of(omega, strain, count, alpha=1.0):
    """A run of cycles under an imposed strain that has not begun, and its Start."""
    law = physics(exponent=alpha, rotations=False)
    oscillation = steady_oscillation(published(), law, START_STEPS)
    start = oscillation.start(Drive(omega, strain, False))
    return repeated_cycles.Cycles(published(), law.law, start, count), start


@pytest.mark.parametrize(("alpha", "omega", "count"), [(1.0, 3.0, 96), (0.5, 1e-5, 64)])
def test_energy_balances(alpha, omega, count):
    """What is dissipated and stored in a cycle is the work."""
    run, start = run_of(omega, 1e-6, count, alpha)
    run.motion.displace(start.displacement, start.velocity, start.gamma, start.rate)
    run.repeat(1)
    assert abs(run.finished[0].consumed / run.finished[0].moduli.work - 1.0) < 1e-6


def test_steps_are_cut_where_disks_rearrange():
    """None loses more energy than it may, and together they lose less than those that are not cut.

    Each begins where the last has ended, whole at places where whole ones begin, longer again after the event.
    """
    lost, counts, period = [], [], 2.0 * np.pi / 16
    for allowed in (np.inf, 1e-8):
        run, _ = run_of(1e-4, 2e-2, 16)
        steps, spent, work = [], 0.0, 0.0
        for n in range(4):
            for stages in run.steps.over(n * period, period, allowed):
                fed = [weight * run.motion.volume * seen.stress * seen.rate for _, weight, seen in stages]
                dissipated = [weight * seen.power for _, weight, seen in stages]
                assert abs(sum(fed) - sum(dissipated) - run.motion.gained) <= allowed
                spent, work = spent + sum(dissipated) + run.motion.gained, work + sum(fed)
                length = sum(weight for _, weight, _ in stages)
                steps.append((stages[-1][0] - length, length))
        lost.append(abs(spent - work))
        counts.append(run.steps.accepted)
        begins, lengths = np.transpose(steps)
        np.testing.assert_allclose([*begins, 4 * period], [0.0, *(begins + lengths)], atol=1e-12)
        assert run.motion.gamma == pytest.approx(2e-2 * np.sin(4 * period), rel=1e-9)
    assert counts[0] == 4 and 2 * counts[0] < counts[1] == len(steps) < 64
    assert lost[1] < 0.5 * lost[0]
    for whole in (-np.log2(lengths / period), begins / lengths):
        np.testing.assert_allclose(whole, np.round(whole), atol=1e-9)
    assert lengths.min() <= 0.25 * period and np.any(np.diff(lengths) > 1e-9)


def test_of_many_short_steps_the_later_ones_have_one_stage(monkeypatch):
    """They lose no more energy than others, and end where they should."""
    monkeypatch.setattr(adaptive_steps, "MIN_SHORT_HALVINGS", 1)
    monkeypatch.setattr(adaptive_steps, "MAX_SHORT_STEPS", 0)
    run, _ = run_of(1e-4, 2e-2, 16)
    counts, time, period = [], 0.0, 2.0 * np.pi / 16
    for n in range(4):
        for stages in run.steps.over(n * period, period, 1e-8):
            work = [
                weight * (run.motion.volume * end.stress * end.rate - end.power) for _, weight, end in stages
            ]
            assert abs(sum(work) - run.motion.gained) <= 1e-8
            time += sum(weight for _, weight, _ in stages)
            assert stages[-1][0] == pytest.approx(time)
            counts.append(len(stages))
    assert set(counts) == {1, 2} and time == pytest.approx(4 * period)
    assert run.motion.gamma == pytest.approx(2e-2 * np.sin(4 * period), rel=1e-9)


@pytest.mark.parametrize("sample", ["published", "hertzian", "power", "spheres"])
def test_energy_of_a_change(sample):
    """As the difference of energies, but for rounding; of a small change to the last digits."""
    rng, disks = np.random.default_rng(1), few_spheres() if sample == "spheres" else SAMPLES[sample]()
    motion, x = moving(1.0, 1e-3, disks=disks), rng.normal(size=disks.base.shape)
    still = motion.at(0.0 * x, 0.0 * x, 0.0)

    def energy(state):
        overlaps = np.maximum(state.bonds.overlap, 0.0)
        return float(np.sum(disks.potential.energy(overlaps, motion.pairs.sigma)))

    moved = motion.at(still.places, 1e-2 * x, 2e-3)
    assert np.any((moved.bonds.overlap > 0.0) != (still.bonds.overlap > 0.0))
    assert motion.energy_change(still, moved) == pytest.approx(energy(moved) - energy(still), rel=1e-12)
    forces, sheared = motion.forces(moved)
    little = motion.energy_change(moved, motion.at(moved.places, 1e-12 * x, 2e-3 + 1e-12)) * 1e12
    assert little == pytest.approx(sheared - np.sum(forces * x), rel=1e-6)


@pytest.mark.parametrize("sample", [published, few_spheres])
def test_curved_steps_follow_the_forces(sample):
    """Their curvature is the second derivative of the forces of springs along a straight step."""
    rng, disks = np.random.default_rng(1), sample()
    motion = moving(1.0, 1e-3, disks=disks)
    x, growth = rng.normal(size=disks.base.shape), 0.7
    still, h = 0.0 * x, 1e-5
    pulls = [motion.forces(motion.at(still, t * x, t * growth)) for t in (-h, 0.0, h)]
    forces, sheared = motion.curvature(motion.at(still, still, 0.0), x, growth)
    for k, bend in enumerate((forces, sheared)):
        difference = (pulls[0][k] - 2.0 * pulls[1][k] + pulls[2][k]) / h**2
        np.testing.assert_allclose(bend, difference, rtol=1e-3, atol=1e-3 * np.abs(forces).max())


@pytest.mark.parametrize(
    ("sample", "options", "free"),
    [
        (published, {}, True),
        (published, {"rotations": False, "tau1": 2.0}, False),
        (few_spheres, {"rotations": False}, False),
        (few_spheres, {"beta": 3.0}, True),
    ],
)
def test_the_matrix_of_a_step_is_the_derivative_of_its_forces(sample, options, free):
    """By differences of the residual forces; with spins, whose blocks are not symmetric, and with a free strain."""
    rng, h = np.random.default_rng(1), 0.7
    motion = moving(1.0, 1e-3, law=physics(**options).law, disks=sample())
    still = np.zeros(motion.offsets.shape)
    imposed = Imposed(stress=1e-4) if free else Imposed(1e-3, 1e-3)
    start = (0.0, 0.0) if free else (imposed.gamma, imposed.rate)
    problem = time_step._Problem(motion, h, still, *start, imposed, motion.fluid(start[0]))
    q = np.zeros(motion.n * motion.dofs + 1)
    right = rng.normal(size=q.shape)
    if not free:
        right[-1] = 0.0
    on_disks = right[:-1].reshape(motion.n, -1)[:, : still.shape[1]]
    on_disks -= on_disks.mean(axis=0)  # a translation of all disks changes no force
    dashpots = motion.dashpots(problem.state(q))
    trial = problem.at(q, dashpots)
    tangents = dashpots.tangents(trial.z, trial.f)
    motion.matrix.factorise(trial.state, dashpots, tangents / h, problem.fluid.weights / h, free)
    assert motion.matrix.factorisations == 1  # so μ is tiny
    x = motion.matrix.solve(right)
    tiny = 1e-6 / np.abs(x).max()
    back, ahead = (problem.at(q + sign * tiny * x, dashpots).residual for sign in (-1.0, 1.0))
    np.testing.assert_allclose((back - ahead) / (2.0 * tiny), right, atol=1e-5)
    assert (x[-1] != 0.0) == free


class Told(repeated_cycles.Cycles):
    """A run whose cycles have these G*, one after the other, and lose this part of the work."""

    def __init__(self, G, lost=0.0):
        self.finished, self.moduli, self.consumed = [], iter(G), 1.0 + lost

    def run_cycle(self):
        moduli = Moduli(next(self.moduli), np.zeros(2), 1.0, 1.0)
        self.finished.append(repeated_cycles.CycleResult(moduli, self.consumed, 0.0))


@pytest.mark.parametrize(
    ("G", "cycles", "count", "left", "change", "spread"),
    [
        # a thousandth is left
        ([1 + 0.5**n for n in range(60)], None, 11, 0.5**10, 0.5**10, 0.5**5 - 0.5**10),
        ([1.0, 1.0, 7.0], None, 2, 0.0, 0.0, 0.0),  # what has not changed at all is enough
        ([1.0, 2.0] * 50, 7, 7, np.inf, 1.0, 1.0),
        ([*np.arange(118.0), 1.0, 1.0], None, 120, 0.0, 0.0, 116.0),  # the last one is in time
        ([10.0, 7.0, 1.5, 1.2, 1.0], 5, 5, 0.4, 0.2, 0.5),  # spread is that of the later half
        ([9.0, 3.0, 1.0, 2.0], 4, 4, 1.0, 1.0, 1.0),
        ([1.0, 2.0, 2.9, 3.71], 4, 4, 7.29, 0.81, 0.81),  # slow: far more than the last change
        ([1.0, 1.1, 1.3], 3, 3, np.inf, 0.2, 0.2),
        ([1.0], 1, 1, np.inf, np.inf, 0.0),
    ],
)
def test_cycles_are_repeated_until_what_is_left_is_a_thousandth_and_not_once_more(
    G, cycles, count, left, change, spread
):
    run = Told(G)
    run.repeat(cycles)
    assert len(run.finished) == count
    assert [run.remaining, run.change, run.spread] == pytest.approx([left, change, spread])


def test_cycles_that_go_on_changing_are_given_up():
    run, rough = Told(1.02 ** np.arange(130)), Told(1.02 ** np.arange(130))
    rough.repeat(None, accurate=False)  # what is left of a transient belongs to the run with all steps
    assert len(rough.finished) == 6
    with pytest.raises(
        ConvergenceError,
        match=r"the last of 120 cycles changes it by 2 %\. Give cycles 120 to keep its value",
    ):
        run.repeat(None)
    assert len(run.finished) == 120


def test_cycles_that_fluctuate_are_averaged_until_both_moduli_are_known():
    """A first run is over once it is clear that they do; a small part need not be known as well as the other."""
    rng = np.random.default_rng(4)
    G = (1.0 + 0.1 * rng.normal(size=100)) + 0.01j * rng.normal(size=100)
    G[:3] += [8.0, 3.0, 1.0]
    rough, run = Told(G), Told(G)
    rough.repeat(None, accurate=False)
    run.repeat(None)
    assert len(rough.finished) < len(run.finished) < 60 and not run.repeats
    mean = run.mean
    assert mean.errors.real <= 0.05 and mean.errors.imag <= 0.01 and mean.transient >= 2
    assert run.averaged == run.finished[mean.transient :]


def test_energy_that_steps_lose_is_in_the_errors_of_a_mean():
    """Independent of the fluctuations, so more cycles are averaged where steps lose more."""
    rng, counts = np.random.default_rng(4), []
    G = 1.0 + 0.5j + 0.15 * (rng.normal(size=120) + 0.5j * rng.normal(size=120))
    for lost in (0.0, 0.03):
        run = Told(G, lost)
        run.repeat(None)
        of_steps = run.mean_errors.real**2 - run.mean.errors.real**2
        assert of_steps == pytest.approx((lost * run.mean.value.real) ** 2, abs=1e-12)
        assert run.mean_errors.real <= 0.05 * run.mean.value.real and len(run.finished) < 120
        counts.append(len(run.finished))
    assert counts[1] > counts[0]


def test_a_first_run_that_still_settles_is_made_again(monkeypatch):
    """Its difference from the second would not be the error of the steps."""
    usual, exact = shaken(1e-2, 1e-2, 16), shaken(1e-2, 1e-2, 64)
    monkeypatch.setattr(repeated_cycles, "MAX_COARSE_CYCLES", 1)
    again = shaken.__wrapped__(1e-2, 1e-2, 16)
    assert usual.repeats and again.repeats and again.cycles == 1 + 3 + 1
    for found in (usual, again):
        assert abs(found.G - exact.G) <= found.error + exact.error < 0.1 * abs(exact.G)
    assert again.error == pytest.approx(usual.error, rel=0.3)


def test_far_above_yielding_the_mean_of_cycles_is_the_result(monkeypatch):
    """Its moduli, errors, work and waveforms are those of the cycles that are averaged."""
    monkeypatch.setattr(cycle_series, "MIN_AVERAGED_CYCLES", 4)
    found = shaken(0.1, 0.3, 8, cycles=5, rotations=False)
    assert not found.repeats and 4 <= found.averaged_cycles <= 5 and found.cycles == 10
    parts = np.array([found.G_error.real, found.G_error.imag])
    assert np.all(parts < 0.4 * np.array([found.G.real, found.G.imag]))
    assert found.error == pytest.approx(np.hypot(*parts))
    assert np.all(parts > 0.9 * abs(found.energy_balance) * np.array([found.G.real, found.G.imag]))
    work = np.pi * found.G.imag * 0.3**2
    area = np.sum(found.stress_waveform * np.gradient(np.append(found.strain_waveform, 0.0))[:-1])
    assert (found.work, area) == (pytest.approx(work), pytest.approx(work, rel=0.1))
    assert np.all(found.harmonics_error > 0.0) and found.harmonics_error.shape == found.harmonics.shape


@pytest.fixture
def runs(monkeypatch):
    """All Cycles that are made from now on."""
    runs = []

    class Kept(repeated_cycles.Cycles):
        def __init__(self, *words):
            super().__init__(*words)
            runs.append(self)

    monkeypatch.setattr(repeated_cycles, "Cycles", Kept)
    return runs


def test_both_runs_are_counted(runs):
    """Steps, cycles, Newton's steps and factors are those of half of the steps and of all of them."""
    found = shaken.__wrapped__(0.1, 1e-6, 16, 3, rotations=False)
    assert (found.steps_taken, found.cycles) == (3 * (8 + 16), 6) and [run.count for run in runs] == [8, 16]
    newton = [run.motion.stages.iterations for run in runs]
    factors = [run.motion.matrix.factorisations for run in runs]
    assert (found.newton_steps, found.factorisations) == (sum(newton), sum(factors))
    assert min(newton + factors) > 0
    assert found.newton_steps >= 2 * found.steps_taken


def test_newtons_method_takes_few_steps_and_factors():
    """Forces predicted, bent steps, dashpots there will be and factors that go on serving: each saves some of these."""
    counts = []
    for omega, strain, more in (
        (1e-2, 1e-7, {}),
        (1e-2, 1e-7, {"stress": True}),
        (1e-4, 2e-2, {}),
        (1e-4, 1e-3, {"stress": True, "alpha": 0.5}),
    ):
        found = shaken(omega, strain, 16, 1, rotations=False, **more)
        counts.append((found.newton_steps, found.factorisations))
    motion = sheared(moving(1e6, 1e-3), 2e-2, 20)
    counts.append((motion.stages.iterations, motion.matrix.factorisations))
    now = np.array([(48, 2), (48, 2), (204, 189), (259, 120), (123, 20)])
    assert np.all(np.array(counts) <= 1.15 * now), counts


@pytest.mark.parametrize(("strain", "stress", "steps"), [(3e-2, False, (25, 33)), (1e-4, True, (27, 33))])
def test_a_cycle_loses_little_energy(runs, strain, stress, steps):
    """A step is cut where it loses more than 8 n⁻³ of π|G*|γ², so a cycle of n loses less than 8 n⁻²: about half.

    Steps of both runs are 24 if none is cut.
    """
    found = shaken.__wrapped__(1e-2, strain, 16, 1, stress=stress, rotations=False)
    for run in runs:
        one = run.finished[0]
        amplitude = strain / abs(one.G) if stress else strain
        lost = abs(one.consumed - one.moduli.work) / (np.pi * abs(one.G) * amplitude**2)
        assert 0.05 < lost * run.count**2 / 8.0 < 0.6
    assert steps[0] <= found.steps_taken <= steps[1]


def test_a_start_that_is_not_found_is_one_from_rest(monkeypatch):
    """Moving contacts do without the cycle of fixed ones; that alone is no failure. Other errors are told."""
    exact = shaken(0.1, 1e-6, 16, 3, rotations=False)
    solved = SteadyOscillation.solve

    def fail(self, point):
        raise ConvergenceError("not found")

    monkeypatch.setattr(SteadyOscillation, "solve", fail)
    found = shaken.__wrapped__(0.1, 1e-6, 16, 3, rotations=False)
    assert abs(found.G - exact.G) < found.error + exact.error and found.cycle_change != exact.cycle_change
    monkeypatch.setattr(SteadyOscillation, "solve", lambda self, point: solved(self, None))
    with pytest.raises(AttributeError):
        shaken.__wrapped__(0.1, 1e-6, 16, 3, rotations=False)


def moved(motion):
    return [np.copy(part) for part in (motion.offsets, motion.u, motion.gamma, motion.rate)]


def assert_alike(one, two, rtol=0.0, atol=0.0):
    for a, b in zip(one, two, strict=True):
        np.testing.assert_allclose(a, b, rtol=rtol, atol=atol)


def test_a_step_is_taken_back_whole():
    """Places, velocities, strain and rate; and the same step then leads to the same place."""
    motion = moving(1.0, 1e-3)
    imposed = [[Imposed(stress=1e-5 * n * part) for part in (STAGE, 1.0)] for n in (1, 2)]
    motion.advance(imposed[0])
    before = moved(motion)
    motion.advance(imposed[1])
    after = moved(motion)
    assert all(np.any(a != b) for a, b in zip(before, after, strict=True))
    motion.undo()
    assert_alike(before, moved(motion))
    motion.advance(imposed[1])
    assert_alike(after, moved(motion), 1e-6, 1e-12)


def test_steps_of_another_length_end_where_those_of_that_length_do():
    """The factor at hand is one of the old length; a new motion has none."""
    found = []
    for first in (1.0, 0.25):
        motion = moving(first, 1e-3)
        strained(motion, np.zeros(2), np.zeros(2))
        motion.set_length(0.25)
        strained(motion, 1e-3 * np.array([STAGE, 1.0]), np.full(2, 4e-3))
        found.append(moved(motion))
        assert motion.stages.iterations <= 8
    assert_alike(*found, 1e-6, 1e-11)


@pytest.mark.parametrize("stress", [True, False])
def test_what_to_do_about_forces_that_are_not_balanced(monkeypatch, stress):
    """Less stress, where one is imposed."""
    monkeypatch.setattr(time_step, "MAX_ITERATIONS", 1)
    imposed = [Imposed(stress=1e-3)] * 2 if stress else [Imposed(1e-2, 1e-2)] * 2
    with pytest.raises(ConvergenceError, match=r"after 1 Newton steps, .*\. Give more steps") as told:
        moving(1.0, 1e-3).advance(imposed)
    assert ("less stress" in str(told.value)) == stress


def test_disks_that_move_too_far_for_any_list():
    """A step so long is refused, and the motion goes on from where it was."""
    motion, fresh = moving(1.0, 1.0), moving(1.0, 1.0)
    before = moved(motion)
    with pytest.raises(ConvergenceError, match=r"disks move too far in one step\. Give more steps"):
        strained(motion, np.array([30.0, 100.0]), np.full(2, 100.0))
    assert_alike(before, moved(motion))
    for one in (motion, fresh):
        strained(one, 1e-4 * np.array([STAGE, 1.0]), np.full(2, 1e-4))
    assert motion.gamma == 1e-4 and motion.skin == fresh.skin
    np.testing.assert_allclose(motion.disks.positions, fresh.disks.positions, atol=1e-9)


@pytest.mark.parametrize("imposed", [{}, {"stress": True}])
def test_rounding_is_no_energy_that_is_lost(imposed):
    """The smallest amplitude there may be: no step is cut for the last digits of forces, and Newton's steps are few."""
    found = shaken(1e-2, 1e-9, 16, 1, rotations=False, **imposed)
    usual = shaken(1e-2, 1e-7, 16, 1, rotations=False, **imposed)
    assert found.steps_taken == 24 and found.newton_steps <= 1.3 * usual.newton_steps
    assert abs(found.G - usual.G) < 1e-4 * abs(usual.G)


@pytest.mark.parametrize("dimension", [2, 3])
def test_newton_converges_in_a_few_steps_to_rattlers_that_dashpots_hold(dimension):
    """A particle between two others: stiffness added to hold it would leave part of the residual at each step."""
    motion = moving(1.0, 1e-2, law=physics().law, disks=bridge(dimension))
    motion.advance([Imposed(1e-3 * at, 1e-3) for at in (STAGE, 1.0)])
    assert motion.stages.iterations <= 7
