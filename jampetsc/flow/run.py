"""A run of steady shear from its start, or from where it was stopped, to its file."""

import time
from dataclasses import dataclass

import numpy as np

from jampetsc.contacts.disks import Disks
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.flow.means import UNBALANCED, Means
from jampetsc.flow.record import Record, remove_checkpoint, resumed, write_checkpoint
from jampetsc.flow.shearing import Shear
from jampetsc.flow.steps import TALLY

ROW = 5e-3  # strain between rows, or a little less: some ten rows per correlation strain
FEWEST_ROWS = 100  # of a short run
INTERVAL = 30.0  # seconds between checkpoints
LINES = 50  # of progress in a log
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
        """The plan that covers `strain`; `steps` to a row where an earlier part of the run has decided."""
        if steps is None:
            steps = max(1, round(min(ROW, strain / FEWEST_ROWS) / (rate * step)))
        return cls(steps, max(1, int(np.ceil(strain / (steps * rate * step) - 1e-9))), discard, snapshots)

    def snapshot_rows(self, first_kept):
        """Rows after which a snapshot is taken: evenly over those kept, the last one included."""
        return set(np.round(np.linspace(self.rows, first_kept, self.snapshots, endpoint=False)).astype(int))


def run(shear: Shear, plan: Plan, out, settings: dict, progress, record=None) -> Record:
    """Shear until the plan's last row, from a checkpoint beside `out` where there is one of these settings.

    The checkpoint holds at most INTERVAL seconds back; an interrupt writes it too. Raises ConvergenceError where
    the time step is too long: a disk jumps, or the energy balance is off by more than 5 % in the mean.
    """
    kept = resumed(out, settings)
    if kept is not None:
        record, state = kept
        shear.restore(state)
        progress.note(f"{out}: goes on from strain {shear.strain:.6g}")
    record = record or Record()
    per_row = plan.steps * shear.rate * shear.scheme.step
    photographed = plan.snapshot_rows(int(plan.discard / per_row + 1e-9)) if plan.snapshots else ()
    saved, said, first, began = time.monotonic(), 0, len(record), time.monotonic()
    try:
        while len(record) < plan.rows:
            _row(shear, plan.steps, record)
            if len(record) in photographed:
                record.snapshot(shear.strain, shear.disks, shear.velocities_now())
            now = time.monotonic()
            if now - saved > INTERVAL:
                write_checkpoint(out, record, shear.state(), settings)
                saved = time.monotonic()
            if len(record) * LINES // plan.rows > said:
                said = len(record) * LINES // plan.rows
                means = check_balance(record, plan.discard, shear)
                progress.to(len(record) / plan.rows, _line(shear, record, means, plan, now - began, first))
    except BaseException as stop:
        if len(record) > first and not isinstance(stop, ConvergenceError):
            whole = shear.steps == len(record) * plan.steps
            if whole:
                write_checkpoint(out, record, shear.state(), settings)
        raise
    check_balance(record, plan.discard, shear)
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


def _line(shear, record, means, plan, spent, first):
    """Where a run is, for a log."""
    left = spent / max(len(record) - first, 1) * (plan.rows - len(record))
    told = "transient" if means is None else f"sigma {means.shear_stress.mean:.4g}, p {means.pressure.mean:.4g}"
    return f"strain {shear.strain:.4g}, {told}, {_duration(left)} left"


def _duration(seconds):
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.0f} s"


def start_from(disks: Disks) -> Disks:
    """A packing as a start. Raises InputError where disks lie inside one another."""
    from jampetsc.contacts.state import find_contacts

    contacts = find_contacts(disks)
    if len(contacts) and float(np.max(contacts.overlap / contacts.sigma)) > 0.5:
        raise InputError(
            f"overlap of {float(np.max(contacts.overlap / contacts.sigma)):.2g} of the distance of two disks: "
            "no state of soft disks; quench it first with `jampetsc pack --from`"
        )
    return disks


def finish(out) -> None:
    """Remove the checkpoint of a run whose file is in place."""
    remove_checkpoint(out)
