"""The last digits of a quench: Newton's method with the exact Hessian, disks and cell together.

Disks that are held (rattlers, and one pinned against translations) keep unit rows, so the pattern never
changes and a successful Cholesky factorisation proves that K without rattlers has no negative eigenvalue. The
cell is eliminated by its Schur complement. The factorisation is passed in (`solver`), so that this package
needs no PETSc:

    solver.factorise(indptr, indices, values) -> bool    upper triangle as CSR; False if not positive definite
    solver.solve(b) -> x
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.contacts.state import both_ends, find_rattlers, force_threshold, virial_pressure
from jampetsc.packing.fire import Quench
from jampetsc.packing.hessian import Bonds, Pattern, border

STEPS = 12  # quadratic convergence needs far fewer: then FIRE should do some more
RELEASES = 200  # sweeps of pushing rattlers out of overlaps
REACH = 0.3  # no disk may move by more than this in one Newton step, in units of d


@dataclass(frozen=True)
class Residual:
    """How far a packing is from equilibrium."""

    force: float  # max |F| over disks that are not rattlers
    pressure: float  # |p − p_target|, 0 at fixed cell
    shear_stress: float  # |σ_xy| where the shear of the cell is free, else 0

    def within(self, limits: "Residual") -> bool:
        """Whether every part is at most that of `limits`."""
        return (
            self.force <= limits.force
            and self.pressure <= limits.pressure
            and self.shear_stress <= limits.shear_stress
        )


def limits(disks, pressure, tolerance) -> Residual:
    """What counts as converged: relative to p, but never below the rounding of bonds, r ~ d.

    One force is uncertain by about 1e-16 k d, the pressure, a mean over N bonds, by 1/√N of that.
    """
    d = 2.0 * float(np.mean(disks.radii))
    k = float(disks.potential.k)
    stress = max(tolerance * pressure, 4e-16 * k / np.sqrt(disks.n))
    return Residual(max(tolerance * pressure * d, 2e-15 * k * d), stress, stress)


class Polish:
    """Newton steps on a quench; `steps` counts factorisations."""

    def __init__(self, quench: Quench, solver):
        self.quench, self.solver = quench, solver
        self.steps = 0
        self.modulus = None

    def look(self):
        """Fold the quench and evaluate bonds, rattlers and residual there."""
        quench = self.quench
        quench.fold()
        disks = quench.disks
        self.disks, self.n, self.area = disks, disks.n, disks.area
        self.bonds = bonds = Bonds.of(quench.pairs, disks.potential)
        self.pressure = virial_pressure(bonds.force, bonds.distance, self.area)
        self.forces = bonds.on_disks(bonds.force * bonds.normal, self.n)
        self.rattlers = self._rattlers()
        self.drive = np.array([0.0, float(np.sum(bonds.force * bonds.normal[0] * bonds.pairs.r0[1]))])
        if quench.goal.pressure is not None:
            self.drive[0] = 2.0 * self.area * (self.pressure - quench.goal.pressure)
        held = self.forces[~self.rattlers]
        self.residual = Residual(
            force=float(np.sqrt((held**2).sum(axis=1).max())) if len(held) else 0.0,
            pressure=abs(self.drive[0]) / (2.0 * self.area),
            shear_stress=abs(self.drive[1]) / self.area if quench.goal.shear else 0.0,
        )
        return self.residual

    def _rattlers(self):
        bears = self.bonds.force > force_threshold(self.disks, self.pressure)
        return find_rattlers(self.n, *both_ends(self.bonds.pairs.i[bears], self.bonds.pairs.j[bears]))

    def _factorise(self, bonds):
        """Factor, border and Schur complement of the cell for these bonds; None if K has a negative mode.

        Returns (free, rows, response, schur): the mask of moving disks, ∂²H/∂o∂(ε, g), K⁻¹ of it, and what
        the cell feels.
        """
        free = ~self.rattlers
        if not free.any():
            return None
        free[np.argmax(free)] = False  # pinned against translations
        pattern = Pattern(bonds.pairs, self.n)
        self.steps += 1
        if not self.solver.factorise(pattern.indptr, pattern.indices, pattern.fill(bonds, free)):
            return None
        rows, corner = border(bonds, self.n, self.area, self.quench.goal.pressure or 0.0)
        rows[~free] = 0.0
        response = np.stack([self._solve(rows[..., b]) for b in range(2)], axis=-1)
        schur = corner - np.einsum("nab,nac->bc", rows, response)
        return free, rows, response, schur

    def _solve(self, right):
        return self.solver.solve(right.ravel()).reshape(self.n, 2)

    @property
    def _moving(self):
        goal = self.quench.goal
        return [b for b, moves in enumerate((goal.pressure is not None, goal.shear)) if moves]

    def step(self) -> bool:
        """One Newton step from where `look` was. False if K has a negative mode or the step is too long."""
        factor = self._factorise(self.bonds)
        if factor is None:
            return False
        free, rows, response, schur = factor
        moving = self._moving
        move = self._solve(np.where(free[:, None], self.forces, 0.0))
        strain = np.zeros(2)
        if moving:
            inner = schur[np.ix_(moving, moving)]
            if np.linalg.eigvalsh(inner)[0] <= 0:
                return False
            strain[moving] = np.linalg.solve(inner, (self.drive - np.einsum("nab,na->b", rows, move))[moving])
            move -= response @ strain
        reach = REACH * 2.0 * float(np.mean(self.disks.radii))
        if not np.isfinite(move).all() or np.abs(move).max() > reach or np.abs(strain).max() > 0.05:
            return False
        self.quench.offsets += move
        self.quench.box[0] += strain
        return True

    def prove(self) -> bool:
        """Whether the load-bearing contacts alone make this a minimum; sets `modulus`, their G₀."""
        i, j = self.bonds.pairs.i, self.bonds.pairs.j
        bearing = self.bonds.force > force_threshold(self.disks, self.pressure)
        bearing &= ~(self.rattlers[i] | self.rattlers[j])
        bonds = replace(
            self.bonds, force=self.bonds.force * bearing, stiffness=self.bonds.stiffness * bearing
        )
        factor = self._factorise(bonds)
        if factor is None:
            return False
        schur, moving = factor[-1], self._moving
        self.modulus = float(schur[1, 1]) / self.area
        return not moving or float(np.linalg.eigvalsh(schur[np.ix_(moving, moving)])[0]) > 0.0

    def release_rattlers(self):
        """Move rattlers out of the disks they still touch: FIRE, with hardly a force on them, is slow at it.

        Only rattlers move. One that finds no room within RELEASES sweeps stays; its forces then count on its
        neighbours.
        """
        pairs, disks = self.bonds.pairs, self.disks
        pressed = self.rattlers[pairs.i] | self.rattlers[pairs.j]
        i, j, r0, sigma = pairs.i[pressed], pairs.j[pressed], pairs.r0[:, pressed], pairs.sigma[pressed]
        moved = np.zeros((disks.n, 2))
        room = 1e-9 * float(np.mean(disks.radii))
        for _ in range(RELEASES):
            r = r0 + (moved[j] - moved[i]).T
            distance = np.hypot(*r)
            depth = np.where(sigma > distance, sigma - distance + room, 0.0)
            if not depth.any():
                break
            push = depth * r / distance
            for axis in range(2):
                np.add.at(moved[:, axis], j, push[axis])
                np.add.at(moved[:, axis], i, -push[axis])
            moved[~self.rattlers] = 0.0
        if moved.any() and np.abs(moved).max() < 0.5 * pairs.skin:
            self.quench.offsets += moved
            self.look()

    def converge(self, wanted: Residual) -> bool:
        """Newton to `wanted`. True when there, and a minimum is proved; else the quench is where it was.

        Gives up as soon as a step does not halve the residual: then contacts still change and FIRE should go
        on.
        """
        start = self.quench.disks
        self.look()
        self.release_rattlers()
        last = self.residual
        for _ in range(STEPS):
            if last.within(wanted):
                if self.prove():
                    return True
                break
            if not self.step():
                break
            here = self.look()
            if not here.within(wanted) and (
                here.force > 0.5 * last.force and here.pressure > 0.5 * last.pressure
            ):
                break
            last = here
        self.quench.set_disks(start)
        self.quench.rest()
        return False
