"""Disks whose contacts open and close while their cell is sheared: implicit steps in time, without inertia.

In the coordinates of a pair list (see `contacts.pairs`) disks move by offsets o, and r = F (r0 + o_j − o_i) with
F = [[1, g], [0, 1]]; their non-affine velocity in the laboratory is u = F ȯ. Forces balance at every instant,

    ∂R/∂u = f(o, γ) ,     ∂R/∂γ̇ = σV − ∂U/∂γ   where the stress σ is imposed and the strain free,

f = −∂U/∂r in full, R(u, γ̇) the dissipation potential of the contacts there are (see `powerlaw`); where damping is
linear ∂R/∂u = B u + b γ̇. A step is that of an L-stable method of second order with two equal stages (Alexander, SIAM
J. Numer. Anal. 14, 1006 (1977)): stiff motions are damped however long it is. A stage is backward Euler over
h = (1 − 1/√2) Δt from some offsets and strain: over the displacements w = h u, where the law has them turns hΩ of
disks, and the growth s of a free strain it minimises

    U(w, γ + s) − σV s + h R(w/h, s/h) .

The contacts that damp, and their directions, belong to where the last velocities would lead: if dashpots came and went
with the contacts while w is looked for, there might be no minimum. Newton's method takes the Hessian of that, and the
same factor until it has served.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.contacts.disks import Disks
from jampetsc.contacts.laws import Law
from jampetsc.contacts.pairs import SKIN_START, PairList, deformed, is_stale, tuned_skin
from jampetsc.contacts.state import find_contacts
from jampetsc.errors import ConvergenceError
from jampetsc.oscillation.dashpots import Damping, Dashpots
from jampetsc.oscillation.stepmatrix import StepMatrix
from jampetsc.packing.hessian import Bonds

STAGE = 1.0 - np.sqrt(0.5)  # of a step
TOLERANCE = 1e-9  # of forces, in units of what the strain amplitude makes
ROUNDED = 1e-15  # of forces, in units of k times the largest diameter
NOISE = 1e-14  # likewise; what does not get smaller is rounding if below this, or below TOLERANCE of damping forces
ITERATIONS = 300
WORN = 0.2  # a factor that leaves more of the residual than this is made anew
FLAT, STEEP = 0.3, 0.7  # of the force along a step, at its end: little is left of it, or nearly all
TRIES = 20  # points of a search
REACH = 3.0  # mean overlaps: no disk moves farther in one of Newton's steps, into another minimum
WIDEST = 2.0  # mean diameters: skin of a list beyond which a step is too long


@dataclass(frozen=True)
class Instant:
    """What is seen at the end of a stage."""

    gamma: float
    rate: float  # of strain
    stress: float  # σ_xy, elastic and viscous
    power: float  # dissipated


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


@dataclass(frozen=True, eq=False)
class _Seen:
    """A state that a stage tries: f at z and what is left of the forces, (unknowns + 1,) with that on γL."""

    bonds: Bonds
    z: np.ndarray
    f: np.ndarray
    left: np.ndarray
    virial: float  # σV
    gamma: float
    rate: float


class MovingContacts:
    """A packing under an imposed strain or stress; `gamma` is where it is, `disks` how it looks.

    scale: strain amplitude, what forces are compared with
    speed: typical |z| of `powerlaw`; nothing depends on it where damping is linear
    gamma: the strain that `disks` have
    """

    def __init__(self, disks: Disks, law: Law, step: float, scale: float, prefix: str, speed=0.0, gamma=0.0):
        self.dofs, self.step, self.h = law.dofs, step, STAGE * step
        self.damping = Damping.of(law, disks, speed)
        self.diameter = 2.0 * float(disks.radii.mean())
        self.largest = 2.0 * float(disks.radii.max())
        self.length = float(np.sqrt(disks.area))
        stiffness = float(disks.potential.scale(np.array(self.diameter))) ** -2 * float(disks.potential.k)
        self.unit = stiffness * self.largest
        self.tolerance = max(TOLERANCE * scale, ROUNDED) * self.unit
        self.gamma, self.rate, self.iterations = gamma, 0.0, 0
        self.u = np.zeros((disks.n, self.dofs))  # velocities, and spins
        self.skin, self.since = SKIN_START * self.diameter, 0
        self._matrix = StepMatrix(prefix, stiffness, self.length)
        self._reach = REACH * float(np.mean(find_contacts(disks).overlap))
        self._list(disks)

    def _list(self, disks):
        self._disks = disks.folded()
        self.pairs = PairList.build(self._disks, self.skin)
        self.listed = self.gamma
        self.offsets = np.zeros((disks.n, 2))
        self._matrix.list(self.pairs, self._disks.radii, self.dofs)
        self._fresh, self.since = False, 0

    @property
    def disks(self) -> Disks:
        """The packing as it is now."""
        return deformed(self._disks, self.offsets, 0.0, self.gamma - self.listed)

    @property
    def factorisations(self) -> int:
        """So far."""
        return self._matrix.factorisations

    def displace(self, displacements, velocities, gamma, rate):
        """Begin with disks moved by (N, 2) from where they are, at velocities (N, dofs), strained and at a rate."""
        disks = deformed(self._disks, displacements, 0.0, gamma - self.gamma)
        self.gamma, self.u, self.rate = gamma, velocities, rate
        self._list(disks)

    def advance(self, gamma, rate):
        """A step in which the strain is gamma[0], gamma[1] at the ends of its stages, and its rate rate[0], rate[1].

        Returns the Instants of both. Raises ConvergenceError where the step is too long.
        """
        return self.follow([Imposed(*pair) for pair in zip(gamma, rate, strict=True)])

    def follow(self, imposed):
        """A step whose two stages end with what is imposed; as `advance`."""
        while True:
            found = self._stages(imposed)
            if found is not None:
                break
            if not self.since:  # a new list does not last for a step
                self.skin *= 2.0
                if self.skin > WIDEST * self.diameter:
                    raise ConvergenceError("disks move too far in one step: give more --steps")
            else:
                self.skin = tuned_skin(self.skin, 10 * self.since, self.diameter)
            self._list(self.disks)
        self.offsets, self.u, instants = found
        self.gamma, self.rate, self.since = instants[1].gamma, instants[1].rate, self.since + 1
        return instants

    def _stages(self, imposed):
        """(offsets, velocities, instants) of a step, or None where the list does not serve for it."""
        base, gamma, last, instants = self.offsets, self.gamma, (self.u, self.rate), []
        for one in imposed:
            if self._is_stale(base, gamma if one.free else one.gamma):
                return None
            found = self._stage(base, gamma, one, last)
            if found is None:
                return None
            end, u, instant = found
            instants.append(instant)
            last = u, instant.rate
            base, first = base + (1.0 - STAGE) / STAGE * (end - base), end
            gamma += (1.0 - STAGE) / STAGE * (instant.gamma - gamma)
        return first, u, instants

    def _is_stale(self, offsets, gamma):
        far = float(np.hypot(*offsets.T).max())
        return is_stale(far, 0.0, gamma - self.listed, self.largest, self.skin)

    def _stage(self, base, gamma, imposed: Imposed, last):
        """(offsets, velocities, Instant) at the end of a stage; None where the list does not serve.

        base, gamma     where it begins, offsets (N, 2) and a strain
        last            velocities and rate of strain of the stage before
        """
        n, h, free = len(base), self.h, imposed.free
        area, begin, rate = self._disks.area, gamma if free else imposed.gamma, 0.0 if free else imposed.rate

        def there(q):
            """(displacements, offsets, strain, its rate) of unknowns (N dofs + 1,)."""
            x, grown = q[:-1].reshape(n, -1), float(q[-1]) / self.length
            now = begin + grown
            moved = x[:, :2].copy()
            moved[:, 0] -= (now - self.listed) * moved[:, 1]
            return x, base + moved, now, rate + grown / h

        def bonds_at(offsets, now):
            return Bonds.of(self.pairs, self._disks.potential, offsets, 0.0, now - self.listed)

        def look(q):
            x, offsets, now, growth = there(q)
            bonds = bonds_at(offsets, now)
            z = dashpots.velocities(x, h * growth, h)
            f = dashpots.forces(z)
            left = -dashpots.on_disks(f, n)
            left[:, :2] += bonds.on_disks(bonds.force * bonds.normal, n)
            left[:, :2] -= left[:, :2].mean(
                axis=0
            )  # rounding, which would move all disks, held by nothing, far
            virial = dashpots.on_strain(f) - float(np.sum(bonds.force * bonds.normal[0] * bonds.r[1]))
            row = (imposed.stress * area - virial) / self.length if free else 0.0
            return _Seen(bonds, z, f, np.append(left, row), virial, now, growth)

        q = np.zeros(n * self.dofs + 1)  # from here it is downhill
        ahead = np.append(h * last[0], h * last[1] * self.length if free else 0.0)
        starts = []
        for start in (q, ahead):  # where a disk has slid off, it does not go on as it went
            _, offsets, now, _ = there(start)
            if not self._is_stale(offsets, now):
                dashpots = Dashpots(bonds_at(offsets, now), self._disks.radii, self.damping, self.dofs)
                starts.append((np.abs(look(start).left).max(), dashpots))
        _, dashpots = min(starts, key=lambda start: start[0])
        seen = look(q)
        predicted = seen.f
        for _ in range(ITERATIONS):
            size = np.abs(seen.left).max()
            if size <= self.tolerance:
                break
            tangents = dashpots.tangents(seen.z, predicted)
            fresh = not self._fresh
            if fresh:
                self._matrix.factorise(seen.bonds, dashpots, tangents / h, free)
                self._fresh = True
            step = self._matrix.solve(seen.left)
            before = seen
            length, seen = self._search(look, q, step, seen.left)
            q = q + length * step
            predicted = before.f + np.einsum("cab,cb->ca", tangents, seen.z - before.z)
            self.iterations += 1
            left = np.abs(seen.left).max()
            noise = NOISE * self.unit + TOLERANCE * np.abs(seen.f).max(initial=0.0)
            if fresh and WORN * size < left <= noise:
                break
            if not left <= WORN * size:
                self._fresh = False
            if self._is_stale(*there(q)[1:3]):
                return None
        else:
            raise ConvergenceError(
                f"forces of a time step are not balanced after {ITERATIONS} of Newton's steps, {size:.1e} of k d is "
                f"left: give more --steps{' or, if the packing flows, less --stress' if free else ''}"
            )
        x, offsets, *_ = there(q)
        power = float(np.sum(seen.f * seen.z))
        return offsets, x / h, Instant(seen.gamma, seen.rate, seen.virial / area, power)

    def _search(self, look, q, step, left):
        """How far to go along a step, and what is there: where its force is small, or has begun to pull back."""
        moved = float(np.hypot(*step[:-1].reshape(-1, self.dofs)[:, :2].T).max())
        longest = moved + abs(float(step[-1])) / self.length * self.largest
        pull, reach = np.vdot(step, left), self._reach / max(longest, 1e-300)
        length, lower, upper = min(1.0, reach), (0.0, 1.0), None
        for _ in range(TRIES):
            found = look(q + length * step)
            now = np.vdot(step, found.left) / pull
            if upper is None and now > STEEP and 2.0 * length <= reach:
                lower, length = (length, now), 2.0 * length  # the force does not give way: a disk slides off
                continue
            if abs(now) <= FLAT or (upper is None and now > 0.0):
                break
            if now < 0.0:
                upper = length, now
            else:
                lower = length, now
            share = min(max(lower[1] / (lower[1] - upper[1]), 0.1), 0.9)
            length = lower[0] + share * (upper[0] - lower[0])
        return length, found

    def destroy(self):
        """Free the factor."""
        self._matrix.destroy()
