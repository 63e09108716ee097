"""Inputs that are several results: the files of a study, and a result derived from them."""

import re
import time
from pathlib import Path

from jampetsc.errors import InputError, named
from jampetsc.io.ensemble import TABLE, Ensemble
from jampetsc.io.provenance import derived_from
from jampetsc.io.reader import load
from jampetsc.io.results import noted
from jampetsc.options.job import Job, files_of
from jampetsc.options.parameters import optional_parameter
from jampetsc.options.values import input_name, load_source, refuse_repeated

WHERE = optional_parameter(
    "study: use only the files whose rows in its table have these values", metavar="COLUMN=VALUE,…"
)


class FitJob(Job):
    """A job that fits numbers of many files, its `results`; of a study the rows that `where` chooses."""

    @property
    def formats(self) -> tuple[str, ...]:
        """Names of the formats that it reads."""
        raise NotImplementedError

    @property
    def sources(self) -> list:
        """The inputs: files, of a study the files of its rows, and results in memory."""
        return files_named(self.results, self.where, self.formats)

    @property
    def paths(self):
        """See `Job`; of a study the files of its rows."""
        return files_of(self.sources)

    def check_outputs(self, to):
        """Refuse a result given twice, and an output that may not be replaced."""
        refuse_repeated(self.sources)
        super().check_outputs(to)


FEW = 5  # values of a column that a message names


def rows_named(sources, where) -> list:
    """The sources; the folder of a study is replaced by its table, an `Ensemble`, of the rows that have these values.

    where    column=value,…, or None

    Raises InputError for a malformed `where`, and for one without a study or that no row has.
    """
    conditions = _wanted(where)
    studies = [isinstance(source, str) and (Path(source) / TABLE).exists() for source in sources]
    if conditions and not any(studies):
        load_source(sources[0])  # which may be missing, or the folder of a study that was stopped
        raise InputError(f"{named('where')} {where}: {input_name(sources[0])} is not a study. Leave it out.")
    results = [load(source) if study else source for source, study in zip(sources, studies, strict=True)]
    for place, study in enumerate(results):
        if conditions and studies[place]:
            results[place] = study.where(**conditions)
            if not results[place].rows:
                available = "; ".join(f"{name} is {_values(study[name])}" for name in conditions)
                raise InputError(
                    f"{named('where')} {where}: no such row in {study.table}. Choose among: {available}."
                )
    return results


def files_named(sources, where, formats) -> list:
    """`rows_named`, with the files of these formats in place of each study. Raises InputError for a study without any.

    formats    names of formats, each of the command of this name
    """
    commands, files = [name.removeprefix("jampetsc-") for name in formats], []
    for item in rows_named(sources, where):
        if not isinstance(item, Ensemble):
            files.append(item)
            continue
        done = item.where(state="done", command=commands)
        if not done.rows:
            here = f" where {where}" if where else ""
            raise InputError(
                f"{item.path}: no finished {' or '.join(commands)} task{here}. Run such tasks in the study first."
            )
        files += [str(item.path / name) for name in done["file"].tolist()]
    return files


def _values(column) -> str:
    """The values of a column in words, some of many."""
    distinct = list(dict.fromkeys(str(value) for value in column.tolist() if value == value and value != ""))
    few = (
        distinct if len(distinct) <= FEW else [*distinct[: FEW - 1], f"one of {len(distinct) - FEW + 1} more"]
    )
    return " or ".join(few)


def _wanted(where) -> dict:
    """{column: value} of column=value,…; empty for None. Raises InputError."""
    # a value may have commas, as that of a load
    pairs = [word.partition("=") for word in re.split(r",(?=\s*[\w-]+\s*=)", where)] if where else []
    if not all(name and equals and value for name, equals, value in pairs):
        raise InputError(
            f"{named('where')} {where}: not a list of conditions. Write column=value, e.g. law=stokes,beta=1."
        )
    return {name.strip().replace("-", "_"): value.strip() for name, _, value in pairs}


def write_derived(to, format, results, start_time, arrays: dict, notes=(), **attributes) -> None:
    """Write a result that was computed from other results: arrays by name, and attributes beside the shared ones.

    start_time   time.perf_counter() at the start
    notes        on its numbers, see `io.results`, all that are to be kept
    """
    with to.writer(format) as writer:
        for name, values in arrays.items():
            writer.dataset(name, values)
        writer.attributes(
            **derived_from(results, time.perf_counter() - start_time) | attributes, notes=noted(list(notes))
        )
