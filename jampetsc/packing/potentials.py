"""Pair potentials of soft disks: harmonic and Hertzian, in both stiffness conventions.

With σ = ρ_i + ρ_j the sum of the radii, δ = σ − r the overlap and α = 2 (harmonic) or 5/2 (Hertzian):

    constant                  V = (k/α) δ^α           (d = 1 sets the length; BT: U = ½ k δ²)
    inverse-square-diameter   V = (k/α) (δ/σ)^α       (Vågberg, thesis eq. 4.7, k = k_e)

The one formula behind energies, forces and stiffnesses, here and (compiled by numba) in the loop of `kernel`, is the
secant stiffness f/δ: V = (f/δ) δ²/α, f = (f/δ) δ and d²V/dr² = (α − 1) f/δ.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError
from jampetsc.packing.elementary import exp, log

EXPONENTS = {"harmonic": 2.0, "hertzian": 2.5}
MAX_STIFFNESS = 1e150  # largest k: squares of stresses then stay in the range of doubles
STIFFNESSES = ("constant", "inverse-square-diameter")


def secant_stiffness(overlap, sigma, constants):
    """f/δ of contacts with overlap δ ≥ 0, numbers or arrays; constants = `Potential.constants`."""
    k, hertzian, scaled = constants
    unit = 1.0 / sigma if scaled else 1.0
    secant = k * unit * unit
    return secant * np.sqrt(unit * overlap) if hertzian else secant


@dataclass(frozen=True)
class Potential:
    """A repulsive contact potential. Raises InputError for an unknown name or k out of range."""

    kind: str = "harmonic"  # harmonic | hertzian
    stiffness: str = "constant"  # constant | inverse-square-diameter
    k: float = 1.0  # contact stiffness k, or k_e where the stiffness is k_e/σ²

    def __post_init__(self):
        if self.kind not in tuple(EXPONENTS):  # a tuple, as a kind of a wrong type may not be hashable
            raise InputError(f"potential {self.kind!r}: not supported. Choose one of {', '.join(EXPONENTS)}.")
        if self.stiffness not in STIFFNESSES:
            raise InputError(
                f"stiffness {self.stiffness!r}: not supported. Choose one of {', '.join(STIFFNESSES)}."
            )
        if not 1.0 / MAX_STIFFNESS <= self.k <= MAX_STIFFNESS:
            raise InputError(
                f"stiffness k = {self.k}: must be a positive number, from {1.0 / MAX_STIFFNESS:g} to {MAX_STIFFNESS:g}"
            )

    @property
    def alpha(self) -> float:
        """Exponent of the potential: 2 or 5/2."""
        return EXPONENTS[self.kind]

    @property
    def constants(self) -> tuple[float, bool, bool]:
        """(k, hertzian, scaled by the diameter): the potential as compiled loops take it."""
        return self.k, self.kind == "hertzian", self.stiffness == "inverse-square-diameter"

    def scale(self, sigma):
        """Length by which overlaps are measured: σ, or the unit of length (shape of sigma)."""
        return sigma if self.stiffness == "inverse-square-diameter" else np.ones_like(sigma)

    def overlap_at(self, force: float, diameter: float) -> float:
        """Overlap of two disks of this diameter that repel each other with this force."""
        scale = float(self.scale(np.array(diameter)))
        ratio = force * scale / self.k
        return scale * (exp(log(ratio) / 1.5) if self.kind == "hertzian" and ratio > 0.0 else ratio)

    def energy(self, overlap, sigma):
        """V(δ) per contact; overlap δ ≥ 0 and sigma are arrays (M,)."""
        return self.force(overlap, sigma) * overlap / self.alpha

    def force(self, overlap, sigma):
        """Repulsive force f = −dV/dr ≥ 0 per contact, (M,)."""
        return secant_stiffness(overlap, sigma, self.constants) * overlap

    def contact_stiffness(self, overlap, sigma):
        """d²V/dr² per contact, (M,): the k of BT eq. 4."""
        secant = secant_stiffness(overlap, sigma, self.constants)
        return (self.alpha - 1.0) * np.broadcast_to(secant, np.shape(overlap))
