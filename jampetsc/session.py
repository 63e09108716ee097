"""The one door to PETSc, SLEPc and MPI.

Importing this module starts nothing; `start` does, once per process:

    s = session.start(scalar="complex", petsc_argv=["-log_view"])
    s.set_defaults({"freq_ksp_type": "preonly", "freq_pc_type": "lu"})
    with s.rehearsal():                     # stops on an option that nobody asks for
        ...                                 # set the solvers up on a small matrix, see `solvers.rehearsal`
    ksp = s.PETSc.KSP().create(s.comm)
    ...                                     # prefix, operators, setFromOptions, setUp: the work
    s.unused_options()                      # what was not needed in the end
"""

import contextlib
import ctypes
import difflib
import gc
import importlib
import re
import signal
import sys
import traceback
from pathlib import Path

from jampetsc import builds, launcher, streams
from jampetsc.errors import InputError
from jampetsc.loading import check_words, load
from jampetsc.shipped_files import located
from jampetsc.stopping import stop_on_sigterm

# Read by PETSc when it finishes, or only in some situations: never called unused.
READ_LATE = frozenset(
    "options_view options_left citations get_total_flops mpi_dump memory_view objects_dump malloc_dump "
    "malloc_view on_error_malloc_dump debugger_nodes debugger_ranks shared_tmp tmp nox display random_seed "
    "random_type viewer_hdf5_collective".split()
)

_session = None


def start(scalar=None, petsc_argv=()):
    """Start MPI, PETSc and SLEPc and return the Session. Collective.

    scalar      "real", "complex", or None for either (real preferred)
    petsc_argv  PETSc's own options, as on a command line: ["-options_file", "a.opts", "-log_view"];
                `jampetsc:NAME` is an options file that comes with the package

    Raises InputError when no build has that scalar type, when the user's own has the other one, when SLEPc
    belongs to another PETSc, or for an options file that cannot be read. A second call returns the running
    session.
    """
    global _session
    petsc_argv = [located(str(token)) for token in petsc_argv]
    if _session is None:
        check_words(petsc_argv)
        with builds.selected(scalar):
            PETSc, SLEPc, comm = load(petsc_argv)
        _session = Session(PETSc, SLEPc, comm, petsc_argv)
        # PETSc's own handlers, set by the start, would abort, without a chance to clean up, a closed pipe included
        stop_on_sigterm()
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # python then raises BrokenPipeError
        if comm.size > 1:
            sys.excepthook = _abort
    elif petsc_argv:
        raise RuntimeError("PETSc options can be given to the first session.start() of a process only")
    if scalar not in (None, _session.scalar_type):
        raise InputError(
            f"{scalar} scalars are needed and {Path(_session.PETSc.__file__).parents[1]} has "
            f"{_session.scalar_type} ones: {builds.remedy(scalar)} (one process loads one)"
        )
    return _session


def current():
    """The running Session. Raises RuntimeError before `start`."""
    if _session is None:
        raise RuntimeError("no session: call jampetsc.session.start() first")
    return _session


def communicator():
    """That of the running session; without one that of all ranks if mpirun has started several, else None."""
    if _session is not None:
        return _session.comm
    return importlib.import_module("mpi4py.MPI").COMM_WORLD if launcher.several() else None


