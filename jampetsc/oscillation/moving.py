"""Disks whose contacts open and close while their cell is sheared: implicit steps in time, without inertia.

In the coordinates of a pair list (see `contacts.pairs`) disks move by offsets o, and r = F (r0 + o_j − o_i) with
F = [[1, g], [0, 1]]; their non-affine velocity in the laboratory is u = F ȯ. Forces balance at every instant,

    B u + b γ̇ = f(o, γ) ,     f = −∂U/∂r in full,     B, b of the damping law on the contacts there are.

A step is that of an L-stable method of second order with two equal stages (Alexander, SIAM J. Numer. Anal. 14, 1006
(1977)): stiff motions are damped however long it is. A stage is backward Euler over h = (1 − 1/√2) Δt from some
offsets: it minimises U(w) + (w·B w/2h + γ̇ b·w) over the displacements w = h u and, where the law has them, turns hΩ of
disks. B and b belong to where the last velocities would lead: if dashpots came and went with the contacts while w is
looked for, there might be none. Newton's method takes the Hessian of that, and the same factor until it has served.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.contacts.disks import Disks
from jampetsc.contacts.forms import linear_forms
from jampetsc.contacts.laws import Law
from jampetsc.contacts.pairs import SKIN_START, PairList, deformed, is_stale, tuned_skin
from jampetsc.contacts.state import both_ends, find_contacts, find_rattlers
from jampetsc.errors import ConvergenceError
from jampetsc.packing.hessian import Bonds
from jampetsc.solvers.local import NewtonSolver

STAGE = 1.0 - np.sqrt(0.5)  # of a step
TOLERANCE = 1e-9  # of forces, in units of what the strain amplitude makes
ROUNDED = 1e-15  # of forces, in units of k times the largest diameter
ITERATIONS = 300
WORN = 0.2  # a factor that leaves more of the residual than this is made anew
FLAT, STEEP = 0.3, 0.7  # of the force along a step, at its end: little is left of it, or nearly all
TRIES = 20  # points of a search
REACH = 3.0  # mean overlaps: no disk moves farther in one of Newton's steps, into another minimum
HELD = 1e-10  # of k: least μ on the diagonal, for what nothing holds; it changes steps, not where they end
RAISED = 3.0
WIDEST = 2.0  # mean diameters: skin of a list beyond which a step is too long


@dataclass(frozen=True)
class Instant:
    """What is seen at the end of a stage."""

    stress: float  # σ_xy, elastic and viscous
    power: float  # dissipated


class _Dashpots:
    """Damping of the contacts there are at some bonds: motions a = rows·(disk i, disk j) + γ̇ s, forces weights × a."""

    def __init__(self, bonds: Bonds, radii, weights, dofs: int):
        touching = np.flatnonzero(bonds.overlap > 0.0)
        self.i, self.j = bonds.pairs.i[touching], bonds.pairs.j[touching]
        self.touching, self.dofs = touching, dofs
        rims = (radii[self.i], radii[self.j]) if dofs == 3 else None
        self.rows, self.sheared = _rows(bonds.normal[:, touching].T, bonds.r[1, touching], rims)
        self.weights = np.array(weights[: self.rows.shape[1]])

    def motions(self, x, strain):
        """(contacts, forms) of x (N, dofs) and a shear strain."""
        ends = np.concatenate((x[self.i], x[self.j]), axis=1)
        return np.einsum("cfx,cx->cf", self.rows, ends) + strain * self.sheared

    def on_disks(self, tensions, n: int):
        """Forces (N, dofs) that hold against tensions (contacts, forms)."""
        ends = np.einsum("cf,cfx->cx", tensions, self.rows)
        total = np.empty((n, self.dofs))
        for axis in range(self.dofs):
            total[:, axis] = np.bincount(self.i, ends[:, axis], minlength=n)
            total[:, axis] += np.bincount(self.j, ends[:, self.dofs + axis], minlength=n)
        return total


def _rows(normal, r_y, rims):
    """`linear_forms` as (M, forms, 2 dofs), and what a strain adds, (M, forms)."""
    forms = linear_forms(normal, r_y, rims)
    rows = np.stack([np.hstack((on_i, on_j)) for on_i, on_j, _ in forms], axis=1)
    return rows, np.stack([on_gamma for *_, on_gamma in forms], axis=1)


class _Pattern:
    """Upper triangle, as CSR, of a matrix with a block for every disk and every listed pair."""

    def __init__(self, pairs: PairList, n: int, dofs: int):
        component = np.arange(dofs)
        ends = np.concatenate(
            (pairs.i[:, None] * dofs + component, pairs.j[:, None] * dofs + component), axis=1
        )
        ends = ends.astype(np.int64)
        size = n * dofs
        row, column = np.broadcast_arrays(ends[:, :, None], ends[:, None, :])
        self._upper = row <= column
        keys = (row * size + column)[self._upper]
        diagonal = np.arange(size) * (size + 1)
        kept, places = np.unique(np.concatenate((keys, diagonal)), return_inverse=True)
        self._places, self._diagonal = places[: len(keys)], places[len(keys) :]
        self.indptr = np.searchsorted(kept // size, np.arange(size + 1)).astype(np.int32)
        self.indices = (kept % size).astype(np.int32)

    def fill(self, blocks, held):
        """Values of the sum of blocks (M, 2 dofs, 2 dofs), with `held` (unknowns,) added to the diagonal."""
        values = np.bincount(self._places, blocks[self._upper], minlength=len(self.indices))
        values[self._diagonal] += held
        return values


class MovingContacts:
    """A packing under an imposed strain; `gamma` is where it is, `disks` how it looks.

    scale: strain amplitude, what forces are compared with
    """

    def __init__(self, disks: Disks, law: Law, step: float, scale: float, prefix: str):
        k = float(disks.potential.k)
        self.dofs, self.step, self.h = law.dofs, step, STAGE * step
        self.weights = k * law.tau1 * np.array(law.on_contacts)
        self.diameter = 2.0 * float(disks.radii.mean())
        self.largest = 2.0 * float(disks.radii.max())
        stiffness = float(disks.potential.scale(np.array(self.diameter))) ** -2 * k
        self.unit, self.held = stiffness * self.largest, HELD * stiffness
        self.tolerance = max(TOLERANCE * scale, ROUNDED) * self.unit
        self._mu = self.held
        self.gamma, self.factorisations, self.iterations = 0.0, 0, 0
        self.u = np.zeros((disks.n, self.dofs))  # velocities, and spins
        self.skin, self.since = SKIN_START * self.diameter, 0
        self._solver = NewtonSolver(prefix, "the matrix of a time step", proves=False)
        self._reach = REACH * float(np.mean(find_contacts(disks).overlap))
        self._list(disks)

    def _list(self, disks):
        self._disks = disks.folded()
        self.pairs = PairList.build(self._disks, self.skin)
        self.listed = self.gamma
        self.offsets = np.zeros((disks.n, 2))
        self._pattern = _Pattern(self.pairs, disks.n, self.dofs)
        self._fresh, self.since = False, 0

    @property
    def disks(self) -> Disks:
        """The packing as it is now."""
        return deformed(self._disks, self.offsets, 0.0, self.gamma - self.listed)

    def displace(self, displacements, velocities):
        """Begin with disks moved by (N, 2) from where they are, at velocities (N, dofs)."""
        self._list(deformed(self._disks, displacements, 0.0, 0.0))
        self.u = velocities

    def advance(self, gamma, rate):
        """A step in which the strain is gamma[0], gamma[1] at the ends of its stages, and its rate rate[0], rate[1].

        Returns the Instants of both. Raises ConvergenceError where the step is too long.
        """
        while True:
            found = self._stages(gamma, rate)
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
        self.gamma, self.since = gamma[1], self.since + 1
        return instants

    def _stages(self, gamma, rate):
        """(offsets, velocities, instants) of a step, or None where the list does not serve for it."""
        base, u, instants = self.offsets, self.u, []
        for part in range(2):
            shear = gamma[part] - self.listed
            if self._is_stale(base, shear):
                return None
            found = self._stage(base, shear, rate[part], u)
            if found is None:
                return None
            end, u, instant = found
            instants.append(instant)
            base, first = base + (1.0 - STAGE) / STAGE * (end - base), end
        return first, u, instants

    def _is_stale(self, offsets, shear):
        far = float(np.hypot(*offsets.T).max())
        return is_stale(far, 0.0, shear, self.largest, self.skin)

    def _stage(self, base, shear, rate, u):
        """(offsets, velocities, Instant) at the end of a stage from `base`; None where the list does not serve."""
        n, h, potential = len(base), self.h, self._disks.potential
        area = self._disks.area

        def there(x):
            moved = x[:, :2].copy()
            moved[:, 0] -= shear * moved[:, 1]
            return base + moved

        def look(x):
            bonds = Bonds.of(self.pairs, potential, there(x), 0.0, shear)
            tensions = dashpots.weights / h * dashpots.motions(x, h * rate)
            left = -dashpots.on_disks(tensions, n)
            left[:, :2] += bonds.on_disks(bonds.force * bonds.normal, n)
            return bonds, tensions, left

        starts = []
        for x in (np.zeros_like(u), h * u):  # where a disk has slid off, it does not go on as it went
            if not self._is_stale(there(x), shear):
                bonds = Bonds.of(self.pairs, potential, there(x), 0.0, shear)
                dashpots = _Dashpots(bonds, self._disks.radii, self.weights, self.dofs)
                starts.append((np.abs(look(x)[-1]).max(), dashpots))
        _, dashpots = min(starts, key=lambda start: start[0])
        x = np.zeros_like(u)  # from here it is downhill
        bonds, tensions, left = look(x)
        for _ in range(ITERATIONS):
            size = np.abs(left).max()
            if size <= self.tolerance:
                break
            if not self._fresh:
                self._factorise(bonds, dashpots)
            step = self._solver.solve(left.ravel()).reshape(x.shape)
            length, (bonds, tensions, left) = self._search(look, x, step, left)
            x = x + length * step
            self.iterations += 1
            if not np.abs(left).max() <= WORN * size:
                self._fresh = False
            if self._is_stale(there(x), shear):
                return None
        else:
            raise ConvergenceError(
                f"forces of a time step are not balanced after {ITERATIONS} of Newton's steps, {size:.1e} of k d is "
                "left: give more --steps"
            )
        virial = -np.sum(bonds.force * bonds.normal[0] * bonds.r[1]) + np.sum(tensions * dashpots.sheared)
        power = float(np.sum(tensions**2 / np.where(dashpots.weights > 0.0, dashpots.weights, np.inf)))
        return there(x), x / h, Instant(float(virial) / area, power)

    def _search(self, look, x, step, left):
        """How far to go along a step, and what is there: where its force is small, or has begun to pull back."""
        pull, longest = np.vdot(step, left), float(np.hypot(*step[:, :2].T).max())
        reach = self._reach / max(longest, 1e-300)
        length, lower, upper = min(1.0, reach), (0.0, 1.0), None
        for _ in range(TRIES):
            found = look(x + length * step)
            now = np.vdot(step, found[-1]) / pull
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

    def _factorise(self, bonds, dashpots):
        """Factorise K + B/h + μ for the next solves, with μ no larger than it takes to be positive definite."""
        rims = (self._disks.radii[self.pairs.i], self._disks.radii[self.pairs.j]) if self.dofs == 3 else None
        rows, _ = _rows(bonds.normal.T, bonds.r[1], rims)
        springs = np.column_stack((bonds.stiffness, -bonds.force / bonds.distance))
        blocks = np.einsum("cf,cfx,cfy->cxy", springs, rows[:, :2], rows[:, :2])
        blocks[dashpots.touching] += np.einsum(
            "f,cfx,cfy->cxy", dashpots.weights / self.h, dashpots.rows, dashpots.rows
        )
        loose = self._loose(bonds)
        self._mu = max(self._mu / RAISED, self.held)
        while True:
            self.factorisations += 1
            values = self._pattern.fill(blocks, self._mu + loose)
            if self._solver.factorise(self._pattern.indptr, self._pattern.indices, values):
                break
            self._mu *= RAISED**2
        self._fresh = True

    def _loose(self, bonds):
        """What holds disks that contacts do not, (unknowns,): more than the −f/r that pushes them aside."""
        n = len(self.offsets)
        i, j = both_ends(*(ends[bonds.overlap > 0.0] for ends in (self.pairs.i, self.pairs.j)))
        push = bonds.force / bonds.distance
        aside = np.bincount(self.pairs.i, push, minlength=n) + np.bincount(self.pairs.j, push, minlength=n)
        return np.repeat(np.where(find_rattlers(n, i, j), 2.0 * aside, 0.0), self.dofs)

    def destroy(self):
        """Free the factor."""
        self._solver.destroy()
