"""What the files given to `jampetsc plot` hold."""

from jampetsc.contacts.disks import Disks
from jampetsc.errors import InputError
from jampetsc.storage.reader import load


def open_files(paths):
    """What the files hold: ("packing", [Disks]), ("sweep", [SweepResult, …]), ("spectrum", [Result, …]), ….

    Raises InputError for a mixture, and for several packings.
    """
    found = [load(path) for path in paths]
    held = ["packing" if isinstance(item, Disks) else item.format.removeprefix("jampetsc-") for item in found]
    other = next((n for n, kind in enumerate(held) if kind != held[0]), None)
    if other is not None:
        hint = "; the packing of a sweep goes with --packing" if "packing" in held else ""
        raise InputError(
            f"{paths[0]} is a {held[0]}, {paths[other]} a {held[other]}: "
            f"one picture shows one or the other{hint}"
        )
    if held[0] == "packing" and len(paths) > 1:
        raise InputError(f"{len(paths)} packings: one picture shows one packing; plot them one by one")
    return held[0], found
