"""The claims of the two works beside what the figures' runs give: prints the table of docs/reproduction.md.

    for figure in run/figures/*; do $figure; done
    .venv/bin/python benchmarks/reproduction.py [figures]

A row is the claim, its number, ours with one standard error (bootstrap over packings or seeds, or the file's own from
the autocorrelation), its size, whether it is decided, and the command. What has not been run is left out.
"""

import sys
from pathlib import Path

import numpy as np
from claims import exponents, flow, jamming, moduli, motion  # noqa: F401  they enter their claims
from claims.shared import CLAIMS, WITHIN

import jampetsc


def text(value, error):
    """A number with its error to two digits of that."""
    if error is None or not np.isfinite(error):
        return f"{value:.4g}"
    digits = max(0, 1 - int(np.floor(np.log10(error)))) if error > 0 else 3
    return f"{value:.{min(digits, 8)}f} ± {error:.{min(digits, 8)}f}"


def decided(row):
    """What the row says of itself, or else whether the two numbers are within WITHIN errors."""
    if row.decided or row.theirs is None or row.error is None:
        return row.decided
    return "yes" if abs(row.ours - row.theirs) <= WITHIN * row.error else "no"


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "figures")
    print("| claim | theirs | ours | size | decided | command | |\n|---|---|---|---|---|---|---|")
    for figure, rows in CLAIMS:
        if not (folder / f"{figure}-quick" / "table.csv").exists():
            continue
        for row in rows(jampetsc.load(folder / f"{figure}-quick")):
            said = "" if row.theirs is None else f"{row.theirs:.4g}"
            cells = [
                row.claim,
                said,
                text(row.ours, row.error),
                row.size,
                decided(row),
                f"`{figure}`",
                row.note,
            ]
            print("| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |")


if __name__ == "__main__":
    main()
