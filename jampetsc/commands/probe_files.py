"""What a probe adds to results of sweep and quasistatic: susceptibilities, of waves also moduli G(k)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jampetsc.analysis.error_bounds import relative_part_bounds
from jampetsc.analysis.susceptibility import modulus_of_wave
from jampetsc.laws.probes import Forces, PointForces, Waves

MODULUS_BOUNDS = ("error_bound", "error_bound_storage", "error_bound_loss")  # on |ΔG*|, |ΔG'|, |ΔG''|


@dataclass(frozen=True, eq=False)
class ProbeResponse:
    """The response to a probe at M frequencies, of P waves or particles; of an array of forces P is 1."""

    probe: Waves | PointForces | Forces
    particles: object  # `ProbedParticles`
    susceptibility: np.ndarray  # (M, P) complex
    bounds: np.ndarray  # (M, P, 3) on |Δχ|, |Δχ'| and |Δχ''|

    @classmethod
    def of(cls, probe, probe_loads, sweep, volume: float) -> "ProbeResponse":
        """Of a `ModulusSweep` of the loads of a probe, `ProbeLoads`."""
        return cls(probe, probe_loads.particles, *probe_loads.susceptibility(sweep.G, sweep.bounds, volume))

    @cached_property
    def modulus(self):
        """G(k) (M, P), complex, and its bounds (M, P, 3), of waves; else None."""
        if not isinstance(self.probe, Waves):
            return None
        return modulus_of_wave(self.susceptibility, self.bounds, self.probe.modulus_factors(self.particles))

    def write(self, writer) -> None:
        """Put it into a result. Collective."""
        values = {"susceptibility": self.susceptibility} | _named("susceptibility_", self.bounds)
        if self.modulus is not None:
            G, bounds = self.modulus
            values |= {"G": G} | _named("", bounds)
        for name, array in values.items():
            writer.dataset(name, array if self.probe.has_columns else array[:, 0])
        write_probe(writer, self.probe, self.particles)

    @property
    def worst_bounds(self):
        """Largest bounds on |Δχ'| and |Δχ''| relative to them, (2,)."""
        return relative_part_bounds(self.susceptibility, self.bounds[..., 1:]).reshape(-1, 2).max(axis=0)

    def lines(self, omega) -> list[str]:
        """Lines of a summary: the response at the first and the last of the frequencies (M,)."""
        ends = (0, -1) if len(omega) > 1 else (0,)
        return [f"  omega {omega[end]:.3g}: {self._text(end)}" for end in ends]

    def _text(self, row):
        chi = self.susceptibility[row]
        if self.modulus is None:
            return _sample_text(chi.real) if len(chi) > 1 else f"susceptibility {_complex_text(chi[0])}"
        G = self.modulus[0][row]
        if len(chi) > 1:
            return f"G'(k) of {len(G)} waves {G.real.min():.6g} to {G.real.max():.6g}"
        return f"susceptibility {_complex_text(chi[0])}, G(k) = {_complex_text(G[0])}"


def _named(prefix, bounds) -> dict:
    """{name: bound (M, P)} of bounds (M, P, 3)."""
    return {f"{prefix}{name}": bounds[..., part] for part, name in enumerate(MODULUS_BOUNDS)}


def _complex_text(value) -> str:
    return f"{value.real:.6g} {value.imag:+.6g}i"


@dataclass(frozen=True, eq=False)
class SlowProbeResponse:
    """The response to a probe in the limit ω → 0, χ → χ₀ − iωχ₁."""

    static: np.ndarray  # (P,) χ₀
    bounds: np.ndarray  # (P,) on |Δχ₀|
    slopes: np.ndarray  # (P,) χ₁
    factors: np.ndarray | None  # (P,) (n/V)/k² of waves
    has_columns: bool  # of points and of several waves

    @classmethod
    def of(cls, probe, probe_loads, slow) -> "SlowProbeResponse":
        """Of the `SlowSusceptibility` of the loads of a probe, `ProbeLoads`."""
        sums = (probe_loads.weights @ values for values in (slow.static, slow.bounds, slow.slopes))
        factors = probe.modulus_factors(probe_loads.particles) if isinstance(probe, Waves) else None
        return cls(*sums, factors, probe.has_columns)

    @cached_property
    def moduli(self) -> dict:
        """G₀ with its bound, η₀ and ω* of waves at their k, (P,) each."""
        if self.factors is None:
            return {}
        bounds = self.bounds[:, None] * np.array([1.0, 1.0, 0.0])
        G, of_G = modulus_of_wave(self.static.astype(complex), bounds, self.factors)
        eta = self.factors * self.slopes / self.static**2
        return {"G0": G.real, "G0_error_bound": of_G[:, 1], "eta0": eta, "omega_star": G.real / eta}

    def write(self, writer, name: str) -> None:
        """Put it into a result; name: "" or that of K without pre-stress. Collective."""
        group, prefix = (f"{name}/", f"{name}_") if name else ("", "")
        arrays = {
            "susceptibility": self.static,
            "susceptibility_error_bound": self.bounds,
            "susceptibility_slope": self.slopes,
        }
        numbers = {"susceptibility_mean": self.static.mean()}
        if self.has_columns:
            arrays |= {f"waves/{key}": values for key, values in self.moduli.items()}
        else:
            numbers |= {key: values[0] for key, values in self.moduli.items()}
        for key, values in arrays.items():
            writer.dataset(f"{group}{key}", values if self.has_columns else values[0])
        writer.attributes(**{f"{prefix}{key}": value for key, value in numbers.items()})

    @property
    def text(self) -> str:
        """It in words."""
        count = len(self.static)
        if self.factors is None:
            single = f"susceptibility {self.static[0]:.6g}, slope {self.slopes[0]:.6g}"
            return _sample_text(self.static) if count > 1 else single
        G0, _, eta0, omega_star = self.moduli.values()
        if count > 1:
            return f"G0(k) of {count} waves {G0.min():.6g} to {G0.max():.6g}"
        return (
            f"G0(k) = {G0[0]:.6g}, eta0(k) = {eta0[0]:.6g}, omega* = {omega_star[0]:.4g}, susceptibility "
            f"{self.static[0]:.6g}, slope {self.slopes[0]:.6g}"
        )


def write_probe(writer, probe, particles) -> None:
    """Put which particles were pushed, and how, into a result. Collective."""
    if isinstance(probe, PointForces):
        writer.dataset("probe/particles", probe.chosen(particles))
    elif isinstance(probe, Forces):
        writer.dataset("probe/forces", probe.array)
    elif probe.has_columns:
        writer.dataset("waves/vectors", probe.vectors(particles.cell))
    else:
        writer.attributes(wave_vector=probe.vectors(particles.cell)[0])


def _sample_text(compliances) -> str:
    """Compliances (P,) of single particles in words."""
    low, middle, high = np.quantile(compliances, (0.0, 0.5, 1.0))
    return f"J of {len(compliances)} particles {low:.6g} to {high:.6g}, median {middle:.6g}"
