"""What is imposed, a sine, and what every solver of an oscillation answers."""

from dataclasses import dataclass

import numpy as np

from jampetsc.oscillation.stage import Imposed


@dataclass(frozen=True)
class Answer:
    """Of one oscillation; each solver adds what it alone knows."""

    G: complex
    error: float  # estimate of |ΔG*|
    harmonics: (
        np.ndarray
    )  # (2,) complex: third, fifth over first, of strain (stress) under stress (strain) control
    work: float  # per area and cycle
    balance: float  # dissipated, and stored where a cycle does not return, over work, − 1
    newton: int  # steps of Newton's method

    def record(self) -> dict:
        """What a file keeps, by the names of its datasets."""
        return {
            "G": self.G,
            "error": self.error,
            "harmonics": list(self.harmonics),
            "work": self.work,
            "energy_balance": self.balance,
            "newton_steps": self.newton,
        }


@dataclass(frozen=True)
class Sine:
    """What is imposed, ∝ sin of a phase: a strain or, in units of its own, a stress."""

    amplitude: float
    stress_controlled: bool

    def at(self, phase: float) -> Imposed:
        """With its rate where it is a strain."""
        now = self.amplitude * np.sin(phase)
        if self.stress_controlled:
            return Imposed(stress=now)
        return Imposed(now, self.amplitude * np.cos(phase))

    def moduli(self, first: complex):
        """(G*, amplitude of the strain, work per area and cycle) of the first harmonic of what answers."""
        work = np.pi * self.amplitude * float(first.imag)  # ∮σdγ = −∮γdσ
        if self.stress_controlled:
            return complex(self.amplitude / first), float(abs(first)), -work
        return complex(first / self.amplitude), self.amplitude, work
