"""A minimum that is followed under a load while its contacts stay: its branch, and which pairs touch at a point of it.

Between two events the contacts are the same, and a branch of minima x(γ) is followed by its tangent and Newton's
method (`branch_follower`). Where overlaps vanish, which of several contacts that only touch stay is the
complementarity problem of their rates,

    dδ/dγ ≥ 0 of contacts that stay,    dδ/dγ ≤ 0 of those that open,

solved by changing the worst one after another. Particles that nothing holds are moved by contacts without a force.
"""

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.jamming.branch_follower import BranchFollower, rate_limit
from jampetsc.jamming.event_table import Measures
from jampetsc.jamming.shear_branch import BranchState, ShearBranch
from jampetsc.jamming.stepwise_shear import MinimumState, StepwiseShear, energy_cut
from jampetsc.laws.loads import Load, simple_shear
from jampetsc.minimisation.contact_branch import BEARING, OPEN_PAIR, WEIGHTLESS
from jampetsc.packing.neighbour_list import is_stale
from jampetsc.packing.neighbours import lengths
from jampetsc.packing.strain import gradient_over, strain_of, strained, volume_ratio

TOUCH_RATIO = 1e-13  # of the largest diameter: overlaps and gaps that are none
LIGHTEST_RATIO = 1e-15  # of the stiffness of a contact times its length: forces that are none
LIGHT_RATIO = 1e3  # of these: overlaps up to which a contact may belong to a particle that nothing holds
MAX_PIVOTS = 200  # contacts changed at one event
LARGEST_RATE_PIVOTS = 20  # of these by the largest rate, then by the lowest number, which cannot cycle


class CameApart(ConvergenceError):
    """No contact bears a force any more."""


