"""Quasistatic strain from event to event: every change of contacts and every instability, at its strain.

A minimum is followed (`followed_minimum`) to the first root of an overlap of a contact or of the gap of another pair,
or to the strain where its branch turns back as K becomes singular (a saddle-node), where s = φ · x is the parameter.
At a root the contact opens or closes. Where K is not definite after a contact opens, and at a turn, the minimum is
lost: disks are pushed along the mode and descend (`overdamped`, or L-BFGS) to another one at this strain.
"""

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.jamming.branch_follower import CONTACT, LOST, SYMMETRY, TARGET, TURN
from jampetsc.jamming.event_table import CLOSES, HIDDEN, LEAVES, OPENS, TOUCHES, UNSTABLE, EventTable
from jampetsc.jamming.followed_minimum import CameApart, FollowedMinimum
from jampetsc.jamming.instability import (
    DESCENT_TOLERANCE,
    descend_steepest,
    displacement_between,
    pushed_offsets,
)
from jampetsc.jamming.stepwise_shear import RESTART_STEPS, StrainStep
from jampetsc.minimisation import warm_start
from jampetsc.minimisation.contact_branch import OPEN_PAIR, WEIGHTLESS
from jampetsc.minimisation.protocols import MAX_SHAKES
from jampetsc.packing.contacts import typical_force
from jampetsc.packing.packing import deformed

FOLD_RATIO = 2.0  # of the moves that make a list stale to those after which a new one is made
QUENCH_STRAIN = 1e-6  # strain before a quench, where only symmetry or rounding keeps disks
MAX_EVENTS = 100_000  # of one step


