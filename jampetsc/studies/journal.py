"""What became of the tasks of a study, kept on disk task by task: a study that is killed loses no finished one.

Every rank appends to a journal of its own, `FOLDER/journal/rank-0007`, one line per task with a checksum: a line
that a kill tore does not count.
"""

import json
import zlib
from pathlib import Path

from jampetsc.storage.atomic import append_durably, write_error

NAME = "journal"


class Journal:
    """The journal of one rank, to append to."""

    def __init__(self, folder, rank):
        self.path = Path(folder) / NAME / f"rank-{rank:04d}"
        self._end = None  # length of its sound beginning, in bytes

    def append(self, record: dict) -> None:
        """Keep a record; on return it survives a kill. Raises JampetscError where it cannot be written."""
        try:
            if self._end is None:
                self.path.parent.mkdir(exist_ok=True)
                self.path.touch()
                self._end = _sound(self.path.read_bytes())[1]
        except OSError as error:
            raise write_error(self.path, error) from None
        text = json.dumps(record).encode()
        line = b"%08x %s\n" % (zlib.crc32(text), text)
        append_durably(self.path, self._end, line)
        self._end += len(line)


def records_of(folder) -> dict:
    """{task: its last record} of all journals of a study; the last is the one with the latest `time`."""
    found = {}
    for path in sorted((Path(folder) / NAME).glob("rank-*")):
        try:
            content = path.read_bytes()
        except OSError as error:
            raise write_error(path, error) from None
        for record in _sound(content)[0]:
            name = record["task"]
            if name not in found or record["time"] >= found[name]["time"]:
                found[name] = record
    return found


def _sound(content: bytes):
    """(records, their length in bytes) of the lines up to the first that is torn."""
    records, end = [], 0
    for line in content.splitlines(keepends=True):
        checksum, _, text = line.rstrip(b"\n").partition(b" ")
        if not line.endswith(b"\n") or checksum != b"%08x" % zlib.crc32(text):
            break
        records.append(json.loads(text))
        end += len(line)
    return records, end
