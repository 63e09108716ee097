"""Arguments of the programs that print tables of a figure or draw its pictures."""

import argparse
import csv
from pathlib import Path


def folder_and_picture(doc: str, picture: str, **sizes):
    """Arguments of a program that prints tables of what a figure has left in a folder, and draws a picture of it.

    sizes: numbers that it takes as options, with their defaults, of the same type
    """
    words = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("folder", type=Path)
    words.add_argument("--picture", type=Path, help=picture)
    for name, value in sizes.items():
        words.add_argument(f"--{name}", type=type(value), default=value)
    return words.parse_args()


def read_rows(path: Path) -> list[dict]:
    """The rows of a table that a program has written, as texts; none where there is none yet."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def write_rows(path: Path, columns, rows) -> None:
    """Write the table of these rows, {column: value}."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
