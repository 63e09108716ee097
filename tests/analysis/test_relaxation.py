"""Relaxation spectrum, G(t), creep: identities, Kramers–Kronig by quadrature, all modes of a packing."""

import numpy as np
import pytest
import samples
import scipy.linalg
from dense import Reference
from scipy.integrate import quad

from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.analysis.transient import retardation, transient
from jampetsc.errors import InputError

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib

OMEGA = np.geomspace(1e-12, 1e8, 121)


def spectrum(G0=0.02, eta_inf=0.4, modes=12, seed=0):
    """Rates over ten decades, weights over ten decades."""
    rng = np.random.default_rng(seed)
    rates = 10.0 ** rng.uniform(-7, 3, modes)
    return RelaxationSpectrum(G0, eta_inf, rates, 10.0 ** rng.uniform(-10, 0, modes))


def dense_spectrum(reference):
    """All modes of a small packing, disks turning as they like best: numpy alone."""
    K, B = np.asarray(reference.K, float), np.asarray(reference.B, float)
    free, volume = np.asarray(reference.free_moves(), float), float(reference.area)
    if reference.dofs == 3:
        turns = np.arange(2, len(K) - 1, 3)
        rest = np.setdiff1d(np.arange(len(K)), turns)
        turned = scipy.linalg.solve(B[np.ix_(turns, turns)], B[np.ix_(turns, rest)])
        B = B[np.ix_(rest, rest)] - B[np.ix_(rest, turns)] @ turned
        K, free = K[np.ix_(rest, rest)], free[rest[:-1]]
    Q = scipy.linalg.null_space(free.T)
    A, C = Q.T @ K[:-1, :-1] @ Q, Q.T @ B[:-1, :-1] @ Q
    load, drag = Q.T @ K[:-1, -1], Q.T @ B[:-1, -1]
    rates, modes = scipy.linalg.eigh(A, C)
    still = -scipy.linalg.solve(A, load, assume_a="pos")
    coupling = modes.T @ (drag + C @ still)
    fast = still - modes @ coupling
    eta_inf = (B[-1, -1] + 2 * drag @ fast + fast @ C @ fast) / volume
    return RelaxationSpectrum(
        (K[-1, -1] + load @ still) / volume, eta_inf, rates, rates * coupling**2 / volume
    )


def gauss(true, count):
    """The quadrature of `count` nodes for the measure Σ g δ(λ) of a spectrum, by Lanczos."""
    total = true.weights.sum()
    basis = [np.sqrt(true.weights / total)]
    alpha, beta = [], []
    for _ in range(count):
        v = true.rates * basis[-1]
        alpha.append(basis[-1] @ v)
        for _ in range(2):
            for q in basis:
                v = v - q * (q @ v)
        beta.append(np.linalg.norm(v))
        basis.append(v / beta[-1])
    rates, vectors = scipy.linalg.eigh_tridiagonal(alpha, beta[: count - 1])
    return RelaxationSpectrum(true.G0, true.eta_inf, rates, total * vectors[0] ** 2)


def test_the_modulus_at_any_frequency_that_a_double_holds():
    true = spectrum()
    np.testing.assert_allclose(true.modulus([1e-300, 1e300, -1e300]).real, [true.G0, true.G_inf, true.G_inf])
    loss = np.array([true.eta0 * 1e-300, true.eta_inf * 1e300, -true.eta_inf * 1e300])
    np.testing.assert_allclose(true.modulus([1e-300, 1e300, -1e300]).imag, loss)


def test_stress_relaxation_is_the_transform_of_the_modulus():
    """G* = G₀ + iω [η_∞ + ∫ (G(t) − G₀) exp(−iωt) dt], η_∞ from the Dirac part."""
    s = RelaxationSpectrum(0.1, 0.3, np.array([0.2, 1.5]), np.array([0.4, 0.6]))
    for omega in (0.05, 1.0, 8.0):
        part = [
            quad(lambda t: s.stress_relaxation(t) - s.G0, 0, 400, weight=w, wvar=omega, limit=400)[0]
            for w in ("cos", "sin")
        ]
        found = s.G0 + 1j * omega * (s.eta_inf + part[0] - 1j * part[1])
        assert found == pytest.approx(s.modulus(omega), rel=1e-7)
    assert s.stress_relaxation(1e-12) == pytest.approx(s.G_inf)
    assert s.stress_relaxation(1e3) == pytest.approx(s.G0)


def compliance(late):
    """J*(ω) of a retardation spectrum."""
    terms = late.compliances * late.rates / (late.rates + 1j * OMEGA[:, None])
    return late.J_inf + late.fluidity / (1j * OMEGA) + np.sum(terms, axis=1)


