"""`jampetsc scaling`: groups of flows, quasistatic shear of the same particles, its file, summary and notes."""

import numpy as np
import pytest
from flow_means import LAWS, RATES, TAU1, K, flow, sheared
from samples import crystal, published

import jampetsc
from jampetsc import main as cli
from jampetsc.analysis.flow_laws import FORMS, PARAMETERS, FlowCurve, FlowLaw, fit_flow_law
from jampetsc.analysis.statistics import half_width
from jampetsc.commands.flow_points import read_groups
from jampetsc.errors import InputError
from jampetsc.packing.potentials import Potential
from jampetsc.studies.study_table import table_text


@pytest.fixture(scope="module")
def flows():
    return [flow(None, rate, seed) for seed in (1, 2, 3, 4) for rate in RATES]


@pytest.mark.parametrize("form", FORMS)
def test_the_result_is_the_fit_of_the_means(flows, form):
    """Over four seeds: the scatter of fits without one of them."""
    fit = jampetsc.scaling(*flows, form=form)
    stress = np.array([run.attributes["shear_stress_mean"] for run in flows]).reshape(4, -1)
    own = np.array([run.attributes["shear_stress_error"] for run in flows]).reshape(4, -1)
    plain = own[0] / half_width(400 / 6) / 2 * half_width(1600 / 6)
    alone = fit_flow_law(FlowCurve(RATES, stress.mean(axis=0), plain, plain, stress), FORMS[form])
    assert np.allclose(fit["shear_stress"], stress.mean(axis=0)) and np.allclose(fit["rate"], RATES)
    assert (fit["shear_stress_error"] >= plain * (1 - 1e-12)).all() and (fit["runs"] == 4).all()
    law = FlowLaw(*(fit[f"groups/{name}"][0] for name in PARAMETERS))
    for name in PARAMETERS:
        assert getattr(law, name) == pytest.approx(getattr(alone.law, name))
        ends = [fit[f"groups/{name}_{end}"][0] for end in ("low", "high")]
        assert np.allclose(ends, alone.intervals.get(name, (np.nan, np.nan)), equal_nan=True)
    assert fit["groups/jackknifed"][0] and fit["groups/seeds"][0] == 4 and fit.attributes["form"] == form
    assert np.allclose(fit["residual"], (fit["shear_stress"] - law.stress(RATES)) / fit["shear_stress_error"])
    assert np.sum(fit["residual"] ** 2) == pytest.approx(fit["groups/chi2"][0])
    cuts = RATES[::-1][: len(RATES) - FORMS[form].min_rates + 1]
    assert np.allclose(fit["drift/cut"], cuts) and fit["drift/flow_index"][0] == law.flow_index
    assert (
        np.isnan(fit["groups/difference"][0]) and fit.attributes["tau1"] == TAU1 and fit.attributes["k"] == K
    )


def test_the_order_of_files_does_not_matter(flows):
    order = np.random.default_rng(1).permutation(len(flows))
    one, other = (jampetsc.scaling(*runs) for runs in (flows, [flows[n] for n in order]))
    assert all(np.allclose(one[name], other[name], rtol=1e-9, equal_nan=True) for name in one)


def test_one_seed_or_other_seeds_at_other_rates_take_the_profile(flows):
    single = jampetsc.scaling(*flows[:6])
    mixed = jampetsc.scaling(*flows[:6], *flows[6:11])
    for fit in (single, mixed):
        assert not fit["groups/jackknifed"][0] and fit["groups/seeds"][0] == 1
    two = jampetsc.scaling(*flows[:12])
    assert two["groups/seeds"][0] == 2 and not two["groups/jackknifed"][0]
    assert set(mixed["runs"]) == {1, 2}


def test_groups_and_quasistatic_shear():
    """Each φ has its law, and the quasistatic shear of its particles alone."""
    runs = [flow(None, rate, seed, phi) for phi in (0.9, 0.86) for seed in (1, 2, 3) for rate in RATES]
    others = [sheared(None, seed=seed, stress=stress) for seed, stress in ((1, 1e-3), (2, 1.2e-3))]
    fit = jampetsc.scaling(*runs, *others, by="phi")
    assert fit.attributes["groups"] == "phi = 0.86; phi = 0.9" and np.allclose(fit["groups/phi"], list(LAWS))
    assert np.array_equal(fit["group"], np.repeat([0, 1], 6)) and "phi" not in fit.attributes
    for place, law in enumerate(LAWS.values()):
        for name in PARAMETERS:
            low, high = (fit[f"groups/{name}_{end}"][place] for end in ("low", "high"))
            assert abs(fit[f"groups/{name}"][place] - getattr(law, name)) < high - low
    assert fit["groups/quasistatic_shear_stress"][0] == pytest.approx(1.1e-3)
    assert fit["groups/quasistatic_pressure"][0] == pytest.approx(8.8e-3)
    assert np.isnan(fit["groups/quasistatic_shear_stress"][1])
    difference = [fit[f"groups/difference{end}"][0] for end in ("_low", "", "_high")]
    assert difference[1] == pytest.approx(fit["groups/yield_stress"][0] - 1.1e-3)
    sides = (
        fit["groups/yield_stress"][0] - fit["groups/yield_stress_low"][0],
        1.96 * fit["groups/quasistatic_shear_stress_error"][0],
    )
    assert difference[1] - difference[0] == pytest.approx(np.hypot(*sides))
    alone = jampetsc.scaling(*runs[18:], form="herschel-bulkley")
    assert alone["groups/yield_stress"][0] == pytest.approx(fit["groups/yield_stress"][0], rel=1e-9)


