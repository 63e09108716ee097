"""The door to PETSc: which build is taken, whose options win, and what is never started."""

import ctypes
import functools
import gc
import importlib.util
import os
import re
import subprocess
import sys
import weakref
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from types import SimpleNamespace

import launch
import pytest
import samples

import jampetsc.petsc.session
from jampetsc.cli import main as cli
from jampetsc.collective import own_cores
from jampetsc.errors import InputError
from jampetsc.io.packing_file import write_packing
from jampetsc.petsc import builds

BLOCK = """
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("mpi4py", "petsc4py", "slepc4py"):
            raise ImportError(f"{name} was asked for")
sys.meta_path.insert(0, Blocker())
"""


def python(code, **variables):
    """Run `code` in a python of its own."""
    environment = launch.environment() | variables
    finished = {"capture_output": True, "text": True, "timeout": 60, "env": environment}
    return subprocess.run([sys.executable, "-c", code], **finished)


def folder(build):
    return {name: str(path) for name, path in build.variables.items()}


def distribution(scalar):
    return next(build for build in builds.distribution_builds() if build.scalar == scalar)


# Nothing is started by importing


def test_every_module_imports_without_mpi_and_petsc():
    modules = sorted(
        ".".join(path.relative_to(launch.ROOT).with_suffix("").parts)
        for path in Path(jampetsc.__file__).parent.rglob("*.py")
        if path.stem not in ("__main__", "__init__")
    )
    assert "jampetsc.petsc.session" in modules and "jampetsc.io.reader" in modules
    code = (
        BLOCK + "".join(f"import {module}\n" for module in modules) + "print(jampetsc.load, jampetsc.Disks)"
    )
    done = python(code)
    assert done.returncode == 0, done.stderr


def test_importing_the_package_loads_no_numpy():
    done = python("import jampetsc, jampetsc.cli.main, sys; assert 'numpy' not in sys.modules")
    assert done.returncode == 0, done.stderr


def test_no_such_attribute():
    with pytest.raises(AttributeError, match="no attribute 'lode'"):
        jampetsc.lode  # noqa: B018


def test_no_session_before_start():
    done = python("from jampetsc.petsc import session; session.current()")
    assert "RuntimeError: no session: call jampetsc.petsc.session.start() first" in done.stderr


@pytest.mark.parametrize(
    "asked, most", [({"OMP_NUM_THREADS": "2,1"}, 2), ({"OMP_NUM_THREADS": "2", "OMP_THREAD_LIMIT": "3"}, 3)]
)
def test_openmp_keeps_to_the_threads_asked_for(asked, most):
    """CHOLMOD asks for four in its own code; libgomp, which it is built with, says how many it gets."""
    code = "import ctypes\nfrom jampetsc.petsc import session\nsession.start()\n"
    done = python(f"{code}print(ctypes.CDLL('libgomp.so.1').omp_get_thread_limit())", **asked)
    assert done.stdout == f"{most}\n", done.stderr


# Which build


def make_build(root, name, suffix=EXTENSION_SUFFIXES[0]):
    lib = root / "petscdir" / name / "lib/python3/dist-packages/petsc4py/lib"
    lib.mkdir(parents=True)
    (lib / f"PETSc{suffix}").touch()


def test_newest_build_for_this_python_comes_first(tmp_path):
    make_build(tmp_path, "petsc3.9/any-linux-gnu-real")
    make_build(tmp_path, "petsc3.18/any-linux-gnu-real-debug")
    make_build(tmp_path, "petsc3.18/any-linux-gnu-real")
    make_build(tmp_path, "petsc64-3.20/any-linux-gnu-real")
    make_build(tmp_path, "petsc3.19/any-linux-gnu-complex")
    make_build(tmp_path, "petsc3.22/any-linux-gnu-real", suffix=".cpython-30-other.so")
    found = builds.distribution_builds(tmp_path)
    names = [str(build.petsc_dir.relative_to(tmp_path / "petscdir")) for build in found]
    assert names == [
        "petsc3.19/any-linux-gnu-complex",
        "petsc3.18/any-linux-gnu-real",
        "petsc3.9/any-linux-gnu-real",
        "petsc64-3.20/any-linux-gnu-real",
        "petsc3.18/any-linux-gnu-real-debug",
    ]
    assert found[0].scalar == "complex" and found[1].scalar == "real"
    assert found[1].slepc_dir == tmp_path / "slepcdir/slepc3.18/any-linux-gnu-real"


