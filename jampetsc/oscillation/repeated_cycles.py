"""Cycles of imposed strain or stress with moving contacts, until G* does not change any more from cycle to cycle.

The drive is ∝ sin ωt and begins at the steady oscillation with fixed contacts. Time is in units of 1/ω, since with
small exponents ω may be any power of ten. Under stress the strain may creep from cycle to cycle; that ramp is removed
before harmonics are computed. Work is ∮σdγ of drive and response, so πG''γ₁².

Steps adapt, see `adaptive_steps`. Harmonics are integrals by their quadrature, so where the strain is imposed the error
of a cycle is the sum of the errors of its steps.

There are two runs, the first with half of the steps; the second starts where the first ended. Their difference
estimates the error of the steps, and the changes of the last cycles, continued as a geometric series, the error of
ending after finitely many cycles.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import ConvergenceError, named
from jampetsc.laws.damping import Law
from jampetsc.oscillation.adaptive_steps import AdaptiveSteps
from jampetsc.oscillation.drive import Moduli, OscillationResult
from jampetsc.oscillation.moving_contacts import MovingContacts
from jampetsc.oscillation.oscillation_start import Start
from jampetsc.packing.packing import Packing

CYCLE_TOLERANCE = 1e-3  # of |G*|: estimated change by later cycles below which cycles count as repeating
ROUNDING_TOLERANCE = 1e-7  # of |G*|: a change this small is rounding
MAX_REPEATED_CYCLES = 60
START_STEPS = 16  # steps of the cycle with fixed contacts; linear damping is exact with any number
ENERGY_TOLERANCE = 8.0  # of the energy balance of a step, times steps³, in units of π|G*|γ₁² of the cell
PERIOD = 2.0 * np.pi
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
        steps_taken=sum(run.steps.accepted for run in runs),
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
    steps      its `AdaptiveSteps`
    """

    def __init__(self, disks, law, start, steps, gamma=0.0):
        drive = start.drive
        unit = float(disks.potential.k) if drive.stress_controlled else 1.0
        self.count, self.drive = steps, replace(drive, omega=1.0, amplitude=unit * drive.amplitude)
        scaled = replace(law, tau1=drive.omega * law.tau1)
        self.motion = MovingContacts(disks, scaled, PERIOD / steps, start.strain, start.speed, gamma)
        self.steps = AdaptiveSteps(self.motion, self.drive.at)
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
            for stages in self.steps.over(n * step, step, self._lost * self._stored):
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
