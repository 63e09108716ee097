"""A job: what is asked, as a frozen dataclass, and how it is answered. Functions and commands are made of its class."""

import shlex
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

from jampetsc.asking.kinds import PACKING, RADII, input_told
from jampetsc.asking.parameters import FILE, OPTION, Part, fields, parameters
from jampetsc.errors import InputError, named
from jampetsc.io.outlet import Outlet
from jampetsc.io.request import Request
from jampetsc.petsc import session
from jampetsc.progress import LOG


@dataclass(frozen=True)
class Job:
    """Base of all jobs. A subclass is a frozen dataclass whose fields are made by `asking.asked` and `asking.part`.

    Its docstring is its description, the first line of it the help of its command. What it says besides are the class
    variables; `check` refuses values that do not go together, whatever files hold, and `work` does it.
    """

    NAME: ClassVar[str]  # of command and function
    FORMAT: ClassVar[str]  # of its result, "jampetsc-sweep"
    EPILOG: ClassVar[str] = ""  # what its help ends with: examples, prefixes of PETSc's options
    SOLVERS: ClassVar[tuple] = ()  # prefixes of the PETSc options that its solvers read, see `solver_options`
    OUT: ClassVar[str] = "required"  # whether its command needs --out: required, optional, or "" for no file
    OUT_HELP: ClassVar[str] = "result file (HDF5)"
    GIVES: ClassVar[str] = ""  # what python gets, where that is not what `load` gives for its file
    scalar: ClassVar[str | None] = (
        "real"  # PETSc's that it needs, or complex, any; None: PETSc has nothing to do
    )
    place: ClassVar = None  # where its result goes where no name is given
    several: ClassVar[bool] = False  # whether it has several results, each a file of its own
    AGAIN: ClassVar[bool] = False  # whether its result is made anew without asking: pictures and tables

    def __post_init__(self):
        for name, said in fields(type(self)).items():
            read = self._made if isinstance(said, Part) else self._read
            object.__setattr__(self, name, read(name, said, getattr(self, name)))
        self.check()

    def _made(self, name, part, value):
        """What several options make: a name stands for its defaults, "stokes"."""
        if isinstance(value, part.type) or (value is None and part.optional):
            return value
        if not isinstance(value, str):
            raise InputError(f"{named(name)} {value!r}: must be a {part.type.__name__}")
        return part.make({part.parameters[0].name: value})

    def _read(self, name, parameter, value):
        if parameter.place in (OPTION, FILE):
            return parameter.read(value)
        if isinstance(value, str | Path) or not hasattr(value, "__iter__"):
            value = (value,)
        if not value:
            raise InputError(f"{named(name)}: must be given")
        return tuple(parameter.read(one) for one in value)

    def check(self) -> None:
        """Raise InputError for values that do not go together."""

    def _values(self, wanted) -> list:
        """The values of parameters that are `wanted`, a function of each; several of one are taken apart."""
        names = [name for name, one in parameters(type(self)).items() if wanted(one)]
        return [one for name in names for one in _several(getattr(self, name))]

    @property
    def sources(self) -> list:
        """What it reads: names of files, and packings and results in memory."""
        return self._values(lambda one: one.place != OPTION)

    @property
    def paths(self) -> list[str]:
        """Files that it reads: those that `sources`, and packings and radii among the options, are or lie in."""
        values = self._values(lambda one: one.place != OPTION or one.kind in (PACKING, RADII))
        files = [
            one if isinstance(one, str | Path) else getattr(one, "file", getattr(one, "path", None))
            for one in values
        ]
        return [str(one) for one in files if one is not None]

    def gathered(self) -> "Job":
        """The job with results in memory whole on every rank. Collective."""
        return replace(self, **{name: _whole(one) for name, one in vars(self).items()})

    @property
    def held(self) -> list[str]:
        """Hashes of what its inputs in memory hold."""
        values = [one for value in vars(self).values() for one in _several(value)]
        found = [getattr(one, "fingerprint", None) for one in values]
        runs = [one.attributes.get("run_id") for one in values if hasattr(one, "attributes")]
        return [str(one) for one in (*found, *runs) if one]

    def told(self) -> dict:
        """{parameter: value} as JSON and command lines hold it: all that is no file, switches that are not usual."""
        values = {}
        for name, one in fields(type(self)).items():
            value = getattr(self, name)
            if value is not None and isinstance(one, Part):
                values |= one.tell(value)
            elif value is not None and one.place == OPTION:
                values[name] = one.kind.tell(value)
        known = parameters(type(self))
        usual = {name: one.default for name, one in known.items() if isinstance(one.default, bool)}
        return {n: value for n, value in values.items() if value is not None and usual.get(n) is not value}

    def request(self, argv, overwrite=False) -> Request:
        """What results record of the job, which the command line `argv` asks for."""
        return Request(self.NAME, self.told(), argv, overwrite, self.same, self.held)

    def words(self) -> list[str]:
        """The options of a command line that asks for the same."""
        told, words = self.told(), []
        for name, parameter in parameters(type(self)).items():
            if parameter.place != OPTION:
                continue
            if isinstance(parameter.default, bool):
                words += [parameter.word] * (name in told)
            elif name in told and (parameter.default is None or not self.same(name, told[name], None)):
                text = str(told[name])
                words += [f"{parameter.word}={text}"] if text.startswith("-") else [parameter.word, text]
        return words

    def line(self, out=None) -> list[str]:
        """A command line that does the same; packings and results in memory are told by what they are."""
        given = [input_told(one) for one in self.sources]
        return ["jampetsc", self.NAME, *map(str, given), *(["--out", str(out)] if out else []), *self.words()]

    def same(self, name, one, other) -> bool:
        """Whether two told values of a parameter mean the same, however they are written; None is the default."""
        parameter = parameters(type(self)).get(name)
        try:
            return parameter is not None and _canonical(parameter, one) == _canonical(parameter, other)
        except InputError:
            return False

    def check_outputs(self, to: Outlet) -> None:
        """Raise InputError, before any work, unless all of its files may be written."""
        to.check(self.FORMAT, self.paths)

    def perform(self, to: Outlet, *, petsc_argv=(), argv=None, overwrite=False, alone=False) -> str:
        """Look whether the result may be put there, start PETSc where it is needed, do the work. Collective.

        to          outlet of the result
        petsc_argv  PETSc's own options; argv: the command line that the result records
        overwrite   whether a finished result of other settings may be replaced
        alone       whether no other rank is here for a job that one rank does

        Returns what a user wants to read. Raises InputError before any work for an output that cannot be, and as
        the job does.
        """
        to.request = self.request(argv or sys.argv, overwrite)
        self.check_outputs(to)
        if self.scalar is not None:
            running = session.start(None if self.scalar == "any" else self.scalar, petsc_argv)
            if running.rank == 0:
                version = ".".join(map(str, running.PETSc.Sys.getVersion()))
                LOG.debug(
                    "PETSc %s, %s scalars, %d ranks: %s", version, running.scalar_type, running.size, self
                )
            return self.work(to)
        from jampetsc.collective import on_root  # and numpy: not before `cli.main` has said how many threads

        comm = None if alone else session.communicator()
        job = self if comm is None else self.gathered()
        told = on_root(comm, lambda: job.work(to))
        if comm is not None and to.path is None:
            to.share(comm)
        return told

    def work(self, to: Outlet) -> str:
        """Do it and put what is found into the outlet `to`; what a user wants to read. Collective."""
        raise NotImplementedError

    def answer(self, to: Outlet, told: str):
        """What python gets: what `load` gives for the file, or the same in memory; words where `GIVES` says "str".

        told   what `work` has said
        """
        return told if self.GIVES.startswith("str") else to.result

    def __str__(self):
        return shlex.join(self.line())


def _several(value) -> list:
    """What a place of a command line holds, as a list."""
    return list(value) if isinstance(value, tuple) else [] if value is None else [value]


def _whole(one):
    """What a job was given, without parts on other ranks. Collective."""
    if isinstance(one, tuple):
        return tuple(_whole(part) for part in one)
    return one.gathered() if hasattr(one, "gathered") else one


def _canonical(parameter, told):
    value = parameter.read(parameter.default if told is None and not parameter.required else told)
    return value if value is None else parameter.kind.tell(value)
