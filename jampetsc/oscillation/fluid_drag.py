"""Drag of the fluid around moving disks: forces ∝ their velocities and spins relative to the affine flow.

The rows of single disks and of the fluid in the dissipation of `laws.damping`,

    2R = kτ₁ { Σ_i [ drag |u_i|² + spin_drag d² |θ̇_i − γ̇Ω|² ] + 2 η_F s:s γ̇² V } ,

s the deviator and Ω the rotation of the affine flow of unit rate. Spins are multiplied by d, as in `moving_contacts`.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.laws.damping import Law
from jampetsc.laws.loads import Load, fluid_dissipation


@dataclass(frozen=True, eq=False)
class FluidDrag:
    """The drag in one affine flow. Velocities u are (N, dofs), with spins times d where the law has them."""

    weights: np.ndarray  # (dofs,) force over velocity
    rotation: np.ndarray  # (dofs,) d Ω in the places of spins, else 0
    viscous: float  # force on the strain over its rate, of the fluid alone

    @classmethod
    def of(cls, law: Law, flow: Load, k: float, diameter: float, volume: float) -> "FluidDrag":
        """Of a law in an affine flow of unit rate.

        k: stiffness of a contact; diameter: d; volume: of the cell
        """
        unit, dimension = k * law.tau1, flow.dimension
        dofs, rotation = law.dofs(dimension), np.zeros(law.dofs(dimension))
        rotation[dimension:] = diameter * flow.rotation[: dofs - dimension]
        weights = unit * np.array(law.on_disks(dimension, 1.0)[:dofs])
        return cls(weights, rotation, unit * law.eta_f * fluid_dissipation(flow, flow) * volume)

    def on_disks(self, u, rate: float):
        """∂R/∂u (N, dofs) at this rate of strain: the forces that balance the drag."""
        return self.weights * (u - rate * self.rotation)

    def on_strain(self, u, rate: float) -> float:
        """∂R/∂γ̇: viscous stress of the load times volume."""
        turned = self.weights * self.rotation
        return self.viscous * rate - float(np.sum(turned * (u - rate * self.rotation)))

    def power(self, u, rate: float) -> float:
        """2R, the power dissipated."""
        return float(np.sum(self.weights * (u - rate * self.rotation) ** 2)) + self.viscous * rate**2
