"""README, docs and examples: their commands and programs run as they are written, at small sizes."""

import importlib.util
import re
import runpy
import subprocess
import sys

import launch
import pytest
from written_commands import small, small_study

import jampetsc
from jampetsc import main as cli
from jampetsc.commands import JOBS, job_class
from jampetsc.options.parameters import OPTION, parameters

SMALL_PYTHON = {  # python in a document -> here
    **{
        "n=256": "n=32",
        "n=64": "n=32",
        "size=64": "size=16",
        "n = 256": "n = 64",
        "n = 320": "n = 32",
        "range(1, 7)": "range(1, 3)",
        "range(1, 61)": "range(1, 3)",
        "range(1, 5)": "range(1, 4)",
        "1e-4, 3e-3, 5": "3e-3, 1e-1, 5",
    },
    **{'"1:16"': '"1:2"', "1e-1, 1e-5, 9": "3e-2, 1e-3, 5", "strain=6.0": "strain=1.2"},
    **{"strain=6\n": "strain=1.2, discard=0.2\n", "strain=6,": "strain=1.2, discard=0.2,"},
    **{"step=2e-4": "step=1e-3", "strain=3)": "strain=1.2, discard=0.2)", "discard=1.0": "discard=0.2"},
}
NUMPY_REPR = r"\bnp\.\w+\("  # of a number in numpy 2, which no reader expects
LONG = "trade"  # runs commands for minutes; it has tests of its own


def blocks(name, language):
    """The ```language blocks of a document."""
    return re.findall(rf"```{language}\n(.*?)```", (launch.ROOT / name).read_text(), re.DOTALL)


def pages(pattern):
    """Names of documents, relative to the root, by a pattern below docs/."""
    return sorted(str(path.relative_to(launch.ROOT)) for path in (launch.ROOT / "docs").glob(pattern))


def python_blocks(names):
    """The python of documents at a size for tests."""
    found = [text for name in names for text in blocks(name, "python")]
    for written, here in SMALL_PYTHON.items():
        found = [text.replace(written, here) for text in found]
    return found


def commands_to_run(names):
    """The command lines of documents at a size for tests, each once; those that take minutes are only parsed."""
    commands = []
    for name in names:
        for words in launch.command_lines((launch.ROOT / name).read_text()):
            if words[0] == LONG:
                cli.command_parser(words)[0].parse_args(words)
            elif small(words) not in commands:
                commands.append(small(words))
    return commands


def write_studies(name, folder):
    """Write the toml of a document at a size for tests, under the names that it has there."""
    paths = dict.fromkeys(re.findall(r"`(\w+\.toml)`", (launch.ROOT / name).read_text()))
    for study, path in zip(blocks(name, "toml"), paths, strict=True):
        (folder / path).write_text(small_study(study))


INDEX = "docs/howto/index.md"
SHARED = ["README.md", INDEX]  # share their files, with the python of pages that have no commands


@pytest.mark.allowed_seconds(900)
def test_what_the_documents_say_runs(tmp_path):
    """README with the list of tasks; a tutorial, a task or a page of theory needs no files but its own."""
    alone = sorted({*pages("tutorials/*.md"), *pages("howto/*.md"), *pages("theory/*.md")} - {INDEX})
    items = {}
    for name in (INDEX, *alone):
        folder = tmp_path / name.replace("/", "-")
        folder.mkdir()
        for linked in ("tests", "options"):
            (folder / linked).symlink_to(launch.ROOT / linked)
        write_studies(name, folder)
        if name == INDEX:
            commands = commands_to_run(SHARED)
            python = python_blocks([*SHARED, "docs/index.md", "docs/reference/python.md"])
            assert len(commands) > 20 and len(python) > 3
            shared = folder
        else:
            commands, python = commands_to_run([name]), python_blocks([name])
        items[folder] = commands + python
    said = launch.run_pages(items)
    assert not re.search(NUMPY_REPR, said), re.findall(rf".*{NUMPY_REPR}.*", said)
    for path in re.findall(r"--out (\S+)", (launch.ROOT / INDEX).read_text()):
        assert list(shared.glob(re.sub(r"\{\w+\}", "*", path))) or path == "trade.csv", path


