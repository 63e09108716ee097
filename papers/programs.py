"""Arguments of the programs that print tables of a figure or draw its pictures."""

import argparse
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
