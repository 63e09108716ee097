"""The measured rows: as CSV with their provenance, as text that is also Markdown, and as recommended settings.

Recommendations follow rules that are printed with them. For a first look errors may be 5 %, less than a line width on
log axes over ten decades; for a figure 0.5 %, a line width on linear axes; an exponent is given with two digits after
the point, so it may change by 0.005.
"""

import math
from dataclasses import dataclass, field, fields

from jampetsc.columns import aligned, comma_separated
from jampetsc.io.atomic import write_whole

LOOK, FIGURE = 0.05, 0.005  # largest error of G' and of G''
MAX_SLOPE_CHANGE = 0.005  # largest change of either slope of the critical branch
STAND_IN_TOLERANCE = 0.05  # simpler physics that changes neither slope by more has the same exponent
SIGNIFICANT_ERRORS = 2.8  # standard errors: 2√2, because the big packing of the same size scatters as much
# runs within this ratio of the shortest time are equally fast; the most exact one is taken
EQUAL_TIME_RATIO = 1.1


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


def write_table(path, rows, facts) -> None:
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


def format_table(rows) -> str:
    """Rows, the reference first, as lines of text; errors below the bound of the reference are not resolved."""
    shown = [
        column
        for column in fields(TradeRow)
        if column.metadata.get("title") and any(not math.isnan(getattr(row, column.name)) for row in rows)
    ]
    lines = [["", "choice", *(column.metadata["title"] for column in shown), "note"]]
    previous = None
    for row in rows:
        cells = [_text(row, column, rows[0].certified) for column in shown]
        lines.append([row.group if row.group != previous else "", row.choice, *cells, row.note])
        previous = row.group
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


def advise(rows) -> list[str]:
    """Lines of recommendation for a table's rows."""
    good = [row for row in rows if not row.failed]
    runs = [row for row in good if row.group in ("accuracy", "method")]
    reference = next(row for row in good if row.group == "reference")
    lines = []
    for use, limit in (("first look", LOOK), ("figure", FIGURE)):
        rule = f"largest error of G' and G'' at most {limit:g}"
        lines.append(f"for a {use} ({rule}): {_cheapest(runs, lambda r, x=limit: r.error <= x, reference)}")
        lines += _frequencies(good, limit)
    if not math.isnan(reference.exponent_storage):
        rule = f"both slopes within {MAX_SLOPE_CHANGE:g} of the reference"
        best = _cheapest(runs, lambda r: _slope_change(r, reference) <= MAX_SLOPE_CHANGE, reference)
        lines.append(f"for an exponent ({rule}): {best}")
        lines += _stand_ins(good, reference)
    rule = f"the fastest run that meets a rule; the most exact of those within {EQUAL_TIME_RATIO - 1:.0%} of its time"
    return [f"recommended is {rule}", *lines, *_packings(good)]


def _cheapest(runs, fits, reference) -> str:
    """The fastest run that fits, as text; among equally fast ones the most exact."""
    fitting = [row for row in runs if fits(row)]
    if not runs:
        return f"the reference, {reference.choice}, {reference.seconds:.2f} s (no other setting was run)"
    if not fitting:
        return f"only the reference, {reference.choice}, {reference.seconds:.2f} s"
    fastest = min(row.seconds for row in fitting)
    best = min(
        (row for row in fitting if row.seconds <= EQUAL_TIME_RATIO * fastest), key=lambda row: row.error
    )
    error = max(best.error, reference.certified)
    return f"{best.choice}, {best.seconds:.2f} s, error at most {error:.0e}"


def _frequencies(rows, limit):
    """How many frequencies suffice where each one has to be solved."""
    grids = [row for row in rows if row.group == "frequencies"]
    if not grids:
        return []
    enough = min((row for row in grids if row.error <= limit), key=lambda row: row.seconds, default=None)
    if enough is None:
        return [
            f"  solved one by one: more than {grids[-1].choice}; a rational sweep gives G* at any frequency"
        ]
    return [f"  solved one by one: {enough.choice} and interpolation do, {enough.seconds:.2f} s"]


def _slope_change(row, reference):
    """The larger change of a slope; inf where a row has none."""
    changes = [
        abs(getattr(row, f"exponent_{n}") - getattr(reference, f"exponent_{n}")) for n in ("storage", "loss")
    ]
    return math.inf if any(math.isnan(change) for change in changes) else max(changes)


def _stand_ins(rows, reference):
    """Which simpler physics has the same exponents."""
    physics = [row for row in rows if row.group == "physics"]
    if not physics:
        return []
    same = [
        f"{row.choice} ({row.seconds:.2f} s)"
        for row in physics
        if _slope_change(row, reference) <= STAND_IN_TOLERANCE
    ]
    which = ", ".join(same) or "none of those tried"
    return [f"  other physics with both slopes within {STAND_IN_TOLERANCE:g}: {which}"]


def _packings(rows):
    """Whether many small packings have the mean of a big one, and which accuracy is below their scatter."""
    ensembles = [row for row in rows if row.group == "ensemble"]
    many = [row for row in ensembles if not math.isnan(row.stderr_storage)]
    single = max((_off(row) for row in ensembles if row not in many), default=0.0)
    lines = []
    if single:
        lines.append(
            f"another packing of the same size is off by {single:.1e}: that is the scatter of single ones"
        )
    for row in many:
        off, scatter = _off(row), max(row.stderr_storage, row.stderr_loss)
        same = off <= max(SIGNIFICANT_ERRORS * scatter, single)
        verdict = "no more than scatter" if same else "more than scatter, too few disks each"
        lines.append(
            f"{row.choice}: {row.seconds:.1f} s, mean off by {off:.1e} with standard error {scatter:.1e}, "
            f"{verdict}; an accuracy below {scatter / 10:.0e} is lost in it"
        )
    return lines


def _off(row):
    """The larger deviation of G' and G'': in the critical window if there is one, else anywhere."""
    inside = max(row.window_storage, row.window_loss)
    return row.error if math.isnan(row.window_storage) else inside
