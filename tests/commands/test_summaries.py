"""What commands say when they have ended: the numbers of the run, and what a user has to know of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from jampetsc.analysis.collapse_fit import Estimate
from jampetsc.analysis.scaling_collapse import Points
from jampetsc.commands import collapse, correlate, modes, oscillate, quasistatic, sweep
from jampetsc.io.results import noted
from jampetsc.laws.damping import Physics, damping_law
from jampetsc.laws.equivalent_damping import EquivalentDamping
from jampetsc.laws.loads import LoadChoice
from jampetsc.studies import study_job

PHYSICS = Physics(damping_law())


SOURCE = SimpleNamespace(network=SimpleNamespace(pressure=2e-3, k=2.0), stress_scale=2.0)


def summary_of_sweep(omega, G, bounds, certified=True, alpha=None, stress=None):
    job = SimpleNamespace(physics=PHYSICS, alpha=alpha, stress=stress, load=LoadChoice("xy"))
    frequencies = sweep.SweepFrequencies(omega, omega + 3.0, omega[:0])
    return sweep._summary(job, "s.h5", None, frequencies, modulus_sweep(omega + 3.0, G, bounds), certified)


def modulus_sweep(omega, G, bounds):
    return SimpleNamespace(omega=omega, G=G, bounds=bounds, tensor=None)


def test_a_sweep_tells_its_ends_and_its_worst_errors():
    G = np.array([1 + 0.1j, 2 + 4j, 5 + 8j])
    bounds = np.array([[9, 1e-3, 1e-3], [9, 4e-2, 1e-3], [9, 1e-3, 8e-2]])
    lines = summary_of_sweep(np.array([0.1, 1.0, 10.0]), G, bounds).split("\n")
    assert lines == [
        "s.h5: contact damping, beta = 1, 3 frequencies, certified to 2.0e-02 in G' and 1.0e-02 in G''",
        "  omega 0.1: G' = 1, G'' = 0.1",
        "  omega 10: G' = 5, G'' = 8",
    ]
    one = summary_of_sweep(np.ones(1), G[:1], bounds[:1], certified=False).split("\n")
    assert len(one) == 2 and "1 frequencies, estimated to" in one[0]


@pytest.mark.parametrize(("stress", "told"), [(1.8e-3, False), (2.2e-3, True)])
def test_a_strain_that_would_change_contacts(stress, told):
    """σ₀/|G| of the softest frequency against p/k = 1e-3."""
    omega = np.array([1.0, 2.0])
    G, bounds = np.array([4.0 + 0j, 2.0j]), np.ones((2, 3))
    said = summary_of_sweep(omega, G, bounds, alpha=0.5, stress=stress)
    assert "equivalent linear frequencies 4 to 5; the stored" in said
    job, damping = SimpleNamespace(stress=stress, load=LoadChoice("xy")), EquivalentDamping(0.5, stress / 2.0)
    notes = sweep.notes_of(job, SOURCE, omega, modulus_sweep(omega, G, bounds), damping)
    assert [
        f"strain amplitude up to {stress / 2:.1e}, more than p/k = 1.0e-03" in note for note in notes
    ] == [True] * told
    notes = sweep.notes_of(job, SOURCE, omega, modulus_sweep(omega, -G, bounds), damping)
    assert notes[-1].startswith("G* is formal: G' < 0")


def test_a_modulus_below_its_bound_below_zero_is_noted():
    omega, bounds, job = np.array([1e-3, 1.0]), np.full((2, 3), 0.01), SimpleNamespace(load=LoadChoice("xy"))
    found = [modulus_sweep(omega, np.array([real + 1j, 1.0]), bounds) for real in (-0.02, -0.005)]
    (note,) = sweep.notes_of(job, SOURCE, omega, found[0], None)
    assert note.startswith("unstable to shear: G' at omega 0.001 = -0.02. ") and "--stabilise shear" in note
    assert sweep.notes_of(job, SOURCE, omega, found[1], None) == []


def test_modes_tell_how_they_were_counted():
    found = SimpleNamespace(
        eigenvalues=np.array([0.25, 0.5, 2.0]), residuals=np.array([1e-9, 3e-9, 2e-9]),
        floppiness=np.array([5.0, 3.0, 1.0]),
        complete=False, inertia_count=3, inertia_shift=2.5, network=SimpleNamespace(prestress=False),
        contributions=SimpleNamespace(share={
            "modulus": np.array([0.25, 0.125, 0.0]), "nonaffine": np.array([0.5, 0.25, 0.125]),
            "normal": np.array([0.25, 0.0, 0.0]), "transverse": np.array([0.5, 0.125, 0.125]),
        }),
    )  # fmt: skip
    assert modes._summary("m.h5", found).split("\n") == [
        "m.h5: 3 modes, no pre-stress; inertia counts 3 below 2.5",
        "  eigenvalues 0.25 to 2, residuals ≤ 3.0e-09",
        "  floppiness (rms Δu⊥ / Δu∥) 5 to 1",
        "  together 87.5 % of |u_na|², 75 % of Δu⊥², 25 % of Δu∥², 37.5 % of G_affine − G0",
    ]
    found.complete, found.contributions, found.network.prestress = True, None, True
    lines = modes._summary("m.h5", found).split("\n")
    assert lines[0] == "m.h5: 3 modes, pre-stress; all of them"
    assert len(lines) == 3
    assert modes._notes(found) == [
        "no shares of the response: it is affine, or not unique because of zero modes"
    ]


def test_a_study_tells_what_failed_and_what_its_runs_noted():
    notes = ["few: 7", "unstable to shear: G0 = -1"], ["few: 9"], [], []
    rows = [
        {"file": f"{n}.h5", "command": "pack" if n == 3 else "sweep"} | ({"notes": noted(one)} if one else {})
        for n, one in enumerate(notes)
    ]
    failures = [{"file": f"{n}.h5", "state": "failed: no"} for n in range(study_job.MAX_LISTED_FAILURES + 2)]
    lines = study_job._summary("t.csv", rows, failures, "3 s").split("\n")
    assert lines[:2] == [
        f"t.csv: 4 tasks, {study_job.MAX_LISTED_FAILURES + 2} failed, 3 s",
        "  0.h5: failed: no",
    ]
    assert lines[study_job.MAX_LISTED_FAILURES + 1 :] == [
        "  … and 2 more, see the table",
        "  note in 2 of 3 sweep tasks, which count like the others: few: 7 (0.h5)",
        "  note in 1 of 3 sweep tasks, which count like the others: unstable to shear: G0 = -1 (0.h5)",
    ]
    exactly = study_job._summary("t.csv", [], failures[: study_job.MAX_LISTED_FAILURES], "3 s")
    assert "more, see" not in exactly and exactly.count("failed: no") == study_job.MAX_LISTED_FAILURES


def test_an_oscillation_tells_both_ends_of_its_frequencies():
    omega = np.array([0.1, 1.0, 10.0])
    asked = SimpleNamespace(
        alpha=1.0,
        physics=PHYSICS,
        amplitude=np.array([1e-6]),
        omega=omega,
        control="strain",
        load=LoadChoice("xy"),
    )
    arrays = {
        "G": np.array([[1 + 1j, 2 + 2j, 3 + 4j]]), "error": np.array([[1e-3, 1e-3, 1e-1]]),
        "energy_balance": np.array([[1e-9, -2e-8, 1e-9]]), "harmonics": np.array([[[0.1j, 0], [0.5, 0], [0.02, 0]]]),
    }  # fmt: skip
    lines = oscillate._summary(asked, "o.h5", arrays).split("\n")
    assert "alpha = 1, 3 oscillations, estimated to 2.0e-02 of |G*|, energy balanced to 2e-08" in lines[0]
    assert lines[1:] == [
        "  strain 1e-06, omega 0.1: G' = 1, G'' = 1, third harmonic 10 %",
        "  strain 1e-06, omega 10: G' = 3, G'' = 4, third harmonic 2 %",
    ]


def test_a_quasistatic_response_tells_its_parts():
    flow = SimpleNamespace(parts={"contacts": 0.25, "fluid": 0.5}, eta0=0.75)
    medians = {"normal": 1.0, "transverse": 2.0, "nonaffine": 3.0}
    found = {key: SimpleNamespace(median=value) for key, value in medians.items()}
    numbers = {"G0": 0.5, "bulk_modulus": 4.0, "omega_star": 0.1, "identity_difference": 1e-12}
    response = SimpleNamespace(network=SimpleNamespace(prestress=True), flow=flow, **numbers)
    outcome = SimpleNamespace(eta_inf=0.5, responses={"": response}, distributions={"": found}, tensors={})
    assert quasistatic._summary("q.h5", PHYSICS, outcome).split("\n") == [
        "q.h5: contact damping, beta = 1, eta_inf = 0.5",
        "  pre-stress: G0 = 0.5, bulk modulus 4, eta0 = 0.75 (contacts 0.25, fluid 0.5), omega* = 0.1",
        "    medians per unit strain: |Δu∥| 1, |Δu⊥| 2, |u_na| 3; identity kept to 1e-12",
    ]


@pytest.mark.parametrize(("finite_size", "scale"), [(False, 1e-3), (True, 0.125)])
def test_a_collapse_tells_its_parameters_those_of_every_cut_and_notes(finite_size, scale):
    def cut(scale, chi2, y, *errors):
        values = {"phi_J": 0.8433, "y": y, "kappa": 3.5}
        fit = SimpleNamespace(parameters=values, chi2=chi2, dof=20, probability=0.5)
        found = zip(values.items(), errors, strict=True)
        return scale, fit, {name: Estimate(one, one - 2 * e, one + 2 * e, 0.0) for (name, one), e in found}

    job = SimpleNamespace(observable="pressure", finite_size=finite_size)
    cuts = [cut(0.5, 30.0, 1.1, 0.01, 0.2, 1.0), cut(scale, 10.0, 1.5, 1e-3, 0.1, np.inf)]
    # L of spheres: the line has their number
    points = Points(*np.full((4, 7), scale), size=np.where(np.arange(7) < 6, 512.0, 64.0))
    points.scale[:6] = 0.5
    nu, what = ("nu", "N >= 64") if finite_size else ("znu", "rates <= 0.001")
    assert collapse._summary("c.h5", job, points, cuts, ["one", "two"]).split("\n") == [
        f"c.h5: pressure at 7 points, phi_J = 0.8433 ± 0.01, y = 1.1 ± 0.2, {nu} = 3.5 ± 1",
        "  chi2/dof = 1.5 with 20 degrees of freedom, probability 0.5",
        f"  {what}: phi_J = 0.8433 ± 0.001, y = 1.5 ± 0.1, {nu} undecided, chi2/dof = 0.5",
        "  note: one",
        "  note: two",
    ]


def test_lanes_of_other_widths_are_compared_with_errors_of_both():
    def result(values, errors):
        C, e = (np.array([[one, x, np.nan]] * 2) for one, x in ((1.0, values), (0.0, errors)))
        root, error = np.array([0.1, np.nan]), np.array([0.01, 0.02])
        return SimpleNamespace(values=C, errors=e, pairs=9, root=root, root_error=error)

    results = [result(0.5, 0.03), result(0.7, 0.04), result(np.nan, 0.1)]
    lines = correlate._sweep_summary("c.h5", 1, np.array([1e-3]), "strain", [0.5, 1.0, 2.0], results, 20.0)
    assert lines.split("\n") == [
        "c.h5: 1 packing, L = 20 d, lanes of 0.5 d, 9 pairs, in phase with the strain",
        "  omega 0.001: l/d Re 2 ± 0.2,  Im no root",
        "  lanes of 1 d: C differs by 0.2 (rms), with errors of 0.05",
        "  lanes of 2 d: C cannot be compared",
    ]
