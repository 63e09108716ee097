"""Time steps of moving contacts whose length follows the error of their energy balance.

A step that fails, or whose energy balance is wrong by too much, is halved. Work is stored or dissipated. With the
weights b_i of the two stages, at whose ends forces balance, the error of the energy balance of a step of length Δt is

    ε = Δt Σ_i b_i (σ_i V γ̇_i − P_i) − ΔU ,

the error of a quadrature of U̇, of third order in Δt; where disks rearrange suddenly within a long step it is the
energy that they dissipate. It costs nothing to compute, and a step is accepted if it is below a limit. Steps have the
length of an interval over a power of two, so that one factor serves for many steps.
"""

from collections.abc import Callable, Iterator

from jampetsc.errors import ConvergenceError, named
from jampetsc.oscillation.drive import Imposed
from jampetsc.oscillation.moving_contacts import MovingContacts
from jampetsc.oscillation.time_step import STAGE, WEIGHTS, StageEnd

# ends of the stages in a step, and their weights
TWO_STAGES, ONE_STAGE = ((STAGE, 1.0), WEIGHTS), ((1.0,), (1.0,))
MAX_HALVINGS = 30  # of a step; no motion of a contact is so sudden
# A step of this many halvings is short. After MAX_SHORT_STEPS of them short steps have one stage: the second stage of a
# disk that jumps, as one that rolls freely, would begin far beyond the contact that stops it.
MIN_SHORT_HALVINGS, MAX_SHORT_STEPS = 10, 32
# of the allowed error: after a step with less the next is twice as long, with 8 times the error
STEP_GROWTH_RATIO = 0.1
# Accepted steps before the next one is twice as long: twice as many after each that was too long, at most
MAX_WAIT = 32
MAX_ATTEMPTS = 4096  # steps of an interval, accepted or not

WeightedStage = tuple[float, float, StageEnd]  # time, weight in an integral over time, end of the stage


class AdaptiveSteps:
    """Steps of a motion under an imposed strain or stress.

    motion     what moves
    imposed    function of the time: its `drive.Imposed`
    accepted   number of accepted steps; of one that was halved, its parts
    """

    def __init__(self, motion: MovingContacts, imposed: Callable[[float], Imposed]):
        self.motion, self.imposed = motion, imposed
        self._halvings = 0  # of the current step length
        self._has_grown, self._since, self._wait = False, 0, 1  # the last step, and steps accepted since
        self.accepted = 0

    def over(
        self, begin: float, length: float, allowed: float, patience: int | None = None
    ) -> Iterator[list[WeightedStage]]:
        """Yield the stages of each step over an interval of time, with at most this error of energy.

        patience   number of steps after which the limit doubles, again and again: disks that slide along the border of
                   a contact jump by as much in every step, however short it is; None: it never does

        Raises ConvergenceError if the shortest steps fail, and after MAX_ATTEMPTS.
        """
        passed, total, short_steps, count = 0, 1 << MAX_HALVINGS, 0, 0
        for _ in range(MAX_ATTEMPTS):
            part, is_short = total >> self._halvings, self._halvings >= MIN_SHORT_HALVINGS
            scheme = ONE_STAGE if is_short and short_steps > MAX_SHORT_STEPS else TWO_STAGES
            stages, error = self._step(
                begin + length * (passed / total), length * (part / total), allowed, scheme
            )
            if error > allowed:
                self._shorten()
                continue
            yield stages
            count += 1
            if patience and count % patience == 0:
                allowed *= 2.0
            passed, self.accepted, short_steps = passed + part, self.accepted + 1, short_steps + is_short
            self._lengthen(error < STEP_GROWTH_RATIO * allowed and passed % (2 * part) == 0)
            if passed == total:
                return
        raise ConvergenceError(
            f"more than {MAX_ATTEMPTS} parts of a time step, as where the packing is not rigid. Give a denser packing."
        )

    def _shorten(self):
        """Halve the next step."""
        if self._has_grown:
            self._wait = min(2 * self._wait, MAX_WAIT)
        self._halvings, self._has_grown, self._since = self._halvings + 1, False, 0

    def _lengthen(self, may_grow):
        """Double the next step if it may, and enough were accepted."""
        if self._has_grown:
            self._wait = max(1, self._wait // 2)
        self._since += 1
        self._has_grown = bool(self._halvings and may_grow and self._since >= self._wait)
        if self._has_grown:
            self._halvings, self._since = self._halvings - 1, 0

    def _step(self, begin, length, allowed, scheme) -> tuple[list[WeightedStage], float]:
        """The stages of a step and its error of energy.

        That is infinite if the step fails; a step with more than `allowed` is undone.
        """
        motion, last = self.motion, self._halvings == MAX_HALVINGS
        parts, weights = scheme
        motion.set_length(length, parts[0])
        times = [begin + part * length for part in parts]
        imposed = [self.imposed(time) for time in times]
        try:
            ends = motion.advance(imposed)
        except ConvergenceError:
            if last:
                raise
            return [], float("inf")
        stages = [
            (time, weight * length, end) for time, weight, end in zip(times, weights, ends, strict=True)
        ]
        fed = sum(weight * (motion.volume * end.stress * end.rate - end.power) for _, weight, end in stages)
        error = max(abs(fed - motion.gained) - motion.rounding, 0.0)
        if error > allowed:
            if last:
                remedy = f"less {named('stress')}" if imposed[-1].free else f"more {named('steps')}"
                raise ConvergenceError(
                    f"energy error of the shortest step {error / allowed:.1e} times the tolerance, as where "
                    f"the packing is not rigid. Give {remedy}."
                )
            motion.undo()
        return stages, error
