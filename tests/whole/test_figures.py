"""The scripts of run/figures: what they ask for exists, and each makes its pictures, at tiny sizes."""

import os
import shlex
import subprocess
import sys
import tarfile
import tomllib

import launch
import numpy as np
import pytest

import jampetsc
from jampetsc.analysis.order import six_fold_order
from jampetsc.asking.kinds import FREQUENCIES
from jampetsc.asking.parameters import parameters
from jampetsc.cli import main as cli
from jampetsc.plots import draw
from jampetsc.studies.kinds import KINDS
from jampetsc.studies.plan import plan

sys.path.insert(0, str(launch.ROOT / "benchmarks"))
from claims import motion  # noqa: F401  it enters its claims
from claims.shared import CLAIMS
from keep import slim

FIGURES = launch.ROOT / "run" / "figures"
STUDIES = sorted(path.name for path in FIGURES.iterdir())


@pytest.fixture(scope="module")
def parsers():
    return {name: cli.command_parser([name])[1].choices[name] for name in (*KINDS, "plot", "collapse")}


def shown(name, *words, **environment):
    """({folder: study}, [words of a picture's command, or of a program of benchmarks/]) of a figure."""
    line = [str(FIGURES / name), "--show", *words]
    done = subprocess.run(line, env=os.environ | environment, capture_output=True, text=True, check=True)
    studies, pictures = {}, []
    for line in done.stdout.splitlines():
        if line.startswith(("jampetsc ", "python ")):
            pictures.append(shlex.split(line)[1:])
        elif line.startswith("# study "):
            part = line.removeprefix("# study ")
            studies[part] = ""
        else:
            studies[part] += f"{line}\n"
    return studies, pictures


def is_program(picture):
    """Whether a picture is made by a program of benchmarks/, which reads the folder that its first word names."""
    return picture[0].startswith("benchmarks/")


@pytest.mark.parametrize("name", STUDIES)
def test_a_figure_asks_for_what_there_is(parsers, name):
    kinds = draw.pictures()
    for words in ([], ["--paper"]):
        studies, pictures = shown(name, *words)
        tasks = [task for part, study in studies.items() for task in plan(part, study.encode())]
        columns = {"command", "file"}.union(*({*task.columns, "law", "model"} for task in tasks))
        formats = {"pack": "packing"}
        made = {formats.get(task.command, task.command) for task in tasks}
        made |= {"correlation", "velocity-correlation"} if "correlate" in made else set()
        assert pictures
        for picture in pictures:
            if is_program(picture):
                assert (launch.ROOT / picture[0]).exists()
                assert all(part.startswith(picture[1]) for part in studies)
                continue
            args = parsers[picture[0]].parse_args(picture[1:])
            if picture[0] == "collapse" or picture[1].endswith(".h5"):
                continue
            assert made.intersection(kinds[args.kind].of), args.kind
            assert not args.where or {word.split("=")[0] for word in args.where.split(",")} <= columns


def tables_of(name, *words):
    """(the tables of a figure's study, with lists instead of single tables, words of its pictures)."""
    studies, pictures = shown(name, *words)
    (study,) = studies.values()
    tables = tomllib.loads(study)
    return {key: table if isinstance(table, list) else [table] for key, table in tables.items()}, pictures


def picture_of(pictures, kind, *words):
    """Whether there is a picture of a kind made with these words."""
    return any(kind in line and all(word in line for word in words) for line in pictures)