class FollowedMinimum(StepwiseShear):
    """Disks at a minimum with a branch of its contacts. `direction`: ±1, of the path.

    The cell is strained by 1 + γE. Stresses are V⁻¹ dU/dγ, V the volume before any strain: σ_xy in simple shear.

    load   E, a `Load` with zeros below its diagonal; simple shear if not given
    """

    def __init__(self, disks, step, solver, tolerance, team=None, load: Load | None = None):
        self.load = load or simple_shear(disks.dimension)
        self.branch, self.shear, self._listed_strain = None, 0.0, 0.0
        self.first_volume = disks.volume
        self.direction = 1.0 if step > 0 else -1.0
        super().__init__(disks, step, solver, tolerance, team)

    @property
    def present_strain(self) -> float:
        """γ where the disks are now."""
        return self._listed_strain + self.shear

    @property
    def cell_strain(self):
        """See `ListedPacking`."""
        return strained(self._gradient, self.shear)

    @property
    def _gradient(self):
        """Gradient of the load by distances of the list, E (1 + γE)⁻¹."""
        E = strain_of(self.load.gradient)
        return gradient_over(E, strained(E, self._listed_strain))

    def list(self, disks):
        """See `ListedPacking`."""
        self._listed_strain = self.present_strain
        super().list(disks)

    def fold(self):
        """See `ListedPacking`; the contacts stay."""
        old = self.branch
        super().fold()
        if old is not None:
            self._find_order()
            self._make_branch()
            self.branch.carry(old)
            self._evaluate()

    def _make_branch(self):
        self.branch = ShearBranch(
            self.pairs, self.reference.n, self._gradient, self._potential, self._stiffness, self._order, self.effort
        )  # fmt: skip
        self._evaluate()

    def _evaluate(self):
        self.branch.evaluate(self.offsets, self.shear)

    def _factorise(self):
        """Begin a branch at the present list, with the contacts that overlap, and come to rest."""
        self._make_branch()
        unit = self._stiffness * self.diameter
        lightest = self.reference.potential.overlap_at(LIGHTEST_RATIO * unit, self.diameter)
        self._touch = max(TOUCH_RATIO * self.largest, lightest)
        self._come_to_rest()
        self._settle([])

    def _forces(self):
        """See `StepwiseShear`: the sums of the branch, of the contacts that it has."""
        return self.branch.sums

    def _minimum_state(self, sums):
        state = self._measures()
        n = self.reference.n
        return MinimumState(
            state.energy,
            state.shear_stress,
            state.pressure,
            bool(state.energy / n > energy_cut(self.reference.potential) * self.reference.potential.k),
            2.0 * state.contacts / n,
        )

    def _measures(self) -> Measures:
        energy, work, trace = self.branch.sums
        contacts = int(np.count_nonzero(self.branch.bearing))
        virial_volume = self.reference.dimension * self.volume * volume_ratio(self.cell_strain)
        return Measures(work / self.first_volume, trace / virial_volume, energy, contacts)

    def _come_to_rest(self):
        """Newton's method to the minimum of the contacts that overlap there. Raises ConvergenceError."""
        branch = self.branch
        branch.active[:] = branch.overlaps > self._touch
        for _ in range(MAX_PIVOTS):
            branch.classify()
            self._evaluate()
            self._require_contacts()
            if not branch.factorise():
                light = (branch.active != OPEN_PAIR) & (branch.overlaps <= self._touch)
                if not light.any():
                    break
                branch.active[light] = OPEN_PAIR  # of a soft potential, they hold nothing any more
                continue
            rest = np.zeros_like(self.offsets)
            start = BranchState(0.0, self.offsets, self.shear, rest, None, rest, 0.0, None, 0.0)
            result = branch.advance(start, 0.0)
            if result is None:
                break
            self.displacement = self.displacement + result[2]
            self.offsets[:] = result[0]
            wrong = (branch.bearing != OPEN_PAIR) & (branch.overlaps < -self._touch)
            wrong |= (branch.active == OPEN_PAIR) & (branch.overlaps > self._touch)
            if not wrong.any():
                return
            branch.active[wrong] = np.where(branch.active[wrong], OPEN_PAIR, BEARING)
        raise ConvergenceError(
            f"shear at strain {self.present_strain:.6g}: no minimum after an instability. Shear without events."
        )

    def _require_contacts(self):
        """Raise CameApart if no contact bears a force."""
        if self._measures().pressure < self._separated_pressure:
            raise CameApart(
                f"shear at strain {self.present_strain:.6g}: particles come apart, and events of loose ones are not "
                "supported. Compress the packing, or shear without events."
            )

    def _settle(self, pairs):
        """Change these pairs, then contacts that only touch until rates fit; the tangent, or None: K is indefinite."""
        branch = self.branch
        changes = list(pairs)
        for pivot in range(MAX_PIVOTS):
            for pair in changes:
                branch.active[pair] = BEARING if branch.active[pair] == OPEN_PAIR else OPEN_PAIR
            branch.classify(LIGHT_RATIO * self._touch, self._touch)
            self._evaluate()
            if not branch.factorise():
                if not changes:
                    raise ConvergenceError(
                        f"shear at strain {self.present_strain:.6g}: a saddle. Shear without events."
                    )
                self._opened = changes[-1]
                return None
            motion, _ = branch.tangent()
            if motion is None:
                break
            rates = self.direction * branch.rates(motion, 1.0)
            limit = rate_limit(motion, 1.0, self.diameter)
            near = np.abs(branch.overlaps) <= self._touch
            wrong = np.where(
                branch.active == OPEN_PAIR,
                near & (rates > limit),
                (near | (branch.active == WEIGHTLESS)) & (rates < -limit),
            )
            if not wrong.any():
                self._tangent = self.direction * motion, self.direction
                branch.start()
                return self._tangent
            by_rate = pivot < LARGEST_RATE_PIVOTS
            changes = [int(np.argmax(np.abs(rates) * wrong if by_rate else wrong))]
        raise ConvergenceError(
            f"shear at strain {self.present_strain:.6g}: contacts that touch do not settle"
        )

    def _follow(self, target):
        """Follow the branch to its next event, or to a strain; move there."""
        branch, still = self.branch, np.zeros_like(self.offsets)
        start = branch.state(0.0, self.offsets.copy(), self.shear, still, self._tangent)
        follower = BranchFollower(
            branch,
            start,
            target - self._listed_strain,
            self.direction,
            self._touch,
            self.diameter,
            self._is_stale,
        )
        arrival = follower.follow()
        self._take(arrival.state)
        return arrival

    def _is_stale(self, offsets, shear) -> bool:
        far = float(lengths(offsets).max())
        return bool(is_stale(far, strained(self._gradient, shear), self.largest, self.skin))

    def _take(self, state):
        """Move to a state of the branch."""
        self.offsets[:] = state.offsets
        self.shear = state.shear
        self.displacement += state.moved
        self._evaluate()
