"""Cycles of imposed strain or stress with moving contacts, until G* does not change any more from cycle to cycle.

The drive is ∝ sin ωt and begins at the steady oscillation with fixed contacts. Time is in units of 1/ω, since with
small exponents ω may be any power of ten. Under stress the strain may creep from cycle to cycle; that ramp is removed
before harmonics are computed. Work is ∮σdγ of drive and response, so πG''γ₁².

A step that fails, or whose energy balance is wrong by too much, is halved. Work is stored or dissipated. With the
weights b_i of the two stages, at whose ends forces balance, the error of the energy balance of a step of length Δt is

    ε = Δt Σ_i b_i (σ_i V γ̇_i − P_i) − ΔU ,

the error of a quadrature of U̇, of third order in Δt; where disks rearrange suddenly within a long step it is the
energy that they dissipate. It costs nothing to compute, and a step is accepted if it is below a limit. Steps have the
length of a step of the cycle over a power of two, so that one factor serves for many steps. Harmonics are integrals by
the same quadrature, so where the strain is imposed the error of a cycle is the sum of the errors of its steps.

There are two runs, the first with half of the steps; the second starts where the first ended. Their difference
estimates the error of the steps, and the changes of the last cycles, continued as a geometric series, the error of
ending after finitely many cycles.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import ConvergenceError, named
from jampetsc.laws.damping import Law
from jampetsc.oscillation.drive import Moduli, OscillationResult
from jampetsc.oscillation.moving_contacts import MovingContacts
from jampetsc.oscillation.oscillation_start import Start
from jampetsc.oscillation.time_step import STAGE, WEIGHTS
from jampetsc.packing.packing import Packing

CYCLE_TOLERANCE = 1e-3  # of |G*|: estimated change by later cycles below which cycles count as repeating
ROUNDING_TOLERANCE = 1e-7  # of |G*|: a change this small is rounding
MAX_REPEATED_CYCLES = 60
START_STEPS = 16  # steps of the cycle with fixed contacts; linear damping is exact with any number
ENERGY_TOLERANCE = 8.0  # of the energy balance of a step, times steps³, in units of π|G*|γ₁² of the cell
PERIOD = 2.0 * np.pi
# ends of the stages in a step, and their weights
TWO_STAGES, ONE_STAGE = ((STAGE, 1.0), WEIGHTS), ((1.0,), (1.0,))
MAX_HALVINGS = 30  # of a step; no motion of a contact is so sudden
# A step of this many halvings is short. After MAX_SHORT_STEPS of them short steps have one stage: the second stage of a
# disk that jumps, as one that rolls freely, would begin far beyond the contact that stops it.
MIN_SHORT_HALVINGS, MAX_SHORT_STEPS = 10, 32
# of the allowed error: after a step with less the next is twice as long, with 8 times the error
STEP_GROWTH_RATIO = 0.1
MAX_STRAIN_DRIFT = 1.0  # of a cycle; a packing whose strain changes by more flows


def repeat_cycles(
    disks: Packing, law: Law, start: Start, steps: int, cycles: int | None
) -> OscillationResult:
    """G* of the oscillation that begins at `start`, with `steps` steps per cycle.

    cycles   number of cycles of each run; None: until they repeat

    Raises ConvergenceError if a step is too long, the packing flows, or MAX_REPEATED_CYCLES do not repeat.
    """
    start = start.near(disks)
    runs, strain, initial = [], 0.0, (start.displacement, start.velocity, start.gamma, start.rate)
    for count in (steps // 2, steps):
        run = Cycles(disks, law, start, count, strain)
        runs.append(run)
        run.motion.displace(*initial)
        run.repeat(cycles)
        final = run.motion
        disks, strain = final.disks, final.gamma
        initial = 0.0 * final.offsets, final.velocities, final.gamma, final.rate
    coarse, fine = runs
    last = fine.finished[-1]
    return OscillationResult(
        G=last.G,
        error=abs(last.G - coarse.finished[-1].G) + min(fine.remaining, fine.spread),
        harmonics=last.moduli.harmonics,
        work=last.moduli.work,
        energy_balance=last.consumed / last.moduli.work - 1.0,
        cycle_change=fine.change,
        drift=last.drift,
        cycles=sum(len(run.finished) for run in runs),
        steps_taken=sum(run.accepted for run in runs),
        factorisations=sum(run.motion.matrix.factorisations for run in runs),
        newton_steps=sum(run.motion.stages.iterations for run in runs),
    )


@dataclass(frozen=True)
class CycleResult:
    """One cycle."""

    moduli: Moduli
    consumed: float  # energy per volume, dissipated and stored
    drift: float  # change of the strain

    @property
    def G(self) -> complex:
        return self.moduli.G


def remaining_change(G) -> float:
    """Estimate of how much later cycles would change the last of G (cycles,): a geometric series; inf if it grows."""
    change, previous = abs(np.diff(G[-3:]))[::-1] if len(G) > 2 else (np.inf, np.inf)
    if len(G) > 1 and abs(G[-1] - G[-2]) <= ROUNDING_TOLERANCE * abs(G[-1]):
        return float(abs(G[-1] - G[-2]))
    return float(change * max(1.0, change / (previous - change))) if change < previous else np.inf


class Cycles:
    """Cycles, each of a number of steps, of a packing at this strain.

    finished   the `CycleResult` of each
    accepted   number of accepted steps; of one that was halved, its parts
    """

    def __init__(self, disks, law, start, steps, gamma=0.0):
        drive = start.drive
        unit = float(disks.potential.k) if drive.stress_controlled else 1.0
        self.count, self.drive = steps, replace(drive, omega=1.0, amplitude=unit * drive.amplitude)
        scaled = replace(law, tau1=drive.omega * law.tau1)
        self.motion = MovingContacts(disks, scaled, PERIOD / steps, start.strain, start.speed, gamma)
        self._halvings = 0  # of the current step length
        self.accepted = 0
        self._lost = ENERGY_TOLERANCE / steps**3 * np.pi * self.motion.volume  # over |G*|γ₁²
        self._stored = start.modulus * start.strain**2  # |G*|γ₁² of the last cycle
        self.finished = []

    def repeat(self, cycles):
        """Run this number of cycles or, for None, until they repeat."""
        while len(self.finished) < (cycles or MAX_REPEATED_CYCLES):
            self.run_cycle()
            if cycles is None and self.remaining <= CYCLE_TOLERANCE * abs(self.finished[-1].G):
                return
        if cycles is None:
            raise ConvergenceError(
                f"G* does not repeat: the last of {MAX_REPEATED_CYCLES} cycles changes it by "
                f"{100 * self.change / abs(self.finished[-1].G):.2g} %. Give {named('cycles')} "
                f"{MAX_REPEATED_CYCLES} to keep its value."
            )

    @property
    def change(self) -> float:
        """|ΔG*| of the last two cycles."""
        return abs(self.finished[-1].G - self.finished[-2].G) if len(self.finished) > 1 else np.inf

    @property
    def remaining(self) -> float:
        """Estimate of how much later cycles would change G*."""
        return remaining_change([cycle.G for cycle in self.finished])

    @property
    def spread(self) -> float:
        """Largest |ΔG*| between the last cycle and any of the second half of all cycles."""
        return max(abs(cycle.G - self.finished[-1].G) for cycle in self.finished[len(self.finished) // 2 :])

    def run_cycle(self) -> None:
        """Run one more cycle. Raises ConvergenceError where it fails, or where the packing flows."""
        motion, initial, rows, consumed = self.motion, self.motion.gamma, [], 0.0
        step, free = PERIOD / self.count, self.drive.stress_controlled
        for n in range(self.count):
            # time within the cycle: rounding of a time over many periods would appear in the strain
            for stages in self.steps(n * step, step, self._lost * self._stored):
                for time, weight, end in stages:
                    rows.append((time, weight, end.gamma if free else end.stress))
                    consumed += weight * end.power
                consumed += motion.gained
            if not abs(motion.gamma - initial) < MAX_STRAIN_DRIFT + self.drive.amplitude:
                raise ConvergenceError(
                    f"packing: flows, its strain changes by {motion.gamma - initial:.2g} in a cycle. Give "
                    f"less {named('stress')}."
                )
        drift, (times, weights, response) = motion.gamma - initial, np.array(rows).T
        moduli = self.drive.moduli(response, times / PERIOD, weights / PERIOD, drift if free else 0.0)
        self._stored = abs(moduli.G) * moduli.strain**2
        self.finished.append(CycleResult(moduli, consumed / motion.volume, drift))

    def steps(self, begin: float, length: float, allowed: float):
        """Yield the stages of each step over a time, with at most this error of energy: see `_step`.

        Raises ConvergenceError if they fail.
        """
        passed, total, short_steps = 0, 1 << MAX_HALVINGS, 0
        while passed < total:
            part, is_short = total >> self._halvings, self._halvings >= MIN_SHORT_HALVINGS
            scheme = ONE_STAGE if is_short and short_steps > MAX_SHORT_STEPS else TWO_STAGES
            stages, error = self._step(
                begin + length * (passed / total), length * (part / total), allowed, scheme
            )
            if error > allowed:
                self._halvings += 1
                continue
            yield stages
            passed, self.accepted, short_steps = passed + part, self.accepted + 1, short_steps + is_short
            if self._halvings and error < STEP_GROWTH_RATIO * allowed and passed % (2 * part) == 0:
                self._halvings -= 1

    def _step(self, begin, length, allowed, scheme):
        """(time, weight in an integral over time, StageEnd) of the stages of a step, and its error of energy.

        That is infinite if the step fails; a step with more than `allowed` is undone.
        """
        motion, last = self.motion, self._halvings == MAX_HALVINGS
        parts, weights = scheme
        motion.set_length(length, parts[0])
        times = [begin + part * length for part in parts]
        imposed = [self.drive.at(time) for time in times]
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
                    f"energy error of the shortest step of a cycle {error / allowed:.1e} times the tolerance, as where "
                    f"the packing is not rigid. Give {remedy}."
                )
            motion.undo()
        return stages, error
