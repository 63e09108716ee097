"""Scaling collapse: planted exponents are found again, wrong forms told by χ², data that say nothing refused."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from picture_contents import bars, figure_of, held, lines
from samples import stored

import jampetsc
from jampetsc import main as cli
from jampetsc.analysis import collapse_fit, jammed_samples
from jampetsc.analysis.collapse_fit import Estimate, drift, estimate, find_minima
from jampetsc.analysis.correlated_series import Average, mean_of_averages
from jampetsc.analysis.scaling_collapse import Form, Points, scaled
from jampetsc.analysis.statistics import half_width, mean_with_error
from jampetsc.commands.collapse_points import COMMON_ATTRIBUTES, notes_of, read_points, text_of
from jampetsc.errors import InputError
from jampetsc.io.reader import load
from jampetsc.plots.scaling_plots import plot_branches, plot_scaling
from jampetsc.studies.study_table import table_text


def fit_collapse(points, form):
    """The parameters with the least χ²."""
    return find_minima(points, form)[0]


PLANTED = {"phi_J": 0.8433, "y": 1.1, "kappa": 3.5}
ALL_BUT_PHI_J = {name: PLANTED[name] for name in ("y", "kappa")}
OMEGA = 0.3
PHIS = np.array([0.835, 0.838, 0.84, 0.842, 0.8433, 0.845, 0.848, 0.85])
RATES = np.geomspace(1e-6, 1e-3, 6)
FREE, CORRECTED = Form({}, degree=3), Form({}, corrections=True, degree=3)
VAGBERG = {"units": "k_e = k_d = 1, diameter of the small disks 1", "stiffness": "inverse-square-diameter"}
HARMONIC = {"sizes": "bidisperse", "potential": "harmonic", **VAGBERG}


def exact(phi, scale, corrections=0.0, planted=PLANTED):
    """What a planted law says: ln f₀ is a cubic, ln f₁ a line."""
    points = Points(phi, scale, None, None)
    x = scaled(points, planted["phi_J"], planted["kappa"])
    leading = scale ** (planted["y"] / planted["kappa"])
    return leading * (
        np.exp(0.5 + 6 * x - 8 * x**2 + 4 * x**3) + corrections * scale**OMEGA * np.exp(0.3 + 3 * x)
    )


def planted(seed, noise=0.01, corrections=0.0, scales=RATES, law=PLANTED, function=None):
    """Points of the planted law, or of one whose ln f₀ is a function of x."""
    phi, scale = np.repeat(PHIS, len(scales)), np.tile(scales, len(PHIS))
    value = exact(phi, scale, corrections, law)
    if function:
        x = scaled(Points(phi, scale, None, None), law["phi_J"], law["kappa"])
        value = scale ** (law["y"] / law["kappa"]) * np.exp(function(x))
    error = noise * value
    return Points(phi, scale, value + error * np.random.default_rng(seed).standard_normal(len(phi)), error)


def apart(points, form, expected):
    """(the fit, by how many of its errors each free parameter misses what was planted)."""
    fit, found = estimate(points, form)
    return fit, [(one.value - expected[name]) / one.error for name, one in found.items()]


@pytest.mark.parametrize("form", [FREE, replace(FREE, spline=True)])
def test_planted_exponents_are_found_again(form):
    """χ² is that of the points, its probability that of a larger one."""
    from scipy.stats import chi2

    misses = []
    for seed in range(4):
        points = planted(seed)
        fit, off = apart(points, form, PLANTED)
        assert fit.dof == len(points) - form.unknowns and fit.probability > 1e-3
        assert fit.chi2 == pytest.approx(np.sum(((points.value - fit.model(points)) / points.error) ** 2))
        assert fit.probability == pytest.approx(chi2.sf(fit.chi2, fit.dof))
        misses += off
    assert 0.5 < np.sqrt(np.mean(np.square(misses))) < 1.6
    assert np.abs(misses).max() < 3.5  # of 12


def test_zeros_are_data():
    """What vanishes within its error tells of f, though not of ln f."""
    points = planted(1)
    low = points.scale ** (1.1 / 3.5) * 0.5  # where an error as large as f hides it
    hidden = points.value < low
    values = {"value": np.where(hidden, 0.0, points.value), "error": np.where(hidden, low, points.error)}
    assert 3 < hidden.sum() < 12
    fit, off = apart(replace(points, **values), FREE, PLANTED)
    assert fit.dof == 48 - 7 and np.abs(off).max() < 3


def test_corrections_are_told_by_chi2():
    points = planted(2, 0.003, 2.0)
    assert fit_collapse(points, FREE).probability < 1e-6
    fit, off = apart(points, CORRECTED, {**PLANTED, "omega": OMEGA})
    assert fit.probability > 0.01 and fit.sign == 1
    assert np.abs(off).max() < 2.5
    assert np.allclose(sum(fit.terms(points)), exact(points.phi, points.scale, 2.0), rtol=0.01)
    below = planted(3, 0.003, -0.5)
    assert fit_collapse(below, replace(CORRECTED, fixed={"omega": OMEGA})).sign == -1


def test_parameters_drift_towards_what_was_planted_and_errors_of_cuts_are_of_their_own_points():
    """Where corrections are left out."""
    points = planted(4, 0.001, 0.2)
    cuts = drift(points, FREE)
    assert [cut for cut, _, _ in cuts] == sorted(RATES, reverse=True)[: len(cuts)] and len(cuts) >= 4
    off = [abs(fit.parameters["phi_J"] - PLANTED["phi_J"]) for _, fit, _ in cuts]
    assert off[0] > 1.5 * off[3] and off[0] > 2 * cuts[0][2]["phi_J"].error
    form = Form(ALL_BUT_PHI_J, degree=3)
    cuts = drift(points, form)
    assert [cut for cut, *_ in cuts] == sorted(RATES)[:1:-1]
    for cut, fit, some in cuts:
        alone = estimate(points[points.scale <= cut], form)
        assert fit.dof == alone[0].dof and some == alone[1]
    with pytest.raises(InputError, match="2 different rates"):
        drift(points[points.scale <= RATES[1]], form)


@pytest.mark.parametrize("spline", [False, True])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_search_with_corrections_begins_on_either_side_and_knows_its_slopes(spline, sign):
    """f₁ begins as a share of what f₀ is without its last terms; slopes are differences by all that is fitted."""
    points = planted(3, corrections=-0.5)
    plain = fit_collapse(points, Form({}, degree=4, spline=spline))
    fixed = Form({"omega": 0.4}, corrections=True, degree=4, spline=spline)
    begun = collapse_fit.start_corrections(plain, fixed, sign)
    assert begun.sign == sign and begun.parameters["omega"] == 0.4
    first, second = begun.coefficients
    assert len(second) == 3 and second[0] == pytest.approx(first[0] + np.log(0.3))
    np.testing.assert_array_equal(second[1:], first[1:3])
    one, step = replace(begun, form=replace(fixed, fixed={})), 1e-6

    def model(row, h):
        at = np.r_[[one.parameters[name] for name in one.form.free], first, second]
        at[row] += h
        moved = dict(zip(one.form.free, at, strict=False))
        coefficients = at[4 : 4 + len(first)], at[4 + len(first) :]
        return replace(one, parameters=moved, coefficients=coefficients).model(points)

    assert one.form.free == ["phi_J", "y", "kappa", "omega"]
    for row, slope in enumerate(one.slopes(points).T):
        found = (model(row, step) - model(row, -step)) / (2 * step)
        np.testing.assert_allclose(found, slope, rtol=1e-4, atol=1e-5 * np.abs(slope).max())


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        *(("value", value, "must not be negative") for value in (-1e-9, np.inf, np.nan)),
        *(("error", value, "not positive. Run longer") for value in (0.0, np.inf, -1.0, np.nan)),
    ],
)
def test_values_that_no_observable_has(name, value, message):
    points = planted(1)
    wrong = getattr(points, name).copy()
    wrong[6] = value
    with pytest.raises(InputError, match=rf"^{name} {value:g} at phi = 0.838: {message}"):
        fit_collapse(replace(points, **{name: wrong}), FREE)
    wrong = points.value.copy()
    wrong[6] = 0.0
    replace(points, value=wrong).check()  # nothing of it is something


def test_a_collapse_needs_three_scales_and_three_packing_fractions_and_more_points_than_unknowns():
    points = planted(1)
    for values, of, what in (
        (points.scale, RATES, "rates or sizes"),
        (points.phi, PHIS, "packing fractions"),
    ):
        points[values <= of[2]].check()
        with pytest.raises(InputError, match=f"2 different {what}: too few for a collapse. Give at least 3"):
            fit_collapse(points[values <= of[1]], FREE)
    form = Form(ALL_BUT_PHI_J, degree=3)  # φ_J and four coefficients
    assert form.unknowns == 5 and CORRECTED.terms == (4, 3) and Form({}, True, 4, True).terms == (7, 3)
    assert Form({"omega": 0.3}, True).plain == Form({}, False) and CORRECTED.free[-1] == "omega"
    chosen = points[np.array([0, 1, 14, 15, 28, 29])]  # three φ, at scales of four kinds
    chosen = replace(chosen, scale=np.array([1e-6, 1e-5, 1e-4] * 2))
    assert fit_collapse(chosen, form).dof == 1
    with pytest.raises(InputError, match=r"5 points for 5 unknowns\. Give more points, or a lower degree"):
        fit_collapse(chosen[np.arange(6) < 5], form)
    with pytest.raises(InputError, match=r"5 values above zero for 5 unknowns\. Give denser packings"):
        fit_collapse(replace(chosen, value=chosen.value * (np.arange(6) > 0)), form)


def test_a_value_that_is_held_is_taken_off_before_the_search():
    """With every parameter held but one, the fit is that of the free one, whatever the grid it begins on."""
    points = planted(3)
    free = fit_collapse(points, FREE)
    for name in PLANTED:
        held = {other: free.parameters[other] for other in PLANTED if other != name}
        one = fit_collapse(points, Form(held, degree=3))
        assert one.form.free == [name] and one.chi2 == pytest.approx(free.chi2, rel=1e-5)
        assert one.parameters[name] == pytest.approx(free.parameters[name], rel=1e-4)


@pytest.mark.parametrize("free", [("phi_J", "y", "kappa"), ("phi_J", "kappa"), ("y",)])
def test_the_search_begins_near_what_was_planted(free):
    """The best of a grid of φ_J and κ, where ln O is linear in the rest: weights are those of ln O."""
    points, held = planted(1), {name: value for name, value in PLANTED.items() if name not in free}
    start = collapse_fit.find_starts(points, Form(held, degree=3))[0]
    p, weight = start.parameters, points.value / points.error
    assert abs(p["phi_J"] - PLANTED["phi_J"]) < 2e-3 and 2.0 < p["kappa"] < 6.0 and 0.6 < p["y"] < 1.8
    residuals = (np.log(points.value) - np.log(start.model(points))) * weight
    assert start.chi2 == pytest.approx(np.sum(residuals**2), rel=1e-6)
    columns = [start.basis(start.x(points))[0], *([np.log(points.scale)] if "y" in free else [])]
    weighted = np.column_stack(columns) * weight[:, None]
    assert np.abs(weighted.T @ residuals).max() < 1e-6 * np.abs(weighted.T @ weight).max()


def linear_errors(points, fit):
    """Standard errors of the free parameters, if the model were linear in all that is fitted."""
    slopes = fit.slopes(points) / points.error[:, None]
    return np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))[: len(fit.form.free)]


def test_ends_of_two_sigma_are_where_chi2_has_risen_by_four():
    """With the parameter held there, whatever else is free; a linear model would have them at twice its error."""
    points = planted(1, 0.1)
    fit, found = estimate(points, FREE)
    linear = linear_errors(points, fit)
    for (name, one), error in zip(found.items(), linear, strict=True):
        for end in (one.low, one.high):
            inner = one.value + np.sign(end - one.value) * np.sqrt((end - one.value) ** 2 - 4 * one.shift**2)
            held = fit_collapse(points, Form({name: float(inner)}, degree=3))
            assert held.chi2 - fit.chi2 == pytest.approx(4, abs=0.3)
        assert one.error == pytest.approx(np.hypot(error, one.shift), rel=0.4)


def test_errors_of_parameters_are_correlated():
    """Where y is held one error higher, zν follows by ρ of its error: so the error of β = zν − y is not their sum."""
    points, names = planted(1, 0.02), ["phi_J", "y", "kappa"]
    fit, _ = estimate(points, FREE)
    correlation, errors = collapse_fit.correlations(points, fit), linear_errors(points, fit)
    assert list(fit.form.free) == names
    np.testing.assert_allclose(np.diag(correlation), 1.0)
    np.testing.assert_allclose(correlation, correlation.T)
    raised = fit_collapse(points, Form({"y": fit.parameters["y"] + errors[1]}, degree=3))
    for name in ("phi_J", "kappa"):
        row = names.index(name)
        moved = (raised.parameters[name] - fit.parameters[name]) / errors[row]
        assert moved == pytest.approx(correlation[1, row], abs=0.1)
    assert abs(correlation[1, 2]) > 0.2  # else nothing is tested


def test_what_a_polynomial_cannot_say_is_in_the_errors():
    """ln f₀ = 2.5 arctan 4x: χ² does not tell that degree 5 makes zν too large, fits of higher degrees do."""
    alone, told, form = [], [], Form({}, degree=5)
    for seed in range(1000, 1006):
        points = planted(seed, 0.02, function=lambda x: 2.5 * np.arctan(4 * x))
        fit, found = estimate(points, form)
        one, off = found["kappa"], fit.parameters["kappa"] - PLANTED["kappa"]
        alone.append(off / np.sqrt(one.error**2 - one.shift**2))
        told.append(off / one.error)
        assert fit.probability > 1e-3
    assert np.mean(alone) > 0.5 and np.abs(told).max() < 2.5
    assert np.sqrt(np.mean(np.square(told))) < 0.85 * np.sqrt(np.mean(np.square(alone)))
    assert estimate(planted(1), form)[1]["kappa"].shift < 0.05  # of a cubic there is nothing to add


def test_what_the_data_do_not_tell_has_no_number():
    """Three rates within a factor of two, 20 % noise: the best φ_J is at the end of its range; a limit, and a note.

    A profile is followed from there, too: χ² with a parameter held is what a search of its own finds.
    """
    scales = np.array([1e-6, 1.5e-6, 2e-6])
    points = planted(1, 0.2, scales=scales)
    fit, found = estimate(points, FREE)
    for name, one in found.items():
        assert one.low <= PLANTED[name] <= one.high
        assert one.decided == np.isfinite(one.error) == (name == "kappa")
    notes, said = notes_of(points, fit, found, False), text_of(fit.parameters, found, False)
    assert "phi_J > 0.83" in said and "y undecided" in said
    assert "phi_J = 0.865 is outside the data, 0.835 to 0.85" in notes
    assert (
        "the data do not determine phi_J: its 2 sigma interval reaches an end of its range, 0.82 to 0.865"
        in notes
    )
    points = planted(2, 0.2, scales=scales)
    fit, found = estimate(points, FREE)
    for name in ("phi_J", "kappa"):
        held = fit_collapse(points, Form({name: PLANTED[name]}, degree=3))
        assert held.chi2 - fit.chi2 < 4 and found[name].low < PLANTED[name] < found[name].high


def test_common_errors_count_by_their_covariance():
    rng = np.random.default_rng(0)
    points = replace(planted(0)[np.arange(48) % 5 > 0], common=0.3)  # not as many at every rate
    residuals = rng.normal(size=(len(points), 2))
    same = points.scale[:, None] == points.scale
    covariance = points.error[:, None] * points.error * (0.7 * np.eye(len(points)) + 0.3 * same)
    turned = points.in_errors(residuals)
    np.testing.assert_allclose(
        turned.T @ turned, residuals.T @ np.linalg.solve(covariance, residuals), rtol=1e-10
    )


def test_errors_that_are_common_to_a_rate_are_fitted_as_such():
    """Nine tenths of the variance shift all points of a rate together; `benchmarks/planted.py` has the coverage."""
    points = planted(5)
    own, shared = np.random.default_rng(5).standard_normal((2, len(points)))
    shared = shared[np.unique(points.scale, return_inverse=True)[1]]
    true = exact(points.phi, points.scale)
    points = replace(points, value=true + points.error * (np.sqrt(0.1) * own + np.sqrt(0.9) * shared))
    fit, found = estimate(points, FREE)
    assert 0.7 < fit.common < 0.97 and 0.01 < fit.probability < 0.99
    assert all(one.low < PLANTED[name] < one.high for name, one in found.items())
    assert notes_of(points, fit, found, False)[0].startswith(
        "points of one rate scatter about their mean by "
    )


def test_notes_of_a_fit():
    points = planted(1)
    fit, found = estimate(points, FREE)

    def notes(fit=fit, points=points, **more):
        return notes_of(points, fit, {**found, **more}, False)

    assert notes() == []
    assert notes(replace(fit, chi2=200.0))[0].startswith("the form does not describe the data")
    assert notes(replace(fit, chi2=10.0))[0].startswith(
        "chi2 is far too small: the errors of the data are too large"
    )
    outside = replace(fit, parameters={**fit.parameters, "phi_J": 0.86})
    assert notes(outside) == ["phi_J = 0.86 is outside the data, 0.835 to 0.85"]
    uneven = "y has uneven errors: use its 2 sigma interval, 0.9 to 1.5"
    assert notes(y=Estimate(1.1, 0.9, 1.5, 0.0)) == [uneven]
    assert "y changes by 0.09 with the degree" in notes(y=Estimate(1.1, 0.9, 1.3, 0.09))[0]
    assert "too few points for a higher degree" in notes(points=points[np.arange(48) % 6 == 0])[-1]
    for one, said in (
        (Estimate(3.5, 2.7, np.inf, 0.0), "znu > 2.7"),
        (Estimate(3.5, -np.inf, 6.0, 0.0), "znu < 6"),
        (Estimate(3.5, -np.inf, np.inf, 0.0), "znu undecided"),
        (Estimate(3.5, 3.3, 5.0, 0.0), "znu = 3.5 (2 sigma: 3.3 to 5)"),
        (Estimate(3.5, 3.3, 3.7, 0.0), "znu = 3.5 ± 0.1"),
        (None, "znu = 3.5 fixed"),
    ):
        assert text_of({"kappa": 3.5}, {"kappa": one} if one else {}, False) == said


def test_another_minimum_nearly_as_deep_is_within_two_sigma():
    points = planted(2)
    fit = fit_collapse(points, FREE)
    other = fit_collapse(planted(9), FREE)  # as if the search had ended there too, 1 above the least
    ends = collapse_fit.find_ends(points, [fit])
    moved = {**other.parameters, "kappa": ends["kappa"][1] * 1.001}
    away = replace(other, parameters=moved, chi2=fit.chi2 + 1)
    both = collapse_fit.find_ends(points, [fit, away])
    assert all(both[n][0] <= ends[n][0] and both[n][1] >= ends[n][1] for n in ends)
    assert collapse_fit.find_ends(points, [fit, replace(away, chi2=fit.chi2 + 5)]) == ends


def test_phi_J_may_lie_beyond_the_data_and_what_grows_near_it_has_a_negative_exponent():
    """By as much as the data span; here all of them are below it. A viscosity has y < 0."""
    points = planted(1, 0.001)
    below = points[points.phi < 0.8425]
    phi_J = fit_collapse(below, Form(ALL_BUT_PHI_J, degree=3)).parameters["phi_J"]
    assert phi_J > below.phi.max() and phi_J == pytest.approx(0.8433, abs=1e-3)
    points = planted(1, 0.003, law=PLANTED | {"y": -0.9})
    fit = fit_collapse(points, Form({"phi_J": PLANTED["phi_J"], "kappa": PLANTED["kappa"]}, degree=3))
    assert fit.parameters["y"] == pytest.approx(-0.9, abs=0.02)


# Files


def write_flow(path, phi, rate, n=1024, **more):
    """A flow file of which only the means are there."""
    rng = np.random.default_rng(int(1e9 * rate) + int(1e5 * phi))
    value = float(exact(np.array([phi]), np.array([rate]))[0])
    facts = {"model": "RD0", "mass": 0.0, "k": 1.0, "tau1": 1.0, "phi": phi, "rate": rate, "seed": 1}
    facts |= {"particle_count": n, "pressure_error": 0.01 * value, **HARMONIC}
    facts |= {"pressure_samples": np.inf, "shear_stress_samples": np.inf}
    facts |= {"pressure_mean": value * (1 + 0.01 * rng.standard_normal())}
    facts |= {"shear_stress_mean": 0.1 * facts["pressure_mean"], "shear_stress_error": 1e-3 * value}
    return str(stored(path, "flow", {"strain": np.arange(3.0)}, **facts | more))


def write_jam(path, n, jammed, pressure=None, phi=(0.82, 0.83, 0.84, 0.85), **more):
    """A loaded jam file of samples (φ, seeds) that jam or not."""
    jammed = np.asarray(jammed, float)
    columns = {"phi": np.repeat(phi, jammed.shape[1]), "seed": np.tile(np.arange(jammed.shape[1]), len(phi))}
    columns["jammed"] = jammed.ravel()
    if pressure is not None:
        columns["pressure"] = np.asarray(pressure, float).ravel()
    return load(stored(path, "jam", columns, **{"particle_count": n, **HARMONIC} | more))


def write_shear(path, jammed, phi, n, discard):
    """A loaded file of slow shear, a state every 0.1, whose pressures are whether they jam."""
    arrays = {"strain": 0.1 * np.arange(1, len(jammed) + 1), "jammed": jammed, "pressure": jammed}
    facts = {"phi": phi, "seed": 1, "particle_count": n, "discard": discard}
    return load(stored(path, "shear", arrays, **facts, **HARMONIC))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A folder of flow files at five rates and φ."""
    folder = tmp_path_factory.mktemp("study")
    rows = []
    for phi, rate, name, model in [
        *((phi, rate, f"{phi}-{rate:.3g}.h5", "RD0") for phi in PHIS[1:6] for rate in RATES[:5]),
        (0.84, 1e-3, "other.h5", "CD0"),
    ]:
        write_flow(folder / name, phi, rate, model=model)
        rows.append({"command": "flow", "state": "done", "file": name, "seconds": 0.1, "model": model})
    (folder / "table.csv").write_text(table_text(rows))
    return folder


