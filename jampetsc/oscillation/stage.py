"""A stage of an implicit step without inertia: what it looks for, and Newton's method for it.

A stage is backward Euler over h from some places and strain, whatever holds the disks. Over the displacements w = h u,
where the law has them turns hΩ of disks, and the growth s of a free strain it minimises

    U(w, γ + s) − σV s + h R(w/h, s/h) ,

U of the springs that it is given, R that of the dashpots which these have where the stage begins, or where the last
velocities would lead: if dashpots came and went while w is looked for, there might be no minimum. Newton's method
takes the Hessian of that, and the same factor until it has served.

A step has two equal stages, L-stable and of second order (Alexander, SIAM J. Numer. Anal. 14, 1006 (1977)): stiff
motions are damped however long it is.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from jampetsc.errors import ConvergenceError, named
from jampetsc.minimise.newton import flat_between
from jampetsc.oscillation.dashpots import Dashpots

STAGE = 1.0 - np.sqrt(0.5)  # of a step
WEIGHTS = 1.0 - STAGE, STAGE  # of what is seen at the ends of the stages, in an integral over a step
TOLERANCE = 1e-9  # of forces, in units of what the strain amplitude makes
ROUNDED = 1e-15  # of forces, in units of k times the largest diameter
NOISE = 1e-14  # likewise; what does not get smaller is rounding if below this, or below TOLERANCE of damping forces
ITERATIONS = 100
WORN = 0.2  # a factor that leaves more of the residual than this is made anew
FLAT, STEEP = 0.3, 0.7  # of the force along a step, at its end: little is left of it, or nearly all
TRIES = 20  # points of a search
BENT = 10.0  # reaches: no disk moves farther in a bent step, whose curvature takes it no farther than one


@dataclass(frozen=True)
class Instant:
    """What is seen at the end of a stage."""

    gamma: float
    rate: float  # of strain
    stress: float  # σ_xy, elastic and viscous
    power: float  # dissipated
    unbalanced: float  # power, at most, of what Newton's method has left of the forces
    z: np.ndarray  # (contacts, damped) of the dashpots there were


@dataclass(frozen=True)
class Imposed:
    """What a stage is to end with: a strain and its rate or, where that is None, a stress."""

    gamma: float = 0.0
    rate: float = 0.0
    stress: float | None = None

    @property
    def free(self) -> bool:
        """Whether the strain is unknown."""
        return self.stress is not None


class Springs(Protocol):
    """What holds the disks of one packing; its states have `places` (N, 2) and `gamma`, the strain."""

    n: int  # disks
    dofs: int  # unknowns of each
    area: float
    largest: float  # diameter
    unit: float  # of forces, k times a diameter
    reach: float  # no disk moves farther towards others in one of Newton's steps

    def at(self, base, x, gamma: float):
        """The state with disks moved by x (N, 2) from the places `base`, at this strain."""

    def serves(self, state) -> bool:
        """Whether what is known of the springs is still enough there."""

    def pull(self, state):
        """−∂U/∂r (N, 2), and ∂U/∂γ."""

    def bend(self, state, x, growth: float):
        """Second derivatives of `pull` along moves x (N, 2) and a growth of the strain, stiffness unchanged."""

    def dashpots(self, state) -> Dashpots:
        """Those of the contacts there."""

    def factorise(self, state, dashpots: Dashpots, damping, free: bool):
        """The Hessian of a stage, for the next `solve`: see `StepMatrix`."""

    def solve(self, right):
        """(unknowns + 1,) for such a right-hand side."""


@dataclass(frozen=True, eq=False)
class _Seen:
    """A state that a stage tries: f at z and what is left of the forces, (unknowns + 1,) with that on γL."""

    state: object
    z: np.ndarray
    f: np.ndarray
    left: np.ndarray
    virial: float  # σV
    rate: float


@dataclass(frozen=True, eq=False)
class _Problem:
    """What one stage looks for, with unknowns q (N dofs + 1,): displacements and turns, last γL where it is free."""

    springs: Springs
    h: float
    base: np.ndarray  # (N, 2) where disks begin
    gamma: float  # where the strain begins, or is
    rate: float
    imposed: Imposed

    @property
    def length(self) -> float:
        """L = √V."""
        return float(np.sqrt(self.springs.area))

    def state(self, q):
        """Of the springs."""
        x = q[:-1].reshape(self.springs.n, -1)
        return self.springs.at(self.base, x[:, :2], self.gamma + float(q[-1]) / self.length)

    def look(self, q, dashpots: Dashpots) -> _Seen:
        """What is left of the forces at q."""
        n, h, state = self.springs.n, self.h, self.state(q)
        growth = self.rate + float(q[-1]) / self.length / h
        z = dashpots.velocities(q[:-1].reshape(n, -1), h * growth, h)
        f = dashpots.forces(z)
        left = -dashpots.on_disks(f, n)
        elastic, sheared = self.springs.pull(state)
        left[:, :2] += elastic
        left[:, :2] -= left[:, :2].mean(axis=0)  # rounding, which would move all disks, held by nothing, far
        virial = dashpots.on_strain(f) + sheared
        row = 0.0
        if self.imposed.free:
            row = (self.imposed.stress * self.springs.area - virial) / self.length
        return _Seen(state, z, f, np.append(left, row), virial, growth)

    def bend(self, state, step):
        """Second derivative of what is left of the forces along a straight step."""
        n = self.springs.n
        bend = np.zeros((n, self.springs.dofs))
        elastic, sheared = self.springs.bend(
            state, step[:-1].reshape(n, -1)[:, :2], float(step[-1]) / self.length
        )
        bend[:, :2] = elastic - elastic.mean(axis=0)
        return np.append(bend, -sheared / self.length if self.imposed.free else 0.0)

    def farthest(self, step) -> float:
        """How far a step takes some disk."""
        moved = float(np.hypot(*step[:-1].reshape(self.springs.n, -1)[:, :2].T).max())
        return max(moved + abs(float(step[-1])) / self.length * self.springs.largest, 1e-300)


class Stages:
    """Stages over h of one packing, one after the other; the factor of one serves the next.

    scale: strain amplitude, what forces are compared with
    """

    def __init__(self, springs: Springs, h: float, scale: float):
        self.springs, self.h = springs, h
        self.tolerance = max(TOLERANCE * scale, ROUNDED) * springs.unit
        self.finest = max(self.tolerance, NOISE * springs.unit)  # of forces that are looked for
        self.iterations = 0
        self.forget()

    def pace(self, h: float):
        """Stages have this length from now on."""
        if h != self.h:
            self.h = h
            self.forget()

    def forget(self):
        """The factor at hand is no longer one of these springs."""
        self._fresh = False

    def step(self, places, gamma, imposed, last):
        """(places, velocities, Instants) after a step of two stages that end with what is imposed.

        places, gamma   where it begins, (N, 2) and a strain
        last            velocities (N, dofs) and rate of strain before
        None where what is known of the springs does not serve for it. Raises ConvergenceError where it is too long.
        """
        base, instants = places, []
        for one in imposed:
            found = self._stage(base, gamma, one, last)
            if found is None:
                return None
            end, u, instant = found
            instants.append(instant)
            last = u, instant.rate
            base, first = base + (1.0 - STAGE) / STAGE * (end - base), end
            gamma += (1.0 - STAGE) / STAGE * (instant.gamma - gamma)
        return first, u, instants

    def _stage(self, base, gamma, imposed, last):
        """(places, velocities, Instant) at the end of a stage, or None."""
        springs, free = self.springs, imposed.free
        start = (gamma, 0.0) if free else (imposed.gamma, imposed.rate)
        problem = _Problem(springs, self.h, base, *start, imposed)
        q = np.zeros(springs.n * springs.dofs + 1)  # from here it is downhill
        if not springs.serves(problem.state(q)):
            return None
        dashpots = self._dashpots(problem, q, last)
        seen = problem.look(q, dashpots)
        predicted = seen.f
        for _ in range(ITERATIONS):
            size = np.abs(seen.left).max()
            if size <= self.tolerance:
                break
            tangents = dashpots.tangents(seen.z, predicted)
            fresh = not self._fresh
            if fresh:
                springs.factorise(seen.state, dashpots, tangents / self.h, free)
                self._fresh = True
            step = springs.solve(seen.left)
            bend = 0.5 * problem.bend(seen.state, step)
            if np.abs(bend).max() > self.tolerance:
                bend = springs.solve(bend)
            else:
                bend = np.zeros_like(step)
            before = seen
            q, seen = self._search(problem, dashpots, q, step, bend, seen.left)
            predicted = before.f + np.einsum("cab,cb->ca", tangents, seen.z - before.z)
            self.iterations += 1
            left = np.abs(seen.left).max()
            if fresh and WORN * size < left <= self._noise(seen, tangents, q):
                break
            if not left <= WORN * size:
                self._fresh = False
            if not springs.serves(seen.state):
                return None
        else:
            remedy = f"more {named('steps')}" + (
                f" or, if the packing flows, less {named('stress')}" if free else ""
            )
            raise ConvergenceError(
                f"forces of a time step are not balanced after {ITERATIONS} of Newton's steps, "
                f"{size / springs.unit:.1e} of k d is left: give {remedy}"
            )
        power, unbalanced = float(np.sum(seen.f * seen.z)), float(np.sum(np.abs(seen.left * q))) / self.h
        instant = Instant(seen.state.gamma, seen.rate, seen.virial / springs.area, power, unbalanced, seen.z)
        return seen.state.places, q[:-1].reshape(springs.n, -1) / self.h, instant

    def _noise(self, seen, tangents, q):
        """Forces that may be rounding; velocities of what moves far in a short stage are rounded as places are."""
        moved = ROUNDED * np.abs(tangents).max(initial=0.0) * np.abs(q).max() / self.h
        return NOISE * self.springs.unit + TOLERANCE * np.abs(seen.f).max(initial=0.0) + moved

    def _dashpots(self, problem, q, last):
        """Of contacts here, or where the last velocities lead: where a disk has slid off, it goes on otherwise."""
        ahead = np.append(
            self.h * last[0], self.h * last[1] * problem.length if problem.imposed.free else 0.0
        )
        found = []
        for place in (q, ahead):
            state = problem.state(place)
            if self.springs.serves(state):
                found.append((place, self.springs.dashpots(state)))
        if found[0][1] is found[-1][1]:
            return found[0][1]
        return min(found, key=lambda one: np.abs(problem.look(*one).left).max())[1]

    def _search(self, problem, dashpots, q, step, bend, left):
        """Where to go along a bent step, and what is there: its force is small there, or has begun to pull back."""
        pull, reach = np.vdot(step, left), self.springs.reach
        longest = min(BENT * reach / problem.farthest(step), np.sqrt(reach / problem.farthest(bend)))
        length, lower, upper = min(1.0, longest), (0.0, 1.0), None
        for _ in range(TRIES):
            end = q + length * (step + length * bend)
            found = problem.look(end, dashpots)
            now = np.vdot(step + 2.0 * length * bend, found.left) / pull
            if upper is None and now > STEEP and 2.0 * length <= longest:
                lower, length = (length, now), 2.0 * length  # the force does not give way: a disk slides off
                continue
            if abs(now) <= FLAT or (upper is None and now > 0.0):
                break
            if now < 0.0:
                upper = length, now
            else:
                lower = length, now
            length = flat_between(lower, upper)
        return end, found
