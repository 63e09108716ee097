"""The last digits of a minimisation: damped Newton steps with the exact Hessian, disks and cell together.

A step solves (K + μ) u = F with μ > 0, much smaller than the softest stiffness, p, so that rattlers, which no contact
holds, need no special treatment; the cell is eliminated by its Schur complement. A converged packing is proved a
minimum if the Cholesky factorisation of K without μ and without rattlers, one disk pinned against translations,
succeeds and the Schur complement of the cell is positive. Otherwise it is a saddle, and is left along a mode of
negative curvature. The pattern of K is analysed once for each pair list.

The factorisation is passed in (`solver`), so that this package needs no PETSc:

    solver.factorise(indptr, indices, values, D) -> bool    upper triangle of blocks of order D as CSR; False if not
                                                            positive definite
    solver.solve(b) -> x
    solver.order(n, i, j) -> order in which `ldl` is to eliminate the n disks; pairs i, j are neighbours
"""

import itertools
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from jampetsc.minimisation.descent import Descent
from jampetsc.minimisation.hessian import Bonds, Pattern, border
from jampetsc.packing.contacts import LOAD_RATIO, both_ends, find_rattlers, force_threshold, virial_pressure
from jampetsc.packing.neighbours import lengths

MAX_STEPS = 12  # a few are enough with the contacts of the minimum; without, L-BFGS should continue
DAMPING = 1e-3  # first μ, in units of p
MIN_DAMPING_AFTER_MODE = 4e-4  # at least, after a negative mode
MIN_DAMPING = 1e-4  # where max |F| > NEAR_MINIMUM_FORCE p d^(D−1)
NEAR_MINIMUM_FORCE = 1e-3
ROUNDING_FORCE = 1e-5  # max |F| / (p d^(D−1)) below which slopes are near rounding, and full steps are taken
MAX_NEWTON_MOVE = 0.1  # no disk moves farther in one step, in units of d
MAX_RAISES = 60  # of μ, fourfold each, before a Hessian is given up
SLOPE_RATIO = 0.3  # slope at the end of a search, as a share of that at its beginning
MAX_SEARCH_POINTS = 12  # points of a search
MAX_MODE_ITERATIONS = 50  # to find a negative mode
FORCE_FLOOR = 3e-15  # in units of k d
STRESS_FLOOR = 4e-16  # in units of k/√N, in space over d
# of the root of the sum of squares of what rounding one bond may do; less than the above where sizes are alike
BOND_FORCE_FLOOR, BOND_STRESS_FLOOR = 5e-16, 2e-16


class Imbalance(NamedTuple):
    """How far a packing is from equilibrium."""

    force: float  # max |F| over all disks
    pressure: float  # |p − p_target|, 0 at fixed cell
    shear_stress: float  # largest of |σ_xy|, … where the shears of the cell are free, else 0

    def within(self, limits: "Imbalance") -> bool:
        """Whether every part is at most that of `limits`."""
        return all(part <= limit for part, limit in zip(self, limits, strict=True))


class Limits:
    """Residuals that count as converged: relative to p, but no less than the rounding of bonds leaves.

    The force of a bond is uncertain by about 1e-16 k r. Where sizes are alike, r ~ d, the net force on a disk, of half
    a dozen, is uncertain by a few times that, and the pressure, a mean over N bonds, by 1/√N of it. Large disks have
    longer bonds and more of them: see `force_floor` and `stress_floor`.
    """

    def __init__(self, descent: Descent, tolerance: float):
        self._descent, self._tolerance = descent, tolerance

    def of_tolerance(self, pressure: float) -> Imbalance:
        """The limits that `tolerance` sets at this pressure."""
        stress = self._tolerance * pressure
        return Imbalance(self._descent.force_at(stress), stress, stress)

    def at(self, point: "Point", pressure: float | None = None) -> Imbalance:
        """The larger of the limits of the tolerance and of rounding at a point, or at another pressure than its own."""
        pressure = point.pressure if pressure is None else pressure
        limits, stiffness = self.of_tolerance(pressure), self._descent.usual_stiffness(pressure)
        length, bonds = self._descent.diameter ** (self._descent.dimension - 2), point.bonds
        stress = stress_floor(stiffness / length, self._descent, bonds)
        ends = bonds.pairs.i, bonds.pairs.j
        force = force_floor(
            stiffness * self._descent.diameter, point.n, *ends, bonds.stiffness * bonds.distance
        )
        return Imbalance(max(limits.force, force), *[max(limits.pressure, stress)] * 2)


