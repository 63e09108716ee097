"""Fixed contacts by steps in time, for exponents at which they stick: against the whole cycle, the sweep, dense
equations, slow shear and dry friction's limit, and themselves."""

import re
from functools import cache

import numpy as np
import pytest
from oscillations import mean_diameter, steady_oscillation, stepped_oscillation
from powerlaw import Friction, Motion, slow_moduli
from samples import SAMPLES, network_of, physics, published
from sweeps import Sweep

from jampetsc.errors import ConvergenceError
from jampetsc.oscillation import dashpots, halfcycles, stage
from jampetsc.oscillation.repeated import repeat_cycles
from jampetsc.oscillation.response import Drive
from jampetsc.petsc.session import current

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]  # a point is one rank's own
RHO0 = mean_diameter(published())


def frequency(alpha, X, amplitude):
    """ω at which damping forces are about X times elastic ones."""
    return float(np.exp((np.log(X) + (1.0 - alpha) * np.log(amplitude)) / alpha))


def oscillation(alpha, steps=8, sample="published", **options):
    return stepped_oscillation(SAMPLES[sample](), physics(exponent=alpha, **options), steps)


@cache
def stepped(alpha, omega, amplitude, stress=False, steps=8, **options):
    """The Stepped of the published packing, solved once."""
    return oscillation(alpha, steps, **options).solve(Drive(omega, amplitude, stress))


@pytest.mark.parametrize(("stress", "sample"), [(True, "k = 2.5"), (False, "published")])
def test_steps_in_time_are_the_whole_cycle(stress, sample):
    weights = {"normal": 0.5, "beta": 1.5}
    drive = Drive(frequency(0.5, 0.3, 1e-4), 1e-4, stress)
    whole = steady_oscillation(SAMPLES[sample](), physics(exponent=0.5, **weights), 32)
    exact = whole.solve(drive)
    found = stepped(0.5, drive.omega, 1e-4, stress, 16, sample=sample, **weights)
    assert abs(found.G - exact.G) <= found.error + exact.error
    assert found.error < 1e-2 * abs(exact.G) and abs(found.energy_balance) < 1e-2
    np.testing.assert_allclose(found.harmonics, exact.harmonics, atol=4e-3)
    assert found.work == pytest.approx(np.pi * found.G.imag * found.start.strain**2, rel=1e-9)
    assert found.work == pytest.approx(exact.work, rel=2.0 * found.error / found.G.imag)


@pytest.mark.parametrize(
    ("stress", "options"),
    [
        (True, {"prestress": False, "normal": 0.25, "beta": 3.0}),
        (False, {"tau1": 2.0, "rotations": False, "beta": 0.3}),
    ],
)
def test_linear_damping_is_the_sweep(stress, options):
    sweep = Sweep(published(), physics(**options), np.array([3e-2]), 1e-8, current().comm).solved()
    G, bound = sweep.G[0], sweep.bounds[0, 0]
    found = stepped(1.0, 3e-2, 1e-4, stress, 16, **options)
    assert abs(found.G - G) <= found.error + bound < 2e-2 * abs(G)


@pytest.mark.parametrize("stress", [True, False])
def test_forces_balance_as_dense_equations_have_it(stress):
    """At the end of the last step: velocities, turns and stress are those that another solver finds for its places."""
    alpha, X = 0.15, 0.1
    found = stepped(alpha, frequency(alpha, X, 1.0), 1.0, stress)
    law = physics(exponent=alpha, tau1=frequency(alpha, X, 1.0))
    dense = Motion(published(), law, 1.0, **({"stress": 1.0} if stress else {"strain": 1.0}))
    Q = np.zeros(len(dense.K))
    Q[-1] = found.start.gamma
    Q[:-1].reshape(published().n, -1)[:, :2] = found.start.displacement
    velocities, _ = dense.velocities(-0.5 * np.pi, Q)
    z = dense.Z @ velocities
    mine = np.append(found.start.velocity, found.start.rate)
    assert np.abs(dense.Z @ mine - z).max() < 2e-3 * np.abs(z).max()
    assert np.abs(z).max() > 10.0 * np.median(np.abs(z))  # some stick


def test_dry_friction_is_the_limit():
    """Half a cycle of Coulomb's law takes the steady oscillation of a tiny exponent to minus itself."""
    alpha, X, stress = 2e-3, 0.3, 1.0
    found = stepped(alpha, frequency(alpha, X, 1.0), stress, True, rotations=False)
    law = physics(rotations=False)
    dry = Friction(published(), law, stress, X * RHO0)
    Q = np.zeros(len(dry.K))
    Q[-1] = found.start.gamma
    Q[:-1] = found.start.displacement.ravel()
    left = Q + dry.half_cycle(Q, 8)
    assert left @ dry.K @ left < 1e-4 * (Q @ dry.K @ Q)
    assert abs(left[-1]) < 1e-2 * abs(Q[-1])
    assert found.G.imag > 0.3 * found.G.real


