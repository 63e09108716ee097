"""What pip makes of the tree: the package is found from every folder, and a wheel has all that comes with it."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile

import launch
import pytest
from samples import published

import jampetsc
from jampetsc import main as cli
from jampetsc.io.packing_file import write_packing

SHIPPED = {"options": "options", "examples": "examples", "slurm": "run/slurm"}  # in a copy -> in the tree


def run(words, folder):
    """What a program prints in a folder, with nothing but its own installation to find modules in."""
    clean = {name: value for name, value in launch.environment().items() if name != "PYTHONPATH"}
    done = subprocess.run(list(map(str, words)), cwd=folder, env=clean, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.strip()


def test_a_clone_named_like_the_package_does_not_stand_for_it_in_the_folder_above(tmp_path):
    (tmp_path / "jampetsc").symlink_to(launch.ROOT)
    code = "import jampetsc; print(jampetsc.__version__, jampetsc.__file__)"
    assert run([sys.executable, "-c", code], tmp_path).endswith(f" {launch.ROOT}/jampetsc/__init__.py")


def test_a_wheel_in_a_fresh_environment(tmp_path):
    """With PETSc and numpy of the system, and nothing of the tree: it computes, with options of its own files.

    Four to six seconds: pip builds and installs, and python compiles what is imported.
    """
    tree, fresh = tmp_path / "tree", tmp_path / "fresh"  # setuptools leaves its work in the tree
    for name in ("jampetsc", "options", "examples", "run/slurm"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(launch.ROOT / name, tree / name, symlinks=True, ignore=ignored)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(launch.ROOT / name, tree)
    pip = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check"]
    run([*pip, "wheel", "--no-index", "--no-deps", "--no-build-isolation", "-w", tmp_path, tree], tmp_path)
    (wheel,) = tmp_path.glob("jampetsc-*.whl")
    shutil.rmtree(tree)
    run([sys.executable, "-m", "venv", "--system-site-packages", "--without-pip", fresh], tmp_path)
    install = ["install", "--no-compile", "--no-index", "--no-deps", wheel]
    run([*pip, "--python", fresh / "bin" / "python", *install], tmp_path)
    write_packing(tmp_path / "p.h5", published())
    (installed,) = fresh.glob("lib/python3*/site-packages/jampetsc")
    assert (installed / "py.typed").exists() and (installed / "__init__.pyi").exists()  # for type checkers
    program = fresh / "bin" / "jampetsc"
    words = (
        "sweep p.h5 --out s.h5 --method direct --omega 1 -options_file jampetsc:superlu_dist -options_left no"
    )
    run([program, *words.split()], tmp_path)
    assert "superlu_dist" in jampetsc.load(tmp_path / "s.h5").attributes["petsc_options"]
    run([program, "examples", "--copy", "mine"], tmp_path)
    for copy, original in SHIPPED.items():
        names = {path.name for path in (launch.ROOT / original).iterdir() if path.is_file()}
        assert {path.name for path in (tmp_path / "mine" / copy).iterdir()} == names
        for name in names:
            held = (tmp_path / "mine" / copy / name).read_bytes()
            assert held == (launch.ROOT / original / name).read_bytes()


def test_pip_does_not_replace_the_packages_of_the_distribution(tmp_path):
    """A later numpy is refused; one that is forced in is found and removed. Three seconds, for starts of pip."""
    fresh = tmp_path / "with a space"
    run([sys.executable, "-m", "venv", "--system-site-packages", "--without-pip", fresh], tmp_path)
    (site,) = fresh.glob("lib/python3*/site-packages")
    (site / "pip").symlink_to(importlib.util.find_spec("pip").submodule_search_locations[0])
    with zipfile.ZipFile(tmp_path / "numpy-99-py3-none-any.whl", "w") as wheel:
        wheel.writestr("numpy/__init__.py", "raise ValueError('numpy.dtype size changed')")
        wheel.writestr("numpy-99.dist-info/METADATA", "Metadata-Version: 2.1\nName: numpy\nVersion: 99\n")
        wheel.writestr(
            "numpy-99.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        wheel.writestr("numpy-99.dist-info/RECORD", "")
    python, script = fresh / "bin" / "python", launch.ROOT / "run" / "distribution.py"
    install = [python, "-m", "pip", "install", "-q", "--no-index", "--find-links", tmp_path]
    environment = launch.environment()

    def status(words, **variables):
        done = subprocess.run(words, env=environment | variables, capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    assert status([python, script]) == (0, "")
    refused, told = status([*install, "numpy>=99"])
    assert refused and "conflicting dependencies" in told
    assert status([*install, "h5py"])[0] == 0  # of the distribution, though its metadata have another name
    assert status([*install, "numpy>=99"], PIP_CONSTRAINT=os.devnull)[0] == 0
    assert status([python, "-c", "import numpy"])[0]
    repaired, told = status([python, script])
    assert repaired == 0 and "numpy 99 in place of the distribution's" in told
    assert status([python, "-c", "import numpy, h5py"]) == (0, "")
    (site / "matplotlib.py").write_text(
        "raise RuntimeError('damaged')"
    )  # nothing that pip knows: .venv is made anew
    failed, told = status([python, script])
    assert failed == 1 and "matplotlib" in told and "Traceback" not in told


def test_the_demo_shows_means_and_powers_with_errors(tmp_path):
    """At a tiny size, with the installation that runs the tests. Seven programs start: four seconds."""
    (tmp_path / "run").mkdir()
    text = (launch.ROOT / "run" / "demo").read_text()
    for asked, less in (
        ("n = 1024", "n = 16"),
        ('"1:8"', '"1:2"'),
        ("-n1024-", "-n16-"),
        ("cores < 4 ? cores : 4", "1"),
    ):
        assert asked in text
        text = text.replace(asked, less)
    (tmp_path / "run" / "demo").write_text(text)
    (tmp_path / "run" / "setup").symlink_to("/bin/true")
    (tmp_path / "run" / "environment").symlink_to(launch.ROOT / "run" / "environment")
    (tmp_path / ".venv").symlink_to(sys.prefix)
    shown = run(["bash", "run/demo"], tmp_path)
    assert "18 tasks, 0 failed" in shown
    assert len(re.findall(r"(?m)^   p = 1e-0[234] .*( ± .*){3}$", shown)) == 6
    assert len(re.findall(r"(?m)^   power of p .*( ± .*){3}$", shown)) == 2
    for name in re.findall(r"demo/\S+\.(?:png|h5)", shown):
        assert (tmp_path / name).is_file()


def test_a_copy_goes_into_a_new_folder_and_names_of_files_are_told(tmp_path, capsys):
    assert cli.main(["examples", "--copy", str(tmp_path)]) == 2
    assert f"--copy {tmp_path}: exists. Give the name of a new folder" in capsys.readouterr().err
    assert os.listdir(tmp_path) == []
    assert cli.main(["trade", "p.h5", "--out", "t.csv", "--options-files", "jampetsc:mump"]) == 2
    assert (
        "jampetsc:mump: no such options file. Choose one of jampetsc:iterative, " in capsys.readouterr().err
    )


def test_what_a_job_of_slurm_leaves_is_a_study(tmp_path):
    """Submitted from any folder; `srun` is left out. A figure has to be told where the clone is."""
    folder = launch.ROOT / "run" / "slurm"
    own = {"N": "16", "SEEDS": "1:1", "LAUNCH": "", "TREE": ""}
    own["PATH"] = f"{os.path.dirname(sys.executable)}:/usr/bin:/bin"
    job = {"cwd": tmp_path, "env": launch.environment() | own, "capture_output": True, "text": True}
    done = subprocess.run(["bash", folder / "ensemble.sbatch"], **job)
    assert done.returncode == 0, done.stderr
    table = jampetsc.load(tmp_path / "ensemble-n16")
    assert sorted(table.where(command="sweep")["pressure"]) == pytest.approx([1e-4, 1e-3, 1e-2])
    assert all(len(sweep.omega) == 141 for sweep in table.where(command="sweep").results())
    done = subprocess.run(["bash", folder / "figure.sbatch", "bt-fig3"], **job)
    assert done.returncode and "say where the clone is: TREE=" in done.stderr


def test_what_conda_installs_is_what_pip_asks_for():
    project = tomllib.loads((launch.ROOT / "pyproject.toml").read_text())["project"]
    names = {re.match(r"\w+", asked)[0] for asked in project["dependencies"]} - {"matplotlib"}
    names |= {"matplotlib-base", "python", "mpi4py", "petsc4py", "slepc4py"}
    recipe = (launch.ROOT / "recipe" / "meta.yaml").read_text()
    assert f'version = "{jampetsc.__version__}"' in recipe
    run_part = recipe[recipe.index("  run:") : recipe.index("test:")]
    for text in (run_part, (launch.ROOT / "environment.yml").read_text()):
        assert names <= set(re.findall(r"^ +- ([\w-]+)", text, re.MULTILINE))
        for name in ("petsc", "slepc"):
            assert re.search(rf"- {name}(=\*=| \* )real_\*$", text, re.MULTILINE)
