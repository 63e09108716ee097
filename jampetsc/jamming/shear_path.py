"""A path of minima along quasistatic shear, in memory: its rows, averages and the packing at its end."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.correlated_series import Average
from jampetsc.flows.flow_run import SAVE_INTERVAL
from jampetsc.flows.trajectory import StrainSeries
from jampetsc.jamming.quasistatic_shear import QuasistaticShear
from jampetsc.minimise.descent import Effort
from jampetsc.packing.packing import Packing
from jampetsc.packing.threads import Team

# of a step: strain, then the fields of `quasistatic_shear.MinimumState` and `StrainStep`
PATH_COLUMNS = {
    "strain": 0, "energy": 0, "shear_stress": 0, "pressure": 0, "jammed": 0, "coordination": 0, "nonaffine": 0,
    "dissipated": 0, "plastic": 0, "proved": 0, "evaluations": 0,
}  # fmt: skip
AVERAGED = ("shear_stress", "pressure", "energy", "coordination", "jammed", "plastic", "dissipated")


@dataclass(frozen=True, eq=False)
class ShearPath:
    """Result of quasistatic shear."""

    disks: Packing  # the last minimum
    series: StrainSeries  # PATH_COLUMNS, a row for each step
    discard: float  # strain before the averages
    averages: dict  # {name of AVERAGED: Average} over strain > discard, over all states, jammed or not
    effort: Effort  # cost of all steps

    @property
    def averaged_rows(self) -> np.ndarray:
        """(T,) whether a row is averaged."""
        return _is_averaged(self.series, self.discard)


def shear_quasistatically(
    disks: Packing,
    step: float,
    steps: int,
    solver,
    tolerance: float,
    *,
    discard: float = 0.0,
    team: Team | None = None,
    resume: tuple[StrainSeries, dict] | None = None,
    save: Callable[[StrainSeries, dict], None] | None = None,
    report: Callable[[StrainSeries], None] | None = None,
) -> ShearPath:
    """Shear disks in `steps` strain steps of size `step`, each followed to the minimum of the energy.

    solver      `petsc.hessian_solver.HessianSolver` for the quenches
    tolerance   max |F| / (p d) of a minimum
    discard     strain before the averages
    team        threads of the quenches
    resume      series and state as given to `save`, from which an interrupted run continues
    save        called with series and state after a step, every SAVE_INTERVAL seconds, and after the last one
    report      called with the series after every step

    Raises ConvergenceError where no minimum is found.
    """
    shear, series = QuasistaticShear(disks, step, solver, tolerance, team), StrainSeries(PATH_COLUMNS)
    if resume is not None:
        series.restore(resume[0].arrays())
        shear.restore(resume[1])
    saved = time.monotonic()
    while len(series) < steps:
        done = shear.advance()
        series.add(strain=shear.strain, **vars(shear.minimum), **vars(done))
        if save is not None and (time.monotonic() - saved > SAVE_INTERVAL or len(series) == steps):
            save(series, shear.state())
            saved = time.monotonic()
        if report is not None:
            report(series)
    rows = _is_averaged(series, discard)
    averages = {name: Average.of(series.column(name)[rows]) for name in AVERAGED}
    return ShearPath(shear.disks, series, discard, averages, shear.effort)


def _is_averaged(series, discard):
    return series.column("strain") > discard * (1 + 1e-12)
