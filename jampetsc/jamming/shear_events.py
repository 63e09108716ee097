"""Quasistatic shear from event to event: every change of contacts and every instability, at its strain.

Between two events the contacts are the same, and a branch of minima x(γ) is followed by its tangent and Newton's
method. The next event is the first root of an overlap of a contact or of the gap of another pair, or the strain where
the branch turns back as K becomes singular (a saddle-node), where s = φ · x is the parameter. At a root the contact
opens or closes; which of several that only touch stay is the complementarity problem of their rates,

    dδ/dγ ≥ 0 of contacts that stay,    dδ/dγ ≤ 0 of those that open,

solved by changing the worst one after another. Where K is not definite after a contact opens, and at a turn, the
minimum is lost: disks are pushed along the mode and descend (`overdamped`, or L-BFGS) to another one at this strain.
Particles that nothing holds are moved by contacts without a force, and stay where they are left.
"""

import numpy as np

from jampetsc.analysis.rearrangement import participation
from jampetsc.analysis.strain_series import StrainSeries
from jampetsc.errors import ConvergenceError
from jampetsc.jamming.branch_follower import (
    CONTACT,
    LOST,
    SYMMETRY,
    TARGET,
    TURN,
    BranchFollower,
    rate_limit,
)
from jampetsc.jamming.event_table import (
    CLOSES,
    EVENT_COLUMNS,
    HIDDEN,
    LEAVES,
    OPENS,
    TOUCHES,
    UNSTABLE,
    Measures,
    deviations,
)
from jampetsc.jamming.instability import descend_steepest, pushed_offsets
from jampetsc.jamming.shear_branch import BranchState, ShearBranch
from jampetsc.jamming.stepwise_shear import (
    RESTART_STEPS,
    MinimumState,
    StepwiseShear,
    StrainStep,
    energy_cut,
)
from jampetsc.minimisation import warm_start
from jampetsc.minimisation.contact_branch import BEARING, OPEN_PAIR, WEIGHTLESS
from jampetsc.minimisation.protocols import MAX_SHAKES
from jampetsc.packing.neighbour_list import is_stale
from jampetsc.packing.neighbours import fractional, lengths, vectors
from jampetsc.packing.packing import deformed
from jampetsc.packing.strain import simple_shear

TOUCH_RATIO = 1e-13  # of the largest diameter: overlaps and gaps that are none
LIGHTEST_RATIO = 1e-15  # of the stiffness of a contact times its length: forces that are none
LIGHT_RATIO = 1e3  # of these: overlaps up to which a contact may belong to a particle that nothing holds
FOLD_RATIO = 2.0  # of the moves that make a list stale to those after which a new one is made
QUENCH_STRAIN = 1e-6  # strain before a quench, where only symmetry or rounding keeps disks
MAX_PIVOTS = 200  # contacts changed at one event
MAX_EVENTS = 100_000  # of one step
LARGEST_RATE_PIVOTS = 20  # of these by the largest rate, then by the lowest number, which cannot cycle


class CameApart(ConvergenceError):
    """No contact bears a force any more."""


