"""What a probe adds to results of sweep and quasistatic: susceptibilities, of waves also moduli G(k)."""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.error_bounds import relative_part_bounds
from jampetsc.analysis.susceptibility import modulus_of_wave
from jampetsc.laws.probes import Forces, PointForces, Wave

MODULUS_BOUNDS = ("error_bound", "error_bound_storage", "error_bound_loss")  # on |ΔG*|, |ΔG'|, |ΔG''|


@dataclass(frozen=True, eq=False)
class ProbeResponse:
    """The response to a probe at M frequencies. P: 1 of waves and of an array, of points the number of particles."""

    probe: Wave | PointForces | Forces
    particles: object  # `ProbedParticles`
    susceptibility: np.ndarray  # (M, P) complex
    bounds: np.ndarray  # (M, P, 3) on |Δχ|, |Δχ'| and |Δχ''|

    @classmethod
    def of(cls, probe, probe_loads, sweep, volume: float) -> "ProbeResponse":
        """Of a `ModulusSweep` of the loads of a probe, `ProbeLoads`."""
        return cls(probe, probe_loads.particles, *probe_loads.susceptibility(sweep.G, sweep.bounds, volume))

    @property
    def modulus(self):
        """G(k) (M,), complex, and its bounds (M, 3), of a wave; else None."""
        if not isinstance(self.probe, Wave):
            return None
        factor = self.probe.modulus_factor(self.particles)
        return modulus_of_wave(self.susceptibility[:, 0], self.bounds[:, 0], factor)

    def write(self, writer) -> None:
        """Put it into a result. Collective."""
        is_sample = isinstance(self.probe, PointForces)
        arrays = {"susceptibility": self.susceptibility}
        for name, bound in zip(MODULUS_BOUNDS, np.moveaxis(self.bounds, -1, 0), strict=True):
            arrays[f"susceptibility_{name}"] = bound
        for name, values in arrays.items():
            writer.dataset(name, values if is_sample else values[:, 0])
        if self.modulus is not None:
            G, bounds = self.modulus
            writer.dataset("G", G)
            for name, bound in zip(MODULUS_BOUNDS, bounds.T, strict=True):
                writer.dataset(name, bound)
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
        if len(chi) > 1:
            return _sample_text(chi.real)
        text = f"susceptibility {chi[0].real:.6g} {chi[0].imag:+.6g}i"
        if self.modulus is None:
            return text
        G = self.modulus[0][row]
        return f"{text}, G(k) = {G.real:.6g} {G.imag:+.6g}i"


@dataclass(frozen=True, eq=False)
class SlowProbeResponse:
    """The response to a probe in the limit ω → 0, χ → χ₀ − iωχ₁."""

    static: np.ndarray  # (P,) χ₀
    bounds: np.ndarray  # (P,) on |Δχ₀|
    slopes: np.ndarray  # (P,) χ₁
    factor: float | None  # (n/V)/k² of a wave
    is_sample: bool  # of points

    @classmethod
    def of(cls, probe, probe_loads, slow) -> "SlowProbeResponse":
        """Of the `SlowSusceptibility` of the loads of a probe, `ProbeLoads`."""
        sums = (probe_loads.weights @ values for values in (slow.static, slow.bounds, slow.slopes))
        factor = probe.modulus_factor(probe_loads.particles) if isinstance(probe, Wave) else None
        return cls(*sums, factor, isinstance(probe, PointForces))

    @property
    def moduli(self) -> dict:
        """Attributes of a wave: G₀ with its bound, η₀ and ω* at its k."""
        if self.factor is None:
            return {}
        error = self.bounds * np.array([1.0, 1.0, 0.0])
        (G,), ((_, bound, _),) = modulus_of_wave(self.static.astype(complex), error[None], self.factor)
        eta = self.factor * float(self.slopes[0] / self.static[0] ** 2)
        return {"G0": G.real, "G0_error_bound": bound, "eta0": eta, "omega_star": G.real / eta}

    def write(self, writer, name: str) -> None:
        """Put it into a result; name: "" or that of K without pre-stress. Collective."""
        group, prefix = (f"{name}/", f"{name}_") if name else ("", "")
        arrays = {
            "susceptibility": self.static,
            "susceptibility_error_bound": self.bounds,
            "susceptibility_slope": self.slopes,
        }
        for key, values in arrays.items():
            writer.dataset(f"{group}{key}", values if self.is_sample else values[0])
        numbers = {"susceptibility_mean": self.static.mean(), **self.moduli}
        writer.attributes(**{f"{prefix}{key}": value for key, value in numbers.items()})

    @property
    def text(self) -> str:
        """It in words."""
        if len(self.static) > 1:
            return _sample_text(self.static)
        text = f"susceptibility {self.static[0]:.6g}, slope {self.slopes[0]:.6g}"
        if self.factor is None:
            return text
        G0, _, eta0, omega_star = self.moduli.values()
        return f"G0(k) = {G0:.6g}, eta0(k) = {eta0:.6g}, omega* = {omega_star:.4g}, {text}"


def write_probe(writer, probe, particles) -> None:
    """Put which particles were pushed, and how, into a result. Collective."""
    if isinstance(probe, PointForces):
        writer.dataset("probe/particles", probe.chosen(particles))
    elif isinstance(probe, Forces):
        writer.dataset("probe/forces", probe.array)
    else:
        writer.attributes(wave_vector=probe.vector(particles.cell))


def _sample_text(compliances) -> str:
    """Compliances (P,) of single particles in words."""
    low, middle, high = np.quantile(compliances, (0.0, 0.5, 1.0))
    return f"J of {len(compliances)} particles {low:.6g} to {high:.6g}, median {middle:.6g}"
