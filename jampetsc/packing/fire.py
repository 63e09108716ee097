"""Quench by FIRE: damped dynamics to a minimum of the enthalpy, with the cell as one or two more coordinates.

FIRE: Bitzek et al., PRL 97, 170201 (2006), in the form of Guénolé et al., Comput. Mater. Sci. 175, 109584
(2020). The coordinates are the offsets o of the disks and, at fixed pressure, the strain ε = ln λ of the cell
and its shear g (see `forces`), scaled by √N so that they are about as stiff as a disk:

    −∂H/∂o = Fᵀ f,    −∂H/∂ε = Σ f r − 2 p V,    −∂H/∂g = Σ (f/r) r_x r_y,    H = U + p V
"""

from dataclasses import dataclass

import numba
import numpy as np

from jampetsc.contacts.disks import Disks
from jampetsc.contacts.kernel import FAST, pair_forces
from jampetsc.contacts.pairs import SKIN_START, PairList, deformed, is_stale, tuned_skin

STEP = 0.5  # largest time step, in units of √(m/k): the stiffest mode, ω² ≈ 8–12 k/m, is stable up to 0.6
DELAY = 20  # steps downhill before the time step grows
MIXING = 0.1


@dataclass(frozen=True)
class Goal:
    """What is held fixed while the energy is minimised."""

    pressure: float | None = None  # target p; None keeps the cell as it is
    shear: bool = False  # also relax the shear of the cell to σ_xy = 0


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _sums(f, v):
    """max |f|, f · v, f · f, v · v of flat arrays in one pass."""
    top = fv = ff = vv = 0.0
    for q in range(len(f)):
        size = abs(f[q])
        top = size if size > top else top
        fv += f[q] * v[q]
        ff += f[q] * f[q]
        vv += v[q] * v[q]
    return top, fv, ff, vv


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _move(o, v, f, keep, push, dt, back):
    """v ← keep v + push f, o ← o + dt v − back v_old; returns max |o|."""
    far = 0.0
    for q in range(len(o)):
        old = v[q]
        new = keep * old + push * f[q]
        here = o[q] + dt * new - back * old
        v[q] = new
        o[q] = here
        size = abs(here)
        far = size if size > far else far
    return far


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _longest(f):
    """Length of the longest row of f (N, 2)."""
    most = 0.0
    for q in range(len(f)):
        here = f[q, 0] * f[q, 0] + f[q, 1] * f[q, 1]
        most = here if here > most else most
    return np.sqrt(most)


@numba.njit(cache=True, fastmath=FAST, error_model="numpy")
def _descend(i, j, r0, sigma, law, o, v, f, box, moving, target, slack, limit, clock, steps):
    """FIRE steps until max |F| ≤ limit[0] and |box force| ≤ limit[1], a stale list, or `steps`.

    box (2, 2): ε, g and their velocities; moving: which of them move; target = (pV at ε = 0, √N, σ_max);
    slack: skin; clock = [dt, mixing, steps downhill, dt_max]. Returns steps done, status (0 more, 1
    converged, 2 stale list), max |F|, box force per d.
    """
    pv, scale, largest = target
    n2 = 2 * len(o)
    flat_o = o.reshape(n2)
    flat_v = v.reshape(n2)
    flat_f = f.reshape(n2)
    for step in range(steps):
        dt, mixing = clock[0], clock[1]
        strain, shear = box[0, 0], box[0, 1]
        _, wxx, wxy, wyy = pair_forces(i, j, r0, sigma, o, strain, shear, law, f)
        growth = np.exp(strain)
        g_strain = (wxx + wyy - 2.0 * pv * growth * growth) / scale if moving[0] else 0.0
        # ∂r/∂g = e^ε (y, 0) and r_y = e^ε y
        g_shear = wxy / scale if moving[1] else 0.0
        box_force = max(abs(g_strain), abs(g_shear)) * scale
        # −∂H/∂o = Fᵀ f: a common factor, but where the cell is sheared.
        factor = growth
        if shear != 0.0:
            factor = 1.0
            for q in range(len(o)):
                f[q, 1] = growth * (f[q, 1] + shear * f[q, 0])
                f[q, 0] = growth * f[q, 0]
        top, fv, f2, v2 = _sums(flat_f, flat_v)
        if (factor / growth) * top <= limit[0] and box_force <= limit[1]:
            worst = _longest(f) * factor / growth
            if worst <= limit[0]:
                return step + 1, 1, worst, box_force
        power = factor * fv + g_strain * box[1, 0] + g_shear * box[1, 1]
        ff = factor * factor * f2 + g_strain * g_strain + g_shear * g_shear
        vv = v2 + box[1, 0] * box[1, 0] + box[1, 1] * box[1, 1]
        if power > 0.0:
            clock[2] += 1.0
            if clock[2] > DELAY:
                dt = min(dt * 1.1, clock[3])
                mixing *= 0.99
            keep = 1.0 - mixing
            push = dt + mixing * np.sqrt(vv / ff)
            back = 0.0
        else:
            # Uphill: go half a step back, stop, and start again more slowly.
            clock[2] = 0.0
            back = 0.5 * dt
            dt = max(0.5 * dt, 0.02 * clock[3])
            mixing = MIXING
            keep = 0.0
            push = dt
        clock[0], clock[1] = dt, mixing
        for b in range(2):
            g = g_strain if b == 0 else g_shear
            box[0, b] -= back * box[1, b] / scale
            box[1, b] = keep * box[1, b] + push * g
            box[0, b] += dt * box[1, b] / scale
        far = np.sqrt(2.0) * _move(flat_o, flat_v, flat_f, keep, push * factor, dt, back)
        if is_stale(far, box[0, 0], box[0, 1], largest, slack):
            return step + 1, 2, _longest(f), box_force
    return steps, 0, _longest(f), box_force


