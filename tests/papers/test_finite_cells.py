"""The collapse of pressures in cells of several N, and the order of crystals, on data whose answer is known."""

import numpy as np
import pytest

from papers.claims.finite_cells import Cells, quotient
from papers.claims.verdicts import Estimate
from papers.tables.crystals import bond_order

N, RATE = (
    grid.ravel()
    for grid in np.meshgrid([64.0, 128.0, 256.0, 1024.0], [3e-4, 1e-4, 3e-5, 1e-5, 3e-6], indexing="ij")
)


def sheared(y, z, noise=0.0, seed=1):
    """The fit of p N^(y/2ν), a cubic of ln(γ̇ N^(z/2)) in its logarithm; y stands for y/ν."""
    u = np.log(RATE * N ** (z / 2)) / 10
    p = N ** (-y / 2) * np.exp(-2.0 + 2.0 * u + 3.0 * u**2 + 0.5 * u**3)
    return Cells.of(
        N, RATE, p * (1 + noise * np.random.default_rng(seed).standard_normal(len(N))), max(noise, 1e-6) * p
    )


@pytest.mark.parametrize(("y", "z"), [(1.1, 3.5), (1.5, 4.5), (0.9, 3.0)])
def test_both_exponents_of_a_collapse_are_found(y, z):
    found = sheared(y, z)
    assert 2 * found.stretch.value == pytest.approx(z, abs=1e-3)
    assert 2 * found.shrink.value == pytest.approx(y, abs=1e-3)
    assert found.ratio.value == pytest.approx(y / z, abs=1e-3)
    x, p, _ = found.collapsed
    np.testing.assert_allclose(found.curve(x), p, rtol=1e-4)
    fewer = found.less(found.n > 64)
    assert 2 * fewer.stretch.value == pytest.approx(z, abs=1e-3) and len(fewer.n) == 15


def test_errors_of_exponents_are_those_of_repeated_data():
    found = [sheared(1.1, 3.5, 0.003, seed) for seed in range(100)]
    for name, truth in (("stretch", 1.75), ("shrink", 0.55), ("ratio", 1.1 / 3.5)):
        pulls = [(getattr(one, name).value - truth) / getattr(one, name).statistical for one in found]
        assert np.std(pulls) == pytest.approx(1.0, abs=0.25) and abs(np.mean(pulls)) < 0.4, name
    assert np.mean([one.stretch.chi2 for one in found]) == pytest.approx(found[0].stretch.dof, rel=0.15)


def test_a_quotient_has_the_relative_errors_of_both():
    ratio = quotient(Estimate(3.3, 0.033, 0.066), Estimate(4.0, 0.04, 0.0))
    assert ratio.value == pytest.approx(0.825) and ratio.statistical == pytest.approx(0.825 * 0.01 * 2**0.5)
    assert ratio.systematic == pytest.approx(0.825 * 0.02)


def test_an_fcc_crystal_has_its_order_in_any_cell_and_a_random_one_none():
    base = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])
    places = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), -1).reshape(-1, 3)
    crystal, cell = (places[:, None] + base).reshape(-1, 3), 4.0 * np.eye(3)
    tilted = cell.copy()
    tilted[1, 0] = 4.0  # the same lattice of images
    for one in (cell, tilted):
        assert bond_order(crystal + 7.3, one) == pytest.approx(0.57452, abs=1e-5)
    assert bond_order(np.random.default_rng(1).random((500, 3)), np.eye(3)) < 0.05