@pytest.mark.parametrize("alpha", [0.1, 0.02])
def test_slow_limit(alpha):
    """Contacts move as in slow shear, and G'' is what that dissipates: ∝ ω^α γ₀^(α−1)."""
    omega = frequency(alpha, 1e-3, 1.0)
    found = stepped(alpha, omega, 1.0, False, 16, rotations=False)
    network = network_of(published(), physics(rotations=False), current().comm)
    storage, loss = slow_moduli(network, published(), alpha, omega, 1.0)
    assert found.G.imag == pytest.approx(loss, rel=2e-2)
    assert found.G.real == pytest.approx(storage, rel=1e-2)


def test_stress_and_frequency_are_one_variable_at_any_power_of_ten():
    """Where only dashpots hold, G* ∝ σ^(1 − 1/α): 49 powers of ten for one of the stress."""
    alpha = 0.02
    runs = [stepped(alpha, frequency(alpha, 3.0, 1e-2), stress, True) for stress in (1e-2, 1e-3)]
    assert abs(runs[0].G) > 1e15 and abs(runs[0].G.real) < runs[0].error
    ratio = np.log10(runs[1].G.imag) - np.log10(runs[0].G.imag)
    assert ratio == pytest.approx(1.0 / alpha - 1.0, abs=1e-4)


def test_where_contacts_begin_to_be_linear_does_not_matter(monkeypatch):
    """What halving it would change is estimated, and is little."""
    words = (0.15, frequency(0.15, 0.1, 1.0), 1.0)
    usual = stepped(*words)
    assert usual.regularisation_effect < 1e-6 * abs(usual.G)
    monkeypatch.setattr(dashpots, "LINEAR_BELOW", 0.3)
    found = stepped.__wrapped__(*words)
    change = abs(found.G - usual.G)
    assert 0.3 < found.regularisation_effect / change < 3.0 and change > 1e-4 * abs(usual.G)
    assert found.error > usual.error + 0.5 * found.regularisation_effect


def test_moving_contacts_at_small_amplitudes():
    """The same steps, but of pairs in a list: the same answer, from which they begin."""
    alpha, strain = 0.1, 1e-7
    exact = stepped(alpha, frequency(alpha, 0.1, strain), strain, rotations=False)
    law = physics(exponent=alpha, rotations=False).law
    found = repeat_cycles(published(), law, exact.start, 8, 3)
    assert abs(found.G - exact.G) < 2e-4 * abs(exact.G) < found.error


@pytest.mark.parametrize("most", [1, 3])
def test_half_cycles_that_do_not_repeat_are_no_answer(monkeypatch, most):
    half, counts = halfcycles._Motion.half, []

    def counted(*words):
        counts.append(words[-1])
        return half(*words)

    monkeypatch.setattr(halfcycles._Motion, "half", counted)
    monkeypatch.setattr(halfcycles, "MOST_HALVES", most)
    with pytest.raises(ConvergenceError, match=f"half cycles do not repeat: after {most} of them G") as told:
        again()
    assert counts.count(4) == most  # with half of the steps, after the first trials with more
    assert 1.0 < float(str(told.value).split("uncertain by ")[1].split(" %")[0]) < 1000.0


EASY = (0.5, frequency(0.5, 0.3, 1.0), 1.0, True)  # any amplitude will do for fixed contacts


def easy(steps=8):
    return stepped(*EASY, steps, rotations=False)


def again():
    return stepped.__wrapped__(*EASY, 8, rotations=False)


def test_energy_balances_to_second_order():
    """What is dissipated is summed up by itself, and is work but for the steps."""
    coarse, fine = (easy(steps).energy_balance for steps in (8, 16))
    assert 0.01 < coarse < 0.05 and 3.0 < coarse / fine < 6.0


def test_error_covers_what_finer_steps_change():
    change = abs(easy(8).G - easy(16).G)
    assert change < easy(8).error < 20.0 * change and easy(16).error < 0.5 * easy(8).error


