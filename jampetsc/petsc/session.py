"""The only module that starts PETSc, SLEPc and MPI.

Importing this module starts nothing; `start` does, once per process:

    s = session.start(scalar="complex", petsc_argv=["-log_view"])
    s.set_defaults({"freq_ksp_type": "preonly", "freq_pc_type": "lu"})
    ksp = s.PETSc.KSP().create(s.comm)
    ...                                     # prefix, operators, setFromOptions, setUp: the work
    s.report_unused()                       # makes PETSc print at its end the options that nothing has read
"""

import atexit
import contextlib
import gc
import importlib
import os
import re
import sys
import traceback
from functools import cache
from pathlib import Path

from jampetsc import streams
from jampetsc.errors import InputError, about
from jampetsc.petsc import builds
from jampetsc.petsc.launchers import has_several_ranks, lone_process
from jampetsc.petsc.solver_options import is_global_option, option_names
from jampetsc.shipped_files import located

NO_SIGNAL_HANDLER = "-no_signal_handler"
# PETSc error codes: not supported, wrong argument, out of range, unknown type, no such factor
VALUE_ERRORS = (56, 62, 63, 86, 92)

_session = None


def start(scalar=None, petsc_argv=()):
    """Start MPI, PETSc and SLEPc and return the Session. Collective.

    scalar      "real", "complex", or None for either (real preferred)
    petsc_argv  PETSc's own options, as on a command line: ["-options_file", "a.opts", "-log_view"];
                `jampetsc:NAME` is an options file that comes with the package

    Raises InputError when no build has that scalar type, when the user's own has the other one, when SLEPc
    was built for another PETSc, for an options file that cannot be read or that names itself, also one that PETSc
    reads by itself, or in a process forked from one with threads in which PETSc runs. A second call returns the running
    session.
    """
    global _session
    petsc_argv = [located(str(token)) for token in petsc_argv]
    if _session is None:
        variable = os.environ.get("PETSC_OPTIONS", "")
        with about(f"PETSC_OPTIONS={variable}"):
            option_names(variable.split())  # whose files may name each other
        names = option_names(petsc_argv)
        for file in _default_files([*variable.split(), *petsc_argv]):
            option_names(["-options_file", str(file)])
        with builds.selected(scalar):
            PETSc, SLEPc, comm = _load(petsc_argv)
        _session = Session(PETSc, SLEPc, comm, petsc_argv, names)
        if comm.size > 1:
            sys.excepthook = _abort
    elif petsc_argv:
        raise RuntimeError("PETSc options can be given to the first session.start() of a process only")
    if _session.pid != os.getpid() and os.environ.get("OMP_NUM_THREADS", "").partition(",")[0] != "1":
        raise InputError(  # CHOLMOD would wait for threads that stayed in the other process
            "PETSc: started before this process was forked. Start processes by "
            "multiprocessing.get_context('spawn'), or python with OMP_NUM_THREADS=1."
        )
    if scalar not in (None, _session.scalar_type):
        raise InputError(
            f"{Path(_session.PETSc.__file__).parents[1]}: {_session.scalar_type} scalars, and {scalar} ones are needed "
            f"(a process loads one PETSc). {builds.remedy(scalar)}"
        )
    return _session


def _load(petsc_argv):
    """(PETSc, SLEPc or None, COMM_WORLD), initialised with petsc_argv. Collective.

    Raises InputError where they are missing, do not fit together, or do not start with these options.
    """
    try:
        import petsc4py

        # Open MPI 4 would start a daemon for ranks to be spawned later, which survives when its process is killed
        os.environ.setdefault("OMPI_MCA_ess_singleton_isolated", "1")
        # CHOLMOD starts four threads for any OMP_NUM_THREADS, and they wait for each other
        if threads := os.environ.get("OMP_NUM_THREADS"):
            os.environ.setdefault("OMP_THREAD_LIMIT", threads.partition(",")[0])
        with lone_process():
            from mpi4py import MPI

            if MPI.Is_finalized():
                raise InputError("MPI: ended in this process, and with it PETSc. Start another process.")
            # python keeps handling SIGTERM and a closed pipe; PETSc would print pages and abort
            petsc4py.init(["jampetsc", NO_SIGNAL_HANDLER, *petsc_argv], comm=MPI.COMM_WORLD)
        from petsc4py import PETSc
    except ImportError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"petsc4py and mpi4py: {reason}. Install them for {sys.executable}.") from error
    except RuntimeError as error:  # PETSc.Error; PETSc has printed the details
        raise InputError(
            f"{_describe_options(petsc_argv)}: PETSc does not start with this. See its message above."
        ) from error
    try:
        import slepc4py

        slepc4py.init(["jampetsc"])
        from slepc4py import SLEPc
    except ModuleNotFoundError:
        SLEPc = None
    except (ImportError, ValueError) as error:  # raised by loading a SLEPc of another PETSc
        raise InputError(
            f"{Path(slepc4py.__file__).parent}: not built for {Path(PETSc.__file__).parents[1]}. "
            "Set PETSC_DIR and SLEPC_DIR to one pair, or unset both."
        ) from error
    return PETSc, SLEPc, MPI.COMM_WORLD


