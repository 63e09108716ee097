"""A run of steady shear from its start, or from a checkpoint, to its last row."""

import time
from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.flows.means import Means
from jampetsc.flows.moves import TALLY
from jampetsc.flows.record import BETWEEN_WALLS, SERIES, Record, write_checkpoint
from jampetsc.flows.shearing import SteadyShear
from jampetsc.flows.walls import wall_columns
from jampetsc.io.checkpoint import Checkpoint
from jampetsc.progress import Progress

ROW = 1e-2  # strain between rows: several per correlation strain (0.05 to 0.4)
FEWEST_ROWS = 50  # into which a short run is divided
INTERVAL = 10.0  # seconds between checkpoints
LINES = 50  # of progress in a log, at most
MAX_TIME_STEPS = 1e12  # time steps of a run
# most time steps of one call, and that times disks, some seconds: Ctrl-C is raised between calls
BATCH, MAX_DISK_STEPS = 20_000, 2e8


@dataclass(frozen=True)
class Plan:
    """Rows and snapshots of a run: `steps` time steps to a row, `rows` of them in all.

    After what is discarded there is a snapshot every `every` rows, or, with a `factor`, at once and after 1,
    factor, factor², … rows. A continued run keeps this rule. If nothing is discarded, the start is also a snapshot,
    unless one alone is asked for: `start` is False.
    """

    steps: int
    rows: int
    discard: float
    every: float = 0.0  # 0: no snapshots
    factor: float = 0.0
    start: bool = True

    @classmethod
    def of(cls, rate, step, strain, discard, snapshots=0, steps=None, every=None, spacing="even") -> "Plan":
        """The plan that covers `strain`.

        steps       to a row, if an earlier part of the run has set it; else a row is no longer than `every`
        snapshots   how many: with `spacing` "even" the last one at the end, "log" at strains since `discard` that grow
                    by a factor
        every       instead: strain from one to the next

        Raises InputError for more time steps or snapshots than there can be.
        """
        needed = strain / rate / step
        if needed > MAX_TIME_STEPS:
            raise InputError(
                f"{named('strain')} {strain:g}: {needed:.2g} time steps of {step:.3g}, at most {MAX_TIME_STEPS:.0e}: "
                f"give a larger {named('rate')} or {named('step')}, or a smaller {named('strain')}"
            )
        if steps is None:
            steps = round(min(ROW, strain / FEWEST_ROWS) / (rate * step))
            if every is not None:  # snapshots are taken after rows
                steps = min(steps, int(every / (rate * step) + 1e-9))
            steps = max(1, steps)
        row = steps * rate * step
        plan = cls(steps, max(1, int(np.ceil(strain / row - 1e-9))), discard)
        first = plan.first_kept(rate * step)
        kept = plan.rows - first
        if snapshots > kept:
            raise InputError(
                f"{named('snapshots')} {snapshots}: there are {kept} rows after {named('discard')}, at most one for "
                "each"
            )
        if spacing == "log" and snapshots:
            if snapshots < 3:
                raise InputError(f"{named('snapshots')} {snapshots}: need 3 or more for logarithmic spacing")
            return replace(plan, factor=kept ** (1.0 / (snapshots - 2)))
        if every is not None:
            if not rate * step <= every * (1 + 1e-9) <= kept * row * (1 + 2e-9):
                raise InputError(
                    f"{named('snapshot_every')} {every:g}: must be at least the strain of a time step, "
                    f"{rate * step:.3g}, and at most what is left after {named('discard')}, {kept * row:.3g}"
                )
            return replace(plan, every=every / row)
        return plan.spread(snapshots, first)

    @classmethod
    def stored(cls, values: dict, strain_step: float) -> "Plan":
        """The plan of a file, made by `asdict`; older files have the number of `snapshots` instead of `every`."""
        snapshots = values.pop("snapshots", 0)
        plan = cls(**values)
        return plan.spread(snapshots, plan.first_kept(strain_step))

    def spread(self, snapshots, first_kept) -> "Plan":
        """The plan with this number of `snapshots`, evenly spaced."""
        if not snapshots:
            return self
        start = snapshots > 1
        between = snapshots - (start and not first_kept)
        return replace(self, every=(self.rows - first_kept) / between, start=start)

    def first_kept(self, strain_step: float) -> int:
        """Number of rows before the means, with time steps of this strain."""
        return int(self.discard / (self.steps * strain_step) + 1e-9)

    def snapshots(self, first_kept: int) -> int:
        """Their number at the end of the run; with a factor an upper bound, as the first ones may share a row."""
        kept = self.rows - first_kept
        if self.factor:
            return 2 + int(np.log(kept) / np.log(self.factor) + 1e-9)
        last = int(kept / self.every + 1e-9) if self.every else 0
        return last + (last > 0 and self.start and not first_kept)

    def snapshot_rows(self, first_kept: int) -> set:
        """Rows after which a snapshot is taken; 0: the start."""
        count = self.snapshots(first_kept)
        if self.factor:
            after = np.r_[0.0, self.factor ** np.arange(count - 1)]
        else:
            after = self.every * (np.arange(count) + (first_kept > 0 or not self.start))
        return set((first_kept + np.round(after)).astype(int).tolist())


