"""The sine of stress or strain that drives an oscillation, and the response to it: G*, harmonics, work."""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

HARMONICS = 2  # kept besides the first: third and fifth


@dataclass(frozen=True)
class Imposed:
    """What holds at one time: a strain and its rate or, where that is None, a stress."""

    gamma: float = 0.0
    rate: float = 0.0
    stress: float | None = None

    @property
    def free(self) -> bool:
        """Whether the strain is unknown."""
        return self.stress is not None


class Moduli(NamedTuple):
    """Of one cycle, in the units of its drive."""

    G: complex
    harmonics: np.ndarray  # (2,) complex: third and fifth over the first
    strain: float  # amplitude
    work: float  # ∮σdγ per area


@dataclass(frozen=True)
class Drive:
    """A sine that is imposed. Its stress is in units of the stiffness k, but where a solver chooses other ones."""

    omega: float
    amplitude: float  # σ₀ or γ₀
    stress_controlled: bool

    def at(self, phase: float) -> Imposed:
        """At ωt = phase, with the rate of a strain in units of ω."""
        now = self.amplitude * np.sin(phase)
        if self.stress_controlled:
            return Imposed(stress=now)
        return Imposed(now, self.amplitude * np.cos(phase))

    def moduli(self, values, times, weights, drift: float = 0.0) -> Moduli:
        """Those of the response, strain or stress, with these values (n,) at these times (n,) of a cycle of length 1.

        weights: (n,), or one number, of a quadrature over the cycle; drift: a ramp over the cycle, left out
        """
        orders = 2 * np.arange(HARMONICS + 1) + 1
        phases = 2.0 * np.pi * times - 0.5 * np.pi  # zero where the drive is largest
        waves = np.exp(-1j * np.outer(phases, orders))
        first, *higher = (2.0 * weights * (values - drift * times)) @ waves
        work = np.pi * self.amplitude * float(first.imag)  # ∮σdγ = −∮γdσ
        if self.stress_controlled:
            G, strain, work = complex(self.amplitude / first), float(abs(first)), -work
        else:
            G, strain = complex(first / self.amplitude), self.amplitude
        return Moduli(G, np.array(higher) / first, strain, work)


@dataclass(frozen=True, kw_only=True)
class Response:
    """What a solver found, by the names of a file's datasets; None where the solver has no such number."""

    G: complex  # of the first harmonic
    error: float  # estimate of |ΔG*|
    harmonics: np.ndarray  # as in Moduli: of the strain where a stress is imposed, else of the stress
    work: float  # per area and cycle
    energy_balance: float  # energy dissipated, and stored where a cycle does not return, over work, − 1
    newton_steps: int
    linear_iterations: int | None = None
    factorisations: int | None = None
    regularisation_effect: float | None = None  # estimate of |ΔG*| if contacts were regularised half as much
    half_cycles: int | None = None  # of both runs, as the next two
    cycles: int | None = None
    steps_taken: int | None = None  # each that was cut counted as those that it was cut into
    cycle_change: float | None = None  # |ΔG*| from the last cycle but one to the last
    drift: float | None = None  # strain that the last cycle has gained

    def record(self) -> dict:
        """What a file keeps."""
        found = {field.name: getattr(self, field.name) for field in fields(Response)}
        found["harmonics"] = list(self.harmonics)
        return {name: value for name, value in found.items() if value is not None}