@pytest.mark.parametrize("name", pages("developer/*.md") + pages("*.md"))
def test_commands_in_other_documents_can_be_parsed(name):
    for words in launch.command_lines((launch.ROOT / name).read_text()):
        cli.command_parser(words)[0].parse_args(words)


def test_the_site_has_every_page_and_every_name(tmp_path):
    text = (launch.ROOT / "mkdocs.yml").read_text()
    listed, docs = re.findall(r"[:-] ([\w/]+\.md)$", text, re.MULTILINE), launch.ROOT / "docs"
    assert sorted(listed) == sorted(str(path.relative_to(docs)) for path in docs.rglob("*.md"))
    entries, commands = ((docs / "reference" / name).read_text() for name in ("api.md", "commands.md"))
    for name in {*jampetsc.__all__, "models.CD0", "loads.compression"} - {"__version__"}:
        assert f"\n## jampetsc.{name}\n\n" in entries
    assert "`law` | jampetsc.ContactDamping(…), jampetsc.StokesDrag(…)" in entries
    assert "Packing(\n    positions, radii, cell, potential=" in entries  # how to make one
    for name in JOBS:
        entry = commands.partition(f"\n## {name}\n\n")[2].partition("\n## ")[0]
        assert all(
            option.word in entry for option in parameters(job_class(name)).values() if option.place == OPTION
        )
    cells = runpy.run_path(str(launch.ROOT / "run" / "notebook.py"))["cells"]
    for name in pages("tutorials/*.md"):
        pieces = [text.strip("\n") for text in blocks(name, "python")]
        assert [text for kind, text in cells((launch.ROOT / name).read_text()) if kind == "code"] == pieces


def test_formulas_of_the_site_are_mathml():
    convert = runpy.run_path(str(launch.ROOT / "run" / "equations.py"))["on_page_content"]
    shown = convert(r'<p>a <span class="arithmatex">\(G^* &lt; \eta_0\)</span></p>')
    assert "<math" in shown and "<mi>η</mi>" in shown.replace("&#x003B7;", "η") and "arithmatex" not in shown


def test_the_site_builds(tmp_path):
    """All but the run of the notebooks, whose pieces other tests run; run/docs builds all."""
    if not all(map(importlib.util.find_spec, ("material", "latex2mathml"))):
        return  # run/docs installs them
    text = (launch.ROOT / "mkdocs.yml").read_text().replace("  - run/notebook.py\n", "")
    for folder in ("docs", "run"):
        (tmp_path / folder).symlink_to(launch.ROOT / folder)
    (tmp_path / "mkdocs.yml").write_text(text)
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", "site"]
    settings = {"cwd": tmp_path, "capture_output": True, "text": True, "timeout": launch.MINUTES}
    done = subprocess.run(build, env=launch.environment() | {"NO_MKDOCS_2_WARNING": "1"}, **settings)
    assert done.returncode == 0, done.stderr
    site = tmp_path / "site"
    pages_made = {path: path.read_text() for path in site.rglob("*.html")}
    for path, page in pages_made.items():
        for target in re.findall(
            r'<(?:a|img)[^>]* (?:href|src)="([^"#?:]+)["#?]', page if path.name != "404.html" else ""
        ):
            assert (path.parent / target).exists(), f"{path.relative_to(site)}: {target}"
    fetched = r'<(?:script|link|img)[^>]*(?:src|href)="?(?:https?:)?//(?!jampetsc)'
    assert len(pages_made) > 15 and not any(re.search(fetched, page) for page in pages_made.values())


