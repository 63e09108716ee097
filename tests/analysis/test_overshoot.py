"""The peak of a start: an exact one is found, errors hold it as often as they say, and noise is not taken for one."""

import math

import numpy as np
import pytest

from jampetsc.analysis.overshoot import find_peak

ROW = 0.005
STRAIN = ROW * (np.arange(200) + 0.5)
MEMORY = 0.05  # correlation strain of the noise


def start_of(strain, height):
    """A rise to 1 with an overshoot that decays more slowly than it grows."""
    return 1.0 - np.exp(-strain / 0.05) + height * strain / 0.1 * np.exp(1.0 - strain / 0.1)


def exact_peak(height):
    """(strain, stress) of its peak."""
    fine = np.linspace(0.0, 1.0, 100_001)
    values = start_of(fine, height)
    return fine[np.argmax(values)], values.max()


def noisy_starts(seed, height, noise, seeds):
    """(starts (S, T), steady stresses (S,)) with noise of exponential memory, relative to the stress."""
    rng, decay = np.random.default_rng(seed), math.exp(-ROW / MEMORY)
    x = rng.standard_normal((seeds, len(STRAIN)))
    for row in range(1, len(STRAIN)):
        x[:, row] = decay * x[:, row - 1] + math.sqrt(1.0 - decay**2) * x[:, row]
    steady = 1.0 + noise * math.sqrt(2 * MEMORY / 5) * rng.standard_normal(seeds)
    return start_of(STRAIN, height) * (1.0 + noise * x), steady


def test_an_exact_peak():
    """In any unit; what the window and the polynomial leave is in the errors."""
    strain, stress = exact_peak(0.3)
    for unit in (1.0, 2.5e-3):
        rows = unit * np.array([start_of(STRAIN, 0.3)] * 2)
        peak = find_peak(STRAIN, rows, [unit] * 2)
        assert peak.stress == pytest.approx(unit * stress, rel=2e-3)
        assert abs(peak.stress - unit * stress) < 3 * peak.stress_error < 0.01 * unit
        assert abs(peak.strain - strain) < min(0.006, 3 * peak.strain_error)
        assert peak.overshoot == pytest.approx(peak.stress - unit) and peak.is_resolved


def test_one_seed_has_no_errors():
    peak = find_peak(STRAIN, start_of(STRAIN, 0.3)[None], [1.0])
    assert np.isnan([peak.strain_error, peak.stress_error, peak.overshoot_error]).all()
    assert peak.stress == pytest.approx(exact_peak(0.3)[1], rel=2e-3) and not peak.is_resolved


@pytest.mark.parametrize(
    ("height", "noise", "seeds"), [(0.3, 0.1, 5), (0.18, 0.1, 5), (0.3, 0.03, 20), (0.8, 0.1, 10)]
)
def test_errors_hold_the_peak(height, noise, seeds):
    """68 % of them are to. The largest value of the mean, with its jackknife error, is held in 33 to 60 %."""
    strain, stress = exact_peak(height)
    held = np.zeros(2)
    for seed in range(60):
        peak = find_peak(STRAIN, *noisy_starts(seed, height, noise, seeds))
        held += abs(peak.stress - stress) <= peak.stress_error, abs(peak.strain - strain) <= peak.strain_error
    assert (held >= 0.5 * 60).all() and (held <= 0.88 * 60).all(), held / 60


@pytest.mark.parametrize("seeds", [3, 10])
def test_noise_is_no_overshoot(seeds):
    peaks = [find_peak(STRAIN, *noisy_starts(seed, 0.0, 0.1, seeds)) for seed in range(40)]
    assert sum(peak.is_resolved for peak in peaks) <= 6


def test_a_peak_at_the_end_of_the_rows():
    rows = np.array([STRAIN, 1.1 * STRAIN])
    peak = find_peak(STRAIN, rows, [2.0, 2.0])
    assert peak.strain == pytest.approx(STRAIN[-1]) and not peak.is_resolved and peak.overshoot < 0
