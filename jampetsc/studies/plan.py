"""STUDY.toml as a list of tasks: tables are jobs, keys their parameters, lists are multiplied out.

[pack]                    every response runs on every packing
n = [256, 1024]
pressure = [1e-2, 1e-3]
seeds = "1:20"
ladder = true             each pressure from the packing at the preceding one; the first from random particles
[[sweep]]
beta = [1.0, 1e-3]
where = {pressure = 1e-2} only on these packings
[quasistatic]
"""

import math
import tomllib
from dataclasses import dataclass

from jampetsc.commands import job_class, study_inputs
from jampetsc.errors import InputError
from jampetsc.io.atomic import open_regular
from jampetsc.options.job import ALL_SEEDS, NO_FILE, ONE_PACKING, ONE_RESULT, PACKING_OR_N
from jampetsc.options.parameters import suggest_name
from jampetsc.studies.table_keys import (
    TaskSettings,
    combinations_of,
    label_of,
    number_of,
    values_of,
)

SEED = "seed"
WHERE = "where"  # key of a table that selects its inputs by their settings
# key of [pack]: whether each pressure starts from the packing at the preceding one
LADDER = "ladder"
MAX_TASKS = 100_000  # tasks of one study
HASH_DIGITS = 8  # hexadecimal digits in the name of a file


@dataclass(frozen=True, eq=False)
class StudyTask:
    """One run of a command. Its name depends on its own settings and inputs only, not on the rest of the study."""

    name: str
    command: str
    settings: TaskSettings
    columns: dict  # column -> value: its settings and its packing's
    inputs: tuple = ()  # tasks whose files it reads
    digest: str = ""  # its identity, see `io.request`: the digests of its inputs stand for their files
    ensemble: str = ""  # the same without seeds, also of its inputs: that of all members of an ensemble

    @property
    def file(self) -> str:
        """Name of its result in the folder of the study."""
        return f"{self.name}.h5"

    @property
    def words(self) -> list[str]:
        """The command line that makes its file, if run in the folder of the study."""
        return self.line([task.file for task in self.inputs], self.file)

    def line(self, inputs, out) -> list[str]:
        """The command line for these names of files."""
        return self.settings.job_of(inputs).line(out)

    @property
    def level(self) -> int:
        """0 for a task that reads nothing, else one more than the highest level that it reads."""
        return 1 + max((task.level for task in self.inputs), default=-1)


def read(path) -> bytes:
    """The content of STUDY.toml. Raises InputError where it cannot be read."""
    try:
        with open_regular(path) as file:
            return file.read()
    except OSError as error:
        raise InputError(
            f"{path}: not readable ({error.strerror}). Check its name and permissions."
        ) from None


def plan(path, content: bytes | dict) -> list[StudyTask]:
    """The tasks of a study, each after the tasks whose files it reads.

    path      name of STUDY.toml in messages
    content   its content, or the same as a dictionary of tables

    Raises InputError naming file, table and key; too many tasks are refused before their list is made.
    """
    tables = _tables(path, content)
    tasks = {}  # name -> StudyTask; a repeated task is run once
    planned = {command: [] for command in study_inputs()}
    for command, task_inputs in study_inputs().items():
        for where, table in tables.get(command, []):
            reads_files = task_inputs.reads is not NO_FILE and not (
                task_inputs.reads is PACKING_OR_N and "n" in table
            )
            conditions = table.get(WHERE, {}) if reads_files else {}
            ladders = _ladders(table, where) if command == "pack" else [False]
            own_keys = [WHERE] * reads_files + [LADDER] * (command == "pack")
            keys = {key: value for key, value in table.items() if key not in own_keys}
            lists = values_of(job_class(command), keys, where)
            starts = _chosen(_starts(task_inputs, planned, where), conditions, where) if reads_files else [()]
            count = len(ladders) * len(starts) * math.prod(len(values) for _, values in lists)
            if len(tasks) + count > MAX_TASKS:
                existing = f" with the {len(tasks)} before them" if tasks else ""
                raise InputError(
                    f"{where}: too many tasks, {count}{existing} (at most {MAX_TASKS}). Divide the study."
                )
            combinations = combinations_of(job_class(command), lists, where, reads_files)
            for is_ladder in ladders:
                new_tasks = (
                    _rungs(combinations)
                    if is_ladder
                    else (_task(command, settings, inputs) for settings in combinations for inputs in starts)
                )
                for task in new_tasks:
                    if task.name not in tasks:
                        tasks[task.name] = task
                        planned[command].append(task)
    if not tasks:
        raise InputError(f"{path}: no table. Add [pack] and tables of the commands to run on the packings.")
    return list(tasks.values())


