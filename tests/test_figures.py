"""The scripts of run/figures: what they ask for exists, and each makes its pictures, at tiny sizes."""

import os
import shlex
import subprocess
import sys
import tomllib

import launch
import numpy as np
import pytest

import jampetsc
from jampetsc import cli, commands
from jampetsc.studies.kinds import KINDS
from jampetsc.studies.plan import plan
from jampetsc.words.frequencies import parse_omega
from jampetsc.words.pictures import PICTURES

sys.path.insert(0, str(launch.ROOT / "benchmarks"))
from claims import motion  # noqa: F401  it enters its claims
from claims.shared import CLAIMS

FIGURES = launch.ROOT / "run" / "figures"
STUDIES = sorted(path.name for path in FIGURES.iterdir())


@pytest.fixture(scope="module")
def parsers():
    return commands.parsers_of(cli.Parser, [*KINDS, "plot", "collapse"])


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
    for words in ([], ["--paper"]):
        studies, pictures = shown(name, *words)
        kinds = {kind: parsers[kind] for kind in KINDS}
        tasks = [task for part, study in studies.items() for task in plan(part, study.encode(), kinds)]
        columns = {"command", "file"}.union(*({*task.columns, "law", "model"} for task in tasks))
        formats = {"pack": "packing"}
        made = {formats.get(task.command, task.command) for task in tasks}
        made |= {"correlation", "velocity-correlation"} if "correlate" in made else set()
        assert pictures
        for picture in pictures:
            if is_program(picture):
                assert (launch.ROOT / picture[0]).exists() and all(
                    part.startswith(picture[1]) for part in studies
                )
                continue
            args = parsers[picture[0]].parse_args(picture[1:])
            if picture[0] == "collapse" or picture[1].endswith(".h5"):
                continue
            assert made.intersection(PICTURES[args.kind].of), args.kind
            assert not args.where or {word.split("=")[0] for word in args.where.split(",")} <= columns


def asked(name, *words):
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
    decades = ["1e-2", "1e-3", "1e-4", "1e-5"]
    for name, pressures in (
        ("bt-fig1", "1e-4"),
        ("bt-fig5", decades),
        ("bt-fig7", decades),
        ("bt-modes", decades),
    ):
        tables, _ = asked(name, *words)
        (pack,) = tables["pack"]
        assert set(pack) == {"n", "pressure", "seeds"} and pack["pressure"] == pressures
        sizes = pack["n"] if isinstance(pack["n"], list) else [pack["n"]]
        first, last = map(int, pack["seeds"].split(":"))
        assert not words or (max(sizes) == 32768 and last - first + 1 >= 10)
    tables, pictures = asked("bt-fig1", *words)
    (sweep,) = tables["sweep"]
    assert sweep == {
        "omega": "1e-10:1e4:141",
        "fields": "1e-10,1e-3,1e4",
    }  # β = 1 with rotations and pre-stress
    assert picture_of(pictures, "moduli") and picture_of(pictures, "fields", "--total", "stress")
    tables, pictures = asked("bt-fig5", *words)
    assert tables["quasistatic"] == [{}] and picture_of(pictures, "medians")
    tables, pictures = asked("bt-fig7", *words)
    contact, stokes = tables["sweep"]
    assert "law" not in contact and contact["omega"] == contact["fields"] == "1e-9,1e-3,1e3"  # twelve decades
    assert (stokes["law"], stokes["eta-f"]) == ("stokes", 0) and stokes["omega"] == stokes["fields"]
    omega = parse_omega(stokes["fields"])
    assert (
        all(np.isclose(omega, 10**power).any() for power in (-6.5, -5.5)) and len(tables["pack"][0]["n"]) == 2
    )
    (correlate,) = tables["correlate"]
    assert correlate == {"lane": "0.5,0.25,0.125", "phase": ["stress", "strain"]}
    for law in ("law=contact,phase=stress", "law=stokes,eta_f=0,phase=stress"):
        assert any("correlation" in line and any(law in word for word in line) for line in pictures)
    lengths = [line for line in pictures if "length" in line and any("phase=stress" in word for word in line)]
    assert [line[-2:] == ["--log-exponent", "-0.65"] for line in lengths] == [
        False,
        True,
    ]  # as printed is the default
    tables, pictures = asked("bt-modes", *words)
    assert tables["modes"] == [{"count": 200, "no-prestress": True}] and picture_of(pictures, "lowest-modes")