class EventShear(FollowedMinimum):
    """Disks strained from event to event, in each `advance` to a multiple of `step`; `events`: an `EventTable`.

    It ends where no contact is left, at the strain `came_apart`.

    descent   steepest or lbfgs, by which disks leave an instability
    load      see `FollowedMinimum`
    """

    def __init__(self, disks, step, solver, tolerance, team=None, descent="steepest", load=None):
        self.descent, self.events = descent, EventTable(disks.n, disks.dimension)
        super().__init__(disks, step, solver, tolerance, team, load)

    @property
    def strain(self) -> float:
        """See `StepwiseShear`."""
        return super().strain if self.came_apart is None else self.came_apart

    def _restart_list(self):
        self.branch = None
        self.fold()
        self._listed_strain = self.steps * self.step
        super()._restart_list()
        self._anchor_events = self.events.state()
        self._mode = np.random.default_rng(self.reference.n).standard_normal(self.offsets.shape)

    def advance(self) -> StrainStep:
        """To the next multiple of `step`, through all events before it."""
        if self.steps % RESTART_STEPS == 0:
            self._restart_list()
        spent, first = self.effort.evaluations, len(self.events)
        target = (self.steps + 1) * self.step
        self.displacement = np.zeros_like(self.offsets)
        try:
            self._advance_to(target)
        except CameApart:
            self.came_apart = self.present_strain
        self.steps += 1
        size, _ = warm_start.without_drift(self.displacement, self.pairs.r0)
        self.minimum = self._minimum_state(self._forces())
        falls = {UNSTABLE, HIDDEN} & set(self.events.rows["kind"][first:])
        drop = float(sum(self.events.rows["drop"][first:]))
        return StrainStep(size / self.diameter, drop, bool(falls), True, self.effort.evaluations - spent)

    def _advance_to(self, target):
        """Through all events before a strain. Raises CameApart and ConvergenceError."""
        for _ in range(MAX_EVENTS):
            if self.direction * (target - self.present_strain) <= 0.0:  # after a quench just before
                break
            if self._is_stale(FOLD_RATIO * self.offsets, FOLD_RATIO * self.shear):
                self.fold()
                self._settle([])
            arrival = self._follow(target)
            self._require_contacts()
            if arrival.cause in (TURN, SYMMETRY, LOST):
                self._lose(arrival)
            elif arrival.cause == CONTACT:
                self._change_contacts(arrival.pair)
            else:
                self._settle([])
                if arrival.cause == TARGET:
                    break
        else:
            raise ConvergenceError(
                f"shear at strain {self.present_strain:.17g}: contacts change without end. Shear without events."
            )

    def state(self) -> dict:
        """See `StepwiseShear`; with the events so far."""
        return super().state() | self._anchor_events

    def restore(self, state: dict) -> None:
        """See `StepwiseShear`."""
        self.events.restore(state)
        self._listed_strain, self.shear = int(state["anchor"]) * self.step, 0.0
        super().restore(state)

    def _lose(self, arrival):
        """An event where K becomes singular."""
        before = self._measures()
        if arrival.cause == TURN:
            self._fall(arrival.mode, before, 0.0)
        else:
            self._quench_on(before, 0.0, UNSTABLE if arrival.cause == SYMMETRY else HIDDEN)

    def _quench_on(self, before, lowest, kind=HIDDEN):
        """An event that cannot be followed: disks are strained on by QUENCH_STRAIN and quenched."""
        start = self.disks
        self.shear += self.direction * QUENCH_STRAIN
        self._land(start, self._quench(self.disks, MAX_SHAKES), before, lowest, kind)

    def _change_contacts(self, pair):
        """An event where a contact opens or closes."""
        branch, before = self.branch, self.branch.active.copy()
        measures, lowest = self._measures(), self._lowest()
        try:
            is_definite = self._settle([pair]) is not None
        except ConvergenceError:
            self._quench_on(measures, lowest)
            return
        if not is_definite:
            self._fall(branch.opening(self._opened), measures, lowest)
            return
        changed = np.flatnonzero((before != OPEN_PAIR) != (branch.active != OPEN_PAIR))
        if not len(changed):  # rates at δ = 0 say that contacts stay which Newton's method loses
            self._quench_on(measures, lowest)
            return
        after = self._measures()
        events = [(self._kind(before[pair], branch.active[pair]), self._ends(pair)) for pair in changed]
        for kind, ends in sorted(events):  # of one strain, in an order that the list does not decide
            self.events.record(self.present_strain, kind, ends, measures, after, lowest)

    def _kind(self, before, after) -> int:
        if before == OPEN_PAIR:
            return TOUCHES if after == WEIGHTLESS else CLOSES
        return LEAVES if before == WEIGHTLESS else OPENS

    def _ends(self, pair):
        i, j = int(self.pairs.i[pair]), int(self.pairs.j[pair])
        return min(i, j), max(i, j)

    def _lowest(self) -> float:
        value, self._mode = self.branch.lowest_mode(self._mode)
        return value

    def _fall(self, mode, before, lowest):
        """An instability: descend from here along a mode to another minimum at this strain."""
        start, is_steepest = self.disks, self.descent != "lbfgs"
        tolerance = DESCENT_TOLERANCE if is_steepest else self._quench_tolerance
        force = max(tolerance * typical_force(self.reference, before.pressure), self._floor)
        pushed = pushed_offsets(
            self.branch, self.reference, self.offsets, self.shear, before.pressure, force, mode
        )
        if pushed is None:
            self._quench_on(before, lowest)
            return
        disks = deformed(self.reference, pushed, self.cell_strain).folded()
        disks = self._descend(disks) if is_steepest else self._quench(disks)
        self._land(start, disks, before, lowest)

    def _descend(self, disks):
        """The minimum that steepest descent leads to."""
        return descend_steepest(disks, self.solver, self._stiffness, self._separated_pressure, self.effort)

    def _land(self, start, disks, before, lowest, kind=UNSTABLE):
        """Continue from another minimum, `disks`, than `start`, where an instability was."""
        moved = displacement_between(start, disks)
        self.branch = None
        self.list(disks)
        self._find_order()
        self._measure_scales()
        so_far, self.displacement = self.displacement, moved
        end = None
        try:
            self._factorise()  # comes to rest
        except CameApart as error:
            end = error
        moved, self.displacement = self.displacement, so_far + self.displacement
        moved = moved - moved.mean(axis=0)
        self.events.record_fall(self.present_strain, kind, start, moved, before, self._measures(), lowest)
        if end is not None:
            raise end
