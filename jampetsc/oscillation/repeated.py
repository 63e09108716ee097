"""Cycles of imposed strain on moving contacts, repeated until they repeat themselves.

Two runs, the second from where the first has ended: half of the steps, then all of them. Their difference estimates
the error of the steps; what the last cycles still changed, as a geometric series goes on, that of the repetitions.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.contacts.disks import Disks
from jampetsc.contacts.laws import Law, Physics
from jampetsc.errors import ConvergenceError
from jampetsc.mechanics.assembly import assemble
from jampetsc.mechanics.compatibility import build_compatibility
from jampetsc.mechanics.network import Network
from jampetsc.oscillation.moving import STAGE, MovingContacts
from jampetsc.oscillation.steady import HARMONICS, Point, SteadyOscillation

PREFIX = "osc_factor_"
REPEATED = 1e-3  # of |G*|: what may be left of the change from cycle to cycle
SAME = 1e-7  # a change that is none
MOST_CYCLES = 60
LINEAR_STEPS = 16  # linear damping comes out exactly whatever they are


@dataclass(frozen=True)
class Repeated:
    """The answer. Harmonics as in `steady.Steady`, under strain control."""

    G: complex  # of the last cycle
    error: float  # estimate of |ΔG*|
    harmonics: np.ndarray  # (2,) complex
    work: float  # per area, of the last cycle
    balance: float  # dissipation over work − 1
    change: float  # |ΔG*| from the last cycle but one to the last
    cycles: int  # of both runs
    factorisations: int
    newton: int  # steps of Newton's method

    def record(self) -> dict:
        """What a file keeps, by the names of its datasets."""
        return {
            "G": self.G,
            "error": self.error,
            "harmonics": list(self.harmonics),
            "work": self.work,
            "energy_balance": self.balance,
            "cycle_change": self.change,
            "cycles": self.cycles,
            "newton_steps": self.newton,
            "factorisations": self.factorisations,
        }


@dataclass(frozen=True, eq=False)
class Start:
    """The linear response of one frequency, per unit of strain amplitude: as if disks had always moved so."""

    omega: float
    displacement: np.ndarray  # (N, 2) complex, non-affine; 0 for rattlers
    velocity: np.ndarray  # (N, dofs) complex, with spins where the law has them


def linear_starts(network: Network, n: int, physics: Physics, omega) -> list[Start]:
    """A Start for each frequency, of a network of one rank in a packing of n disks."""
    pencil = assemble(network, physics.law)
    compatibility = build_compatibility(pencil)
    oscillation = SteadyOscillation(compatibility, 1.0, LINEAR_STEPS)
    starts = []
    for w in omega:
        found = oscillation.solve(Point(float(w), 1.0, stress_controlled=False))
        velocity = np.zeros((n, physics.law.dofs), complex)
        velocity[network.particles] = found.velocity[0, :-1].reshape(network.n, -1)
        starts.append(Start(float(w), velocity[:, :2] / (1j * w), velocity))
    for item in (oscillation, compatibility, pencil):
        item.destroy()
    return starts


def shake(disks: Disks, law: Law, start: Start, strain: float, steps: int, cycles: int | None) -> Repeated:
    """G* under γ₀ sin ωt: as many cycles, or None: as many as it takes until they repeat.

    Raises ConvergenceError where a step is too long, or where cycles do not repeat within MOST_CYCLES.
    """
    half = _Run(disks, law, start, strain, steps // 2)
    whole = None
    try:
        half.repeat(cycles)
        whole = _Run(half.motion.disks, law, start, strain, steps)
        whole.motion.displace(0.0 * half.motion.u[:, :2], half.motion.u)
        whole.repeat(cycles)
        last = whole.seen[-1]
        return Repeated(
            G=last.G,
            error=abs(last.G - half.seen[-1].G) + min(whole.left, whole.spread),
            harmonics=last.harmonics,
            work=last.work,
            balance=last.dissipation / last.work - 1.0,
            change=whole.change,
            cycles=len(half.seen) + len(whole.seen),
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
    dissipation: float


def left_to_change(G) -> float:
    """What later cycles would add to the last of G (cycles,), if changes go on to fall as the last two did; or inf."""
    change, before = abs(np.diff(G[-3:]))[::-1] if len(G) > 2 else (np.inf, np.inf)
    if len(G) > 1 and abs(G[-1] - G[-2]) <= SAME * abs(G[-1]):
        return float(abs(G[-1] - G[-2]))
    return float(change * max(1.0, change / (before - change))) if change < before else np.inf


class _Run:
    """Cycles of so many steps, from the linear response; `seen` has what each of them was like."""

    def __init__(self, disks, law, start, strain, steps):
        self.omega, self.strain, self.steps = start.omega, strain, steps
        self.area = disks.area
        self.motion = MovingContacts(disks, law, 2.0 * np.pi / (start.omega * steps), strain, PREFIX)
        # γ = γ₀ sin ωt is Im(γ₀ exp iωt)
        self.motion.displace(strain * start.displacement.imag, strain * start.velocity.imag)
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
                f"{100 * self.change / abs(self.seen[-1].G):.2g} %; --cycles {MOST_CYCLES} keeps what such a one gives"
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
        motion, w, dt = self.motion, self.omega, self.motion.step
        stress, dissipation = np.empty(self.steps), 0.0
        for n in range(self.steps):
            # whole periods are left out: their rounding would show in the strain
            phases = w * dt * (n + np.array([STAGE, 1.0]))
            ends = motion.advance(self.strain * np.sin(phases), self.strain * w * np.cos(phases))
            stress[n] = ends[1].stress
            dissipation += dt * ((1.0 - STAGE) * ends[0].power + STAGE * ends[1].power)
        phase = 2.0 * np.pi * np.arange(1, self.steps + 1) / self.steps
        orders = 2 * np.arange(HARMONICS + 1) + 1
        # with the time at which the strain is largest as its origin, as for fixed contacts
        found = stress @ np.exp(-1j * np.outer(phase - 0.5 * np.pi, orders)) * (2.0 / self.steps)
        work = dt * float(stress @ (self.strain * w * np.cos(phase)))
        self.seen.append(_Cycle(found[0] / self.strain, found[1:] / found[0], work, dissipation / self.area))
