"""The row of the page for each claim: the worst of the numbers that decide it, or their mean."""

from papers.claims.page import MEANS, PAGE, TEXTS
from papers.claims.shared import Row
from papers.claims.verdicts import AGREES, DIFFERS, UNDECIDED, distance_from, mean_estimate, verdict

GRAVITY = {AGREES: 0, UNDECIDED: 1, DIFFERS: 2}


def combined(key: str, rows: list[Row]) -> Row:
    """The row of a claim that several numbers decide."""
    sizes = "; ".join(dict.fromkeys(row.size for row in rows if row.size))
    if key in MEANS:
        reason = "mean of " + " and ".join(f"{row.ours} ({row.part})" for row in rows)
        ours = mean_estimate([row.ours for row in rows])
        return Row(TEXTS[key], rows[0].theirs, ours, rows[0].target, reason, sizes)

    def badness(row):
        return GRAVITY[verdict(row.ours, row.target)[0]], distance_from(row.ours, row.target)

    worst = max(rows, key=badness)
    label = f"worst of {len(rows)}: {worst.part}".removesuffix(": ")
    reason = "; ".join(filter(None, (label, worst.reason)))
    identity = worst.identity if all(row.identity for row in rows) else ""
    return Row(TEXTS[key], worst.theirs, worst.ours, worst.target, reason, sizes, identity=identity)


def page_rows(entries) -> list:
    """[(group, key, figures, row, parts)] of the page, in its order; parts: the numbers (n,) that decide.

    entries     [(figures, row)] of all numbers; claims without a number are left out
    """
    rows = []
    for group, claims in PAGE.items():
        for key in claims:
            parts = [(figures, row) for figures, row in entries if row.bears == key and row.decides]
            if parts:
                figures = tuple(dict.fromkeys(name for names, _ in parts for name in names))
                numbers = [row for _, row in parts]
                row = combined(key, numbers) if len(numbers) > 1 else numbers[0]
                rows.append((group, key, figures, row, numbers))
    return rows
