"""The claims of the two works beside our results: prints the tables of docs/papers/claims.md and writes claims.csv.

    .venv/bin/python -m papers.reproduction                   # from papers/kept; the csv goes to papers/kept/claims.csv
    .venv/bin/python -m papers.reproduction figures quick     # from what run/figure NAME left, or paper

Each claim has one row by the rule of claims/page.py, and a verdict by that of claims/verdicts.py. What has not been run
is left out. claims.csv has all numbers, with the row of the page on which each bears.
"""

import csv
import sys
import tarfile
import tempfile
from pathlib import Path

import jampetsc
from papers.claims import (  # noqa: F401  they enter their claims
    above,
    beta,
    checks,
    correlations,
    crystals,
    drag,
    exponents,
    finite_cells,
    finite_size,
    flow,
    jamming,
    low_modes,
    moduli,
    motion,
    power_law,
    sizes,
    spheres,
    transition,
)
from papers.claims.page import PAGE, TEXTS
from papers.claims.selection import page_rows
from papers.claims.shared import CLAIMS
from papers.claims.verdicts import AGREES, IDENTITY, verdict
from papers.keep import KEPT

COLUMNS = "row,on_page,claim,theirs,ours,statistical,systematic,chi2,dof,verdict,reason,size,figure".split(
    ","
)
PREDICTIONS = "Predictions"  # title of the table of docs/theory/linear_response.md


def judged(row) -> tuple[str, str]:
    """(verdict, reason) of a row; no verdict for a number beside the claims."""
    if row.target is None:
        return "", row.reason
    said, why = verdict(row.ours, row.target)
    said = IDENTITY if row.identity and said == AGREES else said
    return said, "; ".join(filter(None, (why, row.identity, row.reason)))


def rows_of(folder, mode):
    """[(figures, row)] of the figures whose studies lie in folder/NAME-mode."""
    found = []
    for figures, rows in sorted(CLAIMS, key=lambda entry: entry[0]):
        studies = [folder / f"{figure}-{mode}" for figure in figures]
        if all((study / "table.csv").exists() for study in studies):
            found += [(figures, row) for row in rows(*map(jampetsc.load, studies))]
    return found


def print_table(title, head, rows):
    """A table in Markdown."""
    print(f"\n### {title}\n\n{head}\n|{'---|' * (head.count('|') - 1)}")
    for cells in rows:
        print("| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |")


def print_tables(found):
    """Print the claims of each group, and last the predictions that docs/theory/linear_response.md lists."""
    page = page_rows(found)
    for group in PAGE:
        rows = [
            (TEXTS[key], row.theirs.rpartition(": ")[2], str(row.ours), *judged(row))
            for where, key, _, row, _ in page
            if where == group
        ]
        if rows:
            print_table(group, "| claim | theirs | ours | | reason |", rows)
    rows = [
        (row.claim, row.theirs, str(row.ours), ", ".join(f"`{figure}`" for figure in figures), row.reason)
        for figures, row in found
        if row.predicted
    ]
    if rows:
        print_table(PREDICTIONS, "| prediction | predicted | measured | figure | |", rows)


def write_csv(found, path):
    """Write all numbers in the order of figures, those with a verdict first, and the rows that combine several.

    row         the claim of the page that a number decides, or on which it bears; or PREDICTIONS
    on_page     yes: the page shows this number; part: the page's row combines it with others
    """
    page = page_rows(found)
    shown = {id(row): "yes" if len(numbers) == 1 else "part" for *_, numbers in page for row in numbers}
    entries = [
        (figures, row, TEXTS[key], "yes") for _, key, figures, row, numbers in page if len(numbers) > 1
    ]
    for figures, row in found:
        text = PREDICTIONS if row.predicted else TEXTS[row.bears]
        entries.append((figures, row, text, shown.get(id(row), "")))
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for figures, row, text, on_page in sorted(
            entries, key=lambda entry: (entry[0], entry[1].target is None)
        ):
            ours = row.ours
            numbers = [f"{x:.6g}" for x in (ours.value, ours.statistical, ours.systematic, ours.chi2)]
            said, reason = judged(row)
            names = " ".join(figures)
            writer.writerow(
                [text, on_page, row.claim, row.theirs, *numbers, ours.dof, said, reason, row.size, names]
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
