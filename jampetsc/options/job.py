"""A job: a frozen dataclass of its parameters, and what runs it. Functions and commands are made from its class."""

import shlex
import sys
import types
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

from jampetsc import interrupts
from jampetsc.collective import on_root
from jampetsc.errors import InputError, named
from jampetsc.io.outlet import Outlet
from jampetsc.io.request import Request
from jampetsc.options.parameters import FILE, OPTION, CompositeParameter, fields, parameters
from jampetsc.options.task_inputs import TaskInputs
from jampetsc.options.values import PACKING, RADII, input_name
from jampetsc.petsc import session
from jampetsc.progress import LOG


@dataclass(frozen=True)
class Job:
    """Base of all jobs: a subclass is a frozen dataclass with fields `parameter` and `composite_parameter`.

    Its docstring describes it; the first line is the short help of its command. Class variables say the rest. `check`
    refuses values that contradict each other, without reading files; `work` runs the job.
    """

    NAME: ClassVar[str]  # of command and function: that of the class, in small letters
    FORMAT: ClassVar[str]  # of its result; if not given "jampetsc-NAME"
    EPILOG: ClassVar[str] = ""  # what its help ends with: examples, prefixes of PETSc's options
    SOLVERS: ClassVar[tuple] = ()  # prefixes of the PETSc options that its solvers read, see `solver_options`
    OUT: ClassVar[str] = "required"  # whether its command needs --out: required, optional, or "" for no file
    OUT_HELP: ClassVar[str] = "result file (HDF5)"
    GIVES: ClassVar[str] = ""  # what the python function returns, if not what `load` gives for its file
    STUDY_INPUTS: ClassVar[TaskInputs | None] = None  # what a task of a study reads; None: no study runs it
    scalar: ClassVar[str | None] = (
        "real"  # scalars of PETSc that it needs: real, complex or any; None: it does not use PETSc
    )
    place: ClassVar = None  # file of its result if no name is given
    several: ClassVar[bool] = False  # whether it has several results, each a file of its own
    AGAIN: ClassVar[bool] = (
        False  # whether its result is always made again, without --overwrite: pictures, tables
    )

    def __init_subclass__(cls):
        cls.NAME = cls.__name__.lower()
        cls.FORMAT = vars(cls).get("FORMAT", f"jampetsc-{cls.NAME}")

    def __post_init__(self):
        for name, declaration in fields(type(self)).items():
            read = self._build if isinstance(declaration, CompositeParameter) else self._read
            object.__setattr__(self, name, read(name, declaration, getattr(self, name)))
        self.check()

    def _build(self, name, composite, value):
        """The object that several options describe; a name such as "stokes" stands for that family's defaults."""
        if isinstance(value, composite.type) or (value is None and composite.optional):
            return value
        if not isinstance(value, str):
            hint = f" Call it: {value.__name__}(…)." if isinstance(value, types.FunctionType) else ""
            raise InputError(f"{named(name)} {value!r}: must be a {composite.type.__name__}.{hint}")
        return composite.make(**{composite.parameters[0].name: value})

    def _read(self, name, parameter, value):
        if parameter.place in (OPTION, FILE):
            return parameter.read(value)
        if isinstance(value, str | Path) or not hasattr(value, "__iter__"):
            value = (value,)
        if not value:
            raise InputError(f"{named(name)}: missing. Give at least one.")
        return tuple(parameter.read(item) for item in value)

    def check(self) -> None:
        """Raise InputError for values that contradict each other."""

    def _values(self, selects) -> list:
        """The values of the parameters for which `selects(parameter)` is true, in one flat list."""
        names = [name for name, parameter in parameters(type(self)).items() if selects(parameter)]
        return [value for name in names for value in _as_list(getattr(self, name))]

    @property
    def sources(self) -> list:
        """Its inputs: names of files, and packings and results in memory."""
        return self._values(lambda parameter: parameter.place != OPTION)

    @property
    def paths(self) -> list[str]:
        """Files that it reads: those of its `sources`, and of packings and radii among the options."""
        values = self._values(
            lambda parameter: parameter.place != OPTION or parameter.value_type in (PACKING, RADII)
        )
        files = [
            value if isinstance(value, str | Path) else getattr(value, "file", getattr(value, "path", None))
            for value in values
        ]
        return [str(file) for file in files if file is not None]

    def gathered(self) -> "Job":
        """The same job, with all rows of its results in memory on every rank. Collective."""
        return replace(self, **{name: _gather(value) for name, value in vars(self).items()})

    @property
    def input_hashes(self) -> list[str]:
        """Hashes of its inputs in memory."""
        values = [item for value in vars(self).values() for item in _as_list(value)]
        packings = [getattr(item, "fingerprint", None) for item in values]
        runs = [item.attributes.get("run_id") for item in values if hasattr(item, "attributes")]
        return [str(digest) for digest in (*packings, *runs) if digest]

    def settings(self) -> dict:
        """{parameter: value} as JSON and command lines write them: all but files, and switches at their defaults."""
        values = {}
        for name, declaration in fields(type(self)).items():
            value = getattr(self, name)
            if value is not None and isinstance(declaration, CompositeParameter):
                values |= declaration.serialise(value)
            elif value is not None and declaration.place == OPTION:
                values[name] = declaration.value_type.serialise(value)
        declared = parameters(type(self))
        switches = {name: item.default for name, item in declared.items() if isinstance(item.default, bool)}
        return {
            name: value
            for name, value in values.items()
            if value is not None and switches.get(name) is not value
        }

    def words(self) -> list[str]:
        """The options of a command line for this job."""
        settings, words = self.settings(), []
        for name, parameter in parameters(type(self)).items():
            if parameter.place != OPTION:
                continue
            if isinstance(parameter.default, bool):
                words += [parameter.word] * (name in settings)
            elif name in settings and (
                parameter.default is None or not self.same(name, settings[name], None)
            ):
                text = str(settings[name])
                words += [f"{parameter.word}={text}"] if text.startswith("-") else [parameter.word, text]
        return words

    def line(self, out=None) -> list[str]:
        """A command line for this job; for a packing or a result in memory stands a description."""
        sources = [str(input_name(source)) for source in self.sources]
        return ["jampetsc", self.NAME, *sources, *(["--out", str(out)] if out else []), *self.words()]

    def same(self, name, first, second) -> bool:
        """Whether two values of a parameter, as `settings` has them, mean the same; None stands for the default."""
        parameter = parameters(type(self)).get(name)
        try:
            return parameter is not None and _canonical(parameter, first) == _canonical(parameter, second)
        except InputError:
            return False

    def check_outputs(self, to: Outlet) -> None:
        """Raise InputError, before any work, unless all of its files may be written."""
        to.check(self.FORMAT, self.paths)

    def perform(self, to: Outlet, *, petsc_argv=(), argv=None, overwrite=False, alone=False) -> str:
        """Check that the result may be written, start PETSc if it is needed, do the work. Collective.

        to          outlet of the result
        petsc_argv  PETSc's own options
        argv        the command line that the result records
        overwrite   whether a finished result is computed again and replaced
        alone       whether only this rank calls, for a job without PETSc

        Returns the summary for the user; of a finished result, which stays, only that it is there.

        Raises InputError before any work for an output that may not be written, as `work` does, and KeyboardInterrupt,
        which says what is kept, after a Ctrl-C (see `interrupts`).
        """
        finished = False
        try:
            with interrupts.deferred():
                summary = self._perform(to, petsc_argv, argv, overwrite, alone)
                finished = True
            return summary
        except KeyboardInterrupt:
            kept = f"{to} is finished." if finished else self.kept(to)
            raise KeyboardInterrupt(f"interrupted: {kept}") from None

    def kept(self, to: Outlet) -> str:
        """What an interrupted run leaves on disk, in words."""
        if to.has_checkpoint:
            return f"finished steps are kept beside {to.kept}. The same command resumes."
        return "nothing is kept."

    def _perform(self, to, petsc_argv, argv, overwrite, alone):
        to.request = Request(self, argv or sys.argv, overwrite)
        if self.scalar is None:
            comm = None if alone else session.communicator()
        else:  # one process looks at the files before PETSc starts
            comm = self._start(petsc_argv).comm if session.has_several_ranks() else None
        if on_root(comm, lambda: self._is_finished(to)):
            to.finished = True
            on_root(comm, lambda: self.complete(to))
            return f"{to}: finished earlier with the same settings and inputs. {named('overwrite')} computes it again."
        if self.scalar is not None:
            running = session.current() if comm else self._start(petsc_argv)
            running.forget_defaults()
            summary = self.work(to)
            running.free_dropped(running.comm)
            if petsc_argv:
                running.report_unused()
            return summary + to.remark
        job = self if comm is None else self.gathered()
        summary = on_root(comm, lambda: job.work(to))
        if comm is not None and to.path is None:
            to.share(comm)
        return summary

    def _start(self, petsc_argv):
        """The session with the scalars that the job needs. Collective."""
        running = session.start(None if self.scalar == "any" else self.scalar, petsc_argv)
        if running.rank == 0:
            version = ".".join(map(str, running.PETSc.Sys.getVersion()))
            LOG.debug("PETSc %s, %s scalars, %d ranks: %s", version, running.scalar_type, running.size, self)
        return running

    def _is_finished(self, to) -> bool:
        """Whether its result is there already and stays. Raises InputError for what may not be replaced."""
        self.check_outputs(to)
        return to.finished

    def complete(self, to: Outlet) -> None:
        """Do what is left to do where the result is there already, as after a kill. Not collective."""
        from jampetsc.io.checkpoint import discard_unused

        discard_unused(to.kept or to.path)

    def work(self, to: Outlet) -> str:
        """Run the job and put its result into the outlet `to`; returns a summary for the user. Collective."""
        raise NotImplementedError

    def answer(self, to: Outlet, summary: str):
        """What the python function returns: what `load` gives for the file, or the same in memory; the summary where
        `GIVES` begins with "str".

        summary   text, from `perform`

        Collective.
        """
        packing = getattr(self, "packing", None)
        if to.finished and packing is not None:  # as `work` does
            from jampetsc.io.network_file import read_source
            from jampetsc.io.packing_file import read_identified

            to.made_from(read_identified(packing, session.communicator(), read_source)[0])
        return summary if self.GIVES.startswith("str") else to.result

    def __str__(self):
        return shlex.join(self.line())


def _as_list(value) -> list:
    """The value of a parameter as a list, empty for None."""
    return list(value) if isinstance(value, tuple) else [] if value is None else [value]


def _gather(value):
    """An input with all its rows on this rank. Collective."""
    if isinstance(value, tuple):
        return tuple(map(_gather, value))
    return value.gathered() if hasattr(value, "gathered") else value


def _canonical(parameter, value):
    value = parameter.read(parameter.default if value is None and not parameter.required else value)
    return value if value is None else parameter.value_type.serialise(value)
