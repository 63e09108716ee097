"""A run of steady shear in memory: it is saved, resumed and extended to the last bit, and reports its checks."""

import numpy as np
from sheared import crowd, model

from jampetsc.flows import flow_run
from jampetsc.flows.flow_run import FlowRun, define_flow, run_flow


def same(one, other):
    """Whether two results have the same rows, snapshots and state."""
    pairs = [(a.trajectory.arrays() | a.state) for a in (one, other)]
    return pairs[0].keys() == pairs[1].keys() and all(
        np.array_equal(pairs[0][k], pairs[1][k]) for k in pairs[0]
    )


def test_a_run_is_resumed_from_what_it_saves(monkeypatch):
    monkeypatch.setattr(flow_run, "SAVE_INTERVAL", -1.0)  # after every row
    run = define_flow(crowd(16, phi=0.9), model("CD0"), 1e-2, 0.1, snapshots=4)
    saved, reports = [], []
    whole = run_flow(
        run,
        save=lambda trajectory, state: saved.append((trajectory.copy(), state)),
        report=lambda *numbers: reports.append(numbers),
    )
    assert [len(trajectory) for trajectory, _ in saved] == list(range(1, run.schedule.rows + 1))
    assert len(reports) == run.schedule.rows  # fewer than MAX_CHECKS: one for each row
    strains, means, left = zip(*reports, strict=True)
    assert strains[-1] == whole.trajectory.strain and left[-1] == 0.0
    assert means[0] is None and means[-1].pressure.mean == whole.means.pressure.mean
    reports.clear()
    resumed = run_flow(run, resume=saved[10], report=lambda *numbers: reports.append(numbers))
    assert same(resumed, whole) and len(reports) == run.schedule.rows - 11
    assert len(saved[10][0]) == 11  # what a run resumes is left as it is


def test_an_extended_run_is_the_longer_one():
    """Its settings are those before it ran, and can be read from plain values."""
    disks = crowd(16, phi=0.9)
    short, long = (define_flow(disks, model("RD0"), 1e-2, strain, discard=0.1) for strain in (1.0, 2.0))
    first = run_flow(short)
    run = FlowRun.of_settings(short.settings, disks).extended(first.trajectory, first.state, 1.0)
    before = run.settings
    assert same(run_flow(run), run_flow(long))
    assert run.settings == before and len(first.trajectory) == short.schedule.rows
