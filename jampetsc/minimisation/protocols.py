"""How packings are made: random starts, the path in pressure, and the minimum at its end."""

import math
from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError
from jampetsc.minimisation.descent import Effort, Goal, stress_unit
from jampetsc.minimisation.isotropic import relax_sides
from jampetsc.minimisation.minimise import Minimum, minimise, relax, settle
from jampetsc.packing.compiled import instruction_set
from jampetsc.packing.contacts import measure, typical_force
from jampetsc.packing.elementary import exp, log
from jampetsc.packing.neighbours import spatial_order
from jampetsc.packing.packing import PARTICLES, Packing, deformed
from jampetsc.packing.particles import UNIT_BALL
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import growth_of
from jampetsc.packing.threads import Team

# `Potential.force_limit` of the pressure in units of k from which a random start is decompressed decade by decade
START_PRESSURE = 1e-3
PATH_TOLERANCE = 1e-2  # max |F| / (p d^(D−1)) to which the packings on the way are quenched
SIDES_TOLERANCE = 1e-4  # to which the sides of the cell of spheres relax on the way
MAX_SHAKES = 4  # of a packing for which no minimum is found, before that is an error
START_PHI = {2: 0.85, 3: 0.66}  # by dimension, at p → 0: a little above φ_J
START_FORCE = 1e-3  # likewise of max |F| / (k d) to which a random start is relaxed in its cell


@dataclass(frozen=True)
class Target:
    """The pressure or packing fraction that a packing must have, and how exactly."""

    pressure: float | None = None
    phi: float | None = None
    # "shear": also no shear stress and positive shear moduli; "all": also equal normal stresses, stable to all strains
    stabilise: str = "volume"
    tolerance: float = 1e-10  # max |F| / (p d^(D−1)) and |Δp| / p


def _generator(seed):
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))


def start_phi(pressure: float, dimension: int = 2) -> float:
    """Packing fraction to start from for a pressure in units of k: a little above the final one.

    A packing remembers the densest state it was quenched in: coming from p = 1e-2 raises φ at 1e-4 by 0.002.
    """
    return START_PHI[dimension] + 3.5 * pressure


def random_start(
    radii, phi: float, seed, potential: Potential, separated: bool = False, dimension: int = 2
) -> Packing:
    """The disks of `random_places` in the order of a curve through the cell, good for caches and domains."""
    start = random_places(radii, phi, seed, potential, separated, dimension)
    return start.reordered(spatial_order(start.positions, start.cell))


def random_places(
    radii, phi: float, seed, potential: Potential, separated: bool = False, dimension: int = 2
) -> Packing:
    """Disks at uniformly random places in a square cell of packing fraction `phi`, or spheres in a cube.

    separated: those above the mean radius at x < s L_x, the others beyond, s such that both sides have this `phi`.
    The generator is PCG64 seeded by SeedSequence(seed), a number or several: the same packing on every machine and
    every rank.
    """
    radii = np.asarray(radii, float)
    volume = UNIT_BALL[dimension] * np.sum(radii**dimension) / phi
    side = np.sqrt(volume) if dimension == 2 else exp(log(volume) / 3.0)
    places = _generator(seed).random((len(radii), dimension))
    if separated:
        large = radii > radii.mean()
        share = np.sum(radii[large] ** dimension) / np.sum(radii**dimension)
        places[:, 0] = np.where(large, share * places[:, 0], share + (1.0 - share) * places[:, 0])
    positions = side * places
    return Packing.from_positions(positions, radii, np.diag([side] * dimension), potential)


def changed(disks: Packing, target: Target) -> Packing:
    """The disks from which another packing is made: compressed evenly to the φ of the target, if it has one.

    Raises InputError where no disks touch: the pressure is zero.
    """
    disks = disks.replace(record={})
    if target.phi is None:
        if measure(disks).pressure <= 0:
            raise InputError(
                "no particles touch, so the pressure is 0. Give a packing fraction, or use a random start."
            )
        return disks
    return rescaled(disks, target.phi)


def rescaled(disks: Packing, phi: float) -> Packing:
    """The disks in a cell of packing fraction φ, all lengths but radii scaled."""
    growth = log(disks.phi / phi) / disks.dimension
    return deformed(disks, np.zeros(disks.base.shape), growth_of(growth, disks.dimension))


