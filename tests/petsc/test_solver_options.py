"""PETSc's options: which a command takes, what is said of the others, and of options files that PETSc cannot read."""

import importlib
import re

import launch
import pytest
from samples import polydisperse

from jampetsc.commands import JOBS, job_class
from jampetsc.errors import InputError
from jampetsc.io.packing_file import write_packing
from jampetsc.petsc import solver_options
from jampetsc.petsc.solver_options import check, option_names

OWNED = {name: job_class(name).SOLVERS for name in JOBS}
TAKEN = (  # of PETSc itself, of objects without a prefix, and of solvers, in any case
    "sweep -log_view :x -options_left no -malloc_debug false -objects_dump no -citations -nox -info -Shift_x -1",
    "sweep -mat_view ::ascii_info -vec_view -on_error_abort -start_in_debugger -help -blas_view -use_gpu_aware_mpi 0",
    "modes -modes_st_mat_mumps_icntl_14 50 -shift_pc_type lu -INERTIA_pc_type lu",
    "oscillate -osc_factor_pc_type lu -osc_snes_monitor",
    "study -freq_pc_type lu -osc_snes_view -newton_pc_type lu",
)


@pytest.mark.parametrize("line", TAKEN)
def test_an_option_is_petscs_or_of_a_solver_of_the_command(line):
    command, *words = line.split()
    check(command, OWNED, words)


def test_what_is_said_knows_every_solver_and_every_command():
    homes = {
        "shift_": ("petsc.shifted", "PREFIX"),
        "freq_": ("response.direct", "PREFIX"),
        "inertia_": ("petsc.inertia", "PREFIX"),
        "modes_": ("petsc.eigen", "PREFIX"),
        "newton_": ("petsc.hessian_solver", "PREFIX"),
        "osc_": ("oscillation.cycle_solver", "NEWTON_PREFIX"),
        "osc_factor_": ("oscillation.harmonic_preconditioner", "FACTOR_PREFIX"),
    }
    for prefix, (home, name) in homes.items():
        assert getattr(importlib.import_module(f"jampetsc.{home}"), name) == prefix
    assert set(solver_options.SOLVERS) == set(homes)
    assert {one for name in JOBS for one in job_class(name).SOLVERS} == set(solver_options.SOLVERS)


@pytest.mark.parametrize("path", sorted((launch.ROOT / "options").glob("*.opts")), ids=lambda path: path.stem)
def test_files_that_are_ready_to_use_are_taken_by_their_command(path):
    command = re.search(r"jampetsc (\w+) PACKING", path.read_text())[1]
    words = ["-options_file", str(path)]
    check(command, OWNED, words)
    assert len(option_names(words)) > 1
    with pytest.raises(InputError, match="PETSc option -"):
        check("flow", OWNED, words)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("# why\n\n-a 1 # and why\n  -b_c\nalias x y\n", ["a", "b_c"]),
        ("-a é\n", ["a"]),
        ("", []),
        ("-a 1\n# -\n -1 2\n", "line 3: -1: not an option. Begin options with -, comments with #"),
        ("-a\n\nb 1 # -b 1\n", "line 3: b: not an option. Begin"),
        ("aliases x\n", "line 1: aliases: not an option. Begin"),
        ("--a 1\n", "line 1: --a: not an option. Begin"),
    ],
)
def test_what_an_options_file_may_hold(tmp_path, content, expected):
    path, other = tmp_path / "a.opts", tmp_path / "a.yaml"  # PETSc's other language
    other.write_text("a: 1\n")
    assert option_names(["-options_file", str(other)]) == ["options_file"]
    for encoding in ("utf-8", "latin-1"):
        path.write_bytes(content.encode(encoding))
        words = ["-x", "-options_file", str(path), "-y"]
        if isinstance(expected, list):
            assert option_names(words) == ["x", "options_file", *expected, "y"]
        else:
            with pytest.raises(InputError, match=f"^{path}: {re.escape(expected)}"):
                option_names(words)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-a", "x\ny"], r"x\ny: PETSc takes printable text only. Use another name."),
        (["-a", "\udcff"], r"\udcff: PETSc takes printable text only"),
        (["-options_file"], "-options_file: no name of a file. Give one."),
        (["-options_file", ""], "-options_file: no name of a file. Give one."),
        (["-options_file", "/none.yml"], "/none.yml: No such file or directory. Give a PETSc options file"),
        (["-options_file", "/"], "/: a folder. Give a regular file"),
    ],
)
def test_words_that_petsc_cannot_have(words, message):
    with pytest.raises(InputError) as refused:
        option_names(words)
    assert str(refused.value).startswith(message)


