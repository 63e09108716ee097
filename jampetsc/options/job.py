"""A job: a frozen dataclass of its parameters. Command, python function and key of a study follow from its class."""

import shlex
import types
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

from jampetsc.errors import InputError, named, python_value
from jampetsc.io.outlet import Outlet
from jampetsc.options.parameters import FILE, OPTION, CompositeParameter, fields, parameters
from jampetsc.options.values import PACKING, RADII, input_name
from jampetsc.petsc import session

NO_FILE = "no file"
ONE_PACKING = "one packing"
PACKING_OR_N = "one packing, or no file where the table gives n"
NETWORKS = ("pack", "springs")  # commands that make a packing or a network
ONE_RESULT = "one result"
ALL_SEEDS = "the results of all seeds"


@dataclass(frozen=True)
class TaskInputs:
    """What one task of a command reads in a study.

    reads        NO_FILE, ONE_PACKING, PACKING_OR_N, ONE_RESULT or ALL_SEEDS
    commands     commands whose results it reads; of packings: pack alone if none are named
    is_suitable  whether it can use the result of this job
    needs        the results that it can use, for messages
    one_rank     whether it runs on one rank only, however large the packing is
    """

    reads: str
    commands: tuple[str, ...] = ()
    is_suitable: Callable = lambda job: True
    needs: str = ""
    one_rank: bool = False


@dataclass(frozen=True)
class Job:
    """Base of all jobs: a subclass is a frozen dataclass with fields `parameter` and `composite_parameter`.

    Its docstring describes it; the first line is the short help of its command. Class variables say the rest. `check`
    refuses values that contradict each other, without reading files; `work` computes and fills the outlet. `execution`
    runs it.
    """

    NAME: ClassVar[str]  # of command and function: the name of the class in small letters
    FORMAT: ClassVar[str]  # of its result; if not given "jampetsc-NAME"
    EPILOG: ClassVar[str] = ""  # what its help ends with: examples, prefixes of PETSc's options
    SOLVERS: ClassVar[tuple] = ()  # prefixes of the PETSc options that its solvers read, see `solver_options`
    OUT: ClassVar[str] = "required"  # whether its command needs --out: required, optional, or "" for no file
    OUT_HELP: ClassVar[str] = "result file (HDF5)"
    GIVES: ClassVar[str] = ""  # result of the python function, if not as `load` gives it for the file
    STUDY_INPUTS: ClassVar[TaskInputs | None] = None  # inputs of a task of a study; None: no study runs it
    scalar: ClassVar[str | None] = (
        "real"  # scalars of PETSc that it needs: real, complex or any; None: it does not use PETSc
    )
    place: ClassVar = None  # file of its result if no name is given
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
            raise InputError(
                f"{named(name)} {python_value(value)!r}: must be a {composite.type.__name__}.{hint}"
            )
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
        """Files that it reads: of its `sources`, and of packings and radii among the options."""
        return files_of(
            self._values(
                lambda parameter: parameter.place != OPTION or parameter.value_type in (PACKING, RADII)
            )
        )

    def gathered(self) -> "Job":
        """The same job, with all rows of its results in memory on every rank. Collective."""
        return replace(self, **{name: _gather(value) for name, value in vars(self).items()})

    @property
    def input_hashes(self) -> list[str]:
        """Hashes of its inputs in memory."""
        values = [item for value in vars(self).values() for item in _as_list(value)]
        packings = [getattr(item, "fingerprint", None) for item in values]
        results = [item for item in values if hasattr(item, "attributes") and item.file is None]
        runs = [item.attributes.get("run_id") for item in results]
        return [str(digest) for digest in (*packings, *runs) if digest]

    @property
    def implied(self) -> dict:
        """{parameter: value} that None, for an optional parameter that was left out, stands for."""
        return {}

    def identity(self) -> dict:
        """{parameter: value} that the result depends on, besides its files: `settings`, with defaults spelled out."""
        declared = parameters(type(self))
        switches = {name: item.default for name, item in declared.items() if isinstance(item.default, bool)}
        implied = {name: declared[name].value_type.serialise(value) for name, value in self.implied.items()}
        values = switches | implied | self.settings()
        return {name: value for name, value in values.items() if declared[name].in_identity}

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
            elif name in settings and settings[name] != _default_text(parameter):
                text = str(settings[name])
                words += [f"{parameter.word}={text}"] if text.startswith("-") else [parameter.word, text]
        return words

    def line(self, out=None) -> list[str]:
        """A command line for this job; for a packing or a result in memory stands a description."""
        sources = [str(input_name(source)) for source in self.sources]
        return ["jampetsc", self.NAME, *sources, *(["--out", str(out)] if out else []), *self.words()]

    def check_outputs(self, to: Outlet) -> None:
        """Raise InputError, before any work, unless all of its files may be written."""
        to.check(self.FORMAT, self.paths)

    def kept_text(self, to: Outlet) -> str:
        """What an interrupted run leaves on disk, in words."""
        if to.has_checkpoint:
            return f"finished steps are kept beside {to.checkpoint_path}. The same command resumes."
        return "nothing is kept."

    def complete(self, to: Outlet) -> None:
        """Finish a run whose result exists already, as after a kill. Not collective."""
        from jampetsc.io.checkpoint import discard_unused

        discard_unused(to.checkpoint_path or to.path)

    def work(self, to: Outlet) -> str:
        """Run the job and put its result into the outlet `to`; returns a summary for the user. Collective."""
        raise NotImplementedError

    def python_result(self, to: Outlet):
        """What the python function returns after a run: what `load` gives for the file, or the same in memory.

        The summary where `GIVES` begins with "str". Collective.
        """
        packing = getattr(self, "packing", None)
        if to.finished and packing is not None:  # as `work` does
            from jampetsc.io.packing_file import read_identified, read_source

            to.set_source(read_identified(packing, session.communicator(), read_source)[0])
        return to.summary if self.GIVES.startswith("str") else to.result

    def __str__(self):
        return shlex.join(self.line())


def files_of(values) -> list[str]:
    """The files among values of parameters: names of files, and the files of results and radii that have one."""
    files = [
        value if isinstance(value, str | Path) else getattr(value, "file", getattr(value, "path", None))
        for value in values
    ]
    return [str(file) for file in files if file is not None]


def _as_list(value) -> list:
    """The value of a parameter as a list, empty for None."""
    return list(value) if isinstance(value, tuple) else [] if value is None else [value]


def _gather(value):
    """An input with all its rows on this rank. Collective."""
    if isinstance(value, tuple):
        return tuple(map(_gather, value))
    return value.gathered() if hasattr(value, "gathered") else value


def _default_text(parameter):
    """The default of a parameter as `Job.settings` has it; None without one."""
    if parameter.required or parameter.default is None:
        return None
    return parameter.value_type.serialise(parameter.read(parameter.default))
