"""README, docs, examples and figures: their commands and programs run as they are written, at small sizes."""

import json
import os
import re
import shlex
import subprocess
import sys

import launch
import pytest

from jampetsc import cli, commands
from jampetsc.studies.kinds import KINDS
from jampetsc.studies.plan import plan
from jampetsc.words.pictures import PICTURES

TIMEOUT = 300
SMALL = {  # option -> its value here
    **{"--n": "32", "--count": "5", "--seeds": "1:2", "--strain": "0.05", "--snapshots": "2"},
    **{"--phi": "0.86", "--discard": "0.01"},
}
KEPT = ("pack", "import")  # whose φ and seeds are those of files that later lines read
FREQUENCIES = {"oscillate": "1e-6"}  # command -> --omega here: each takes a while
LONG = "trade"  # runs commands for minutes; it has tests of its own


def blocks(name, language):
    """The ```language blocks of a document."""
    return re.findall(rf"```{language}\n(.*?)```", (launch.ROOT / name).read_text(), re.DOTALL)


def lines(name):
    """The command lines of a document as lists of words after `jampetsc`: those of its indented blocks."""
    found = re.findall(
        r"^    (?:mpirun -n \d+ )?jampetsc (.*)$", (launch.ROOT / name).read_text(), re.MULTILINE
    )
    return [shlex.split(line, comments=True) for line in found]


def small(words):
    """A command line at a size for tests."""
    words = list(words)
    for n in range(len(words) - 1):
        if words[n] in SMALL and not (words[0] in KEPT and words[n] in ("--seeds", "--phi")):
            words[n + 1] = SMALL[words[n]]
        if words[n] == "--omega":
            words[n + 1] = FREQUENCIES.get(words[0], words[n + 1])
    return words


def small_study(text):
    return re.sub(r'"1:\d+"', '"1:2"', re.sub(r"^n = \d+", "n = 16", text, flags=re.MULTILINE))


def run(folder, items):
    line = launch.command(0, "run_lines.py")
    done = subprocess.run(
        line,
        input=json.dumps(items),
        env=launch.environment(),
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
    )
    assert done.returncode == 0, f"{done.stderr[-2000:]}\n{items}"
    return done.stdout


def test_what_the_documents_say_runs(tmp_path):
    for name in ("tests", "options"):
        (tmp_path / name).symlink_to(launch.ROOT / name)
    (study,) = blocks("README.md", "toml")
    (tmp_path / "study.toml").write_text(small_study(study))
    together, apart = [], []
    for name in ("README.md", "docs/solvers.md"):
        for words in lines(name):
            if words[0] == LONG:
                cli.command_parser(words)[0].parse_args(words)
            else:
                (apart if _has_petsc_options(words) else together).append(small(words))
    python = [
        text.replace("n=256", "n=32")
        for name in ("README.md", "docs/python.md")
        for text in blocks(name, "python")
    ]
    assert len(together) > 20 and len(apart) > 1 and len(python) > 3
    run(tmp_path, together + python)
    for words in apart:  # one process has one set of them
        run(tmp_path, [words])
    for path in re.findall(r"--out (\S+)", (launch.ROOT / "README.md").read_text()):
        assert list(tmp_path.glob(re.sub(r"\{\w+\}", "*", path))) or path == "trade.csv", path


def _has_petsc_options(words):
    return any(re.match(r"-[a-z]", word) for word in words)


def test_links_between_documents_lead_somewhere():
    for path in [launch.ROOT / "README.md", *(launch.ROOT / "docs").glob("*.md")]:
        for target in re.findall(r"\]\(([^)#]+?)\)", path.read_text()):
            assert "://" in target or (path.parent / target).exists(), f"{path.name}: {target}"


def test_examples(tmp_path):
    def example(name, *words):
        path = str(launch.ROOT / "examples" / name)
        return f"import runpy, sys\nsys.argv = {[path, *words]}\nrunpy.run_path(sys.argv[0], run_name='__main__')"

    made = ["pack --n 16 --pressure 1e-2 --out p.h5", "sweep p.h5 --out s.h5", "quasistatic p.h5 --out q.h5"]
    said = run(
        tmp_path,
        [
            *(line.split() for line in made),
            example("reading_files.py", "p.h5", "s.h5", "q.h5"),
            example("ensemble_average.py", "16", "2"),
            example("own_law.py", "16"),
        ],
    )
    assert re.search(r"^16 disks, phi = 0\.\d+, Z = ", said, re.MULTILINE)
    assert re.search(r"median \|Δu⊥\|/\|Δu∥\| = \d", said)
    assert re.search(r"^G0 ~ p\^-?\d\.\d\d, eta0 ~ p\^-?\d\.\d\d$", said, re.MULTILINE)
    # one law is the sum of the others where they do not compete
    both, contacts, drag = map(
        float, re.search(r"^ +1e-06 +(\S+) +(\S+) +(\S+)$", said, re.MULTILINE).groups()
    )
    assert both == pytest.approx(contacts + drag, rel=1e-3)


# figures

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


def test_a_figure_is_made_and_its_claims_are_looked_at(tmp_path):
    folder = tmp_path / "bt-fig5-quick"
    environment = launch.environment() | {"N": "16", "SEEDS": "1:2", "FOLDER": str(folder)}
    settings = {"env": environment, "capture_output": True, "text": True, "timeout": TIMEOUT}
    done = subprocess.run([FIGURES / "bt-fig5"], **settings)
    assert done.returncode == 0, done.stderr
    assert (folder / "5.png").stat().st_size > 5000 and (folder / "table.csv").exists()
    program = launch.ROOT / "benchmarks" / "reproduction.py"
    done = subprocess.run([sys.executable, program, tmp_path], **settings)
    assert done.returncode == 0, done.stderr
    rows = [line for line in done.stdout.splitlines()[2:]]
    assert len(rows) == 10 and all(row.count(" | ") == 5 and "`bt-fig5`" in row for row in rows)
