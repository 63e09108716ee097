"""A time step without inertia, in two implicit stages, each solved by Newton's method.

A stage is backward Euler over a time h. It minimises, over the displacements w = h u of the disks, their rotations hΩ
where the law has them, and the growth s of the strain where a stress is imposed,

    U(w, γ + s) − σV s + h R(w/h, s/h) ,

U the energy of the springs, R the dissipation potential of the dashpots and of the fluid. The set of dashpots is fixed
during a stage: if it changed, there might be no minimum. It holds the contacts at the beginning of the stage, or at the
positions to which the last velocities lead. Newton's method keeps a factor of the Hessian as long as it reduces the
residual well.

A step has two stages of equal length; this method is L-stable, so that stiff motions are damped however long a step is,
and of second order (Alexander, SIAM J. Numer. Anal. 14, 1006 (1977)).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from jampetsc.errors import ConvergenceError, named
from jampetsc.laws.loads import Load
from jampetsc.minimisation.hessian import Bonds
from jampetsc.minimisation.newton import flat_between
from jampetsc.oscillation.dashpots import Dashpots
from jampetsc.oscillation.drive import Imposed
from jampetsc.oscillation.fluid_drag import FluidDrag
from jampetsc.oscillation.step_matrix import StepMatrix
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.neighbours import longest
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import Strain

STAGE = 1.0 - np.sqrt(0.5)  # of a step
WEIGHTS = 1.0 - STAGE, STAGE  # of the ends of the stages, in an integral over a step
# of forces, in units of k times the largest diameter times the strain amplitude, if not given
TOLERANCE = 1e-7
ROUNDING_FORCE = 1e-15  # of forces, in units of k times the largest diameter
# likewise; a residual that stops falling below it, or below TOLERANCE of damping forces, is rounding
NOISE_FORCE = 1e-14
MAX_ITERATIONS = 100
MAX_CONTRACTION = 0.2  # a factor with which a step leaves more of the residual than this is replaced
# of the force along a step: at its end it is small below the first, too large above the second
MIN_SLOPE_RATIO, MAX_SLOPE_RATIO = 0.3, 0.7
MAX_LINE_SEARCH_POINTS = 20  # points of a line search
# in `reach`: longest move of a disk in a curved step, to which curvature may add one `reach`
MAX_CURVED_MOVE = 10.0


@dataclass(frozen=True, eq=False)
class DiskState:
    """Positions of the disks and the strain, and the bonds there."""

    places: np.ndarray  # (N, D)
    gamma: float
    pairs: NeighbourList
    strain: Strain  # of the cell since the list
    potential: Potential

    @property
    def geometry(self) -> tuple:
        """As compiled loops over pairs take it."""
        return self.pairs, self.places, self.strain, self.potential.constants

    @cached_property
    def bonds(self) -> Bonds:
        """The bonds of all listed pairs; forces alone do not need them."""
        return Bonds.of(self.pairs, self.potential, self.places, self.strain)


class StepForces(Protocol):
    """Elastic forces between the disks of one packing, and where its dashpots are."""

    n: int  # number of disks
    dofs: int  # unknowns of each
    volume: float  # before any strain
    load: Load  # E of the strain, x → (1 + γE) x
    length: float  # L, by which the strain is multiplied where it is unknown
    largest: float  # diameter
    rims: np.ndarray  # (N,) radii, in units of the length by which rotations are multiplied
    stiffness: float  # typical, of a contact
    reach: float  # longest move of a disk in one of Newton's steps

    def at(self, base, x, gamma: float) -> DiskState:
        """The DiskState with disks moved by x (N, D) from the positions `base` (N, D), at this strain."""

    def covers(self, state: DiskState) -> bool:
        """Whether the bonds of a state include all its contacts."""

    def forces(self, state: DiskState):
        """−∂U/∂r (N, D), and ∂U/∂γ."""

    def curvature(self, state: DiskState, x, growth: float):
        """Second derivatives of `forces` along moves x (N, D) and a growth of the strain, at constant stiffness."""

    def dashpots(self, state: DiskState) -> Dashpots:
        """The dashpots of the contacts of a state."""

    def fluid(self, gamma: float) -> FluidDrag:
        """The drag of the fluid in the affine flow at this strain."""


@dataclass(frozen=True)
class StageEnd:
    """Strain, stress and power at the end of a stage."""

    gamma: float
    rate: float  # of strain
    stress: float  # of the load, elastic and viscous
    power: float  # dissipated


@dataclass(frozen=True, eq=False)
class _Trial:
    """An iterate of Newton's method."""

    state: DiskState
    z: np.ndarray
    f: np.ndarray  # damping forces at z
    residual: np.ndarray  # (unknowns + 1,) residual forces, the last on γL
    virial: float  # σV
    rate: float
    power: float  # dissipated