@pytest.mark.parametrize(
    ("module", "name", "value"),
    [(halfcycles, "LEFT", 0.3), (stage, "TOLERANCE", 1e-2)],
)
def test_what_is_left_is_in_the_error(monkeypatch, module, name, value):
    """Of half cycles not yet repeated, of forces that are not balanced."""
    usual = easy()
    monkeypatch.setattr(module, name, value)
    found = again()
    change = abs(found.G - usual.G)
    assert change > 1e-3 * abs(usual.G) and found.error > usual.error + change


def test_half_cycles_are_mixed():
    """Repeated as they come, or each by itself, they would take several times as many."""
    assert easy().half_cycles <= 14 and stepped(0.15, frequency(0.15, 0.1, 1.0), 1.0).half_cycles <= 14


@pytest.mark.parametrize(
    ("alpha", "stress", "off"), [(1.0, True, 5e-3), (1.0, False, 5e-3), (0.6, True, 0.03)]
)
def test_steps_in_time_begin_as_the_cycle_does(alpha, stress, off):
    """Where what is imposed grows through zero: moves, velocities and sizes are those of the cycle at once."""
    drive = Drive(frequency(alpha, 0.1, 1e-4), 1e-4, stress)
    whole = steady_oscillation(published(), physics(exponent=alpha, rotations=False), 64)
    exact = whole.start(drive)
    found = oscillation(alpha, 32, rotations=False).start(drive)
    for name in ("displacement", "velocity"):
        a, b = (getattr(start, name) - getattr(start, name).mean(axis=0) for start in (found, exact))
        assert np.abs(a - b).max() < 2.0 * off * np.abs(b).max() > 0.0, name
    for name in ("strain", "modulus", "rate"):
        assert getattr(found, name) == pytest.approx(getattr(exact, name), rel=off)
    if alpha == 1.0:  # of the equivalent linear damping
        assert found.speed == pytest.approx(exact.speed, rel=off)
    assert found.gamma == pytest.approx(exact.gamma, rel=2.0 * off, abs=1e-9 * exact.strain)
    assert (abs(exact.gamma) > 0.1 * exact.strain) == stress


@pytest.mark.parametrize("X", [1e6, 1e12])
def test_dashpots_alone(X):
    """Far above the crossover G* ∝ ω; unbalanced forces of the first trial are less than what counts as balanced."""
    slow, fast = (frequency(0.4, at, 1e-4) for at in (1e3, X))
    one, other = (stepped(0.4, omega, 1e-4, True, rotations=False) for omega in (slow, fast))
    assert other.G.imag / fast == pytest.approx(one.G.imag / slow, rel=1e-6)
    assert other.start.strain == pytest.approx(1e-4 / abs(other.G), rel=1e-9)


@pytest.mark.parametrize(("stress", "slower"), [(1e-8, 1.0), (1e-9, 1e-68)])  # moduli; work alone
def test_more_than_doubles_hold(stress, slower):
    """The message has strain and modulus as powers of ten, where G* ∝ σ^(1 − 1/α) and ∝ ω."""
    alpha = 0.02
    omega = frequency(alpha, 3.0, 1e-2)
    G = abs(stepped(alpha, omega, 1e-3, True).G) * slower
    with pytest.raises(ConvergenceError, match="more than doubles hold: choose omega nearer") as told:
        stepped(alpha, slower * omega, stress, True)
    strain, modulus = (int(word) for word in re.findall(r"of 1e(-?\d+)", str(told.value)))
    expected = np.log10(G) + (1.0 / alpha - 1.0) * np.log10(1e-3 / stress)
    assert modulus == pytest.approx(expected, abs=15.0)  # of the trial that is the first beyond
    assert strain == pytest.approx(np.log10(stress) - expected, abs=15.0)


@pytest.mark.parametrize(
    ("module", "name", "words", "message"),
    [
        # nothing smaller is tried instead
        (stage, "ITERATIONS", EASY, "not balanced after 1 of Newton's steps"),
        (halfcycles, "PILOTS", (0.1, frequency(0.1, 100.0, 1e-4), 1e-4, True), "no unit of velocity .* in 1"),
    ],
)
def test_trials_that_fail_or_do_not_suffice_are_told(monkeypatch, module, name, words, message):
    monkeypatch.setattr(module, name, 1)
    with pytest.raises(ConvergenceError, match=message):
        stepped.__wrapped__(*words)


def test_half_cycles_go_on_until_little_is_left(monkeypatch):
    """A hundred-thousandth of G*."""
    usual = easy()
    monkeypatch.setattr(halfcycles, "LEFT", 1e-8)
    exact = again()
    assert exact.half_cycles > usual.half_cycles
    assert abs(usual.G - exact.G) < 1e-5 * abs(exact.G)
