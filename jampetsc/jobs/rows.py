"""Files that are named: the folder of a study is many."""

from pathlib import Path

from jampetsc.errors import InputError, named


def files_named(paths, where, chosen) -> tuple[list[str], bool]:
    """(files, whether some come from a study): in the place of the folder of a study the files of some of its rows.

    where    column=value,… : of its rows those that have these values
    chosen   (path, rows that are done, " where …" or nothing for messages) → the rows whose files are meant

    Raises InputError for `where` that is not so written, or without a study, and what `chosen` raises.
    """
    from jampetsc.io.ensemble import TABLE
    from jampetsc.io.reader import load

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
        raise InputError(
            f"{named('where')} {where}: chooses rows of a study, but {paths[0]} is none: leave it out"
        )
    return files, study


def wanted_of(where) -> dict:
    """{column: value} of column=value,…, nothing of None. Raises InputError."""
    pairs = [word.partition("=") for word in where.split(",")] if where else []
    if not all(name and equals and value for name, equals, value in pairs):
        raise InputError(
            f"{named('where')} {where}: write column=value, several with commas, such as law=stokes,beta=1"
        )
    return {name.strip().replace("-", "_"): value.strip() for name, _, value in pairs}