class EventShear(StepwiseShear):
    """Disks sheared from event to event, in each `advance` to a multiple of `step`.

    `events` has EVENT_COLUMNS, `largest_drop` the largest drop of the energy so far.

    It ends where no contact is left, at the strain `came_apart`.

    descent: steepest or lbfgs, by which disks leave an instability
    """

    def __init__(self, disks, step, solver, tolerance, team=None, descent="steepest"):
        self.descent, self.branch, self._origin = descent, None, 0.0
        self.events = StrainSeries(EVENT_COLUMNS)
        self.largest_drop = {"drop": 0.0, "event": -1, "d2min": np.full(disks.n, np.nan)}
        self.direction = 1.0 if step > 0 else -1.0
        super().__init__(disks, step, solver, tolerance, team)

    @property
    def strain(self) -> float:
        """See `StepwiseShear`."""
        return super().strain if self.came_apart is None else self.came_apart

    @property
    def present_strain(self) -> float:
        """γ where the disks are now."""
        return self._origin + self.shear

    def fold(self):
        """See `ListedPacking`; the contacts stay."""
        origin, old = self.present_strain, self.branch
        super().fold()
        self._origin = origin
        if old is not None:
            self._find_order()
            self._make_branch()
            self.branch.carry(old)
            self._evaluate()

    def _make_branch(self):
        self.branch = ShearBranch(
            self.pairs, self.reference.n, self._potential, self._stiffness, self._order, self.effort
        )
        self._evaluate()

    def _evaluate(self):
        self.branch.evaluate(self.offsets, self.shear)

    def _factorise(self):
        """Begin a branch at the present list, with the contacts that overlap, and come to rest."""
        self._make_branch()
        unit = self._stiffness * self.diameter
        lightest = self.reference.potential.overlap_at(LIGHTEST_RATIO * unit, self.diameter)
        self._touch = max(TOUCH_RATIO * self.largest, lightest)
        self._come_to_rest()
        self._settle([])

    def _restart_list(self):
        self.branch = None
        super()._restart_list()
        self._origin = self.steps * self.step
        self._anchor_events, self._anchor_largest = len(self.events), self.largest_drop
        self._mode = np.random.default_rng(self.reference.n).standard_normal(self.offsets.shape)

    def _forces(self):
        """See `StepwiseShear`: the sums of the branch, of the contacts that it has."""
        return self.branch.sums

    def _minimum_state(self, sums):
        state = self._measures()
        n = self.reference.n
        return MinimumState(
            state.energy,
            state.shear_stress,
            state.pressure,
            bool(state.energy / n > energy_cut(self.reference.potential) * self.reference.potential.k),
            2.0 * state.contacts / n,
        )

    def _measures(self) -> Measures:
        energy, shear, trace = self.branch.sums
        contacts = int(np.count_nonzero(self.branch.bearing))
        return Measures(
            shear / self.volume, trace / (self.reference.dimension * self.volume), energy, contacts
        )

    def _come_to_rest(self):
        """Newton's method to the minimum of the contacts that overlap there. Raises ConvergenceError."""
        branch = self.branch
        branch.active[:] = branch.overlaps > self._touch
        for _ in range(MAX_PIVOTS):
            branch.classify()
            self._evaluate()
            self._require_contacts()
            if not branch.factorise():
                break
            rest = np.zeros_like(self.offsets)
            start = BranchState(0.0, self.offsets, self.shear, rest, None, rest, 0.0, None, 0.0)
            result = branch.advance(start, 0.0)
            if result is None:
                break
            self.displacement = self.displacement + result[2]
            self.offsets[:] = result[0]
            wrong = (branch.bearing != OPEN_PAIR) & (branch.overlaps < -self._touch)
            wrong |= (branch.active == OPEN_PAIR) & (branch.overlaps > self._touch)
            if not wrong.any():
                return
            branch.active[wrong] = np.where(branch.active[wrong], OPEN_PAIR, BEARING)
        raise ConvergenceError(
            f"shear at strain {self.present_strain:.6g}: no minimum after an instability. Shear without events."
        )

    def _require_contacts(self):
        """Raise CameApart if no contact bears a force."""
        if self._measures().pressure < self._separated_pressure:
            raise CameApart(
                f"shear at strain {self.present_strain:.6g}: particles come apart, and events of loose ones are not "
                "supported. Compress the packing, or shear without events."
            )

    def _settle(self, pairs):
        """Change these pairs, then contacts that only touch until rates fit; the tangent, or None: K is indefinite."""
        branch = self.branch
        changes = list(pairs)
        for pivot in range(MAX_PIVOTS):
            for pair in changes:
                branch.active[pair] = BEARING if branch.active[pair] == OPEN_PAIR else OPEN_PAIR
            branch.classify(LIGHT_RATIO * self._touch, self._touch)
            self._evaluate()
            if not branch.factorise():
                if not changes:
                    raise ConvergenceError(
                        f"shear at strain {self.present_strain:.6g}: a saddle. Shear without events."
                    )
                self._opened = changes[-1]
                return None
            motion, _ = branch.tangent()
            if motion is None:
                break
            rates = self.direction * branch.rates(motion, 1.0)
            limit = rate_limit(motion, 1.0)
            near = np.abs(branch.overlaps) <= self._touch
            wrong = np.where(
                branch.active == OPEN_PAIR,
                near & (rates > limit),
                (near | (branch.active == WEIGHTLESS)) & (rates < -limit),
            )
            if not wrong.any():
                self._tangent = self.direction * motion, self.direction
                branch.start()
                return self._tangent
            by_rate = pivot < LARGEST_RATE_PIVOTS
            changes = [int(np.argmax(np.abs(rates) * wrong if by_rate else wrong))]
        raise ConvergenceError(
            f"shear at strain {self.present_strain:.6g}: contacts that touch do not settle"
        )

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
            if self._is_stale(FOLD_RATIO * self.offsets, FOLD_RATIO * self.shear):
                self.fold()
                self._settle([])
            arrival, follower = self._follow(target)
            self._require_contacts()
            if arrival.cause in (TURN, SYMMETRY, LOST):
                self._lose(arrival)
            elif arrival.cause == CONTACT:
                self._change_contacts(arrival, follower)
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
        events = {
            f"events/{name}": values[: self._anchor_events] for name, values in self.events.arrays().items()
        }
        return (
            super().state()
            | events
            | {f"largest/{name}": value for name, value in self._anchor_largest.items()}
        )

    def restore(self, state: dict) -> None:
        """See `StepwiseShear`."""
        self.events.restore({name: state[f"events/{name}"] for name in EVENT_COLUMNS})
        drop, event, deviation = (np.asarray(state[f"largest/{name}"]) for name in self.largest_drop)
        self.largest_drop = {"drop": float(drop), "event": int(event), "d2min": deviation}
        super().restore(state)

    def _follow(self, target):
        """Follow the branch to its next event, or to a strain; move there."""
        branch, still = self.branch, np.zeros_like(self.offsets)
        start = branch.state(0.0, self.offsets.copy(), self.shear, still, self._tangent)
        follower = BranchFollower(
            branch, start, target - self._origin, self.direction, self._touch, self.diameter, self._is_stale
        )
        arrival = follower.follow()
        self._take(arrival.state)
        return arrival, follower

    def _is_stale(self, offsets, shear) -> bool:
        far = float(lengths(offsets).max())
        return bool(is_stale(far, simple_shear(shear), self.largest, self.skin))

    def _take(self, state):
        """Move to a state of the branch."""
        self.offsets[:] = state.offsets
        self.shear = state.shear
        self.displacement += state.moved
        self._evaluate()

    def _lose(self, arrival):
        """An event where K becomes singular."""
        before = self._measures()
        if arrival.cause == TURN:
            self._fall(arrival.mode, before, 0.0)
        else:
            self._quench_on(before, 0.0, UNSTABLE if arrival.cause == SYMMETRY else HIDDEN)

    def _quench_on(self, before, lowest, kind=HIDDEN):
        """An event that cannot be followed: disks are sheared on by QUENCH_STRAIN and quenched."""
        start = self.disks
        self.shear += self.direction * QUENCH_STRAIN
        self._land(start, self._quench(self.disks, MAX_SHAKES), before, lowest, kind)

    def _change_contacts(self, arrival, follower):
        """An event where a contact opens or closes."""
        branch, before, pair = self.branch, self.branch.active.copy(), arrival.pair
        measures, lowest = self._measures(), self._lowest()
        try:
            is_definite = self._settle([pair]) is not None
        except ConvergenceError:
            self._quench_on(measures, lowest)
            return
        if not is_definite:
            if self._opened == pair:  # was K definite before?
                branch.active[:] = before
                branch.classify(LIGHT_RATIO * self._touch)
                loss = follower.confirm(arrival)
                if loss is not arrival:
                    self.displacement -= arrival.state.moved
                    self._take(loss.state)
                    self._lose(loss)
                    return
                mode = branch.opening(pair)
                branch.active[pair] = OPEN_PAIR
                branch.classify(LIGHT_RATIO * self._touch)
            else:
                mode = branch.opening(self._opened)
            self._fall(mode, measures, lowest)
            return
        after = self._measures()
        for changed in np.flatnonzero((before != OPEN_PAIR) != (branch.active != OPEN_PAIR)):
            kind = self._kind(before[changed], branch.active[changed])
            self._record(kind, self._ends(changed), measures, after, lowest)

    def _kind(self, before, after) -> int:
        if before == OPEN_PAIR:
            return TOUCHES if after == WEIGHTLESS else CLOSES
        return LEAVES if before == WEIGHTLESS else OPENS

    def _ends(self, pair):
        i, j = int(self.pairs.i[pair]), int(self.pairs.j[pair])
        return min(i, j), max(i, j)

    def _record(self, kind, particles, before, after, lowest, drop=0.0, participation=0.0):
        both = {name: [getattr(before, name), getattr(after, name)] for name in vars(before)}
        self.events.add(
            strain=self.present_strain,
            kind=kind,
            particles=particles,
            drop=drop,
            participation=participation,
            lowest_eigenvalue=lowest,
            **both,
        )

    def _lowest(self) -> float:
        value, self._mode = self.branch.lowest_mode(self._mode)
        return value

    def _fall(self, mode, before, lowest):
        """An instability: descend from here along a mode to another minimum at this strain."""
        start = self.disks
        pushed = pushed_offsets(
            self.branch, self.reference, self.offsets, self.shear, before.pressure, self._floor, mode
        )
        if pushed is None:
            self._quench_on(before, lowest)
            return
        disks = deformed(self.reference, pushed, self.cell_strain).folded()
        if self.descent == "lbfgs":
            disks = self._quench(disks)
        else:
            disks = descend_steepest(
                disks, self.solver, self._stiffness, self._separated_pressure, self.effort
            )
        self._land(start, disks, before, lowest)

    def _land(self, start, disks, before, lowest, kind=UNSTABLE):
        """Continue from another minimum, `disks`, than `start`, where an instability was."""
        strain = self.present_strain
        displacement = (disks.base - start.base) + (disks.offset - start.offset)
        moved = displacement - vectors(np.round(fractional(displacement, start.cell)), start.cell)
        self.branch = None
        self.list(disks)
        self._origin = strain
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
        after = self._measures()
        farthest = tuple(sorted(int(k) for k in np.argsort(np.sum(moved**2, axis=1))[-2:]))
        drop = before.energy - after.energy
        self._record(kind, farthest, before, after, lowest, drop, participation(moved))
        if drop > self.largest_drop["drop"]:
            self.largest_drop = {
                "drop": drop,
                "event": len(self.events) - 1,
                "d2min": deviations(start, moved),
            }
        if end is not None:
            raise end
