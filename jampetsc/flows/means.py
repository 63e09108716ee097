"""What a run says in the end: means over the steady part with errors, the energy balance, and whether to trust them."""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.averages import Average
from jampetsc.flows.record import ON_WALLS

UNBALANCED = 0.05  # of the dissipation, by which work may miss it
FEW = 20  # rows from which on the balance is looked at


@dataclass(frozen=True)
class Means:
    """Averages of the series of a record over strain > discard; stresses are sums of their parts."""

    shear_stress: Average
    pressure: Average
    coordination: Average
    largest_cluster: float  # disks in the largest cluster of those that touch
    walls: dict  # name -> Average of what is looked up on walls, where there are any
    parts: np.ndarray  # (3,) elastic, viscous and kinetic shear stress
    strain: float  # that the means are over
    spacing: float  # strain between rows
    energy_balance: float  # σγ̇V/⟨D⟩
    mismatch: float  # (work − dissipation − growth of the energy) / dissipation

    @classmethod
    def of(cls, record, discard: float, rate: float, area: float) -> "Means | None":
        """Means of a `flows.record.Record`; None where nothing is kept."""
        strain = record.series("strain")
        kept = strain > discard * (1 + 1e-12)
        if not kept.any():
            return None
        spacing = float(strain[1] - strain[0]) if len(strain) > 1 else float(strain[0])
        stress, pressure = (record.series(name)[kept] for name in ("shear_stress", "pressure"))
        energy, spent = (record.series(name)[kept] for name in ("energy", "dissipation"))
        work = rate * area * stress.sum(1)
        # Energies are means over rows too: their change is that between the middles of the first and the last.
        inner = np.ones(len(work))
        inner[[0, -1]] = 0.5
        duration = spacing / rate
        total = duration * float(np.dot(inner, spent))
        excess = duration * float(np.dot(inner, work - spent)) - float(energy[-1] - energy[0])
        return cls(
            Average.of(stress.sum(1)),
            Average.of(pressure.sum(1)),
            Average.of(record.series("coordination")[kept]),
            float(record.series("largest_cluster")[kept].mean()),
            {name: Average.of(record.series(name)[kept]) for name in ON_WALLS if name in record.columns},
            stress.mean(0),
            spacing * int(kept.sum()),
            spacing,
            float(work.sum() / spent.sum()) if spent.any() else np.nan,
            excess / total if len(work) >= FEW and total > 0 else 0.0,
        )

    @property
    def correlation_strain(self) -> float:
        """Integrated autocorrelation of the shear stress, in strain."""
        return self.shear_stress.time * self.spacing

    def warnings(self) -> list[str]:
        """What a reader of the means must know, in lines."""
        found = []
        if not self.shear_stress.enough:
            found.append(
                f"strain {self.strain:.3g} after --discard is short for a correlation strain of about "
                f"{self.correlation_strain:.2g}: the errors are rough; a longer --strain helps"
            )
        if self.shear_stress.drifts or self.pressure.drifts:
            found.append(
                "the two halves of the run differ by more than their errors: not steady yet; --discard more"
            )
        return found

    def facts(self) -> dict:
        """Attributes of the file."""
        return {
            "shear_stress_mean": self.shear_stress.mean,
            "shear_stress_error": self.shear_stress.error,
            "pressure_mean": self.pressure.mean,
            "pressure_error": self.pressure.error,
            "coordination_mean": self.coordination.mean,
            "coordination_error": self.coordination.error,
            "largest_cluster_mean": self.largest_cluster,
            **{f"{name}_mean": average.mean for name, average in self.walls.items()},
            **{f"{name}_error": average.error for name, average in self.walls.items()},
            "correlation_strain": self.correlation_strain,
            "energy_balance": self.energy_balance,
        }
