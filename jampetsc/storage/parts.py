"""The part files of a joint file: one per rank, named after the run so that two runs never mix.

HDF5 reads a missing part of a virtual dataset as zeros without an error. The joint file therefore lists its
parts in the group `part_files` (names, sizes in bytes), and each part carries its `run_id` and rank.
"""

import re
from contextlib import suppress
from pathlib import Path

import h5py

from jampetsc.errors import InputError
from jampetsc.storage.hdf5 import open_file, reading

GROUP = "part_files"
_NAME = re.compile(r"[^/]+\.parts/[0-9a-f]{12}-rank-\d{4,}\.h5")


def part_name(joint, run_id: str, rank: int) -> str:
    """Path of a rank's part relative to the folder of the joint file."""
    return f"{Path(joint).stem}.parts/{run_id}-rank-{rank:04d}.h5"


class PartList:
    """The parts that belong to an open joint file; empty for a plain file."""

    def __init__(self, h5, path):
        self.path = Path(path).resolve()
        self.shown = path  # as the user wrote it, for messages
        with reading(path):
            self.run_id = h5.attrs.get("run_id", "")
            group = h5.get(GROUP)
            names = [] if group is None else [name.decode() for name in group["names"][...]]
            sizes = [] if group is None else [int(size) for size in group["sizes"][...]]
        for name in names:
            if not (_NAME.fullmatch(name) and Path(name).name.startswith(f"{self.run_id}-")):
                raise InputError(
                    f"{path}: part {name!r} cannot be a part of run {self.run_id}: damaged, make it again"
                )
        self.sizes = dict(zip(names, sizes, strict=True))

    def __bool__(self):
        return bool(self.sizes)

    def check_present(self) -> None:
        """Raise InputError if a part is missing or of another size.

        Called after reading as well: parts never come back under the same name, so what was read was theirs.
        """
        for name, size in self.sizes.items():
            try:  # in one look: the part of a replaced run may go at any moment
                found = (self.path.parent / name).stat().st_size
            except (FileNotFoundError, NotADirectoryError):
                raise InputError(
                    f"{self.shown}: part {name} is missing: keep the folder {Path(name).parent} beside "
                    "the file (`jampetsc merge` makes one file of them)"
                ) from None
            if found != size:
                raise InputError(
                    f"{self.shown}: part {name} has {found} bytes instead of {size}: "
                    "truncated or not copied completely; copy it again"
                )

    def check(self) -> None:
        """Raise InputError if a part is missing, truncated or from another run."""
        self.check_present()
        for rank, name in enumerate(self.sizes):
            with open_file(self.path.parent / name) as h5, reading(self.path.parent / name):
                found = h5.attrs.get("run_id"), h5.attrs.get("rank")
            if found != (self.run_id, rank):
                raise InputError(
                    f"{self.shown}: part {name} is rank {found[1]} of run {found[0]}, not rank {rank} of run "
                    f"{self.run_id}: put the right one back"
                )

    def remove(self) -> None:
        """Delete the parts, and their folder once it is empty."""
        for name in self.sizes:
            with suppress(OSError):  # such as a folder that is no longer writable: nothing refers to the part
                (self.path.parent / name).unlink(missing_ok=True)
        for folder in {(self.path.parent / name).parent for name in self.sizes}:
            remove_if_empty(folder)


def remove_if_empty(folder: Path) -> None:
    """Remove a folder that holds nothing."""
    with suppress(OSError):
        folder.rmdir()


def parts_of(path) -> PartList | None:
    """The parts of the result at `path`, unchecked; None if there is no readable HDF5 file."""
    try:
        with h5py.File(path, "r") as h5:
            return PartList(h5, path)
    except (OSError, InputError):
        return None
