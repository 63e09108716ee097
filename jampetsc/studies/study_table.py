"""table.csv: one row per task, with its settings, its state and its numbers."""

from jampetsc.columns import comma_separated

# columns that come first and last, if they exist
FIRST_COLUMNS = ("command", "state", "file", "packing", "n", "pressure", "phi", "seed", "law")
LAST_COLUMNS = ("seconds",)


def rows_of(tasks, records: dict) -> list[dict]:
    """The rows of the tasks in STUDY.toml, in its order, then of done tasks that an earlier STUDY.toml asked for.

    Unfinished tasks have no row.
    """
    names = {task.name: None for task in tasks if task.name in records}  # a set in order
    before = [name for name, record in records.items() if name not in names and record["state"] == "done"]
    return [_row(records[name]) for name in [*names, *sorted(before)]]


def _row(record):
    state = "done" if record["state"] == "done" else f"failed: {record['why']}"
    return record["row"] | {"state": state, "seconds": round(record["seconds"], 3)}


def table_text(rows) -> str:
    """The table as CSV; numbers to their last digit, nothing where a task has none."""
    names = {name: None for row in rows for name in row}
    columns = [name for name in FIRST_COLUMNS if name in names]
    columns += [name for name in names if name not in (*FIRST_COLUMNS, *LAST_COLUMNS)] + list(LAST_COLUMNS)
    return comma_separated(columns, ({name: _cell(value) for name, value in row.items()} for row in rows))


def _cell(value):
    if isinstance(value, bool):
        return int(value)
    return value if value == value else None  # for which csv writes nothing
