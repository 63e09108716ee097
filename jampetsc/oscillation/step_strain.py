"""A step strain: the cell is strained by γ at t = 0 and held, and the disks relax without inertia, contacts moving.

The strain rises within a ramp around t = 0 that is short against the times at which the stress is measured. Elastic
forces do next to nothing within it, so that dashpots and fluid alone decide where the disks go: along with the strain
where only the fluid damps them, otherwise as dissipates least. That is the instant of a step in linear response too,
where K u + B u̇ = −k γ − b γ̇. Afterwards γ̇ = 0, and

    G(t, γ) = [σ(t) − σ(0⁻)] / γ ,     U(0⁺) − U(t) = ∫ P dt ,

σ the elastic and viscous stress of the load, σ(0⁻) that of the packing at rest. The Dirac part of G(t), which is the
work of the ramp, is left out. A ramp of length ε makes G(t) its mean over ε about t, so wrong by ε² G̈/24.

Lengths of steps (`adaptive_steps`) follow the error of the energy balance, here relative to the energy
that the interval before has dissipated. There are two runs, the second with some half of the steps' lengths; their
difference estimates the error.
"""

import math
from dataclasses import dataclass, fields

import numpy as np

from jampetsc.errors import ConvergenceError, named
from jampetsc.laws.damping import Law
from jampetsc.laws.loads import Load
from jampetsc.oscillation.adaptive_steps import TWO_STAGES, AdaptiveSteps
from jampetsc.oscillation.drive import Imposed
from jampetsc.oscillation.moving_contacts import MovingContacts
from jampetsc.packing.contacts import find_contacts, pair_keys
from jampetsc.packing.packing import Packing

RAMP_RATIO = 1e-2  # of the first time: the length of the ramp
INTERVALS_PER_DECADE = 10  # of time, in each of which the error of a step has one limit
FINER = 2.0  # how much shorter the steps of the second run are, or more
ENERGY_ORDER = 3  # of the error of the energy of a step, in its length
MIN_DISSIPATED_RATIO = (
    1e-6  # of the energy of the step: least dissipation that limits of errors are relative to
)
# Of the longest move of a disk in a step of Newton's method: affine move of a diameter in a step of the ramp. More, and
# shorter, steps than MAX_RAMP_STEPS would follow contacts that open and close all the time while nothing but dashpots
# decides: disks that slide out of a contact move freely back into it.
MAX_RAMP_MOVE = 0.03
MAX_RAMP_STEPS = 64
MAX_RAMP_DOUBLINGS = 5  # of the number of steps, where one fails
# At rest: of the energy of the step, P t, what is dissipated while t doubles; and of the first forces, those left.
REST_POWER_RATIO, REST_FORCE_RATIO = 1e-12, 1e-3
PATIENCE = 64  # steps of an interval until errors may be larger
NOISE_FORCES = 10.0  # tolerances of a time step: forces that count as none


@dataclass(frozen=True, kw_only=True, eq=False)
class StepStrainResult:
    """The response to one step strain, named as the datasets of the file. T times, until it is at rest.

    Stresses and energies are in the unit of k, of spheres over that of length, energies per volume before the step.
    """

    G: np.ndarray  # (T,)
    error: np.ndarray  # (T,) estimate of |ΔG|
    energy: np.ndarray  # (T,) U(t) − U(0⁻)
    dissipated: np.ndarray  # (T,) since 0⁺
    contacts_opened: np.ndarray  # (T,) contacts of the packing at rest that do not touch
    contacts_closed: np.ndarray  # (T,) contacts that it did not have
    initial_G: float  # G(0⁺)
    initial_energy: float  # U(0⁺) − U(0⁻)
    rest_stress: float  # σ(0⁻)
    relaxed_time: float  # from which forces are balanced; nan: not within the times
    steps_taken: int  # of both runs
    newton_steps: int
    factorisations: int
    final: Packing  # the disks at the last time

    def record(self) -> dict:
        """{dataset: value} for the file, lists and numbers."""
        values = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "final"}
        return {name: value.tolist() if np.ndim(value) else value for name, value in values.items()}


def step_strain(
    disks: Packing, law: Law, load: Load, strain: float, times, accuracy: float
) -> StepStrainResult:
    """The relaxation of a packing at rest after a step strain 1 + γE.

    load      E, zero below its diagonal
    times     (T,) increasing, at which G is measured
    accuracy  relative error of the energy that steps may have

    Raises ConvergenceError if the shortest steps fail.
    """
    runs = [_Relaxation(disks, law, load, strain, times, accuracy, finer) for finer in (1.0, FINER)]
    for run in runs:
        run.relax()
    count = max(len(run.rows) for run in runs)
    other, rows = (run.filled(count) for run in runs)
    fine = runs[-1]
    G, energy, dissipated, opened, closed = rows.T
    return StepStrainResult(
        G=G,
        error=abs(G - other[:, 0]),
        energy=energy,
        dissipated=dissipated,
        contacts_opened=opened.astype(int),
        contacts_closed=closed.astype(int),
        initial_G=fine.initial[0],
        initial_energy=fine.initial[1],
        rest_stress=fine.rest_stress,
        relaxed_time=fine.relaxed_time,
        steps_taken=sum(run.accepted for run in runs),
        newton_steps=sum(run.motion.stages.iterations for run in runs),
        factorisations=sum(run.motion.matrix.factorisations for run in runs),
        final=fine.motion.disks,
    )