def command(*words):
    return cli.main(["collapse", *map(str, words)])


def test_the_command_on_a_study(study, tmp_path, capsys):
    out, picture = tmp_path / "p.h5", tmp_path / "p.png"
    words = "--where model=RD0 --observable pressure --fit phi_J,y=1.1,znu --degree 3 --out".split()
    assert command(study, *words, out) == 0
    said = capsys.readouterr().out
    result = load(out)
    a, drift = (
        result.attributes,
        [result[f"drift/{name}"] for name in ("cut", "parameters", "errors", "chi2_per_dof")],
    )
    told = [
        f"phi_J = {phi_J:.5g} ± {errors[0]:.2g}, y = 1.1 fixed, znu = {znu:.5g} ± {errors[1]:.2g}"
        for (phi_J, znu), errors in zip(*drift[1:3], strict=True)
    ]
    further = zip(drift[0], told, drift[3], strict=True)
    assert said.splitlines()[: 1 + len(told)] == [
        f"{out}: pressure at 25 points, {told[0]}",
        f"  chi2/dof = {a['chi2'] / a['dof']:.3g} with 19 degrees of freedom, probability {a['probability']:.2g}",
        *[f"  rates <= {cut:.4g}: {text}, chi2/dof = {chi2:.3g}" for cut, text, chi2 in further][1:],
    ]
    assert len(told) > 1 and drift[0][1] == pytest.approx(RATES[3])
    assert a["fitted"] == "phi_J,znu" and a["scaling"] == "rate" and a["dof"] == 25 - 6
    for name, expected in (("phi_J", PLANTED["phi_J"]), ("znu", PLANTED["kappa"])):
        assert abs(a[name] - expected) < 2.5 * a[f"{name}_error"]
        assert a[f"{name}_low"] < a[name] < a[f"{name}_high"] and a[f"{name}_shift"] < a[f"{name}_error"]
        assert a[f"{name}_error"] == pytest.approx((a[f"{name}_high"] - a[f"{name}_low"]) / 4)
    assert np.allclose((result["phi"] - a["phi_J"]) / result["rate"] ** (1 / a["znu"]), result["x"])
    model = result["leading"] + result["correction"]
    assert np.sum(((result["value"] - model) / result["error"]) ** 2) == pytest.approx(a["chi2"])
    facts = {"model": "RD0", "mass": 0.0, "tau1": 1.0, **HARMONIC}
    assert {name: a[name] for name in facts} == facts
    assert a["notes"] and all(f"  note: {note}" in said for note in a["notes"].split("; "))
    assert command(study, *words, tmp_path / "cut.h5", "--cut", "7e-5", "--range", "0.8385:0.9") == 0
    assert len(load(tmp_path / "cut.h5")["phi"]) == 16
    for more, message in (
        ([], "model CD0, but"),
        (["--where", "model=CD"], "model is RD0 or CD0"),
        (["--where", "command=jam"], "command is flow"),
    ):
        assert command(study, *words[2:], tmp_path / "x.h5", *more) == 2
        assert message in capsys.readouterr().err
    assert cli.main(["plot", str(out), "--out", str(picture)]) == 0
    assert picture.stat().st_size > 20_000


