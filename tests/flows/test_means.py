"""Results of a run of steady shear: rows and snapshots, means, balance of energy, warnings, checkpoint."""

from dataclasses import replace

import numpy as np
import pytest
from samples import stored
from sheared import crowd, shear

from jampetsc.analysis.velocity_correlation import LaneCorrelation
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.flows import flow_run
from jampetsc.flows.flow_run import Schedule, add_row, check_balance
from jampetsc.flows.trajectory import FLOW_COLUMNS, MIN_CHECKED_ROWS, WALL_AVERAGES, Means, Trajectory
from jampetsc.io.disk_motion import correlate_lanes
from jampetsc.io.reader import load
from jampetsc.packing.contacts import find_contacts, measure

RATE, AREA, SPACING = 0.1, 30.0, 0.02


def recorded(rows, lost=1.0, loss=0.5, stress=(2.0, 0.3), with_walls=False):
    """Rows of a run whose stress grows steadily; it dissipates `loss`, but records `lost` times as much.

    The energy takes the rest of the work; a row has its mean, of a parabola here.
    """
    record, step = Trajectory(with_walls), SPACING / RATE
    first, slope = stress
    for row in range(rows):
        t = (row + 0.5) * step
        xy = first + slope * t
        mean_square = t * t + step * step / 12.0
        energy = 7.0 + RATE * AREA * (first * t + 0.5 * slope * mean_square) - loss * t
        values = dict.fromkeys(record.columns, 1.0) | {
            "strain": (row + 1) * SPACING,
            "shear_stress": [0.5 * xy, 0.3 * xy, 0.2 * xy],
            "pressure": [1.0, 2.0, 3.0],
            "energy": energy,
            "dissipation": lost * loss,
            "contact_number": 4.0 + row,
        }
        record.add(**values)
    return record


def means(record, discard=0.0):
    return Means.of(record, discard, RATE, AREA)


def test_work_is_dissipated_or_stored():
    found = means(recorded(40))
    assert abs(found.mismatch) < 1e-13
    assert found.energy_balance == pytest.approx(RATE * AREA * found.shear_stress.mean / 0.5)
    for lost in (0.9, 1.2):
        assert means(recorded(40, lost)).mismatch == pytest.approx((1.0 - lost) / lost)
    assert means(recorded(40, 1.2), discard=0.2).mismatch == pytest.approx(-1 / 6)


def test_the_balance_is_not_checked_for_few_rows_or_without_dissipation():
    few, enough = means(recorded(MIN_CHECKED_ROWS - 1, 1.2)), means(recorded(MIN_CHECKED_ROWS, 1.2))
    assert np.isnan(few.mismatch) and "energy balance not checked: " in few.warnings()[-1]
    assert enough.mismatch == pytest.approx(-1 / 6) and "not checked" not in str(enough.warnings())
    found = means(recorded(40, lost=0.0))
    assert np.isnan(found.energy_balance) and np.isnan(found.mismatch)


def test_means_are_over_rows_after_discard():
    record = recorded(10)
    stress, pressure = record.column("shear_stress"), record.column("pressure")
    assert stress.shape == pressure.shape == (10, 3)
    for discard, first in ((0.0, 0), (3 * SPACING, 3), (3 * SPACING * (1 + 1e-13), 3), (3.01 * SPACING, 3)):
        found = means(record, discard)
        assert found.shear_stress.mean == pytest.approx(stress[first:].sum(1).mean())
        assert found.pressure.mean == 6.0 and found.contact_number.mean == np.mean(4.0 + np.arange(first, 10))
        np.testing.assert_allclose(found.parts, stress[first:].mean(0))
        assert [found.strain, found.spacing] == pytest.approx([(10 - first) * SPACING, SPACING])
        assert found.facts()["correlation_strain"] == pytest.approx(found.shear_stress.time * SPACING)
    assert means(record, 10 * SPACING) is None
    assert means(record, 9.5 * SPACING).strain == pytest.approx(SPACING)
    assert means(recorded(1)).spacing == SPACING
    assert not found.walls
    beside = recorded(10, with_walls=True)
    assert set(means(beside).walls) == set(WALL_AVERAGES)
    assert means(beside).facts()["wall_pressure_mean"] == 1.0


