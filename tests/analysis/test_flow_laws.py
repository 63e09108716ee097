"""Fits of flow curves: planted laws are found again, intervals hold them as often as they say, in any unit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from jampetsc.analysis.flow_laws import (
    CHI2_RISE,
    CONSISTENCY,
    FLOW_INDEX,
    FORMS,
    PARAMETERS,
    YIELD_STRESS,
    FlowCurve,
    FlowLaw,
    fit_flow_law,
    fits_below,
    least_squares_law,
)
from jampetsc.errors import InputError

RATES = np.geomspace(1e-5, 1e-2, 7)
PLANTED = {
    "herschel-bulkley": FlowLaw(1e-3, 0.03, 0.5),
    "bingham": FlowLaw(1e-3, 2.0, 1.0),
    "power-law": FlowLaw(0.0, 0.03, 0.5),
}


def curve_of(law, seed=0, noise=0.03, seeds=1, rates=RATES):
    """Stresses of a law with Gaussian errors; of several seeds errors of the mean that hardly vary."""
    rng, exact = np.random.default_rng(seed), law.stress(rates)
    stresses = exact * (1.0 + noise * rng.standard_normal((seeds, len(rates))))
    own = noise * exact / math.sqrt(seeds) * np.sqrt(rng.chisquare(40, len(rates)) / 40 if seeds > 1 else 1.0)
    return FlowCurve(rates, stresses.mean(axis=0), own, own, stresses if seeds > 1 else None)


@pytest.mark.parametrize("form", FORMS)
def test_an_exact_law_is_found_again(form):
    law = PLANTED[form]
    curve = replace(curve_of(law), stress=law.stress(RATES))
    fit = fit_flow_law(curve, FORMS[form])
    for name in PARAMETERS:
        assert getattr(fit.law, name) == pytest.approx(getattr(law, name), rel=1e-5)
    assert fit.chi2 < 1e-7 and fit.dof == len(RATES) - len(FORMS[form].free)
    assert fit.intervals.keys() == set(FORMS[form].free)
    assert all(low < getattr(law, name) < high for name, (low, high) in fit.intervals.items())


def test_the_fit_is_that_of_another_program():
    """`scipy.optimize.curve_fit`, which searches all three parameters at once."""
    from scipy.optimize import curve_fit

    curve = curve_of(PLANTED["herschel-bulkley"], seed=3)

    def stress(rate, yield_stress, consistency, flow_index):
        return yield_stress + consistency * rate**flow_index

    start = (1e-3, 0.03, 0.5)
    best, covariance = curve_fit(stress, RATES, curve.stress, start, curve.error, xtol=1e-12, ftol=1e-12)
    fit = fit_flow_law(curve, FORMS["herschel-bulkley"])
    assert np.allclose([getattr(fit.law, name) for name in PARAMETERS], best, rtol=1e-4)
    low, high = fit.intervals[YIELD_STRESS]
    linear = 2 * 1.96 * math.sqrt(covariance[0, 0] * fit.dof / fit.chi2)  # of errors that are not rescaled
    assert high - low == pytest.approx(linear, rel=0.15)


@pytest.mark.parametrize("form", FORMS)
def test_chi2_at_the_ends_of_an_interval(form):
    """By a search over the other parameters from the planted law."""
    from scipy.optimize import minimize

    law, shape = PLANTED[form], FORMS[form]
    curve = curve_of(law, seed=1)
    fit = fit_flow_law(curve, shape)
    for name, ends in fit.intervals.items():
        others = [other for other in shape.free if other != name]
        for end in ends:

            def chi2(scales, name=name, end=end, others=others):
                values = {
                    other: getattr(fit.law, other) * scale
                    for other, scale in zip(others, scales, strict=True)
                }
                trial = replace(fit.law, **values, **{name: end})
                return np.sum(((curve.stress - trial.stress(RATES)) / curve.error) ** 2)

            found = minimize(
                chi2, np.ones(len(others)), method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-7}
            )
            assert found.fun - fit.chi2 == pytest.approx(CHI2_RISE, abs=1e-3)


@pytest.mark.parametrize(
    ("form", "seeds", "count"),
    [("herschel-bulkley", 1, 30), ("bingham", 1, 60), ("herschel-bulkley", 5, 100)],
)
def test_intervals_hold_what_was_planted(form, seeds, count):
    """95 % of them; by chance fewer than 85 % in one of a thousand tests of 100."""
    law, held = PLANTED[form], dict.fromkeys(FORMS[form].free, 0)
    for seed in range(count):
        fit = fit_flow_law(curve_of(law, seed, seeds=seeds), FORMS[form])
        for name, (low, high) in fit.intervals.items():
            held[name] += low <= getattr(law, name) <= high
    assert all(0.84 * count <= times for times in held.values()), held
    assert min(held.values()) < count or count < 100  # nor are they too wide


def test_units_and_order_do_not_matter():
    stress_unit, rate_unit = 2.5, 8.0
    for seeds in (1, 4):
        curve = curve_of(PLANTED["herschel-bulkley"], seed=2, seeds=seeds)
        order = np.random.default_rng(1).permutation(len(RATES))
        told = FlowCurve(
            rate_unit * curve.rate[order],
            *(stress_unit * values[order] for values in (curve.stress, curve.error, curve.own_error)),
            None if seeds == 1 else stress_unit * curve.seeds[::-1, order],
        )
        fit, other = (fit_flow_law(one, FORMS["herschel-bulkley"]) for one in (curve, told))
        factor = {YIELD_STRESS: stress_unit, FLOW_INDEX: 1.0}
        for name, scale in factor.items():
            assert getattr(other.law, name) == pytest.approx(scale * getattr(fit.law, name), rel=1e-5)
            assert np.allclose(other.intervals[name], scale * np.array(fit.intervals[name]), rtol=1e-3)
        consistency = stress_unit * fit.law.consistency / rate_unit**fit.law.flow_index
        assert other.law.consistency == pytest.approx(consistency, rel=1e-5)
        assert other.chi2 == pytest.approx(fit.chi2, rel=1e-6)


def test_no_yield_stress_where_there_is_none():
    """Its interval has 0, also where lower and lower n fit as well."""
    for noise in (0.02, 0.1):
        fit = fit_flow_law(curve_of(PLANTED["power-law"], 4, noise), FORMS["herschel-bulkley"])
        assert fit.intervals[YIELD_STRESS][0] < 0 < fit.intervals[YIELD_STRESS][1]
        assert not fit.resolves_yield_stress
    assert fit_flow_law(
        curve_of(PLANTED["herschel-bulkley"]), FORMS["herschel-bulkley"]
    ).resolves_yield_stress
    assert not fit_flow_law(curve_of(PLANTED["power-law"]), FORMS["power-law"]).resolves_yield_stress


def test_a_flat_curve_does_not_determine_n():
    fit = fit_flow_law(replace(curve_of(FlowLaw(1.0, 0.0, 1.0), 5, 0.01)), FORMS["herschel-bulkley"])
    assert fit.intervals[FLOW_INDEX] == (-math.inf, math.inf)
    falling = replace(curve_of(FlowLaw(1.0, -1.0, 0.5)), seeds=np.ones((3, len(RATES))))
    assert fit_flow_law(falling, FORMS["bingham"]).intervals[CONSISTENCY] == (-math.inf, math.inf)


def test_rates_are_left_out_from_above():
    """A law with another branch at high rates: χ² shows it, and the fits below the cut have the planted σ_y."""
    law = PLANTED["herschel-bulkley"]
    curve = replace(curve_of(law), stress=law.stress(RATES) + 30.0 * RATES**1.5)
    fits = fits_below(curve, FORMS["herschel-bulkley"])
    assert [cut for cut, _ in fits] == list(RATES[:2:-1])
    assert fits[0][1].probability < 1e-3 < fits[-1][1].probability
    assert abs(fits[0][1].law.yield_stress / 1e-3 - 1) > 5 * abs(fits[-1][1].law.yield_stress / 1e-3 - 1)
    assert least_squares_law(curve, FORMS["bingham"], flow_index=0.5)[0].flow_index == 0.5


@pytest.mark.parametrize(("form", "least"), [("herschel-bulkley", 4), ("bingham", 3), ("power-law", 3)])
def test_too_few_rates(form, least):
    curve = curve_of(PLANTED[form]).below(RATES[least - 2])
    with pytest.raises(
        InputError, match=rf"^{least - 1} rates: too few for form {form} \(at least {least}\)\. Give"
    ):
        fit_flow_law(curve, FORMS[form])
    assert fit_flow_law(curve_of(PLANTED[form]).below(RATES[least - 1]), FORMS[form]).dof == 1
