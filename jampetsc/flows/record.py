"""Files of flows: series over strain, snapshots, attributes, and the state from which a run is continued.

A checkpoint holds the same but the means, see `io.checkpoint`.
"""

import json
import shutil

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.io.atomic import follow
from jampetsc.io.checkpoint import Checkpoint
from jampetsc.io.hdf5 import reading
from jampetsc.io.provenance import provenance
from jampetsc.io.result_formats import FLOW
from jampetsc.petsc import session

FORMAT = "jampetsc-flow"
STATE = "state/"  # prefix of the arrays from which a run is continued
# name -> columns: strain and time at the end of a row, four means over the row, the others at its end again
SERIES = {
    "strain": 0, "time": 0, "shear_stress": 3, "pressure": 3, "energy": 0, "dissipation": 0,
    "coordination": 0, "clusters": 0, "largest_cluster": 0, "deepest_overlap": 0,
}  # fmt: skip
SNAPSHOTS = ("strain", "positions", "velocities", "cell", "images", "spins")  # spins where disks roll
ON_WALLS = {"wall_shear_stress": 0, "wall_pressure": 0}  # of a run between walls, at the end of a row
WIDEST_SKIN = 10.0  # of a state that is read, in units of the largest diameter
LAYERS = 20  # of equal height between walls
BETWEEN_WALLS = ON_WALLS | {"velocity_profile": LAYERS}


class Record:
    """Rows and snapshots of a run so far."""

    def __init__(self, columns=None):
        self.columns = columns or SERIES
        self.rows = {name: [] for name in self.columns}
        self.snapshots = {name: [] for name in SNAPSHOTS}
        self.radii = None  # (N,) of the disks in the snapshots

    def __len__(self):
        return len(next(iter(self.rows.values())))

    def add(self, **row) -> None:
        """One row: a value for every column."""
        for name, column in self.rows.items():
            column.append(row[name])

    def snapshot(self, strain, disks, velocities, spins=None) -> None:
        """Keep positions, images, non-affine velocities, angular ones where disks roll, and cell of this moment."""
        kept = (strain, disks.positions, velocities, disks.cell, disks.images, spins)
        for name, value in zip(SNAPSHOTS, kept, strict=True):
            if name in self.snapshots and value is not None:
                self.snapshots[name].append(value)
        self.radii = disks.radii

    def series(self, name):
        """(T,) array of a column, or (T, C) of one that has C parts."""
        columns = self.columns[name]
        return np.array(self.rows[name], float).reshape((-1, columns) if columns else -1)

    def datasets(self) -> dict:
        """All arrays of the file but the state."""
        found = {name: self.series(name) for name in self.columns}
        if self.snapshots["strain"]:
            found |= {f"snapshots/{name}": np.array(kept) for name, kept in self.snapshots.items() if kept}
            found["snapshots/radii"] = self.radii
        return found

    @classmethod
    def of(cls, arrays, columns=None) -> "Record":
        """The record in a result or a checkpoint, a mapping of names to arrays."""
        record = cls(
            columns or SERIES | {name: size for name, size in BETWEEN_WALLS.items() if name in arrays}
        )
        record.rows = {name: list(np.asarray(arrays[name])) for name in record.columns}
        if "snapshots/strain" in arrays:  # older files have no images here, and radii only in the state
            found = {name: arrays.get(f"snapshots/{name}") for name in SNAPSHOTS}
            record.snapshots = {name: list(np.asarray(one)) for name, one in found.items() if one is not None}
            has_radii = "snapshots/radii" in arrays
            record.radii = np.asarray(arrays["snapshots/radii" if has_radii else f"{STATE}radii"])
        return record


def run_provenance(seconds: float, running=None, ranks: int = 1, law=None) -> dict:
    """Attributes of how a run was made; running: the session whose solvers it used, None if it used none."""
    return provenance(
        versions=session.versions(),
        scalar_type=running and running.scalar_type,
        petsc_options=running and running.options_told(),
        ranks=ranks,
        packing=(None, None),
        law=law or {},
        wall_seconds=seconds,
    )


def facts_of_disks(disks) -> dict:
    """Attributes of the potential of the disks."""
    potential = disks.potential
    return {"potential": potential.kind, "stiffness": potential.stiffness, "k": float(potential.k)}


def write_record(writer, record: Record, state: dict, settings: dict, facts: dict) -> None:
    """Write the finished result: series, snapshots, state, settings, and the attributes `facts`.

    Collective if the writer is. Raises the errors of ResultWriter.
    """
    with writer:
        for name, array in record.datasets().items():
            writer.dataset(name, array)
        for name, value in state.items():
            writer.dataset(f"state/{name}", value)
        writer.attributes(settings=json.dumps(settings), **facts)


def write_checkpoint(checkpoint: Checkpoint, record: Record, state: dict) -> None:
    """Put the run so far on disk, complete or not at all; nothing where the checkpoint is in memory."""
    if checkpoint.journal is not None:
        state = {f"{STATE}{name}": value for name, value in state.items()}
        checkpoint.save(0, {}, record.datasets() | state)


def check_space(to, disks: int, snapshots: int) -> None:
    """Raise InputError where the snapshots of a run do not fit on the disk where `to`, an Outlet, puts them."""
    for out in {to.path, to.kept} - {None}:
        needed = 2 * snapshots * (disks * 7 + 5) * 8  # twice with the checkpoint
        free = shutil.disk_usage(follow(out).parent).free
        if needed > free:
            raise InputError(
                f"{named('snapshots')} {snapshots}: of {disks} disks need {needed / 1e9:.3g} GB with the checkpoint, "
                f"and {free / 1e9:.3g} GB are free where {out} is to be: ask for fewer"
            )


def record_of(result):
    """(record, state, settings, attributes) of a flow, an `io.results.Result`. Raises InputError."""
    attrs = result.attributes
    for name, row in FLOW.datasets.rows.items():
        if name.startswith(STATE) and name not in result and not row.optional:
            raise InputError(f"{result.path}: dataset {name}: missing. Make the file again.")
    with reading(result.path):
        state = {name.removeprefix(STATE): result[name] for name in result if name.startswith(STATE)}
        for name, array in state.items():
            if not _is_sound(name, array, 2.0 * float(state["radii"].max())):
                raise InputError(
                    f"{result.path}: dataset {STATE}{name}: not the state of a flow. Make the file again."
                )
        return Record.of(result), state, json.loads(attrs["settings"]), attrs


def _is_sound(name, array, diameter) -> bool:
    """Whether an array of a state can be what a run has written; diameter: that of the largest disk."""
    if name == "order":  # loops over disks use it without a look
        return np.array_equal(np.sort(array), np.arange(len(array)))
    if name == "skin":
        return bool(0.0 < array <= WIDEST_SKIN * diameter)
    if np.ndim(array) == 0:
        return bool(array >= 0) or name == "sorted_at"
    return bool(np.isfinite(array).all())


def resumed(checkpoint: Checkpoint, columns=None):
    """(record, state) of the run that a checkpoint holds, None if it is empty."""
    if not checkpoint.done:
        return None
    arrays = checkpoint.fields(0)
    if not (columns or {}).keys() <= arrays.keys():
        return None  # of an older version, which had fewer columns
    state = {name.removeprefix(STATE): array for name, array in arrays.items() if name.startswith(STATE)}
    return Record.of(arrays, columns), state