@pytest.mark.parametrize("words", [[], ["--paper"]])
def test_figures_of_motion_are_those_of_the_paper(words):
    """Pressures, frequencies, laws, sizes and axes of BT 1, 5 and 7; packings at a pressure, the cell not relaxed."""
    found = {name: tables_of(name, *words) for name in ("bt-fig1", "bt-fig5", "bt-fig7", "bt-modes")}
    for name, (tables, _) in found.items():
        (pack,) = tables["pack"]
        assert set(pack) == {"n", "pressure", "seeds"}
        assert pack["pressure"] == ("1e-4" if name == "bt-fig1" else ["1e-2", "1e-3", "1e-4", "1e-5"])
        sizes = pack["n"] if isinstance(pack["n"], list) else [pack["n"]]
        first, last = map(int, pack["seeds"].split(":"))
        assert not words or (max(sizes) == 32768 and last - first + 1 >= 10)
    tables, pictures = found["bt-fig1"]  # β = 1 with rotations and pre-stress
    assert tables["sweep"] == [{"omega": "1e-10:1e4:141", "fields": "1e-10,1e-3,1e4"}]
    assert picture_of(pictures, "moduli") and picture_of(pictures, "fields", "--total", "stress")
    tables, pictures = found["bt-fig5"]
    assert tables["quasistatic"] == [{}] and picture_of(pictures, "medians")
    tables, pictures = found["bt-modes"]
    assert tables["modes"] == [{"count": 200, "no-prestress": True}] and picture_of(pictures, "lowest-modes")
    tables, pictures = found["bt-fig7"]
    contact, stokes = tables["sweep"]
    assert "law" not in contact and contact["omega"] == contact["fields"] == "1e-9,1e-3,1e3"  # twelve decades
    assert (stokes["law"], stokes["eta-f"]) == ("stokes", 0) and stokes["omega"] == stokes["fields"]
    omega = FREQUENCIES.read(stokes["fields"])
    assert all(np.isclose(omega, 10**power).any() for power in (-6.5, -5.5))
    assert len(tables["pack"][0]["n"]) == 2
    assert tables["correlate"] == [{"lane": "0.5,0.25,0.125", "phase": ["stress", "strain"]}]
    for law in ("law=contact,phase=stress", "law=stokes,eta_f=0,phase=stress"):
        assert any("correlation" in line and any(law in word for word in line) for line in pictures)
    lengths = [line for line in pictures if "length" in line and any("phase=stress" in word for word in line)]
    # as printed is the default
    assert [line[-2:] == ["--log-exponent", "-0.65"] for line in lengths] == [False, True]


def asked(parsers, name):
    """(tasks of the study of a figure at the paper's size, {name of a picture: its parsed words})."""
    studies, pictures = shown(name, "--paper")
    (tasks,) = (plan(part, study.encode()) for part, study in studies.items())
    plots = [parsers["plot"].parse_args(words[1:]) for words in pictures]
    return tasks, {os.path.basename(args.out).removesuffix(".png"): args for args in plots}


def settings(job):
    """What a job was asked for and what it has by default, with its law."""
    usual = {name: one.default for name, one in parameters(type(job)).items()}
    return usual | job.told() | dict(job.law.options if hasattr(job, "law") else ())


def by_pressure(tasks, command, **options):
    """{(N, p): tasks} of a command with these options, over which the seeds are the same."""
    found = {}
    for task in tasks:
        if task.command == command and options.items() <= settings(task.choice.job).items():
            packing = task.columns if task.command == "pack" else task.inputs[0].columns
            found.setdefault((packing["n"], packing["pressure"]), []).append(task)
    return found


def decades(first, last):
    """10^first, …, 10^last as they are written."""
    return [float(f"1e{n}") for n in range(first, last + 1)]


PAPER, DECADES = 32768, [1e-5, 1e-4, 1e-3, 1e-2]  # N and pressures of BT figures 3, 4 and 6
AT_ALL = {(PAPER, p) for p in DECADES}


@pytest.mark.parametrize("name", ["bt-fig3", "bt-fig4", "bt-fig6", "bt-fig8"])
def test_packings_of_moduli_are_quenched_at_a_pressure_in_a_cell_of_fixed_shape(parsers, name):
    tasks, _ = asked(parsers, name)
    packs = by_pressure(tasks, "pack")
    assert all(task.choice.job.stabilise == "volume" for some in packs.values() for task in some)
    assert min(map(len, packs.values())) >= 10
    assert set(packs) == AT_ALL or name == "bt-fig8"
    for task in tasks:  # G* from below the lowest crossover, ω ~ p, to the viscous end
        if task.command == "sweep":
            omega = task.choice.job.omega
            assert omega.min() <= 1e-3 * min(DECADES) and omega.max() >= 1e3 and 71 <= len(omega) <= 141


