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
        [word.ljust(width) for word, width in zip(start, widths, strict=False)] + list(row[len(start) :])
        for row, start in zip(rows, padded, strict=True)
    ]


FORMULAS = ("=", "+", "-", "@", "\t", "\r")  # first characters of a cell that a spreadsheet computes
QUOTE = "'"  # put before such text, and before text that begins with it


def comma_separated(names, rows) -> str:
    """Rows {name: cell} below a line of names; a row may lack some. Text is quoted, see `unquoted`."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(_harmless, names))
    writer.writerows([_harmless(row.get(name, "")) for name in names] for row in rows)
    return text.getvalue()


def _harmless(cell):
    """A cell that no spreadsheet takes for a formula; a number as text stays one."""
    if not isinstance(cell, str) or not cell.startswith((*FORMULAS, QUOTE)):
        return cell
    try:
        float(cell)
    except ValueError:
        return f"{QUOTE}{cell}"
    return cell


def unquoted(cell: str) -> str:
    """The text of a cell without the quote that `comma_separated` has put before it."""
    return cell[1:] if cell.startswith(tuple(QUOTE + sign for sign in (*FORMULAS, QUOTE))) else cell
