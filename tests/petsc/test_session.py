"""The door to PETSc: which build is taken, whose options win, and what is never started."""

import ctypes
import gc
import os
import re
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import launch
import pytest
import samples

import jampetsc
from jampetsc import main as cli
from jampetsc.errors import InputError
from jampetsc.io.packing_file import write_packing
from jampetsc.petsc import builds
from jampetsc.petsc import session as door

BLOCK = """
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("mpi4py", "petsc4py", "slepc4py"):
            raise ImportError(f"{name} was asked for")
sys.meta_path.insert(0, Blocker())
"""


def python(code, **variables):
    """Run `code` in a python of its own, which knows the door."""
    finished = {"capture_output": True, "text": True, "timeout": 60, "env": launch.environment() | variables}
    code = f"from jampetsc.petsc import builds, session\n{code}"
    return subprocess.run([sys.executable, "-c", code], **finished)


# Nothing is started by importing


def test_every_module_imports_without_mpi_and_petsc():
    modules = sorted(
        ".".join(path.relative_to(launch.ROOT).with_suffix("").parts)
        for path in Path(jampetsc.__file__).parent.rglob("*.py")
        if path.stem not in ("__main__", "__init__")
    )
    assert "jampetsc.petsc.session" in modules and "jampetsc.io.reader" in modules
    imports = "".join(f"import {module}\n" for module in modules)
    door = "import jampetsc, jampetsc.main\nassert 'numpy' not in sys.modules\n"
    done = python(f"{BLOCK}{door}{imports}print(jampetsc.load, jampetsc.Packing)")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "asked, most", [({"OMP_NUM_THREADS": "2,1"}, 2), ({"OMP_NUM_THREADS": "2", "OMP_THREAD_LIMIT": "3"}, 3)]
)
def test_openmp_keeps_to_the_threads_asked_for(asked, most):
    """CHOLMOD asks for four in its own code; libgomp, which it is built with, says how many it gets."""
    told = "import ctypes; print(ctypes.CDLL('libgomp.so.1').omp_get_thread_limit())"
    done = python(f"session.start()\n{told}", **asked)
    assert done.stdout == f"{most}\n", done.stderr


# Which build


def make_build(root, name, suffix=EXTENSION_SUFFIXES[0]):
    lib = root / "petscdir" / name / "lib/python3/dist-packages/petsc4py/lib"
    lib.mkdir(parents=True)
    (lib / f"PETSc{suffix}").touch()


@pytest.mark.most_ranks(1)
@pytest.mark.scalar("real")
@pytest.mark.parametrize(("threads", "code"), [("1", 0), ("2,1", 7)])
def test_a_forked_process_does_not_wait_for_threads_that_it_has_not(session, monkeypatch, threads, code):
    """CHOLMOD hangs in it, unless OpenMP has one thread."""
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    if (child := os.fork()) == 0:
        try:
            door.start("real")
        except InputError as error:
            os._exit(7 if "forked" in str(error) and "spawn" in str(error) else 8)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == code


def test_newest_build_for_this_python_comes_first(tmp_path, monkeypatch):
    for name in ("petsc3.9/*-real", "petsc3.18/*-real-debug", "petsc3.18/*-real", "petsc64-3.20/*-real"):
        make_build(tmp_path, name.replace("*", "any-linux-gnu"))
    make_build(tmp_path, "petsc3.19/any-linux-gnu-complex")
    make_build(tmp_path, "petsc3.18/any-linux-gnu-mixed")
    make_build(tmp_path, "petsc3.22/any-linux-gnu-real", suffix=".cpython-30-other.so")
    (tmp_path / "petscdir" / "3.9").mkdir()  # another name of a build that has been found
    (tmp_path / "petscdir/3.9/real").symlink_to(tmp_path / "petscdir/petsc3.9/any-linux-gnu-real")
    monkeypatch.setattr(builds, "DISTRIBUTION", tmp_path)
    found = builds.distribution_builds()
    names = [str(build.petsc_dir.resolve().relative_to(tmp_path / "petscdir")) for build in found]
    assert names == [
        "petsc3.19/any-linux-gnu-complex",
        "petsc3.18/any-linux-gnu-real",
        "petsc3.9/any-linux-gnu-real",
        "petsc64-3.20/any-linux-gnu-real",
        "petsc3.18/any-linux-gnu-real-debug",
    ]
    assert [build.scalar for build in found[:2]] == ["complex", "real"]
    assert found[1].slepc_dir == tmp_path / "slepcdir/slepc3.18/any-linux-gnu-real"