def _describe_options(petsc_argv) -> str:
    """Where PETSc takes options from: a command line, PETSC_OPTIONS, files that it reads by itself."""
    variable = os.environ.get("PETSC_OPTIONS")
    sources = [*petsc_argv, *([f"PETSC_OPTIONS={variable}"] if variable else []), *_default_files(petsc_argv)]
    return " ".join(map(str, sources)) or "no options"


def _default_files(words) -> list[Path]:
    """Options files that PETSc reads by itself, without the word that tells it not to."""
    files = [Path.home() / ".petscrc", Path(".petscrc"), Path("petscrc")]
    return [] if "-skip_petscrc" in words else [file for file in files if file.is_file()]


def current():
    """The running Session. Raises RuntimeError before `start`."""
    if _session is None:
        raise RuntimeError("no session: call jampetsc.petsc.session.start() first")
    return _session


def communicator():
    """`comm` of the running session; without a session COMM_WORLD if mpirun has started several ranks, else None."""
    if _session is not None:
        return _session.comm
    return importlib.import_module("mpi4py.MPI").COMM_WORLD if has_several_ranks() else None


class Session:
    """PETSc as it runs in this process; made by `start`.

    PETSc, SLEPc   the petsc4py and slepc4py modules; SLEPc is None where no slepc4py is installed
    pid            of the process that started them, not of a fork
    MPI            the module mpi4py.MPI
    comm           mpi4py communicator of the current work: COMM_WORLD, within `alone` COMM_SELF
    rank, size     of this process in `comm`
    world          COMM_WORLD
    scalar_type    "real" or "complex"
    petsc_argv     the PETSc options this process was given
    """

    def __init__(self, PETSc, SLEPc, comm, petsc_argv, names):
        self.PETSc, self.pid = PETSc, os.getpid()
        self.MPI = importlib.import_module("mpi4py.MPI")
        self.SLEPc = SLEPc
        self.world = comm
        self._work_on(comm)
        self.scalar_type = "complex" if PETSc.ScalarType(0).dtype.kind == "c" else "real"
        self.petsc_argv = petsc_argv
        PETSc.Options().delValue(NO_SIGNAL_HANDLER)  # not for the record: the user did not give it
        self._for_solvers = not all(map(is_global_option, names))  # whether options of solvers were given
        self._defaults = set()
        atexit.register(self.forget_defaults)

    def forget_defaults(self):
        """Delete the defaults, which each solver sets again, so that a job does not hand its own to the next.

        Also at the end, where PETSc from 3.19 on reports options that nothing has read, as after an error.
        """
        while self._defaults:
            self.PETSc.Options().delValue(self._defaults.pop())

    def _work_on(self, comm):
        self.comm, self.rank, self.size = comm, comm.rank, comm.size

    @contextlib.contextmanager
    def alone(self):
        """A context for work of this rank alone: `comm` is COMM_SELF, so nothing waits for other ranks."""
        previous = self.comm
        self._work_on(self.MPI.COMM_SELF)
        try:
            yield
        finally:
            self._work_on(previous)

    def options(self):
        """All PETSc options in force, {name: value}, without their dash."""
        return self.PETSc.Options().getAll()

    def options_text(self) -> str:
        """All options as on a command line, for the record of a run: the user's, and the defaults set so far."""
        return " ".join(f"-{name} {value or ''}".strip() for name, value in self.options().items())

    def set_defaults(self, defaults):
        """Set the `defaults`, {"freq_ksp_type": "preonly", …}, that no options file and no command line gives.

        None stands for an option without a value.
        """
        database = self.PETSc.Options()
        present = {name.lower() for name in self.options()} - self._defaults  # hasName would mark it used
        for name, value in defaults.items():
            if name.lower() not in present:
                database.setValue(name, value)
                self._defaults.add(name.lower())

    def has_options(self, prefix) -> bool:
        """Whether the user gave options that begin with `prefix`, on a command line, in a file or in PETSC_OPTIONS."""
        return any(
            name.lower().startswith(prefix) for name in self.options() if name.lower() not in self._defaults
        )

    def report_unused(self):
        """Make PETSc print, when it ends, the solvers' options that nothing has read on rank 0 (its -options_left)."""
        if self._for_solvers and "options_left" not in self.options():
            self.PETSc.Options().setValue("options_left", True)

    @contextlib.contextmanager
    def stage(self, name):
        """A PETSc log stage as a context: -log_view sums what runs inside under `name`. Collective.

        Objects dropped inside are freed at its end, unless it ends by an exception.
        """
        with self.PETSc.Log.Stage(name):
            yield
        self.free_dropped(self.comm)

    def memory(self) -> int:
        """Bytes of this machine's memory, divided by the number of ranks of `comm` on it. Collective."""
        node = self.comm.Split_type(self.MPI.COMM_TYPE_SHARED)
        share = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // node.size
        node.Free()
        return share

    def collect(self):
        """Free the PETSc objects that python no longer refers to, even if only on some ranks. Collective.

        A full garbage collection, tens of milliseconds: not for every step of a fast loop.
        """
        gc.collect()
        self.free_dropped(self.comm)

    def free_dropped(self, comm):
        """Free PETSc's objects of this rank, and of `comm`, that python has dropped. Collective over comm.

        PETSc keeps objects of several ranks, 3.18 also objects of one, until all of them call this.
        """
        if hasattr(self.PETSc, "garbage_cleanup"):  # petsc4py ≥ 3.18
            self.PETSc.garbage_cleanup(self.PETSc.COMM_SELF)
            self.PETSc.garbage_cleanup(comm)


