"""Cycles of imposed strain or stress on moving contacts, repeated until they repeat themselves.

What is imposed is ∝ sin ωt, from the steady oscillation with fixed contacts, and time is counted in 1/ω: with small
exponents ω may be any power of ten. Under stress the strain may creep from cycle to cycle; that ramp is no part of the
harmonics. Work is ∮σdγ of what is imposed and answers, so πG''γ₁².

Steps are cut where they lose too much energy (see `steps`). Harmonics are integrals by the same quadrature: where the
strain is imposed a cycle is off by the sum of what its steps are.

Two runs, the second from where the first has ended: half of the steps, then all of them. Their difference estimates
the error of the steps; what the last cycles still changed, as a geometric series goes on, that of the repetitions.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.core.disks import Disks
from jampetsc.core.laws import Law
from jampetsc.core.pairs import deformed
from jampetsc.core.state import find_contacts
from jampetsc.errors import ConvergenceError, named
from jampetsc.oscillation.answer import Answer, Sine
from jampetsc.oscillation.cycle import Cycle
from jampetsc.oscillation.halfcycles import SteppedOscillation
from jampetsc.oscillation.harmonics import harmonics_of
from jampetsc.oscillation.moving import MovingContacts
from jampetsc.oscillation.preconditioner import PREFIX
from jampetsc.oscillation.steady import Point, SteadyOscillation
from jampetsc.oscillation.steps import Steps

REPEATED = 1e-3  # of |G*|: what may be left of the change from cycle to cycle
SAME = 1e-7  # a change that is none
MOST_CYCLES = 60
START_STEPS = 16  # of the cycle that is the start; linear damping comes out exactly whatever they are
LOST = 8.0  # over the cubed number of steps: energy by which one may be off, in units of π|G*|γ₁² of the cell
PERIOD = 2.0 * np.pi
FLOWING = 1.0  # a strain at which disks have left their neighbours for others


@dataclass(frozen=True)
class Repeated(Answer):
    """The answer, of the last cycle."""

    change: float  # |ΔG*| from the last cycle but one to the last
    drift: float  # strain that the last cycle has gained
    cycles: int  # of both runs
    steps: int  # likewise, each cut one counted as those that it was cut into
    factorisations: int

    def record(self) -> dict:
        """What a file keeps, by the names of its datasets."""
        return super().record() | {
            "cycle_change": self.change,
            "drift": self.drift,
            "cycles": self.cycles,
            "steps_taken": self.steps,
            "factorisations": self.factorisations,
        }


@dataclass(frozen=True, eq=False)
class Start:
    """The steady oscillation with fixed contacts, at the instant at which what is imposed grows through zero.

    Velocities are those in units of time 1/ω.
    """

    point: Point
    displacement: np.ndarray  # (N, 2) non-affine; 0 for rattlers
    velocity: np.ndarray  # (N, dofs), with spins where the law has them
    gamma: float
    rate: float  # of strain
    strain: float  # amplitude
    modulus: float  # |G*|
    speed: float  # see `steady.Steady`

    @classmethod
    def of(cls, oscillation: SteadyOscillation, n: int, point: Point) -> "Start":
        """Of a packing of n disks, on one rank; from rest where the cycle is not solved."""
        try:
            found = oscillation.solve(point)
        except ConvergenceError:
            return cls._at_rest(oscillation, n, point)
        network = oscillation.network
        cycle = Cycle(oscillation.steps, point.omega)
        waves = found.velocity * (-1j) ** cycle.orders[:, None]  # a quarter of a cycle before the largest
        parts = []
        for motion in (waves / (1j * cycle.frequencies[:, None]), waves / point.omega):
            now = motion.sum(axis=0).real
            field = np.zeros((n, oscillation.law.dofs))
            field[network.particles] = now[:-1].reshape(network.n, -1)
            parts.append((field, float(now[-1]) / oscillation.contacts.length))
        (displacement, gamma), (velocity, rate) = parts
        strain = point.amplitude * network.k / abs(found.G) if point.stress_controlled else point.amplitude
        if not point.stress_controlled:
            gamma = 0.0  # but for rounding
        speed = found.speed / point.omega
        return cls(point, displacement[:, :2], velocity, gamma, rate, strain, abs(found.G), speed)

    @classmethod
    def of_steps(cls, oscillation: SteppedOscillation, n: int, point: Point) -> "Start":
        """The same, found by steps in time."""
        found, particles = oscillation.solve(point), oscillation.network.particles
        displacement, velocity = np.zeros((n, 2)), np.zeros((n, oscillation.law.dofs))
        displacement[particles], velocity[particles] = found.start.places, found.velocity
        scales = found.strain, abs(found.G), found.speed
        return cls(point, displacement, velocity, found.start.gamma, found.rate, *scales)

    @classmethod
    def _at_rest(cls, oscillation, n, point):
        strain, speed = oscillation.scales(point)
        velocity = np.zeros((n, oscillation.law.dofs))
        scales = strain, oscillation.network.k, speed / point.omega
        return cls(point, velocity[:, :2], velocity, 0.0, 0.0, *scales)

    def near(self, disks: Disks) -> "Start":
        """This one or, where contacts of these disks open or close, one at rest.

        Fixed contacts pull where they are gone, and do not push where others are new: a disk that is left with one
        neighbour, as a rattler is by what runs into it, would roll off that at once, by steps however short.
        """
        moved = deformed(disks, self.displacement, 0.0, self.gamma)
        if np.array_equal(*(_pairs(find_contacts(one), disks.n) for one in (disks, moved))):
            return self
        rest = 0.0 * self.displacement, 0.0 * self.velocity
        return replace(self, displacement=rest[0], velocity=rest[1], gamma=0.0, rate=0.0)


def _pairs(contacts, n):
    return np.sort(contacts.i.astype(np.int64) * n + contacts.j)


def shake(disks: Disks, law: Law, start: Start, steps: int, cycles: int | None) -> Repeated:
    """G* of the oscillation that `start` begins: so many cycles, or None: as many as it takes until they repeat.

    Raises ConvergenceError where a step is too long, where the packing flows, or where cycles do not repeat within
    MOST_CYCLES.
    """
    start = start.near(disks)
    half = Run(disks, law, start, steps // 2)
    whole = None
    try:
        half.motion.displace(start.displacement, start.velocity, start.gamma, start.rate)
        half.repeat(cycles)
        now = half.motion
        whole = Run(now.disks, law, start, steps, now.gamma)
        whole.motion.displace(0.0 * now.u[:, :2], now.velocities, now.gamma, now.rate)
        whole.repeat(cycles)
        last = whole.seen[-1]
        return Repeated(
            G=last.G,
            error=abs(last.G - half.seen[-1].G) + min(whole.left, whole.spread),
            harmonics=last.harmonics,
            work=last.work,
            balance=last.spent / last.work - 1.0,
            change=whole.change,
            drift=last.drift,
            cycles=len(half.seen) + len(whole.seen),
            steps=half.steps.taken + whole.steps.taken,
            factorisations=half.motion.factorisations + whole.motion.factorisations,
            newton=half.motion.iterations + whole.motion.iterations,
        )
    finally:
        half.motion.destroy()
        if whole is not None:
            whole.motion.destroy()


@dataclass(frozen=True)
class _Cycle:
    G: complex
    harmonics: np.ndarray
    work: float
    spent: float  # dissipated and stored
    drift: float


def left_to_change(G) -> float:
    """What later cycles would add to the last of G (cycles,), if changes go on to fall as the last two did; or inf."""
    change, before = abs(np.diff(G[-3:]))[::-1] if len(G) > 2 else (np.inf, np.inf)
    if len(G) > 1 and abs(G[-1] - G[-2]) <= SAME * abs(G[-1]):
        return float(abs(G[-1] - G[-2]))
    return float(change * max(1.0, change / (before - change))) if change < before else np.inf


class Run:
    """Cycles of so many steps of a packing at this strain; `seen` has what each of them was like."""

    def __init__(self, disks, law, start, steps, gamma=0.0):
        point = start.point
        self.count, unit = steps, float(disks.potential.k) if point.stress_controlled else 1.0
        self.sine = Sine(point.amplitude * unit, point.stress_controlled)
        scaled = replace(law, tau1=point.omega * law.tau1)
        self.motion = MovingContacts(disks, scaled, PERIOD / steps, start.strain, PREFIX, start.speed, gamma)
        self.steps = Steps(self.motion, self.sine.at)
        self.strain, self.modulus = start.strain, start.modulus
        self.seen = []

    def repeat(self, cycles):
        """So many cycles, or as many as it takes."""
        while len(self.seen) < (cycles or MOST_CYCLES):
            self._cycle()
            if cycles is None and self.left <= REPEATED * abs(self.seen[-1].G):
                return
        if cycles is None:
            raise ConvergenceError(
                f"cycles do not repeat: the last of {MOST_CYCLES} still changes G* by "
                f"{100 * self.change / abs(self.seen[-1].G):.2g} %; {named('cycles')} {MOST_CYCLES} keeps "
                "what such a one gives"
            )

    @property
    def change(self) -> float:
        """|ΔG*| of the last two cycles."""
        return abs(self.seen[-1].G - self.seen[-2].G) if len(self.seen) > 1 else np.inf

    @property
    def left(self) -> float:
        """Estimate of what later cycles would change."""
        return left_to_change([one.G for one in self.seen])

    @property
    def spread(self) -> float:
        """Largest |ΔG*| from the last cycle among the later half of all."""
        return max(abs(one.G - self.seen[-1].G) for one in self.seen[len(self.seen) // 2 :])

    def _cycle(self):
        motion, begin, rows, spent = self.motion, self.motion.gamma, [], 0.0
        step = PERIOD / self.count
        allowed = LOST / self.count**3 * np.pi * self.modulus * self.strain**2 * motion.area
        for n in range(self.count):
            # whole periods are left out: their rounding would show in the strain
            for one in self.steps.over(n * step, step, allowed):
                for time, weight, seen in one.stages():
                    rows.append((time, weight, seen.gamma if self.sine.stress_controlled else seen.stress))
                    spent += weight * seen.power
                spent += motion.gained
            if not abs(motion.gamma - begin) < FLOWING + self.sine.amplitude:
                raise ConvergenceError(
                    f"the packing flows: its strain has changed by {motion.gamma - begin:.2g} within a cycle: give "
                    f"less {named('stress')}"
                )
        drift, (times, weights, response) = motion.gamma - begin, np.array(rows).T
        ramp = drift if self.sine.stress_controlled else 0.0
        found = harmonics_of(response, times / PERIOD, weights / PERIOD, ramp)
        G, self.strain, work = self.sine.moduli(found[0])
        self.modulus = abs(G)
        self.seen.append(_Cycle(G, found[1:] / found[0], work, spent / motion.area, drift))
