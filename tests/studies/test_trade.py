"""The trade: real runs at N = 64, what is made of them, and the advice that follows from rows."""

import csv
from dataclasses import fields, replace

import launch
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.image import imread
from samples import published, stored

from jampetsc import main as cli
from jampetsc.analysis.power_laws import CRITICAL_START
from jampetsc.analysis.statistics import half_width
from jampetsc.errors import ConvergenceError, InputError, JampetscError
from jampetsc.io.outlet import Outlet
from jampetsc.io.packing_file import read_packing, write_packing
from jampetsc.laws.damping import Physics, damping_law
from jampetsc.options.values import format_numbers
from jampetsc.packing.packing import Packing
from jampetsc.petsc import launchers
from jampetsc.progress import Progress
from jampetsc.studies import trade_process, trade_report, trade_runs
from jampetsc.studies.trade_errors import ReferenceCurve, log_interpolate
from jampetsc.studies.trade_job import Trade
from jampetsc.studies.trade_report import TradeRow, advise

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib

OMEGA = "1e-2:10:16"  # six of them in the critical window of p = 1e-3


def rows_of(path):
    """The rows of a written table as dictionaries of text, by the name of the choice."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return {(row["group"], row["choice"]): row for row in csv.DictReader(lines)}


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trade")
    launch.run_lines(folder, ["pack --n 64 --pressure 1e-3 --out p.h5".split()])
    return folder / "p.h5"


@pytest.fixture
def clean(monkeypatch):
    """The environment of child processes as `launch` makes it."""
    for name, value in launch.environment().items():
        monkeypatch.setenv(name, value)


def asked(packing="p.h5", **changes):
    return Trade(str(packing), **{"omega": "1e-8:10:91", "choices": []} | changes)


def bench_of(folder, *asked_, **changes):
    with Progress(None, "trade") as progress:
        return trade_runs.TradeRuns(asked(*asked_, **changes), folder, progress)


# The whole of it


def test_trade_of_a_packing(packing, tmp_path):
    (tmp_path / "broken.opts").write_text("-freq_pc_type none_such\n")
    words = ["trade", str(packing), "--out", "t.csv", "--omega", OMEGA, "--choices", "method"]
    said = launch.run_lines(tmp_path, [[*words, "--options-files", "broken.opts"]])
    rows = rows_of(tmp_path / "t.csv")
    assert [group for group, _ in rows] == ["reference", *["method"] * 2]
    reference = next(row for (group, _), row in rows.items() if group == "reference")
    direct = rows["method", "direct, MUMPS"]
    bounds = float(reference["certified"]) + float(direct["certified"])
    for part in ("storage", "loss"):
        assert float(direct[f"error_{part}"]) <= bounds < 1e-8
        assert direct[f"exponent_{part}"] == pytest.approx(reference[f"exponent_{part}"])
    assert direct["factorisations"] == "16" and float(direct["memory_mb"]) > 10
    assert 0 < float(direct["seconds"]) <= float(direct["process_seconds"])
    broken = rows["method", "direct, broken.opts"]
    assert broken["failed"] == "1" and broken["note"].startswith("failed: ") and "\n" not in broken["note"]
    assert broken["seconds"] == broken["error_storage"] == ""
    assert "for a figure" in said and "broken.opts" in said
    assert imread(tmp_path / "t.png").std() > 0.01
    assert sorted(path.name for path in tmp_path.iterdir()) == ["broken.opts", "t.csv", "t.png"]


def with_record(path, n=64, **record):
    rng = np.random.default_rng(1)
    disks = Packing.from_positions(rng.random((n, 2)) * 9, np.full(n, 0.5), 9.0 * np.eye(2), record=record)
    write_packing(path, disks)
    return path


def test_what_can_be_known_to_be_wrong_is_said_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    with_record("p.h5", 16)
    for name, content in {"t.csv": b"1,2\n", "t.png": b"\x89PNG\r\n"}.items():
        (tmp_path / name).write_bytes(content)
    good = asked()
    good.check_outputs(Outlet("t.csv"))  # a table and a picture may be made anew
    with pytest.raises(InputError, match="--ranks 3: neither mpirun nor mpiexec in PATH"):
        cli.dispatch("trade p.h5 --out t.csv --ranks 3".split())
    monkeypatch.setattr(launchers, "has_several_ranks", lambda: True)
    with pytest.raises(InputError, match="Run it without mpirun, with ranks"):
        good.check_outputs(Outlet("t.csv"))


# Its runs


def test_ranks_ensemble_and_frequencies(packing, tmp_path, clean):
    bench = bench_of(tmp_path, packing, omega=OMEGA, choices=["physics", "frequencies"], ranks=1)
    bench.find_reference()
    bench.job = replace(bench.job, ranks=None)
    assert bench.reference.window[0] >= 0.99 * CRITICAL_START * 1e-3 and bench.reference.certified < 1e-8
    plan, left_out = trade_runs.plan_settings(bench)
    physics, grids = plan[:3], plan[3:]
    assert [choice.name for choice in physics][2:] == ["Stokes drag, eta_f = 0"] and not left_out
    assert [choice.name for choice in grids] == [f"{n} frequencies" for n in (3, 4, 7, 13, 16)]
    stokes = bench.measure(physics[2])
    assert min(stokes.error_storage, stokes.error_loss) > 1e-3
    coarse, full = bench.measure(grids[0]), bench.measure(grids[-1])
    assert coarse.error > 3 * full.error > 1e-6  # what straight lines miss, not what solvers do
    ((pack,), *_), _ = trade_runs.plan_ensembles(bench)
    row = trade_runs.measure_ensemble(bench, [replace(pack, n=32, seed=seed) for seed in (1001, 1002)])
    assert not row.failed and row.choice == "2 x N = 32" and row.stderr_loss > 0
    assert row.factorisations >= 2 and row.error > 1e-3 and "packing took" in row.note


def test_a_run_that_fails_says_why(clean):
    outcome = trade_process.run(["sweep", "none.h5", "--out", "x.h5"])
    assert (outcome.status, outcome.error) == (2, "none.h5: no such file. Check its name.")
    assert 10 < outcome.memory < 2000  # MB


def test_simpler_physics_of_each_law():
    names = [name for name, _ in trade_runs.simpler(Physics(damping_law(rotations=False), prestress=False))]
    assert names == ["with rotations", "with pre-stress", "Stokes drag, eta_f = 0"]
    names = [name for name, _ in trade_runs.simpler(Physics(damping_law(beta=0.0)))]
    assert names == ["without pre-stress", "Stokes drag, eta_f = 0"]  # whose disks may roll as they like
    for prestress in (True, False):
        others = dict(trade_runs.simpler(Physics(damping_law(tau1=3.0), prestress=prestress)))
        others.pop("without pre-stress" if prestress else "with pre-stress")
        assert {(other.prestress, other.law.tau1) for other in others.values()} == {(prestress, 3.0)}
    others = dict(trade_runs.simpler(Physics(damping_law("stokes", tau1=2.0))))
    assert others["contact damping, beta = 1"] == Physics(damping_law(tau1=2.0))
    assert others["without pre-stress"] == Physics(damping_law("stokes", tau1=2.0), prestress=False)


# Runs that end otherwise


@pytest.mark.parametrize(
    ("text", "status", "reason"),
    [
        ("noise\njampetsc: error: p.h5: no  such file\njampetsc: error: other\n", 2, "p.h5: no such file"),
        ("half a line", -9, "killed by signal 9"),
        ("\n ---- \n", 5, "exit status 5 without a message"),
        ("Traceback (most recent call last):\n  File\nZeroDivisionError: a bug\n", 1, "ZeroDivisionError: a bug"),
        ("----\nmpirun: not found\nsecond line\n", 127, "mpirun: not found"),
    ],
)  # fmt: skip
def test_why_a_run_failed(text, status, reason):
    assert trade_process.failure_reason(text, status) == reason


@pytest.mark.parametrize(
    ("name", "version", "words"),
    [
        ("mpirun", "mpirun (Open MPI) 4.1.4", ["--oversubscribe", "--bind-to", "none"]),
        ("mpirun", "mpirun (PRRTE) 3.0, OpenRTE", ["--oversubscribe", "--bind-to", "none"]),
        ("mpiexec", "HYDRA build details: 4.0", []),
    ],
)
def test_words_before_a_command_for_several_ranks(tmp_path, monkeypatch, name, version, words):
    (tmp_path / name).write_text(f"#!/bin/sh\necho '{version}'\n")
    (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert trade_process.launcher(3) == [str(tmp_path / name), *words, "-n", "3"]
    assert trade_process.launcher(None) == []
    (tmp_path / name).unlink()
    with pytest.raises(InputError, match="ranks 2: neither mpirun nor mpiexec"):
        trade_process.launcher(2)


def ending(monkeypatch, *ends):
    """Processes end at once as they are told: (text in their words, status, result); [the words of each so far]."""
    asked = []

    def run(words, ranks=None):
        asked.append(" ".join(map(str, words)))
        status, result = next(end for text, *end in ends if text in asked[-1])
        if result is not None:
            out = words[words.index("--out") + 1]
            write_packing(out, result) if isinstance(result, Packing) else result.save(out)
        error = f"ended by {status}" if status else ""
        return trade_process.ProcessOutcome(status, 1.5, 100.0 + len(asked), error)

    monkeypatch.setattr(trade_process, "run", run)
    return asked


@pytest.fixture
def told(tmp_path, monkeypatch):
    """A function that makes a bench whose processes end as they are told, and the list of their words."""

    def bench(*ends, **changes):
        asked = ending(monkeypatch, *ends)
        return bench_of(tmp_path, **changes), asked

    return bench


def curve(
    omega,
    scale=1.0,
    k=1.0,
    tau1=1.0,
    pressure=1e-6,
    G=None,
    bounds=None,
    spectrum=(),
    seconds=2.0,
    factorisations=5,
):
    """A sweep with G* = (1 + i)√ω at p = 1e-6 k unless told otherwise, certified to 1e-6 of |G*|."""
    omega = np.asarray(omega) / tau1
    G = scale * (1 + 1j) * np.sqrt(omega) if G is None else G
    arrays = {"omega": omega, "G": G, "error_bound": 1e-6 * np.abs(G)}
    for part in ("storage", "loss"):
        arrays[f"error_bound_{part}"] = 1e-6 * np.abs(G) if bounds is None else np.full(len(G), bounds[part])
    arrays |= {f"spectrum/{name}": values for name, values in dict(spectrum).items()}
    facts = {"wall_seconds": seconds, "factorisations": factorisations, "petsc_version": "3.99"}
    return stored(None, "sweep", arrays, tau1=tau1, pressure=pressure * k, k=k, **facts)


WIDE = np.geomspace(1e-8, 10, 91)


def test_the_reference_is_the_tightest_sweep_that_is_certified(told, capsys, reporting):
    ends = [("1e-12", 3, None), ("1e-11", 3, None), ("1e-10", 3, None), ("1e-09", 0, curve(WIDE))]
    bench, _ = told(*ends, choices=["accuracy"])
    rows = bench.find_reference()
    assert [(row.group, row.choice, row.failed) for row in rows] == [
        ("reference", "accuracy 1e-09", False), ("accuracy", "accuracy 1e-10", True),
    ]  # fmt: skip
    assert (rows[0].seconds, rows[0].process_seconds, rows[0].factorisations) == (2.0, 1.5, 5)
    assert rows[0].exponent_storage == pytest.approx(0.5) and rows[0].certified == pytest.approx(
        2**0.5 * 1e-6
    )
    assert rows[1].note == "failed: ended by 3" and bench.reference_accuracy == 1e-9
    bench.failed("options", "o.opts", trade_process.ProcessOutcome(1, 1.0, 1.0, "broken"))
    bench.measure(
        trade_runs.TradeSetting(
            "method", "direct", bench.sweep_with(accuracy=1e-9), lambda *_: errors(2e-5, 1e-5)
        )
    )
    assert capsys.readouterr().err.splitlines() == [
        *[f"[{n}] accuracy accuracy 1e-{13 - n}: failed: ended by 3" for n in (1, 2, 3)],
        "[4] reference accuracy 1e-09: 2.00 s  certified to 1.4e-06",
        "[5] options o.opts: failed: broken",
        "[6] method direct: 2.00 s  error 2.0e-05",
    ]
    plan, left_out = trade_runs.plan_settings(bench)
    assert [choice.name for choice in plan] == [f"accuracy {a:g}" for a in trade_runs.ACCURACIES if a > 1e-9]
    assert left_out == []


@pytest.mark.parametrize(
    ("status", "kind", "message", "runs"),
    [
        (2, InputError, "^ended by 2$", 1),
        (1, JampetscError, "^no reference: ended by 1$", 1),
        (3, ConvergenceError, "^no reference, as .* failed at every accuracy: ended by 3$", 11),
    ],
)
def test_where_there_is_no_reference(told, status, kind, message, runs):
    bench, asked = told(("", status, None))
    with pytest.raises(kind, match=message) as refused:
        bench.find_reference()
    assert type(refused.value) is kind and len(asked) == runs


def test_what_cannot_be_measured_is_said(told, tmp_path):
    narrow = np.geomspace(1.0, 10, 5)
    (tmp_path / "a.opts").touch()
    for omega in ("1,2,5", "lin:1:10:5"):
        how = {"omega": omega, "choices": ["method", "frequencies"], "options_files": [tmp_path / "a.opts"]}
        bench, _ = told(("", 0, curve(narrow)), **how)
        (row,) = bench.find_reference()
        assert np.isnan(row.exponent_storage) and bench.reference.window is None
        assert not [name for name in bench.reference.deviation(bench.reference.G) if "window" in name]
        plan, left_out = trade_runs.plan_settings(bench)
        assert [choice.name for choice in plan] == ["direct, MUMPS", "direct, a.opts"]
        assert plan[1].petsc == ("-options_file", str(tmp_path / "a.opts"))
        window = "critical window, 10 p/k < omega tau1 < 0.1"
        assert [line.split(":")[0] for line in left_out] == ["number of frequencies", window]


@pytest.mark.parametrize(("omega", "counts"), [("1:10:3", (2, 3)), ("0.0001:100:60", (4, 7, 13, 25, 60))])
def test_numbers_of_frequencies_are_so_many_per_decade_up_to_those_asked_for(told, omega, counts):
    low, high, points = (float(word) for word in omega.split(":"))
    swept = curve(np.geomspace(low, high, int(points)))
    bench, _ = told(("", 0, swept), omega=omega, choices=["frequencies"])
    bench.find_reference()
    plan, _ = trade_runs.plan_settings(bench)
    assert [choice.name for choice in plan] == [f"{n} frequencies" for n in counts]
    grids = [format_numbers(np.geomspace(low, high, n)) for n in counts]
    assert [choice.sweep.words() for choice in plan] == [["--omega", g, "--method", "direct"] for g in grids]


def test_a_choice_is_run_once_and_one_that_cannot_be_read_fails(packing, tmp_path, monkeypatch):
    bench, runs = bench_of(tmp_path, packing, omega="1,2"), []

    def run(words, ranks):
        runs.append(words)
        return trade_process.ProcessOutcome(len(runs) - 1, 1.0, 10.0, "" if len(runs) == 1 else "by itself")

    monkeypatch.setattr(trade_process, "run", run)
    outcome, result = bench.run(bench.sweep_with(accuracy=0.1))
    assert result is None and outcome.status == 1 and outcome.error == "no such file. Check its name."
    assert bench.run(bench.sweep_with(accuracy=0.1))[0] is outcome and len(runs) == 1
    assert bench.run(bench.sweep_with(accuracy=0.05))[0].error == "by itself"
    bench.run(bench.sweep_with(accuracy=0.05, omega="1"))
    bench.run(bench.sweep_with(accuracy=0.05), ("-options_file", "a.opts"))
    out = ["--out", str(tmp_path / "run2.h5"), "--omega", "1.0", "--accuracy", "0.05"]
    assert len(runs) == 4 and runs[2] == ["sweep", str(packing), *out] and runs[3][-1] == "a.opts"


def packs_of(told, path, *ends, n=64, **record):
    """(bench for a packing with this record, words of its processes, what an ensemble would be, what is left out)."""
    packing = with_record(path / "p.h5", n, **record)
    bench, asked = told(("1e-12", 0, curve(WIDE, k=2.0)), *ends, packing=packing)
    bench.find_reference()
    return bench, asked, *trade_runs.plan_ensembles(bench)


def test_an_ensemble_costs_what_all_its_runs_cost(told, tmp_path):
    G = 0.9 * (1 + 1j) * np.sqrt(WIDE)
    G[0] = -1.0 + 1j * G[0].imag
    low, disks = curve(WIDE, G=G, seconds=4.0, factorisations=8), published()
    bench, _, packs, _ = packs_of(told, tmp_path, ("--seed", 2, None), sizes="bidisperse")
    row = trade_runs.measure_ensemble(bench, packs[1])
    assert row.failed and row.note == "failed: ended by 2"
    ends = [("--seed 1004", 3, None), ("--seed", 0, disks), ("-1003", 3, None),
            ("-1001", 0, curve(WIDE, 1.1, seconds=3.0, factorisations=7)), ("-1002", 0, low)]  # fmt: skip
    bench, asked, packs, _ = packs_of(told, tmp_path, *ends, sizes="bidisperse")
    row = trade_runs.measure_ensemble(bench, packs[1])
    assert (row.seconds, row.process_seconds, row.factorisations) == (13.0, 10.5, 15)
    assert row.memory_mb == 100.0 + len(asked)
    assert row.note == "packing took 6.0 s; only 2 of 4: ended by 3; G' < 0 in 1 of them"
    assert row.stderr_loss == pytest.approx(0.1 * half_width(1))  # of 1.1 and 0.9
    assert sum(line.endswith(" ".join(packs[1][0].words())) for line in asked) == 1
    ends = [("--seed", 0, disks), ("packing-16-", 3, None)]  # no sweep is left
    bench, _, packs, _ = packs_of(told, tmp_path, *ends, sizes="bidisperse")
    row = trade_runs.measure_ensemble(bench, packs[1])
    assert (row.failed, row.note, row.process_seconds) == (True, "failed: ended by 3", 1.5)


def test_which_ensembles_a_packing_allows_and_that_they_are_made_as_it_was(told, tmp_path):
    for n, shares in ((256, [1, 4, 16]), (255, [1, 4]), (64, [1, 4]), (63, [1])):
        *_, found, left_out = packs_of(told, tmp_path, n=n, sizes="bidisperse")
        assert [(packs[0].n, len(packs)) for packs in found] == [(n // share, share) for share in shares]
        assert [line.split()[0] for line in left_out] == [str(s) for s in (1, 4, 16) if s not in shares]
    no_pressure = {"sizes": "bidisperse", "requested_pressure": 7.0}
    for record, why in (
        ({}, "the radii of "),
        ({"sizes": "radii of r.txt"}, "the radii of "),
        (no_pressure, "pressure 7"),
    ):
        *_, found, (line,) = packs_of(told, tmp_path, n=256, **record)
        assert found == [] and line.startswith(f"ensemble: left out, {why}")
    record = {"sizes": "monodisperse", "requested_pressure": 0.02, "stabilise": "shear"}
    for kept, expected in ((record, (0.02, "shear")), ({"sizes": "monodisperse"}, (1e-6, "volume"))):
        *_, (_, packs), _ = packs_of(told, tmp_path, n=64, **kept)
        assert [pack.seed for pack in packs] == [1001, 1002, 1003, 1004]
        for pack in packs:
            assert (pack.pressure, pack.stabilise) == expected
            assert (pack.n, pack.sizes) == (16, "monodisperse")
            assert (pack.potential, pack.stiffness) == ("harmonic", "constant")


def test_scatter_of_an_ensemble_is_that_of_a_mean_in_the_window_and_of_slopes_from_packing_to_packing():
    reference, shifts = ReferenceCurve(curve(WIDE)), np.array([-0.1, 0.1] * 4)
    curves = (1 + shifts)[:, None] * reference.G
    curves[:, 0] = shifts + 1e-9j
    found = trade_runs.ensemble_errors(reference, curves)
    assert found["window_storage"] < 1e-12  # the mean is exact
    assert found["stderr_storage"] == found["stderr_loss"] == pytest.approx(0.1 / np.sqrt(7) * half_width(7))

    reference = ReferenceCurve(curve(omega := np.geomspace(1e-4, 1e-2, 7)))
    steep = [omega**exponent * (1 + 1j) for exponent in (0.5, 0.6)]
    found = trade_runs.ensemble_errors(reference, np.array(steep))
    for part in ("storage", "loss"):  # √(0.05² + 0.05²)/√2
        assert found[f"exponent_{part}_error"] == pytest.approx(0.05 * half_width(1))
    steep[1][3] = -0.1 * steep[1][3]  # of which no slope can be told: a single one has no scatter
    fit = reference.deviation(np.mean(steep, axis=0))
    alone = trade_runs.ensemble_errors(reference, np.array(steep))
    assert alone["exponent_storage_error"] == fit["exponent_storage_error"] > 0


# What it tells
def test_a_trade_tells_what_was_measured_on_what_and_what_was_left_out(tmp_path, monkeypatch):
    packing, drawn = with_record(tmp_path / "p.h5", 64), []
    ending(monkeypatch, ("", 0, curve(WIDE)))
    monkeypatch.setattr("jampetsc.plots.trade_plots.plot_trade", lambda *words: drawn.append(words))
    text = trade_runs.measure_trade(asked(packing, ensemble=True), tmp_path / "t.csv")
    written = (tmp_path / "t.csv").read_text()
    for line in (
        f"command: jampetsc trade {packing} --out {tmp_path}/t.csv --choices '' --ensemble --omega 1e-08:10.0:91",
        f"packing: p.h5, N = 64, p = 1e-06, sha256 {read_packing(packing).fingerprint}",
        "law: contact damping, beta = 1, tau1 = 1; frequencies 1e-08:10.0:91",
        "reference: certified to 1.4e-06; errors below that are not resolved",
        "critical window: omega = 1e-05 to 0.1",
        f"ensemble: left out, the radii of {packing} cannot be drawn by `jampetsc pack`",
    ):
        assert f"# {line}\n" in written and line in text.splitlines()
    assert "runs: one process each; " in written and "PETSc 3.99; 2" in written
    assert text.endswith(f"{tmp_path}/t.csv, {tmp_path}/t.png")
    assert "for a first look" in text and [row.group for row in drawn[0][0]] == ["reference"]
    assert drawn[0][1:] == (pytest.approx(2**0.5 * 1e-6), tmp_path / "t.png")
    ending(monkeypatch, ("", 0, curve(WIDE[:9])))
    text = trade_runs.measure_trade(
        asked(packing, omega="1,2", choices=["frequencies"], ranks=2), tmp_path / "t.csv"
    )
    for told in ("runs: mpirun -n 2; ", "critical window, 10 p/k", "left out, it needs"):
        assert told in text


# What is made of them
def test_errors_and_slopes_of_a_square_root():
    reference = ReferenceCurve(curve(WIDE, k=100.0, tau1=4.0))
    assert reference.window == pytest.approx((2.5e-6, 0.025), rel=0.3)  # to a step of the grid
    G = reference.G.real * 1.01 + 0.98j * reference.G.imag
    G[0] *= 2  # outside of the window
    found = reference.deviation(G)
    assert [found[f"{where}_{part}"] for where in ("error", "window") for part in ("storage", "loss")] == [
        pytest.approx(error) for error in (1.02, 0.96, 0.01, 0.02)
    ]
    assert (found["exponent_storage"], found["exponent_loss"]) == pytest.approx((0.5, 0.5))
    G[45] *= 1.1
    assert min(reference.exponents(G)[f"exponent_{part}_error"] for part in ("storage", "loss")) > 1e-4
    for negative in (-G, -G.real + 1j * G.imag, G.real - 1j * G.imag):
        assert reference.exponents(negative) == {}
    narrow = ReferenceCurve(curve(np.geomspace(1.0, 10, 5)))
    assert narrow.window is None and narrow.deviation(narrow.G) == {"error_storage": 0.0, "error_loss": 0.0}


def test_too_few_frequencies_are_judged_between_those_of_the_reference():
    """G* = 1 + 9iω/(1 + iω): between 0.01 and 100 straight lines are off by most where G'' is largest, at 1."""
    ends, middle = np.array([0.01, 100.0]), np.array([0.01, 1.0, 100.0])
    spectrum = {"G0": 1.0, "eta_inf": 0.0, "rates": np.ones(1), "weights": np.full(1, 9.0)}
    few, finer = (
        curve(omega, pressure=1.0, G=1 + 9j * omega / (1 + 1j * omega), spectrum=spectrum)
        for omega in (ends, middle)
    )
    fine = np.geomspace(*ends, 100_001)
    exact, chord = 1 + 9j * fine / (1 + 1j * fine), log_interpolate(fine, ends, few.G)
    storage, loss = (np.abs(part(chord) / part(exact) - 1).max() for part in (np.real, np.imag))
    assert loss == pytest.approx(1 - 0.02 / 1.0001)
    for reference in (few, finer):
        judged = trade_runs.errors_at_few_frequencies(ReferenceCurve(reference), few)
        found = judged["error_storage"], judged["error_loss"]
        assert found == pytest.approx((storage, loss), rel=1e-3)
        assert "interpolation between them" in judged["note"] and "window_storage" not in judged
    omega, G = np.array([1.0, 100.0]), np.array([1 + 4j, 10 + 1j])
    assert log_interpolate(np.array([10.0]), omega, G)[0] == pytest.approx(np.sqrt(10) + 2j)
    assert np.isnan(log_interpolate(np.array([10.0]), omega, G - 2)[0].real)


def test_the_bounds_of_both_moduli_count_each_for_its_own():
    def bounded(storage, loss, error=0.0):
        G = (1 + 1j) * np.array([1.0, 2.0]) + error * np.array([0.0, 1.0])
        return curve([1.0, 4.0], G=G, bounds={"storage": storage, "loss": loss})

    reference = ReferenceCurve(bounded(0.1, 0.2))
    for error, beyond in ((0.29, None), (0.31, 4.0), (0.49j, None), (-0.51j, 4.0), (-0.31, 4.0)):
        run = bounded(0.2, 0.3, error)
        assert reference.violation(run) == beyond
        note = f"EXCEEDS ITS BOUND at omega = {beyond:g}" if beyond else ""
        assert trade_runs.errors_with_bounds(reference, run)["note"] == note
    for bounds, certified in (((0.1, 0.2), 0.2), ((0.4, 0.2), 0.4)):
        assert ReferenceCurve(bounded(*bounds)).certified == pytest.approx(certified)


SLOPES = {"exponent_storage": 0.5, "exponent_loss": 0.5}


def errors(storage, loss=None):
    return {"error_storage": storage, "error_loss": storage if loss is None else loss}


ROWS = [
    TradeRow("reference", "accuracy 1e-12", 5.0, certified=1e-12, **SLOPES),
    TradeRow(
        "accuracy", "accuracy 0.01", 1.0, **errors(1e-2, 3e-2), exponent_storage=0.51, exponent_loss=0.5
    ),
    TradeRow("accuracy", "accuracy 0.001", 2.0, **errors(1e-3), **SLOPES),
    TradeRow("accuracy", "accuracy 0.0001", 2.1, **errors(1e-4), **SLOPES),
    TradeRow("method", "direct, MUMPS", 50.0, **errors(1e-13), **SLOPES),
    TradeRow("method", "direct, iterative.opts", note="failed: no", failed=True),
    TradeRow("physics", "without rotations", 0.5, **errors(0.5), exponent_storage=0.47, exponent_loss=0.53),
    TradeRow("physics", "without pre-stress", 0.5, **errors(0.5), exponent_storage=0.4, exponent_loss=0.53),
    TradeRow("frequencies", "8 frequencies", 3.0, **errors(0.2)),
    TradeRow("frequencies", "15 frequencies", 7.0, **errors(0.04)),
    TradeRow("frequencies", "29 frequencies", 11.0, **errors(0.03)),
]


def test_advice_follows_its_rules():
    _, look, frequencies, figure, more, exponent, physics = advise(ROWS)
    assert look.endswith("accuracy 0.01, 1.00 s, error at most 3e-02")
    assert frequencies == "  solved one by one: 15 frequencies and interpolation do, 7.00 s"
    assert figure.endswith("accuracy 0.0001, 2.10 s, error at most 1e-04")  # as fast as 0.001, and more exact
    assert "more than 29 frequencies" in more
    assert exponent.endswith("accuracy 0.0001, 2.10 s, error at most 1e-04")  # 0.01 moves a slope by 0.01
    assert physics.endswith(": without rotations (0.50 s)")


GROUPS = ("accuracy", "method", "physics", "frequencies", "ensemble")
RUNS = st.builds(
    lambda group, seconds, error, storage, loss: TradeRow(
        group, "", seconds, **errors(error), exponent_storage=storage, exponent_loss=loss
    ),
    st.sampled_from(GROUPS),
    st.sampled_from([1.0, 1.09, 1.11, 3.0]),
    st.sampled_from([1e-15, 1e-3, 0.005, 0.00501, 0.05, 0.0501]),
    *[st.sampled_from([0.5, 0.4951, 0.4949, 0.5049, 0.5051, np.nan])] * 2,
)
RULES = (
    lambda run: run.error <= 0.05,
    lambda run: run.error <= 0.005,
    lambda run: max(abs(run.exponent_storage - 0.5), abs(run.exponent_loss - 0.5)) <= 0.005,
)


@settings(derandomize=True, deadline=None, database=None, max_examples=300)
@given(st.lists(RUNS, max_size=6))
def test_the_run_that_is_recommended_is_the_fastest_that_will_do_and_of_those_the_most_exact(runs):
    """Of other ways to the same numbers alone, and none promises more than the reference resolves."""
    runs = [replace(run, choice=f"run {n}") for n, run in enumerate(runs)]
    lines = [line for line in advise([ROWS[0], *runs]) if line.startswith("for ")]
    others = [run for run in runs if run.group in ("accuracy", "method")]
    for line, rule in zip(lines, RULES, strict=True):
        told = line.rpartition("): ")[2]
        known = [run for run in others if not np.isnan([run.exponent_storage, run.exponent_loss]).any()]
        fitting = [run for run in (known if rule is RULES[2] else others) if rule(run)]
        if not fitting:
            only = "only the reference, accuracy 1e-12, 5.00 s"
            assert (
                told == only if others else told.startswith("the reference, accuracy 1e-12, 5.00 s (no other")
            )
            continue
        fast = [run for run in fitting if run.seconds <= 1.1 * min(run.seconds for run in fitting)]
        error = min(run.error for run in fast)
        ways = [f"{run.choice}, {run.seconds:.2f} s" for run in fast if run.error == error]
        assert told in [f"{way}, error at most {max(error, 1e-12):.0e}" for way in ways]


BIG = TradeRow("ensemble", "1 x N = 64", 9.0, **errors(1.0), window_storage=0.1, window_loss=0.3)


@pytest.mark.parametrize(
    ("fields", "more", "told"),
    [  # errors and standard errors of G' and of G'', another row, what is said
        ((0.055, 0.0, 0.02, 0.01), [], "mean off by 5.5e-02 with standard error 2.0e-02, no more than scatter;"),
        ((0.0, 0.055, 0.01, 0.02), [], "mean off by 5.5e-02 with standard error 2.0e-02, no more than scatter;"),
        ((0.057, 0.0, 0.02, 0.01), [], "mean off by 5.7e-02 with standard error 2.0e-02, more than scatter, too"),
        ((0.0, 0.057, 0.01, 0.02), [], "mean off by 5.7e-02 with standard error 2.0e-02, more than scatter, too"),
        ((0.2, 0.0, 0.02, 0.01), [BIG], "mean off by 2.0e-01 with standard error 2.0e-02, no more than scatter;"),
        ((np.nan, np.nan, 0.2, 0.1), [], "mean off by 3.0e-01 with standard error 2.0e-01, no more than"),
    ],
)  # fmt: skip
def test_advice_on_packings(fields, more, told):
    names = ("window_storage", "window_loss", "stderr_storage", "stderr_loss")
    row = TradeRow("ensemble", "4 x N = 16", 9.0, **errors(0.1, 0.3), **dict(zip(names, fields, strict=True)))
    alone, line = advise([*ROWS, *more, row])[-2:]
    assert f"4 x N = 16: 9.0 s, {told}" in line and line.endswith(
        f"below {max(fields[2:]) / 10:.0e} is lost in it"
    )
    assert ("off by 3.0e-01: that is the scatter of single ones" in alone) == bool(more)


def test_a_table_reads_back_and_tells_what_is_resolved(tmp_path):
    rows = [*ROWS, replace(ROWS[5], choice="x", seconds=1 / 3)]
    trade_report.write_table(tmp_path / "t.csv", rows, ["packing: p.h5"])
    text = (tmp_path / "t.csv").read_text()
    assert text.startswith("# packing: p.h5\n")
    assert {field.name for field in fields(TradeRow) if f"# {field.name}: " not in text} == {"failed"}
    read = rows_of(tmp_path / "t.csv")
    assert float(read["accuracy", "accuracy 0.01"]["error_loss"]) == 3e-2
    assert [read["method", name]["seconds"] for name in ("direct, iterative.opts", "x")] == ["", "0.333333"]
    assert [row["failed"] for row in read.values()] == ["0"] * 5 + ["1"] + ["0"] * 5 + ["1"]
    small = {"error_storage": 1e-15, "error_loss": 2e-12, "window_storage": 1e-15, "window_loss": 1e-12}
    lines = trade_report.format_table(
        [*ROWS, TradeRow("method", "direct", 1e-15, stderr_loss=1e-15, **small)]
    ).splitlines()
    assert len({len(line) for line in lines}) == 1 and "memory" not in lines[0]  # nothing known: no column
    groups = [line.split("|")[1].strip() for line in lines[:6]]
    assert groups == ["", "-" * 11, "reference", "accuracy", "", ""]
    assert [cell.strip() for cell in lines[-1].split("|")][3:] == [
        "0.00", "", "< 1e-12", "2.0e-12", "< 1e-12", "1.0e-12", "", "", "1.0e-15", "", "",
    ]  # fmt: skip
