"""What a flow leaves in memory: series over strain and snapshots."""

from copy import copy

import numpy as np

from jampetsc.flows.walls import LAYERS

# name -> columns: strain and time at the end of a row, four means over the row, the others at its end again
FLOW_COLUMNS = {
    "strain": 0, "time": 0, "shear_stress": 3, "pressure": 3, "energy": 0, "dissipation": 0,
    "coordination": 0, "clusters": 0, "largest_cluster": 0, "deepest_overlap": 0,
}  # fmt: skip
WALL_AVERAGES = {"wall_shear_stress": 0, "wall_pressure": 0}  # of a run between walls, at the end of a row
WALL_COLUMNS = WALL_AVERAGES | {"velocity_profile": LAYERS}
SNAPSHOT_ARRAYS = ("strain", "positions", "velocities", "cell", "images", "spins")  # spins where disks roll


class StrainSeries:
    """Numbers of a run over strain, a row at a time.

    columns: {name: number of parts of a value, 0 for a scalar}, the strain among them
    """

    def __init__(self, columns: dict):
        self.columns = columns
        self.rows = {name: [] for name in columns}

    def __len__(self):
        return len(self.rows["strain"])

    @property
    def strain(self) -> float:
        """Strain at the end of the last row; 0 before the first one."""
        return float(self.rows["strain"][-1]) if len(self) else 0.0

    def add(self, **row) -> None:
        """One row: a value for every column."""
        for name, column in self.rows.items():
            column.append(row[name])

    def column(self, name) -> np.ndarray:
        """(T,) array of a column, or (T, C) of one whose values have C parts."""
        parts = self.columns[name]
        return np.array(self.rows[name], float).reshape((-1, parts) if parts else -1)

    def arrays(self) -> dict:
        """All columns by name, for `restore`."""
        return {name: self.column(name) for name in self.columns}

    def restore(self, arrays) -> None:
        """Take the rows that `arrays` gave, a mapping of names to arrays."""
        self.rows = {name: list(np.asarray(arrays[name])) for name in self.columns}


class Trajectory(StrainSeries):
    """Rows and snapshots of a flow; with_walls: whether rows have stress, pressure and velocity profile of walls."""

    def __init__(self, with_walls: bool = False):
        super().__init__(FLOW_COLUMNS | (WALL_COLUMNS if with_walls else {}))
        self.snapshots = {name: [] for name in SNAPSHOT_ARRAYS}
        self.radii = None  # (N,) of the disks in the snapshots

    def add_snapshot(self, strain, disks, velocities, spins=None) -> None:
        """Keep positions, images, non-affine velocities, angular ones where disks roll, and cell of this moment."""
        values = (strain, disks.positions, velocities, disks.cell, disks.images, spins)
        for name, value in zip(SNAPSHOT_ARRAYS, values, strict=True):
            if value is not None:
                self.snapshots[name].append(value)
        self.radii = disks.radii

    def arrays(self) -> dict:
        """All columns, and arrays of the snapshots as `snapshots/NAME`, for `restore`."""
        arrays = super().arrays()
        if self.snapshots["strain"]:
            arrays |= {
                f"snapshots/{name}": np.array(values) for name, values in self.snapshots.items() if values
            }
            arrays["snapshots/radii"] = self.radii
        return arrays

    def restore(self, arrays) -> None:
        """See `StrainSeries`."""
        super().restore(arrays)
        if "snapshots/strain" in arrays:
            stored = {name: arrays.get(f"snapshots/{name}", ()) for name in SNAPSHOT_ARRAYS}
            self.snapshots = {name: list(np.asarray(values)) for name, values in stored.items()}
            self.radii = np.asarray(arrays["snapshots/radii"])

    def copy(self) -> "Trajectory":
        """The same rows and snapshots, to which others can be added."""
        twin = copy(self)
        twin.rows = {name: list(values) for name, values in self.rows.items()}
        twin.snapshots = {name: list(values) for name, values in self.snapshots.items()}
        return twin

    @classmethod
    def of(cls, arrays) -> "Trajectory":
        """The trajectory whose `arrays` these are."""
        trajectory = cls(with_walls="wall_pressure" in arrays)
        trajectory.restore(arrays)
        return trajectory
