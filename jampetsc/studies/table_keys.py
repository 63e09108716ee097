"""The keys of a table of STUDY.toml: the parameters of a job, written as the options of its command."""

import dataclasses
import functools
import itertools
from dataclasses import dataclass

from jampetsc.commands.pack import PARTICLE_PARAMETERS
from jampetsc.errors import InputError
from jampetsc.io.request import digest_of, input_hashes, settings_of, with_inputs
from jampetsc.options.job import Job
from jampetsc.options.parameters import COUNT, FILES, NUMBER, OPTION, build_job, parameters, suggest_name
from jampetsc.options.values import read_seeds

STUDY_KEYS = ("out", "packing", "last", "overwrite", "quiet")  # keys that the study sets itself
# column -> its letters in names of files
LABEL_LETTERS = {"n": "n", "pressure": "p", "phi": "phi", "seed": "s"}
PLACEHOLDER = "<file of another task>"  # stands for real files while values are checked


@dataclass(frozen=True, eq=False)
class TaskSettings:
    """One value for every key of a table."""

    options: dict  # parameter -> value given by the table
    job: Job  # with PLACEHOLDER for the files of other tasks

    def job_of(self, inputs) -> Job:
        """The job for real files."""
        place = _place(type(self.job))
        if place is None or not inputs:
            return self.job
        files = tuple(inputs) if place.place == FILES else inputs[0]
        return dataclasses.replace(self.job, **{place.name: files})

    def continued(self, **columns) -> "TaskSettings":
        """The same of a packing that is made from another one, whose particles it has; columns: what its row adds."""
        fixed = dict.fromkeys(("seed", *PARTICLE_PARAMETERS))
        job = dataclasses.replace(self.job, **fixed, from_=PLACEHOLDER)
        return TaskSettings(self.options | columns, job)

    @functools.cached_property
    def _identity(self):
        """(settings, hashes of its other inputs), see `io.request`."""
        return settings_of(self.job), input_hashes(self.job, without=(PLACEHOLDER,))

    def digest(self, hashes, without: str | None = None) -> str:
        """The digest of the job where the files of other tasks have these hashes; without: a parameter to leave out."""
        settings, other_hashes = self._identity
        settings = {name: text for name, text in settings.items() if name != without}
        return digest_of(with_inputs(settings, [*other_hashes, *hashes]))


def _place(job):
    """The parameter of a class of jobs that takes the files of other tasks, or None."""
    declared = parameters(job)
    return next(
        (parameter for parameter in declared.values() if parameter.place != OPTION), declared.get("from_")
    )


def values_of(job, table: dict, where: str) -> list:
    """[(parameter of the class of jobs, its values)] of a table; `where` names file and table in messages.

    A key may be written with an underscore as in python: eta_f for eta-f. Raises InputError for a key
    that the job does not have or that is there twice, and for a value of the wrong type.
    """
    options = {
        parameter.word[2:]: parameter for parameter in parameters(job).values() if parameter.place == OPTION
    }
    lists = []
    keys = [key.replace("_", "-") for key in table]
    for key, value in zip(keys, table.values(), strict=True):
        if keys.count(key) > 1:
            raise InputError(f"{where}: {key}: given twice. Leave one out.")
        if key in STUDY_KEYS:
            raise InputError(f"{where}: {key}: set by the study. Leave it out.")
        if key not in options and not (key == "seeds" and "seed" in options):
            hint = suggest_name(key, set(options) - set(STUDY_KEYS))
            raise InputError(f"{where}: {key}: no such option{hint}")
        lists.append(_values(options, key, value, where))
    return lists


def combinations_of(job, lists: list, where: str, reads_files: bool) -> list[TaskSettings]:
    """Every combination of the values that `values_of` returned, the last key varying fastest.

    job   the class of jobs; reads_files: whether it reads files of other tasks

    Raises InputError for a value that the job refuses.
    """
    place = _place(job)
    files = (
        {place.name: [PLACEHOLDER] if place.place == FILES else PLACEHOLDER} if place and reads_files else {}
    )
    keys = {parameter.name: parameter.word[2:] for parameter in parameters(job).values()}
    combinations = []
    for values in itertools.product(*(values for _, values in lists)):
        pairs = [(parameter, value) for (parameter, _), value in zip(lists, values, strict=True)]
        values_by_name = {parameter.name: _typed(parameter, value) for parameter, value in pairs}
        try:
            task_job = build_job(job, files | values_by_name)
        except InputError as error:
            raise InputError(f"{where}: {error.message(lambda name: keys.get(name, name))}") from None
        options = {name: number_of(value) for name, value in values_by_name.items()}
        combinations.append(TaskSettings(options, task_job))
    return combinations


def _values(options, key, value, where):
    """(parameter, its values) for one key. Raises InputError."""
    if key == "seeds" and "seed" in options:  # one task per seed, not one run of the job for all
        key, value = "seed", _seeds(value, where)
    parameter, values = options[key], value if isinstance(value, list | range) else [value]
    if not values:
        raise InputError(f"{where}: {key} = []: empty. Give at least one value.")
    for item in () if isinstance(values, range) else values:
        if _is_switch(parameter) and not isinstance(item, bool):
            raise InputError(f"{where}: {key} = {item!r}: a switch must be true or false")
        if not _is_switch(parameter) and (isinstance(item, bool) or not isinstance(item, int | float | str)):
            text = str(item).lower() if isinstance(item, bool) else str(item)
            raise InputError(f"{where}: {key} = {text}: must be a number, a string or a list of them")
    return parameter, values


def _is_switch(parameter):
    return isinstance(parameter.default, bool)


def _seeds(value, where):
    """The seeds of "first:last", a range; a list or one number as it is."""
    if not isinstance(value, str):
        return value
    try:
        return read_seeds(value)
    except (InputError, ValueError) as error:
        raise InputError(f"{where}: seeds {value}: {error}") from None


def _typed(parameter, value):
    """A value as the job reads it, with numbers written in one way."""
    if _is_switch(parameter):
        return parameter.default != value  # a switch that is on by default has a key that turns it off
    text = str(number_of(value))
    try:
        return parameter.value_type.read(text) if parameter.value_type in (NUMBER, COUNT) else text
    except ValueError:  # which the job refuses
        return text


def number_of(value):
    """A number where a string is one, any other value as it is."""
    if isinstance(value, str):
        for kind in (int, float):
            try:
                return kind(value)
            except ValueError:
                continue
    return value


def label_of(columns: dict) -> str:
    """The part of a file's name that describes its task: n1024-p0.001-s1."""
    words = [
        f"{short}{columns[name]:g}"
        for name, short in LABEL_LETTERS.items()
        if isinstance(columns.get(name), int | float)
    ]
    return "-".join(words)
