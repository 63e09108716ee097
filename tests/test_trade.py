"""The trade: real runs at N = 64, what is made of them, and the advice that follows from rows."""

import csv
import os
import subprocess
import sys
from argparse import ArgumentParser
from dataclasses import replace

import launch
import numpy as np
import pytest
from drawn import figure_of, lines
from matplotlib.image import imread

from jampetsc import cli
from jampetsc.contacts.laws import Physics, damping_law
from jampetsc.errors import InputError
from jampetsc.plots.trade import plot_trade
from jampetsc.progress import Progress
from jampetsc.speed_accuracy import choices, ensembles, processes
from jampetsc.speed_accuracy.advice import advise
from jampetsc.speed_accuracy.compare import CRITICAL_START, Reference, log_interpolate
from jampetsc.speed_accuracy.table import MEANINGS, Row, Table
from jampetsc.words.law import add_law_options, physics_from, words_of

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib

OMEGA = "1e-2:10:16"  # six of them in the critical window of p = 1e-3


def jampetsc_run(*words, folder, **environment):
    return subprocess.run(
        [sys.executable, "-m", "jampetsc", *map(str, words)],
        env=launch.environment() | environment,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
    )


def rows_of(path):
    """The rows of a written table as dictionaries of text, by the name of the choice."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return {(row["group"], row["choice"]): row for row in csv.DictReader(lines)}


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trade")
    made = jampetsc_run("pack", "--n", 64, "--pressure", "1e-3", "--out", "p.h5", folder=folder)
    assert made.returncode == 0, made.stderr
    return folder / "p.h5"


@pytest.fixture
def clean(monkeypatch):
    """The environment of child processes as `launch` makes it."""
    for name, value in launch.environment().items():
        monkeypatch.setenv(name, value)


@pytest.fixture
def bench(packing, tmp_path, clean):
    with Progress(None, "trade") as progress:
        yield choices.Bench(packing, Physics(damping_law()), OMEGA, None, tmp_path, progress)


# The whole of it


def test_trade_of_a_packing(packing, tmp_path):
    (tmp_path / "broken.opts").write_text("-freq_pc_type none_such\n")
    words = ["trade", packing, "--out", "t.csv", "--omega", OMEGA, "--choices", "method,physics"]
    done = jampetsc_run(*words, "--options-files", "broken.opts", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = rows_of(tmp_path / "t.csv")
    assert [group for group, _ in rows] == ["reference", *["method"] * 2, *["physics"] * 3]
    reference = next(row for (group, _), row in rows.items() if group == "reference")
    direct = rows["method", "direct, MUMPS"]
    bounds = float(reference["certified"]) + float(direct["certified"])
    for part in ("storage", "loss"):
        assert float(direct[f"error_{part}"]) <= bounds < 1e-8
        assert float(rows["physics", "Stokes drag, eta_f = 0"][f"error_{part}"]) > 1e-3
        assert direct[f"exponent_{part}"] == pytest.approx(reference[f"exponent_{part}"])
    assert direct["factorisations"] == "16" and float(direct["memory_mb"]) > 10
    assert 0 < float(direct["seconds"]) <= float(direct["process_seconds"])
    broken = rows["method", "direct, broken.opts"]
    assert broken["failed"] == "1" and broken["note"].startswith("failed: ") and "\n" not in broken["note"]
    assert broken["seconds"] == broken["error_storage"] == ""
    assert "for a figure" in done.stdout and "broken.opts" in done.stdout
    assert imread(tmp_path / "t.png").std() > 0.01
    assert sorted(path.name for path in tmp_path.iterdir()) == ["broken.opts", "t.csv", "t.png"]


def test_no_reference_is_one_line_and_no_file(packing, tmp_path):
    words = ["trade", packing, "--out", "t.csv", "--omega", OMEGA]
    done = jampetsc_run(*words, folder=tmp_path, PETSC_DIR="/nowhere")
    assert done.returncode == 2 and "/nowhere" in done.stderr
    assert [line for line in done.stderr.splitlines() if line.startswith("jampetsc: ")] == [
        done.stderr.splitlines()[-1]
    ]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--out", "t.txt"], "--out t.txt: give it the ending .csv"),
        (["--out", "t.csv", "--choices", "method,speed"], "--choices method,speed: 'speed' is none of"),
        (["--out", "t.csv", "--ranks", 0], "--ranks 0: must be 1 or more"),
        (["--out", "t.csv", "--omega", "1:x:3"], "--omega 1:x:3: write low:high:count"),
        (["--out", "t.csv", "--options-files", "none.opts"], "--options-files none.opts: no such file"),
        (["--out", "none/t.csv"], "none/t.csv: folder none does not exist"),
        (["--out", "t.csv", "--law", "stokes", "--beta", 1], "--beta: belongs to --law contact"),
    ],
)
def test_bad_input_is_one_line(packing, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as error:
        cli.dispatch(["trade", str(packing), *map(str, words)])
    assert str(error.value).startswith(message) and "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())


def test_not_under_mpirun(packing, tmp_path, monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    with pytest.raises(InputError, match="run it without mpirun and give --ranks"):
        cli.dispatch(["trade", str(packing), "--out", str(tmp_path / "t.csv")])


# Its runs


def test_ranks_ensemble_and_frequencies(bench):
    bench.ranks = 1
    bench.find_reference()
    bench.ranks = None
    assert bench.reference.window[0] >= 0.99 * CRITICAL_START * 1e-3 and bench.reference.certified < 1e-8
    plan, left_out = choices.plan(bench, ["frequencies"], [])
    assert [choice.name for choice in plan] == [
        f"{n} frequencies" for n in (3, 4, 7, 13, 16)
    ] and not left_out
    coarse, full = bench.measure(plan[0]), bench.measure(plan[-1])
    assert coarse.error > 3 * full.error > 1e-6  # what straight lines miss, not what solvers do
    row = ensembles.measure(bench, 2)
    assert not row.failed and row.choice == "2 x N = 32" and row.stderr_loss > 0
    assert row.factorisations >= 2 and row.error > 1e-3 and "packing took" in row.note


def test_a_run_that_fails_says_why(clean):
    outcome = processes.run(["sweep", "none.h5", "--out", "x.h5"])
    assert (outcome.status, outcome.error) == (2, "none.h5: no such file")
    assert 10 < outcome.memory < 2000  # MB


def test_no_mpirun_is_said(monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(InputError, match="--ranks 2: neither mpirun nor mpiexec"):
        processes.launcher(2)


@pytest.mark.parametrize(
    "physics",
    [
        Physics(damping_law(beta=0.25, rotations=False), prestress=False),
        Physics(damping_law("stokes", eta_f=0.0, tau1=2.5)),
        Physics(damping_law(beta=1e-3, tau1=0.1)),
        Physics(damping_law(normal=0.5)),
    ],
)
def test_a_law_survives_as_options(physics):
    parser = ArgumentParser()
    add_law_options(parser)
    assert physics_from(parser.parse_args(words_of(physics))) == physics


def test_simpler_physics_of_each_law():
    names = [name for name, _ in choices.simpler(Physics(damping_law(rotations=False), prestress=False))]
    assert names == ["with rotations", "with pre-stress", "Stokes drag, eta_f = 0"]
    others = dict(choices.simpler(Physics(damping_law("stokes", tau1=2.0))))
    assert others["contact damping, beta = 1"] == Physics(damping_law(tau1=2.0))
    assert others["without pre-stress"] == Physics(damping_law("stokes", tau1=2.0), prestress=False)


def test_the_options_files_are_there():
    assert all(path.is_file() for path in choices.OPTIONS_FILES)


# What is made of them


class Curve:
    """√ω at p = 1e-6 with a certified error of 1e-6."""

    def __init__(self, omega, scale=1.0, k=1.0, tau1=1.0):
        self.omega = np.asarray(omega) / tau1
        self.G = scale * self.modulus(self.omega)
        self.attributes = {"tau1": tau1, "pressure": 1e-6 * k, "k": k}

    def __getitem__(self, name):
        return np.full(len(self.omega), 1e-6) * np.abs(self.G)

    def modulus(self, omega):
        return (1 + 1j) * np.sqrt(omega)


def test_errors_and_slopes_of_a_square_root():
    reference = Reference(Curve(np.geomspace(1e-8, 10, 91)))
    assert reference.window == pytest.approx((1e-5, 0.1))
    assert reference.errors(reference.G.real * 1.01 + 0.98j * reference.G.imag) == pytest.approx((0.01, 0.02))
    slopes = reference.exponents(reference.G)
    assert (slopes.storage, slopes.loss) == pytest.approx((0.5, 0.5))
    assert reference.exponents(-reference.G) is None
    assert max(reference.interpolation_errors(np.array([1e-8, 10]), reference.G[[0, -1]])) < 1e-12


def test_the_critical_window_is_in_units_of_k_and_tau1():
    window = Reference(Curve(np.geomspace(1e-8, 10, 91), k=100.0, tau1=4.0)).window
    assert window == pytest.approx((2.5e-6, 0.025), rel=0.3)  # to a step of the grid


def test_the_scatter_of_a_mean_falls_with_the_number_of_packings():
    omega = np.geomspace(1e-4, 1e-2, 7)
    reference = Reference(Curve(omega))
    shifts = np.array([-0.1, 0.1] * 4)
    found = ensembles._statistics(reference, (1 + shifts)[:, None] * reference.G)
    assert found["error_storage"] < 1e-12  # the mean is exact
    assert found["stderr_storage"] == found["stderr_loss"] == pytest.approx(0.1 / np.sqrt(7))


def test_interpolation_is_straight_in_log_log():
    omega = np.array([1.0, 100.0])
    G = np.array([1 + 4j, 10 + 1j])
    assert log_interpolate(np.array([10.0]), omega, G)[0] == pytest.approx(np.sqrt(10) + 2j)
    assert np.isnan(log_interpolate(np.array([10.0]), omega, G - 2)[0].real)


def test_a_violated_bound_is_seen():
    omega = np.geomspace(1e-8, 10, 91)
    reference = Reference(Curve(omega))
    assert reference.violation(Curve(omega, 1 + 1e-7)) is None
    assert reference.violation(Curve(omega, 1 + 1e-5)) == pytest.approx(1e-8)
    assert reference.violation(Curve(omega, 1 + 1.5e-6)) is None  # the reference itself is off by 1e-6
    turned = Curve(omega)
    turned.G = turned.G.real + 1.00001j * turned.G.imag
    assert reference.violation(turned) == pytest.approx(1e-8)
    judge = choices._accuracy(Physics(damping_law()), 1e-6).judge
    assert judge(reference, Curve(omega, 1 + 1e-5))["note"] == "EXCEEDS ITS BOUND at omega = 1e-08"


SLOPES = {"exponent_storage": 0.5, "exponent_loss": 0.5}


def errors(storage, loss=None):
    return {"error_storage": storage, "error_loss": storage if loss is None else loss}


ROWS = [
    Row("reference", "--accuracy 1e-12", 5.0, certified=1e-12, **SLOPES),
    Row("accuracy", "--accuracy 0.01", 1.0, **errors(1e-2, 3e-2), exponent_storage=0.51, exponent_loss=0.5),
    Row("accuracy", "--accuracy 0.001", 2.0, **errors(1e-3), **SLOPES),
    Row("accuracy", "--accuracy 0.0001", 2.1, **errors(1e-4), **SLOPES),
    Row("method", "direct, MUMPS", 50.0, **errors(1e-13), **SLOPES),
    Row("method", "direct, iterative.opts", note="failed: no", failed=True),
    Row("physics", "without rotations", 0.5, **errors(0.5), exponent_storage=0.47, exponent_loss=0.53),
    Row("physics", "without pre-stress", 0.5, **errors(0.5), exponent_storage=0.4, exponent_loss=0.53),
    Row("frequencies", "8 frequencies", 3.0, **errors(0.2)),
    Row("frequencies", "29 frequencies", 11.0, **errors(0.03)),
]


def test_advice_follows_its_rules():
    _, look, frequencies, figure, more, exponent, physics = advise(ROWS)
    assert look.endswith("--accuracy 0.01, 1.00 s, error at most 3e-02")
    assert frequencies == "  solved one by one: 29 frequencies and interpolation do, 11.00 s"
    assert figure.endswith(
        "--accuracy 0.0001, 2.10 s, error at most 1e-04"
    )  # as fast as 0.001, and more exact
    assert "more than 29 frequencies" in more
    assert exponent.endswith("--accuracy 0.0001, 2.10 s, error at most 1e-04")  # 0.01 moves a slope by 0.01
    assert physics.endswith(": without rotations (0.50 s)")


def test_advice_where_only_the_reference_is_exact_enough():
    loose = [row if row.group == "reference" else replace(row, **errors(0.9)) for row in ROWS]
    assert "only the reference, --accuracy 1e-12, 5.00 s" in advise(loose)[1]
    assert "(no other setting was run)" in advise(ROWS[:1])[1]


@pytest.mark.parametrize(
    ("off", "verdict"), [(0.02, ", no more than scatter;"), (0.2, ", more than scatter, too few disks each;")]
)
def test_advice_on_packings(off, verdict):
    scatter = {"stderr_storage": 0.01, "stderr_loss": 0.02, "window_storage": off, "window_loss": 0.0}
    row = Row("ensemble", "4 x N = 16", 9.0, **errors(1.0), **scatter)
    line = advise([*ROWS, row])[-1]
    assert (
        line.startswith(f"4 x N = 16: 9.0 s, mean off by {off:.1e} with standard error 2.0e-02")
        and verdict in line
    )
    assert line.endswith("an accuracy below 2e-03 is lost in it")
    big = Row("ensemble", "1 x N = 64", 9.0, **errors(1.0), window_storage=0.1, window_loss=0.3)
    alone, line = advise([*ROWS, big, row])[-2:]
    assert "off by 3.0e-01" in alone and ", no more than scatter;" in line


def test_a_table_reads_back(tmp_path):
    Table(ROWS, ["packing: p.h5"]).write(tmp_path / "t.csv")
    text = (tmp_path / "t.csv").read_text()
    assert text.startswith("# packing: p.h5\n") and all(f"# {name}: " in text for name in MEANINGS)
    read = rows_of(tmp_path / "t.csv")
    assert float(read["accuracy", "--accuracy 0.01"]["error_loss"]) == 3e-2
    assert read["method", "direct, iterative.opts"]["seconds"] == ""
    widths = {len(line) for line in str(Table(ROWS, [])).splitlines()}
    assert len(widths) == 1  # columns are aligned
    assert "| < 1e-12 " in str(Table(ROWS, []))  # of the direct method: not resolved
    assert "memory" not in str(Table(ROWS, []))  # nothing known: no column


def test_points_of_the_picture_are_times_of_runs_and_errors_of_both_moduli():
    run = Row("method", "direct, MUMPS", 2.0, 5.0, **errors(1e-2, 3e-2))
    exact = Row("physics", "without rotations", 3.0, 5.0, **errors(1e-13, 1e-6))
    points = lines(figure_of(plot_trade, [run, exact], 1e-12).axes[0], 1)
    for row, (filled, empty) in zip((run, exact), (points[:2], points[2:4]), strict=True):
        assert (filled[0], empty[0]) == (row.seconds, row.seconds)
        # what is not resolved is drawn at the bound of the reference
        assert (filled[1], empty[1]) == (max(row.error_storage, 1e-12), row.error_loss)
        assert filled[3] != "white" and empty[3] == "white"


def test_names_stay_in_the_picture_and_apart(tmp_path):
    crowd = [Row("physics", f"law {n}", 1.0, **errors(0.3)) for n in range(8)]
    plot_trade([*ROWS, *crowd], 1e-12, tmp_path / "t.png")
    assert imread(tmp_path / "t.png").shape[2] == 4
    assert os.listdir(tmp_path) == ["t.png"]
