"""The files of papers/figures: what they ask for exists, and each makes its pictures, at tiny sizes."""

import csv
import importlib.util
import os
import re
import shlex
import subprocess

import launch
import numpy as np
import pytest

import jampetsc
from jampetsc import main as cli
from jampetsc.commands import study_inputs
from jampetsc.io.disk_motion import six_fold_order
from jampetsc.plots import draw
from jampetsc.studies.plan import plan
from papers.claims import checks, correlations, low_modes, motion  # noqa: F401  they enter their claims
from papers.claims.shared import CLAIMS
from papers.keep import slim
from papers.show import GALLERY, SHOWN

FIGURE = launch.ROOT / "run" / "figure"
STUDIES = sorted(path.name for path in (launch.ROOT / "papers" / "figures").iterdir())


@pytest.fixture(scope="module")
def parsers():
    return {
        name: cli.command_parser([name])[1].choices[name] for name in (*study_inputs(), "plot", "collapse")
    }


def shown(name, *words, **environment):
    """({folder: study}, [words of a picture's command, or of a program of papers/]) of a figure."""
    line = [FIGURE, name, "--show", *words]
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
    """Whether a picture is made by a program of papers/: words -m MODULE FOLDER …."""
    return picture[0] == "-m"


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
                assert importlib.util.find_spec(picture[1])
                assert all(part.startswith(picture[2]) for part in studies)
                continue
            args = parsers[picture[0]].parse_args(picture[1:])
            if picture[0] == "collapse" or picture[1].endswith(".h5"):
                continue
            assert made.intersection(kinds[args.kind].of), args.kind
            assert not args.where or {word.split("=")[0] for word in args.where.split(",")} <= columns


def test_sizes_of_a_figure_come_from_its_mode_or_the_environment():
    for words, sizes, n in (([], {}, 4096), (["--paper"], {}, 32768), (["--paper"], {"N": "16"}, 16)):
        (study,) = shown("bt-fig3", *words, **sizes)[0].values()
        assert f"n = {n}\n" in study
    done = subprocess.run([FIGURE, "bt-fig3", "--papers"], capture_output=True, text=True)
    assert done.returncode == 2 and "--papers: not supported. Give one of --quick, --paper," in done.stderr
    done = subprocess.run([FIGURE, "bt-fig2"], capture_output=True, text=True)
    assert (
        done.returncode == 2
        and "bt-fig2: missing. Give one of papers/figures: above-jamming, bt-fig1, bt-fig3," in done.stderr
    )


JAMMING = ("paper1", "paper2", "paper3")  # whose claims take few samples as they are


def test_corrections_to_scaling_are_fitted_beside_what_goes_without(parsers):
    lines = [words[1:] for words in shown("paper2")[1] if words[0] == "collapse"]
    fits = [parsers["collapse"].parse_args(words) for words in lines]
    asked = {(fit.where, fit.observable, fit.corrections) for fit in fits}
    assert len(asked) == len(fits) == 8 and all(fit.finite_size for fit in fits)
    assert {fit.fit for fit in fits if fit.corrections} == {"phi_J,y=0,nu,omega", "phi_J,y,nu,omega"}


def as_python(words):
    """The command line -m MODULE … of a program, for `launch.run_lines`."""
    _, module, *options = words
    return f"import runpy, sys\nsys.argv = {[module, *options]}\nrunpy.run_module({module!r}, run_name='__main__')"


