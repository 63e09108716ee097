"""Half a cycle of a steady oscillation in equal steps, and the implicit midpoint rule on it, solved for the cycle.

With fixed contacts the equations are odd in the motion, so their steady oscillation changes sign after half a period,
Q(t + T/2) = −Q(t), and the m steps of a half cycle suffice. With velocities v_n in the middles of the steps, the
midpoint rule Q_{n+1} − Q_n = h v_n, and Q in the middle the mean of both ends, it is diagonal in the odd harmonics

    Q = v / iΩ_k ,     Ω_k = (2/h) tan(kπ/2m) ,     k = 1, 3, …, m − 1 .

The step h is chosen, (2/h) tan(π/2m) = ω, so that the first harmonic has Ω₁ = ω: the result is exact for linear
damping and any number of steps; the error, of second order in 1/m, is in the higher harmonics. The map from v to Q is
antisymmetric in time, so elastic energy is recovered exactly: work per cycle is dissipation per cycle.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jampetsc.oscillation.drive import WAVEFORM_TIMES


@dataclass(frozen=True)
class Cycle:
    """A cycle of `steps` steps, a multiple of 4, at frequency omega. Arrays have m = steps/2 rows."""

    steps: int
    omega: float

    @property
    def m(self) -> int:
        """Steps of half a cycle."""
        return self.steps // 2

    @cached_property
    def phase(self):
        """ωt in the middle of each step, (m,)."""
        return (np.arange(self.m) + 0.5) * np.pi / self.m

    @cached_property
    def orders(self):
        """Odd orders k of the harmonics, (m/2,)."""
        return np.arange(1, self.m, 2)

    @cached_property
    def frequencies(self):
        """Ω_k of the harmonics, (m/2,)."""
        return self.omega * np.tan(self.orders * np.pi / (2 * self.m)) / np.tan(np.pi / (2 * self.m))

    @cached_property
    def _waves(self):
        return np.exp(1j * np.outer(self.phase, self.orders))

    def harmonics(self, values):
        """Complex c (m/2, …) with values = Re Σ c_k exp(ikωt), for values (m, …)."""
        return np.tensordot(self._waves.conj().T, values, 1) * (2.0 / self.m)

    def samples(self, harmonics):
        """Values (m, …) of harmonics c, first axis of any length; orders above m are left out."""
        kept = harmonics[: len(self.orders)]
        waves = self._waves[:, : len(kept)]
        return np.tensordot(waves.real, kept.real, 1) - np.tensordot(waves.imag, kept.imag, 1)

    @cached_property
    def integral(self):
        """Antisymmetric matrix (m, m) that takes velocities to displacements."""
        return ((self._waves / (1j * self.frequencies)) @ self._waves.conj().T).real * (2.0 / self.m)

    def wave(self, harmonics):
        """Values (WAVEFORM_TIMES,) of harmonics c (m/2,) at equal intervals of a cycle from the phase −π/2 on."""
        phases = 2.0 * np.pi * np.arange(WAVEFORM_TIMES) / WAVEFORM_TIMES - 0.5 * np.pi
        return (np.exp(1j * np.outer(phases, self.orders)) @ harmonics).real