def test_bt_figure_3_is_balanced_damping_at_four_pressures_and_its_collapse(parsers):
    tasks, pictures = asked(parsers, "bt-fig3")
    for prestress in (True, False):
        assert set(by_pressure(tasks, "sweep", law="contact", beta=1.0, prestress=prestress)) == AT_ALL
    assert set(by_pressure(tasks, "sweep", law="contact", beta=1.0, rotations=False)) == AT_ALL
    assert set(by_pressure(tasks, "quasistatic", law="contact", beta=1.0, prestress=True)) == AT_ALL
    assert (pictures["3a"].kind, pictures["3a"].where) == ("moduli", "rotations=1,prestress=1")
    b = pictures["3b"]
    assert (b.kind, b.mu, vars(b)["lambda"], b.where) == ("collapse", 0.5, 1.0, "rotations=1,prestress=1")
    assert {pictures[name].kind for name in ("3c", "3c-no-prestress", "3d")} == {"exponents"}


def test_bt_figure_4_is_no_sliding_at_four_pressures_and_seven_decades_of_it_at_one(parsers):
    tasks, pictures = asked(parsers, "bt-fig4")
    for prestress in (True, False):
        assert set(by_pressure(tasks, "sweep", beta=0.0, prestress=prestress)) == AT_ALL
        betas = [b for b in decades(-6, 1) if by_pressure(tasks, "sweep", beta=b, prestress=prestress)]
        assert len(betas) == 8
        for beta in betas:
            assert set(by_pressure(tasks, "sweep", beta=beta, prestress=prestress)) == {(PAPER, 1e-4)}
    (betas,) = {tuple(task.choice.job.betas) for task in tasks if task.command == "quasistatic"}
    assert min(betas) < 1e-6 and max(betas) > 10
    for name, on in (("4a", 1), ("4a-no-prestress", 0)):
        a = pictures[name]
        assert (a.kind, a.mu, vars(a)["lambda"], a.where) == ("collapse", 0.5, 0.0, f"beta=0,prestress={on}")
    assert pictures["4b"].kind == "moduli" and "pressure=1e-4" in pictures["4b"].where
    inset = pictures["4b-inset"]
    assert (inset.kind, inset.where) == ("viscosities", "pressure=1e-4")


def test_bt_figure_6_is_drag_in_a_fluid_at_four_pressures_and_ten_decades_of_it_at_one(parsers):
    tasks, pictures = asked(parsers, "bt-fig6")
    assert all(task.choice.job.law.family == "stokes" for task in tasks if task.command != "pack")
    assert set(by_pressure(tasks, "sweep", eta_f=1.0, prestress=True)) == AT_ALL
    for eta_f in decades(-5, 5):
        assert (PAPER, 1e-4) in by_pressure(tasks, "sweep", eta_f=eta_f, prestress=True)
    assert set(by_pressure(tasks, "quasistatic", eta_f=1.0)) == AT_ALL
    a, b = pictures["6a"], pictures["6b"]
    assert (a.kind, a.mu, vars(a)["lambda"], a.where) == ("collapse", 0.5, 1.0, "eta_f=1,prestress=1")
    assert (b.kind, b.where) == ("moduli", "command=sweep,pressure=1e-4,prestress=1")


def test_bt_figure_8_is_the_viscosity_of_many_sizes_under_both_laws(parsers):
    tasks, pictures = asked(parsers, "bt-fig8")
    for law, own in (("contact", {"beta": 1.0}), ("stokes", {"eta_f": 1.0})):
        slow = by_pressure(tasks, "quasistatic", law=law, prestress=True, **own)
        x = [p * n**2 for n, p in slow]
        assert min(x) < 1e-2 and max(x) > 1e4 and max(n for n, _ in slow) == PAPER
        for decade in range(0, 7):  # where at least three sizes can be compared
            inside = {n for n, p in slow if 0.1 <= p * n**2 / 10.0**decade <= 10}
            assert len(inside) >= (3 if decade < 6 else 2), decade
    for name, law, power in (("8a", "contact", 1.0), ("8b", "stokes", 1.09)):
        one = pictures[name]
        assert (one.kind, one.where, one.size_power) == ("finite-size", f"law={law}", power)