def kind_of(words):
    """What a picture shares with those that differ from it in the rows that they take, or in their observable."""
    last = words[-1] if is_program(words) else words[1]
    return words[0], words[words.index("--kind") + 1] if "--kind" in words else last


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
ALIKE = (  # as others are, but for laws, models, rates and the dimension; their kinds of pictures are drawn elsewhere
    *(
        "bt-fig3",
        "bt-fig6",
        "paper5",
        "three-dimensions",
        "three-dimensions-flow",
        "three-dimensions-jamming",
    ),
    *("vagberg-fig4.8", "vagberg-fig5.1-slow", "vagberg-flow-curves", "walls"),
)
SAME = "bt-fig7cd-in-phase-with-the-strain"  # of bt-fig7cd, of the other phase
FEWER = {  # in the studies: pressures, frequencies and models that pictures and claims can do without
    '"1e-2", "1e-3", "1e-4", "1e-5"': '"1e-2", "1e-4"',
    ":121": ":25",
    '"1e-6", "1e-5", "1e-4", "1e-3", "1e-2", "1e-1", 1, 10': '"1e-6", "1e-2", 1',
    "1e-8,1e-7,1e-6,1e-5,1e-4,1e-3,1e-2,1e-1,1,1e1,1e2": "1e-8,1e-4,1,1e2",
    'lane = "0.5,0.25,0.125"': 'lane = "0.5,0.25"',
    "strain = 3e-7": "strain = 6e-8",
    "step = 2e-3\n": "step = 1e-2\n",
    "accuracy = 1e-2\n": "accuracy = 1e-1\n",
}
LESS = {  # a figure of which something has to be smaller, or must not be
    "bt-fig7": sizes("N=36 OMEGA=1e-7:10:3"),  # two disks in a lane
    "bt-fig8": sizes("SMALL,MIDDLE,LARGE,LARGEST=16 MANY,SOME,FEW,LAST=1:1"),
    "bt-modes": sizes("MODES=10"),
    "bt-nonlinear": sizes("STRESSES=1e-5 POINTS,LARGE_POINTS=2 PRESSURES=1e-2"),
    "contact-lifetimes": sizes(
        "RATE=0.05 SLOW=0.03 BOUND,SLOW_BOUND=0.4 EVERY,COLLISION,SLOW_COLLISION=0.02"
    ),
    "crystals": sizes("SEEDS=2 STRAIN=0.02 SPHERES=16 SPHERE_SEEDS=2 SPHERE_STRAIN=0.02"),
    "finite-size-flow": {
        "CELLS": "16:0.2:3e-4,2e-4,1e-4 20:0.2:3e-4,2e-4,1e-4 24:0.2:3e-4,2e-4,1e-4",
        "OTHERS": "16:0.1:3e-4",
        "SLOW": "24:0.2:5e-5",
    },
    "lees-edwards": sizes("RATE=0.1"),
    "large-oscillations": sizes("STRAINS=1e-3,1e-2 STEPS=16"),
    "overdamped-limit": sizes("RATE=0.1 DRAG_STRAIN,CONTACT_STRAIN,PARTIAL_STRAIN=0.6")
    | {"QUALITY": "1,0.3", "LIGHT": "1,0.8"},
    "paper1": sizes(
        "LIQUID=16 LARGE=20 SEVERAL,MIXED=1:2 MIXING=0.02 THIRD,RUNS=1:1 PHI=0.84,0.86 FIRST=0.06"
    )
    | sizes("STRAIN=0.1 DISCARD=0.04"),
    "paper2": sizes("SMALL=16 MIDDLE=20,24 SOME=1:3 WIDE=0.8,0.82,0.84,0.86,0.88 NARROW=0.82,0.84,0.86,0.88")
    | sizes("SLOW=20 STRAIN,LITTLE=0.1 DISCARD=0.04"),
    "paper3": sizes("STRAIN=0.1 DISCARD=0.04 RUNS=1:1"),
    "paper4": sizes("STRAIN=0.6 DISCARD=0.3 RATES=0.1,0.05 SLOW=0.03 PHI=0.78 HEAVY=1,10 HEAVIEST=10"),
    "preparation": sizes("SEEDS=2"),
    "relaxation": sizes("N=24 STARTS=2"),
    "sharp-transition": sizes("RATE=0.05 POINTS=2"),
    "softening": sizes("PRESSURES=1e-2 STRAINS=0.01,1 STEPS=16 CYCLES=3"),
    "split-coordinates": sizes("N=64"),
    "step-strain": sizes("PRESSURES=1e-2 STRAINS=0.01,1"),
    "vagberg-fig5.1": sizes("WIDE=0.7,0.95 WIDE_RUNS=0.1,0.05:0.6"),
}


@pytest.mark.allowed_seconds(900)
def test_figures_are_made(tmp_path):
    """Of each kind with the same options one picture: `test_a_figure_asks_for_what_there_is` looks at all words."""
    items, made, folders = [], [], {}
    for name in STUDIES:
        if name in (WHOLE, *ALIKE):
            continue
        studies, pictures = shown(name, FOLDER=str(tmp_path / name), **TINY | LESS.get(name, {}))
        # what `jampetsc plot` draws has tests of its own
        pictures = [words for words in pictures if words[0] != "plot" and SAME not in words[-1]]
        for n, (part, study) in enumerate(studies.items() if pictures else ()):
            for written, here in FEWER.items():
                study = study.replace(written, here)
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
    (tmp_path / "claims").mkdir()
    for name in JAMMING:
        (tmp_path / "claims" / f"{name}-quick").symlink_to(tmp_path / name)
    items.append(as_python(["-m", "papers.reproduction", str(tmp_path / "claims"), "quick"]))
    said = launch.run_lines(tmp_path, items)
    entries = list(csv.DictReader((tmp_path / "claims" / "claims.csv").open()))
    assert all(sum(entry["figure"] == name for entry in entries) >= 2 for name in JAMMING)
    linear = "| 0.01 | 0.01 | 1 of 1 | 1.00 | 1.00 |"  # the least strain
    assert linear in said and "alpha = 0.6667" in said and "measured over self-consistent" in said
    for (figure, *_), claims in CLAIMS:
        if figure in ("bt-fig1", "bt-fig7", "bt-modes"):
            rows = list(claims(jampetsc.load(tmp_path / figure)))
            assert len(rows) >= 6 and all(np.isfinite(row.ours.value) and row.size for row in rows), figure
    flow = next((tmp_path / "vagberg-fig4.6-4.7").glob("flow-*.h5"))
    slim(flow, tmp_path / "kept.h5")  # without the positions that figures 4.6 and 4.7 show, with their order
    order, kept = (six_fold_order(jampetsc.load(path)) for path in (flow, tmp_path / "kept.h5"))
    np.testing.assert_allclose(kept, order, rtol=1e-6)
    assert "snapshots/positions" not in jampetsc.load(tmp_path / "kept.h5")
    relaxed = next((tmp_path / "step-strain").rglob("relax-*.h5"))
    slim(relaxed, tmp_path / "relaxed.h5")  # with all that the table of its figure reads
    assert "contacts_opened" in jampetsc.load(tmp_path / "relaxed.h5")
    assert len(made) > 20 and len(STUDIES) > 15
    for path in made:
        assert os.path.getsize(path) > 5000, path


