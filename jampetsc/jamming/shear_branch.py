"""A branch of minima under a load: positions x(γ) at rest while the same particles touch, with tangent and proof."""

from dataclasses import dataclass

import numpy as np

from jampetsc.minimisation import ldl
from jampetsc.minimisation.contact_branch import (
    BEARING,
    OPEN_PAIR,
    STARTING,
    WEIGHTLESS,
    correct,
    empty_point,
    evaluate,
    factor_of_branch,
    overlap_rates,
    push_loose,
    remove_drift,
    respond,
)
from jampetsc.minimisation.warm_start import MIN_CURVATURE, displace_disks_by
from jampetsc.packing.contacts import both_ends, find_rattlers, pair_keys
from jampetsc.packing.strain import strained

# of the stiffness of a contact: what holds loose disks, so that a contact moves them along its normal; in a factor
HOLD_RATIO, FACTOR_HOLD_RATIO = 1e-6, 1e-3
PIN_RATIO = 1e12  # of it: what holds the other disks while loose ones move
TANGENT_TOLERANCE = 1e-10  # of the linear solve, relative
MODE_TOLERANCE, MAX_MODE_STEPS = 1e-4, 60  # of the lowest mode


@dataclass(frozen=True, eq=False)
class BranchState:
    """A point of the branch: where disks are, and how they move on.

    The parameter t of the branch is the strain, counted in the direction of the path, or s = φ · x of a mode φ.
    """

    t: float
    offsets: np.ndarray  # (N, D)
    shear: float  # amplitude of the load since the list
    moved: np.ndarray  # (N, D) in the laboratory, since t = 0
    slacks: (
        np.ndarray
    )  # (M,) overlaps of contacts and gaps of other pairs: negative where contacts must change
    motion: np.ndarray  # (N, D) d moved/dt
    strain_rate: float  # dγ/dt
    slack_rates: np.ndarray  # (M,)
    span: float  # of t, over which the tangent has changed to what it is