def _tables(path, content):
    """{command: [(where, table)]}. Raises InputError."""
    try:
        content = content if isinstance(content, dict) else tomllib.loads(content.decode())
    except ValueError as error:  # of TOML, of text, of a number with too many digits
        raise InputError(f"{path}: not TOML ({error}). Correct the file.") from None
    except RecursionError:
        raise InputError(f"{path}: brackets nested too deeply. Remove them.") from None
    tables_of = {}
    for command, value in content.items():
        if command not in study_inputs():
            hint = suggest_name(command, study_inputs()) or f"; there are {', '.join(study_inputs())}"
            raise InputError(f"{path}: {command}: no table of a study has this name{hint}")
        tables = value if isinstance(value, list) else [value]
        if not tables or not all(isinstance(table, dict) for table in tables):
            raise InputError(f"{path}: {command} = {value}: not a table. Write [{command}].")
        several = len(tables) > 1
        tables_of[command] = [
            (f"{path}: [{command}]{f' number {number}' if several else ''}", table)
            for number, table in enumerate(tables, 1)
        ]
    return tables_of


def _starts(task_inputs, planned, where):
    """The inputs of the tasks of a command, [(task, …)]. Raises InputError where there are none."""
    if task_inputs.reads in (ONE_PACKING, PACKING_OR_N):
        sources = [task for command in task_inputs.commands or ("pack",) for task in planned[command]]
        if not sources:
            raise InputError(
                f"{where}: needs packings. Add a table [pack]{' or n' if task_inputs.reads is PACKING_OR_N else ''}."
            )
        return [(source,) for source in sources]
    files = [
        task
        for command in task_inputs.commands
        for task in planned[command]
        if task_inputs.is_suitable(task.settings.job)
    ]
    if not files:
        tables = " or ".join(f"[{command}]" for command in task_inputs.commands)
        raise InputError(f"{where}: needs {task_inputs.needs}. Add a table {tables}.")
    if task_inputs.reads is ONE_RESULT:
        return [(task,) for task in files]
    groups = {}
    for task in files:
        groups.setdefault(task.ensemble, []).append(task)
    return [tuple(group) for group in groups.values()]


def _chosen(starts, conditions, where):
    """The inputs whose columns have values of the `conditions`. Raises InputError where none has."""
    if not isinstance(conditions, dict):
        raise InputError(
            f"{where}: {WHERE} = {conditions!r}: not a table. Write e.g. {WHERE} = {{pressure = 1e-4}}."
        )
    for name, value in conditions.items():
        values = [number_of(item) for item in (value if isinstance(value, list) else [value])]
        matching = [inputs for inputs in starts if _shared(inputs).get(name) in values]
        if not matching:
            raise InputError(f"{where}: {WHERE}: no task with {name} = {value}. Choose another value.")
        starts = matching
    return starts


def _shared(inputs):
    """The settings that all of these tasks share; seeds differ where a task reads all of them."""
    shared = inputs[0].columns if inputs else {}
    return {k: v for k, v in shared.items() if all(task.columns.get(k) == v for task in inputs)}


def _task(command, settings, inputs):
    shared, digests = _shared(inputs), [task.digest for task in inputs]
    ensembles = [task.ensemble for task in inputs[:1]]
    if study_inputs()[command].reads is ALL_SEEDS:  # with more seeds it is the same task, done again
        shared.pop(SEED, None)
        digests = ensembles
    columns = {**shared, **settings.options}
    digest = settings.digest(digests)
    name = "-".join(filter(None, (command, label_of(columns), digest[:HASH_DIGITS])))
    return StudyTask(name, command, settings, columns, inputs, digest, settings.digest(ensembles, SEED))


def _ladders(table, where) -> list[bool]:
    """The values of the key `ladder` of a table [pack]. Raises InputError."""
    values = table.get(LADDER, False)
    values = values if isinstance(values, list) else [values]
    if not values or not all(isinstance(value, bool) for value in values):
        raise InputError(f"{where}: {LADDER} = {table[LADDER]!r}: must be true, false or a list of them")
    if any(values) and "pressure" not in table:
        raise InputError(f"{where}: {LADDER}: a ladder without pressures. Give pressure.")
    return values


def _rungs(combinations):
    """The tasks of ladders, each of which reads the packing at the previous pressure.

    The first task of a ladder reads nothing: it is the same packing as without a ladder.
    """
    last_rungs = {}  # of each ladder: the task of its last pressure so far
    for settings in combinations:
        ladder = settings.digest((), "pressure")
        above = last_rungs.get(ladder)
        settings = settings if above is None else settings.continued(**{LADDER: True})
        last_rungs[ladder] = _task("pack", settings, () if above is None else (above,))
        yield last_rungs[ladder]
