"""Finite-size scaling of η₀: fits to data of a known law, and pictures of them and of local exponents."""

import numpy as np
import pytest
from picture_contents import bars, figure_of, lines, require_inside, told
from samples import stored

from jampetsc.analysis.statistics import half_width, log_median, median_interval
from jampetsc.errors import InputError
from jampetsc.plots.curves import Curve
from jampetsc.plots.exponent_plots import plot_exponents
from jampetsc.plots.page import Page
from jampetsc.plots.quasistatic_plots import draw_finite_size, plot_finite_size
from jampetsc.plots.style import drawn_in
from papers.claims.sizes import size_scaling

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib
SIZES, PRESSURES = np.array([64, 256, 1024]), np.array([1e-6, 1e-5, 1e-4, 1e-3])
UNIT = 2.0 * 0.5  # of viscosities in the files below: k = 2, τ₁ = ½


# Fits


def test_the_power_of_size_and_its_error():
    """ln η₀ = a ln N + a cubic in ln pN² is fitted exactly; with noise a is off as its error says."""
    n, p = (grid.ravel() for grid in np.meshgrid(SIZES, PRESSURES))
    x = np.log(p * n**2)
    eta0 = n**1.09 * np.exp(0.1 - 0.2 * x - 0.01 * x**2 + 1e-3 * x**3)
    fit = size_scaling(n, p, eta0, 0.05 * eta0)
    assert fit.power == pytest.approx(1.09, abs=1e-9) and fit.chi2 < 1e-12 and fit.dof == 12 - 7
    draw, off = np.random.default_rng(1), []
    for _ in range(200):
        noisy = eta0 * np.exp(0.05 * draw.standard_normal(12))
        off.append(size_scaling(n, p, noisy, 0.05 * eta0).power - 1.09)
    assert np.std(off) == pytest.approx(fit.error, rel=0.15)
    scattered = size_scaling(n, p, noisy, 1e-4 * eta0)
    inflated = scattered.error * np.sqrt(scattered.chi2 / scattered.dof)  # as verdicts take it
    assert inflated == pytest.approx(fit.error, rel=0.8)


def test_the_logarithm_of_a_median_has_half_the_interval_as_its_error():
    values = np.array([1.0, 2.0, 3.0, 4.0, 400.0])
    low, high = median_interval(values)
    assert log_median(values) == pytest.approx((np.log(3.0), 0.5 * np.log(high / low)))
    below = np.array([-5.0, -1.0, 2.0, 3.0, 4.0])
    low, high = median_interval(below)
    assert low < 0 and log_median(below) == pytest.approx((np.log(2.0), 0.5 * (high - low) / 2.0))
    assert np.isnan(log_median(-values)).all()


# Pictures


def file(n, p, eta0, law="contact", fluid=0.0, stressed=2.0, G0=1.0):
    """A quasistatic file of a packing: η₀ in kτ₁ without pre-stress, `stressed` times as much with it."""
    facts = {"k": 2.0, "tau1": 0.5, "pressure": 2.0 * p, "particle_count": int(n), "law": law}
    facts |= {"prestress": True, "eta0_fluid": fluid * UNIT}
    for bare, times in (("", stressed), ("no_prestress_", 1.0)):
        facts |= {f"{bare}eta0": times * eta0 * UNIT, f"{bare}G0": G0, f"{bare}omega_star": 1.0}
        for name, exponent in (("normal", 0.25), ("transverse", -0.25), ("nonaffine", -0.25)):
            facts[f"{bare}{name}_median"] = p**exponent
    return stored(None, "quasistatic", {}, **facts)


def files(of, **settings):
    """Three packings of each N and p, η₀ = of(N, p) and 10 % less and more."""
    return [file(n, p, c * of(n, p), **settings) for n in SIZES for p in PRESSURES for c in (0.9, 1.0, 1.1)]