class Session:
    """PETSc as it runs in this process; made by `start`.

    PETSc, SLEPc   the petsc4py and slepc4py modules; SLEPc is None where no slepc4py is installed
    MPI            mpi4py's
    comm           mpi4py communicator of the work at hand, COMM_WORLD but for `alone`; rank and size are its
    world          COMM_WORLD
    scalar_type    "real" or "complex"
    petsc_argv     the PETSc options this process was given
    """

    def __init__(self, PETSc, SLEPc, comm, petsc_argv):
        self.PETSc = PETSc
        self.MPI = importlib.import_module("mpi4py.MPI")
        self.SLEPc = SLEPc
        self.world = comm
        self._work_on(comm)
        self.scalar_type = "complex" if PETSc.ScalarType(0).dtype.kind == "c" else "real"
        self.petsc_argv = petsc_argv
        self._library = ctypes.CDLL(
            PETSc.__file__
        )  # finds the symbols of the libpetsc it is linked to as well
        self._defaults = set()
        self._given = self._names_given() & {name.lower() for name in self._unused()} - READ_LATE

    def _work_on(self, comm):
        self.comm, self.rank, self.size = comm, comm.rank, comm.size

    @contextlib.contextmanager
    def alone(self):
        """Work inside is this rank's own: `comm` is COMM_SELF, and nothing in it waits for other ranks.

        PETSc's options are those of the whole run, which has rehearsed them: inside there are none to rehearse.
        """
        before, given = self.comm, self._given
        self._work_on(self.MPI.COMM_SELF)
        self._given = set()
        try:
            yield
        finally:
            self._work_on(before)
            self._given = given

    def options(self):
        """All PETSc options in force, {name: value}, without their dash."""
        return self.PETSc.Options().getAll()

    def options_told(self) -> str:
        """Those as words of a command line, for the record of a run: given by the user, or defaults set by then."""
        return " ".join(f"-{name} {value or ''}".strip() for name, value in self.options().items())

    def set_defaults(self, defaults):
        """Set those of {"freq_ksp_type": "preonly", …} that no options file and no command line gives.

        None stands for an option without a value.
        """
        database = self.PETSc.Options()
        present = {name.lower() for name in self.options()} - self._defaults  # hasName would mark it used
        for name, value in defaults.items():
            if name.lower() not in present:
                database.setValue(name, value)
                self._defaults.add(name.lower())

    def has_options(self, prefix) -> bool:
        """Whether options that begin with this were given, by a command line, a file or PETSC_OPTIONS."""
        return any(
            name.lower().startswith(prefix) for name in self.options() if name.lower() not in self._defaults
        )

    def options_given(self) -> bool:
        """Whether some rank has options of the user that no start of PETSc has asked for yet. Collective."""
        return any(self.comm.allgather(bool(self._given)))

    @contextlib.contextmanager
    def rehearsal(self):
        """Setting up solvers inside tells which options they read and whether they can. Collective.

        Defaults set in the block are gone after it, and nothing in it counts as use. Raises InputError that
        names the options of the user that nothing in the block asked for, or what PETSc says of their values.
        """
        before = set(self._defaults)
        self._forget_use()
        try:
            yield
            self.check_options()
        except (self.PETSc.Error, SystemError) as error:
            if not petsc_error(error):
                raise
            given = " ".join(self.petsc_argv)
            raise InputError(f"{given}: {petsc_message(error)}: correct or remove the option") from error
        finally:
            for name in self._defaults - before:
                self.PETSc.Options().delValue(name)
            self._defaults = before
            self._forget_use()

    def check_options(self):
        """Stop on options that no object has asked for. Collective: asked for by one rank is enough.

        Raises InputError that names the options.
        """
        hints = []
        for name in self.unused_options():
            near = difflib.get_close_matches(name, self._defaults, n=1, cutoff=0.75)
            hints.append(f"-{name}" + (f" (did you mean -{near[0]}?)" if near else ""))
        if hints:
            raise InputError(f"PETSc option {', '.join(hints)}: not used by this run: correct or remove it")

    def unused_options(self) -> list[str]:
        """Names of the options that no object on any rank has asked for. Collective.

        Looks at what the command line and its options files gave, not at PETSC_OPTIONS or a .petscrc: other
        programs use those too.
        """
        mine = {name for name in self._unused() if name.lower() in self._given}
        return sorted(set.intersection(*self.comm.allgather(mine)))

    @contextlib.contextmanager
    def stage(self, name):
        """A log stage: what runs inside is summed under `name` by -log_view. Collective."""
        with self.PETSc.Log.Stage(name):
            yield

    def collect(self):
        """Free the PETSc objects that python has dropped, even if on some ranks only. Collective.

        A full garbage collection, tens of milliseconds: not for every step of a fast loop.
        """
        gc.collect()
        if hasattr(self.PETSc, "garbage_cleanup"):  # petsc4py ≥ 3.18
            self.PETSc.garbage_cleanup(self.comm)

    def _names_given(self):
        """Lower-case names of the options in petsc_argv and its options files, as PETSc parses them."""
        database = self.PETSc.Options().create()
        database.insertString(" ".join(f'"{token}"' if " " in token else token for token in self.petsc_argv))
        names = {name.lower() for name in database.getAll()}
        database.destroy()
        return names

    def _forget_use(self):
        """Make every option given unused again: PETSc knows no other way than to set it anew."""
        database = self.PETSc.Options()
        for name, value in self.options().items():
            if name.lower() in self._given:
                database.delValue(name)
                database.setValue(name, value)

    def _unused(self):
        """Names in PETSc's database that nothing has asked for on this rank; petsc4py has no call for it."""
        integer = {4: ctypes.c_int32, 8: ctypes.c_int64}[self.PETSc.IntType(0).itemsize]
        strings = ctypes.POINTER(ctypes.c_char_p)
        count, names, values = integer(), strings(), strings()
        arguments = (None, ctypes.byref(count), ctypes.byref(names), ctypes.byref(values))
        self._library.PetscOptionsLeftGet(*arguments)
        unused = [names[i].decode() for i in range(count.value)]
        self._library.PetscOptionsLeftRestore(*arguments)
        return unused


