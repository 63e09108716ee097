"""Files that are named: the folder of a study is many."""

from pathlib import Path

from jampetsc.asking.kinds import input_told
from jampetsc.errors import InputError, named


def rows_named(sources, where) -> list:
    """The sources, in the place of the folder of a study its table, an `Ensemble`, of the rows that have these values.

    where    column=value,…, or None

    Raises InputError for `where` that is not so written, or without a study.
    """
    from jampetsc.io.ensemble import TABLE
    from jampetsc.io.reader import load

    wanted = _wanted(where)
    studies = [isinstance(one, str) and (Path(one) / TABLE).exists() for one in sources]
    if wanted and not any(studies):
        raise InputError(
            f"{named('where')} {where}: chooses rows of a study, but {input_told(sources[0])} is none: leave it out"
        )
    return [load(one).where(**wanted) if study else one for one, study in zip(sources, studies, strict=True)]


def _wanted(where) -> dict:
    """{column: value} of column=value,…, nothing of None. Raises InputError."""
    pairs = [word.partition("=") for word in where.split(",")] if where else []
    if not all(name and equals and value for name, equals, value in pairs):
        raise InputError(
            f"{named('where')} {where}: write column=value, several with commas, such as law=stokes,beta=1"
        )
    return {name.strip().replace("-", "_"): value.strip() for name, _, value in pairs}