@pytest.mark.parametrize("G0", [0.02, 0.0, -0.02])
@pytest.mark.parametrize("eta_inf", [0.4, 1e-9, 0.0])
@pytest.mark.parametrize("seed", range(4))
def test_compliance_is_the_inverse_modulus(G0, eta_inf, seed):
    s = spectrum(G0, eta_inf, seed=seed)
    late = retardation(s)
    J, exact = compliance(late), 1.0 / s.modulus(OMEGA)
    np.testing.assert_allclose(J, exact, rtol=1e-12)
    if G0 >= 0:
        np.testing.assert_allclose(J.real, exact.real, rtol=1e-12)
        np.testing.assert_allclose(J.imag, exact.imag, rtol=1e-12)
        assert (late.compliances > 0).all() and (late.rates > 0).all() and late.growth_rate == 0
    else:
        assert (late.rates[1:] > 0).all() and (late.compliances[1:] > 0).all()
        assert late.rates[0] == -late.growth_rate < 0 and late.compliances[0] < 0
    poles, zeros = np.sort(s.rates), late.rates[late.rates > 0]
    assert np.all(np.searchsorted(poles, zeros) == np.arange(len(zeros)) + (G0 <= 0))


@pytest.mark.parametrize("G0", [0.1, 0.0, -0.1])
@pytest.mark.parametrize("eta_inf", [0.3, 0.0])
def test_creep_and_relaxation_convolve_to_time(G0, eta_inf):
    """∫₀ᵗ G(t − t') J(t') dt' = t, the Dirac part included: the two functions are inverse to each other."""
    s = RelaxationSpectrum(G0, eta_inf, np.array([0.2, 1.5]), np.array([0.4, 0.6]))
    late = retardation(s)
    for t in (0.1, 2.0, 30.0):
        value, _ = quad(lambda x, t=t: s.stress_relaxation(t - x) * late.creep(x), 0, t)
        assert value + s.eta_inf * late.creep(t) == pytest.approx(t, rel=1e-9)
    assert late.creep(1e5) == (np.inf if G0 < 0 else pytest.approx(1 / G0 if G0 else 1e5 / s.eta0, rel=1e-3))


def test_modes_without_weight_and_equal_rates():
    s = RelaxationSpectrum(0.1, 0.2, np.array([1.0, 2.0, 1.0, 5.0]), np.array([0.3, 0.0, 0.2, 0.4]))
    ordered = s.sorted()
    np.testing.assert_array_equal(ordered.rates, [5.0, 1.0])
    np.testing.assert_array_equal(ordered.weights, [0.4, 0.5])
    np.testing.assert_allclose(compliance(retardation(s)), 1 / s.modulus(OMEGA), rtol=1e-12)


@pytest.mark.parametrize("width", [0.02, 0.3, 1.0, 1.5])
def test_the_window_of_the_smoothed_spectrum(width):
    s = spectrum()
    tau = np.geomspace(1e-16, 1e20, 200001)
    H = s.smoothed(tau, width)
    assert (H >= 0).all()
    assert H.sum() * np.log(tau[1] / tau[0]) == pytest.approx(s.G_inf - s.G0, rel=1e-6)
    one = RelaxationSpectrum(0.0, 0.0, np.array([1.0]), np.array([1.0]))
    half = 10 ** (0.5 * width)
    np.testing.assert_allclose(
        one.smoothed([half, 1 / half], width), 0.5 * one.smoothed(1.0, width), rtol=1e-9
    )


def test_a_wide_window_is_the_loss_modulus_and_none_is_wider_than_a_decade_and_a_half():
    s = spectrum()
    width = 2 * np.arccosh(2.0) / np.log(10)  # ε = π/2
    tau = np.geomspace(1e-4, 1e8, 50)
    expected = 2 / np.pi * (s.modulus(1 / tau).imag - s.eta_inf / tau)
    np.testing.assert_allclose(s.smoothed(tau, width), expected, rtol=1e-6)
    for width in (0.0, 1.6, np.nan):
        with pytest.raises(InputError, match=r"width .*: must lie between 0.01 and 1.5 decades"):
            s.smoothed(1.0, width)


@pytest.mark.parametrize("law", [samples.physics(), samples.physics("stokes")], ids=str)
def test_nodes_against_all_modes_of_a_packing(law):
    """Few nodes know the true cumulative weight within that of each node, and H over a window."""
    reference = Reference(samples.published(), law)
    true = dense_spectrum(reference)
    for omega in (1e-4, 1e-2, 1.0):
        assert true.modulus(omega) == pytest.approx(reference.modulus(omega), rel=1e-8)
    few = gauss(true, 6).sorted()
    times, total = 1 / few.rates, np.cumsum(few.weights)
    below = np.array([true.weights[1 / true.rates < t].sum() for t in times])
    slack = 1e-9 * total[-1]
    assert (below <= total + slack).all() and (below >= total - few.weights - slack).all()
    times_between, between = few.between()
    np.testing.assert_array_equal(times_between, times)
    content = between * np.diff(np.log(times))
    assert (np.abs(content - np.diff(below)) <= 0.5 * (few.weights[1:] + few.weights[:-1]) + slack).all()
    width = min(2 * few.resolution, 1.5)
    tau = np.geomspace(times[0], times[-1], 60)
    near, exact = few.smoothed(tau, width), true.smoothed(tau, width)
    assert np.max(np.abs(near - exact)) < 0.05 * exact.max()


