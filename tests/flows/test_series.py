"""The series of a flow in finer rows: the same flow, with the state at γ = 0, also after a kill and from a file."""

import numpy as np
import pytest
from samples import published
from sheared import crowd, model, spheres, stop_after

import jampetsc
from jampetsc import main as cli
from jampetsc.errors import InputError
from jampetsc.flows.flow_run import Schedule, define_flow, run_flow
from jampetsc.packing.contacts import measure
from jampetsc.packing.potentials import Potential

STARTS = {
    "RD0": crowd(16, phi=0.9),
    "CD0": spheres(16),
    "CDn": crowd(16, phi=0.9).replace(potential=Potential(k=2.5)),
    "rolling": crowd(16, phi=0.9),
}


@pytest.mark.parametrize("name", STARTS)
def test_finer_rows_are_of_the_same_flow(name):
    """Their means are those of the rows by default, and the state at the end is the same."""
    disks = STARTS[name]
    run = define_flow(disks, model(name), 1e-2, 0.2, step=0.05)
    fine = define_flow(disks, model(name), 1e-2, 0.2, step=0.05, series=1e-3)
    assert run.schedule.steps == 8 and fine.schedule.steps == 2
    one, other = run_flow(run), run_flow(fine)
    close = (
        np.allclose if run.model.mass else np.array_equal
    )  # Verlet predicts velocities again after each row
    assert all(close(one.state[key], other.state[key]) for key in one.state if key != "tally")
    rows, parts = one.trajectory.arrays(), other.trajectory.arrays()
    assert parts["strain"][0] == pytest.approx(1e-3) and np.allclose(parts["strain"][3::4], rows["strain"])
    for key in ("shear_stress", "pressure", "energy", "dissipation"):
        means = parts[key].reshape(len(rows[key]), 4, -1).mean(axis=1).reshape(rows[key].shape)
        assert np.allclose(means, rows[key], rtol=1e-9, atol=1e-13)
    assert np.array_equal(parts["contact_number"][3::4], rows["contact_number"])
    assert other.means.shear_stress.mean == pytest.approx(one.means.shear_stress.mean, rel=1e-9)
    assert not [key for key in rows if key.startswith("start/")]


@pytest.mark.parametrize("name", STARTS)
def test_the_state_at_no_strain(name):
    """Elastic stress, pressure and energy of the start; all terms those of a first row of one time step."""
    disks = STARTS[name]
    flow = run_flow(define_flow(disks, model(name), 1e-2, 0.02, step=0.05, series=5e-4))
    start, rows, state = flow.trajectory.start, flow.trajectory.arrays(), measure(disks)
    assert start["shear_stress"][0] == pytest.approx(state.stress[0, 1], rel=1e-9)
    assert start["pressure"][0] == pytest.approx(state.pressure, rel=1e-9)
    for key in ("shear_stress", "pressure", "energy", "dissipation"):
        assert np.allclose(start[key], rows[key][0], rtol=1e-12, atol=1e-15)
    if name != "CDn":
        assert start["energy"] == pytest.approx(state.energy, rel=1e-9)


def test_a_killed_series_continues_to_the_last_bit(tmp_path, monkeypatch):
    left = stop_after(monkeypatch, 0)
    words = "flow --n 16 --phi 0.88 --model RD0 --rate 1e-2 --strain 0.1 --series 4e-3 --out".split()
    for left[0], name, status in ((0, "whole", 0), (12, "out", 130), (0, "out", 0)):
        assert cli.main([*words, str(tmp_path / f"{name}.h5")]) == status
    whole, out = (jampetsc.load(tmp_path / f"{name}.h5") for name in ("whole", "out"))
    assert set(whole) == set(out) and all(np.array_equal(whole[name], out[name]) for name in whole)
    assert whole["start/shear_stress"].shape == (3,) and whole["start/energy"].shape == ()
    more = jampetsc.flow(whole, strain=0.1)
    assert np.allclose(np.diff(more["strain"]), 4e-3) and len(more["strain"]) == 2 * len(whole["strain"])
    assert np.array_equal(more["start/pressure"], whole["start/pressure"])


def test_results_without_units_stay():
    """k and τ₁ other than 1, the series in strain."""
    answers = []
    for k, tau1 in ((1.0, 1.0), (2.5, 0.4)):
        disks = published().replace(potential=Potential(k=k))
        law = jampetsc.models.CD0(tau1=tau1)
        flow = jampetsc.flow(disks, model=law, rate=0.01 / tau1, strain=0.1, series=5e-3)
        answers.append([flow[name] / k for name in ("start/shear_stress", "start/pressure", "shear_stress")])
    assert all(np.allclose(*pair, rtol=1e-6, atol=1e-12) for pair in zip(*answers, strict=True))


def test_rows_that_cannot_be():
    how = {"rate": 1e-2, "step": 0.1, "strain": 1.0, "discard": 0.5}
    assert Schedule.of(**how, series=1e-3).steps == 1 and Schedule.of(**how, series=9.9e-3).steps == 9
    for series, says in (
        (9e-4, "at least the strain of a time step, 0.001"),
        (0.011, "at most .* without it, 0.01$"),
    ):
        with pytest.raises(InputError, match=says):
            Schedule.of(**how, series=series)
    with pytest.raises(InputError, match=r"1e\+07 rows \(at most 1e\+06\). Give a larger"):
        Schedule.of(1e-6, 0.1, 10.0, 1.0, series=1e-6)