def force_floor(usual: float, n: int, i, j, changes) -> float:
    """What rounding may leave of the largest net force on n disks.

    usual     k d of a contact of mean size
    changes   k r of the bonds (M,) between disks i and j, (M,) each: what relative changes of their lengths do
    """
    squares = np.square(changes)
    on_disks = np.bincount(i, squares, n) + np.bincount(j, squares, n)
    return max(FORCE_FLOOR * usual, BOND_FORCE_FLOOR * float(np.sqrt(on_disks.max())))


def stress_floor(usual: float, disks, bonds) -> float:
    """What rounding may leave of pressure and shear stress.

    usual: unit of stress, k or in space k/d; disks: a packing or `Descent`; bonds: theirs
    """
    changes = float(np.sqrt(np.sum(np.square(bonds.stiffness * np.square(bonds.distance)))))
    of_bonds = changes / (disks.dimension * disks.volume)
    return max(STRESS_FLOOR * usual / np.sqrt(disks.n), BOND_STRESS_FLOOR * of_bonds)


@dataclass(frozen=True, eq=False)
class Point:
    """Bonds, pressure and forces of a packing during a minimisation."""

    target: float  # pressure that the cell is under; 0 in a fixed cell
    moving: tuple  # which strains of the cell move
    bonds: Bonds
    n: int
    volume: float
    pressure: float
    forces: np.ndarray  # (N, D) −∂H/∂o
    drive: np.ndarray  # (C,) −∂H of the strains of the cell, 0 for those that do not move

    @classmethod
    def of(cls, descent: Descent) -> "Point":
        """The present point of `descent`."""
        n, volume, target = descent.n, descent.volume, descent.goal.pressure or 0.0
        bonds, dimension = descent.bonds(), descent.dimension
        pressure = virial_pressure(bonds.force, bonds.distance, volume, dimension)
        push = bonds.force * bonds.normal
        planes = itertools.combinations(range(dimension), 2)
        pulls = [dimension * volume * (pressure - target), *(np.sum(push[a] * bonds.r[b]) for a, b in planes)]
        drive = np.where(descent.moving, pulls, 0.0)
        return cls(target, descent.moving, bonds, n, volume, pressure, bonds.on_disks(push, n), drive)

    @property
    def residual(self) -> Imbalance:
        """How far this is from equilibrium."""
        return Imbalance(
            force=float(lengths(self.forces).max()),
            pressure=abs(self.drive[0]) / (self.bonds.dimension * self.volume),
            shear_stress=float(np.abs(self.drive[1:]).max()) / self.volume,
        )

    def along(self, step) -> float:
        """−∂H along a step (u, strain)."""
        move, strain = step
        return _inner(self.forces, move) + _inner(self.drive, strain)

    def load_bearing(self, disks):
        """(the point with its load-bearing contacts alone, mask (N,) of the disks they hold, whether they bear all).

        One of these disks is left out of the mask, to be pinned against translations. Where contacts bear a load on
        disks that they do not hold, as a disk between two others, these belong to the point, with all their contacts:
        such a point is a saddle, or rests on contacts too weak to count.
        """
        i, j, force = self.bonds.pairs.i, self.bonds.pairs.j, self.bonds.force
        bears = force > force_threshold(disks, self.pressure)
        backbone = ~find_rattlers(self.n, *both_ends(i[bears], j[bears]), disks.dimension)
        outside = ~(backbone[i] & backbone[j])
        loaded = bears & outside & (force > LOAD_RATIO * self.residual.force)
        if loaded.any():
            backbone[i[loaded]] = backbone[j[loaded]] = True
            bears = (force > 0.0) & outside | bears
        bare = replace(self, bonds=self.bonds.only(bears & backbone[i] & backbone[j]))
        if backbone.any():
            backbone[np.argmax(backbone)] = False
        return bare, backbone, not loaded.any()