def test_flows_in_memory_are_scaled_as_their_files_are(study):
    flows = [load(path) for path in sorted(study.glob("0.84*-*.h5"))]
    held = [stored(None, "flow", {}, **flow.attributes) for flow in flows]
    how = {"observable": "pressure", "fit": ["phi_J", "y=1.1", "znu"], "degree": 1, "range": (0.8, 0.9)}
    one, other = jampetsc.collapse(*held, **how), jampetsc.collapse(*flows, **how)
    assert one.file is None and set(one) == set(other)
    assert all(np.array_equal(one[name], other[name]) for name in one)
    assert one.attributes["source_runs"] == other.attributes["source_runs"]
    with pytest.raises(InputError, match="given twice"):
        jampetsc.collapse(held[0], held[0], **how)


def test_slow_shear_counts_after_its_discard(tmp_path):
    file = write_shear(tmp_path / "qs.h5", np.r_[np.ones(5), 0, 0, 0, 1, 0], 0.84, 64, 0.5)
    for name in ("jammed", "pressure"):
        points = read_points([file], name, True)
        assert points.value == pytest.approx([0.2]) and points.scale == pytest.approx([1 / 8])
        assert points.error[0] > 0.1


def test_points_of_jam_files_are_shares_and_means_with_their_errors(tmp_path):
    """Wilson's interval is not even about a share near one; a pressure is a mean of all, 0 where none jams."""
    rows = [[0] * 6, [0, 0, 0, 0, 1, 1], [1, 1, 1, 1, 1, 0], [1, 1, 1, 1, 1, np.nan]]
    jammed = np.array(rows, float)
    least = 1e-15  # what a minimiser leaves of zero
    pressure = np.where(np.nan_to_num(jammed) == 1, 1e-3 * np.arange(1, 7), least) + 0 * jammed
    file = write_jam(tmp_path / "a.h5", 64, jammed, pressure)
    data = read_points([file], "jammed", True)
    shares = [jammed_samples.independent_share(row[np.isfinite(row)]) for row in jammed]
    np.testing.assert_allclose(data.value, [share.value for share in shares])
    np.testing.assert_allclose(data.error, [0.5 * (share.high - share.low) for share in shares])
    assert data.runs.tolist() == [6, 6, 6, 5]
    assert (data.size == 64).all() and (data.scale == 1 / 8).all()
    data = read_points([file], "pressure", True)
    assert data.phi.tolist() == [0.83, 0.84, 0.85]
    values = [np.where(row == 1, p, 0.0) for row, p in zip(jammed[1:], pressure[1:], strict=True)]
    values[2] = values[2][:5]  # one that reached no minimum
    np.testing.assert_allclose(data.value, [some.mean() for some in values], rtol=1e-15)
    np.testing.assert_allclose(data.error, [mean_with_error(some)[1] for some in values])
    alone = write_jam(tmp_path / "b.h5", 64, [[1]], [[2e-3]], (0.84,))
    assert np.isnan(read_points([alone], "pressure", True).error).all()