def test_the_modes_of_the_figure_are_found_by_slepc():
    script = (FIGURES / "bt-modes").read_text()
    assert 'study "" -modes_eps_type krylovschur <<END' in script


def test_sizes_of_a_figure_come_from_its_mode_or_the_environment():
    for words, sizes, n in (([], {}, 4096), (["--paper"], {}, 32768), (["--paper"], {"N": "16"}, 16)):
        (study,) = shown("bt-fig3", *words, **sizes)[0].values()
        assert f"n = {n}\n" in study
    done = subprocess.run([FIGURES / "bt-fig3", "--papers"], capture_output=True, text=True)
    assert done.returncode == 2 and "--papers: there are --quick, --paper and --show" in done.stderr


def as_python(words):
    """A program's command line, for `launch.run_lines`."""
    argv = [str(launch.ROOT / words[0]), *words[1:]]
    return f"import runpy, sys\nsys.argv = {argv}\nrunpy.run_path(sys.argv[0], run_name='__main__')"


def kind_of(words):
    """What a picture shares with those that differ from it in the rows that they take, or in their observable."""
    return words[0], words[words.index("--kind") + 1] if "--kind" in words else words[1]


TINY = {
    **{"N": "16", "SEEDS": "1:1", "SAMPLES": "1:3", "SNAPSHOTS": "2", "PRESSURES": "1e-2,1e-3", "CUT": "1"},
    **{"STRAIN": "1.2", "RATES": "0.1,0.05,0.03", "SHEARED": "16", "COOLED": "1:2", "COOLING": "0.1"},
}
WHOLE = "bt-fig5"  # is run by its script
LESS = {  # a figure of which something has to be smaller, or must not be
    **{"paper1": {"STRAIN": "0.1"}, "paper2": {"N": "16,20,24"}, "paper3": {"STRAIN": "0.1"}},
    **{"paper4": {"RATES": "0.1,0.05"}, "paper5": {"RATES": "0.1,0.05"}},
    **{
        "softening": {"STRAINS": "0.01,1", "STEPS": "16", "CYCLES": "3"},
        "bt-fig7": {"N": "64", "OMEGA": "1e-7:10:3"},  # two disks in a lane
        "bt-modes": {"MODES": "10"},
        "bt-nonlinear": {"STRESSES": "1e-5", "POINTS": "3", "PRESSURES": "1e-2"},
    },
}


def test_every_figure_is_made(tmp_path):
    """Of each kind the first picture: `test_a_figure_asks_for_what_there_is` looks at the words of all."""
    items, made, folders = [], [], {}
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
        items += [as_python(words) if is_program(words) else words for words in pictures]
        made += [words[words.index("--picture" if is_program(words) else "--out") + 1] for words in pictures]
    said = launch.run_lines(tmp_path, items)
    linear = "| 0.01 | 0.01 | 1 of 1 | 1.00 | 1.00 |"  # the least strain
    assert linear in said and "alpha = 0.6667" in said and "measured over self-consistent" in said
    for figure, claims in CLAIMS:
        if figure in ("bt-fig1", "bt-fig7", "bt-modes"):
            rows = list(claims(jampetsc.load(tmp_path / figure)))
            assert len(rows) >= 6 and all(np.isfinite(row.ours) and row.size for row in rows), figure
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
    assert len(rows) == 21 and all(row.count(" | ") == 6 and "`bt-fig5`" in row for row in rows)
