"""Files named on the command line: several that are one and the same count once; the folder of a study is many."""

import os
from pathlib import Path

from jampetsc.errors import InputError


def refuse_repeated(paths) -> None:
    """Raise InputError where two of the paths are one file, also through links: it would count twice."""
    seen = {}
    for path in paths:
        file = os.path.realpath(path)
        if file in seen:
            again = f"is {seen[file]}, which" if str(path) != str(seen[file]) else "this file"
            raise InputError(f"{path}: {again} is given already: name each file once")
        seen[file] = path


def refuse_one_packing(results) -> None:
    """Raise InputError where two results come from one packing, by its sha256: it would count twice.

    results: `storage.reader.Result`, each with `path` and `attributes`.
    """
    seen = {}
    for result in results:
        sha256 = result.attributes.get("packing_sha256")
        if sha256 in seen:
            raise InputError(
                f"{result.path}: comes from the same packing as {seen[sha256].path.name} "
                f"(sha256 {sha256[:12]}…): an average takes each packing once"
            )
        if sha256 is not None:
            seen[sha256] = result


def files_named(paths, where, chosen) -> tuple[list[str], bool]:
    """(files, whether some come from a study): in the place of the folder of a study the files of some of its rows.

    where    column=value,… : of its rows those that have these values
    chosen   (path, rows that are done, " where …" or nothing for messages) → the rows whose files are meant

    Raises InputError for `where` that is not so written, or without a study, and what `chosen` raises.
    """
    from jampetsc.storage.ensemble import TABLE
    from jampetsc.storage.reader import load

    files, study, wanted = [], False, wanted_of(where)
    for path in paths:
        if not (Path(path) / TABLE).exists():
            files.append(path)
            continue
        study = True
        rows = chosen(
            path, load(path).where(**wanted).where(state="done"), f" where {where}" if where else ""
        )
        files += [str(Path(path) / name) for name in rows["file"].tolist()]
    if where and not study:
        raise InputError(f"--where {where}: chooses rows of a study, but {paths[0]} is none: leave it out")
    return files, study


def wanted_of(where) -> dict:
    """{column: value} of column=value,…, nothing of None. Raises InputError."""
    pairs = [word.partition("=") for word in where.split(",")] if where else []
    if not all(name and equals and value for name, equals, value in pairs):
        raise InputError(
            f"--where {where}: write column=value, several with commas, such as law=stokes,beta=1"
        )
    return {name.strip().replace("-", "_"): value.strip() for name, _, value in pairs}