class Linear:
    """(H + μ) of a point, factorised: disks by `solver`, the cell by its Schur complement."""

    def __init__(self, point: Point, pattern: Pattern, solver, free, mu: float):
        self._solver, self._free, self._moving = solver, free, point.moving
        self._dimension = point.bonds.dimension
        values = pattern.fill(point.bonds, free, mu)
        self.definite = bool(free.any()) and solver.factorise(
            pattern.indptr, pattern.indices, values, self._dimension
        )
        if not self.definite:
            return
        rows, corner = border(point.bonds, point.n, point.volume, point.target)
        self._rows = np.where(free[:, None, None], rows, 0.0)
        self._response = np.stack([self._disks(self._rows[..., b]) for b in range(len(corner))], axis=-1)
        corner = corner + mu * point.n * np.eye(len(corner))
        schur = corner - np.einsum("nab,nac->bc", self._rows, self._response)
        self.modulus = float(schur[1, 1]) / point.volume
        self._schur = np.where(np.logical_and.outer(self._moving, self._moving), schur, np.eye(len(schur)))
        self.definite = is_definite(self._schur)

    def _disks(self, right):
        return self._solver.solve(np.ascontiguousarray(right).ravel()).reshape(-1, self._dimension)

    def solve(self, forces, drive):
        """(u (N, D), strain (C,)) with (H + μ)(u, strain) = (forces, drive)."""
        move = self._disks(np.where(self._free[:, None], forces, 0.0))
        left = np.where(self._moving, drive - np.einsum("nab,na->b", self._rows, move), 0.0)
        strain = solve_dense(self._schur, left)
        return move - np.einsum("nab,b->na", self._response, strain), strain


class Newton:
    """Newton steps on a descent; `Effort.newton_steps` counts factorisations."""

    def __init__(self, descent: Descent, solver):
        self.descent, self.solver = descent, solver
        self._analysed = None, None

    def factorise(self, point, free, mu) -> Linear:
        """(H + μ) of a point for the disks of the mask `free` (N,); the pattern is analysed once for each list."""
        pairs = self.descent.pairs
        if self._analysed[0] is not pairs:
            self._analysed = pairs, Pattern(pairs, self.descent.n, self.descent.dimension)
        self.descent.effort.newton_steps += 1
        return Linear(point, self._analysed[1], self.solver, free, mu)

    def factorise_definite(self, point, free, mu):
        """(H + μ) with μ raised until it is positive definite, and that μ."""
        for _ in range(MAX_RAISES):
            linear = self.factorise(point, free, mu)
            if linear.definite:
                break
            mu = max(4.0 * mu, MIN_DAMPING_AFTER_MODE * point.pressure)
        return linear, mu

    def converge(self, limits: Limits) -> bool:
        """Up to MAX_STEPS steps, until the residual is within `limits` or rounding stops it; whether it is within."""
        d, unit = self.descent.diameter, self.descent.force_at(1.0)
        free = np.ones(self.descent.n, bool)
        point = Point.of(self.descent)
        mu = DAMPING * point.pressure
        last = np.inf
        for _ in range(MAX_STEPS):
            scale, force = point.pressure, point.residual.force
            if point.residual.within(limits.of_tolerance(scale)):
                return True
            if point.residual.within(limits.at(point)) and force > 0.5 * last:
                return True
            last = force
            linear, mu = self.factorise_definite(point, free, mu)
            if not linear.definite:
                return False
            step = linear.solve(point.forces, point.drive)
            longest = float(lengths(step[0]).max())
            if not 0.0 < longest < np.inf:
                return False
            length = min(1.0, MAX_NEWTON_MOVE * d / longest)
            if force > ROUNDING_FORCE * scale * unit:
                length, point = self.search_along(point, step, length)
            else:
                point = self.advance(step, length)
            if length > 0.7:
                near = point.residual.force <= NEAR_MINIMUM_FORCE * scale * unit
                mu = max(0.3 * mu, 0.0 if near else MIN_DAMPING * scale)
            elif length < 0.3:
                mu *= 3.0
        return point.residual.within(limits.at(point))

    def advance(self, step, length) -> Point:
        """Move by `length` of a step (u, strain); the point there."""
        self.descent.move(length * step[0], length * step[1])
        return Point.of(self.descent)

    def search_along(self, start, step, length):
        """Line search along a step for a small slope; the whole step if it is downhill to its end.

        Returns (length, point there).
        """
        pull = start.along(step)
        point = self.advance(step, length)
        slope = point.along(step)
        if slope >= 0.0:
            return length, point
        lower, upper = (0.0, pull), (length, slope)
        for _ in range(MAX_SEARCH_POINTS):
            if abs(slope) <= SLOPE_RATIO * pull:
                break
            here, length = length, flat_between(lower, upper)
            point = self.advance(step, length - here)
            slope = point.along(step)
            if slope > 0.0:
                lower = (length, slope)
            else:
                upper = (length, slope)
        return length, point

    def prove(self):
        """G₀ of the load-bearing contacts if they are proved to make this a minimum, else None."""
        point, backbone, complete = Point.of(self.descent).load_bearing(self.descent.disks)
        if not complete:
            return None
        linear = self.factorise(point, backbone, 0.0)
        return linear.modulus if linear.definite else None

    def leave_saddle(self) -> bool:
        """Go down along a mode of negative curvature, to where the slope is steepest; False if none is found."""
        descent = self.descent
        point, backbone, _ = Point.of(descent).load_bearing(descent.disks)
        mode = self.find_negative_mode(point, backbone) if backbone.any() else None
        if mode is None:
            return False
        longest = float(lengths(mode[0]).max())
        size = 0.1 * descent.usual_overlap() / longest
        for _ in range(MAX_SEARCH_POINTS):
            pulls = {sign * size: self.pull_after(mode, sign * size) for sign in (1.0, -1.0)}
            way = max(pulls, key=pulls.get)
            if pulls[way] > 0.0:
                break
            size *= 0.1
        else:
            return False
        pull = pulls[way]
        while abs(2.0 * way) * longest <= MAX_NEWTON_MOVE * descent.diameter:
            farther = self.pull_after(mode, 2.0 * way)
            if farther <= pull:
                break
            way, pull = 2.0 * way, farther
        self.advance(mode, way)
        return True

    def pull_after(self, mode, way):
        """Force along `mode`, in the direction of `way`, after a move by way · mode."""
        pull = np.sign(way) * self.advance(mode, way).along(mode)
        self.advance(mode, -way)
        return pull

    def find_negative_mode(self, point, backbone):
        """A move (u, strain) of negative curvature, by inverse iteration with μ; None without one."""
        linear, mu = self.factorise_definite(point, backbone, MIN_DAMPING * point.pressure)
        if not linear.definite:
            return None
        weight = float(point.n)  # of a strain, beside a move of one disk
        move = np.random.default_rng(point.n).standard_normal(point.forces.shape)
        strain = np.zeros(len(point.drive))
        curvature = np.inf
        for _ in range(MAX_MODE_ITERATIONS):
            new, turned = linear.solve(move, weight * strain)
            norm = _inner(new, new) + weight * _inner(turned, turned)
            previous = curvature
            curvature = (_inner(new, move) + weight * _inner(turned, strain)) / norm - mu
            move, strain = new / np.sqrt(norm), turned / np.sqrt(norm)
            if curvature < 0.0 and abs(curvature - previous) < 0.1 * abs(curvature):
                break
        return (move, strain) if curvature < 0.0 else None