def test_viscosities_of_all_sizes_are_one_curve_of_the_pressure_times_n_squared():
    fig = figure_of(plot_finite_size, files(lambda n, p: n / np.sqrt(1 + p * n**2)))
    require_inside(fig)
    collapsed, by_size = fig.axes
    assert (collapsed.get_xlabel(), collapsed.get_ylabel()) == ("$N^2p/k$", r"$\eta_0\,/\,N$ $[k\tau_1]$")
    assert by_size.get_ylabel() == r"$(p/k)^{1/2}\,\eta_0$ $[k\tau_1]$" and by_size.get_xlabel() == "$N$"
    drawn = lines(collapsed, len(PRESSURES))
    assert len(drawn) == 2 * len(SIZES)
    for number, (x, y, dash, face) in enumerate(drawn):
        stressed = number % 2 == 1  # open and dashed, as BT's text has it
        np.testing.assert_allclose(x, PRESSURES * SIZES[number // 2] ** 2, rtol=1e-9)
        np.testing.assert_allclose(y, (2.0 if stressed else 1.0) / np.sqrt(1 + x), rtol=1e-9)
        assert (dash == "-") != stressed and (face == "white") == stressed
    (guide,) = lines(collapsed, 2)
    assert np.diff(np.log(guide[1])) / np.diff(np.log(guide[0])) == pytest.approx(-0.5)
    assert guide[1][-1] == pytest.approx(guide[0][-1] ** -0.5, rel=0.01)  # where all that is large lies
    for x, y, low, high in bars(by_size):
        np.testing.assert_allclose(y, 1.0, rtol=0.02)
        error = half_width(2) * 0.1 / np.sqrt(3.0)
        np.testing.assert_allclose([low, high], np.full((2, len(x)), error), rtol=0.1)
    assert told(collapsed)[-1] == "slope $-1/2$"


def test_the_fluid_is_in_one_panel_and_out_of_the_next():
    def drag(n, p):
        return p**-0.5 * (0.1 + 0.04 * np.log(n))

    with_fluid = files(lambda n, p: drag(n, p) + 3.0, law="stokes", fluid=3.0)
    for one in with_fluid:  # 10 % more or less of the drag, not of the fluid
        one.attributes["no_prestress_eta0"] = 3.0 + (one.attributes["no_prestress_eta0"] - 3.0)
    with drawn_in():
        page = Page()
        draw_finite_size(with_fluid, page, 1.09)
        page.finish()
    fig = page.figure
    assert [ax.get_ylabel() for ax in fig.axes] == [
        r"$\eta_0\,/\,N^{1.09}$ $[k\tau_1]$",
        r"$(\eta_0-\eta_F)\,/\,N^{1.09}$ $[k\tau_1]$",
        r"$(p/k)^{1/2}\,(\eta_0-\eta_F)$ $[k\tau_1]$",
    ]
    (whole, *_), (less, *_) = (lines(ax, len(PRESSURES)) for ax in fig.axes[:2])
    np.testing.assert_allclose((whole[1] - less[1]) * SIZES[0] ** 1.09, 3.0, rtol=1e-9)
    np.testing.assert_allclose(less[1] * SIZES[0] ** 1.09, drag(SIZES[0], PRESSURES), rtol=1e-9)
    with pytest.raises(InputError, match=r"quasistatic in memory: law contact, .* has stokes"):
        plot_finite_size([*with_fluid, file(64, 1e-3, 1.0)])


def test_a_line_in_the_logarithm_of_size_where_there_are_three():
    """A fourth one, twice as high, has an error that leaves the line where it is."""
    p, shares = 1e-3, {256: (0.99, 1.01), 1024: (0.99, 1.01), 4096: (0.99, 1.01), 16384: (1.0, 3.0)}
    pairs = [(n, p**-0.5 * (0.1 + 0.04 * np.log(n)) * c) for n, some in shares.items() for c in some]
    some = [file(n, p, eta0, law="stokes") for n, eta0 in pairs]
    for count, rtol in ((6, 1e-9), (8, 1e-2)):
        ax = figure_of(plot_finite_size, some[:count]).axes[-1]
        x, y = ax.containers[0].lines[0].get_data()
        np.testing.assert_allclose(y[:3], 0.1 + 0.04 * np.log(x[:3]), rtol=1e-9)
        np.testing.assert_allclose(lines(ax, count // 2)[-1][1][:3], y[:3], rtol=rtol)
    assert not lines(figure_of(plot_finite_size, some[:4]).axes[-1], 2)[3:]  # of two sizes bars alone


def curve(p, G0, seed=0):
    omega = np.geomspace(1e-8, 1e4, 121)
    attributes = {"law": "contact", "beta": 1.0, "packing_sha256": str(seed)}
    return Curve("s.h5", omega, np.sqrt(G0**2 + 1j * omega), np.zeros((2, 121)), p, attributes)


def test_local_exponents_of_a_square_root_of_the_frequency():
    """G*² = G₀² + iω: ½ in both estimators from ω* = 2G₀² on, whatever G₀ a packing has; G''/G' rises to 1."""
    fig = figure_of(plot_exponents, [curve(1e-4, G0, seed) for seed, G0 in enumerate((0.01, 0.012))])
    require_inside(fig)
    assert len(fig.axes) == 4 and fig.axes[2].get_xlabel() == r"$\omega\tau_1$"
    slope, phase, ratio, loss = (next(one for one in lines(ax) if len(one[0]) > 2) for ax in fig.axes)
    star = (0.01 + 0.012) / (0.5 / 0.01 + 0.5 / 0.012)
    for x, y, *_ in (slope, phase):
        assert star < x[0] < 1.3 * star
        np.testing.assert_allclose(y, 0.5, atol=1e-3)
    assert ratio[1][-1] == pytest.approx(1.0, abs=1e-6) and (np.diff(ratio[1]) > 0).all()
    assert len(loss[0]) == 121 and loss[1][[0, -1]] == pytest.approx([1.0, 0.5], abs=1e-3)
    other = curve(1e-4, 0.01, 1)
    other.omega[:] *= 2
    with pytest.raises(InputError, match=r"s\.h5: not the frequencies of s\.h5"):
        plot_exponents([curve(1e-4, 0.01), other])


def test_local_exponents_in_the_pressure_and_their_limits():
    """G₀ ~ p^½, negative for one of three packings, which counts in the median; η₀ ~ p^(−½), with pre-stress p^(−¼)."""
    some = [
        file(64, p, p**-0.5, stressed=p**0.25, G0=c * p**0.5) for p in PRESSURES for c in (-0.5, 1.0, 2.0)
    ]
    fig = figure_of(plot_exponents, some)
    require_inside(fig)
    assert [ax.get_lines()[0].get_ydata()[0] for ax in fig.axes] == [0.5, -0.5, 1.0, 0.25, -0.25, -0.25]
    medians = [(quarter, quarter) for quarter in (0.25, -0.25, -0.25)]
    for ax, wanted in zip(fig.axes, ((0.5, 0.5), (-0.5, -0.25), (0.0, 0.0), *medians), strict=True):
        for (x, y, low, high), slope in zip(bars(ax), wanted, strict=True):
            np.testing.assert_allclose(x, np.sqrt(PRESSURES[1:] * PRESSURES[:-1]))
            np.testing.assert_allclose(y, slope, atol=1e-9)
            assert (low == high).all() or np.allclose(low, high)
    stable = [one for one in some if one.attributes["G0"] > 0]
    for ax in (*figure_of(plot_exponents, stable[::2]).axes, *figure_of(plot_exponents, stable).axes):
        assert [len(container.lines[0].get_ydata()) for container in ax.containers] == [3, 3]
        assert not any(container.lines[2] for container in ax.containers)  # of one packing a point or two
    with pytest.raises(InputError, match=r"quasistatic in memory: one pressure alone"):
        plot_exponents(some[:3])
