"""Rows as columns, for every text that is a table: words that stand below each other, or commas between them."""

import csv
import io


def aligned(rows, last: bool = True) -> list[list[str]]:
    """Rows of words, each word padded to the width of its column; rows may differ in length.

    last: whether the last word of a row counts as well; without it a long remark there widens no column.
    """
    padded = [row if last else row[:-1] for row in rows]
    widths = [
        max(len(row[column]) for row in padded if len(row) > column)
        for column in range(max(map(len, padded), default=0))
    ]
    return [
        [word.ljust(width) for word, width in zip(some, widths, strict=False)] + list(row[len(some) :])
        for row, some in zip(rows, padded, strict=True)
    ]


def comma_separated(names, rows) -> str:
    """Rows {name: cell} below a line of names; a row leaves out what it has not."""
    text = io.StringIO()
    writer = csv.DictWriter(text, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
