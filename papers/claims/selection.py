"""The row of the page for each claim, and the claim on which each number bears, by the patterns of claims/page.py."""

import re

from papers.claims.page import MEAN, PAGE, PageClaim
from papers.claims.shared import Row
from papers.claims.verdicts import AGREES, DIFFERS, UNDECIDED, distance_from, mean_estimate, verdict

GRAVITY = {AGREES: 0, UNDECIDED: 1, DIFFERS: 2}


def matched(pattern: str, name: str) -> re.Match | None:
    """The match of a number's name by a pattern, its … as groups."""
    return re.fullmatch("(.*?)".join(map(re.escape, pattern.split("…"))), name)


def label_of(claim: PageClaim, row: Row) -> str | None:
    """Label of a number among those that decide a claim; None for other numbers."""
    for pattern, label in claim.decisive.items():
        match = matched(pattern, row.claim) if row.target is not None else None
        if match:
            return label.format(*match.groups())
    return None


def claim_of(row: Row) -> PageClaim | None:
    """The claim that a number decides, else the first on which it bears; None beside all claims."""
    claims = [claim for group in PAGE.values() for claim in group]
    for claim in claims:
        if label_of(claim, row) is not None:
            return claim
    for claim in claims:
        if any(matched(pattern, row.claim) for pattern in (*claim.decisive, *claim.supporting)):
            return claim
    return None


def combined(claim: PageClaim, rows: list[Row]) -> Row:
    """The row of a claim that several numbers decide."""
    sizes = "; ".join(dict.fromkeys(row.size for row in rows if row.size))
    if claim.combine == MEAN:
        reason = "mean of " + " and ".join(f"{row.ours} ({label_of(claim, row)})" for row in rows)
        ours = mean_estimate([row.ours for row in rows])
        return Row(claim.text, rows[0].theirs, ours, rows[0].target, reason, sizes)

    def badness(row):
        return GRAVITY[verdict(row.ours, row.target)[0]], distance_from(row.ours, row.target)

    worst = max(rows, key=badness)
    label = f"worst of {len(rows)}: {label_of(claim, worst)}".removesuffix(": ")
    reason = "; ".join(filter(None, (label, worst.reason)))
    return Row(claim.text, worst.theirs, worst.ours, worst.target, reason, sizes)


def page_rows(entries) -> list:
    """[(group, claim, figures, row, parts)] of the page, in its order; parts: the numbers (n,) that decide.

    entries     [(figures, row)] of all numbers; claims without a number are left out
    """
    rows = []
    for group, claims in PAGE.items():
        for claim in claims:
            parts = [(figures, row) for figures, row in entries if label_of(claim, row) is not None]
            if parts:
                figures = tuple(dict.fromkeys(name for names, _ in parts for name in names))
                numbers = [row for _, row in parts]
                row = combined(claim, numbers) if len(numbers) > 1 else numbers[0]
                rows.append((group, claim, figures, row, numbers))
    return rows