def _inner(a, b) -> float:
    """Σ a b; without BLAS, whose last digits depend on the processor."""
    return float(np.sum(a * b))


def flat_between(lower, upper) -> float:
    """Length between two (length, slope) where the slope may vanish, by the secant, at least a tenth from each end."""
    share = min(max(lower[1] / (lower[1] - upper[1]), 0.1), 0.9)
    return lower[0] + share * (upper[0] - lower[0])


def is_definite(matrix) -> bool:
    """Whether a small symmetric matrix (C, C) has positive pivots only."""
    return _eliminated(matrix, np.zeros(len(matrix))) is not None


def solve_dense(matrix, right):
    """x of a small definite system, (C, C) and (C,); without LAPACK, whose last digits depend on the processor."""
    if len(matrix) == 2:
        (a, b), (_, c) = matrix
        return np.array([c * right[0] - b * right[1], a * right[1] - b * right[0]]) / (a * c - b * b)
    upper, x = _eliminated(matrix, right)
    for row in range(len(x))[::-1]:
        x[row] = (x[row] - _inner(upper[row, row + 1 :], x[row + 1 :])) / upper[row, row]
    return x


def _eliminated(matrix, right):
    """(upper triangle, right side) after Gauss's elimination without pivoting; None if a pivot is not positive."""
    upper, x = np.array(matrix), np.array(right)
    for row in range(len(x)):
        if not upper[row, row] > 0.0:
            return None
        for below in range(row + 1, len(x)):
            factor = upper[below, row] / upper[row, row]
            upper[below] -= factor * upper[row]
            x[below] -= factor * x[row]
    return upper, x
