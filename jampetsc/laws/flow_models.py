"""Models of steady shear: a damping law, a mass or none, and the time step that fits them.

MODELS is the table of those that have a name; the functions RD0(), CD0(), RD(mass=…) … of this module, the command's
choices and its messages follow from it: a new model is one more row.
"""

import inspect
import math
from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import InputError, as_float, named, python_value
from jampetsc.laws.damping import MAX_WEIGHT, Law, refuse_beyond

# Vågberg, thesis sec. 4.3: weights of the law (see `laws.damping`), and whether disks have a mass.
MODELS = {
    "RD0": (Law("drag, overdamped", drag=1.0), False),
    "CD0": (Law("contact damping, overdamped", normal=1.0, transverse=1.0), False),
    "RD": (Law("drag", drag=1.0), True),
    "CD": (Law("contact damping", normal=1.0, transverse=1.0), True),
    "CDn": (Law("normal contact damping", normal=1.0), True),
    "CDt": (Law("tangential contact damping", transverse=1.0), True),
}
FLOW_WEIGHTS = "normal", "transverse", "sliding", "drag", "eta_f"  # of laws that the kernels of flows compute
STRAIN_STEP = 5e-3  # largest γ̇Δt
MAX_LIST_STRAIN = 0.1  # d/σ_max: largest γ̇Δt for which a pair list serves more than one step
SIZE_MARGIN = (
    1.5  # contacts of the largest particle, and their lengths, over the mean ones, that steps allow for
)
# by dimension, as the largest eigenvalues are: of the Hessian 3.6 and 6.1 k/σ², of contact damping 6.7 and 15 c
DRAG_STEP, VERLET_STEP = {2: 0.2, 3: 0.12}, {2: 0.1, 3: 0.04}
INERTIA = {2: 0.5, 3: 0.4}  # moment of a uniform disk and sphere, in units of m ρ²
QUALITY = 0.3  # Q below which damping is stiff and backward Euler takes over from velocity Verlet


@dataclass(frozen=True)
class Model:
    """Damping and mass of the disks of a flow.

    law              damping law
    mass             m of every disk, 0: overdamped
    background_drag  δ, drag beside contact damping, in units of k_d
    name             its name in MODELS, if it has one
    quality          Q = √(m k)/(k τ₁), which sets the mass when the stiffness k is known, see `of_stiffness`

    Raises InputError for values out of range and where overdamped motion has no unique velocities.
    """

    law: Law
    mass: float = 0.0
    background_drag: float = 0.0
    name: str = ""
    quality: float | None = None

    def __post_init__(self):
        law = self.law
        for name in ("mass", "background_drag", "quality"):
            object.__setattr__(self, name, python_value(getattr(self, name)))
        for name in ("mass", "background_drag"):
            refuse_beyond(named(name), getattr(self, name))
        if self.quality is not None and not 0 < self.quality <= MAX_WEIGHT:
            quality = f"{named('quality')} {as_float(self.quality):g}"
            raise InputError(f"{quality}: must be positive and at most {MAX_WEIGHT:g}")
        if self.quality is not None and self.mass:
            raise InputError(
                f"{named('quality')} {self.quality:g}, {named('mass')}: both given. Give one of them."
            )
        if law.tau1 > MAX_WEIGHT:
            raise InputError(f"{named('tau1')} {law.tau1:g}: must be at most {MAX_WEIGHT:g}")
        law.require_dissipation()
        law.require_only(FLOW_WEIGHTS, "flow")
        if law.exponent != 1.0:
            raise InputError(
                f"{named('alpha')} {law.exponent:g}: not supported, flow has linear damping. Leave it out."
            )
        if self.background_drag and not law.damps_contacts:
            raise InputError(
                f"{named('background_drag')} {self.background_drag:g}: an option of contact damping, not of {self}. "
                "Leave it out."
            )
        if self.massive:
            return
        remedy = f"give {named('mass')}"  # otherwise forces do not determine the velocities
        if law.couples_rotations:
            raise InputError(
                f"{self}: no overdamped limit, because particles that roll have motions that no contact damps: "
                f"{remedy}, or switch rotations off ({named('rotations')})"
            )
        if law.damps_contacts and not (law.normal and law.transverse) and not self.drag:
            raise InputError(
                f"{self}: no overdamped limit, because damping of one direction only leaves the other free: {remedy}"
            )

    @property
    def massive(self) -> bool:
        """Whether disks have a mass."""
        return bool(self.mass or self.quality)

    @property
    def drag(self) -> float:
        """Weight of |u|² per disk, in units of kτ₁."""
        return self.law.drag + self.background_drag

    def of_stiffness(self, k: float) -> "Model":
        """The model with its mass, Q² k τ₁² if it was given by a quality Q."""
        if self.quality is None:
            return self
        return replace(self, mass=self.quality**2 * k * self.law.tau1**2, quality=None)

    def __str__(self):
        return self.name or str(self.law)


