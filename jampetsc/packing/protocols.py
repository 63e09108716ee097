"""How packings are made: random starts, the path in pressure, and the quench down to the last digits."""

from dataclasses import dataclass, field

import numpy as np

from jampetsc.contacts.disks import Disks
from jampetsc.contacts.minimum import with_proof
from jampetsc.contacts.neighbours import spatial_order
from jampetsc.contacts.potentials import Potential
from jampetsc.contacts.state import measure
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.packing.fire import Goal, Quench
from jampetsc.packing.newton import Polish, limits

FIRST = 1e-3  # pressure in units of k from which a random start goes down decade by decade
LOOSE = 1e-2  # max |F| / (p d) to which the packings on the way are quenched
EVALUATIONS = 20_000_000  # of the forces, before a quench is given up
KICKS = 20  # ways out of saddles to try
UNJAMMED = 1e-11  # pressure in units of k below which disks at fixed cell do not touch


@dataclass(frozen=True)
class Target:
    """What the packing must fulfil: a pressure or a packing fraction, and how exactly."""

    pressure: float | None = None
    phi: float | None = None
    stabilise: str = "volume"  # "shear": σ_xy = 0 and a positive shear modulus, too
    tolerance: float = 1e-10  # max |F| / (p d) and |Δp| / p


@dataclass
class Effort:
    """What a quench has cost so far; `report` is called with it now and then."""

    evaluations: int = 0
    newton_steps: int = 0
    kicks: int = 0
    stage: str = ""
    residual: float = np.nan  # max |F| / (p d)
    report: object = field(default=lambda effort: None, repr=False)


def _generator(seed):
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))


def start_phi(pressure: float) -> float:
    """Packing fraction to start from for a pressure in units of k: near where it will end, a little above.

    A packing remembers the densest state it was quenched in: coming from p = 1e-2 raises φ at 1e-4 by 0.002.
    """
    return 0.85 + 3.5 * pressure


def random_start(radii, phi: float, seed: int, potential: Potential) -> Disks:
    """Disks at uniformly random places in a square cell of packing fraction `phi`, in spatial order.

    The generator is PCG64 seeded by SeedSequence(seed): the same packing on every machine and every rank.
    """
    radii = np.asarray(radii, float)
    side = np.sqrt(np.pi * np.sum(radii**2) / phi)
    positions = side * _generator(seed).random((len(radii), 2))
    cell = np.diag([side, side])
    order = spatial_order(positions, cell)
    return Disks.from_positions(positions[order], radii[order], cell, potential)


def make_packing(
    start: Disks, target: Target, solver, *, seed: int = 0, fresh: bool = True, effort=None
) -> Disks:
    """Quench `start` to `target` and record how; every random number follows from `seed`.

    fresh: a random start, relaxed in its cell first; otherwise a packing whose pressure is changed. At a
    target pressure the path goes down decade by decade, every packing on the way quenched to max |F| = 1e-2 p
    d. solver: see `newton`.

    Raises ConvergenceError where the packing misses the target, InputError for a φ below jamming.
    """
    effort = effort or Effort()
    quench = Quench(start, Goal())
    path = []
    if target.pressure is None:
        path.append(f"phi = {target.phi:.10g}")
    else:
        if fresh:
            effort.stage = "random start"
            quench.descend(1e-3 * _stress_unit(start), np.inf, 20_000)
            path.append(f"phi = {start.phi:.6g}")
            now = max(FIRST * _stress_unit(start), target.pressure)
        else:
            now = measure(start).pressure
            path.append(f"p = {now:.6g}")
        for pressure in [*_decades(now, target.pressure, fresh), target.pressure]:
            effort.stage = f"p = {pressure:.3g}"
            effort.report(effort)
            quench.goal = Goal(pressure, target.stabilise == "shear")
            quench.rest()
            path.append(f"p = {pressure:.6g}")
            if pressure != target.pressure:
                _loosely(quench, pressure)
    proof = _exactly(quench, target, solver, _generator([seed, 1]), effort)
    return _recorded(
        quench.disks, target, proof, ("random, " if fresh else "") + ", then ".join(path), effort
    )


def _stress_unit(disks):
    """k/d^… : pressure of order one for this potential."""
    return float(disks.potential.k) / (
        float(np.mean(2 * disks.radii)) ** 2 if disks.potential.stiffness != "constant" else 1.0
    )


def _decades(now, wanted, include_first):
    """Pressures between `now` and a lower `wanted`, a decade apart."""
    steps = int(np.ceil(np.log10(now / wanted) - 1e-9)) if now > wanted else 0
    return [now * 10.0**-s for s in range(0 if include_first else 1, steps)]


def _loosely(quench, pressure):
    d = 2.0 * float(np.mean(quench.disks.radii))
    quench.descend(LOOSE * pressure * d, 2.0 * LOOSE * pressure * quench.disks.area, EVALUATIONS)


def _exactly(quench, target, solver, generator, effort) -> Polish:
    """FIRE and Newton in turn until the packing is a converged minimum; returns the Newton that proved it."""
    d = 2.0 * float(np.mean(quench.disks.radii))
    fraction = LOOSE
    before = effort.newton_steps
    polish = Polish(quench, solver)
    while True:
        polish.look()
        pressure = polish.pressure if target.pressure is None else target.pressure
        if (
            target.pressure is None
            and pressure < UNJAMMED * _stress_unit(quench.disks)
            and effort.evaluations
        ):
            raise InputError(f"phi = {target.phi:.6g}: the disks do not touch: choose a larger --phi")
        wanted = limits(quench.disks, pressure, target.tolerance)
        goal = max(fraction * pressure * d, 0.5 * wanted.force)
        reached, force, _ = quench.descend(goal, 2.0 * quench.disks.area * goal / d, EVALUATIONS // 100)
        effort.evaluations = quench.evaluations
        effort.residual = force / (pressure * d)
        effort.report(effort)
        if reached:
            if polish.converge(limits(quench.disks, pressure, target.tolerance)):
                effort.newton_steps = before + polish.steps
                return polish
            effort.newton_steps = before + polish.steps
            if goal <= 0.5 * wanted.force:
                # FIRE is as far as rounding lets it and still this is no minimum: a saddle. Leave it.
                # A small kick would fade before it grows.
                size = 0.1 * 1.5**effort.kicks * quench.usual_overlap()
                quench.offsets += size * generator.standard_normal(quench.offsets.shape)
                effort.kicks += 1
                fraction = LOOSE
            fraction *= 0.2
        if quench.evaluations > EVALUATIONS or effort.kicks > KICKS:
            residual = polish.look()
            raise ConvergenceError(
                f"quench stopped after {quench.evaluations} force evaluations and {effort.kicks} kicks with "
                f"max|F|/(p d) = {residual.force / (pressure * d):.1e}: "
                "use another --seed, or a larger --tolerance"
            )


def _recorded(disks, target, proof, protocol, effort) -> Disks:
    state = measure(disks)
    return with_proof(disks).with_record(
        pressure=state.pressure,
        phi=disks.phi,
        energy=state.energy,
        max_force=state.max_force,
        coordination=state.coordination,
        rattlers=int(np.count_nonzero(state.rattlers)),
        shear_stress=float(state.stress[0, 1]),
        shear_modulus=proof.modulus,
        protocol=protocol,
        stabilise=target.stabilise,
        tolerance=target.tolerance,
        evaluations=effort.evaluations,
        newton_steps=effort.newton_steps,
    )
