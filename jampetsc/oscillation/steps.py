"""Time steps of adaptive length: one that fails, or whose energy balance is wrong by too much, is halved.

Work is stored or dissipated. With the weights b_i of the two stages, at whose ends forces balance, the error of the
energy balance of a step of length Δt is

    ε = Δt Σ_i b_i (σ_i V γ̇_i − P_i) − ΔU ,

the error of a quadrature of U̇, of third order in Δt; where disks rearrange suddenly within a long step it is the
energy that they dissipate. It costs nothing to compute, and a step is accepted if it is below a limit. Steps have the
length of a step of the cycle over a power of two, so that one factor serves for many steps.
"""

from collections.abc import Callable
from dataclasses import dataclass

from jampetsc.errors import ConvergenceError, named
from jampetsc.oscillation.moving import MovingContacts
from jampetsc.oscillation.response import Imposed
from jampetsc.oscillation.stage import STAGE, WEIGHTS, StageEnd

FINEST = 30  # most halvings of a step; no motion of a contact is so sudden
ROOM = 0.1  # of the allowed error: after a step with less the next is twice as long, with 8 times the error


@dataclass(frozen=True)
class Step:
    """A step that was made."""

    begin: float  # time
    length: float
    ends: list[StageEnd]

    def stages(self):
        """(time, weight in an integral over time, StageEnd) of each stage."""
        for part, weight, end in zip((STAGE, 1.0), WEIGHTS, self.ends, strict=True):
            yield self.begin + part * self.length, weight * self.length, end


class Steps:
    """Steps of one motion.

    imposed: the function time → Imposed
    taken: number of accepted steps
    """

    def __init__(self, motion: MovingContacts, imposed: Callable[[float], Imposed]):
        self._motion, self._imposed = motion, imposed
        self._halvings = 0  # of the current step length
        self.taken = 0

    def over(self, begin: float, length: float, allowed: float):
        """Yield the Steps over a time, each with at most this error of energy. Raises ConvergenceError if they fail."""
        done, whole = 0, 1 << FINEST
        while done < whole:
            part = whole >> self._halvings
            step = Step(begin + length * (done / whole), length * (part / whole), [])
            off = self._take(step, allowed)
            if off > allowed:
                self._halvings += 1
                continue
            yield step
            done, self.taken = done + part, self.taken + 1
            if self._halvings and off < ROOM * allowed and done % (2 * part) == 0:
                self._halvings -= 1

    def _take(self, step, allowed) -> float:
        """Error of the energy balance, infinite if the step fails; a step with more than `allowed` is undone."""
        motion, last = self._motion, self._halvings == FINEST
        motion.set_length(step.length)
        imposed = [self._imposed(step.begin + part * step.length) for part in (STAGE, 1.0)]
        try:
            step.ends.extend(motion.advance(imposed))
        except ConvergenceError:
            if last:
                raise
            return float("inf")
        fed = sum(
            weight * (motion.area * one.stress * one.rate - one.power) for _, weight, one in step.stages()
        )
        off = max(abs(fed - motion.gained) - motion.rounding, 0.0)
        if off > allowed:
            if last:
                remedy = f"less {named('stress')}" if imposed[-1].free else f"more {named('steps')}"
                raise ConvergenceError(
                    f"energy is lost in the shortest step of a cycle, {off / allowed:.1e} times what one may, as where "
                    f"nothing holds the packing: give {remedy}"
                )
            motion.undo()
        return off