@pytest.mark.parametrize(("scalar", "chosen"), [(None, "real"), ("complex", "complex")])
def test_real_is_preferred_to_a_newer_complex_build(tmp_path, scalar, chosen):
    make_build(tmp_path, "petsc3.18/any-linux-gnu-real")
    make_build(tmp_path, "petsc3.19/any-linux-gnu-complex")
    code = (
        "import os\nfrom jampetsc.petsc import builds\n"
        f"builds.distribution_builds.__defaults__ = ({str(tmp_path)!r},)\n"
        f"with builds.selected({scalar!r}): print(os.environ['PETSC_DIR'])"
    )
    assert python(code).stdout.rstrip().endswith(f"any-linux-gnu-{chosen}")


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A distribution's root, in which builds can be made, and no petsc4py loaded or the user's own."""
    find = importlib.util.find_spec
    monkeypatch.setattr(
        builds, "distribution_builds", functools.partial(builds.distribution_builds, tmp_path)
    )
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "petsc4py" else find(name))
    monkeypatch.setattr(sys, "path", [*sys.path])
    for name in ("petsc4py", "slepc4py"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    for name in ("PETSC_DIR", "SLEPC_DIR", "PETSC_ARCH"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


def variables_of(scalar=None):
    """PETSC_DIR and SLEPC_DIR while a build is selected, without the root."""
    with builds.selected(scalar):
        return tuple(os.environ.get(name) for name in ("PETSC_DIR", "SLEPC_DIR"))


def test_variables_are_as_before_when_a_build_has_been_selected(installed, monkeypatch):
    make_build(installed, "petsc3.18/any-linux-gnu-real")
    petsc, slepc = (str(installed / f"{one}dir/{one}3.18/any-linux-gnu-real") for one in ("petsc", "slepc"))
    before = len(sys.path)
    assert variables_of() == (petsc, slepc)
    assert not {"PETSC_DIR", "SLEPC_DIR"} & os.environ.keys()
    assert sys.path[0] == f"{petsc}/lib/python3/dist-packages" and len(sys.path) == before + 1
    lib = installed / "slepcdir/slepc3.18/any-linux-gnu-real/lib/python3/dist-packages/slepc4py/lib"
    lib.mkdir(parents=True)
    (lib / f"SLEPc{EXTENSION_SUFFIXES[0]}").touch()
    variables_of()
    assert sys.path[:2] == [f"{one}/lib/python3/dist-packages" for one in (petsc, slepc)]
    monkeypatch.setenv("PETSC_DIR", petsc)  # the user's own, with a SLEPc beside it
    assert variables_of() == (petsc, slepc) and os.environ["PETSC_DIR"] == petsc
    assert "SLEPC_DIR" not in os.environ
    monkeypatch.setenv("SLEPC_DIR", "/other")
    assert variables_of() == (petsc, "/other") and os.environ["SLEPC_DIR"] == "/other"


def test_nothing_is_chosen_where_petsc4py_is_loaded_or_the_users_own(installed, monkeypatch):
    make_build(installed, "petsc3.18/any-linux-gnu-real")
    assert builds.to_choose("real") and not builds.to_choose("complex")
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "petsc4py", sys)
        assert variables_of() == (None, None) and not builds.to_choose("real")
    with monkeypatch.context() as patch:
        patch.setattr(
            importlib.util, "find_spec", lambda name: SimpleNamespace(origin="/own/petsc4py/__init__.py")
        )
        assert variables_of() == (None, None) and not builds.to_choose("real")
    with monkeypatch.context() as patch:  # the distribution's, on the path
        inside = str(installed / "petscdir/petsc3.18/any-linux-gnu-real/lib/petsc4py/__init__.py")
        patch.setattr(importlib.util, "find_spec", lambda name: SimpleNamespace(origin=inside))
        assert variables_of()[0] and builds.to_choose("real")
    monkeypatch.setenv("PETSC_DIR", "/own")
    assert not builds.to_choose("real")


def test_an_own_petsc_may_have_its_petsc4py_under_its_arch_or_on_the_path(installed, monkeypatch):
    lib = installed / "own" / "arch-opt" / "lib" / "petsc4py" / "lib" / "arch-opt"
    lib.mkdir(parents=True)
    (lib / f"PETSc{EXTENSION_SUFFIXES[0]}").touch()
    monkeypatch.setenv("PETSC_DIR", str(installed / "own"))
    with pytest.raises(InputError, match="no petsc4py for this python there"):
        variables_of()
    monkeypatch.setenv("PETSC_ARCH", "arch-opt")
    assert variables_of()[0] == str(installed / "own")
    assert sys.path[0] == str(installed / "own" / "arch-opt" / "lib")
    monkeypatch.delenv("PETSC_ARCH")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: SimpleNamespace(origin="/own/x.py"))
    assert variables_of()[0] == str(installed / "own")


def test_a_build_without_petsc4py_for_this_python_is_none(installed):
    make_build(installed, "petsc3.18/any-linux-gnu-real", suffix=".cpython-30-other.so")
    make_build(installed, "petsc3.18/any-linux-gnu-mixed")
    assert builds.distribution_builds() == []
    with pytest.raises(InputError, match=r"no petsc4py \(real scalars\) for"):
        variables_of()
    assert builds.remedy("real").endswith("configured --with-scalar-type=real")


@pytest.mark.parametrize("scalar", ["real", "complex"])
def test_either_build_is_chosen_by_the_program(scalar):
    done = python(f"from jampetsc.petsc import session; print(session.start({scalar!r}).scalar_type)")
    assert done.stdout.strip() == scalar, done.stderr


def test_real_is_preferred_where_both_would_do():
    assert (
        python("from jampetsc.petsc import session; print(session.start().scalar_type)").stdout.strip()
        == "real"
    )


def test_own_petsc_dir_is_respected():
    code = "from jampetsc.petsc import session; print(session.start().scalar_type)"
    assert python(code, PETSC_DIR=folder(distribution("complex"))["PETSC_DIR"]).stdout.strip() == "complex"


def test_own_petsc_dir_of_the_other_scalar_type():
    own = folder(distribution("real"))
    done = python("from jampetsc.petsc import session; session.start('complex')", **own)
    line = done.stderr.splitlines()[-1]
    assert line.startswith(f"jampetsc.errors.InputError: complex scalars are needed and {own['PETSC_DIR']}")
    assert "unset PETSC_DIR and SLEPC_DIR" in line and str(distribution("complex").petsc_dir) in line


def test_slepc_of_another_petsc():
    mixed = folder(distribution("real")) | {"SLEPC_DIR": folder(distribution("complex"))["SLEPC_DIR"]}
    line = python("from jampetsc.petsc import session; session.start('real')", **mixed).stderr.splitlines()[
        -1
    ]
    assert line.startswith(f"jampetsc.errors.InputError: {mixed['SLEPC_DIR']}")
    assert line.endswith("set PETSC_DIR and SLEPC_DIR to one pair, or unset both")


def test_petsc_dir_without_petsc4py(tmp_path):
    done = python("from jampetsc.petsc import session; session.start('real')", PETSC_DIR=str(tmp_path))
    assert f"InputError: PETSC_DIR={tmp_path}: no petsc4py for this python there" in done.stderr


def test_own_petsc4py_on_the_path_is_respected():
    own = distribution("complex")
    paths = [str(path / "lib/python3/dist-packages") for path in (own.petsc_dir, own.slepc_dir)]
    # the distribution's is told by where it lies; seen from a root without builds it is the user's own
    code = (
        f"import sys; sys.path[:0] = {paths}\n"
        "from jampetsc.petsc import builds, session\n"
        "builds.distribution_builds.__defaults__ = ('/nowhere',)\n"
        "print(session.start().scalar_type)\n"
        "session.start('real')"
    )
    done = python(code)
    assert done.stdout.strip() == "complex"
    assert "use a petsc4py and slepc4py whose PETSc was configured --with-scalar-type=real" in done.stderr


def test_no_petsc4py_at_all():
    code = (
        "from jampetsc.petsc import builds, session\n"
        "builds.distribution_builds.__defaults__ = ('/nowhere',)\n"
        "session.start('complex')"
    )
    line = python(code).stderr.splitlines()[-1]
    assert "no petsc4py (complex scalars)" in line and "run/setup installs it" in line


# Options


def probe(*words, **variables):
    """The probe command with real scalars; it solves with prefix probe_, and defaults preonly and jacobi."""
    finished = {"capture_output": True, "text": True, "timeout": 60, "env": launch.environment() | variables}
    return subprocess.run(launch.command(0, "probe.py", "probe", "x", "--scalar", "real", *words), **finished)


def test_command_line_wins_over_options_file_wins_over_default(tmp_path):
    options = tmp_path / "my solver.opts"
    options.write_text("# why\n-probe_ksp_type cg\n-probe_pc_type none # and why\n")
    done = probe("-options_file", options, "-probe_pc_type", "sor")
    assert "types cg sor" in done.stdout, done.stderr
    assert "types preonly jacobi" in probe("-options_left", "no").stdout


def test_options_that_serve_other_programs_too_are_left_alone():
    done = probe("-probe_pc_type", "none", PETSC_OPTIONS="-other_program 1")
    assert done.returncode == 0 and "types preonly none" in done.stdout, done.stderr


# In the running session


@pytest.mark.scalar("real", "complex")
def test_session_describes_itself(session):
    assert session.scalar_type == os.environ["JAMPETSC_TEST_SCALAR"]
    assert session.PETSc.ScalarType(0).dtype.kind == {"real": "f", "complex": "c"}[session.scalar_type]
    assert session.SLEPc.EPS().create(session.comm).getComm().size == session.size == session.comm.size
    assert session.rank == session.comm.rank


@pytest.mark.scalar("real", "complex")
def test_starting_again(session):
    assert jampetsc.petsc.session.start() is jampetsc.petsc.session.start(session.scalar_type) is session
    assert jampetsc.petsc.session.current() is session
    with pytest.raises(RuntimeError, match="first session"):
        jampetsc.petsc.session.start(petsc_argv=["-log_view"])
    with pytest.raises(InputError, match="one process loads one"):
        jampetsc.petsc.session.start({"real": "complex", "complex": "real"}[session.scalar_type])


@pytest.mark.scalar("real", "complex")
def test_a_child_process_chooses_its_own_build(session):
    assert session.scalar_type not in os.environ.get("PETSC_DIR", "")
    assert session.scalar_type not in os.environ.get("SLEPC_DIR", "")


@pytest.mark.scalar("real", "complex")
def test_defaults_do_not_override(session):
    database = session.PETSc.Options()
    database.setValue("Twice_type", "given")
    session.set_defaults({"twice_type": "default", "twice_count": 3, "twice_flag": None})
    session.set_defaults({"twice_count": 4})
    found = {name: value for name, value in session.options().items() if name.lower().startswith("twice")}
    assert found == {"Twice_type": "given", "twice_count": "4", "twice_flag": None}
    for name in found:
        database.delValue(name)


@pytest.mark.scalar("real", "complex")
def test_versions_for_the_record(session):
    versions = jampetsc.petsc.session.versions()
    assert list(versions) == ["numpy", "h5py", "mpi4py", "mpi", "petsc", "slepc", "mumps"]
    assert "unknown" not in versions.values()


@pytest.mark.scalar("real", "complex")
def test_objects_dropped_on_one_rank_only_are_freed(session):
    kept = [session.PETSc.Vec().createMPI(10, comm=session.comm) for _ in range(3)]
    if session.rank == 0:
        kept.clear()
    session.collect()
    kept.clear()
    session.collect()
    total = session.PETSc.Vec().createMPI(10, comm=session.comm)
    total.set(1)
    assert total.sum() == 10


@pytest.mark.scalar("real")
def test_an_error_made_of_one_of_petsc_is_one(session):
    own = session.PETSc.Error(62)
    wrapped = SystemError("returned a result with an exception set")
    wrapped.__cause__ = own
    assert (
        jampetsc.petsc.session.petsc_error(own) is own and jampetsc.petsc.session.petsc_error(wrapped) is own
    )
    assert jampetsc.petsc.session.petsc_error(SystemError()) is None
    for error in (own, wrapped):
        said = jampetsc.petsc.session.petsc_message(error)
        assert said == " ".join(said.split()) and said and not said.startswith("[")


@pytest.mark.scalar("real")
def test_whether_options_of_a_prefix_were_given(session):
    session.set_defaults({"mine_type": "x"})
    session.PETSc.Options().setValue("Ours_a", "1")
    assert not session.has_options("mine_") and not session.has_options("ours_b")
    assert session.has_options("ours_")
    for name in ("mine_type", "Ours_a"):
        session.PETSc.Options().delValue(name)
    session._defaults.discard("mine_type")


def test_versions_without_a_session(monkeypatch):
    monkeypatch.setattr(jampetsc.petsc.session, "_session", None)
    assert list(jampetsc.petsc.session.versions()) == ["numpy", "h5py"]


@pytest.mark.scalar("real")
def test_what_python_drops_petsc_forgets(session, capfd):
    """On several ranks PETSc keeps it until all have come to collect."""
    if not hasattr(session.PETSc, "garbage_view"):
        pytest.skip("this petsc4py frees at once")
    session.collect()
    vectors = [session.PETSc.Vec().createMPI(10, comm=session.comm) for _ in range(3)]

    def kept():
        capfd.readouterr()
        session.PETSc.garbage_view(session.comm)
        ctypes.CDLL(None).fflush(None)
        said = session.comm.bcast(capfd.readouterr().out)
        return {int(word) for word in re.findall(r"Total entries: (\d+)", said)}

    vectors.clear()
    assert session.size == 1 or kept() == {3}
    session.collect()
    assert kept() <= {0}


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_what_refers_to_itself_is_collected_too(session):
    class Loop:
        pass

    one = Loop()
    one.itself, seen = one, weakref.ref(one)
    gc.disable()
    try:
        del one
        assert seen() is not None
        session.collect()
        assert seen() is None
    finally:
        gc.enable()


def test_stages_are_named_in_the_log(tmp_path):
    code = (
        "from jampetsc.petsc import session\n"
        f"s = session.start('real', ['-log_view', ':{tmp_path}/log'])\n"
        "for _ in range(2):\n    with s.stage('Factor shifts'):\n        s.PETSc.Vec().createMPI(9).sum()\n"
    )
    done = python(code)
    assert done.returncode == 0, done.stderr
    log = (tmp_path / "log").read_text()
    assert log.count(":   Factor shifts:") == 1


@pytest.mark.scalar("real")
def test_ranks_of_a_node_share_its_cores(session):
    cores = len(os.sched_getaffinity(0))
    assert own_cores(session.comm) == max(1, cores // session.size)
    alone = own_cores(session.comm, session.rank == 0)
    assert alone == cores or session.rank > 0


# A rank on its own


@pytest.mark.scalar("real")
def test_what_one_rank_does_alone_waits_for_no_other(session, tmp_path):
    if session.rank == session.size - 1:
        write_packing(tmp_path / "p.h5", samples.published())
        with session.alone():
            assert (session.rank, session.size) == (0, 1)
            for line in ("quasistatic", "modes --count 5", "sweep"):
                out = tmp_path / f"{line}.h5"
                assert cli.dispatch([*line.split(), str(tmp_path / "p.h5"), "--out", str(out)]) == 0
                assert jampetsc.load(out).attributes["ranks"] == 1
    assert session.size == session.world.size


def test_a_build_with_two_names_is_one(installed):
    make_build(installed, "petsc3.18/any-linux-gnu-real")
    (installed / "petscdir" / "3.18").mkdir()
    (installed / "petscdir" / "3.18" / "real").symlink_to(installed / "petscdir/petsc3.18/any-linux-gnu-real")
    (build,) = builds.distribution_builds()
    assert build.scalar == "real"


@pytest.mark.parametrize("scalar", ["real", "complex"])
def test_the_remedy_is_a_build_of_the_type_that_is_wanted(installed, monkeypatch, scalar):
    wish = f"use a petsc4py and slepc4py whose PETSc was configured --with-scalar-type={scalar}"
    other = "complex" if scalar == "real" else "real"
    make_build(installed, f"petsc3.19/any-linux-gnu-{other}")
    assert builds.remedy(scalar) == wish and not builds.to_choose(scalar) and builds.to_choose(other)
    monkeypatch.setenv("PETSC_DIR", str(installed / "mine"))
    with pytest.raises(InputError, match=f"no petsc4py for this python there: .*, or {wish}"):
        builds._choose(scalar)
    make_build(installed, f"petsc3.18/any-linux-gnu-{scalar}")
    folder = installed / f"petscdir/petsc3.18/any-linux-gnu-{scalar}"
    assert builds.remedy(scalar) == (
        f"unset PETSC_DIR and SLEPC_DIR (and leave other environments) to use {folder}"
    )
    assert not builds.to_choose(scalar)
    monkeypatch.delenv("PETSC_DIR")
    assert builds.to_choose(scalar)
    assert builds._choose(scalar) == {
        "PETSC_DIR": str(folder), "SLEPC_DIR": str(folder).replace("petscdir/petsc", "slepcdir/slepc"),
    }  # fmt: skip
    monkeypatch.setitem(sys.modules, "petsc4py", SimpleNamespace())
    assert not builds.to_choose(scalar)


def test_who_works_together(monkeypatch):
    """The ranks of the session; without one all that mpirun has started, or nobody."""
    monkeypatch.setitem(sys.modules, "mpi4py.MPI", SimpleNamespace(COMM_WORLD="all"))
    for running, several, comm in (("session", True, "its"), (None, True, "all"), (None, False, None)):
        monkeypatch.setattr(
            jampetsc.petsc.session, "_session", running and SimpleNamespace(comm="its", world="all")
        )
        monkeypatch.setattr(jampetsc.petsc.session.launcher, "several", lambda: several)  # noqa: B023
        assert jampetsc.petsc.session.communicator() == comm


# Words for PETSc, and what may be wrong with it


@pytest.fixture
def modules(monkeypatch):
    """petsc4py, slepc4py and mpi4py that do nothing: a function that puts others in their place, None for missing."""

    def module(name, part, **attributes):
        path = f"/lib/{name}/__init__.py"
        made = SimpleNamespace(init=lambda *words, **more: None, __file__=path, **attributes)
        inner = {"COMM_WORLD": "world", "Is_finalized": lambda: False}
        setattr(made, part, SimpleNamespace(__file__=f"/usr/lib/petsc/lib/{part}.so", **inner))
        return made

    def put(**changes):
        found = {name: module(name, part) for name, part in PARTS.items()} | changes
        for name, one in found.items():
            monkeypatch.setitem(sys.modules, name, one)
        return found

    return put


PARTS = {"mpi4py": "MPI", "petsc4py": "PETSc", "slepc4py": "SLEPc"}


def refusing(error):
    """A module whose start fails."""

    def init(*words, **more):
        raise error

    return SimpleNamespace(init=init, __file__="/lib/any/__init__.py", PETSc=None)


def test_what_has_ended_does_not_start_again():
    code = "from mpi4py import MPI; MPI.Finalize(); from jampetsc.petsc import session; session.start('real')"
    assert "MPI has ended in this process" in python(code).stderr


def test_petsc_is_started_with_the_words_and_slepc_need_not_be_there(modules):
    started = []
    found = modules()
    found["petsc4py"].init = lambda words, comm: started.append((words, comm))
    assert jampetsc.petsc.session._load(["-a", "1"]) == (
        found["petsc4py"].PETSc,
        found["slepc4py"].SLEPc,
        "world",
    )
    assert started == [(["jampetsc", jampetsc.petsc.session.QUIET, "-a", "1"], "world")]
    modules(slepc4py=None)
    assert jampetsc.petsc.session._load([])[1] is None


@pytest.mark.parametrize(
    ("name", "module", "message"),
    [
        ("mpi4py", None, "petsc4py and mpi4py: import of mpi4py halted; None in sys.modules: install them for /"),
        ("petsc4py", None, "petsc4py and mpi4py: import of petsc4py halted"),
        ("petsc4py", refusing(ImportError("no\n  symbol")), "petsc4py and mpi4py: no symbol: install them for"),
        ("petsc4py", refusing(RuntimeError(62)), "-a 1: PETSc does not start with this: see its message above"),
        ("slepc4py", refusing(ImportError("x")), "/lib/any was not built for /usr/lib/petsc: set PETSC_DIR and"),
        ("slepc4py", refusing(ValueError("x")), "/lib/any was not built for /usr/lib/petsc: set PETSC_DIR and"),
    ],
)  # fmt: skip
def test_what_does_not_start_is_one_line(modules, name, module, message):
    modules(**{name: module})
    with pytest.raises(InputError) as refused:
        jampetsc.petsc.session._load(["-a", "1"])
    assert str(refused.value).startswith(message)


@pytest.mark.parametrize(
    ("line", "version"),
    [
        ("7f r-xp /usr/lib/libdmumps-5.5.so", "5.5"),
        ("7f r-xp /usr/lib/x86_64-linux-gnu/libzmumps_ptscotch-5.1.2.so\n7f /lib/libz.so", "5.1.2"),
        ("7f r-xp /opt/libdmumps.so.5.7", "5.7"),
        ("7f r-xp /usr/lib/libdmumps.so", "unknown"),
        ("7f r-xp /usr/lib/libmumps_common-5.5.so", "unknown"),
        (None, "unknown"),
    ],
)
def test_the_version_of_mumps_is_in_the_name_of_its_library(tmp_path, monkeypatch, line, version):
    if line is not None:
        (tmp_path / "maps").write_text(line)
    monkeypatch.setattr(jampetsc.petsc.session, "Path", lambda path: tmp_path / "maps")
    assert jampetsc.petsc.session._mumps_version() == version
    monkeypatch.setattr(jampetsc.petsc.session, "Path", lambda path: tmp_path)  # what cannot be read
    assert jampetsc.petsc.session._mumps_version() == "unknown"


class World:
    """A communicator of three ranks, the last of which this is; remembers how the job was ended."""

    rank, size, ended = 2, 3, None

    def Abort(self, status):
        self.ended = status


def test_a_rank_that_ends_by_an_exception_says_so_and_takes_the_others_along(monkeypatch, capsys):
    monkeypatch.setattr(jampetsc.petsc.session, "_session", SimpleNamespace(world=World()))
    error = ZeroDivisionError("a bug")
    jampetsc.petsc.session._abort(type(error), error, None)
    assert jampetsc.petsc.session._session.world.ended == 1
    told = capsys.readouterr().err
    assert told.startswith("jampetsc: rank 2 of 3 failed:\n") and "ZeroDivisionError: a bug" in told


def test_petsc_says_it_in_its_last_line_without_places_or_ranks(monkeypatch):
    class Error(RuntimeError):
        pass

    running = SimpleNamespace(world=World(), PETSc=SimpleNamespace(Error=Error))
    monkeypatch.setattr(jampetsc.petsc.session, "_session", running)
    said = Error("error code 62\n[2] KSPSolve() at /petsc/src/ksp.c:1\n[2] Invalid  argument\t[2]")
    assert jampetsc.petsc.session.petsc_message(said) == "Invalid argument [2]"