def test_what_one_seed_gives_in_a_row_is_one_run(tmp_path):
    """Of shear between samples a file has several rows of a seed: a series, not so many samples."""
    pressure = np.abs(np.random.default_rng(1).normal(1e-3, 1e-4, (2, 60)))
    columns = {"phi": np.full(120, 0.84), "seed": np.repeat([1, 2], 60), "jammed": np.ones(120)}
    columns["pressure"] = pressure.ravel()
    path = stored(tmp_path / "s.h5", "jam", columns, particle_count=64, potential="harmonic")
    data = read_points([load(path)], "pressure", True)
    value, error = mean_of_averages([Average.of(run) for run in pressure])
    assert data.runs.tolist() == [2] and data.value == value
    assert data.error == pytest.approx(error)


def test_flows_of_one_state_are_averaged_each_observable_with_its_own_error(tmp_path):
    def points_of(*files, observable="pressure"):
        named = ((tmp_path / f"{n}.h5", phi, {"seed": n} | more) for n, (phi, more) in enumerate(files))
        flows = [load(write_flow(path, phi, 1e-3, **more)) for path, phi, more in named]
        return read_points(flows, observable, False)

    data = points_of(*((0.84, {"pressure_mean": p, "pressure_error": 1e-6}) for p in (1e-3, 3e-3)))
    assert data.value == pytest.approx([2e-3]) and data.runs == [2] and data.size == [1024]
    assert data.error == pytest.approx([half_width(1) * 1e-3])
    for off, runs in ((3e-7, [2]), (2e-6, [1, 1])):  # φ is one to six decimals
        assert points_of((0.84, {}), (0.84 + off, {})).runs.tolist() == runs
    more = {"shear_stress_mean": 7e-4, "shear_stress_error": 3e-5, "pressure_error": 1e-5}
    points = points_of((0.84, more), observable="shear_stress")
    assert (points.value, points.error, points.scale) == ([7e-4], [3e-5], [1e-3])
    assert points_of((0.84, more)).error == [1e-5]