def test_times_and_their_ends():
    """Within what was swept, no farther than two decades beyond all modes, twenty to a decade, two at least."""
    s = spectrum(modes=5)
    found = transient(s, 1e-3, 1e2)
    assert found.time[[0, -1]] == pytest.approx([1e-2, 1e3]) and found.retardation.growth_rate == 0.0
    for grid in (found.time, found.tau):
        steps = np.diff(np.log10(grid))
        assert np.ptp(steps) < 1e-9 and 1 / 20 >= steps[0] * (1 - 1e-12) and steps[0] > 0.9 / 20
    assert len(transient(s, 1.0, 1.001).time) == 2
    one = RelaxationSpectrum(1e-6, 1e-3, np.array([1.0]), np.array([1.0]))  # creep ends a million times later
    found = transient(one, 1e-12, 1e12)
    late = found.retardation.rates
    assert late[0] < 1e-5 and late[-1] > 1e2
    np.testing.assert_allclose(found.time[[0, -1]], [1 / (100 * late[-1]), 100 / late[0]])


def test_the_smoothed_spectrum_ends_with_its_modes():
    """Half a window beyond them H has fallen to about half of what the last mode gives; further out nothing is new."""
    s = spectrum(modes=5)
    found, reach = transient(s, 1e-15, 1e12, window=0.5), 10.0**0.25
    ends = 1 / s.rates.max() / reach, reach / s.rates.min()
    np.testing.assert_allclose(found.tau[[0, -1]], ends, rtol=1e-12)
    assert found.time[0] < found.tau[0] and found.tau[-1] < found.time[-1]


def test_creep_that_grows_is_followed_for_five_of_its_times():
    found = transient(spectrum(G0=-0.02, modes=5), 1e-15, 1e12)
    late = found.retardation.growth_rate
    assert late > 0 and found.creep_time[-1] * late <= 5.0 < found.time[len(found.creep_time)] * late
    assert np.isfinite(found.J).all()


def test_windows_that_follow_from_the_gaps_between_modes():
    """A node of one per cent of all weight counts for the resolution; of less it does not."""
    for rates, window in (([1.0, 10**0.4], 0.8), ([1.0, 10**0.1], 0.25), ([1.0, 10.0**3], 1.5)):
        s = RelaxationSpectrum(0.1, 0.2, np.array(rates), np.ones(2))
        assert transient(s, 1e-3, 1e3).window == pytest.approx(window)
    for weight, resolution in ((0.99 / 99, 0.5), (1.05 / 99, 3.0)):
        s = RelaxationSpectrum(0.0, 0.1, np.array([1.0, 10**0.5, 10**3.5]), np.array([0.5, 0.5, weight]))
        assert s.resolution == pytest.approx(resolution)


@pytest.mark.parametrize(
    ("G0", "exact"),
    [(0.0, lambda t: t / 2), (-1.0, lambda t: np.expm1(t / 2)), (1.0, lambda t: -np.expm1(-t / 2))],
)
def test_creep_of_a_dashpot_with_and_without_its_spring(G0, exact):
    """G* = G₀ + 2iω has no pole, and J(t) = (1 − exp(−G₀t/2))/G₀."""
    bare = RelaxationSpectrum(G0, 2.0, np.empty(0), np.empty(0))
    late = retardation(bare)
    assert bare.resolution == 0.0 and bare.smoothed(1.0, 0.5) == 0.0
    t = np.array([0.1, 1.0, 10.0])
    np.testing.assert_allclose(late.creep(t), exact(t), rtol=1e-13)
    assert late.growth_rate == pytest.approx(max(0.0, -G0 / 2))


def test_only_what_holds_no_stress_at_once_is_refused():
    """G_∞ = 0 without a dashpot holds none; the least of either does."""
    rates, weights = np.array([1.0]), np.array([0.25])
    with pytest.raises(InputError, match="G_inf = 0 without viscosity"):
        retardation(RelaxationSpectrum(-0.25, 0.0, rates, weights))
    assert retardation(RelaxationSpectrum(-0.25, 1e-3, rates, weights)).growth_rate > 0
    assert retardation(RelaxationSpectrum(-0.2, 0.0, rates, weights)).J_inf == pytest.approx(20.0)


@pytest.mark.parametrize(("slowest", "fastest"), [(1e-9, 1e-6), (1e6, 1e9)])
def test_where_no_mode_was_swept_all_of_it_is_shown(slowest, fastest):
    """Times from 1/fastest to 1/slowest, which never change places, though all modes lie to one side."""
    s = RelaxationSpectrum(1.0, 1e-3, np.array([1.0]), np.array([1e-3]))
    found = transient(s, slowest, fastest, window=0.5)
    assert 1 / fastest <= found.time[0] * (1 + 1e-12) and found.time[-1] <= (1 + 1e-12) / slowest
    assert found.time[0] <= found.time[-1] and found.tau[0] <= found.tau[-1]
    assert np.isfinite(found.H).all() and len(found.tau) == len(found.time)