class Quench:
    """A packing on its way to a minimum; `evaluations` counts force evaluations."""

    def __init__(self, disks: Disks, goal: Goal):
        self.goal = goal
        self.evaluations = 0
        self.skin = SKIN_START * self._diameter(disks)
        self.set_disks(disks)
        self.rest()

    @staticmethod
    def _diameter(disks):
        return 2.0 * float(np.mean(disks.radii))

    def set_disks(self, disks: Disks):
        """Start from these coordinates: new list, zero offsets and strain."""
        self._disks = disks
        self.pairs = PairList.build(disks, self.skin)
        self.offsets = np.zeros((disks.n, 2))
        self.box = np.vstack((np.zeros(2), getattr(self, "box", np.zeros((2, 2)))[1]))

    def rest(self):
        """Forget all velocities."""
        self.velocities = np.zeros((self._disks.n, 2))
        self.box[1] = 0.0
        step = self._longest_step()
        self.clock = np.array([0.2 * step, MIXING, 0.0, step])

    def _longest_step(self):
        """STEP in units of √(m/k), k the stiffest contact there is, or that the target pressure makes."""
        law, pairs = self._disks.potential, self.pairs
        depth = np.full_like(pairs.sigma, self.usual_overlap())
        if law.alpha > 2.0:
            moved = pairs.r0 + (self.offsets[pairs.j] - self.offsets[pairs.i]).T
            depth = np.maximum(depth, pairs.sigma - np.exp(self.box[0, 0]) * np.hypot(*moved))
        return STEP / np.sqrt(np.max(law.contact_stiffness(depth, pairs.sigma), initial=1e-300))

    def usual_overlap(self):
        """Overlap of a contact that carries a typical force, 2 p d."""
        law, d = self._disks.potential, self._diameter(self._disks)
        scale = float(law.scale(np.array(d)))
        pressure = self.goal.pressure if self.goal.pressure is not None else 1e-3 * law.k / scale**2
        return scale * (2.0 * pressure * d * scale / law.k) ** (1.0 / (law.alpha - 1.0))

    @property
    def disks(self) -> Disks:
        """The packing as it is now."""
        return deformed(self._disks, self.offsets, self.box[0, 0], self.box[0, 1])

    def fold(self):
        """Put offsets and strain into the coordinates and list the pairs anew."""
        self.set_disks(self.disks)

    def descend(self, force_limit, box_limit, max_evaluations):
        """FIRE until max |F| ≤ force_limit and the box force ≤ box_limit.

        Returns (converged, max |F|, box force).
        """
        goal = self.goal
        n = self._disks.n
        moving = np.array([goal.pressure is not None, goal.shear])
        limit = np.array([force_limit, box_limit])
        forces = np.empty((n, 2))
        law = self._disks.potential.constants
        diameter = self._diameter(self._disks)
        budget = self.evaluations + max_evaluations
        while True:
            pairs = self.pairs
            self.clock[3] = self._longest_step()
            target = ((goal.pressure or 0.0) * self._disks.area, np.sqrt(n), 2.0 * self._disks.radii.max())
            done, status, worst, box_force = _descend(
                *(pairs.i, pairs.j, pairs.r0, pairs.sigma, law),
                *(self.offsets, self.velocities, forces, self.box, moving),
                *(target, pairs.skin, limit, self.clock, min(2000, budget - self.evaluations)),
            )
            self.evaluations += done
            skin = self.skin
            if status == 2 or done >= 2000:
                self.skin = tuned_skin(skin, done, diameter)
            if status == 2 or self.skin != skin:
                self.fold()
            if status == 1 or self.evaluations >= budget:
                return status == 1, worst, box_force
