"""The measured rows: as CSV with their provenance, and as text that is also Markdown."""

import math
from dataclasses import dataclass, field, fields

from jampetsc.columns import aligned, comma_separated
from jampetsc.io.atomic import write_whole


def _word(meaning, **default):
    return field(**default, metadata={"meaning": meaning})


def _number(meaning, title="", form=".1e"):
    """A field that is nan where it has no meaning; title, form: its column in the text, if it has one."""
    return field(default=math.nan, metadata={"meaning": meaning, "title": title, "form": form})


@dataclass(frozen=True)
class TradeRow:
    """One measured choice. The comments of the file explain its fields."""

    group: str = _word("what is varied")  # reference | accuracy | method | physics | frequencies | ensemble
    choice: str = _word("how")
    seconds: float = _number(
        "time of the run as its result file has it; of an ensemble, packing included", "seconds", ".2f"
    )
    process_seconds: float = _number("time of its processes, start and imports included", "process s", ".2f")
    memory_mb: float = _number("largest resident memory of one process", "MB", ".0f")
    factorisations: float = _number("sparse factorisations", "factors", "d")
    certified: float = _number("largest relative error bound, of G' and of G''", "certified", ".0e")
    error_storage: float = _number("largest relative deviation of G' from the reference", "error G'")
    error_loss: float = _number("the same of G''", "error G''")
    window_storage: float = _number("largest relative deviation of G' in the critical window", "in window G'")
    window_loss: float = _number("the same of G''", "in window G''")
    exponent_storage: float = _number("slope d ln G'/d ln omega over the critical window", "slope G'", ".3f")
    exponent_storage_error: float = _number("its standard error; of an ensemble, from packing to packing")
    exponent_loss: float = _number("slope d ln G''/d ln omega over the critical window", "slope G''", ".3f")
    exponent_loss_error: float = _number("its standard error")
    stderr_storage: float = _number(
        "largest relative standard error of a mean of G', in the window if there is one", "std. err. G'"
    )
    stderr_loss: float = _number("the same of G''", "std. err. G''")
    note: str = _word("what else is to be said; what went wrong", default="")
    failed: bool = False

    @property
    def error(self) -> float:
        """The larger of the errors of G' and of G''."""
        return math.nan if math.isnan(self.error_storage) else max(self.error_storage, self.error_loss)


def write(path, rows, facts) -> None:
    """Write rows as CSV, complete or not at all: comment lines with #, a header, a line per row.

    facts   lines about packing, law, machine and reference
    """
    meanings = [
        f"{column.name}: {column.metadata['meaning']}" for column in fields(TradeRow) if column.metadata
    ]
    above = "".join(f"# {line}\n" for line in [*facts, *meanings])
    cells = ({name: _cell(value) for name, value in vars(row).items()} for row in rows)
    text = above + comma_separated([column.name for column in fields(TradeRow)], cells)
    write_whole(path, text.encode(errors="backslashreplace"))  # names of files that are no text


def as_text(rows) -> str:
    """Rows, the reference first, as lines of text; errors below the bound of the reference are not resolved."""
    shown = [
        column
        for column in fields(TradeRow)
        if column.metadata.get("title") and any(not math.isnan(getattr(row, column.name)) for row in rows)
    ]
    lines = [["", "choice", *(column.metadata["title"] for column in shown), "note"]]
    before = None
    for row in rows:
        cells = [_text(row, column, rows[0].certified) for column in shown]
        lines.append([row.group if row.group != before else "", row.choice, *cells, row.note])
        before = row.group
    lines = aligned(lines)
    lines.insert(1, ["-" * len(cell) for cell in lines[0]])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _text(row, column, resolved):
    value = getattr(row, column.name)
    if math.isnan(value):
        return ""
    small = column.name.startswith(("error_", "window_")) and value < resolved
    return f"< {resolved:.0e}" if small else format(value, column.metadata["form"])


def _cell(value):
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return int(value) if isinstance(value, bool) else value
