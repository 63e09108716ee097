"""The fit of pressures above φ_J on data whose answer is known."""

import numpy as np
import pytest

from papers.claims.above import Rise, with_changes
from papers.claims.verdicts import difference

PHI = np.array([0.846, 0.848, 0.85, 0.855, 0.86, 0.87, 0.88])


def risen(y, phi_J, noise=0.0, A=0.4, seed=1):
    p = A * (PHI - phi_J) ** y * (1 + noise * np.random.default_rng(seed).standard_normal(len(PHI)))
    return Rise.of(PHI, p, np.full(len(PHI), max(noise, 1e-6)) * p)


@pytest.mark.parametrize(("y", "phi_J"), [(1.0, 0.8433), (1.1, 0.8421), (1.5, 0.8455)])
def test_a_power_is_found(y, phi_J):
    rise = risen(y, phi_J)
    assert rise.y.value == pytest.approx(y, abs=1e-6) and rise.phi_J.value == pytest.approx(phi_J, abs=1e-8)
    assert pytest.approx(0.4, rel=1e-5) == rise.A


def test_errors_are_those_of_repeated_data():
    found = [risen(1.1, 0.843, 0.01, seed=seed) for seed in range(200)]
    for name, truth in (("y", 1.1), ("phi_J", 0.843)):
        pulls = [(getattr(one, name).value - truth) / getattr(one, name).statistical for one in found]
        assert np.std(pulls) == pytest.approx(1.0, abs=0.15) and abs(np.mean(pulls)) < 0.3
    assert np.mean([one.y.chi2 for one in found]) == pytest.approx(len(PHI) - 3, rel=0.15)


def test_a_form_that_does_not_hold_at_the_ends_is_seen_in_the_systematic_error():
    rise, bent = risen(1.0, 0.843), PHI - 0.843
    p = 0.4 * bent * (1 + 3 * bent**0.5)
    other = Rise.of(PHI, p, 1e-3 * p)
    y, phi_J = with_changes(other, [])
    assert y.systematic > 0.005 and phi_J.systematic > 0 and with_changes(rise, [])[0].systematic < 1e-6
    y, _ = with_changes(rise, [risen(1.2, 0.843)])
    assert y.systematic == pytest.approx(0.1, rel=1e-3)
    change = difference(y, rise.y)
    assert change.value == 0.0 and change.systematic == y.systematic