def test_options_files_that_name_others(tmp_path, monkeypatch):
    """PETSc follows them, also those that name each other: until its stack was full."""
    monkeypatch.chdir(tmp_path)
    for name, content in (
        ("a", "-a 1\n-options_file b.opts\n"), ("b", '-B_c\n-Options_File "sub/c.opts" # why\n'), ("sub/c", "-d\n"),
        ("self", "-options_file ./self.opts"), ("one", "-options_file two.opts"), ("two", "-options_file one.opts"),
        ("ours", "-options_file jampetsc:mumps"), ("gone", "-options_file none.opts"),
        *((f"n{n}", f"-options_file n{n + 1}.opts\n" * 2) for n in range(8)), ("n8", ""),
    ):  # fmt: skip
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / f"{name}.opts").write_text(content)
    names = ["options_file", "a", "options_file", "B_c", "Options_File", "d"]
    assert option_names(["-options_file", "a.opts"]) == names
    with pytest.raises(InputError, match="PETSc option -a: "):
        check("sweep", OWNED, ["-options_file", "a.opts"])
    for name, message in (
        (
            "self",
            r"\./self\.opts: named by itself, in self\.opts, so reading would not end\. Remove that line\.$",
        ),
        ("two", r"two\.opts: named by itself, in one\.opts, so"),
        ("ours", r"ours\.opts: -options_file jampetsc:mumps: PETSc takes paths only"),
        ("gone", r"none\.opts: No such file or directory, named in gone.opts. Give"),
        ("n0", "n0.opts: names more than 100 options files"),
    ):
        with pytest.raises(InputError, match=message):
            option_names(["-options_file", f"{name}.opts"])


# What PETSc says


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    path = tmp_path_factory.mktemp("packing") / "p.h5"
    write_packing(path, polydisperse(3)[0])
    return path


def run(packing, folder, line, ranks=0):
    """The finished `jampetsc` of a command line; PACKING is the packing."""
    words = line.replace("PACKING", str(packing)).split()
    return launch.run(ranks, "../jampetsc/__main__.py", *words, cwd=folder)


@pytest.mark.parametrize("ranks", [0, 2])
def test_of_a_value_that_petsc_refuses_there_is_one_line(packing, tmp_path, ranks):
    said = {
        "sweep PACKING --out o.h5 -shift_pc_type foo": "-shift_pc_type foo: Unable to find requested PC type foo",
        "pack --n 16 --phi 0.95 --seed 1 --out o.h5 -newton_pc_type lu": "-newton_pc_type lu: MatSolverType cholmod",
    }
    lines = [*said][: None if ranks == 0 else 1]
    for line in lines:
        done = run(packing, tmp_path, line, ranks)
        told = [text for text in done.stderr.splitlines() if text.startswith("jampetsc")]
        assert len(told) == 1 and told[0].startswith(f"jampetsc: error: {said[line]}"), done.stderr
        assert done.returncode == 2 and "Traceback" not in done.stderr and "Option left" not in done.stdout
        assert not (tmp_path / "o.h5").exists()


@pytest.mark.parametrize(
    ("ranks", "line", "left"),
    [
        (2, "modes PACKING --count 3 -shift_pc_typ lu -modes_eps_tol 1e-12 -modes_st_pc_type cholesky", 1),
        (0, "sweep PACKING --omega 1 -options_left", 0),
        (0, "sweep PACKING --omega 1 -log_view :log", None),  # nothing of solvers was given
    ],
)
def test_what_nobody_asked_for_petsc_says_at_its_end(packing, tmp_path, ranks, line, left):
    """Defaults of the program that no solver came to ask for are none of the user's."""
    done = run(packing, tmp_path, f"{line} --out o.h5", ranks)
    assert done.returncode == 0 and (tmp_path / "o.h5").exists()
    said = [text for text in done.stdout.splitlines() if "ption" in text]
    unused = [text for text in said if text.startswith("Option left")]
    assert len(unused) == (left or 0) and ("There are no unused options" in done.stdout) == (left == 0)
    assert bool(said) == (left is not None) and all("-shift_pc_typ value: lu" in text for text in unused)