@pytest.mark.parametrize("name", COMMON_ATTRIBUTES)
def test_what_is_scaled_is_of_one_kind(tmp_path, name):
    words = {
        "potential": ("harmonic", "hertzian"),
        "stiffness": ("constant", "inverse-square-diameter"),
        "dimension": (2, 3),
        "exponent": (2.25, 3.5),
        **dict.fromkeys(("k", "mass", "tau1"), (1.0, 2.0)),
    }
    one, two = words.get(name, ("one", "two"))
    first, other = (
        load(write_flow(tmp_path / f"{n}.h5", 0.84, 1e-3, seed=n, **more))  # files of disks have no dimension
        for n, more in enumerate(({} if one == 2 else {name: one}, {name: two}))
    )
    with pytest.raises(
        InputError, match=rf"1\.h5: {name} {two}, but 0\.h5 has {one}\. Give files of one kind"
    ):
        read_points([first, other], "pressure", False)


def test_samples_of_shear_may_stand_beside_those_of_a_protocol_but_each_counts_once(tmp_path):
    random = write_jam(tmp_path / "a.h5", 64, np.ones((4, 3)), protocol="random")
    slow = write_shear(tmp_path / "qs.h5", np.ones(20), 0.84375, 256, 1.0)
    data = read_points([random, slow], "jammed", True)
    assert sorted(data.phi) == [0.82, 0.83, 0.84, 0.84375, 0.85] and sorted(data.size)[-1] == 256
    cooled = write_jam(tmp_path / "b.h5", 144, np.ones((4, 3)), protocol="compress")
    with pytest.raises(InputError, match=r"b\.h5: protocol compress, but a\.h5 has random"):
        read_points([random, cooled], "jammed", True)
    again = write_jam(tmp_path / "c.h5", 64, np.ones((4, 1)), protocol="random")
    with pytest.raises(
        InputError, match=r"c\.h5: phi = 0\.82 from seed 0 is in a\.h5 as well\. Give each run once"
    ):
        read_points([random, again], "jammed", True)