def test_a_run_that_is_not_steady_is_warned_of():
    def warnings(stress, pressure):
        record, noise = Trajectory(), np.random.default_rng(1).normal(0, 0.1, (1000, 2))
        for row in range(1000):
            values = dict.fromkeys(FLOW_COLUMNS, 1.0) | {
                "strain": (row + 1) * SPACING,
                "shear_stress": [1.0 + stress * (row > 500) + noise[row, 0], 0.0, 0.0],
                "pressure": [1.0 + pressure * (row > 500) + noise[row, 1], 0.0, 0.0],
            }
            record.add(**values)
        return means(record).warnings()

    assert warnings(0.0, 0.0) == []
    for drifts in (warnings(0.05, 0.0), warnings(0.0, 0.05)):
        assert len(drifts) == 1 and drifts[0].startswith("slow changes, or not steady yet: ")
    short = means(recorded(30)).warnings()
    assert "strain 0.6 after discard is short for a correlation strain of about" in short[0]


@pytest.mark.parametrize("lost, balanced", [(0.96, True), (1.04, True), (0.94, False), (1.07, False)])
def test_too_much_and_too_little_dissipation_are_errors(lost, balanced):
    run = shear("RD0", crowd(16), rate=RATE)
    scale = run.reference.volume / AREA  # the record's cell is another one
    record = recorded(40)
    for name, factor in (("shear_stress", 1.0 / scale), ("dissipation", lost)):
        record.rows[name] = [factor * np.array(value) for value in record.rows[name]]
    if balanced:
        assert check_balance(record, 0.0, run).energy_balance > 0
    else:
        with pytest.raises(ConvergenceError, match=r"differ by -?[67] % in the mean .*: give a smaller step"):
            check_balance(record, 0.0, run)
    assert check_balance(record, 1.0, run) is None


@pytest.mark.parametrize(
    ("given", "steps", "rows"),
    [
        ((1e-2, 0.1, 1.0), 10, 100),  # a row is a strain of 0.01
        ((1e-2, 0.1, 0.1), 2, 50),  # or a fiftieth of a short run
        ((1e-2, 0.1, 1e-3), 1, 1),
        ((0.1, 1.0, 1.1), 1, 11),  # 1.1/0.1 is 11.000000000000002
        ((0.1, 1.0, 1.101), 1, 12),
        ((1.0, 1e-12, 1.0), 10**10, 100),  # as many time steps as there may be
    ],
)
def test_rows_of_a_run(given, steps, rows):
    plan = Schedule.of(*given, 0.0)
    assert (plan.steps, plan.rows) == (steps, rows)
    assert Schedule.of(*given, 0.0, steps=3 * steps).steps == 3 * steps


def test_a_row_is_no_longer_than_the_strain_between_snapshots():
    plan = Schedule.of(1e-2, 0.1, 1.0, 0.9, every=3.5e-3)
    assert plan.steps == 3 and plan.every == pytest.approx(3.5 / 3.0)
    assert Schedule.of(1e-2, 0.1, 1.0, 0.9, every=0.03).steps == 10


def test_more_steps_or_snapshots_than_there_can_be():
    with pytest.raises(InputError, match=r"strain 1.01: 1e\+12 time steps of 1e-12 \(at most 1e\+12\)"):
        Schedule.of(1.0, 1e-12, 1.01, 0.0)
    row = 0.1
    assert Schedule.of(0.1, 1.0, 1.0, 3 * row, 7).first_averaged_row(row) == 3  # 0.3/0.1 is less than 3
    for refused, words in (
        ("snapshots 8: 7 rows after discard, each with at most one", {"snapshots": 8}),
        ("snapshots 2: must be at least 3", {"snapshots": 2, "spacing": "log"}),
        ("snapshot_every 0.09: must be at least the strain of a time step, 0.1, and .* 0.7", {"every": 0.09}),
        ("snapshot_every 0.71: must be", {"every": 0.71}),
    ):
        with pytest.raises(InputError, match=refused):
            Schedule.of(0.1, 1.0, 1.0, 3 * row, **words)


@pytest.mark.parametrize(
    ("discard", "words", "rows", "further"),
    [
        (0.4, {"snapshots": 3}, [6, 8, 10], [12, 14]),
        (0.4, {"snapshots": 6}, [5, 6, 7, 8, 9, 10], [11, 12, 13, 14, 15]),
        (0.4, {"snapshots": 1}, [10], []),
        (0.0, {"snapshots": 3}, [0, 5, 10], [15]),  # without discard the start is one of several
        (0.0, {"snapshots": 2}, [0, 10], []),
        (0.0, {"snapshots": 1}, [10], []),
        (0.0, {"every": 1.0}, [0, 10], []),
        (0.4, {"every": 0.25}, [6, 9], [12, 14]),  # 2.5 rows, to even ones
        (0.0, {"snapshots": 5, "spacing": "log"}, [0, 1, 2, 5, 10], []),
        (0.2, {"snapshots": 5, "spacing": "log"}, [2, 3, 4, 6, 10], []),
    ],
)
def test_snapshots_of_a_continued_run_keep_their_spacing(discard, words, rows, further):
    plan = Schedule.of(0.1, 1.0, 1.0, discard, **words)
    first = plan.first_averaged_row(0.1)
    assert sorted(plan.snapshot_rows(first)) == rows
    assert sorted(replace(plan, rows=15).snapshot_rows(first)) == rows + further


