"""Estimators of the claims on planted data: exponents of seeds, the logarithm of drag, identities."""

from dataclasses import replace

import numpy as np
import pytest

from jampetsc.io.ensemble import Ensemble
from papers.claims.drag import logarithmic_fit
from papers.claims.moduli import LIMIT, limit_form, limit_of
from papers.claims.shared import Row, exponent_of_seeds, identities, independent, paired, widened, widening
from papers.claims.verdicts import AGREES, IDENTITY, Estimate, number
from papers.reproduction import judged

P = np.array([1e-5, 1e-4, 1e-3, 1e-2])


def table(seeds, values):
    """Rows of all pressures for each of these seeds; values(seed, p) in the column y."""
    seed, p = (grid.ravel() for grid in np.meshgrid(seeds, P, indexing="ij"))
    columns = {"seed": seed, "pressure": p, "n": np.full(len(p), 32768), "state": np.full(len(p), "done")}
    return Ensemble("study", columns | {"y": values(seed, p)}, None)


def test_the_exponent_of_each_seed_is_free_of_its_offset():
    rows = table([1, 2, 3, 4], lambda seed, p: np.exp(seed) * p ** (-0.5 + 0.01 * (seed - 2.5)))
    found = exponent_of_seeds(*paired(rows, "y"))
    slopes = -0.5 + 0.01 * (np.arange(1, 5) - 2.5)
    student = 1.1974  # of four values, at 68 %
    assert found.value == pytest.approx(-0.5)
    assert found.statistical == pytest.approx(student * slopes.std(ddof=1) / 2, rel=1e-3)
    assert found.systematic == pytest.approx(0.0, abs=1e-12)
    bent = table([1, 2, 3, 4], lambda seed, p: seed * p**-0.5 * np.exp(3 * np.sqrt(p)))
    found = exponent_of_seeds(*paired(bent, "y"))
    assert found.systematic == pytest.approx(0.5 * (found.value + 0.5)) and found.value > -0.49


def test_packings_of_one_seed_count_once():
    rows = table([1, 1, 2, 2], lambda seed, p: np.arange(16.0) + 1)
    one = rows.where(pressure=1e-5)
    assert independent(one, "y") == pytest.approx([3.0, 11.0])
    assert widening(rows) == pytest.approx(np.sqrt(2))
    assert widened(Estimate(1.0, 0.1, 0.2), rows) == Estimate(1.0, pytest.approx(0.1 * np.sqrt(2)), 0.2)
    assert widened(None, rows) is None


@pytest.mark.parametrize("delta", [0.5, 0.53])
def test_the_logarithm_of_drag_is_found(delta):
    omega, static, a, b = np.geomspace(1e-4, 2e-2, 15), 3e-3, 0.06, 0.08
    G = np.sqrt(1j * omega * 0.3)
    for _ in range(200):
        G = np.sqrt(static**2 + (a + b * np.log(G / (1j * omega))) * (1j * omega) ** (2 * delta))
    constant, slope, found, rms = logarithmic_fit(omega, G, static, slope=b)
    assert (constant, slope, found) == pytest.approx((a, b, delta), rel=1e-5) and rms < 1e-6
    constant, slope, found, rms = logarithmic_fit(omega, G, static)
    assert found == 0.5 and ((rms < 1e-6) == (delta == 0.5))
    assert delta != 0.5 or (constant, slope) == pytest.approx((a, b), rel=1e-4)


def test_the_limit_of_the_ratio_is_that_without_its_viscous_end():
    series = []
    for p in (1e-5, 1e-4):
        omega = np.geomspace(1e-5, 1e-1, 41)
        middle = limit_form((omega / p, omega), 1.0, 0.7, 0.35, 0.9)
        series.append((p, omega, middle + np.array([-1e-3, 0.0, 1e-3])[:, None]))
    assert limit_of(series, *LIMIT, viscous=True)[0] == pytest.approx(1.0, abs=1e-3)
    assert abs(limit_of(series, *LIMIT)[0] - 1.0) > 0.05


def test_an_identity_agrees_but_is_no_evidence():
    row = Row("β = 0", "0.5", Estimate(0.5, 0.001), number(0.5), bears="eta0-beta0")
    (marked,) = identities([row], {"eta0-beta0": "η₀ = G₀τ₁"})
    assert judged(row) == (AGREES, "") and judged(marked) == (IDENTITY, "η₀ = G₀τ₁")
    assert judged(replace(marked, ours=Estimate(0.9, 0.001)))[0] == "differs"