def run(shear: SteadyShear, plan: Plan, checkpoint: Checkpoint, record=None, note=None) -> Record:
    """Shear until the plan's last row, after those of `record`; note: a line with which progress begins.

    A kill loses at most INTERVAL seconds and a row; everything if the checkpoint is in memory. Raises ConvergenceError
    where the time step is too long: a disk jumps, or the energy balance is off by more than 5 % in the mean.
    """
    record = record or Record(SERIES | (BETWEEN_WALLS if shear.held else {}))
    first, began = len(record), time.monotonic()
    with_snapshot = plan.snapshot_rows(plan.first_kept(shear.rate * shear.scheme.step))
    saved, lines, cold = began, min(LINES, plan.rows), True
    lines_done = first * lines // plan.rows
    with Progress(lines, "flow", 0, lines_done) as progress:
        if note:
            progress.note(note)
        if not len(record) and 0 in with_snapshot:
            record.snapshot(shear.strain, shear.disks, shear.velocities_now(), shear.spins_now())
        while len(record) < plan.rows:
            _row(shear, plan.steps, record)
            if len(record) in with_snapshot:
                record.snapshot(shear.strain, shear.disks, shear.velocities_now(), shear.spins_now())
            if time.monotonic() - saved > INTERVAL:
                write_checkpoint(checkpoint, record, shear.state())
                saved = time.monotonic()
            if len(record) * lines // plan.rows > lines_done:
                lines_done += 1
                means = check_balance(record, plan.discard, shear)
                left = (time.monotonic() - began) / (len(record) - first) * (plan.rows - len(record))
                progress.step(_line(shear, means, left))
            if cold:  # the first row may have compiled the loops, which is not what the others take
                first, began, cold = len(record), time.monotonic(), False
    return record


def _row(shear, steps, record):
    """Add a row to the record: means over `steps` time steps, and a survey at their end."""
    shear.tally[:] = 0.0
    left, batch = steps, max(1, min(BATCH, int(MAX_DISK_STEPS / shear.reference.n)))
    while left > 0:
        shear.advance(min(left, batch))
        left -= batch
    terms = dict(zip(TALLY, shear.tally / shear.tally[TALLY.index("steps")], strict=True))
    area = shear.reference.area
    walls = wall_columns(shear) if shear.held else {}
    record.add(
        strain=shear.strain,
        time=shear.strain / shear.rate,
        shear_stress=[-terms[f"{part}_xy"] / area for part in ("elastic", "viscous", "kinetic")],
        pressure=[terms[part] / (2.0 * area) for part in ("elastic", "viscous", "kinetic")],
        energy=terms["energy"],
        dissipation=terms["dissipation"],
        **shear.survey(),
        **walls,
    )


def check_balance(record, discard, shear) -> Means | None:
    """Means so far. Raises ConvergenceError where work and dissipation do not balance."""
    means = Means.of(record, discard, shear.rate, shear.reference.area)
    if means is not None and not means.balanced:
        raise ConvergenceError(
            f"strain {shear.strain:.4g}: work and dissipation differ by {100 * means.mismatch:.0f} % in the mean with "
            f"time steps of {shear.scheme.step:.3g}: give a smaller {named('step')}"
        )
    return means


def _line(shear, means, left):
    """Progress of a run, for a log."""
    means_so_far = (
        "transient" if means is None else f"sigma {means.shear_stress.mean:.4g}, p {means.pressure.mean:.4g}"
    )
    return f"strain {shear.strain:.4g}, {means_so_far}, {_duration(left)} left"


def _duration(seconds):
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.0f} s"
