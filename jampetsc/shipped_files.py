"""Files that come with the package, `shipped/`: options files of PETSc, example programs and scripts for Slurm.

In the tree these are links to the folders `options/`, `examples/` and `run/slurm/`; a wheel holds the files themselves.
"""

from pathlib import Path

from jampetsc.errors import InputError

FOLDER = Path(__file__).parent / "shipped"
PREFIX = "jampetsc:"


def located(word: str) -> str:
    """The path of an options file for `jampetsc:NAME`; any other word is returned unchanged.

    Raises InputError for an unknown NAME.
    """
    if not word.startswith(PREFIX):
        return word
    paths = {path.stem: str(path) for path in sorted((FOLDER / "options").glob("*.opts"))}
    name = word.removeprefix(PREFIX)
    if name not in paths:
        raise InputError(
            f"{word}: no such options file. Choose one of {', '.join(map(PREFIX.__add__, paths))}."
        )
    return paths[name]
