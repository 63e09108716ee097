"""Models of steady shear: a damping law, a mass or none, and the time step that fits them."""

import math
from dataclasses import dataclass

import numpy as np

from jampetsc.contacts.laws import Law
from jampetsc.errors import InputError

# Vågberg, thesis sec. 4.3: weights of the law (see `contacts.laws`), and whether disks have a mass.
MODELS = {
    "RD0": (Law("drag, overdamped", drag=1.0), False),
    "CD0": (Law("contact damping, overdamped", normal=1.0, transverse=1.0), False),
    "RD": (Law("drag", drag=1.0), True),
    "CD": (Law("contact damping", normal=1.0, transverse=1.0), True),
    "CDn": (Law("normal contact damping", normal=1.0), True),
    "CDt": (Law("tangential contact damping", transverse=1.0), True),
}
STRAIN_STEP = 5e-3  # largest γ̇Δt
QUALITY = 0.3  # Q below which damping is stiff and backward Euler takes over from velocity Verlet


@dataclass(frozen=True)
class Model:
    """What flows: law, mass m (0: overdamped), friction δ in units of k_d, name."""

    law: Law
    mass: float = 0.0
    friction: float = 0.0
    name: str = ""

    def __post_init__(self):
        law = self.law
        if not (math.isfinite(self.mass) and self.mass >= 0):
            raise InputError(f"--mass {self.mass:g}: must be positive; leave it out for overdamped disks")
        if not (math.isfinite(self.friction) and self.friction >= 0):
            raise InputError(f"--friction {self.friction:g}: must not be negative")
        if law.exponent != 1.0:
            raise InputError(f"--alpha {law.exponent:g}: flow has linear damping only; leave it out")
        held = law.drag + self.friction > 0
        if not self.mass and law.damps_contacts and (law.couples_rotations or not self._rigid) and not held:
            why = (
                "disks that roll have motions that no contact damps"
                if law.couples_rotations
                else "damping of one direction only leaves the other free"
            )
            raise InputError(f"{self}: no overdamped limit, because {why}: give --mass")
        if not self.mass and law.couples_rotations:
            raise InputError(f"{self}: disks that roll need --mass, or --no-rotations")
        if self.friction and not law.damps_contacts:
            raise InputError(f"--friction {self.friction:g}: belongs to contact damping, not to {self}")

    @property
    def _rigid(self):
        return self.law.normal > 0 and self.law.transverse > 0

    @property
    def drag(self) -> float:
        """Weight of |u|² per disk, in units of kτ₁."""
        return self.law.drag + self.friction

    def __str__(self):
        return self.name or str(self.law)


@dataclass(frozen=True)
class Scheme:
    """How a model is integrated: the time step and the method that suits it."""

    step: float  # Δt
    method: str  # "euler" | "heun" | "verlet" | "backward Euler"
    tolerance: float  # of the solve for velocities, |residual| / |forces|

    @property
    def heun(self) -> bool:
        """Whether a step has a predictor and a corrector."""
        return self.method == "heun"


def stiffest(disks) -> float:
    """Stiffness of the stiffest contact that these disks can have."""
    potential = disks.potential
    scale = float(potential.scale(2.0 * np.array(disks.radii.min())))
    return potential.k * (potential.alpha - 1.0) / scale**2


def scheme_for(model: Model, disks, rate: float, step=None, tolerance=1e-4) -> Scheme:
    """The scheme that suits a model at this rate; `step` overrides its time step.

    Times are those of the stiffest contact, k/σ² at the smallest σ, against damping c = kτ₁ × weight and mass m:
    drag 0.2 c/k (unstable from 0.56), contacts 0.5 c/k (unstable from 2), velocity Verlet 0.1 min(m/c, √(m/k)).
    """
    law, potential, stiffness = model.law, disks.potential, stiffest(disks)
    unit = potential.k * law.tau1
    weights = [unit * w for w in law.on_contacts if w]
    drag = unit * model.drag
    fast = rate * unit / stiffness > 5e-3
    if not model.mass:
        slowest = 0.5 * min(weights) / stiffness if weights else 0.2 * drag / stiffness
        method = "heun" if fast else "euler"
    else:
        swing = math.sqrt(model.mass / stiffness)
        # A disk's moment of inertia is half its mass times ρ²: sliding brakes it so much the faster.
        damping = max([*weights, drag, 4.0 * unit * law.sliding])
        # What brakes a disk in every direction makes it follow the forces; else it flies between collisions of m/c.
        braked = drag or (law.normal and law.transverse)
        if swing * stiffness / damping < QUALITY and braked and not law.couples_rotations:
            method, slowest = "backward Euler", 0.25 * damping / stiffness
        else:
            method, slowest = "verlet", 0.1 * min(model.mass / damping, swing)
    return Scheme(step or min(slowest, STRAIN_STEP / rate), method, tolerance)