def test_files_that_do_not_go_together(tmp_path, capsys):
    first = write_flow(tmp_path / "first.h5", 0.84, 1e-3)
    other = write_flow(tmp_path / "other.h5", 0.84, 1e-3, n=64, seed=2)
    words = ("--observable", "pressure", "--fit", "phi_J,y,znu", "--out", tmp_path / "x.h5")
    assert command(first, other, *words) == 2
    assert "Give files of one N to scale with rates" in capsys.readouterr().err


@pytest.mark.parametrize("D", [2, 3])
def test_a_file_of_sizes_holds_what_was_fitted_in_words_of_the_command(tmp_path, capsys, D):
    """L^D = N; --cut N and --range take their ends along; of four sizes and four φ, three of each are left."""
    rng, sizes = np.random.default_rng(3), [side**D for side in (6, 8, 12, 16, 20)]
    more = {"dimension": 3} if D == 3 else {}
    for n in sizes:
        share = 1 / (1 + np.exp(-(np.array([0.82, 0.83, 0.84, 0.85]) - 0.835) * 10 * n ** (1 / D)))
        write_jam(tmp_path / f"{n}.h5", n, rng.random((4, 40)) < share[:, None], **more)
    words = f"--finite-size --observable jammed --fit phi_J,y=0,nu=1 --degree 1 --cut {8**D} --spline --range 0.82:0.84"
    files = [tmp_path / f"{sizes[i]}.h5" for i in (4, 0, 3, 1, 2)]
    assert command(*files, *words.split(), "--out", tmp_path / "f.h5") == 0
    found = load(tmp_path / "f.h5")
    a = found.attributes
    assert found["N"].tolist() == sizes[:0:-1] * 3 and np.allclose(found["size"] ** D, found["N"])
    assert found["phi"].tolist() == [0.82] * 4 + [0.83] * 4 + [0.84] * 4 and (found["runs"] == 40).all()
    assert np.allclose(found["x"], (found["phi"] - a["phi_J"]) * found["size"])
    data = read_points([load(path) for path in files], "jammed", True)
    points = data[(data.phi < 0.845) & (data.scale < 0.13)]
    for name in ("value", "error"):
        np.testing.assert_allclose(found[name], getattr(points, name))
    fit = fit_collapse(points, Form({"y": 0.0, "kappa": 1.0}, degree=1, spline=True))
    assert a["phi_J"] == pytest.approx(fit.parameters["phi_J"]) and a["chi2"] == pytest.approx(fit.chi2)
    assert (a["fitted"], a["scaling"], a["dof"], a["y"], a["nu"]) == ("phi_J", "size", fit.dof, 0.0, 1.0)
    assert a["probability"] == pytest.approx(fit.probability) and not a["corrections"]
    assert (
        a["functions"] == "spline, degree 1"
        and {name: a[name] for name in HARMONIC | more} == HARMONIC | more
    )
    one = estimate(points, fit.form)[1]["phi_J"]
    assert [a[f"phi_J_{what}"] for what in ("error", "low", "high")] == [one.error, one.low, one.high]
    np.testing.assert_allclose(found["drift/cut"], sizes[1:3])
    for row, (cut, one, some) in enumerate(drift(points, fit.form)):
        drifted = [found[f"drift/{name}"][row] for name in ("cut", "parameters", "chi2_per_dof")]
        assert drifted == pytest.approx([cut**-D, one.parameters["phi_J"], one.chi2 / one.dof])
        np.testing.assert_array_equal(found["drift/errors"][row], some["phi_J"].error)
    np.testing.assert_allclose(found["curve/f0"], fit.functions(found["curve/x"])[0])
    assert (found["curve/f1"] == 0).all()
    assert found["curve/x"][[0, -1]] == pytest.approx([found["x"].min(), found["x"].max()])
    said = capsys.readouterr().out.splitlines()
    assert "jammed at 12 points, phi_J = " in said[0] and "nu = 1 fixed" in said[0]
    text = text_of(one.parameters, some, True)
    assert [line for line in said[2:] if "note" not in line] == [
        f"  N >= {sizes[2]}: {text}, chi2/dof = {one.chi2 / one.dof:.3g}"
    ]
    for more, message in (
        (f"--cut {14**D}", "2 different rates or sizes: too few for a collapse. Give at least 3"),
        ("--observable pressure", "no dataset pressure"),
        ("--observable shear_stress", "no dataset shear_stress"),
    ):
        assert command(*files, *words.split(), *more.split(), "--out", tmp_path / "x.h5") == 2
        assert message in capsys.readouterr().err


