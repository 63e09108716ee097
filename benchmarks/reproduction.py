"""The claims of the two works beside what the figures' runs give: prints the table of docs/reproduction.md.

    .venv/bin/python benchmarks/reproduction.py                   # from docs/kept, what was found at the papers' sizes
    .venv/bin/python benchmarks/reproduction.py figures quick     # from what run/figures/NAME left, or paper

A row is the claim, its number, ours with one standard error (bootstrap over packings or seeds, or the file's own from
the autocorrelation), its size, whether it is decided, and the command. What has not been run is left out.
"""

import sys
import tarfile
import tempfile
from pathlib import Path

import numpy as np
from claims import exponents, flow, jamming, moduli, motion  # noqa: F401  they enter their claims
from claims.shared import CLAIMS, WITHIN
from keep import KEPT

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


def print_table(folder, mode):
    """Print the rows of the figures whose studies lie in folder/NAME-mode."""
    print("| claim | theirs | ours | size | decided | command | |\n|---|---|---|---|---|---|---|")
    for figure, rows in sorted(CLAIMS, key=lambda entry: entry[0]):
        if not (folder / f"{figure}-{mode}" / "table.csv").exists():
            continue
        for row in rows(jampetsc.load(folder / f"{figure}-{mode}")):
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


def main():
    if len(sys.argv) > 1:
        print_table(Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "quick")
        return
    with tempfile.TemporaryDirectory() as folder:
        for archive in KEPT.glob("*.tar.xz"):
            with tarfile.open(archive) as kept:
                kept.extractall(Path(folder) / archive.name.replace(".tar.xz", "-kept"))
        print_table(Path(folder), "kept")


if __name__ == "__main__":
    main()
