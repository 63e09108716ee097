"""Disks whose contacts open and close while their cell is strained: implicit steps in time, without inertia.

The cell is strained by 1 + γE, E of a load, simple shear unless another one is given. In the coordinates of a list made
at γ₀ (see `packing.neighbour_list`) disks move by offsets o, and r = F (r0 + o_j − o_i) with F = (1 + γE)(1 + γ₀E)⁻¹;
the affine flow has the gradient γ̇ E (1 + γE)⁻¹, and the non-affine velocity in the laboratory is u = F ȯ. Forces
balance at every instant,

    ∂R/∂u = f(o, γ) ,     ∂R/∂γ̇ = σV − ∂U/∂γ   where the stress σ is imposed and the strain free,

f = −∂U/∂r, not linearised, R(u, γ̇) the dissipation potential of the current contacts (see `power_law`) and of the fluid
(see `fluid_drag`); where damping is linear ∂R/∂u = B u + b γ̇. V is the volume before any strain. A stress is imposed
along simple shear alone, whose flow is the same at every strain. `time_step` solves for a step. This module has forces
and energy of the springs, and the state of the packing between steps.
"""

from functools import lru_cache

import numpy as np

from jampetsc.errors import ConvergenceError, named
from jampetsc.laws.damping import Law
from jampetsc.laws.loads import Load, simple_shear
from jampetsc.oscillation.dashpots import Damping, Dashpots
from jampetsc.oscillation.fluid_drag import FluidDrag
from jampetsc.oscillation.force_curvature import add_curvature
from jampetsc.oscillation.power_law import ContactPowerLaw
from jampetsc.oscillation.step_matrix import StepMatrix
from jampetsc.oscillation.time_step import STAGE, TOLERANCE, DiskState, Stages
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.kernel import bond_forces, elastic_virial
from jampetsc.packing.neighbour_list import SKIN_START, ListedPacking, is_stale
from jampetsc.packing.neighbours import longest
from jampetsc.packing.packing import Packing
from jampetsc.packing.strain import (
    UNSTRAINED,
    Strain,
    bond_vector,
    gradient_over,
    strain_between,
    strain_of,
    strained,
)

MAX_OVERLAP_MOVE = 3.0  # mean overlaps: largest move in a Newton step, to stay in the same minimum
# of an overlap: changes up to which energies are integrals of forces, by Gauss's formula with errors below rounding
MAX_INTEGRATED_RATIO = 0.1
INTEGRATION = tuple(
    0.5 * (a + b) for a, b in zip(np.polynomial.legendre.leggauss(6), (1.0, 0.0), strict=True)
)
MAX_SKIN_RATIO = 2.0  # mean diameters: a step that needs a pair list with a larger skin is too long