def test_sizes_of_a_figure_come_from_its_mode_or_the_environment():
    for words, sizes, n in (([], {}, 4096), (["--paper"], {}, 32768), (["--paper"], {"N": "16"}, 16)):
        (study,) = shown("bt-fig3", *words, **sizes)[0].values()
        assert f"n = {n}\n" in study
    done = subprocess.run([FIGURES / "bt-fig3", "--papers"], capture_output=True, text=True)
    assert done.returncode == 2 and "--papers: there are --quick, --paper, --kept and --show" in done.stderr


JAMMING = {  # of each figure, what Vågberg's papers I to III do: {(protocol, option): values that the study has}
    "paper1": {
        ("compress", "cooling-rate"): {1e-1, 1e-2, 1e-3},
        ("compress", "separated"): {False, True},
        ("compress", "strain"): {None, 3},
        ("shear", "separated"): {False, True, None},
        ("shear", "step"): {2e-3, 6.667e-4},
        ("random", "potential"): {None},
    },
    "paper2": {
        ("random", "n"): {32, 64, 128, 256},
        ("shear", "n"): {32, 64, 128},
        ("shear", "step"): {2e-3},
        ("shear", "phi"): {0.82, 0.83, 0.835, 0.84, 0.845, 0.85, 0.855},
    },
    "paper3": {
        (protocol, option): values
        for protocol in ("random", "shear")
        for option, values in (("phi", {0.84}), ("potential", {"harmonic", "hertzian"}), ("n", {64}))
    },
}
AT_THEIR_SIZE = {
    "paper1": {("compress", "cooling-rate"): {1e-1, 1e-2, 1e-3, 1e-4}},
    "paper2": {(protocol, "n"): {32, 64, 128, 256, 512, 1024} for protocol in ("random", "shear")},
    "paper3": {(protocol, "n"): {64, 256} for protocol in ("random", "shear")},
}


@pytest.mark.parametrize("name", JAMMING)
def test_studies_of_jamming_are_those_of_the_papers(name):
    for words, wanted in (([], JAMMING), (["--paper"], AT_THEIR_SIZE)):
        (study,) = shown(name, *words)[0].values()
        tables = tomllib.loads(study)["jam"]
        for (protocol, option), values in wanted[name].items():
            mine = [table.get(option) for table in tables if table["protocol"] == protocol]
            assert {one for some in mine for one in (some if isinstance(some, list) else [some])} == values


def test_corrections_to_scaling_are_fitted_beside_what_goes_without(parsers):
    lines = [words[1:] for words in shown("paper2")[1] if words[0] == "collapse"]
    fits = [parsers["collapse"].parse_args(words) for words in lines]
    asked = {(fit.where, fit.observable, fit.corrections) for fit in fits}
    assert len(asked) == len(fits) == 8 and all(fit.finite_size for fit in fits)
    assert {fit.fit for fit in fits if fit.corrections} == {"phi_J,y=0,nu,omega", "phi_J,y,nu,omega"}


def as_python(words):
    """A program's command line, for `launch.run_lines`."""
    argv = [str(launch.ROOT / words[0]), *words[1:]]
    begin = f"import runpy, sys\nsys.argv = {argv}\nsys.path.insert(0, {os.path.dirname(argv[0])!r})"
    return f"{begin}\nrunpy.run_path(sys.argv[0], run_name='__main__')"


def kind_of(words):
    """What a picture shares with those that differ from it in the rows that they take, or in their observable."""
    return words[0], words[words.index("--kind") + 1] if "--kind" in words else words[1]


def sizes(text):
    """{name: value} of NAME=VALUE …; several names that have one value with commas."""
    pairs = [word.split("=") for word in text.split()]
    return {name: value for names, value in pairs for name in names.split(",")}