def make_packing(
    start: Packing,
    target: Target,
    solver,
    *,
    fresh: bool = True,
    team: Team | None = None,
    effort: Effort | None = None,
) -> Packing:
    """Quench `start` to `target` and record how.

    fresh: a random start, relaxed in its cell first; otherwise a packing whose pressure is changed. At a
    target pressure the path goes down decade by decade, every packing on the way relaxed to max |F| = 1e-2 p
    d. At a target φ the disks come to rest in their cell; to stabilise "shear" the cell then shears at this φ, to a
    minimum of U over positions and γ, where dU/dγ = V σ_xy = 0; to stabilise "all" its sides relax as well, of spheres
    at every pressure on the way. solver: see `newton`. team: the threads to do it with; how many does not change the
    packing.

    Raises ConvergenceError where no minimum is reached, InputError for a φ below jamming.
    """
    effort = effort or Effort()
    settings = {"shakes": MAX_SHAKES, "team": team, "effort": effort}
    disks, path = start, []
    if target.pressure is None:
        goal = Goal()
        path.append(f"phi = {target.phi:.10g}")
    else:
        goal = Goal(target.pressure, target.stabilise != "volume")
        unit, limit = stress_unit(disks), disks.potential.force_limit
        if fresh:
            effort.stage = "random start"
            disks = settle(disks, typical_force(disks, limit(START_FORCE) * unit), team=team, effort=effort)
            path.append(f"phi = {start.phi:.6g}")
            first = max(limit(START_PRESSURE) * unit, target.pressure)
        else:
            first = measure(start).pressure
            path.append(f"p = {first:.6g}")
        for pressure in pressures_between(first, target.pressure, fresh):
            effort.stage = f"p = {pressure:.3g}"
            intermediate = Goal(pressure, goal.shear)
            disks = relax(
                disks, intermediate, PATH_TOLERANCE * typical_force(disks, pressure), team=team, effort=effort
            )
            # at low pressure alone the two stretches of a cell of spheres rarely relax
            if target.stabilise == "all" and disks.dimension == 3:
                minimum = minimise(disks, intermediate, solver, tolerance=SIDES_TOLERANCE, **settings)
                disks = relax_sides(
                    minimum, intermediate, solver, tolerance=SIDES_TOLERANCE, **settings
                ).disks
            path.append(f"p = {pressure:.6g}")
        effort.stage = f"p = {target.pressure:.3g}"
        path.append(f"p = {target.pressure:.6g}")
    settings["tolerance"] = target.tolerance
    minimum = minimise(disks, goal, solver, **settings)
    if target.pressure is None and target.stabilise != "volume" and minimum.jammed:
        path.append("shear_stress = 0")
        goal = Goal(shear=True)
        minimum = minimise(minimum.disks, goal, solver, **settings)
    if target.stabilise == "all" and minimum.jammed:
        path.append("isotropic stress")
        minimum = relax_sides(minimum, goal, solver, **settings)
    if not minimum.jammed:
        particles = PARTICLES[minimum.disks.dimension]
        raise InputError(
            f"phi = {target.phi:.6g}: the {particles} do not touch. Choose a larger packing fraction."
        )
    path += ["shaken"] * effort.shakes
    return _recorded(minimum, target, ("random, " if fresh else "") + ", then ".join(path), effort)


def pressures_between(start, end, include_first):
    """Pressures from `start` down to `end`, a decade apart."""
    steps = math.ceil(math.log10(start / end) - 1e-9) if start > end else 0
    return [start * float(f"1e-{s}") for s in range(0 if include_first else 1, steps)]


def _recorded(minimum: Minimum, target, protocol, effort) -> Packing:
    disks, state = minimum.disks, measure(minimum.disks)
    return disks.with_record(
        pressure=state.pressure,
        phi=disks.phi,
        energy=state.energy,
        max_force=state.max_force,
        coordination=state.coordination,
        rattlers=int(np.count_nonzero(state.rattlers)),
        shear_stress=float(state.stress[0, 1]),
        shear_modulus=float(minimum.modulus),
        protocol=protocol,
        stabilise=target.stabilise,
        tolerance=target.tolerance,
        limited_by=minimum.limit,
        evaluations=effort.evaluations,
        newton_steps=effort.newton_steps,
        instruction_set=instruction_set(),
    )
