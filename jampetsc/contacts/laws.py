"""Damping laws: what dissipates, and which unknowns that needs."""

import math
from dataclasses import dataclass

from jampetsc.errors import InputError

KINDS = ("contact", "stokes")


@dataclass(frozen=True)
class Law:
    """A linear damping law together with the pre-stress switch of K.

    contact:  kτ₁ Σ_c [(Δu∥)² + β (Δu⊥ᶜ)²]   (BT eqs. 5, 6), with particle rotations in Δu⊥ᶜ unless switched off
    stokes:   kτ₁ Σ_i |ũ_i|² + η_F V γ²       (BT eqs. 7, 8), η_F in units of kτ₁

    Raises InputError for values out of range.
    """

    kind: str = "contact"  # contact | stokes
    beta: float = 1.0  # ratio of transverse to normal damping, ≥ 0
    rotations: bool = True  # disks roll (contact law only)
    eta_f: float = 1.0  # viscosity of the fluid (Stokes law only), ≥ 0
    prestress: bool = True  # keep the −f/r term of K (BT eq. 4)
    tau1: float = 1.0  # damping time τ₁ > 0

    def __post_init__(self):
        if self.kind not in KINDS:
            raise InputError(f"--law {self.kind}: choose one of {', '.join(KINDS)}")
        for name, value in (("beta", self.beta), ("eta-f", self.eta_f)):
            if not (math.isfinite(value) and 0 <= value <= 1e12):
                raise InputError(f"--{name} {value:g}: must lie between 0 and 1e12")
        if not (math.isfinite(self.tau1) and self.tau1 > 0):
            raise InputError(f"--tau1 {self.tau1:g}: must be positive")

    @property
    def couples_rotations(self) -> bool:
        """Whether the law needs the angles θ: only transverse contact damping couples to them."""
        return self.kind == "contact" and self.rotations and self.beta > 0

    @property
    def dofs(self) -> int:
        """Unknowns per disk: (x, y, θ) or (x, y)."""
        return 3 if self.couples_rotations else 2

    @property
    def parameters(self) -> dict:
        """The parameters that this law really has, for files and messages."""
        common = {"law": self.kind, "prestress": self.prestress, "tau1": self.tau1}
        if self.kind == "stokes":
            return {**common, "eta_f": self.eta_f}
        return {**common, "beta": self.beta, "rotations": self.rotations}

    def __str__(self):
        stress = "" if self.prestress else ", no pre-stress"
        if self.kind == "stokes":
            return f"Stokes drag, eta_f = {self.eta_f:g}{stress}"
        return f"contact damping, beta = {self.beta:g}{'' if self.rotations else ', no rotations'}{stress}"