class MovingContacts(ListedPacking):
    """A packing under an imposed strain or stress, the `time_step.StepForces` of its own steps.

    disks: current state
    step: time of a step
    scale: strain amplitude, to which the tolerance of forces is relative
    speed: typical |z| of `power_law`, without effect where damping is linear
    gamma: strain of the given disks
    load: E; simple shear if not given
    tolerance: of forces, in units of k times the largest diameter times `scale`
    u: (N, dofs) velocities, and spins times the mean diameter
    """

    def __init__(
        self,
        disks: Packing,
        law: Law,
        step: float,
        scale: float,
        speed=0.0,
        gamma=0.0,
        load: Load | None = None,
        tolerance=TOLERANCE,
    ):
        self.step, self.gamma, self.rate = step, gamma, 0.0
        self.load = load or simple_shear(disks.dimension)
        self._unit_strain = strain_of(self.load.gradient)
        self._is_steady = not (self.load.gradient @ self.load.gradient).any()  # flow the same at every strain
        super().__init__(disks)
        potential = self._potential = disks.potential
        dimension = disks.dimension
        self.n, self.dofs = disks.n, law.dofs(dimension)
        self.volume = disks.volume / self._growth(gamma)
        # of V over a thickness of one diameter for each axis beyond two, so that γL is a displacement
        self.length = float(np.sqrt(self.volume / self.diameter ** (dimension - 2)))
        stiffness = float(potential.scale(np.array(self.diameter))) ** -2 * float(potential.k)
        self.stiffness = stiffness * potential.reach(self.diameter)
        self.reach = MAX_OVERLAP_MOVE * float(np.mean(find_contacts(disks).overlap))
        # rotations are solved for as lengths, times this diameter, as displacements are
        self._lengths = np.repeat((1.0, self.diameter), (dimension, self.dofs - dimension))
        self.rims = disks.radii / self.diameter
        self._damping = Damping.of(
            law, dimension, ContactPowerLaw.of(law, float(potential.k), self.diameter), speed
        )
        self._law = law
        self.u = np.zeros((disks.n, self.dofs))
        self.gained = 0.0  # change of the elastic energy in the last step
        self.matrix = StepMatrix(self)
        self.stages = Stages(self, self.matrix, STAGE * step, scale, tolerance)

    def list(self, disks):
        """See `ListedPacking`."""
        super().list(disks.folded())
        self.listed = self.gamma  # strain at which the list was made
        self._served = 0  # steps made with the list

    @property
    def cell_strain(self):
        """See `ListedPacking`."""
        return self._strain_at(self.gamma)

    def _strain_at(self, gamma) -> Strain:
        """E of the cell since the list was made."""
        return _strain_since(self._unit_strain, gamma, self.listed)

    def _growth(self, gamma) -> float:
        """Volume over that before any strain."""
        return float(np.linalg.det(np.eye(self.load.dimension) + gamma * self.load.gradient))

    def flow(self, gamma: float) -> Load:
        """The affine flow of unit rate at a strain, E (1 + γE)⁻¹."""
        if self._is_steady:
            return self.load
        E = self.load.gradient
        gradient = E @ np.linalg.inv(np.eye(len(E)) + gamma * E)
        return Load(self.load.name, tuple(map(tuple, gradient.tolist())))

    @property
    def velocities(self):
        """Velocities (N, dofs), with spins where the law has them."""
        return self.u / self._lengths

    def displace(self, displacements, velocities, gamma, rate):
        """Set the start: disks displaced by (N, D), velocities (N, dofs), strain and strain rate."""
        self.gamma, self.u, self.rate = gamma, velocities * self._lengths, rate
        self.offsets = self.offsets + displacements
        self.fold()

    def set_length(self, step: float, stage: float = STAGE):
        """Set the time of the next steps, and of a stage as a share of it."""
        self.step = step
        self.stages.set_length(stage * step)

    def advance(self, imposed):
        """Make a step; `imposed`: the Imposed at the ends of its stages, one or two. Returns their `StageEnd`s.

        Raises ConvergenceError if the step is too long.
        """
        while True:
            step = self.stages.step(self, self.offsets, self.gamma, imposed, (self.u, self.rate))
            if step is not None:
                break
            if not self._served:  # a new list is stale within one step
                self.skin *= 2.0
                if self.skin > MAX_SKIN_RATIO * self.diameter:
                    self.skin = SKIN_START * self.diameter
                    self.fold()
                    raise ConvergenceError(f"disks move too far in one step. Give more {named('steps')}.")
            else:
                self.tune(10 * self._served)
            self.fold()
        self._before = self.offsets, self.u, self.gamma, self.rate, self._served
        previous = self.state
        self.offsets, self.u, ends = step
        self.gamma, self.rate, self._served = ends[-1].gamma, ends[-1].rate, self._served + 1
        self.gained = self.energy_change(previous, self.state)
        return ends

    def undo(self):
        """Return to the state before the last step."""
        self.offsets, self.u, self.gamma, self.rate, self._served = self._before

    @property
    def rounding(self) -> float:
        """Error of the energy balance of the last step that the rounding of forces may cause."""
        return self.stages.finest * self.step * float(np.abs(self.u).sum())

    @property
    def state(self) -> DiskState:
        """The disks as they are now."""
        return self.at(self.offsets, np.zeros_like(self.offsets), self.gamma)

    def at(self, base, x, gamma) -> DiskState:
        """See `time_step.StepForces`; places are offsets o, moves x (N, D) are in the laboratory frame."""
        strain = self._strain_at(gamma)
        offsets = base + x @ _offset_of_move(strain, self.load.dimension)
        return DiskState(offsets, gamma, self.pairs, strain, self._potential)

    def covers(self, state) -> bool:
        """See `time_step.StepForces`."""
        far = longest(state.places)
        return not is_stale(far, self._strain_at(state.gamma), self.largest, self.skin)

    def energy_change(self, before: DiskState, after: DiskState) -> float:
        """U(after) − U(before) of two states of the same list, computed without subtracting energies."""
        pairs, potential = self.pairs, self._potential
        drawn = after.places - before.places
        # r − r of before = F (Δo_j − Δo_i) + ΔE (r0 + o_j − o_i)
        moved = (drawn[pairs.j] - drawn[pairs.i]).T
        change = np.stack(bond_vector(self._strain_at(before.gamma), np.zeros(len(moved)), moved))
        bond = np.stack(pairs.r0) + (after.places[pairs.j] - after.places[pairs.i]).T
        growth = (after.gamma - before.gamma) * self.flow(self.listed).gradient
        change += growth @ bond
        mean_bond = after.bonds.r + before.bonds.r
        deeper = -np.sum(mean_bond * change, axis=0) / (after.bonds.distance + before.bonds.distance)
        old, new = (np.maximum(state.bonds.overlap, 0.0) for state in (before, after))
        little = np.abs(deeper) < MAX_INTEGRATED_RATIO * old
        few, sigma, way = old[little], pairs.sigma[little], deeper[little]
        work = sum(w * potential.force(few + x * way, sigma) for x, w in zip(*INTEGRATION, strict=True)) * way
        much = (potential.energy(new, pairs.sigma) - potential.energy(old, pairs.sigma))[~little]
        return float(np.sum(work) + np.sum(much))

    def forces(self, state):
        """See `time_step.StepForces`."""
        forces = np.empty(state.places.shape)
        sums = bond_forces(*state.geometry, forces, None, None)
        virial = elastic_virial(sums, self.load.dimension)
        return forces, -float(np.sum(self.flow(state.gamma).gradient * virial))

    def curvature(self, state, x, growth):
        """See `time_step.StepForces`."""
        flow = gradient_over(self._unit_strain, strained(self._unit_strain, state.gamma))
        on_disks = np.zeros(x.shape)
        return on_disks, add_curvature(*state.geometry, flow, np.ascontiguousarray(x), growth, on_disks)

    def dashpots(self, state) -> Dashpots:
        """See `time_step.StepForces`: dashpots of touching pairs."""
        return Dashpots(state.bonds, self.rims, self._damping, self.dofs, self.flow(state.gamma))

    def fluid(self, gamma) -> FluidDrag:
        """See `time_step.StepForces`."""
        volume = self.volume * self._growth(gamma)
        return FluidDrag.of(self._law, self.flow(gamma), float(self._potential.k), self.diameter, volume)


@lru_cache(maxsize=16)
def _strain_since(unit_strain: Strain, gamma: float, listed: float) -> Strain:
    """E of F = 1 + γ E₁ since an earlier γ, `listed`; E₁ is `unit_strain`."""
    return strain_between(strained(unit_strain, gamma), strained(unit_strain, listed))


@lru_cache(maxsize=16)
def _offset_of_move(strain: Strain, dimension: int):
    """F⁻¹ transposed, (D, D): moves (N, D) in the laboratory frame times it are offsets."""
    back = np.reshape(strain_between(UNSTRAINED, strain), (3, 3))[:dimension, :dimension]
    return np.eye(dimension) + back.T
