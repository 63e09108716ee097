"""The flow file: series over strain, snapshots, means with errors, and the state from which the run goes on.

A checkpoint holds the same but the means, see `storage.checkpoint`.
"""

import json
import shutil

import h5py
import numpy as np

from jampetsc.analysis.order import bond_order
from jampetsc.errors import InputError
from jampetsc.storage.atomic import follow
from jampetsc.storage.checkpoint import Checkpoint, discard, folder_of
from jampetsc.storage.hdf5 import attributes, check_format, open_file, reading, values
from jampetsc.storage.result_file import ResultWriter

FORMAT = "jampetsc-flow"
STATE = "state/"  # before the names of what a run goes on from
# name -> columns, per row; the first six are means over the strain since the row before, the others are looked up
SERIES = {
    "strain": 0, "time": 0, "shear_stress": 3, "pressure": 3, "energy": 0, "dissipation": 0,
    "coordination": 0, "clusters": 0, "largest_cluster": 0, "deepest_overlap": 0,
}  # fmt: skip
SNAPSHOTS = ("strain", "positions", "velocities", "cell")
ON_WALLS = {"wall_shear_stress": 0, "wall_pressure": 0}  # of a run between walls, looked up
LAYERS = 20  # of equal height between walls
BETWEEN_WALLS = ON_WALLS | {"velocity_profile": LAYERS}
_open = {}  # folder -> settings and checkpoint of a run of this process, which locks it


class Record:
    """Rows and snapshots of a run so far."""

    def __init__(self, columns=None):
        self.columns = columns or SERIES
        self.rows = {name: [] for name in self.columns}
        self.snapshots = {name: [] for name in SNAPSHOTS}

    def __len__(self):
        return len(next(iter(self.rows.values())))

    def add(self, **row) -> None:
        """One row: a value for every column."""
        for name, column in self.rows.items():
            column.append(row[name])

    def snapshot(self, strain, disks, velocities) -> None:
        """Keep positions, non-affine velocities and cell of this moment."""
        kept = (strain, disks.positions, velocities, disks.cell)
        for name, value in zip(SNAPSHOTS, kept, strict=True):
            self.snapshots[name].append(value)

    def series(self, name):
        """(T,) or (T, 3) array of a column."""
        columns = self.columns[name]
        return np.array(self.rows[name], float).reshape((-1, columns) if columns else -1)

    def datasets(self) -> dict:
        """Everything, as the file has it."""
        found = {name: self.series(name) for name in self.columns}
        if self.snapshots["strain"]:
            found |= {f"snapshots/{name}": np.array(kept) for name, kept in self.snapshots.items()}
        return found

    def order(self, held=0) -> dict:
        """⟨|ψ₆|⟩ and |⟨ψ₆⟩| of every snapshot, (S,) each, of all disks but the first `held` (see `analysis.order`)."""
        kept = zip(self.snapshots["positions"], self.snapshots["cell"], strict=True)
        psi = [bond_order(positions, cell)[held:] for positions, cell in kept]
        if not psi:
            return {}
        return {
            "snapshots/psi6_local": np.abs(psi).mean(1),
            "snapshots/psi6_global": np.abs(np.mean(psi, axis=1)),
        }

    @classmethod
    def of(cls, arrays, columns=None) -> "Record":
        """The record in a result, or in an open file."""
        read = values if isinstance(arrays, h5py.File) else np.asarray
        record = cls(
            columns or SERIES | {name: size for name, size in BETWEEN_WALLS.items() if name in arrays}
        )
        record.rows = {name: list(read(arrays[name])) for name in record.columns}
        if "snapshots/strain" in arrays:
            record.snapshots = {name: list(read(arrays[f"snapshots/{name}"])) for name in SNAPSHOTS}
        return record


def write_record(
    path, record: Record, state: dict, settings: dict, facts: dict, format=FORMAT, held=0
) -> None:
    """The finished file: series, snapshots, their order, state, settings and `facts`, its attributes.

    The first `held` disks are those of walls. Raises as ResultWriter.
    """
    with ResultWriter(path, format) as writer:
        for name, array in (record.datasets() | record.order(held)).items():
            writer.dataset(name, array)
        for name, value in state.items():
            writer.dataset(f"state/{name}", value)
        writer.attributes(settings=json.dumps(settings), **facts)


def write_checkpoint(out, record: Record, state: dict, settings: dict) -> None:
    """Put the run so far beside `out`, if that is not None; complete or not at all.

    From then on, until `remove_checkpoint`, no other process may.
    """
    if out is None:
        return
    known, checkpoint = _open.get(folder_of(out), (None, None))
    if known != settings:
        checkpoint = Checkpoint(out, settings)
        _open[folder_of(out)] = settings, checkpoint
    state = {f"{STATE}{name}": value for name, value in state.items()}
    checkpoint.save(0, {}, record.datasets() | state)


def check_space(out, disks: int, snapshots: int) -> None:
    """Raise InputError where the snapshots of a run, twice with the checkpoint, do not fit on the disk of `out`."""
    needed = 2 * snapshots * (disks * 4 + 5) * 8
    free = shutil.disk_usage(follow(out).parent).free
    if needed > free:
        raise InputError(
            f"--snapshots {snapshots}: of {disks} disks need {needed / 1e9:.3g} GB with the checkpoint, and "
            f"{free / 1e9:.3g} GB are free where {out} is to be: ask for fewer"
        )


def remove_checkpoint(out) -> None:
    """Delete the checkpoint of a run that is finished."""
    if out is not None:
        _open.pop(folder_of(out), None)
        discard(folder_of(out))


def read_record(path, format=FORMAT, columns=None):
    """(record, state, settings, attributes) of a flow file. Raises InputError."""
    with open_file(path) as h5, reading(path):
        attrs = attributes(h5)
        check_format(path, attrs, format)
        state = {name: values(data) for name, data in h5["state"].items()}
        return Record.of(h5, columns), state, json.loads(attrs["settings"]), attrs


def resumed(out, settings: dict, columns=None):
    """(record, state) of a checkpoint of the same job beside `out`, else None."""
    if out is None:
        return None
    checkpoint = Checkpoint(out, settings)
    _open[folder_of(out)] = settings, checkpoint
    if not checkpoint.done:
        return None
    arrays = checkpoint.fields(0)
    state = {name.removeprefix(STATE): array for name, array in arrays.items() if name.startswith(STATE)}
    return Record.of(arrays, columns), state
