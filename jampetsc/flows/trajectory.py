"""The trajectory of a flow: series over strain, snapshots, and means over the steady part with their errors."""

from copy import copy
from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.correlated_series import Average
from jampetsc.analysis.strain_series import StrainSeries, average_facts, short_run_warnings
from jampetsc.flows.walls import LAYERS

# name -> columns: strain and time at the end of a row, four means over the row, the others at its end again
FLOW_COLUMNS = {
    "strain": 0, "time": 0, "shear_stress": 3, "pressure": 3, "energy": 0, "dissipation": 0,
    "contact_number": 0, "clusters": 0, "largest_cluster": 0, "deepest_overlap": 0,
}  # fmt: skip
START_COLUMNS = tuple(
    name for name in FLOW_COLUMNS if name not in ("strain", "time")
)  # of the state at γ = 0
WALL_AVERAGES = {"wall_shear_stress": 0, "wall_pressure": 0}  # of a run between walls, at the end of a row
WALL_COLUMNS = WALL_AVERAGES | {"velocity_profile": LAYERS}
SNAPSHOT_ARRAYS = ("strain", "positions", "velocities", "cell", "images", "spins")  # spins where disks roll
MAX_MISMATCH = 0.05  # largest |mismatch| of the energy balance
MIN_CHECKED_ROWS = 20  # for which the balance is checked
# dissipation over Σ|work| below which disks follow the affine flow but for rounding, which may grow
MAX_REVERSIBLE_RATIO = 1e-6


class Trajectory(StrainSeries):
    """Rows and snapshots of a flow; with_walls: whether rows have stress, pressure and velocity profile of walls."""

    def __init__(self, with_walls: bool = False):
        super().__init__(FLOW_COLUMNS | (WALL_COLUMNS if with_walls else {}))
        self.snapshots = {name: [] for name in SNAPSHOT_ARRAYS}
        self.radii = None  # (N,) of the disks in the snapshots
        self.start = {}  # {column: value} of the state at γ = 0; empty where it is not kept

    def add_snapshot(self, strain, disks, velocities, spins=None) -> None:
        """Keep positions, images, non-affine velocities, angular ones where disks roll, and cell of this moment."""
        values = (strain, disks.positions, velocities, disks.cell, disks.images, spins)
        for name, value in zip(SNAPSHOT_ARRAYS, values, strict=True):
            if value is not None:
                self.snapshots[name].append(value)
        self.radii = disks.radii

    def arrays(self) -> dict:
        """All columns, `start/NAME` of the state at γ = 0 and `snapshots/NAME`, for `restore`."""
        arrays = super().arrays() | {f"start/{name}": np.array(v, float) for name, v in self.start.items()}
        if self.snapshots["strain"]:
            arrays |= {
                f"snapshots/{name}": np.array(values) for name, values in self.snapshots.items() if values
            }
            arrays["snapshots/radii"] = self.radii
        return arrays

    def restore(self, arrays) -> None:
        """See `StrainSeries`."""
        super().restore(arrays)
        self.start = {name: arrays[f"start/{name}"] for name in START_COLUMNS if f"start/{name}" in arrays}
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


@dataclass(frozen=True)
class Means:
    """Averages of the series of a trajectory over strain > discard; stress and pressure are sums of their parts."""

    shear_stress: Average
    pressure: Average
    contact_number: Average  # 2N_c/N of all disks
    largest_cluster: float  # mean number of disks in the largest cluster of touching disks
    walls: dict  # name -> Average of stress and pressure on walls; empty without walls
    parts: np.ndarray  # (3,) elastic, viscous and kinetic shear stress
    strain: float  # over which the means are taken
    spacing: float  # strain between rows
    energy_balance: float  # σγ̇V/⟨D⟩; nan where motion is reversible
    mismatch: float  # (work − dissipation − growth of the energy) / dissipation; nan if there are too few rows to tell
    # part of the mismatch that rows leave open: second difference of the energy / dissipation
    unresolved: float

    @classmethod
    def of(cls, trajectory: Trajectory, discard: float, rate: float, area: float) -> "Means | None":
        """Means of the rows after discard; None if there are none."""
        strain = trajectory.column("strain")
        kept = strain > discard * (1 + 1e-12)
        if not kept.any():
            return None
        spacing = float(strain[1] - strain[0]) if len(strain) > 1 else float(strain[0])
        stress, pressure = (trajectory.column(name)[kept] for name in ("shear_stress", "pressure"))
        energy, spent = (trajectory.column(name)[kept] for name in ("energy", "dissipation"))
        work = rate * area * stress.sum(1)
        # An energy is the mean over a row: their change is that from the middle of the first row to that of the last.
        inner = np.ones(len(work))
        inner[[0, -1]] = 0.5
        duration = spacing / rate
        total = duration * float(np.sum(inner * spent))
        excess = duration * float(np.sum(inner * (work - spent))) - float(energy[-1] - energy[0])
        checked = len(work) >= MIN_CHECKED_ROWS and total > 0
        return cls(
            shear_stress=Average.of(stress.sum(1)),
            pressure=Average.of(pressure.sum(1)),
            contact_number=Average.of(trajectory.column("contact_number")[kept]),
            largest_cluster=float(trajectory.column("largest_cluster")[kept].mean()),
            walls={
                name: Average.of(trajectory.column(name)[kept])
                for name in WALL_AVERAGES
                if name in trajectory.columns
            },
            parts=stress.mean(0),
            strain=spacing * int(kept.sum()),
            spacing=spacing,
            energy_balance=float(work.sum() / spent.sum())
            if spent.sum() > MAX_REVERSIBLE_RATIO * np.abs(work).sum()
            else np.nan,
            mismatch=excess / total if checked else np.nan,
            unresolved=float(np.abs(np.diff(energy, 2)).max()) / total if checked else np.nan,
        )

    @property
    def is_balanced(self) -> bool:
        """Whether work and dissipation balance, as far as the rows tell."""
        return not abs(self.mismatch) > MAX_MISMATCH + self.unresolved

    @property
    def correlation_strain(self) -> float:
        """Integrated autocorrelation of the shear stress, in strain."""
        return self.shear_stress.time * self.spacing

    def warnings(self) -> list[str]:
        """Warnings about the means, see `io.results`."""
        warnings = short_run_warnings(self.strain, self.spacing, self.shear_stress, self.pressure)
        if self.shear_stress.drifts or self.pressure.drifts:
            warnings.append(
                "slow changes, or not steady yet: the tenths of the run differ by more than its fluctuations explain. "
                "Discard more"
            )
        if np.isnan(self.energy_balance):
            warnings.append(
                "no energy is dissipated: every particle follows the affine flow, as in a perfect crystal"
            )
        elif np.isnan(self.mismatch):
            warnings.append(
                f"energy balance not checked: fewer than {MIN_CHECKED_ROWS} rows after discard. Give a smaller step or "
                "a longer strain"
            )
        return warnings

    def facts(self) -> dict:
        """The numbers by name."""
        return {
            **average_facts(
                shear_stress=self.shear_stress,
                pressure=self.pressure,
                contact_number=self.contact_number,
                **self.walls,
            ),
            "largest_cluster_mean": self.largest_cluster,
            "correlation_strain": self.correlation_strain,
            "energy_balance": self.energy_balance,
        }
