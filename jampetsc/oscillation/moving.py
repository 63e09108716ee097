"""Disks whose contacts open and close while their cell is sheared: implicit steps in time, without inertia.

In the coordinates of a pair list (see `core.pairs`) disks move by offsets o, and r = F (r0 + o_j − o_i) with
F = [[1, g], [0, 1]]; their non-affine velocity in the laboratory is u = F ȯ. Forces balance at every instant,

    ∂R/∂u = f(o, γ) ,     ∂R/∂γ̇ = σV − ∂U/∂γ   where the stress σ is imposed and the strain free,

f = −∂U/∂r in full, R(u, γ̇) the dissipation potential of the contacts there are (see `powerlaw`); where damping is
linear ∂R/∂u = B u + b γ̇. What a step looks for is told in `stage`; here is what its springs are.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.core.disks import Disks
from jampetsc.core.laws import Law
from jampetsc.core.pairs import SKIN_START, ListedDisks, is_stale
from jampetsc.core.state import find_contacts
from jampetsc.errors import ConvergenceError, named
from jampetsc.minimise.hessian import Bonds
from jampetsc.oscillation.dashpots import Damping, Dashpots
from jampetsc.oscillation.stage import STAGE, Imposed, Stages
from jampetsc.oscillation.stepmatrix import StepMatrix

REACH = 3.0  # mean overlaps: no disk moves farther in one of Newton's steps, into another minimum
WIDEST = 2.0  # mean diameters: skin of a list beyond which a step is too long


@dataclass(frozen=True, eq=False)
class _State:
    """The bonds of a list with disks at these offsets."""

    places: np.ndarray  # (N, 2) offsets
    gamma: float
    bonds: Bonds


class ListedSprings:
    """The pairs of a list, those that touch and those that may: `stage.Springs`."""

    def __init__(self, disks: Disks, law: Law, speed: float, prefix: str):
        self.n, self.dofs, self.area, self.potential = disks.n, law.dofs, disks.area, disks.potential
        self.damping = Damping.of(law, disks, speed)
        self.diameter = 2.0 * float(disks.radii.mean())
        self.largest = 2.0 * float(disks.radii.max())
        stiffness = float(disks.potential.scale(np.array(self.diameter))) ** -2 * float(disks.potential.k)
        self.unit = stiffness * self.largest
        self.reach = REACH * float(np.mean(find_contacts(disks).overlap))
        # turns are looked for as those of a rim of this diameter: lengths as displacements are, whatever their unit
        self.lengths = np.array([1.0, 1.0, self.diameter])[: law.dofs]
        self._matrix = StepMatrix(prefix, stiffness, float(np.sqrt(disks.area)))

    def list(self, listed: ListedDisks, gamma: float):
        """From now on pairs are those of these disks, which have the strain gamma."""
        self.pairs, self.skin, self.listed = listed.pairs, listed.skin, gamma
        self._rims = listed.reference.radii / self.diameter
        self._matrix.list(self.pairs, self._rims, self.dofs)

    @property
    def factorisations(self) -> int:
        """So far."""
        return self._matrix.factorisations

    def at(self, base, x, gamma):
        """Moves x (N, 2) are those of the laboratory."""
        moved = x.copy()
        moved[:, 0] -= (gamma - self.listed) * moved[:, 1]
        offsets = base + moved
        bonds = Bonds.of(self.pairs, self.potential, offsets, 0.0, gamma - self.listed)
        return _State(offsets, gamma, bonds)

    def serves(self, state) -> bool:
        """Whether the list misses no contact."""
        far = float(np.hypot(*state.places.T).max())
        return not is_stale(far, 0.0, state.gamma - self.listed, self.largest, self.skin)

    def gain(self, state, after) -> float:
        """Energy that a state has more than another of the same list; only the change is rounded, not the energies."""
        rx, ry = after.bonds.r + state.bonds.r
        drawn = after.places - state.places
        dx, dy = (drawn[self.pairs.j] - drawn[self.pairs.i]).T
        low = self.pairs.r0[1] + (after.places[self.pairs.j] - after.places[self.pairs.i])[:, 1]
        dx = dx + (state.gamma - self.listed) * dy + (after.gamma - state.gamma) * low
        deeper = -(rx * dx + ry * dy) / (after.bonds.distance + state.bonds.distance)
        potential, sigma = self.potential, self.pairs.sigma
        before, now = (np.maximum(one.bonds.overlap, 0.0) for one in (state, after))
        energy, little = potential.energy(before, sigma), np.abs(deeper) < 0.5 * before
        grown = np.expm1(potential.alpha * np.log1p(deeper[little] / before[little]))
        much = (potential.energy(now, sigma) - energy)[~little]
        return float(np.sum(energy[little] * grown) + np.sum(much))

    def pull(self, state):
        """See `stage.Springs`."""
        bonds = state.bonds
        sheared = -float(np.sum(bonds.force * bonds.normal[0] * bonds.r[1]))
        return bonds.on_disks(bonds.force * bonds.normal, self.n), sheared

    def bend(self, state, x, growth):
        """With w of a bond along and across it, −k w⊥²/r (1 + f/kr) along and −2 k w∥ w⊥/r (1 + f/kr) across."""
        bonds, (nx, ny) = state.bonds, state.bonds.normal
        wx, wy = (x[bonds.pairs.j] - x[bonds.pairs.i]).T
        wx = wx + growth * bonds.r[1]
        along, across = nx * wx + ny * wy, nx * wy - ny * wx
        push = bonds.force / bonds.distance
        stiff = (bonds.stiffness + push) * across / bonds.distance
        bent = -stiff * across * bonds.normal - 2.0 * stiff * along * np.stack((-ny, nx))
        first = -bonds.stiffness * along * nx - push * across * ny
        sheared = -float(np.sum(bent[0] * bonds.r[1] + 2.0 * first * wy))
        return bonds.on_disks(bent, self.n), sheared

    def dashpots(self, state) -> Dashpots:
        """Of the pairs that touch."""
        return Dashpots(state.bonds, self._rims, self.damping, self.dofs)

    def factorise(self, state, dashpots, damping, free):
        """See `StepMatrix`."""
        self._matrix.factorise(state.bonds, dashpots, damping, free)

    def solve(self, right):
        """See `StepMatrix`."""
        return self._matrix.solve(right)

    def destroy(self):
        """Free the factor."""
        self._matrix.destroy()


class MovingContacts(ListedDisks):
    """A packing under an imposed strain or stress; `gamma` is where it is, `disks` how it looks.

    scale: strain amplitude, what forces are compared with
    speed: typical |z| of `powerlaw`; nothing depends on it where damping is linear
    gamma: the strain that `disks` have
    """

    def __init__(self, disks: Disks, law: Law, step: float, scale: float, prefix: str, speed=0.0, gamma=0.0):
        self.step, self.gamma, self.rate = step, gamma, 0.0
        self.springs = ListedSprings(disks, law, speed, prefix)
        self._stages = Stages(self.springs, STAGE * step, scale)
        self.gained = 0.0  # energy of springs, in the last step
        self.u = np.zeros((disks.n, law.dofs))  # velocities, and spins times the mean diameter
        super().__init__(disks)

    def list(self, disks):
        """See `ListedDisks`."""
        super().list(disks.folded())
        self.springs.list(self, self.gamma)
        self._since = 0
        self._stages.forget()

    @property
    def box(self):
        """See `ListedDisks`."""
        return 0.0, self.gamma - self.springs.listed

    @property
    def iterations(self) -> int:
        """Newton's steps so far."""
        return self._stages.iterations

    @property
    def factorisations(self) -> int:
        """So far."""
        return self.springs.factorisations

    def displace(self, displacements, velocities, gamma, rate):
        """Begin with disks moved by (N, 2) from where they are, at velocities as below, strained and at a rate."""
        self.gamma, self.u, self.rate = gamma, velocities * self.springs.lengths, rate
        self.offsets = self.offsets + displacements
        self.fold()

    @property
    def velocities(self):
        """(N, dofs), with spins where the law has them."""
        return self.u / self.springs.lengths

    def advance(self, gamma, rate):
        """A step in which the strain is gamma[0], gamma[1] at the ends of its stages, and its rate rate[0], rate[1].

        Returns the Instants of both. Raises ConvergenceError where the step is too long.
        """
        return self.follow([Imposed(*pair) for pair in zip(gamma, rate, strict=True)])

    def pace(self, step: float):
        """Steps have this length from now on."""
        self.step = step
        self._stages.pace(STAGE * step)

    def follow(self, imposed):
        """A step whose two stages end with what is imposed; as `advance`."""
        while True:
            found = self._stages.step(self.offsets, self.gamma, imposed, (self.u, self.rate))
            if found is not None:
                break
            if not self._since:  # a new list does not last for a step
                self.skin *= 2.0
                if self.skin > WIDEST * self.diameter:
                    self.skin = SKIN_START * self.diameter
                    self.fold()
                    raise ConvergenceError(f"disks move too far in one step: give more {named('steps')}")
            else:
                self.tune(10 * self._since)
            self.fold()
        self._before = self.offsets, self.u, self.gamma, self.rate, self._since
        begin = self._at(self.offsets, self.gamma)
        self.offsets, self.u, instants = found
        self.gamma, self.rate, self._since = instants[1].gamma, instants[1].rate, self._since + 1
        self.gained = self.springs.gain(begin, self._at(self.offsets, self.gamma))
        return instants

    def _at(self, offsets, gamma):
        return self.springs.at(offsets, np.zeros_like(offsets), gamma)

    def undo(self):
        """Be again where the last step began."""
        self.offsets, self.u, self.gamma, self.rate, self._since = self._before

    @property
    def area(self) -> float:
        """Of the cell."""
        return self.springs.area

    @property
    def rounding(self) -> float:
        """Energy by which the last step may be off because forces are not balanced to the last bit."""
        return self._stages.finest * self.step * float(np.abs(self.u).sum())

    def destroy(self):
        """Free the factor."""
        self.springs.destroy()