def test_the_gallery_has_the_pictures_that_its_page_shows_and_figures_make():
    shown_there = set(
        re.findall(
            r"\(\.\./\.\./papers/gallery/(\S+)\.png\)",
            (launch.ROOT / "docs" / "papers" / "gallery.md").read_text(),
        )
    )
    files = {path.stem: path.stat().st_size for path in GALLERY.iterdir()}
    assert shown_there == set(files) == {name for some in SHOWN.values() for name in some.values()}
    assert max(files.values()) < 2.5e5
    for figure, some in SHOWN.items():
        made = {os.path.basename(word) for words in shown(figure)[1] for word in words}
        made |= {name.replace(".h5", ".png") for name in made}
        assert made >= {f"{name}.png" for name in some}, figure


def test_a_figure_does_without_a_task_that_fails(tmp_path):
    toml = "[pack]\nn = 24\nphi = [0.8, 0.95]\n"  # at 0.8 disks do not touch
    (tmp_path / "papers" / "figures").mkdir(parents=True)
    (tmp_path / "papers" / "figures" / "fails").write_text(f"study <<END\n{toml}END\necho drawn\n")
    for name in ("run", ".venv"):
        (tmp_path / name).symlink_to(launch.ROOT / name)
    environment = launch.environment() | {"FOLDER": str(tmp_path / "made")}
    line = [tmp_path / "run" / "figure", "fails"]
    done = subprocess.run(line, env=environment, capture_output=True, text=True)
    assert done.returncode == 0 and "2 tasks, 1 failed" in done.stdout and done.stdout.endswith("drawn\n")


def test_a_figure_may_be_a_table_alone(tmp_path):
    for folder in ("figures", "tables"):
        (tmp_path / "papers" / folder).mkdir(parents=True)
    for package in (tmp_path / "papers", tmp_path / "papers" / "tables"):
        (package / "__init__.py").touch()
    (tmp_path / "papers" / "figures" / "told").write_text("tables told --n 3\n")
    (tmp_path / "papers" / "tables" / "told.py").write_text("import sys\nprint(sys.argv[2:])\n")
    for name in ("run", ".venv"):
        (tmp_path / name).symlink_to(launch.ROOT / name)
    folder, line = tmp_path / "made", [tmp_path / "run" / "figure", "told"]
    done = subprocess.run(
        line, env=launch.environment() | {"FOLDER": str(folder)}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert (
        (folder / "told.md").read_text() == done.stdout == f"['--picture', '{folder}/told.png', '--n', '3']\n"
    )


def test_a_figure_is_made_and_its_claims_are_looked_at(tmp_path):
    folder, kept, archive = (tmp_path / f"{WHOLE}{ending}" for ending in ("-quick", "-kept", ".tar.xz"))
    environment = launch.environment() | {"N": "16", "SEEDS": "1:2", "FOLDER": str(folder)}
    done = subprocess.run([FIGURE, WHOLE], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (folder / "5.png").stat().st_size > 5000 and (folder / "table.csv").exists()
    table = ["-m", "papers.reproduction", str(tmp_path)]
    paths = f"p.Path({str(folder)!r}), p.Path({str(tmp_path)!r})"
    keeping = f"from papers import keep; import pathlib as p; keep.keep({paths})"
    unpacking = f"import tarfile; tarfile.open({str(archive)!r}).extractall({str(kept)!r}); print('unpacked')"
    said = launch.run_lines(tmp_path, [as_python(table), keeping, unpacking, as_python([*table, "kept"])])
    made, again = said.split("unpacked\n")
    rows = [line for line in made.splitlines() if line.startswith(r"| mean \|Δu∥\| levels off")]
    assert len(rows) == 1 and rows[0].count(" | ") == 4
    assert (
        sum(line.startswith("| ") for line in made.splitlines()) == 2
    )  # of so small packings one claim alone
    assert again == made and (tmp_path / "claims.csv").exists()
    assert not list(kept.glob("pack-*")) and archive.stat().st_size < 1e5
