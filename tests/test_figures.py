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
STUDIES = sorted(path.name for path in FIGURES.iterdir() if "study <<" in path.read_text())


@pytest.fixture(scope="module")
def parsers():
    return commands.parsers_of(cli.Parser, [*KINDS, "plot", "collapse"])


def shown(name, *words, **environment):
    """(study, [words of a picture's command]) of a figure."""
    line = [str(FIGURES / name), "--show", *words]
    done = subprocess.run(line, env=os.environ | environment, capture_output=True, text=True, check=True)
    text = done.stdout.splitlines()
    pictures = [shlex.split(one)[1:] for one in text if one.startswith("jampetsc ")]
    return "\n".join(one for one in text if not one.startswith("jampetsc ")), pictures


@pytest.mark.parametrize("name", STUDIES)
def test_a_figure_asks_for_what_there_is(parsers, name):
    for words in ([], ["--paper"]):
        study, pictures = shown(name, *words)
        tasks = plan(name, study.encode(), {kind: parsers[kind] for kind in KINDS})
        columns = {"command", "file"}.union(*({*task.columns, "law", "model"} for task in tasks))
        formats = {"pack": "packing"}
        made = {formats.get(task.command, task.command) for task in tasks}
        made |= {"correlation", "velocity-correlation"} if "correlate" in made else set()
        assert pictures
        for words in pictures:
            parsers[words[0]].parse_args(words[1:])
        for picture in pictures:
            if picture[0] == "collapse" or picture[1].endswith(".h5"):
                continue
            args = parsers["plot"].parse_args(picture[1:])
            assert made.intersection(PICTURES[args.kind].of), args.kind
            assert not args.where or {word.split("=")[0] for word in args.where.split(",")} <= columns


def test_sizes_of_a_figure_come_from_its_mode_or_the_environment():
    assert "n = 4096\n" in shown("bt-fig3")[0] and "n = 32768\n" in shown("bt-fig3", "--paper")[0]
    assert "n = 16\n" in shown("bt-fig3", "--paper", N="16")[0]
    done = subprocess.run([FIGURES / "bt-fig3", "--papers"], capture_output=True, text=True)
    assert done.returncode == 2 and "--papers: there are --quick, --paper and --show" in done.stderr


TINY = {
    **{"N": "16", "SEEDS": "1:1", "SAMPLES": "1:3", "SNAPSHOTS": "2", "PRESSURES": "1e-2,1e-3", "CUT": "1"},
    **{"STRAIN": "1.2", "RATES": "0.1,0.05,0.03", "SHEARED": "16", "COOLED": "1:2", "COOLING": "0.1"},
}
LESS = {  # a figure of which something has to be smaller, or must not be
    **{"paper1": {"STRAIN": "0.1"}, "paper2": {"N": "16,20,24"}, "paper3": {"STRAIN": "0.1"}},
}


def test_every_figure_is_made(tmp_path):
    items, made = [], []
    for name in STUDIES:
        study, pictures = shown(name, FOLDER=str(tmp_path / name), **TINY | LESS.get(name, {}))
        (tmp_path / f"{name}.toml").write_text(study)
        items += [["study", str(tmp_path / f"{name}.toml"), "--out", str(tmp_path / name)], *pictures]
        made += [words[words.index("--out") + 1] for words in pictures]
    launch.run_lines(tmp_path, items)
    assert len(made) > 2 * len(STUDIES) > 20
    for path in made:
        assert os.path.getsize(path) > 5000, path


def test_a_figure_is_made_and_its_claims_are_looked_at(tmp_path):
    folder = tmp_path / "bt-fig5-quick"
    environment = launch.environment() | {"N": "16", "SEEDS": "1:2", "FOLDER": str(folder)}
    settings = {"env": environment, "capture_output": True, "text": True, "timeout": launch.MINUTES}
    done = subprocess.run([FIGURES / "bt-fig5"], **settings)
    assert done.returncode == 0, done.stderr
    assert (folder / "5.png").stat().st_size > 5000 and (folder / "table.csv").exists()
    program = launch.ROOT / "benchmarks" / "reproduction.py"
    done = subprocess.run([sys.executable, program, tmp_path], **settings)
    assert done.returncode == 0, done.stderr
    rows = [line for line in done.stdout.splitlines()[2:]]
    assert len(rows) == 10 and all(row.count(" | ") == 5 and "`bt-fig5`" in row for row in rows)