class ShearBranch:
    """Contacts `active` (M,) of the pairs of a list, which stay the same, and the factor of their K.

    n           number of disks
    gradient    of the load, by distances of the list, a `Strain`
    potential   `Potential.constants`
    stiffness   of a usual contact
    order       of elimination
    effort      counts evaluations and factorisations
    """

    def __init__(self, pairs, n: int, gradient, potential, stiffness: float, order, effort):
        self.pairs, self.n, self.gradient, self.potential, self.stiffness = (
            pairs,
            n,
            gradient,
            potential,
            stiffness,
        )
        self.order, self.effort = order, effort
        self.dimension = len(pairs.r0)
        self.active = np.zeros(len(pairs.i), np.int8)
        self.point = empty_point(pairs, n)
        self.no_mode = np.empty((0, self.dimension))
        self.factor = None
        self.classify()

    @property
    def overlaps(self):
        """δ (M,) of all pairs where `evaluate` was called last, negative for gaps."""
        return self.point[0]

    def classify(self, light: float = np.inf, touch: float = 0.0):
        """Find the disks that nothing holds: of too few contacts, none of which overlaps by more than `light`.

        touch: overlaps up to which contacts of a disk begin, if all of them do
        """
        chosen = np.flatnonzero(self.active)
        i, j = self.pairs.i[chosen], self.pairs.j[chosen]
        self.loose = find_rattlers(self.n, *both_ends(i, j), self.dimension)
        loaded = self.overlaps[chosen] > light
        self.loose[i[loaded]] = self.loose[j[loaded]] = False
        weightless = self.loose[i] | self.loose[j]
        started = np.zeros(self.n, bool)
        beyond = chosen[(self.overlaps[chosen] > touch) & ~weightless]
        started[self.pairs.i[beyond]] = started[self.pairs.j[beyond]] = True
        self.starting = ~(started | self.loose)  # (N,) disks whose contacts begin all at once
        begins = self.starting[i] | self.starting[j]
        self.active[chosen] = np.where(weightless, WEIGHTLESS, np.where(begins, STARTING, BEARING))
        self.bearing = np.where(self.active == WEIGHTLESS, OPEN_PAIR, self.active)
        self.weightless = np.where(self.active == WEIGHTLESS, WEIGHTLESS, OPEN_PAIR)
        self.shift = self.stiffness * np.where(self.loose, 1.0, MIN_CURVATURE)

    def start(self):
        """Let contacts that begin bear their forces: to call where disks have a tangent, before they move."""
        self.begun = self.starting[self.pairs.i] | self.starting[self.pairs.j]
        self.active[self.active == STARTING] = BEARING
        self.bearing[self.bearing == STARTING] = BEARING

    def evaluate(self, offsets, shear: float):
        """(U, dU/dγ, p D V) of the contacts; `point` has all the rest."""
        self.effort.evaluations += 1
        self.sums = evaluate(
            self.pairs, self.active, self.loose, offsets, shear, self.gradient, self.potential, self.stiffness,
            self.point,
        )  # fmt: skip
        return self.sums

    def factorise(self) -> bool:
        """Factorise K at the last point; whether it is positive definite. If not, the factor stays the old one."""
        self.effort.newton_steps += 1
        definite, factor = factor_of_branch(self.order, self.pairs, self.bearing, self.point[2], self.shift)
        if definite:
            self.factor = factor
        return definite

    def respond(self, right, mode=None):
        """K⁻¹ right, with a mode (K + c φ φᵀ)⁻¹ right, of the disks that are held; None if not definite."""
        mode, start = self.no_mode if mode is None else mode, np.zeros_like(right)
        steps = respond(
            self.pairs, self.bearing, self.point[2], self.shift, self.factor, mode, self.stiffness,
            np.where(self.loose[:, None], 0.0, right), start, TANGENT_TOLERANCE,
        )  # fmt: skip
        if steps < 0:
            return None
        remove_drift(self.loose, start)
        return start

    @property
    def _loose_system(self):
        """(shift, factor) of loose disks, the others pinned."""
        shifts = (
            self.stiffness * np.where(self.loose, ratio, PIN_RATIO)
            for ratio in (HOLD_RATIO, FACTOR_HOLD_RATIO)
        )
        shift, factor_shift = shifts
        return shift, factor_of_branch(self.order, self.pairs, self.weightless, self.point[2], factor_shift)[
            1
        ]

    def with_loose(self, motion, rate):
        """The motion of held disks with that of the loose ones that they push, as γ changes by `rate`."""
        if not self.weightless.any():
            return motion
        right = np.where(self.loose[:, None], rate * self.point[5], 0.0)
        push_loose(self.pairs, self.active, self.loose, self.point[2], motion, right)
        shift, factor = self._loose_system
        moves = np.zeros_like(motion)
        respond(
            self.pairs, self.weightless, self.point[2], shift, factor, self.no_mode, 0.0, right, moves,
            TANGENT_TOLERANCE,
        )  # fmt: skip
        return np.where(self.loose[:, None], moves, motion)

    def tangent(self, mode=None):
        """(d moved/dt, dγ/dt) at the last point, for dγ/dt = 1 or for a mode φ with φ · d moved/dt = 1."""
        motion = self.respond(self.point[5], mode)
        if motion is None:
            return None, 1.0
        if mode is None:
            return self.with_loose(motion, 1.0), 1.0
        own = self.respond(mode, mode)
        if own is None:
            return None, 0.0
        rate = (1.0 - self.stiffness * np.sum(mode * own)) / np.sum(mode * motion)
        return self.with_loose(rate * motion + self.stiffness * own, rate), rate

    def displace(self, offsets, moved, motion, shear: float):
        """Add a motion (N, D) in the laboratory to offsets, and to `moved`."""
        displace_disks_by(offsets, moved, motion, strained(self.gradient, shear), self.pairs.r0)

    def rates(self, motion, strain_rate: float):
        """dδ/dt (M,) of all pairs."""
        rates = np.empty(len(self.active))
        overlap_rates(self.pairs, self.point, motion, strain_rate, rates)
        return rates

    def signed(self, values):
        """Values (M,) of overlaps as slacks have them."""
        return np.where(self.active != OPEN_PAIR, values, -values)

    def state(self, t, offsets, shear, moved, tangent, span=0.0, slack_rates=None) -> BranchState:
        """The point of the last `evaluate` with this tangent, (d moved/dt, dγ/dt), and its rates if they are known."""
        if slack_rates is None:
            slack_rates = self.signed(self.rates(*tangent))
        return BranchState(t, offsets, shear, moved, self.signed(self.overlaps), *tangent, slack_rates, span)

    def advance(self, start: BranchState, dt: float, mode=None, short: float = 0.0):
        """(offsets, shear, moved, length of the correction) after dt from a state; None where Newton's method fails."""
        offsets, moved = start.offsets.copy(), start.moved.copy()
        self.displace(offsets, moved, dt * start.motion, start.shear)
        predicted = moved.copy()
        shear = start.shear + dt * start.strain_rate
        goal = start.t + dt if mode is not None else 0.0
        scalars = shear, self.stiffness, self.stiffness, goal, short
        success, shear, evaluations, self.sums = correct(
            self.pairs, self.bearing, self.loose, self.gradient, self.potential, scalars, self.shift,
            self.factor, self.no_mode if mode is None else mode, self.point, offsets, moved,
        )  # fmt: skip
        self.effort.evaluations += evaluations
        if success and self.weightless.any():
            success = self._move_loose(offsets, shear, moved)
        if not success:
            return None
        return offsets, shear, moved, float(np.abs((moved - predicted)[~self.loose]).max(initial=0.0))

    def _move_loose(self, offsets, shear, moved) -> bool:
        """Bring loose disks to rest, the others fixed; whether that succeeds."""
        self.evaluate(offsets, shear)
        scalars = shear, self.stiffness, 0.0, 0.0, 0.0
        success, *_ = correct(
            self.pairs, self.weightless, self.loose, self.gradient, self.potential, scalars,
            *self._loose_system, self.no_mode, self.point, offsets, moved,
        )  # fmt: skip
        self.evaluate(offsets, shear)
        return success

    def opening(self, pair):
        """The motion (N, D) by which a contact opens: K⁻¹ of a force along it, by the last factor."""
        push = np.zeros((self.n, self.dimension))
        push[self.pairs.j[pair]] += self.point[1][pair]
        push[self.pairs.i[pair]] -= self.point[1][pair]
        motion, work = np.empty_like(push), np.empty_like(push)
        ldl.solve(self.factor, push, motion, work)
        return motion

    def lowest_mode(self, start):
        """(lowest eigenvalue of K without loose disks and translations, its mode (N, D)), by the last factor.

        By Lanczos' method on K⁻¹ from `start` (N, D), to MODE_TOLERANCE of the mode.
        """
        shape, basis, images = start.shape, [], []
        vector, work = self._of_backbone(start), np.empty_like(start)
        for _ in range(MAX_MODE_STEPS):
            basis.append(vector.ravel() / np.linalg.norm(vector))
            image = np.empty_like(start)
            ldl.solve(self.factor, basis[-1].reshape(shape), image, work)
            images.append(self._of_backbone(image).ravel())
            rows = np.array(basis)
            values, shares = np.linalg.eigh(rows @ np.array(images).T)
            rest = images[-1] - rows.T @ (rows @ images[-1])
            rest -= rows.T @ (rows @ rest)
            vector = rest.reshape(shape)
            if np.linalg.norm(rest) * abs(shares[-1, -1]) <= MODE_TOLERANCE * values[-1]:
                break
        mode = (shares[:, -1] @ rows).reshape(shape)
        return 1.0 / values[-1] - self.stiffness * MIN_CURVATURE, mode

    def _of_backbone(self, moves):
        """Moves (N, D) of the backbone without their mean; of loose disks zero."""
        result = np.where(self.loose[:, None], 0.0, moves)
        remove_drift(self.loose, result)
        return result

    def carry(self, old: "ShearBranch"):
        """Take over the contacts of a branch on an earlier list of the same disks, at its last point."""
        chosen = np.flatnonzero(old.active)
        keys, vectors = pair_keys(old.pairs, old.n), _upward_normals(old)
        new_keys, new_vectors = pair_keys(self.pairs, self.n), _upward_normals(self)
        sort = np.argsort(new_keys, kind="stable")
        sorted_keys = new_keys[sort]
        first = np.searchsorted(sorted_keys, keys[chosen])
        best, least = np.full(len(chosen), -1), np.full(len(chosen), np.inf)
        place = first.copy()
        while True:  # several images of a pair have the same key
            inside = place < len(sort)
            same = np.zeros(len(chosen), bool)
            same[inside] = sorted_keys[place[inside]] == keys[chosen][inside]
            if not same.any():
                break
            candidate = np.where(same, sort[np.minimum(place, len(sort) - 1)], 0)
            off = np.abs(new_vectors[candidate] - vectors[chosen]).sum(axis=1)
            better = same & (off < least)
            best[better], least[better] = candidate[better], off[better]
            place += 1
        if (best < 0).any():
            raise RuntimeError("a contact is missing in a new list of neighbours")
        self.active[best] = old.active[chosen]
        self.classify()


def _upward_normals(branch):
    """Normals (M, D) of pairs, each from the disk with the lower number."""
    normals = branch.point[1]
    return np.where((branch.pairs.i < branch.pairs.j)[:, None], normals, -normals)
