"""Cycles of imposed strain or stress with moving contacts, until they repeat or their mean is known.

The drive is ∝ sin ωt and begins at the steady oscillation with fixed contacts, or where an oscillation of another
amplitude has ended. Time is in units of 1/ω, since with small exponents ω may be any power of ten. Under stress the
strain may creep from cycle to cycle; that ramp is removed before harmonics are computed. Work is ∮σdγ of drive and
response, so πG''γ₁².

Steps adapt, see `adaptive_steps`. Harmonics are integrals by their quadrature, so where the strain is imposed the error
of a cycle is the sum of the errors of its steps.

There are two runs, the first with half of the steps; the second starts where the first ended. Where cycles repeat, the
difference of the runs estimates the error of the steps, and the changes of the last cycles that of ending after
finitely many. Where the second repeats but the first still settled, one more with half of the steps takes its place,
from where the second ended. Where cycles fluctuate, the first run is part of the transient; the error is the standard
error of the mean over the cycles of the second and, independent of it, the energy that its steps lose: the root of the
sum of their squares (see `analysis.cycle_series`).
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.analysis.cycle_series import CycleMean, fluctuation_error, fluctuation_mean, remaining_change
from jampetsc.errors import ConvergenceError, named
from jampetsc.laws.damping import Law
from jampetsc.oscillation.adaptive_steps import AdaptiveSteps
from jampetsc.oscillation.drive import Moduli, OscillationResult
from jampetsc.oscillation.moving_contacts import MovingContacts
from jampetsc.oscillation.oscillation_start import Start
from jampetsc.packing.packing import Packing

CYCLE_TOLERANCE = 1e-3  # of |G*|: estimated change by later cycles below which cycles count as repeating
# of G' and of G'', where cycles fluctuate; of |G*| for a part that is far smaller than the other
MEAN_TOLERANCE, SMALL_PART_TOLERANCE = 0.05, 0.01
MAX_REPEATED_CYCLES = 120
MAX_COARSE_CYCLES = 6  # with half of the steps; the second run has the rest of a transient
START_STEPS = 16  # steps of the cycle with fixed contacts; linear damping is exact with any number
ENERGY_TOLERANCE = 8.0  # of the energy balance of a step, times steps³, in units of π|G*|γ₁² of the cell
# of forces in a time step, times steps², as in `time_step`: a residual disturbs G* by far less than the steps do
FORCE_TOLERANCE = 1e-2
PERIOD = 2.0 * np.pi
MAX_STRAIN_DRIFT = 1.0  # of a cycle; a packing whose strain changes by more flows


def repeat_cycles(
    disks: Packing, law: Law, start: Start, steps: int, cycles: int | None
) -> tuple[OscillationResult, Start, Packing]:
    """G* of the oscillation that begins at `start`, with `steps` steps per cycle, where it ended, and the disks there.

    disks    at the strain `start.reference`
    cycles   number of cycles of each run; None: until they repeat, or fluctuate about a mean that is known

    Raises ConvergenceError if a step is too long, the packing flows, or MAX_REPEATED_CYCLES still have a trend.
    """
    start = start.near(disks)
    coarse = Cycles(disks, law, start, steps // 2)
    coarse.repeat(cycles, accurate=False)
    fine = Cycles(coarse.motion.disks, law, coarse.final, steps)
    fine.repeat(cycles)
    runs, compared = [coarse, fine], coarse
    if cycles is None and fine.repeats and not coarse.repeats:
        compared = Cycles(fine.motion.disks, law, fine.final, steps // 2)
        compared.repeat(None, accurate=False)
        runs.append(compared)
    averaged = fine.averaged
    harmonics = np.array([cycle.moduli.harmonics for cycle in averaged])
    G, balance = complex(np.mean([cycle.G for cycle in averaged])), energy_balance(averaged)
    if fine.mean is None or fine.repeats:
        of_steps, rest = G - compared.finished[-1].G, min(fine.remaining, fine.spread)
        error = abs(of_steps) + rest
        harmonics_error = abs(harmonics[-1] - compared.finished[-1].moduli.harmonics)
        G_error = complex(abs(of_steps.real) + rest, abs(of_steps.imag) + rest)
    else:
        G_error = fine.mean_errors
        error = abs(G_error)
        harmonics_error = np.abs([fluctuation_error(values) for values in harmonics.T])
    strain, stress = np.mean([cycle.waveform for cycle in averaged], axis=0)
    result = OscillationResult(
        G=G,
        error=error,
        G_error=G_error,
        harmonics=harmonics.mean(axis=0),
        harmonics_error=harmonics_error,
        work=float(np.mean([cycle.moduli.work for cycle in averaged])),
        energy_balance=balance,
        repeats=fine.repeats,
        averaged_cycles=len(averaged),
        strain_waveform=strain,
        stress_waveform=stress,
        cycle_change=fine.change,
        drift=averaged[-1].drift,
        cycles=sum(len(run.finished) for run in runs),
        steps_taken=sum(run.steps.accepted for run in runs),
        factorisations=sum(run.motion.matrix.factorisations for run in runs),
        newton_steps=sum(run.motion.stages.iterations for run in runs),
    )
    return result, fine.final, fine.motion.disks


def is_accurate(G, errors):
    """Whether the errors of G′ and G″, parts of complex `errors`, are within MEAN_TOLERANCE; of arrays, each."""
    G, errors = np.asarray(G), np.asarray(errors)
    least = SMALL_PART_TOLERANCE * abs(G)
    return (errors.real <= np.maximum(MEAN_TOLERANCE * abs(G.real), least)) & (
        errors.imag <= np.maximum(MEAN_TOLERANCE * abs(G.imag), least)
    )


def energy_balance(cycles) -> float:
    """Energy that these `CycleResult`s have consumed over their work, less 1."""
    return sum(cycle.consumed for cycle in cycles) / sum(cycle.moduli.work for cycle in cycles) - 1.0


@dataclass(frozen=True)
class CycleResult:
    """One cycle."""

    moduli: Moduli
    consumed: float  # energy per volume, dissipated and stored
    drift: float  # change of the strain
    waveform: np.ndarray | None = None  # (2, times) strain and stress, see `Drive.waveform`

    @property
    def G(self) -> complex:
        return self.moduli.G


class Cycles:
    """Cycles, each of a number of steps, of a packing from a start.

    finished   the `CycleResult` of each
    """

    def __init__(self, disks, law, start, steps):
        drive = start.drive
        unit = float(disks.potential.k) if drive.stress_controlled else 1.0
        self.count, self._start = steps, start
        self.drive = replace(drive, omega=1.0, amplitude=unit * drive.amplitude)
        scaled = replace(law, tau1=drive.omega * law.tau1)
        self.motion = MovingContacts(
            disks, scaled, PERIOD / steps, start.strain, start.speed, start.reference,
            tolerance=FORCE_TOLERANCE / steps**2,
        )  # fmt: skip
        self.motion.displace(start.displacement, start.velocity, start.gamma, start.rate)
        self.steps = AdaptiveSteps(self.motion, self.drive.at)
        self._lost = ENERGY_TOLERANCE / steps**3 * np.pi * self.motion.volume  # over |G*|γ₁²
        self._stored = start.modulus * start.strain**2  # |G*|γ₁² of the last cycle
        self.finished = []

    def repeat(self, cycles, accurate=True):
        """Run this number of cycles or, for None, until they repeat or fluctuate.

        accurate   whether they continue until they repeat or the error of their mean is within MEAN_TOLERANCE; else
                   there are at most MAX_COARSE_CYCLES

        Raises ConvergenceError if accurate cycles still have a trend, and as `run_cycle`.
        """
        limit = cycles or (MAX_REPEATED_CYCLES if accurate else MAX_COARSE_CYCLES)
        while len(self.finished) < limit:
            self.run_cycle()
            if cycles is None and (self.repeats or (accurate and self._has_known_mean)):
                return
        if cycles is None and accurate and self.mean is None:
            raise ConvergenceError(
                f"G* does not repeat: the last of {MAX_REPEATED_CYCLES} cycles changes it by "
                f"{100 * self.change / abs(self.finished[-1].G):.2g} %. Give {named('cycles')} "
                f"{MAX_REPEATED_CYCLES} to keep its value."
            )

    @property
    def repeats(self) -> bool:
        """Whether later cycles would hardly change G*."""
        return bool(self.remaining <= CYCLE_TOLERANCE * abs(self.finished[-1].G))

    @property
    def mean(self) -> CycleMean | None:
        """The mean of G* where cycles fluctuate."""
        return fluctuation_mean([cycle.G for cycle in self.finished])

    @property
    def mean_errors(self) -> complex:
        """Errors of G′ and of G″ of `mean`, also by the energy that steps lose, as parts of a complex number."""
        mean = self.mean
        lost = energy_balance(self.finished[mean.transient :]) * mean.value
        return complex(np.hypot(mean.errors.real, lost.real), np.hypot(mean.errors.imag, lost.imag))

    @property
    def _has_known_mean(self) -> bool:
        mean = self.mean
        return mean is not None and bool(is_accurate(mean.value, self.mean_errors))

    @property
    def averaged(self) -> list[CycleResult]:
        """The cycles whose mean is the result: the last one or, where they fluctuate, those after the transient."""
        mean = None if self.repeats else self.mean
        return self.finished[-1:] if mean is None else self.finished[mean.transient :]

    @property
    def final(self) -> Start:
        """The start of another oscillation of the same drive, with the disks of `motion` as they are now."""
        motion, still = self.motion, np.zeros_like(self.motion.offsets)
        last = self.finished[-1].moduli
        return replace(
            self._start, displacement=still, velocity=motion.velocities, gamma=motion.gamma, rate=motion.rate,
            strain=last.strain, modulus=abs(last.G), reference=motion.gamma,
        )  # fmt: skip

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
        times, ramp = times / PERIOD, drift if free else 0.0
        moduli = self.drive.moduli(response, times, weights / PERIOD, ramp)
        self._stored = abs(moduli.G) * moduli.strain**2
        waveform = self.drive.waveform(response, times, ramp)
        self.finished.append(CycleResult(moduli, consumed / motion.volume, drift, waveform))