@dataclass(frozen=True, eq=False)
class _Problem:
    """One stage with unknowns q (N dofs + 1,): displacements and rotations; last the growth of γL if free."""

    springs: StepForces
    h: float
    base: np.ndarray  # (N, D) positions at the beginning
    gamma: float  # strain at the beginning or, where it is imposed, at the end
    rate: float  # imposed strain rate, or 0
    imposed: Imposed
    fluid: FluidDrag

    def split(self, q):
        """Displacements (N, dofs) and the growth of the strain in q."""
        return q[:-1].reshape(self.springs.n, -1), float(q[-1]) / self.springs.length

    def moves(self, x):
        """The moves (N, D) among displacements and rotations x (N, dofs)."""
        return x[:, : self.base.shape[1]]

    def state(self, q) -> DiskState:
        """The DiskState that q leads to."""
        x, growth = self.split(q)
        return self.springs.at(self.base, self.moves(x), self.gamma + growth)

    def at(self, q, dashpots: Dashpots) -> _Trial:
        """The iterate at q, with its residual forces."""
        n, (x, growth), state = self.springs.n, self.split(q), self.state(q)
        u, rate = x / self.h, self.rate + growth / self.h
        z = dashpots.velocities(u, rate)
        f = dashpots.forces(z)
        drag, turning, dissipated = self.fluid.forces(u, rate)
        elastic, sheared = self.springs.forces(state)
        virial = dashpots.on_strain(f) + sheared + turning
        residual = np.zeros(len(q))
        on_disks = residual[:-1].reshape(n, -1)
        dashpots.subtract_forces(f, on_disks)
        forces = self.moves(on_disks)
        forces += elastic
        forces -= forces.sum(axis=0) / n  # rounding, which would make a large translation of all disks
        on_disks -= drag
        if self.imposed.free:
            residual[-1] = (self.imposed.stress * self.springs.volume - virial) / self.springs.length
        return _Trial(state, z, f, residual, virial, rate, float(np.vdot(f, z)) + dissipated)

    def curvature(self, state: DiskState, step):
        """Second derivative of the residual forces along a straight step."""
        x, growth = self.split(step)
        curvature = np.zeros_like(x)
        elastic, sheared = self.springs.curvature(state, self.moves(x), growth)
        self.moves(curvature)[:] = elastic - elastic.mean(axis=0)
        return np.append(curvature, -sheared / self.springs.length if self.imposed.free else 0.0)

    def farthest(self, step) -> float:
        """The longest move of a disk in a step."""
        x, growth = self.split(step)
        return max(longest(self.moves(x)) + abs(growth) * self.springs.largest, 1e-300)