def package_versions():
    """Versions for the record: {"numpy": …, "h5py": …}, in a session also mpi4py, mpi, petsc, slepc, mumps.

    "unknown" stands for one that cannot be determined. Not collective.
    """
    packages = ["numpy", "h5py"] + (["mpi4py"] if _session else [])
    versions = {package: importlib.import_module(package).__version__ for package in packages}
    if _session:
        from mpi4py import MPI

        versions["mpi"] = MPI.Get_library_version().split("\n")[0].split(",")[0].strip("\0 ")
        versions["petsc"] = ".".join(map(str, _session.PETSc.Sys.getVersion()))
        versions["slepc"] = (
            ".".join(map(str, _session.SLEPc.Sys.getVersion())) if _session.SLEPc else "unknown"
        )
        versions["mumps"] = mumps_version()
    return versions


def petsc_error(error):
    """The exception if it is a PETSc.Error, its cause if that is one (as in slepc4py 3.25), else None."""
    candidates = (error, error.__cause__) if _session else ()
    return next((item for item in candidates if isinstance(item, _session.PETSc.Error)), None)


def petsc_message(error) -> str:
    """The last line of PETSc's message, without the traceback of its sources."""
    last = str(petsc_error(error)).rpartition("\n")[2]
    return " ".join(last.removeprefix(f"[{_session.world.rank}]").split())


def explain_error(error) -> tuple[str, int]:
    """A PETSc error in one line, and the exit status: 2 if it may be about a value that the user gave, else 1."""
    options = " ".join(_session.petsc_argv)
    if options and petsc_error(error).ierr in VALUE_ERRORS:
        return f"{options}: {petsc_message(error)}. Correct or remove the option.", 2
    return f"PETSc: {petsc_message(error)}", 1


def _abort(kind, error, trace):
    """sys.excepthook that aborts all ranks: they would wait forever for one that ends by an exception."""
    text = "".join(traceback.format_exception(kind, error, trace))
    streams.say(f"jampetsc: rank {_session.world.rank} of {_session.world.size} failed:\n{text}")
    _session.world.Abort(1)


@cache  # it stays the same while every result of a process records it
def mumps_version(maps: Path = Path("/proc/self/maps")) -> str:
    """The version in the file name of the MUMPS library that a process has loaded, by its memory map (Linux).

    "unknown" if it has none, no version, or the file `maps` cannot be read.
    """
    try:
        loaded = maps.read_text()
    except OSError:
        return "unknown"
    match = re.search(r"lib[dz]mumps[\w.-]*?[-.](\d+(?:\.\d+)+)", loaded)
    return match[1] if match else "unknown"
