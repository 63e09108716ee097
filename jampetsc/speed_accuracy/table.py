"""The measured rows: as CSV with their provenance, and as text that is also Markdown."""

import csv
import io
import math
from dataclasses import dataclass, fields

from jampetsc.columns import aligned
from jampetsc.io.atomic import write_whole

MEANINGS = {
    "group": "what is varied",
    "choice": "how",
    "seconds": "time of the run as its result file has it; of an ensemble, packing included",
    "process_seconds": "time of its processes, start and imports included",
    "memory_mb": "largest resident memory of one process",
    "factorisations": "sparse factorisations",
    "certified": "largest relative error bound, of G' and of G''",
    "error_storage": "largest relative deviation of G' from the reference",
    "error_loss": "the same of G''",
    "window_storage": "largest relative deviation of G' in the critical window",
    "window_loss": "the same of G''",
    "exponent_storage": "slope d ln G'/d ln omega over the critical window",
    "exponent_storage_error": "its standard error; of an ensemble, from packing to packing",
    "exponent_loss": "slope d ln G''/d ln omega over the critical window",
    "exponent_loss_error": "its standard error",
    "stderr_storage": "largest relative standard error of a mean of G', in the window if there is one",
    "stderr_loss": "the same of G''",
    "note": "what else is to be said; what went wrong",
}
_SHOWN = {  # column of the text -> (field, format)
    "seconds": ("seconds", ".2f"),
    "process s": ("process_seconds", ".2f"),
    "MB": ("memory_mb", ".0f"),
    "factors": ("factorisations", "d"),
    "certified": ("certified", ".0e"),
    "error G'": ("error_storage", ".1e"),
    "error G''": ("error_loss", ".1e"),
    "in window G'": ("window_storage", ".1e"),
    "in window G''": ("window_loss", ".1e"),
    "slope G'": ("exponent_storage", ".3f"),
    "slope G''": ("exponent_loss", ".3f"),
    "std. err. G'": ("stderr_storage", ".1e"),
    "std. err. G''": ("stderr_loss", ".1e"),
}


@dataclass(frozen=True)
class Row:
    """One measured choice; nan where a quantity has no meaning. The fields are told in `MEANINGS`."""

    group: str  # reference | accuracy | method | physics | frequencies | ensemble
    choice: str
    seconds: float = math.nan
    process_seconds: float = math.nan
    memory_mb: float = math.nan
    factorisations: int | None = None
    certified: float = math.nan
    error_storage: float = math.nan
    error_loss: float = math.nan
    window_storage: float = math.nan
    window_loss: float = math.nan
    exponent_storage: float = math.nan
    exponent_storage_error: float = math.nan
    exponent_loss: float = math.nan
    exponent_loss_error: float = math.nan
    stderr_storage: float = math.nan
    stderr_loss: float = math.nan
    note: str = ""
    failed: bool = False

    @property
    def error(self) -> float:
        """The larger of the errors of G' and of G''."""
        return math.nan if math.isnan(self.error_storage) else max(self.error_storage, self.error_loss)


@dataclass(frozen=True)
class Table:
    """Rows in the order in which they were measured; `facts` are lines on what was measured, on what."""

    rows: list[Row]
    facts: list[str]

    def write(self, path) -> None:
        """Write the CSV, complete or not at all: comment lines with #, a header, a line per row."""
        text = io.StringIO()
        meanings = [f"{name}: {meaning}" for name, meaning in MEANINGS.items()]
        text.writelines(f"# {line}\n" for line in [*self.facts, *meanings])
        names = [field.name for field in fields(Row)]
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(names)
        for row in self.rows:
            writer.writerow([_cell(getattr(row, name)) for name in names])
        write_whole(path, text.getvalue().encode())

    @property
    def resolved(self) -> float:
        """The bound of the reference: smaller errors are not resolved."""
        return next((row.certified for row in self.rows if row.group == "reference"), 0.0)

    def _text(self, row, field, form):
        value = getattr(row, field)
        if not _known(value):
            return ""
        small = field.startswith(("error_", "window_")) and value < self.resolved
        return f"< {self.resolved:.0e}" if small else format(value, form)

    def __str__(self):
        columns = {
            title: (field, form)
            for title, (field, form) in _SHOWN.items()
            if any(_known(getattr(row, field)) for row in self.rows)
        }
        lines = [["", "choice", *columns, "note"]]
        before = None
        for row in self.rows:
            cells = [self._text(row, field, form) for field, form in columns.values()]
            lines.append([row.group if row.group != before else "", row.choice, *cells, row.note])
            before = row.group
        lines = aligned(lines)
        lines.insert(1, ["-" * len(cell) for cell in lines[0]])
        return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _known(value):
    return value is not None and not (isinstance(value, float) and math.isnan(value))


def _cell(value):
    if not _known(value):
        return ""
    if isinstance(value, bool):
        return int(value)
    return f"{value:.6g}" if isinstance(value, float) else value
