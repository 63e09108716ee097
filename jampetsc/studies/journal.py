"""What became of the tasks of a study, kept on disk task by task: a study that is killed loses no finished one.

`FOLDER/journal` has a file for each task, put there whole with a hash of its content (`io.checkpoint.keep`).
"""

from pathlib import Path
from urllib.parse import quote

from jampetsc.io.atomic import remove_abandoned
from jampetsc.io.checkpoint import keep, kept

NAME = "journal"


def keep_record(folder, record: dict) -> None:
    """Keep the record of a task; on return it survives a kill. Raises JampetscError where it cannot be written."""
    keep(Path(folder) / NAME / quote(record["task"], safe=""), record)


def records_of(folder) -> dict:
    """{task: its record} of a study."""
    places = sorted((Path(folder) / NAME).glob("[!.]*"))
    return {found[0]["task"]: found[0] for found in map(kept, places) if found is not None}


def tidy(folder) -> None:
    """Remove what killed processes have left."""
    remove_abandoned(Path(folder) / NAME)