TINY = sizes(
    "N,SHEARED=16 SEEDS=1:1 SAMPLES=1:3 SNAPSHOTS=2 PRESSURES=1e-2,1e-3 CUT=1 RANGE=0.7:0.9 STRAIN=0.6 DISCARD=0.3 "
    "RATES=0.1,0.05,0.03 RUNS,DRAG,CONTACT=0.1,0.05,0.03:0.6 MASSIVE,LARGE_RUNS,MASSIVE_RUNS=0.1,0.05:1.2 LARGE=20 "
    "COOLED=1:2 COOLING=0.1"
)
WHOLE = "bt-fig5"  # is run by its script
LESS = {  # a figure of which something has to be smaller, or must not be
    "bt-fig7": sizes("N=36 OMEGA=1e-7:10:3"),  # two disks in a lane
    "bt-fig8": sizes("SMALL,MIDDLE,LARGE=16 MANY,SOME,FEW=1:1"),
    "bt-modes": sizes("MODES=10"),
    "bt-nonlinear": sizes("STRESSES=1e-5 POINTS=3 PRESSURES=1e-2"),
    "paper1": sizes(
        "LIQUID=16 LARGE=20 SEVERAL,MIXED=1:2 MIXING=0.02 THIRD,RUNS=1:1 PHI=0.84,0.86 FIRST=0.06"
    )
    | sizes("STRAIN=0.1 DISCARD=0.04"),
    "paper2": sizes("SMALL=16 MIDDLE=20,24 SOME=1:3 WIDE=0.8,0.82,0.84,0.86,0.88 NARROW=0.82,0.84,0.86,0.88")
    | sizes("SLOW=20 STRAIN,LITTLE=0.1 DISCARD=0.04"),
    "paper3": sizes("STRAIN=0.1 DISCARD=0.04 RUNS=1:1"),
    "paper4": sizes("STRAIN=1.2 DISCARD=0.6 RATES=0.1,0.05 SLOW=0.03 PHI=0.78 HEAVY=1,10 HEAVIEST=10"),
    "paper5": sizes("SEEN=0.1:1.2 BETWEEN=0.05,0.03:1.2 PHI=0.83,0.86 QUALITY=1"),
    "softening": sizes("STRAINS=0.01,1 STEPS=16 CYCLES=3"),
    **dict.fromkeys(("vagberg-fig4.8", "vagberg-flow-curves"), sizes("RUNS=0.1,0.05:1.2")),
}


