"""The claims of the two works beside our results: prints the tables of docs/reproduction.md and writes claims.csv.

    .venv/bin/python benchmarks/reproduction.py                   # from docs/kept; the csv goes to docs/kept/claims.csv
    .venv/bin/python benchmarks/reproduction.py figures quick     # from what run/figures/NAME left, or paper

Each claim has one estimator and a verdict by the rule of claims/verdicts.py. What has not been run
is left out. claims.csv has all numbers, also those of other estimators, which get no verdict.
"""

import csv
import math
import sys
import tarfile
import tempfile
from pathlib import Path

from claims import checks, exponents, flow, jamming, moduli, motion, power_law  # noqa: F401  they enter their claims
from claims.shared import CLAIMS, GROUPS, THEORY
from claims.verdicts import verdict
from keep import KEPT

import jampetsc

COLUMNS = "group,claim,theirs,ours,statistical,systematic,chi2,dof,verdict,reason,size,figure".split(",")


def with_errors(ours) -> str:
    """value(statistical)(systematic), errors in units of the last digit: two digits of the larger one."""
    errors = [ours.inflated, ours.systematic]
    largest = max((error for error in errors if math.isfinite(error)), default=0.0)
    if not largest > 0.0:
        return f"{ours.value:.4g}"
    digits = min(max(0, 1 - math.floor(math.log10(largest))), 8)
    shown = [error for error, needed in zip(errors, (True, ours.systematic > 0), strict=True) if needed]
    if digits == 0:
        return f"{ours.value:.0f}" + "".join(f"({error:.0f})" for error in shown)
    return f"{ours.value:.{digits}f}" + "".join(f"({error * 10**digits:.0f})" for error in shown)


def judged(row) -> tuple[str, str]:
    """(verdict, reason) of a row; no verdict for a number beside the claims."""
    if row.target is None:
        return "", row.reason
    said, why = verdict(row.ours, row.target)
    return said, "; ".join(filter(None, (why, row.reason)))


def rows_of(folder, mode):
    """[(figures, row)] of the figures whose studies lie in folder/NAME-mode."""
    found = []
    for figures, rows in sorted(CLAIMS, key=lambda entry: entry[0]):
        studies = [folder / f"{figure}-{mode}" for figure in figures]
        if all((study / "table.csv").exists() for study in studies):
            found += [(figures, row) for row in rows(*map(jampetsc.load, studies))]
    return found


def print_tables(found):
    """Print the claims of each group; last the predictions that docs/theory/linear_response.md lists."""
    for group in (*GROUPS, THEORY):
        rows = [(figures, row) for figures, row in found if row.group == group]
        if not rows:
            continue
        head = "| claim | theirs | ours | | figure | reason |\n|---|---|---|---|---|---|"
        print(f"\n### {group}\n\n{head}")
        for figures, row in rows:
            cells = (
                row.claim,
                row.theirs,
                with_errors(row.ours),
                *judged(row)[:1],
                ", ".join(f"`{figure}`" for figure in figures),
                judged(row)[1],
            )
            print("| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |")


def write_csv(found, path):
    """Write all rows, those with a verdict first in each figure."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for figures, row in sorted(found, key=lambda entry: (entry[0], entry[1].target is None)):
            ours = row.ours
            numbers = [f"{x:.6g}" for x in (ours.value, ours.statistical, ours.systematic, ours.chi2)]
            said, reason = judged(row)
            writer.writerow(
                [
                    row.group,
                    row.claim,
                    row.theirs,
                    *numbers,
                    ours.dof,
                    said,
                    reason,
                    row.size,
                    " ".join(figures),
                ]
            )


def main():
    if len(sys.argv) > 1:
        folder = Path(sys.argv[1])
        found = rows_of(folder, sys.argv[2] if len(sys.argv) > 2 else "quick")
        write_csv(found, folder / "claims.csv")
    else:
        with tempfile.TemporaryDirectory() as scratch:
            for archive in KEPT.glob("*.tar.xz"):
                with tarfile.open(archive) as kept:
                    kept.extractall(Path(scratch) / archive.name.replace(".tar.xz", "-kept"))
            found = rows_of(Path(scratch), "kept")
        write_csv(found, KEPT / "claims.csv")
    print_tables(found)


if __name__ == "__main__":
    main()
