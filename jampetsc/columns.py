"""Rows of words as columns, for every text that is a table."""


def aligned(rows, last: bool = True) -> list[list[str]]:
    """Rows of words, each word padded to the width of its column; rows may differ in length.

    last: the last word of a row too; without it a long remark there widens no column.
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