def test_what_does_not_belong_together(flows):
    for more, says in (
        (
            [flow(None, 1e-2, phi=0.9)],
            r"phi 0\.9, but .* has 0\.86\. Give files of one kind, or group them: by phi",
        ),
        ([flow(None, 1e-2, particle_count=32)], r"n 32, but .* has 64\..*: by n"),
        ([flow(None, 1e-2, tau1=1.0)], r"tau1 1\.0, but .* has 0\.4\. Give files of one kind\.$"),
        ([flow(None, 1e-2, dimension=3)], "dimension 3, but"),
        ([sheared(None, phi=0.9)], r"phi 0\.9, but .* has 0\.86\. Give quasistatic shear of the"),
        ([sheared(None, k=1.0)], r"k 1\.0, but"),
        ([sheared(None), sheared(None)], "as in shear in memory. Give each run once"),
        ([flow(None, 0.5, shear_stress_mean=np.nan)], "a rate or mean stress that is not finite"),
        ([flow(None, 0.5, shear_stress_error=0.0)], r"no error of the mean stress at rate 0\.5, which a fit"),
    ):
        with pytest.raises(InputError, match=says):
            read_groups([*flows, *more])
    with pytest.raises(InputError, match="quasistatic shear alone"):
        read_groups([sheared(None)])
    assert read_groups([*flows, flow(None, 1e-2, phi=0.86 + 1e-9, seed=9)])  # as a packing has it


def test_the_command_on_a_study(tmp_path, capsys):
    rows = []
    for phi in LAWS:
        for rate in RATES:
            name = f"{phi}-{rate:.3g}.h5"
            flow(tmp_path / name, rate, phi=phi)
            rows.append({"command": "flow", "state": "done", "file": name, "seconds": 0.1, "phi": phi})
    sheared(tmp_path / "qs.h5", phi=0.9, stress=5e-3)
    rows.append({"command": "shear", "state": "done", "file": "qs.h5", "seconds": 0.1, "phi": 0.9})
    (tmp_path / "table.csv").write_text(table_text(rows))
    out = tmp_path / "hb.h5"
    assert cli.main(["scaling", str(tmp_path), "--by", "phi", "--cut", "0.05", "--out", str(out)]) == 0
    lines, fit = capsys.readouterr().out.splitlines(), jampetsc.load(out)
    value, low, high = (fit[f"groups/yield_stress{end}"][1] for end in ("", "_low", "_high"))
    assert lines[0] == f"{out}: herschel-bulkley fit of 10 points, 95 % intervals"
    start = next(n for n, line in enumerate(lines) if line.startswith("  phi = 0.9: "))
    assert lines[start].startswith(f"  phi = 0.9: sigma_y = {value:.4g} ({low:.3g} to {high:.3g}), A = ")
    assert "(profile of chi2), chi2/dof = " in lines[start]
    assert lines[start + 1].startswith("    quasistatic sigma = 0.005 ± 0.00025; sigma_y is ")
    assert lines[start + 2].startswith(f"    rates <= {RATES[3]:.4g}: sigma_y = ")
    assert cli.main(["scaling", str(tmp_path), "--where", "phi=0.9", "--out", str(tmp_path / "one.h5")]) == 0
    one = jampetsc.load(tmp_path / "one.h5")
    assert len(one["groups/phi"]) == 1 and one["groups/quasistatic_shear_stress"][0] == 5e-3
    assert cli.main(["plot", str(out), "--out", str(tmp_path / "hb.png")]) == 0


def test_notes():
    """Of a yield stress that is not resolved, of a law that is wrong, of errors that are too large."""
    noisy = jampetsc.scaling(*(flow(None, rate, noise=0.3) for rate in RATES))
    assert "the yield stress is not resolved: its 95 % interval, from -" in noisy.attributes["notes"]
    wrong = jampetsc.scaling(*(flow(None, rate, noise=1e-3) for rate in RATES), form="bingham")
    assert (
        "the law does not describe the stresses within their errors: probability" in wrong.attributes["notes"]
    )
    exact = [flow(None, rate, shear_stress_mean=float(LAWS[0.86].stress(rate))) for rate in RATES]
    assert "chi2 is far too small" in jampetsc.scaling(*exact).attributes["notes"]
    flat = [flow(None, rate, shear_stress_mean=1.0 - 1e-3 * n) for n, rate in enumerate(RATES)]
    notes = jampetsc.scaling(*flat).attributes["notes"]
    assert "does not rise with the rate" in notes and "n is not determined" in notes


@pytest.mark.parametrize("make", [published, crystal], ids=["disks", "spheres"])
def test_real_flows_in_other_units(make):
    """σ_y over k, A over k τ₁ⁿ and n stay; in two and in three dimensions, with quasistatic shear in the first."""
    answers = []
    for k, tau1 in ((1.0, 1.0), (K, TAU1)):
        disks = make().replace(potential=Potential(k=k))
        model, rates = jampetsc.models.RD0(tau1=tau1), np.array([1e-2, 2e-2, 4e-2, 8e-2]) / tau1
        runs = [jampetsc.flow(disks, model=model, rate=rate, strain=0.5, discard=0.1) for rate in rates]
        fit = jampetsc.scaling(*runs)
        n = fit["groups/flow_index"][0]
        answers.append(
            [
                n,
                fit["groups/yield_stress"][0] / k,
                fit["groups/consistency"][0] / (k * tau1**n),
                *fit["pressure"] / k,
            ]
        )
        assert fit.attributes.get("dimension", 2) == disks.dimension
    assert np.allclose(*answers, rtol=1e-4)
