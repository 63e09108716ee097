"""A run of steady shear from its start, or from where it was stopped, to its file."""

import time
from dataclasses import dataclass

import numpy as np

from jampetsc.errors import ConvergenceError, InputError
from jampetsc.flows.means import UNBALANCED, Means
from jampetsc.flows.moves import TALLY
from jampetsc.flows.record import BETWEEN_WALLS, SERIES, Record, resumed, write_checkpoint
from jampetsc.flows.shearing import Shear
from jampetsc.flows.walls import seen_between_walls
from jampetsc.progress import Progress

ROW = 1e-2  # strain between rows: several per correlation strain (0.05 to 0.4)
FEWEST_ROWS = 50  # of a short run
INTERVAL = 10.0  # seconds between checkpoints
LINES = 50  # of progress in a log
MOST = 1e12  # time steps
BATCH = 20_000  # time steps between looks at signals


@dataclass(frozen=True)
class Plan:
    """Rows and snapshots of a run: `steps` time steps to a row, `rows` of them in all."""

    steps: int
    rows: int
    discard: float
    snapshots: int

    @classmethod
    def of(cls, rate, step, strain, discard, snapshots, steps=None) -> "Plan":
        """The plan that covers `strain`; `steps` to a row where an earlier part of the run has decided.

        Raises InputError for more time steps or snapshots than there can be.
        """
        many = strain / rate / step
        if many > MOST:
            raise InputError(
                f"--strain {strain:g}: {many:.2g} time steps of {step:.3g}, at most {MOST:.0e}: give a larger --rate "
                "or --step, or a smaller --strain"
            )
        if steps is None:
            steps = max(1, round(min(ROW, strain / FEWEST_ROWS) / (rate * step)))
        plan = cls(steps, max(1, int(np.ceil(strain / (steps * rate * step) - 1e-9))), discard, snapshots)
        kept = plan.rows - plan.first_kept(rate * step)
        if snapshots > kept:
            raise InputError(
                f"--snapshots {snapshots}: there are {kept} rows after --discard, at most one for each"
            )
        return plan

    def first_kept(self, strain_step: float) -> int:
        """Rows that --discard leaves out, with time steps of so much strain."""
        return int(self.discard / (self.steps * strain_step) + 1e-9)

    def snapshot_rows(self, first_kept):
        """Rows after which a snapshot is taken: evenly over those kept, the last included; 0: the start."""
        start = not first_kept and self.snapshots > 1
        return set(np.round(np.linspace(self.rows, first_kept, self.snapshots, endpoint=start)).astype(int))


def run(shear: Shear, plan: Plan, out, settings: dict, record=None) -> Record:
    """Shear until the plan's last row, from a checkpoint beside `out` where there is one of these settings.

    A kill loses at most INTERVAL seconds. Raises ConvergenceError where the time step is too long: a disk jumps,
    or the energy balance is off by more than 5 % in the mean.
    """
    kept = resumed(out, settings)
    if kept is not None:
        record, state = kept
        shear.restore(state)
    record = record or Record(SERIES | (BETWEEN_WALLS if shear.held else {}))
    first, began = len(record), time.monotonic()
    photographed = (
        plan.snapshot_rows(plan.first_kept(shear.rate * shear.scheme.step)) if plan.snapshots else ()
    )
    saved, said = began, first * LINES // plan.rows
    with Progress(LINES, "flow", 0, said) as progress:
        if kept is not None:
            progress.note(f"{out}: goes on from strain {shear.strain:.6g}")
        if not len(record) and 0 in photographed:
            record.snapshot(shear.strain, shear.disks, shear.velocities_now())
        while len(record) < plan.rows:
            _row(shear, plan.steps, record)
            if len(record) in photographed:
                record.snapshot(shear.strain, shear.disks, shear.velocities_now())
            if time.monotonic() - saved > INTERVAL:
                write_checkpoint(out, record, shear.state(), settings)
                saved = time.monotonic()
            if len(record) * LINES // plan.rows > said:
                said += 1
                means = check_balance(record, plan.discard, shear)
                left = (time.monotonic() - began) / (len(record) - first) * (plan.rows - len(record))
                progress.step(_line(shear, means, left))
    return record


def _row(shear, steps, record):
    """One row: means over `steps` time steps, and a look at their end."""
    shear.seen[:] = 0.0
    left = steps
    while left > 0:
        shear.advance(min(left, BATCH))
        left -= BATCH
    seen = dict(zip(TALLY, shear.seen / shear.seen[TALLY.index("steps")], strict=True))
    area, look = shear.reference.area, shear.look()
    walls = seen_between_walls(shear) if shear.held else {}
    record.add(
        strain=shear.strain,
        time=shear.strain / shear.rate,
        shear_stress=[-seen[f"{part}_xy"] / area for part in ("elastic", "viscous", "kinetic")],
        pressure=[seen[part] / (2.0 * area) for part in ("elastic", "viscous", "kinetic")],
        energy=seen["energy"],
        dissipation=seen["dissipation"],
        coordination=look.coordination,
        clusters=look.clusters,
        largest_cluster=look.largest_cluster,
        deepest_overlap=look.deepest,
        **walls,
    )


def check_balance(record, discard, shear) -> Means | None:
    """Means so far. Raises ConvergenceError where work and dissipation do not balance."""
    means = Means.of(record, discard, shear.rate, shear.reference.area)
    if means is not None and abs(means.mismatch) > UNBALANCED:
        raise ConvergenceError(
            f"strain {shear.strain:.4g}: work and dissipation differ by {100 * means.mismatch:.0f} % in the mean with "
            f"time steps of {shear.scheme.step:.3g}: give a smaller --step"
        )
    return means


def _line(shear, means, left):
    """Where a run is, for a log."""
    told = (
        "transient" if means is None else f"sigma {means.shear_stress.mean:.4g}, p {means.pressure.mean:.4g}"
    )
    return f"strain {shear.strain:.4g}, {told}, {_duration(left)} left"


def _duration(seconds):
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.0f} s"