class _Relaxation:
    """One run. `rows`: [(G, U − U(0⁻), dissipated since 0⁺, contacts opened, closed)] at the times so far."""

    def __init__(self, disks, law, load, strain, times, accuracy, finer):
        self._start = disks, law, load
        self._strain, self._times, self._finer = strain, np.asarray(times, float), finer
        self._tolerance = accuracy / finer**ENERGY_ORDER
        self._contacts = pair_keys(find_contacts(disks), disks.n)
        self._energy = self._dissipated = self._time = 0.0
        self.rows, self.accepted, self.relaxed_time = [], 0, float("nan")

    def relax(self):
        """The ramp, and the relaxation until the disks are at rest or the times end."""
        try:
            self._ramp()
            self._hold()
        except ConvergenceError as error:
            raise ConvergenceError(
                f"time steps after t = {self._time:.3g}: too many, or too short. Give a smaller {named('strain')}."
            ) from error

    def filled(self, count):
        """Rows (count, 5); what is missing repeats the last one, of disks at rest."""
        return np.array(self.rows + self.rows[-1:] * (count - len(self.rows)))

    def _ramp(self):
        """Strain the cell within a time so short that elastic forces do next to nothing."""
        disks, law, load = self._start
        motion = MovingContacts(disks, law, RAMP_RATIO * self._times[0], self._strain, load=load)
        moved = self._strain * motion.diameter / (MAX_RAMP_MOVE * motion.reach)
        count = round(self._finer * min(math.ceil(moved), MAX_RAMP_STEPS))
        for doublings in range(MAX_RAMP_DOUBLINGS + 1):
            try:
                return self._strain_within(motion.step, count << doublings)
            except ConvergenceError:
                if doublings == MAX_RAMP_DOUBLINGS:
                    raise

    def _strain_within(self, length, count):
        """Strain the cell at rest in this number of steps within a time."""
        disks, law, load = self._start
        motion = self.motion = MovingContacts(disks, law, length / count, self._strain, load=load)
        self.rest_stress, self._energy = self._elastic_stress(), 0.0
        rate = self._strain / length
        for n in range(count):
            motion.advance([Imposed(self._strain * (n + part) / count, rate) for part in TWO_STAGES[0]])
            self._energy += motion.gained
        self._step_energy = (
            0.5 * motion.volume * self._strain * abs(self._elastic_stress() - self.rest_stress)
        )
        motion.displace(0.0, 0.0 * motion.velocities, motion.gamma, 0.0)  # its velocities were the ramp's

    def _hold(self):
        """From the middle of the ramp on, which is t = 0: first as far as the ramp was long, for G(0⁺)."""
        motion, length, step_energy = self.motion, RAMP_RATIO * self._times[0], self._step_energy
        steps = AdaptiveSteps(motion, lambda t: Imposed(self._strain, 0.0))
        first_force, initial_energy = self._largest_force(), self._energy / motion.volume
        self._time, spent = 0.5 * length, step_energy
        for end in (length, *_ends(length, self._times, self._finer > 1.0)):
            before = self._dissipated
            allowed = self._tolerance * max(spent, MIN_DISSIPATED_RATIO * step_energy)
            last = self._follow(steps, end, allowed)
            spent = self._dissipated - before
            if end == length:
                self.initial = (last.stress - self.rest_stress) / self._strain, initial_energy
                continue
            few = max(REST_FORCE_RATIO * first_force, NOISE_FORCES * motion.stages.tolerance)
            is_at_rest = last.power * end <= REST_POWER_RATIO * step_energy and self._largest_force() <= few
            if is_at_rest or end in self._times:
                self._measure(last.stress)
            if is_at_rest:
                self.relaxed_time = float(end)
                break
        self.accepted += steps.accepted

    def _follow(self, steps, end, allowed):
        """The `StageEnd` after steps until this time, whose energies are counted.

        Raises ConvergenceError for too many steps.
        """
        for stages in steps.over(self._time, end - self._time, allowed, PATIENCE):
            self._energy += self.motion.gained
            self._dissipated += sum(weight * stage.power for _, weight, stage in stages)
        self._time = end
        return stages[-1][2]

    def _measure(self, stress):
        motion = self.motion
        now = pair_keys(find_contacts(motion.disks), motion.n)
        opened = len(np.setdiff1d(self._contacts, now))
        closed = len(np.setdiff1d(now, self._contacts))
        energies = self._energy / motion.volume, self._dissipated / motion.volume
        self.rows.append(((stress - self.rest_stress) / self._strain, *energies, opened, closed))

    def _elastic_stress(self) -> float:
        return self.motion.forces(self.motion.state)[1] / self.motion.volume

    def _largest_force(self) -> float:
        return float(np.abs(self.motion.forces(self.motion.state)[0]).max())


def _ends(begin, times, divided):
    """Ends of intervals from `begin`: the times and those that divide decades, and for `divided` all middles."""
    decades = np.log10(times[-1] / times[0])
    even = times[0] * 10.0 ** (np.arange(1.0, INTERVALS_PER_DECADE * decades) / INTERVALS_PER_DECADE)
    between = even[np.abs(np.log(even[:, None] / times)).min(axis=1) > 0.5 / INTERVALS_PER_DECADE]
    ends = np.sort(np.concatenate((times, between)))
    if not divided:
        return ends
    return np.sort(np.concatenate((ends, np.sqrt(ends * np.append(begin, ends[:-1])))))
