"""ω* against p and its exponent, from files and sweeps of known ω*."""

import numpy as np
import pytest
from picture_contents import bars, figure_of, held, lines, told
from samples import stored
from test_floppy_plots import quasistatic_of

from jampetsc.analysis.statistics import median_interval
from jampetsc.errors import InputError
from jampetsc.plots.crossover_plots import plot_crossover

P = np.array([1e-4, 1e-3, 1e-2])
FACTORS = np.array([1.0, 1.5, 20.0])


def slow(pressure, omega_star, bare=None, k=2.0, tau1=4.0, **more):
    """A quasistatic file in units of k and τ₁; ω* in 1/τ₁, with pre-stress and without."""
    more |= {} if bare is None else {"no_prestress_omega_star": bare / tau1}
    stressed = quasistatic_of([1, 1, 1], 64, pressure, k, bare=None if bare is None else [1, 1, 1])
    return held({}, stressed.attributes | {"omega_star": omega_star / tau1, "tau1": tau1} | more, "q.h5")


def test_medians_of_files_follow_a_power_law_with_its_exponent():
    """ω*τ₁ = 3 p^1.1 without pre-stress, and 1/10 of it with: of three files each, one far off."""
    files = [slow(p, 0.3 * c * p**1.1, 3.0 * c * p**1.1) for p in P for c in FACTORS]
    page = plot_crossover.draw(files)
    assert "p^1.100 ± 0.000 (N = 64, no pre-stress); p^1.100 ± 0.000 (N = 64, pre-stress)" in page.text
    ax = figure_of(plot_crossover, files).axes[0]
    low, high = median_interval(FACTORS)
    for (x, y, below, above), factor in zip(bars(ax), (3.0, 0.3), strict=True):
        unit = factor * P**1.1
        np.testing.assert_allclose((x, y), (P, 1.5 * unit))
        np.testing.assert_allclose((y - below, y + above), np.outer([low, high], unit))
    fits = [(x, y, dash) for x, y, dash, _ in lines(ax, 2)]
    for (x, y, dash), factor, drawn in zip(fits, (3.0, 0.3), ("-", "--"), strict=True):
        np.testing.assert_allclose((x, y), (P[[0, -1]], 1.5 * factor * P[[0, -1]] ** 1.1))
        assert dash == drawn
    slope = np.diff(np.log(lines(ax, 3)[-1][:2])[:, [0, -1]]).ravel()
    assert slope[1] / slope[0] == pytest.approx(1.0)
    power = r"$p^{1.100\pm0.000}$"
    assert told(ax) == ["$N=64$", "no pre-stress", "pre-stress", power, power, "slope 1"]


@pytest.mark.parametrize("dimension", [2, 3])
def test_sweeps_give_the_same_as_quasistatic_files(dimension):
    """G* = G₀ + iωη₀ at each pressure, k = 2 and τ₁ = 4; without pre-stress and with it in files of their own."""
    omega = np.geomspace(1e-8, 1.0, 9)
    facts = {"k": 2.0, "tau1": 4.0, "dimension": dimension, "particle_count": 64, "law": "stokes"}
    sweeps = [
        stored(None, "sweep", {"omega": omega, "G": 2.0 * (factor * p + 4.0j * omega), "error_bound": omega},
               **facts, pressure=2.0 * p, prestress=prestress)
        for p in P for prestress, factor in ((True, 0.5), (False, 3.0))
    ]  # fmt: skip
    page = plot_crossover.draw(sweeps)
    assert "of 6 sweeps: p^1.000 ± 0.000 (N = 64, no pre-stress); p^1.000 ± 0.000" in page.text
    (ax,) = page.axes
    assert ax.get_xlabel() == {2: "$p/k$", 3: r"$p\,d/k$"}[dimension]
    for (x, y, *_), factor in zip(lines(ax, 3)[:2], (3.0, 0.5), strict=True):
        np.testing.assert_allclose((x, y), (P, factor * P))
    (ax,) = plot_crossover.draw([sweep for sweep in sweeps if sweep.attributes["prestress"]]).axes
    assert "no pre-stress" not in told(ax) and "pre-stress" in told(ax)
    near = np.array([1.0, 2.0])
    arrays = {"omega": near, "G": 1.0 + 1j * near**0.5, "error_bound": near}
    short = stored(None, "sweep", arrays, **facts, pressure=1e-3)
    with pytest.raises(InputError, match="still change at the lowest frequency"):
        plot_crossover.draw([short])


def test_files_whose_omega_star_is_negative_count_and_are_told():
    two = [slow(p, value) for p in P[:2] for value in (-1.0, 2.0 * p, 3.0 * p)]
    page = plot_crossover.draw(two)
    assert "omega* < 0 in 2 of them" in page.text and "p^" not in page.text
    (ax,) = page.axes
    np.testing.assert_allclose(lines(ax, 2)[0][:2], (P[:2], 2.0 * P[:2]))
    with pytest.raises(InputError, match=r"q\.h5: omega\* is not positive at any pressure"):
        plot_crossover.draw([slow(1e-3, -1.0)])
    with pytest.raises(InputError, match=r"dimension 3, but .* has 2\. Draw files of one dimension"):
        plot_crossover.draw([*two, slow(1e-2, 1.0, dimension=3)])