def test_one_version_in_all_entries_to_cite():
    words = {"README.md": r"version = \{(.*?)\}", "CITATION.cff": r"^version: (.*)$"}
    for name, pattern in words.items():
        text = (launch.ROOT / name).read_text()
        assert re.findall(pattern, text, re.MULTILINE) == [jampetsc.__version__], name


def test_links_between_documents_lead_somewhere():
    for path in [launch.ROOT / "README.md", *(launch.ROOT / "docs").rglob("*.md")]:
        for target in re.findall(r"\]\(([^)#]+?)\)", path.read_text()):
            assert "://" in target or (path.parent / target).exists(), f"{path.name}: {target}"


def test_examples(tmp_path):
    def example(name, *words):
        path = str(launch.ROOT / "examples" / name)
        return f"import runpy, sys\nsys.argv = {[path, *words]}\nrunpy.run_path(sys.argv[0], run_name='__main__')"

    runs = {
        "reading_files.py": ["p.h5", "s.h5", "q.h5"],
        "ensemble_average.py": ["16", "2"],
        "own_law.py": ["16"],
        "own_packing.py": ["32"],
        "diffusion.py": ["16", "1"],
        "other_programs.py": ["16"],
        "matrices.py": ["16"],
        "contact_forces.py": ["16", "p.h5"],
        "own_figure.py": ["16"],
        "ovito_picture.py": ["p.h5", "ovito.png"],
    }
    assert set(runs) == {path.name for path in (launch.ROOT / "examples").glob("*.py")}
    if not importlib.util.find_spec("ovito"):  # 500 MB: CI has it
        del runs["ovito_picture.py"]
    made = ["pack --n 16 --pressure 1e-2 --out p.h5", "sweep p.h5 --out s.h5", "quasistatic p.h5 --out q.h5"]
    items = [line.split() for line in made] + [example(name, *words) for name, words in runs.items()]
    said = launch.run_lines(tmp_path, [*items, example("own_packing.py", "0", "packing.dump")])
    energies = re.findall(r"^energy \D*(\d\S+?),?(?: |$)", said, re.MULTILINE)
    assert len(energies) == 3 and float(energies[0]) == pytest.approx(float(energies[1]), rel=1e-8)
    assert re.search(r"^16 disks, phi = 0\.\d+, Z = ", said, re.MULTILINE)
    assert re.search(r"median \|Δu⊥\|/\|Δu∥\| = \d", said)
    assert re.search(r"^G0 ~ p\^-?\d\.\d\d, eta0 ~ p\^-?\d\.\d\d$", said, re.MULTILINE)
    table = jampetsc.load(tmp_path / "ensemble-n16")
    spread = [float(line.split()[1]) for line in said.partition("<dy^2>/d^2")[2].splitlines()[1:7]]
    assert 0.0 < spread[0] < spread[3] < 1.0  # folded coordinates would jump by the height of the cell
    assert len(table.where(command="sweep").mean_curve("G", by="pressure")) == 3
    pressures = [float(p) for p in re.findall(r"^\w+\.\w+ +p = (\S+) k$", said, re.MULTILINE)]
    assert len(pressures) >= 3 and pressures == pytest.approx([1e-2] * len(pressures), rel=1e-4)
    differences = [float(one) for one in re.findall(r"from the sweep (\S+)$", said, re.MULTILINE)]
    assert len(differences) == 3 and max(differences) < 1e-12
    assert re.search(r"pressure from the contacts (0\.01\d*|0\.00999\d*) k, of the packing 0\.01 k", said)
    for name in ("figure.pdf", "ensemble-n16/collapse.png"):
        assert (tmp_path / name).stat().st_size > 10_000
    # one law is the sum of the others where they do not compete
    losses = re.search(r"^ +1e-06 +(\S+) +(\S+) +(\S+)$", said, re.MULTILINE).groups()
    both, contacts, drag = map(float, losses)
    assert both == pytest.approx(contacts + drag, rel=1e-3)