def least(comm, values):
    """Collective. The smallest of each entry over all ranks, put into the array `values`, which is returned.

    Takes no memory that grows with the number of ranks, as a gather of the arrays would.
    """
    from mpi4py import MPI

    comm.Allreduce(MPI.IN_PLACE, values, op=MPI.MIN)
    return values


def versions():
    """Versions for the record: {"numpy": …, "h5py": …}, in a session also mpi4py, mpi, petsc, slepc, mumps.

    One that cannot be found out is "unknown". Not collective.
    """
    packages = ["numpy", "h5py"] + (["mpi4py"] if _session else [])
    known = {package: importlib.import_module(package).__version__ for package in packages}
    if _session:
        from mpi4py import MPI

        known["mpi"] = MPI.Get_library_version().split("\n")[0].split(",")[0].strip("\0 ")
        known["petsc"] = ".".join(map(str, _session.PETSc.Sys.getVersion()))
        known["slepc"] = ".".join(map(str, _session.SLEPc.Sys.getVersion())) if _session.SLEPc else "unknown"
        known["mumps"] = _mumps_version()
    return known


def petsc_error(error):
    """The PETSc.Error that an exception is or, as in slepc4py 3.25, was made of; None if there is none."""
    found = (one for one in (error, error.__cause__) if _session and isinstance(one, _session.PETSc.Error))
    return next(found, None)


def petsc_message(error) -> str:
    """What PETSc said, without the places in its sources: the last line."""
    last = str(petsc_error(error)).rpartition("\n")[2]
    return " ".join(last.removeprefix(f"[{_session.world.rank}]").split())


def _abort(kind, error, trace):
    """sys.excepthook: a rank that ends by an exception would leave the others waiting for it forever."""
    text = "".join(traceback.format_exception(kind, error, trace))
    streams.say(f"jampetsc: rank {_session.world.rank} of {_session.world.size} failed:\n{text}")
    _session.world.Abort(1)


def _mumps_version():
    """The version in the name of the MUMPS library this process has loaded; Linux tells which that is."""
    try:
        loaded = Path("/proc/self/maps").read_text()
    except OSError:
        return "unknown"
    found = re.search(r"lib[dz]mumps[\w.-]*?[-.](\d+(?:\.\d+)+)", loaded)
    return found[1] if found else "unknown"