class Stages:
    """Stages over h of one packing, one after the other; the factor of one is used in the next.

    scale: strain amplitude, to which the tolerance of forces is relative
    iterations: number of Newton's steps so far
    """

    def __init__(self, springs: StepForces, matrix: StepMatrix, h: float, scale: float, tolerance=TOLERANCE):
        self.h, self._matrix = h, matrix
        self.unit = springs.stiffness * springs.largest  # of forces
        self.tolerance = max(tolerance * scale, ROUNDING_FORCE) * self.unit
        self.finest = max(TOLERANCE * scale, NOISE_FORCE) * self.unit  # smallest force that counts
        self.iterations, self._is_stale = 0, True  # no factor yet

    def set_length(self, h: float):
        """Set the time of the next stages."""
        if h != self.h:
            self.h, self._is_stale = h, True

    def step(self, springs: StepForces, places, gamma, imposed, last):
        """(places, velocities, StageEnds) after a step of one or two stages, or None if the pair list is too small.

        springs         the forces that the Stages were made for
        places, gamma   positions (N, D) and strain at its beginning
        imposed         the Imposed at the ends of the stages
        last            velocities (N, dofs) and strain rate before the step

        Raises ConvergenceError if the step is too long.
        """
        base, ends = places, []
        for condition in imposed:
            stage = self._stage(springs, base, gamma, condition, last)
            if stage is None:
                return None
            places, u, end = stage
            ends.append(end)
            last = u, end.rate
            base = base + (1.0 - STAGE) / STAGE * (places - base)
            gamma += (1.0 - STAGE) / STAGE * (end.gamma - gamma)
        return places, u, ends

    def _stage(self, springs, base, gamma, imposed, last):
        """(places, velocities, StageEnd), or None."""
        free = imposed.free
        start = (gamma, 0.0) if free else (imposed.gamma, imposed.rate)
        problem = _Problem(springs, self.h, base, *start, imposed, springs.fluid(start[0]))
        begun = self._first_iterate(problem, last)
        if begun is None:
            return None
        q, dashpots, iterate = begun
        predicted = iterate.f
        for _ in range(MAX_ITERATIONS):
            size = np.abs(iterate.residual).max()
            if size <= self.tolerance:
                break
            tangents = dashpots.tangents(iterate.z, predicted)
            fresh = self._is_stale or self._matrix.pairs is not iterate.state.pairs
            if fresh:
                drag = problem.fluid.weights / self.h
                self._matrix.factorise(iterate.state, dashpots, tangents / self.h, drag, free)
            step = self._matrix.solve(iterate.residual)
            if not fresh and problem.farthest(step) > MAX_CURVED_MOVE * springs.reach:
                self._is_stale = True  # some disk had no contact when the matrix was factorised
                continue
            curvature = 0.5 * problem.curvature(iterate.state, step)
            if np.abs(curvature).max() > self.tolerance:
                curvature = self._matrix.solve(curvature)
            else:
                curvature = np.zeros_like(step)
            previous = iterate
            q, iterate = self._search(problem, dashpots, q, step, curvature, iterate.residual)
            predicted = previous.f + np.einsum("cab,cb->ca", tangents, iterate.z - previous.z)
            self.iterations += 1
            remaining = np.abs(iterate.residual).max()
            self._is_stale = False
            if fresh and MAX_CONTRACTION * size < remaining <= self._noise(iterate, tangents, q):
                break
            self._is_stale = not remaining <= MAX_CONTRACTION * size
            if not springs.covers(iterate.state):
                return None
        else:
            remedy = f"more {named('steps')}"
            if free:
                remedy += f" or, if the packing flows, less {named('stress')}"
            raise ConvergenceError(
                f"forces of a time step not balanced after {MAX_ITERATIONS} Newton steps, "
                f"max|F| = {size / self.unit:.1e} k d. Give {remedy}."
            )
        end = StageEnd(
            iterate.state.gamma,
            iterate.rate,
            iterate.virial / springs.volume,
            iterate.power,
        )
        return iterate.state.places, problem.split(q)[0] / self.h, end

    def _noise(self, iterate, tangents, q):
        """Forces that may be rounding: of elastic and damping forces, and of velocities, differences of positions."""
        moved = ROUNDING_FORCE * np.abs(tangents).max(initial=0.0) * np.abs(q).max() / self.h
        return NOISE_FORCE * self.unit + TOLERANCE * np.abs(iterate.f).max(initial=0.0) + moved

    def _first_iterate(self, problem, last):
        """(q, Dashpots, _Trial) at the beginning or where the last velocities lead, whichever is better balanced.

        The dashpots are at the contacts there. None if the pair list is too small.
        """
        ahead = np.append(
            self.h * last[0], self.h * last[1] * problem.springs.length if problem.imposed.free else 0.0
        )
        trials = []
        for q in (np.zeros_like(ahead), ahead):
            state = problem.state(q)
            if problem.springs.covers(state):
                dashpots = problem.springs.dashpots(state)
                trials.append((q, dashpots, problem.at(q, dashpots)))
            elif not trials:
                return None
        return min(trials, key=lambda trial: np.abs(trial[2].residual).max())

    def _search(self, problem, dashpots, q, step, curvature, residual):
        """(q, _Trial) at a point of a curved step where the force along it is small."""
        force, reach = np.vdot(step, residual), problem.springs.reach
        longest = min(
            MAX_CURVED_MOVE * reach / problem.farthest(step), np.sqrt(reach / problem.farthest(curvature))
        )
        length, lower, upper = min(1.0, longest), (0.0, 1.0), None
        for _ in range(MAX_LINE_SEARCH_POINTS):
            end = q + length * (step + length * curvature)
            trial = problem.at(end, dashpots)
            slope = np.vdot(step + 2.0 * length * curvature, trial.residual) / force
            if upper is None and slope > MAX_SLOPE_RATIO and 2.0 * length <= longest:
                lower, length = (length, slope), 2.0 * length  # the force hardly falls: a disk slides off
                continue
            if abs(slope) <= MIN_SLOPE_RATIO or (upper is None and slope > 0.0):
                break
            if slope < 0.0:
                upper = length, slope
            else:
                lower = length, slope
            length = flat_between(lower, upper)
        return end, trial
