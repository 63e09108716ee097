"""The imposed sine of stress or strain, and the response to it: G*, harmonics, work."""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

HARMONICS = 2  # saved besides the first: third and fifth
WAVEFORM_TIMES = 128  # of a cycle, at equal intervals, at which strain and stress are saved
LISTS = "harmonics", "harmonics_error", "strain_waveform", "stress_waveform"
MIN_FIXED_ALPHA = 0.45  # below, FGMRES does not solve the equations of fixed contacts, which stick


@dataclass(frozen=True)
class Imposed:
    """The imposed stress at one time or, without one, the imposed strain and its rate."""

    gamma: float = 0.0
    rate: float = 0.0
    stress: float | None = None

    @property
    def free(self) -> bool:
        """Whether the strain is unknown."""
        return self.stress is not None


class Moduli(NamedTuple):
    """Moduli of one cycle, in the units of its drive."""

    G: complex
    harmonics: np.ndarray  # (2,) complex: third and fifth over the first
    strain: float  # amplitude
    work: float  # ∮σdγ per volume


@dataclass(frozen=True)
class Drive:
    """An imposed sine.

    A stress amplitude is in multiples of k, of spheres over that of length, unless a solver uses its own units.
    """

    omega: float
    amplitude: float  # σ₀ or γ₀
    stress_controlled: bool

    @property
    def control(self) -> str:
        """The imposed quantity, "stress" or "strain"."""
        return "stress" if self.stress_controlled else "strain"

    def at(self, phase: float) -> Imposed:
        """The Imposed at ωt = phase, with a strain rate in units of ω."""
        value = self.amplitude * np.sin(phase)
        if self.stress_controlled:
            return Imposed(stress=value)
        return Imposed(value, self.amplitude * np.cos(phase))

    def moduli(self, values, times, weights, drift: float = 0.0) -> Moduli:
        """Moduli of a response (strain or stress) with these values (n,) at these times (n,) of a cycle of length 1.

        weights: (n,) or one number, of a quadrature over the cycle; drift: a ramp over the cycle, which is removed
        """
        orders = 2 * np.arange(HARMONICS + 1) + 1
        phases = 2.0 * np.pi * times - 0.5 * np.pi  # zero at the maximum of the drive
        waves = np.exp(-1j * np.outer(phases, orders))
        first, *higher = (2.0 * weights * (values - drift * times)) @ waves
        work = np.pi * self.amplitude * float(first.imag)  # ∮σdγ = −∮γdσ
        if self.stress_controlled:
            G, strain, work = complex(self.amplitude / first), float(abs(first)), -work
        else:
            G, strain = complex(first / self.amplitude), self.amplitude
        return Moduli(G, np.array(higher) / first, strain, work)

    def waveform(self, values, times, drift: float = 0.0):
        """Strain and stress (2, WAVEFORM_TIMES) from ωt = 0 on of a response as in `moduli`, between whose times it is
        linear.
        """
        moments = np.arange(WAVEFORM_TIMES) / WAVEFORM_TIMES
        response = np.interp(moments, times, values - drift * times, period=1.0)
        imposed = self.amplitude * np.sin(2.0 * np.pi * moments)
        return np.array((response, imposed) if self.stress_controlled else (imposed, response))


@dataclass(frozen=True, kw_only=True)
class OscillationResult:
    """The result of a solver, named as the datasets of the file; None where the solver has no such number."""

    G: complex  # of the first harmonic
    error: float  # estimate of |ΔG*|
    harmonics: np.ndarray  # as in Moduli: of the strain where a stress is imposed, else of the stress
    work: float  # per volume and cycle
    energy_balance: float  # (energy dissipated + stored) / work − 1
    newton_steps: int
    strain_waveform: np.ndarray | None = (
        None  # (WAVEFORM_TIMES,) of the cycles that G is the mean of, from ωt = 0 on
    )
    stress_waveform: np.ndarray | None = None  # likewise
    G_error: complex | None = None  # of G' and of G''
    harmonics_error: np.ndarray | None = None  # (2,) estimates of |Δ| of `harmonics`
    repeats: bool | None = (
        None  # whether cycles repeat; else G is the mean over cycles that fluctuate, or the last one
    )
    averaged_cycles: int | None = None  # number of cycles that G is the mean of
    linear_iterations: int | None = None
    factorisations: int | None = None
    regularisation_effect: float | None = None  # estimate of |ΔG*| if contacts were regularised half as much
    cycles: int | None = None  # of both runs
    steps_taken: int | None = None  # accepted steps; of one that was halved, its parts
    cycle_change: float | None = None  # |ΔG*| between the last two cycles
    drift: float | None = None  # change of the strain in the last cycle

    def record(self) -> dict:
        """{dataset: value} for the file."""
        values = {field.name: getattr(self, field.name) for field in fields(OscillationResult)}
        values = {name: value for name, value in values.items() if value is not None}
        return values | {name: list(values[name]) for name in LISTS if name in values}