# Pictures


@pytest.mark.parametrize(("off", "inside"), [(0.005, True), (0.5, False)])
@pytest.mark.parametrize(
    ("scale", "kappa", "observable", "symbol"),
    [
        ("rate", "znu", "pressure", "p"),
        ("rate", "znu", "shear_stress", r"\sigma"),
        ("size", "nu", "jammed", "f"),
    ],
)
def test_a_picture_of_a_collapse(scale, kappa, observable, symbol, off, inside):
    """What is left without corrections, its residuals, and the drift: of a fit that has lost its way six typical
    changes or errors to either side of the best are seen, less where everything is nearer.
    """
    rng, sized = np.random.default_rng(4), scale == "size"
    b = np.repeat([0.1, 0.125] if sized else [1e-3, 1e-2], 3)
    leading, correction, noise = (1 + rng.random((3, 6))) * [[1], [0.2 * sized], [0.1]]
    best, own, errors = 0.84, 2e-3, np.array([1e-3, 2e-3, 3e-3])
    cuts, values = np.array([1e-2, 1e-3, 1e-4]), best + np.array([1e-3, -2e-3, off])
    result = {
        scale: 1 / b if sized else b, "value": leading + correction + noise, "error": np.full(6, 0.1),
        "leading": leading, "correction": correction, "x": rng.normal(size=6), "N": np.repeat([1000.0, 512.0], 3),
        "curve/x": np.linspace(-2, 2, 9), "curve/f0": np.linspace(1, 3, 9), "drift/cut": cuts,
        "drift/parameters": values[:, None], "drift/errors": errors[:, None],
    }  # fmt: skip
    facts = {"scaling": scale, "observable": observable, "corrections": sized, "fitted": "phi_J", "y": 1.2}
    facts |= {kappa: 3.0, "phi_J": best, "phi_J_error": own, "chi2": 3.0, "dof": 4}
    top, middle, drifted = figure_of(plot_scaling, held(result, facts)).axes
    for label in (top.get_ylabel(), middle.get_xlabel(), drifted.get_xlabel()):
        assert (r"\dot\gamma" in label) != sized
    if sized:
        assert [text.get_text() for text in top.get_legend().get_texts()] == ["$1000$", "$512$"]
    unit = b ** (1.2 / 3.0)
    for number, (x, y, down, up) in enumerate(bars(top)):
        here = slice(3 * number, 3 * number + 3)
        assert np.allclose(x, result["x"][here]) and np.allclose(y, ((leading + noise) / unit)[here])
        assert np.allclose([down, up], 0.1 / unit[here])
        assert np.allclose(lines(middle, 3)[number][1], 10 * noise[here])
    minus, power, span = (
        (rf"({symbol} - \mathrm{{corr.}})", r"L^{y/\nu}", r"L^{1/\nu}") if sized
        else (symbol, r"\dot\gamma^{-y/z\nu}", r"\dot\gamma^{-1/z\nu}")
    )  # fmt: skip
    assert (top.get_ylabel(), middle.get_ylabel()) == (rf"${minus}\,{power}$", "residual / error")
    assert middle.get_xlabel() == rf"$x=(\phi-\phi_J)\,{span}$" and drifted.get_ylabel() == r"$\phi_J$"
    assert top.get_title(loc="right") == r"$\chi^2/\mathrm{dof}=0.75$" and top.get_yscale() == "linear"
    ((x, y, down, _),) = bars(drifted)
    assert np.allclose([x, y, down], [cuts, values, errors])
    low, high = drifted.get_ylim()
    reach = 6 * max(np.median(np.abs(values - best)), 2e-3, own)
    expected = min(max((values + errors).max(), best + own) + 0.1 * own, best + reach)
    assert high == pytest.approx(expected) and (high > values[2]) == inside
    assert low == pytest.approx(max(min((values - errors).min(), best - own) - 0.1 * own, best - reach))
    assert drifted.get_xlim() == pytest.approx((10**-4.1, 10**-1.9))
    band = drifted.patches[0].get_extents().transformed(drifted.transData.inverted())
    assert (band.y0, band.y1) == pytest.approx((best - own, best + own))
    result |= {
        "drift/cut": cuts[:1],
        "drift/parameters": np.array([[best]]),
        "drift/errors": np.array([[np.nan]]),
    }
    with warnings.catch_warnings():  # one value without an error, which matplotlib warned of
        warnings.simplefilter("error")
        figure_of(plot_scaling, held(result, facts | {"phi_J_error": np.nan}))


