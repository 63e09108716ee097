"""A run of steady shear in memory: the schedule of its rows, what determines it, and its way to the last row."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import numpy as np

from jampetsc.analysis.strain_series import SAVE_INTERVAL, discarded_strain
from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.flows.steady_shear import SteadyShear
from jampetsc.flows.step_kernels import TALLY
from jampetsc.flows.trajectory import Means, Trajectory
from jampetsc.flows.walls import phi_between, wall_columns
from jampetsc.laws.damping import Law
from jampetsc.laws.flow_models import FLOW_WEIGHTS, Model, Scheme, scheme_for
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.packing import Packing
from jampetsc.packing.threads import Team

ROW_STRAIN = 1e-2  # strain between rows: several per correlation strain (0.05 to 0.4)
MIN_ROWS = 50  # into which a short run is divided
MAX_CHECKS = 50  # of the energy balance, evenly over the rows
MAX_TIME_STEPS = 1e12  # time steps of a run
MAX_SERIES_ROWS = 10**6  # of a series with its own spacing
MAX_START_OVERLAP = 0.5  # of two disks of a start, in units of σ
MIN_PRESSURE = 1e-6  # p/(γ̇ kτ₁) below which disks are taken not to touch: overlaps of a start fade slowly
# most time steps of one call, and that times disks, some seconds: Ctrl-C is raised between calls
MAX_CALL_STEPS, MAX_CALL_DISK_STEPS = 20_000, 2e8
LAW_SETTINGS = ("label", *FLOW_WEIGHTS, "tau1")  # what a run's settings have of its damping law


@dataclass(frozen=True)
class Schedule:
    """Rows and snapshots of a run: `steps` time steps to a row, `rows` of them in all.

    After what is discarded there is a snapshot every `every` rows, or, with a `factor`, at once and after 1,
    factor, factor², … rows. A continued run keeps this rule. If nothing is discarded, the start is also a snapshot,
    unless one alone is requested: `start` is False. With `has_start_row` the state at γ = 0 is kept beside the rows.
    """

    steps: int
    rows: int
    discard: float
    every: float = 0.0  # 0: no snapshots
    factor: float = 0.0
    start: bool = True
    has_start_row: bool = False

    @classmethod
    def of(
        cls, rate, step, strain, discard, snapshots=0, steps=None, every=None, spacing="even", series=None
    ) -> "Schedule":
        """The schedule that covers `strain`.

        steps       to a row, if an earlier part of the run has set it; else a row is at most `every` long
        snapshots   how many: with `spacing` "even" the last one at the end, "log" at strains since `discard` that grow
                    by a factor
        every       instead: strain from one to the next
        series      strain of a row, for a series finer than by default that has the state at γ = 0

        Raises InputError for more time steps or snapshots than there can be.
        """
        needed = strain / rate / step
        if needed > MAX_TIME_STEPS:
            raise InputError(
                f"{named('strain')} {strain:g}: {needed:.2g} time steps of {step:.3g} (at most "
                f"{MAX_TIME_STEPS:.0e}). Give a larger {named('rate')} or {named('step')}, or a smaller "
                f"{named('strain')}."
            )
        if steps is None:
            steps = (
                round(min(ROW_STRAIN, strain / MIN_ROWS) / (rate * step))
                if series is None
                else _series_steps(series, rate * step, strain)
            )
            if every is not None:  # snapshots are taken after rows
                steps = min(steps, int(every / (rate * step) + 1e-9))
            steps = max(1, steps)
        row = steps * rate * step
        rows = max(1, int(np.ceil(strain / row - 1e-9)))
        schedule = cls(steps, rows, discard, has_start_row=series is not None)
        first = schedule.first_averaged_row(rate * step)
        kept = schedule.rows - first
        if snapshots > kept:
            raise InputError(
                f"{named('snapshots')} {snapshots}: {kept} rows after {named('discard')}, each with at most one. "
                "Ask for fewer."
            )
        if spacing == "log" and snapshots:
            if snapshots < 3:
                raise InputError(
                    f"{named('snapshots')} {snapshots}: must be at least 3 with logarithmic spacing"
                )
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


def _series_steps(series, strain_step, strain) -> int:
    """Time steps of a row of at most `series` in strain; raises InputError for rows that are too long or too many."""
    longest = max(ROW_STRAIN, strain_step)
    if not strain_step <= series * (1 + 1e-9) <= longest * (1 + 2e-9):
        raise InputError(
            f"{named('series')} {series:g}: must be at least the strain of a time step, {strain_step:.3g}, and at "
            f"most that of a row without it, {longest:.3g}"
        )
    if strain / series > MAX_SERIES_ROWS:
        raise InputError(
            f"{named('series')} {series:g}: {strain / series:.2g} rows (at most {MAX_SERIES_ROWS:.0e}). Give a larger "
            f"one, or a shorter {named('strain')}."
        )
    return int(series / strain_step + 1e-9)


@dataclass(frozen=True, eq=False)
class FlowRun:
    """What determines a run of steady shear."""

    disks: Packing  # at the start
    model: Model
    rate: float
    scheme: Scheme
    schedule: Schedule
    wall_disks: int = 0  # the first ones, which make up walls
    earlier: tuple | None = None  # (Trajectory, state) of the run that it continues

    @property
    def phi(self) -> float:
        """Packing fraction of the disks that move."""
        return phi_between(self.disks, self.wall_disks)

    @property
    def first_averaged_row(self) -> int:
        """Number of rows before the means."""
        return self.schedule.first_averaged_row(self.rate * self.scheme.step)

    @property
    def settings(self) -> dict:
        """What a run that continues this one keeps, as plain values."""
        return {
            "model": asdict(self.model)
            | {"law": {name: getattr(self.model.law, name) for name in LAW_SETTINGS}},
            "rate": self.rate,
            "scheme": asdict(self.scheme),
            "schedule": asdict(self.schedule),
            "walls": self.wall_disks,
        }

    @classmethod
    def of_settings(cls, settings: dict, disks: Packing) -> "FlowRun":
        """The run of `disks` with these `settings`."""
        model = settings["model"] | {"law": Law(**settings["model"]["law"])}
        scheme, schedule = Scheme(**settings["scheme"]), Schedule(**settings["schedule"])
        return cls(disks, Model(**model), settings["rate"], scheme, schedule, settings["walls"])

    def extended(self, trajectory: Trajectory, state: dict, strain: float) -> "FlowRun":
        """The run that continues this one by `strain`; raises InputError as `Schedule.of`.

        trajectory, state   of its result
        """
        schedule = self.schedule.extended(strain, self.rate, self.scheme.step)
        return replace(self, schedule=schedule, earlier=(trajectory, state))


@dataclass(frozen=True, eq=False)
class CompletedFlow:
    """Result of a run of steady shear."""

    disks: Packing  # the packing at the end
    trajectory: Trajectory
    means: Means
    state: dict  # arrays and numbers from which the run can be continued, see `SteadyShear.state`


def define_flow(
    disks, model, rate, strain, *, wall_disks=0, discard=None, step=None, tolerance=1e-4, **rows
) -> FlowRun:
    """A new run; rows: `snapshots`, `every`, `spacing` and `series` as for `Schedule.of`.

    Raises InputError for overlaps beyond MAX_START_OVERLAP, and as `Schedule.of`.
    """
    contacts = find_contacts(disks)
    overlap = float(np.max(contacts.overlap / contacts.sigma, initial=0.0))
    if overlap > MAX_START_OVERLAP:
        raise InputError(
            f"start: two particles overlap by {100 * overlap:.3g} % of their distance at contact (at most "
            f"{100 * MAX_START_OVERLAP:.0f} %). Quench it first: pack with {named('from_')}."
        )
    scheme = scheme_for(model, disks, rate, step, tolerance)
    schedule = Schedule.of(rate, scheme.step, strain, discarded_strain(strain, discard), **rows)
    return FlowRun(disks, model, rate, scheme, schedule, wall_disks)


def run_flow(
    run: FlowRun,
    *,
    team: Team | None = None,
    resume: tuple[Trajectory, dict] | None = None,
    save: Callable[[Trajectory, dict], None] | None = None,
    report: Callable[[float, Means | None, float], None] | None = None,
) -> CompletedFlow:
    """Shear until the last row of the run.

    team    threads that take the time steps
    resume  trajectory and state as given to `save`, from which an interrupted run continues
    save    called with trajectory and state after a row, every SAVE_INTERVAL seconds
    report  called at every check of the energy balance with the strain, the means so far (None before there are any)
            and the seconds left

    Raises ConvergenceError where the time step is too long: a disk jumps, or the energy balance is off by more than
    5 % in the mean; and where disks never touch.
    """
    shear = SteadyShear(run.disks, run.model, run.rate, run.scheme, team, run.wall_disks)
    trajectory, state = resume or run.earlier or (Trajectory(run.wall_disks > 0), None)
    trajectory = trajectory.copy()
    if state is not None:
        shear.restore(state)
    elif run.schedule.has_start_row:
        trajectory.start = start_row(run, team)
    _take_rows(run, shear, trajectory, save, report)
    means = check_balance(trajectory, run.schedule.discard, shear)
    if means is None or means.pressure.mean < MIN_PRESSURE * run.rate * shear.damping_unit:
        raise ConvergenceError(
            f"phi = {run.phi:.4g}: no two particles touched within the strain of {shear.strain:.3g}: "
            f"choose a larger {named('phi')}, or a longer {named('strain')}"
        )
    return CompletedFlow(shear.disks, trajectory, means, shear.state())


def _take_rows(run, shear, trajectory, save, report):
    """Add rows and snapshots to the trajectory until the last row."""
    schedule, first, began = run.schedule, len(trajectory), time.monotonic()
    snapshot_rows = schedule.snapshot_rows(run.first_averaged_row)
    saved, is_first = began, True
    if not len(trajectory) and 0 in snapshot_rows:
        _add_snapshot(trajectory, shear)
    while len(trajectory) < schedule.rows:
        add_row(trajectory, shear, schedule.steps)
        rows = len(trajectory)
        if rows in snapshot_rows:
            _add_snapshot(trajectory, shear)
        if save is not None and time.monotonic() - saved > SAVE_INTERVAL:
            save(trajectory, shear.state())
            saved = time.monotonic()
        if schedule.count_checks(rows) > schedule.count_checks(rows - 1):
            means = check_balance(trajectory, schedule.discard, shear)
            if report is not None:
                report(
                    shear.strain, means, (time.monotonic() - began) / (rows - first) * (schedule.rows - rows)
                )
        if is_first:  # it may have compiled the loops, which the others need not
            first, began, is_first = rows, time.monotonic(), False


def _add_snapshot(trajectory, shear):
    trajectory.add_snapshot(
        shear.strain, shear.disks, shear.nonaffine_velocities(), shear.angular_velocities()
    )


def start_row(run: FlowRun, team: Team | None) -> dict:
    """{column: value} of the state at γ = 0: what the first time step computes before it moves the disks."""
    shear = SteadyShear(run.disks, run.model, run.rate, run.scheme, team, run.wall_disks)
    contacts = shear.survey()
    return row_means(shear, 1) | contacts


def row_means(shear: SteadyShear, steps: int) -> dict:
    """{column: value} of the means over the next `steps` time steps, which are taken."""
    shear.tally[:] = 0.0
    batch = max(1, min(MAX_CALL_STEPS, int(MAX_CALL_DISK_STEPS / shear.reference.n)))
    while steps > 0:
        shear.advance(min(steps, batch))
        steps -= batch
    terms = dict(zip(TALLY, shear.tally / shear.tally[TALLY.index("steps")], strict=True))
    volume, parts = shear.reference.volume, ("elastic", "viscous", "kinetic")
    return {
        "shear_stress": [-terms[f"{part}_xy"] / volume for part in parts],
        "pressure": [terms[part] / (shear.reference.dimension * volume) for part in parts],
        "energy": terms["energy"],
        "dissipation": terms["dissipation"],
    }


def add_row(trajectory, shear, steps: int) -> None:
    """Add a row to the trajectory: means over `steps` time steps, and a survey at their end."""
    means = row_means(shear, steps)
    walls = wall_columns(shear) if shear.wall_disks else {}
    end = {"strain": shear.strain, "time": shear.strain / shear.rate, **shear.survey()}
    trajectory.add(**end, **means, **walls)


def check_balance(trajectory: Trajectory, discard: float, shear: SteadyShear) -> Means | None:
    """Means so far. Raises ConvergenceError where work and dissipation do not balance."""
    means = Means.of(trajectory, discard, shear.rate, shear.reference.volume)
    if means is not None and not means.is_balanced:
        raise ConvergenceError(
            f"strain {shear.strain:.4g}: work and dissipation differ by {100 * means.mismatch:.0f} % in the mean with "
            f"time steps of {shear.scheme.step:.3g}: give a smaller {named('step')}"
        )
    return means