def test_a_row_has_means_over_its_steps():
    """Stress, pressure and energy of the packing at its time steps; contacts at the end."""
    run, record = shear("RD0", crowd(16, phi=0.9), rate=RATE, step=0.01), Trajectory()
    state = measure(run.disks)
    add_row(record, run, 1)
    row = {name: record.column(name)[0] for name in FLOW_COLUMNS}
    assert row["shear_stress"] == pytest.approx([state.stress[0, 1], 0.0, 0.0], rel=1e-9)
    assert row["pressure"] == pytest.approx([state.pressure, 0.0, 0.0], rel=1e-9)
    assert row["energy"] == pytest.approx(state.energy, rel=1e-9)
    assert row["strain"] == pytest.approx(1e-3) and row["time"] == pytest.approx(0.01)
    add_row(record, run, 3)
    contacts = find_contacts(run.disks)
    assert record.column("time") == pytest.approx([0.01, 0.04]) and run.tally[-1] == 3
    assert record.column("contact_number")[1] == 2 * len(contacts) / 16
    assert record.column("deepest_overlap")[1] == pytest.approx(np.max(contacts.overlap / contacts.sigma))
    assert record.column("pressure")[1, 0] == pytest.approx(measure(run.disks).pressure, rel=0.1)


def test_steps_are_taken_in_batches(monkeypatch):
    """A row of many steps takes several calls, between which signals are handled."""
    monkeypatch.setattr(flow_run, "MAX_CALL_STEPS", 4)
    run, asked = shear("RD0", crowd(16), rate=RATE, step=0.01), []
    monkeypatch.setattr(type(run), "advance", lambda _, steps: asked.append(steps) or run.tally.__iadd__(1.0))
    for steps in (3, 4, 11):
        asked.clear()
        add_row(Trajectory(), run, steps)
        assert asked == [4] * (steps // 4) + [steps % 4] * (steps % 4 > 0)


def flow_file(path, velocity=0.1, phi=0.8, walls=False, snapshots=2, **facts):
    """A flow file with snapshots of 30 disks, its disks at random places with u_y = ±velocity."""
    rng = np.random.default_rng(1)
    cell = np.array([[8.0, 0.0], [1.0, 6.0]])
    common = {"model": "RD0", "rate": 0.1, "particle_count": 30, "mass": 0.0, "phi": phi}
    arrays = {"snapshots/positions": rng.random((snapshots, 30, 2)) @ cell, "state/radii": np.full(30, 0.25)}
    arrays |= {"snapshots/velocities": velocity * rng.choice([-1.0, 1.0], (snapshots, 30, 2))}
    arrays |= {"snapshots/cell": np.array([cell] * snapshots), "snapshots/radii": arrays["state/radii"]}
    return load(stored(path, "flow", arrays, **common | facts | ({"walls": 4} if walls else {})))


@pytest.mark.filterwarnings("error")
def test_a_bin_without_pairs_has_no_value(tmp_path):
    found = correlate_lanes([flow_file(tmp_path / "one.h5")], 0.4, 0.5)
    empty = found.pairs == 0
    assert empty.any() and not empty.all()
    np.testing.assert_array_equal(np.isnan(found.values), empty)
    np.testing.assert_array_equal(np.isnan(found.errors), empty)


def test_faster_motions_alone_are_no_error_of_a_correlation(tmp_path):
    """The same places and directions in all snapshots at different speeds: g_y is the same in each of them."""
    one = flow_file(tmp_path / "one.h5", snapshots=1)
    places, u, cells = (one[f"snapshots/{name}"] for name in ("positions", "velocities", "cell"))
    speeds = np.random.default_rng(2).uniform(0.5, 2.0, (40, 1, 1))
    arrays = {
        "positions": np.repeat(places, 40, 0),
        "velocities": speeds * u,
        "cell": np.repeat(cells, 40, 0),
    }
    arrays = {f"snapshots/{name}": values for name, values in arrays.items()} | {
        "state/radii": np.full(30, 0.25)
    }
    arrays["snapshots/radii"] = arrays["state/radii"]
    faster = load(stored(tmp_path / "faster.h5", "flow", arrays, **dict(one.attributes)))
    found = correlate_lanes([faster], 4, 2)
    np.testing.assert_allclose(found.values, correlate_lanes([one], 4, 2).values)
    assert (found.errors < 1e-12).all() and max(found.minimum_errors) < 1e-12


def test_correlated_files_are_of_one_kind(tmp_path):
    one = flow_file(tmp_path / "one.h5")
    found = correlate_lanes([one, one], 2, 2)
    assert found.snapshots == 4 and found.mean_square == pytest.approx(1.0) and len(found.values) == 4
    np.testing.assert_allclose(found.values, correlate_lanes([one], 2, 2).values)
    for name, value in (("model", "CD0"), ("rate", 0.2), ("particle_count", 31), ("mass", 1.0)):
        other = flow_file(tmp_path / "other.h5", **{name: value})
        with pytest.raises(
            InputError, match=rf"other.h5: {name} {value}, but one.h5 has .*\. Average flows of one kind\."
        ):
            correlate_lanes([one, other], 2, 2)
    correlate_lanes([one, flow_file(tmp_path / "near.h5", phi=0.8 + 9e-7)], 2, 2)
    with pytest.raises(InputError, match=r"far.h5: another phi than one.h5"):
        correlate_lanes([one, flow_file(tmp_path / "far.h5", phi=0.8 + 2e-6)], 2, 2)
    for velocity in (0.0, 1e-15):
        with pytest.raises(InputError, match=r"crystal.h5: \|u_y\| is rounding, .*Give another flow"):
            correlate_lanes([flow_file(tmp_path / "crystal.h5", velocity=velocity)], 2, 2)
    with pytest.raises(InputError, match=r"walls.h5: a flow between walls, which is not homogeneous"):
        correlate_lanes([flow_file(tmp_path / "walls.h5", walls=True)], 2, 2)


def test_errors_of_a_correlation_are_those_between_snapshots(tmp_path):
    """Without correlation the values differ from zero by about their errors; a disk alone in its lane has no pairs."""
    found = correlate_lanes([flow_file(tmp_path / "many.h5", snapshots=60)], 4, 0.4)
    assert len(found.values) == 20 and (found.errors > 0).all()
    assert 0.6 < np.sqrt(np.mean((found.values / found.errors) ** 2)) < 1.6
    lone = correlate_lanes([flow_file(tmp_path / "one.h5", snapshots=1)], 0.004, 8)
    assert lone.pairs[0] in (0, 1, 2) and np.isnan(lone.values[0]) == (lone.pairs[0] == 0)


def test_lanes_and_bins_that_fit(tmp_path):
    one = flow_file(tmp_path / "one.h5")  # half of the cell is 4 wide and 3 high
    assert len(correlate_lanes([one], 11.996, 8).values) == 1
    assert len(correlate_lanes([one], 2, 8 / 93).values) == 93  # whole bins, for all rounding
    assert len(correlate_lanes([one], 2, 3).values) == 2
    for lane in (12.0, float("nan")):
        with pytest.raises(InputError, match=r"must be less than the height of the cell, 12 mean diameters"):
            correlate_lanes([one], lane, 2.0)
    for width in (8.001, float("nan")):
        with pytest.raises(InputError, match=r"must be at most half the width of the cell, 8 mean diameters"):
            correlate_lanes([one], 2.0, width)


@pytest.mark.parametrize(
    ("values", "where", "least"),
    [
        ([1.0, 0.2, -0.3, -0.1, 0.4], 2.5 + 0.5 * (0.2 + 0.1) / (0.2 + 0.6 - 0.1), -0.3),  # of the parabola
        ([-0.5, 0.2, 0.3, 0.1, 0.4], 0.5, -0.5),  # at an end there is none
        ([1.0, 0.2, 0.3, 0.1, -0.4], 4.5, -0.4),
        ([1.0, 0.2, -0.3, np.nan, 0.4], 2.5, -0.3),
        ([np.nan, 0.2, -0.3, -0.3, -0.3], 2.5 + 0.5 * (0.2 + 0.3) / (0.2 + 0.6 - 0.3), -0.3),
    ],
)
def test_where_the_correlation_is_least(values, where, least):
    edges, count = np.arange(6.0), np.ones(5)
    found = LaneCorrelation(edges, np.array(values), count, count, 1.0, 1, 1.0)
    assert found.minimum == (pytest.approx(where), least)