def test_two_branches_are_drawn_against_the_distance():
    x, f0 = np.array([-0.2, 0.1, -0.4, 0.3]), np.array([1.0, 2.0, 0.5, 3.0])
    rate = np.array([1e-3, 1e-3, 1e-2, 1e-2])
    unit = rate**0.5
    result = {"rate": rate, "x": x, "value": f0 * unit + 0.1, "error": 0.2 * unit}
    result |= {"correction": np.full(4, 0.1)}
    result |= {"curve/x": np.linspace(-0.5, 0.5, 11), "curve/f0": np.arange(1.0, 12.0)}
    facts = {"scaling": "rate", "observable": "pressure", "y": 1.0, "znu": 2.0, "phi_J": 0.84}
    (ax,) = figure_of(plot_branches, held(result, facts)).axes
    assert ax.get_xscale() == ax.get_yscale() == "log"
    order = [1, 0, 3, 2]  # of each rate those above φ_J first
    for (distance, y, down, up), n in zip(bars(ax), order, strict=True):
        assert np.allclose([distance[0], y[0], down[0], up[0]], [abs(x[n]), f0[n], 0.2, 0.2])
    below, above = (drawn[:2] for drawn in lines(ax, 5))
    assert np.allclose(below, [[0.5, 0.4, 0.3, 0.2, 0.1], [1, 2, 3, 4, 5]])
    assert np.allclose(above[1], [7, 8, 9, 10, 11])
    assert "hollow" in ax.get_legend().get_title().get_text()
    dashed = {line.get_label(): line.get_data() for line in ax.get_lines() if line.get_linestyle() == "--"}
    assert dashed.keys() == {"_:y", r"_:y-z\nu"}  # through the farthest points
    for name, (place, height, slope) in (("_:y", (0.3, 3.0, 1.0)), (r"_:y-z\nu", (0.4, 0.5, -1.0))):
        distance, y = dashed[name]
        assert np.allclose(distance, place * np.array([0.7, 1.15]))
        assert np.allclose(y, height * (distance / place) ** slope)
    with pytest.raises(InputError, match=r"f\.h5: a collapse of sizes"):
        plot_branches([held(result, facts | {"scaling": "size"}, "f.h5")])
