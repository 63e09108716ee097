"""What a probe adds to results of sweep and quasistatic: susceptibilities, of waves also moduli G(k)."""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.error_bounds import relative_part_bounds
from jampetsc.analysis.susceptibility import modulus_of_wave
from jampetsc.laws.probes import Forces, Points, Wave

MODULUS_BOUNDS = ("error_bound", "error_bound_storage", "error_bound_loss")  # on |ΔG*|, |ΔG'|, |ΔG''|


@dataclass(frozen=True, eq=False)
class ProbeResponse:
    """The response to a probe at M frequencies. P: 1 of waves and of an array, of points the number of particles."""

    probe: Wave | Points | Forces
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
        is_sample = isinstance(self.probe, Points)
        arrays = {"susceptibility": self.susceptibility}
        for name, bound in zip(MODULUS_BOUNDS, np.moveaxis(self.bounds, -1, 0), strict=True):
            arrays[f"susceptibility_{name}"] = bound
        for name, values in arrays.items():
            writer.dataset(name, values if is_sample else values[:, 0])
        if is_sample:
            writer.dataset("probe/particles", self.probe.chosen(self.particles))
        elif isinstance(self.probe, Forces):
            writer.dataset("probe/forces", self.probe.array)
        else:
            G, bounds = self.modulus
            writer.dataset("G", G)
            for name, bound in zip(MODULUS_BOUNDS, bounds.T, strict=True):
                writer.dataset(name, bound)
            writer.attributes(wave_vector=self.probe.vector(self.particles.cell))

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
        if isinstance(self.probe, Points) and len(chi) > 1:
            low, middle, high = np.quantile(chi.real, (0.0, 0.5, 1.0))
            return f"J' of {len(chi)} particles {low:.6g} to {high:.6g}, median {middle:.6g}"
        text = f"susceptibility {chi[0].real:.6g} {chi[0].imag:+.6g}i"
        if self.modulus is None:
            return text
        G = self.modulus[0][row]
        return f"{text}, G(k) = {G.real:.6g} {G.imag:+.6g}i"
