"""Minimise in this cell, at this area or at this pressure: from any disks to a proved minimum of energy or enthalpy.

L-BFGS comes first: it follows the rearrangements of a quench cheaply, and does not need the contacts of the minimum.
Newton's method then takes a few steps; if it does not converge, contacts still change, and L-BFGS continues to a tenth
of the forces. What has converged is proved a minimum; if it is a saddle, it is left along a mode of negative curvature.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.minimisation.descent import Descent, Effort, Goal, stress_unit
from jampetsc.minimisation.fire import fire_descent
from jampetsc.minimisation.newton import Limits, Newton, Point
from jampetsc.packing.contacts import IMBALANCE
from jampetsc.packing.packing import Packing, with_proof
from jampetsc.packing.threads import Team

NEWTON_START_FORCE = 1e-5  # max |F| / (p d^(D−1)) at which Newton's method is tried first
MAX_EVALUATIONS = 20_000_000  # force evaluations after which a minimisation is given up
SLICE = 20_000  # evaluations between two reports
MAX_SETTLING_EVALUATIONS = 20_000  # evaluations for the first relaxation of a random start
MAX_SADDLES = 20  # saddles left before the minimisation is given up or disks are shaken
SHAKE_LENGTH = 0.02  # largest move of disks in the first shake, in units of d; twice as far in each next one
MIN_JAMMED_PRESSURE = (
    1e-11  # pressure below which disks in a fixed cell do not touch, see `separated_pressure`
)


@dataclass(frozen=True)
class Minimum:
    """A result of `minimise`; the record of its disks holds the proof."""

    disks: Packing
    jammed: bool  # False: no two disks touch, so the energy is zero and nothing is proved
    pressure: float
    max_force: float  # over all disks, rattlers too
    limit: str  # what limits the forces: "tolerance", or "rounding" where that is larger
    modulus: float  # G₀ at fixed area, of the load-bearing contacts


def settle(
    disks: Packing, force: float, *, team: Team | None = None, effort: Effort | None = None
) -> Packing:
    """Random disks after a first relaxation in their cell, to max |F| ≤ force or for MAX_SETTLING_EVALUATIONS."""
    descent = Descent(disks, Goal(), team, effort)
    fire_descent(descent, force, MAX_SETTLING_EVALUATIONS)
    return descent.disks


def relax(
    disks: Packing, goal: Goal, force: float, *, team: Team | None = None, effort: Effort | None = None
):
    """Disks after L-BFGS to max |F| ≤ force and, where the cell moves, |Δp| ≤ force / d^(D−1); not a minimum yet.

    Raises ConvergenceError after MAX_EVALUATIONS.
    """
    descent = Descent(disks, goal, team, effort)
    while not _down_to(descent, force):
        pass
    return descent.disks


def minimise(
    disks: Packing,
    goal: Goal,
    solver,
    *,
    tolerance: float = 1e-10,
    shakes: int = 0,
    team: Team | None = None,
    effort: Effort | None = None,
) -> Minimum:
    """The minimum of the energy in the cell or at its area, or of the enthalpy at a pressure, downhill from `disks`.

    goal       what is held fixed
    solver     Cholesky factorisations of the Hessian, see `newton`
    tolerance  max |F| ≤ tolerance · p d^(D−1) over all disks, |Δp| and, where the cell shears, each |σ_xy| …
               ≤ tolerance · p; or what rounding leaves of them, if that is more
    shakes     how often disks may be shaken, each time farther, if no minimum is reached; they then reach another one
    team       threads to use
    effort     counts the cost

    Every minimum is proved by a Cholesky factorisation of its Hessian (see `newton`). In a fixed cell disks may come
    apart: then `jammed` is False. Raises ConvergenceError where no minimum is reached.
    """
    descent = Descent(disks, goal, team, effort)
    effort, newton, limits = descent.effort, Newton(descent, solver), Limits(descent, tolerance)
    fraction = NEWTON_START_FORCE
    while True:
        pressure = relax_to_fraction(descent, fraction, limits)
        if goal.pressure is None and pressure < separated_pressure(disks):
            return Minimum(descent.disks, False, pressure, Point.of(descent).residual.force, "tolerance", 0.0)
        if newton.converge(limits):
            descent.fold()  # so that the proof is of the disks that are returned, to the last bit
            point, modulus = Point.of(descent), newton.prove()
            if (
                modulus is None
                and effort.saddles < MAX_SADDLES * (effort.shakes + 1)
                and newton.leave_saddle()
            ):
                effort.saddles += 1
                fraction = NEWTON_START_FORCE
                continue
            if modulus is not None and point.residual.within(limits.at(point)):
                is_within_tolerance = point.residual.within(limits.of_tolerance(point.pressure))
                return Minimum(
                    with_proof(descent.disks),
                    True,
                    point.pressure,
                    point.residual.force,
                    "tolerance" if is_within_tolerance else "rounding",
                    modulus,
                )
        if fraction * descent.force_at(pressure) >= 0.1 * limits.at(Point.of(descent), pressure).force:
            fraction *= 0.1
            continue
        if effort.shakes == shakes:
            raise _failure(descent, pressure)
        shake(descent, SHAKE_LENGTH * 2.0**effort.shakes * descent.diameter)
        effort.shakes += 1
        fraction = NEWTON_START_FORCE


def proved(disks: Packing, solver) -> Packing:
    """The disks, with the proof in their record if their load-bearing contacts make them a minimum."""
    return disks if Newton(Descent(disks, Goal()), solver).prove() is None else with_proof(disks)


def shake(descent: Descent, reach: float):
    """Move every disk by up to `reach` along each axis.

    This leaves, for instance, a minimum in which a contact of less than `force_threshold` keeps a disk between two
    others: that disk counts as a rattler, so that the proof leaves it and its contacts out, and finds a mode without
    stiffness.
    """
    moves = np.random.default_rng(descent.n).uniform(-reach, reach, (descent.n, descent.dimension))
    descent.move(moves, np.zeros(len(descent.box)))


def _down_to(descent: Descent, force: float) -> bool:
    """One slice of L-BFGS; whether max |F| ≤ force is reached. Raises ConvergenceError after MAX_EVALUATIONS."""
    box_force = descent.dimension * descent.volume * force / descent.force_at(1.0)
    reached = descent.descend(force, box_force, SLICE)
    descent.effort.report(descent.effort)
    if not reached and descent.evaluations > MAX_EVALUATIONS:
        raise _failure(descent, Point.of(descent).pressure)
    return reached


def separated_pressure(disks) -> float:
    """Pressure below which disks in a fixed cell do not touch."""
    return disks.potential.force_limit(MIN_JAMMED_PRESSURE) * stress_unit(disks)


def relax_to_fraction(descent: Descent, fraction: float, limits: Limits) -> float:
    """Down to max |F| = fraction · p d^(D−1), or to rounding; p, which in a fixed cell decreases meanwhile."""
    force = np.inf
    while True:
        point = Point.of(descent)
        pressure = point.pressure if descent.goal.pressure is None else descent.goal.pressure
        if descent.goal.pressure is None and pressure < separated_pressure(descent.disks):
            return pressure
        descent.effort.residual = point.residual.force / descent.force_at(pressure)
        target = max(fraction * descent.force_at(pressure), 0.5 * limits.at(point, pressure).force)
        if force <= 2.0 * target:
            return pressure
        if _down_to(descent, target):
            force = target


def _failure(descent: Descent, pressure: float) -> ConvergenceError:
    """The error to raise where no minimum is reached."""
    force, effort = Point.of(descent).residual.force, descent.effort
    imbalance = (
        f"{IMBALANCE[descent.dimension]} = {force / descent.force_at(pressure):.1e}" if pressure > 0.0 else ""
    )
    return ConvergenceError(
        f"no minimum after {effort.evaluations} force evaluations and {effort.saddles} saddles: "
        f"{imbalance or 'p = 0'}"
    )