def model_of(name: str, *, mass=None, quality=None, background_drag=0.0, tau1=1.0) -> Model:
    """The model of this name, see `Model`. Raises InputError for a name not in MODELS and as `Model`."""
    if name not in MODELS:
        raise InputError(f"{named('model')} {name}: not supported. Choose one of {', '.join(MODELS)}.")
    law, massive = MODELS[name]
    if massive and not mass and quality is None:
        limit = (
            f" The overdamped limit is {name}0." if f"{name}0" in MODELS else " It has no overdamped limit."
        )
        raise InputError(
            f"{named('model')} {name}: no mass. Give a positive {named('mass')} or {named('quality')}.{limit}"
        )
    if not massive and (mass is not None or quality is not None):
        option = "quality" if mass is None else "mass"
        other = f", or give model {name[:-1]}" if name[:-1] in MODELS else ""
        raise InputError(f"{named(option)}: not of {named('model')} {name}, overdamped. Leave it out{other}.")
    return Model(replace(law, tau1=tau1), mass or 0.0, background_drag, name, quality)


def _maker(name):
    """The function that makes the model of this name."""
    law, massive = MODELS[name]

    def make(**options):
        bound = make.__signature__.bind(**options)
        return model_of(name, **bound.arguments)

    options = {"mass": None, "quality": None} if massive else {}
    options |= ({"background_drag": 0.0} if law.damps_contacts else {}) | {"tau1": 1.0}
    keyword = inspect.Parameter.KEYWORD_ONLY
    make.__signature__ = inspect.Signature(
        [inspect.Parameter(option, keyword, default=default) for option, default in options.items()]
    )
    make.__name__ = make.__qualname__ = name
    make.__doc__ = (
        f"{law.label[0].upper()}{law.label[1:]} (Vågberg, thesis sec. 4.3), see `Model` and `model_of`."
    )
    return make


globals().update({name: _maker(name) for name in MODELS})  # jampetsc.models.CD0() …


@dataclass(frozen=True)
class Scheme:
    """How a model is integrated: time step, method and tolerance."""

    step: float  # Δt
    method: str  # "euler" | "heun" | "verlet" | "backward Euler"
    tolerance: float  # of the solve for velocities, |residual| / |forces|

    @property
    def heun(self) -> bool:
        """Whether a step has a predictor and a corrector."""
        return self.method == "heun"


def stiffest(disks) -> float:
    """Stiffness of the stiffest contact that these disks can have."""
    return disks.potential.largest_stiffness(2.0 * float(disks.radii.min()))


def crowding(disks) -> float:
    """How many times more contacts the largest particle may have than steps allow for, at least 1.

    Particles of mean radius r around one of radius R are in proportion to (R + r)^(D−1).
    """
    return max(1.0, (0.5 * (1.0 + _ratio(disks))) ** (disks.dimension - 1) / SIZE_MARGIN)


def _ratio(disks) -> float:
    """Largest radius over the mean radius."""
    return float(disks.radii.max() / np.mean(disks.radii))


def stiffest_motion(disks) -> float:
    """Stiffness of the stiffest motion of one particle, in units in which it is `stiffest` where sizes are alike."""
    large = disks.potential.largest_stiffness(float(disks.radii.max() + disks.radii.min()))
    return max(stiffest(disks), crowding(disks) * large)


def scheme_for(model: Model, disks, rate: float, step=None, tolerance=1e-4) -> Scheme:
    """The scheme that suits a model at this rate; `step` overrides its time step.

    Δt follows from the stiffest contact, k/σ² at the smallest σ, damping c = kτ₁ × weight and mass m: drag 0.2 c/k
    (unstable from 0.56), contacts 0.5 c/k (unstable from 2), backward Euler 0.25 c/k, velocity Verlet
    0.1 min(m/c, √(m/k)); of spheres, which have more contacts, 0.12 (unstable from 0.33) and 0.04 in place of 0.2 and
    0.1. c is the weakest of several without mass, the strongest with. A large particle among small ones has more
    contacts: see `crowding` and `stiffest_motion`.
    """
    law, potential, stiffness = model.law, disks.potential, stiffest(disks)
    crowd, moved = crowding(disks), stiffest_motion(disks)
    gripped = stiffness * max(1.0, _ratio(disks) / SIZE_MARGIN)  # long contacts slip more in a step
    unit = potential.k * law.tau1
    weights = [unit * w for w in law.on_contacts if w]
    drag = unit * model.drag
    fast = rate * unit / stiffness > 5e-3
    if not model.mass:
        longest = 0.5 * min(weights) / gripped if weights else DRAG_STEP[disks.dimension] * drag / moved
        method = "heun" if fast else "euler"
    else:
        swing = math.sqrt(model.mass / moved)
        # The moment of inertia is less than m ρ²: sliding damps spins at a higher rate than velocities.
        sliding = 2.0 / INERTIA[disks.dimension] * unit * law.sliding
        damping = max([*weights, drag, sliding])
        # Damped in every direction, a disk follows the forces; else it flies freely between collisions that last m/c.
        braked = drag or (law.normal and law.transverse)
        if swing * stiffness / damping < QUALITY and braked and not law.couples_rotations:
            method, longest = "backward Euler", 0.25 * damping / (gripped if weights else moved)
        else:
            damping = max([crowd * max([*weights, sliding]), drag])
            method, longest = "verlet", VERLET_STEP[disks.dimension] * min(model.mass / damping, swing)
    strain = min(STRAIN_STEP, MAX_LIST_STRAIN / _ratio(disks))
    return Scheme(step or min(longest, strain / rate), method, tolerance)
