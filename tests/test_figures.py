"""The scripts of run/figures: what they ask for exists, and each makes its pictures, at tiny sizes."""

import os
import shlex
import subprocess
import sys

import launch
import pytest

from jampetsc import cli, commands
from jampetsc.studies.kinds import KINDS
from jampetsc.studies.plan import plan
from jampetsc.words.pictures import PICTURES

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
    **{
        "N": "16",
        "SEEDS": "1:1",
        "SAMPLES": "1:3",
        "SNAPSHOTS": "2",
        "PRESSURES": "1e-2,1e-3",
        "CUT": "1",
        "RANGE": "0.7:0.9",
    },
    **{
        "STRAIN": "1.2",
        "DISCARD": "0.6",
        "RATES": "0.1,0.05,0.03",
        "RUNS": "0.1,0.05,0.03:1.2",
        "LARGE": "20",
    },
    **dict.fromkeys(("DRAG", "CONTACT"), "0.1,0.05,0.03:1.2"),
    **dict.fromkeys(("MASSIVE", "LARGE_RUNS", "MASSIVE_RUNS"), "0.1,0.05:1.2"),
    **{"SHEARED": "16", "COOLED": "1:2", "COOLING": "0.1"},
}
WHOLE = "bt-fig5"  # is run by its script
LESS = {  # a figure of which something has to be smaller, or must not be
    **{"paper1": {"STRAIN": "0.1"}, "paper2": {"N": "16,20,24"}, "paper3": {"STRAIN": "0.1"}},
    "paper4": {"RATES": "0.1,0.05", "SLOW": "0.03", "PHI": "0.78", "HEAVY": "1,10", "HEAVIEST": "10"},
    "paper5": {"SEEN": "0.1:1.2", "BETWEEN": "0.05,0.03:1.2", "PHI": "0.83,0.86", "QUALITY": "1"},
    **{name: {"RUNS": "0.1,0.05:1.2"} for name in ("vagberg-fig4.8", "vagberg-flow-curves")},
    **{
        "softening": {"STRAINS": "0.01,1", "STEPS": "16", "CYCLES": "3"},
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
    assert len(rows) == 10 and all(row.count(" | ") == 6 and "`bt-fig5`" in row for row in rows)