OTHER = "{real}.*: real scalars, and complex ones are needed .* Unset PETSC_DIR and .*{complex}"
PAIR = "slepcdir.* Set PETSC_DIR and SLEPC_DIR to one pair, or unset both"
STARTED = [  # what is asked for, whose folders PETSC_DIR and SLEPC_DIR name, the scalars of the session or what is said
    (None, {}, "real"),
    ("real", {}, "real"),
    ("complex", {}, "complex"),
    (None, {"PETSC_DIR": "complex"}, "complex"),
    ("complex", {"PETSC_DIR": "real", "SLEPC_DIR": "real"}, OTHER),
    ("real", {"PETSC_DIR": "real", "SLEPC_DIR": "complex"}, PAIR),
    ("real", {"PETSC_DIR": "nowhere"}, "PETSC_DIR=nowhere: no petsc4py for this python there"),
]


@pytest.mark.parametrize(("asked", "own", "found"), STARTED)
def test_which_build_is_started(asked, own, found):
    folders = {build.scalar: build.variables for build in reversed(builds.distribution_builds())}
    own = {name: folders.get(scalar, {}).get(name, scalar) for name, scalar in own.items()}
    done = python(f"print(session.start({asked!r}).scalar_type)", **own)
    if found in folders:
        assert done.stdout.strip() == found and done.returncode == 0, done.stderr
        return
    places = {scalar: re.escape(one["PETSC_DIR"]) for scalar, one in folders.items()}
    assert re.search(f"InputError: .*{found.format(**places)}", done.stderr.splitlines()[-1]), done.stderr


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A distribution's root, in which builds can be made, and no petsc4py loaded or the user's own."""
    monkeypatch.setattr(builds, "DISTRIBUTION", tmp_path)
    monkeypatch.setattr(sys, "path", [folder for folder in sys.path if not Path(folder, "petsc4py").exists()])
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


REAL, COMPLEX = "petscdir/petsc3.18/any-linux-gnu-real", "petscdir/petsc3.19/any-linux-gnu-complex"
CHOSEN = [  # what is asked for, what is loaded already, where petsc4py is on the path, the user's own, PETSC_DIR
    (None, False, None, {}, REAL),  # though older
    ("complex", False, None, {}, COMPLEX),
    (None, True, None, {}, None),  # nothing is chosen then
    (None, False, "elsewhere", {}, None),
    (None, False, f"{REAL}/lib", {}, REAL),  # the distribution's
    (None, False, None, {"PETSC_DIR": "own"}, "no petsc4py for this python there"),
    (None, False, "elsewhere", {"PETSC_DIR": "own"}, "own"),
    (None, False, None, {"PETSC_DIR": "own", "PETSC_ARCH": "arch-opt"}, "own"),
]


@pytest.mark.parametrize(("asked", "loaded", "found", "own", "chosen"), CHOSEN)
def test_which_build_is_chosen(installed, monkeypatch, asked, loaded, found, own, chosen):
    """The distribution's, where there is none of the user's own: under its arch, or on the path."""
    for build in (REAL, COMPLEX):
        make_build(installed, build.removeprefix("petscdir/"))
    lib = installed / "own" / "arch-opt" / "lib" / "petsc4py" / "lib" / "arch-opt"
    lib.mkdir(parents=True)
    (lib / f"PETSc{EXTENSION_SUFFIXES[0]}").touch()
    for name, value in own.items():
        monkeypatch.setenv(name, str(installed / value) if name == "PETSC_DIR" else value)
    if loaded:
        monkeypatch.setitem(sys.modules, "petsc4py", sys)
    if found:
        (installed / found / "petsc4py").mkdir(parents=True)
        (installed / found / "petsc4py/__init__.py").touch()
        sys.path.append(str(installed / found))
    assert builds.can_choose("real") == (not own and bool(chosen))
    if chosen and " " in chosen:
        with pytest.raises(InputError, match=chosen):
            variables_of(asked)
    else:
        assert variables_of(asked)[0] == (chosen and str(installed / chosen))
    assert "PETSC_ARCH" not in own or sys.path[0] == str(lib.parents[2])


def test_own_petsc4py_on_the_path_is_respected():
    own = next(build for build in builds.distribution_builds() if build.scalar == "complex")
    paths = [str(path / "lib/python3/dist-packages") for path in (own.petsc_dir, own.slepc_dir)]
    # the distribution's is told by where it lies; seen from a root without builds it is the user's own
    code = (
        f"import sys; sys.path[:0] = {paths}\nbuilds.DISTRIBUTION /= 'nowhere'\n"
        "print(session.start().scalar_type)\nsession.start('real')"
    )
    done = python(code)
    assert done.stdout.strip() == "complex"
    assert "Use a petsc4py and slepc4py whose PETSc was configured --with-scalar-type=real" in done.stderr


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


# In the running session


@pytest.mark.scalar("real", "complex")
def test_a_running_session(session):
    scalar = os.environ["JAMPETSC_TEST_SCALAR"]
    assert session.scalar_type == scalar and scalar not in os.environ.get("PETSC_DIR", "")
    assert session.SLEPc.EPS().create(session.comm).getComm().size == session.size == session.comm.size
    assert door.start() is door.start(scalar) is door.current() is session
    with pytest.raises(RuntimeError, match="first session"):
        door.start(petsc_argv=["-log_view"])
    with pytest.raises(InputError, match="a process loads one PETSc"):
        door.start({"real": "complex", "complex": "real"}[scalar])


def test_without_a_session_all_that_mpirun_has_started_work_together():
    """Or nobody, and MPI is not loaded."""
    code = "import os, sys\nfrom jampetsc.petsc import session\ncomm = session.communicator()\n"
    code += "os.write(1, f'{comm and comm.size} {\"mpi4py.MPI\" in sys.modules}\\n'.encode())"
    for ranks, said in ((0, ["None False"]), (2, 2 * ["2 True"])):
        line = [*launch.mpirun(ranks), sys.executable, "-c", code]
        done = subprocess.run(line, capture_output=True, text=True, timeout=60, env=launch.environment())
        assert done.stdout.replace("\0", "").splitlines() == said, done.stderr


def test_before_and_after_a_session():
    assert "no session: call jampetsc.petsc.session.start() first" in python("session.current()").stderr
    code = "print(*session.package_versions())\nfrom mpi4py import MPI\nMPI.Finalize()\nsession.start('real')"
    done = python(code)
    assert done.stdout == "numpy h5py\n" and "MPI: ended in this process" in done.stderr


@pytest.mark.scalar("real", "complex")
def test_defaults_do_not_override(session):
    database = session.PETSc.Options()
    database.setValue("Twice_type", "given")
    session.set_defaults({"twice_type": "default", "twice_count": 3, "twice_flag": None})
    session.set_defaults({"twice_count": 4})
    found = {name: value for name, value in session.options().items() if name.lower().startswith("twice")}
    assert found == {"Twice_type": "given", "twice_count": "4", "twice_flag": None}
    given = [session.has_options(f"twice_{name}") for name in ("", "type", "count", "other")]
    assert given == [True, True, False, False]
    for name in found:
        database.delValue(name)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_options_of_one_job_are_not_recorded_by_the_next(session):
    """In a study they depended on what its rank had done before."""
    disks = samples.published()
    before = jampetsc.sweep(disks, omega=[1.0]).attributes["petsc_options"]
    assert "modes_" in jampetsc.modes(disks, count=3).attributes["petsc_options"]
    assert jampetsc.sweep(disks, omega=[1.0]).attributes["petsc_options"] == before
    assert "-shift_" in before and "modes_" not in before


@pytest.mark.scalar("real", "complex")
def test_versions_for_the_record(session):
    versions = door.package_versions()
    assert list(versions) == ["numpy", "h5py", "mpi4py", "mpi", "petsc", "slepc", "mumps"]
    assert "unknown" not in versions.values()


@pytest.mark.scalar("real")
def test_an_error_made_of_one_of_petsc_is_one(session):
    """It says its last line, without places or ranks."""
    own, wrapped = session.PETSc.Error(62), SystemError("returned a result with an exception set")
    wrapped.__cause__ = own
    assert door.petsc_error(own) is door.petsc_error(wrapped) is own
    assert door.petsc_error(SystemError()) is None
    assert door.petsc_message(own) == door.petsc_message(wrapped) != ""
    with pytest.raises(session.PETSc.Error) as raised:
        session.PETSc.KSP().create(session.comm).setType("nonsense")
    assert f"\n[{session.rank}] KSPSetType() at " in str(raised.value)
    assert door.petsc_message(raised.value) == "Unable to find requested KSP type nonsense"


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
    gc.disable()
    try:
        looped = [session.PETSc.Vec().createMPI(10, comm=session.comm)]
        looped.append(looped)  # refers to itself
        if session.rank == 0:
            del looped  # on one rank first
        session.collect()
        looped = None
        session.collect()
    finally:
        gc.enable()
    assert kept() <= {0}


# A rank on its own


@pytest.mark.scalar("real")
def test_what_one_rank_does_alone_waits_for_no_other(session, tmp_path):
    if session.rank == session.size - 1:
        write_packing(tmp_path / "p.h5", samples.published())
        with session.alone():
            assert (session.rank, session.size) == (0, 1) and door.communicator() is session.comm
            for line in ("quasistatic", "modes --count 5", "sweep --omega 1"):
                out = tmp_path / f"{line}.h5"
                assert cli.dispatch([*line.split(), str(tmp_path / "p.h5"), "--out", str(out)]) == 0
                assert jampetsc.load(out).attributes["ranks"] == 1
    assert session.size == session.world.size and door.communicator() is session.comm is session.world


@pytest.mark.parametrize("scalar", ["real", "complex"])
def test_the_remedy_is_a_build_of_the_type_that_is_wanted(installed, monkeypatch, scalar):
    with pytest.raises(InputError, match=r"petsc4py: none with real scalars for .* run/setup installs it"):
        variables_of()
    wish = f"Use a petsc4py and slepc4py whose PETSc was configured --with-scalar-type={scalar}."
    other = "complex" if scalar == "real" else "real"
    make_build(installed, f"petsc3.19/any-linux-gnu-{other}")
    assert builds.remedy(scalar) == wish and not builds.can_choose(scalar) and builds.can_choose(other)
    monkeypatch.setenv("PETSC_DIR", str(installed / "mine"))
    with pytest.raises(InputError, match=f"no petsc4py for this python there.* Or: {wish}"):
        variables_of(scalar)
    make_build(installed, f"petsc3.18/any-linux-gnu-{scalar}")
    folder = installed / f"petscdir/petsc3.18/any-linux-gnu-{scalar}"
    instead = f"Unset PETSC_DIR and SLEPC_DIR (and leave other environments) to use {folder}."
    assert builds.remedy(scalar) == instead


# Words for PETSc, and what may be wrong with it


def test_petsc_is_started_with_the_words_and_slepc_need_not_be_there():
    start = "running = session.start('real', ['-a', '1'])\nprint(running.SLEPc, running.options())"
    done = python(f"import sys\nsys.modules['slepc4py'] = None\n{start}")
    assert done.stdout.startswith("None {'a': '1'}\n"), done.stderr


@pytest.mark.parametrize(
    ("module", "found", "message"),
    [
        ("mpi4py", None, "petsc4py and mpi4py: import of mpi4py halted; None in sys.modules. Install them for /"),
        ("petsc4py", None, "petsc4py and mpi4py: import of petsc4py halted"),
        ("any", None, "-malloc_debug maybe: PETSc does not start with this. See its message above."),
        ("slepc4py", "Namespace(init=dict, __file__='/lib/x/y.py')", "/lib/x: not built for /"),  # ValueError
    ],
)  # fmt: skip
def test_what_does_not_start_is_one_line(module, found, message):
    words = ["-malloc_debug", "maybe"] if module == "any" else []
    before = f"import sys\nfrom argparse import Namespace\nsys.modules[{module!r}] = {found}"
    done = python(f"{before}\nsession.start('real', {words})")
    assert done.stderr.splitlines()[-1].startswith(f"jampetsc.errors.InputError: {message}"), done.stderr


def test_options_that_keep_petsc_from_starting_are_named_wherever_they_are(tmp_path, monkeypatch):
    """In PETSC_OPTIONS and in files that PETSc reads by itself: without end, if they name themselves."""
    monkeypatch.chdir(tmp_path)
    missing = "none: No such file or directory"
    for name, text, reason in (
        ("PETSC_OPTIONS=-options_file none", "", f"{{name}}: {missing}. Give a PETSc options file"),
        (".petscrc", "-options_file none", f"{missing}, named in .petscrc. Give a PETSc options file"),
        (".petscrc", "-options_file .petscrc", "{name}: named by itself, in .petscrc"),
        (".petscrc", "-options_file b.opts", "{name}: named by itself, in b.opts"),
        (".petscrc", "-malloc_debug maybe", "{name}: PETSc does not start with this."),
    ):
        (tmp_path / "b.opts").write_text("-options_file .petscrc")
        if text:
            monkeypatch.delenv("PETSC_OPTIONS", raising=False)
            (tmp_path / name).write_text(text)
        else:
            monkeypatch.setenv(*name.split("=", 1))
        done = python("session.start('real')")
        assert f"InputError: {reason.format(name=name)}" in done.stderr, done.stderr
    assert python("session.start('real', ['-skip_petscrc'])").returncode == 0


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
def test_the_version_of_mumps_is_in_the_name_of_its_library(tmp_path, line, version):
    if line is not None:
        (tmp_path / "maps").write_text(line)
    assert door.mumps_version(tmp_path / "maps") == version
