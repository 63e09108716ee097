"""Rows, snapshots and checks of a flow: after how many time steps each of them is due."""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import InputError, named

ROW_STRAIN = 1e-2  # strain between rows: several per correlation strain (0.05 to 0.4)
MIN_ROWS = 50  # into which a short run is divided
MAX_CHECKS = 50  # of the energy balance, evenly over the rows
MAX_TIME_STEPS = 1e12  # time steps of a run


@dataclass(frozen=True)
class Schedule:
    """Rows and snapshots of a run: `steps` time steps to a row, `rows` of them in all.

    After what is discarded there is a snapshot every `every` rows, or, with a `factor`, at once and after 1,
    factor, factor², … rows. A continued run keeps this rule. If nothing is discarded, the start is also a snapshot,
    unless one alone is requested: `start` is False.
    """

    steps: int
    rows: int
    discard: float
    every: float = 0.0  # 0: no snapshots
    factor: float = 0.0
    start: bool = True

    @classmethod
    def of(
        cls, rate, step, strain, discard, snapshots=0, steps=None, every=None, spacing="even"
    ) -> "Schedule":
        """The schedule that covers `strain`.

        steps       to a row, if an earlier part of the run has set it; else a row is at most `every` long
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
            steps = round(min(ROW_STRAIN, strain / MIN_ROWS) / (rate * step))
            if every is not None:  # snapshots are taken after rows
                steps = min(steps, int(every / (rate * step) + 1e-9))
            steps = max(1, steps)
        row = steps * rate * step
        schedule = cls(steps, max(1, int(np.ceil(strain / row - 1e-9))), discard)
        first = schedule.first_averaged_row(rate * step)
        kept = schedule.rows - first
        if snapshots > kept:
            raise InputError(
                f"{named('snapshots')} {snapshots}: there are {kept} rows after {named('discard')}, at most one for "
                "each"
            )
        if spacing == "log" and snapshots:
            if snapshots < 3:
                raise InputError(f"{named('snapshots')} {snapshots}: need 3 or more for logarithmic spacing")
            return replace(schedule, factor=kept ** (1.0 / (snapshots - 2)))
        if every is not None:
            if not rate * step <= every * (1 + 1e-9) <= kept * row * (1 + 2e-9):
                raise InputError(
                    f"{named('snapshot_every')} {every:g}: must be at least the strain of a time step, "
                    f"{rate * step:.3g}, and at most what is left after {named('discard')}, {kept * row:.3g}"
                )
            return replace(schedule, every=every / row)
        return schedule.spread_snapshots(snapshots, first)

    def spread_snapshots(self, snapshots, first_averaged) -> "Schedule":
        """The schedule with this number of `snapshots`, evenly spaced."""
        if not snapshots:
            return self
        start = snapshots > 1
        between = snapshots - (start and not first_averaged)
        return replace(self, every=(self.rows - first_averaged) / between, start=start)

    def first_averaged_row(self, strain_step: float) -> int:
        """Number of rows before the means, with time steps of this strain."""
        return int(self.discard / (self.steps * strain_step) + 1e-9)

    def count_snapshots(self, first_averaged: int) -> int:
        """Their number at the end of the run; with a factor an upper bound, as the first ones may share a row."""
        kept = self.rows - first_averaged
        if self.factor:
            return 2 + int(np.log(kept) / np.log(self.factor) + 1e-9)
        last = int(kept / self.every + 1e-9) if self.every else 0
        return last + (last > 0 and self.start and not first_averaged)

    def snapshot_rows(self, first_averaged: int) -> set:
        """Rows after which a snapshot is taken; 0: the start."""
        count = self.count_snapshots(first_averaged)
        if self.factor:
            after = np.r_[0.0, self.factor ** np.arange(count - 1)]
        else:
            after = self.every * (np.arange(count) + (first_averaged > 0 or not self.start))
        return set((first_averaged + np.round(after)).astype(int).tolist())

    def count_checks(self, rows: int) -> int:
        """Checks of the energy balance until the end of this number of rows."""
        return rows * min(MAX_CHECKS, self.rows) // self.rows

    def extended(self, strain: float, rate: float, step: float) -> "Schedule":
        """The schedule of a run continued by `strain`; raises InputError as `of`."""
        extension = Schedule.of(rate, step, strain, 0.0, steps=self.steps)
        return replace(self, rows=self.rows + extension.rows)