def test_every_figure_is_made(tmp_path):
    """Of each kind with the same options one picture: `test_a_figure_asks_for_what_there_is` looks at all words."""
    items, made, folders, drawn = [], [], {}, set()
    for name in STUDIES:
        if name == WHOLE:
            continue
        studies, pictures = shown(name, FOLDER=str(tmp_path / name), **TINY | LESS.get(name, {}))
        for n, (part, study) in enumerate(studies.items()):
            (tmp_path / f"{name}-{n}.toml").write_text(study)
            os.makedirs(os.path.dirname(part), exist_ok=True)
            if study in folders:  # that of another figure, for other pictures
                items.append(f"import shutil\nshutil.copytree({folders[study]!r}, {part!r})")
                continue
            folders[study] = part
            os.makedirs(part, exist_ok=True)
            items.append(["study", str(tmp_path / f"{name}-{n}.toml"), "--out", part])
        fits = [words for words in pictures if words[0] == "collapse"]
        for fit in fits[1:]:  # of another observable, and a second each
            pictures = [words for words in pictures if fit[fit.index("--out") + 1] not in words]
        pictures = [*{kind_of(words): words for words in reversed(pictures)}.values()][::-1]
        kinds = [(*kind_of(words), *sorted(word for word in words if word[:2] == "--")) for words in pictures]
        pictures = [
            words
            for words, kind in zip(pictures, kinds, strict=True)
            if words[0] != "plot" or "--kind" not in words or kind not in drawn
        ]
        drawn.update(kinds)
        items += [as_python(words) if is_program(words) else words for words in pictures]
        made += [words[words.index("--picture" if is_program(words) else "--out") + 1] for words in pictures]
    (tmp_path / "claims").mkdir()
    for name in JAMMING:  # claims that take few samples as they are
        (tmp_path / "claims" / f"{name}-quick").symlink_to(tmp_path / name)
    items.append(as_python(["benchmarks/reproduction.py", str(tmp_path / "claims"), "quick"]))
    said = launch.run_lines(tmp_path, items)
    assert all(said.count(f" | `{name}` | ") >= 2 for name in JAMMING)
    linear = "| 0.01 | 0.01 | 1 of 1 | 1.00 | 1.00 |"  # the least strain
    assert linear in said and "alpha = 0.6667" in said and "measured over self-consistent" in said
    for figure, claims in CLAIMS:
        if figure in ("bt-fig1", "bt-fig7", "bt-modes"):
            rows = list(claims(jampetsc.load(tmp_path / figure)))
            assert len(rows) >= 6 and all(np.isfinite(row.ours) and row.size for row in rows), figure
    flow = next((tmp_path / "vagberg-fig4.6-4.7").glob("flow-*.h5"))
    slim(flow, tmp_path / "kept.h5")  # without the positions that figures 4.6 and 4.7 show, with their order
    order, kept = (six_fold_order(jampetsc.load(path)) for path in (flow, tmp_path / "kept.h5"))
    np.testing.assert_allclose(kept, order, rtol=1e-6)
    assert "snapshots/positions" not in jampetsc.load(tmp_path / "kept.h5")
    assert len(made) > 20 and len(STUDIES) > 15
    for path in made:
        assert os.path.getsize(path) > 5000, path


def test_a_figure_does_without_a_task_that_fails(tmp_path):
    toml = "[pack]\nn = 24\nphi = [0.8, 0.95]\n"  # at 0.8 disks do not touch
    (tmp_path / "fig").write_text(f". {launch.ROOT}/run/figure\nstudy <<END\n{toml}END\necho drawn\n")
    environment = launch.environment() | {"FOLDER": str(tmp_path / "made")}
    done = subprocess.run(["bash", tmp_path / "fig"], env=environment, capture_output=True, text=True)
    assert done.returncode == 0 and "2 tasks, 1 failed" in done.stdout and done.stdout.endswith("drawn\n")


def test_a_figure_is_made_and_its_claims_are_looked_at(tmp_path):
    folder = tmp_path / f"{WHOLE}-quick"
    environment = launch.environment() | {"N": "16", "SEEDS": "1:2", "FOLDER": str(folder)}
    settings = {"env": environment, "capture_output": True, "text": True, "timeout": launch.MINUTES}
    done = subprocess.run([FIGURES / WHOLE], **settings)
    assert done.returncode == 0, done.stderr
    assert (folder / "5.png").stat().st_size > 5000 and (folder / "table.csv").exists()
    program = launch.ROOT / "benchmarks" / "reproduction.py"
    done = subprocess.run([sys.executable, program, tmp_path], **settings)
    assert done.returncode == 0, done.stderr
    rows = [line for line in done.stdout.splitlines()[2:]]
    assert len(rows) == 15 and all(row.count(" | ") == 6 and "`bt-fig5`" in row for row in rows)
    keeping = f"import keep, pathlib as p; keep.keep(p.Path({str(folder)!r}), p.Path({str(tmp_path)!r}))"
    subprocess.run([sys.executable, "-c", keeping], cwd=program.parent, check=True)
    with tarfile.open(tmp_path / f"{WHOLE}.tar.xz") as archive:
        archive.extractall(tmp_path / f"{WHOLE}-kept")
    kept = subprocess.run([sys.executable, program, tmp_path, "kept"], **settings)
    assert kept.stdout == done.stdout
    assert not list(tmp_path.glob(f"{WHOLE}-kept/pack-*"))
    assert os.path.getsize(tmp_path / f"{WHOLE}.tar.xz") < 1e5
