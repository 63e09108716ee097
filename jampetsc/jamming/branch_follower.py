"""From a minimum along its branch to the first event: a contact that opens or closes, a turn, or the strain asked for.

Each point of the branch has a tangent, so that each overlap δ has its root predicted, t − δ/(dδ/dt); the earliest root
is approached by Newton's method from either side, between the last point where all contacts are as they should be and
the first one where one is not. Where Newton's method to the next point fails, K is nearly singular, and the parameter
becomes s = φ · x along the tangent there: γ(s) passes its turn, dγ/ds = 0, smoothly.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.jamming.shear_branch import BranchState, ShearBranch
from jampetsc.minimisation.contact_branch import WEIGHTLESS

STRAIN_TOLERANCE = 1e-14  # of a root
RATE_TOLERANCE = 1e-9  # of rates of overlaps, in units of the largest velocity: none
MAX_TRIALS = 1000  # points from an event to the next
MAX_CORRECTION = 0.2  # of the predicted displacement: longer ones may leave the branch
MAX_JUMP = 0.03  # of the largest change of an overlap: difference from that by the mean of the rates
SAME_TANGENT = 0.05  # of a step that ended with a new tangent: further steps that keep it
MAX_SKEW = 2.0  # of the motion along the branch to its part along the mode, before another mode is taken
NOISE = 1e-9  # mean diameters: what rounding may do to places where K is nearly singular
SHRINK = 0.25  # of a step that fails
MIN_STEP = 1e-13  # of s, in mean diameters
MAX_BISECTIONS = 60
MIN_SPEED = 1e-5  # of motion per strain, in mean diameters: slower ones have no part in a loss of stability
# what ends a branch; SYMMETRY: K is singular, but its mode is not driven by the shear; LOST: rounding hides the branch
TARGET, CONTACT, TURN, STALE, SYMMETRY, LOST = "target", "change", "turn", "stale", "symmetry", "lost"


@dataclass(frozen=True, eq=False)
class Arrival:
    """Where a branch was followed to."""

    state: BranchState
    cause: str  # TARGET, CONTACT, TURN, STALE, SYMMETRY or LOST
    pair: int = -1  # of CONTACT
    mode: np.ndarray | None = None  # (N, D) of TURN: where K is singular


def rate_limit(motion, strain_rate: float, diameter: float) -> float:
    """Rates of overlaps below which they do not change; diameter: the unit of length."""
    return RATE_TOLERANCE * (diameter * abs(strain_rate) + float(np.abs(motion).max()))


class BranchFollower:
    """Follows a branch from a state of its parameter γ, in a direction ±1.

    goal       shear of the list to end at
    touch      overlaps and gaps that count as none
    diameter   unit of length
    stale      function of (offsets, shear): whether the list may miss a contact
    """

    def __init__(self, branch: ShearBranch, start, goal, direction, touch, diameter, stale):
        self.branch, self.start, self.goal, self.direction = branch, start, goal, direction
        self.touch, self.diameter, self.stale = touch, diameter, stale
        self._passed = np.zeros_like(start.moved)  # moves before t = 0 of the present parameter

    def follow(self) -> Arrival:
        """To the first event, where K is proved definite, or to where it becomes singular before."""
        arrival = self._follow(self.start, None, np.inf)
        if arrival.cause in (TURN, SYMMETRY, LOST) or self._is_definite(arrival.state):
            return arrival
        self._passed = np.zeros_like(self._passed)
        return self._bisect(self.start, arrival.state.shear)

    def _follow(self, start, mode, longest) -> Arrival:
        previous, last, here, beyond = (
            None,
            start,
            start,
            None,
        )  # beyond: the first state that is past an event
        for _ in range(MAX_TRIALS):
            dt, cause, pair = self._first_root(here, last if here is not last else previous, mode)
            near = abs(dt * here.strain_rate) <= STRAIN_TOLERANCE and (
                cause != TURN or abs(dt) < self.diameter
            )
            if near and not (here.slacks[self._can_change] < -self.touch).any():
                turn = here.motion / np.sqrt(np.sum(here.motion**2)) if cause == TURN else None
                return self._arrival(here, cause, pair, turn)
            upper = np.inf if beyond is None else beyond.t
            if abs((upper - last.t) * last.strain_rate) <= STRAIN_TOLERANCE:
                return self._arrival(last, CONTACT, self._worst(beyond))
            t, origin = min(here.t + dt, last.t + longest), here
            if not last.t < t < upper:
                t, origin = 0.5 * (last.t + min(upper, last.t + longest)), last
            new = self._trial(origin, t, mode)
            if isinstance(new, BranchState) and not self._grazes(last, new):
                if self._is_violated(new, mode):
                    beyond = here = new
                else:
                    previous, last, here, longest = last, new, new, 2.0 * longest
                    if mode is not None and np.sum(new.motion**2) > MAX_SKEW**2:
                        mode, last, longest = self._along_mode(last, longest)
                        previous, beyond, here = None, None, last
                continue
            if cause == CONTACT and here is last and last.slacks[pair] <= self.touch:
                return self._arrival(last, CONTACT, pair)
            longest, beyond, here = SHRINK * (t - last.t), None, last
            if new == STALE:
                if last is not start:
                    return self._arrival(last, STALE)
            elif mode is None and np.abs(last.motion).max() < MIN_SPEED * self.diameter:
                return self._bisect(last, last.shear + self.direction * (t - last.t))
            elif mode is None:
                mode, last, longest = self._along_mode(last, longest)
                previous, here = None, last
            if longest < MIN_STEP * self.diameter:
                break
        return self._arrival(last, LOST)

    def _arrival(self, state, cause, pair=-1, mode=None) -> Arrival:
        """An arrival, with all moves since the start."""
        return Arrival(replace(state, moved=state.moved + self._passed), cause, pair, mode)

    @property
    def _can_change(self):
        """(M,) pairs that open or close at overlap 0; others leave where their rates change sign."""
        return self.branch.active != WEIGHTLESS

    def _worst(self, state) -> int:
        """The pair that is farthest past its change."""
        past = np.where(self._can_change, state.slacks, np.minimum(state.slack_rates, 0.0) * self.diameter)
        return int(np.argmin(past))

    def _along_mode(self, state, length):
        """(mode, the same state with s = mode · moved as parameter, length in it)."""
        branch, self._passed = self.branch, self._passed + state.moved
        mode = np.where(branch.loose[:, None], 0.0, state.motion)
        speed = float(np.sqrt(np.sum(mode * mode)))
        return (
            mode / speed,
            replace(
                state,
                t=0.0,
                moved=np.zeros_like(state.moved),
                motion=state.motion / speed,
                strain_rate=state.strain_rate / speed,
                slack_rates=state.slack_rates / speed,
            ),
            length * speed,
        )

    def _first_root(self, here, other, mode):
        """(dt, cause, pair) of the first root that is predicted from `here`; other: an earlier or later point."""
        rates, limit = here.slack_rates, rate_limit(here.motion, here.strain_rate, self.diameter)
        ahead = self.direction * (self.goal - here.shear)
        speed = self.direction * here.strain_rate
        best = (ahead / speed, TARGET, -1) if speed > 0.0 or ahead < 0.0 else (np.inf, TARGET, -1)
        moving = np.flatnonzero((rates < -limit) & self._can_change)
        if len(moving):
            times = -here.slacks[moving] / rates[moving]
            first = int(np.argmin(times))
            if times[first] < best[0]:
                best = float(times[first]), CONTACT, int(moving[first])
        if other is None:
            return best
        weightless = np.flatnonzero(~self._can_change & (rates < -2.0 * limit))
        if len(weightless):  # which leave where their rates change sign, at an earlier point
            slopes = (rates - other.slack_rates)[weightless] / (here.t - other.t)
            times = -(rates[weightless] + limit) / slopes
            if times.min() < best[0]:
                best = float(times.min()), CONTACT, int(weightless[np.argmin(times)])
        if mode is not None:
            slope = (here.strain_rate - other.strain_rate) / (here.t - other.t)
            if self.direction * slope < 0.0 and -here.strain_rate / slope < best[0]:
                best = -here.strain_rate / slope, TURN, -1
        return best

    def _is_violated(self, state, mode) -> bool:
        changing, limit = self._can_change, rate_limit(state.motion, state.strain_rate, self.diameter)
        past = self.direction * (state.shear - self.goal)
        slacks, rates = state.slacks[changing], state.slack_rates[changing]
        crossed = (rates < -limit) & (slacks * abs(state.strain_rate) < STRAIN_TOLERANCE * rates)
        return bool(
            past > STRAIN_TOLERANCE
            or (mode is not None and self.direction * state.strain_rate < 0.0)
            or crossed.any()
            or (slacks < -self.touch).any()
            or (state.slack_rates[~changing] < -2.0 * limit).any()
        )

    def _grazes(self, last, new) -> bool:
        """Whether a pair may have changed and changed back between two states."""
        before, after = last.slack_rates, new.slack_rates
        back = (before < 0.0) & (after > 0.0) & self._can_change & (new.slacks > 0.0)
        turn = before[back] ** 2 * (new.t - last.t) / (2.0 * (after[back] - before[back]))
        return bool((last.slacks[back] - turn < -self.touch).any())

    def _trial(self, start, t, mode):
        """The state at t, from another one; STALE where the list ends, None where the branch may be left."""
        dt, branch = t - start.t, self.branch
        result = branch.advance(start, dt, mode, MIN_STEP * self.diameter)
        if result is None:
            return None
        offsets, shear, moved, correction = result
        if self.stale(offsets, shear):
            return STALE
        if mode is None and abs(dt) <= SAME_TANGENT * start.span:
            return branch.state(
                t, offsets, shear, moved, (start.motion, start.strain_rate), start.span, start.slack_rates
            )
        predicted = abs(dt) * float(np.abs(start.motion[~branch.loose]).max(initial=0.0))
        if correction > MAX_CORRECTION * predicted + NOISE * self.diameter:
            return None
        tangent = self._tangent(mode)
        if tangent is None:
            return None
        new = branch.state(t, offsets, shear, moved, tangent, abs(dt))
        return new if self._is_smooth(start, new) else None

    def _is_smooth(self, start, new) -> bool:
        """Whether overlaps have changed as their rates at both ends say: else the branch is another one."""
        smooth = ~self.branch.begun if start.t == 0.0 else slice(None)
        dt, before, after = new.t - start.t, start.slack_rates[smooth], new.slack_rates[smooth]
        off = np.abs(new.slacks[smooth] - start.slacks[smooth] - 0.5 * dt * (before + after)).max(initial=0.0)
        largest = max(np.abs(before).max(initial=0.0), np.abs(after).max(initial=0.0))
        return bool(off <= MAX_JUMP * abs(dt) * largest + NOISE * self.diameter)

    def _tangent(self, mode):
        motion, rate = self.branch.tangent(mode)
        if motion is None:
            return None
        return (motion, rate) if mode is not None else (self.direction * motion, self.direction)

    def _is_definite(self, state) -> bool:
        self.branch.evaluate(state.offsets, state.shear)
        return self.branch.factorise()

    def _bisect(self, lower, high) -> Arrival:
        """To where K becomes singular after a state, before a strain, though the branch does not turn: in crystals.

        Where all states are definite that Newton's method reaches, the last of them.
        """
        low, high = 0.0, self.direction * (high - lower.shear)
        start = replace(lower, t=0.0, moved=np.zeros_like(lower.moved))
        self._passed = self._passed + lower.moved
        lower, cause = start, STALE
        for _ in range(MAX_BISECTIONS):
            middle = self._trial(start, 0.5 * (low + high), None)
            is_state = isinstance(middle, BranchState)
            if is_state and self._is_definite(middle):
                lower, low = middle, middle.t
            else:
                high = 0.5 * (low + high)
                cause = SYMMETRY if is_state else cause
            if high - low <= STRAIN_TOLERANCE:
                break
        return self._arrival(lower, cause)
