"""Half a cycle of a steady oscillation in equal steps, and the implicit midpoint rule on it, solved for the cycle.

With fixed contacts the equations are odd in the motion, so their steady oscillation changes sign after half a period,
Q(t + T/2) = −Q(t), and m steps of a half cycle tell all of it. Where velocities v_n belong to the middles of the steps,
the midpoint rule Q_{n+1} − Q_n = h v_n, with Q at the middles the mean of both ends, is diagonal in the odd harmonics

    Q = v / iΩ_k ,     Ω_k = (2/h) tan(kπ/2m) ,     k = 1, 3, …, m − 1 .

The step h is fitted, (2/h) tan(π/2m) = ω, so that the first harmonic has its own frequency: linear damping comes
out exactly, whatever the number of steps, and the error, of second order in 1/m, belongs to the higher harmonics. The
map from v to Q is antisymmetric in time, so elastic energy returns exactly: work per cycle is dissipation per cycle.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np


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
        """(m,) ωt in the middle of each step."""
        return (np.arange(self.m) + 0.5) * np.pi / self.m

    @cached_property
    def orders(self):
        """(m/2,) of the harmonics, odd."""
        return np.arange(1, self.m, 2)

    @cached_property
    def frequencies(self):
        """(m/2,) Ω_k."""
        return self.omega * np.tan(self.orders * np.pi / (2 * self.m)) / np.tan(np.pi / (2 * self.m))

    @cached_property
    def _waves(self):
        return np.exp(1j * np.outer(self.phase, self.orders))

    def harmonics(self, values):
        """(m/2, …) complex c with values = Re Σ c_k exp(ikωt), for values (m, …)."""
        return np.tensordot(self._waves.conj().T, values, 1) * (2.0 / self.m)

    def samples(self, harmonics):
        """(m, …) of the lowest harmonics (up to m/2, …) of any cycle."""
        kept = harmonics[: len(self.orders)]
        waves = self._waves[:, : len(kept)]
        return np.tensordot(waves.real, kept.real, 1) - np.tensordot(waves.imag, kept.imag, 1)

    @cached_property
    def integral(self):
        """(m, m) antisymmetric matrix: displacements of velocities."""
        return ((self._waves / (1j * self.frequencies)) @ self._waves.conj().T).real * (2.0 / self.m)
