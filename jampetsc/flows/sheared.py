"""Disks under steady shear at the present time: positions, velocities, contacts, and the state to continue from."""

import numpy as np

from jampetsc.flows import moves
from jampetsc.flows import steps as compiled
from jampetsc.flows.clusters import survey_of
from jampetsc.flows.resistance import Graph, Search
from jampetsc.laws.flow_models import Model, Scheme
from jampetsc.packing.domains import Domains, borders, domain_order
from jampetsc.packing.kernel import block_room
from jampetsc.packing.packing import PLACES, Packing
from jampetsc.packing.pairs import ListedDisks
from jampetsc.packing.threads import Team

INNER_SKIN_RATIO = 0.2  # skin of the near pairs, of which forces are computed, relative to that of the list
SORTED = 0.5  # strain between two sorts of the disks, which keep domains compact


class ShearedDisks(ListedDisks):
    """N disks sheared at a rate γ̇ under Lees–Edwards conditions, at the present time; `SteadyShear` moves them.

    The packing is `disks`, in a cell with tilt |γ| ≤ ½ Lx/Ly, at total strain `strain`, and `velocities_now()` are the
    non-affine velocities. `tally` has sums over time steps (see `moves.TALLY`). The first `held` disks are those of
    walls, which move with the affine flow (see `walls`).

    Internally many disks are sorted by place: disk a of all arrays is disk order[a] of those given.
    """

    ARRAYS = ("offsets", "velocities", "accelerations", "spins", "spin_rates")

    def __init__(
        self, disks: Packing, model: Model, rate: float, scheme: Scheme, team: Team | None = None, held=0
    ):
        self.model, self.rate, self.scheme, self.held = model, rate, scheme, held
        n = disks.n
        self.unit = float(disks.potential.k * model.law.tau1)  # kτ₁, of all weights
        sigma = 2.0 * np.array([disks.radii.min(), disks.radii.max()])
        self.strongest = float(disks.potential.force(sigma, sigma).max())
        self.inertia = 0.5 * model.mass * disks.radii**2  # uniform disks
        self.steps = 0  # time steps in all
        self.since = 0  # those since the list was made
        self.rebuilds = 0
        self.substeps = 0  # parts of steps that were divided
        self.velocities = np.zeros((n, 2))
        self.accelerations = np.zeros((n, 2))
        self.spins, self.spin_rates = np.zeros(n), np.zeros(n)
        self.tally = np.zeros(len(moves.TALLY))
        self._borders = np.minimum(borders(n), n)
        self.order, self._sorted_at = np.arange(n), -np.inf  # strain
        sums = np.zeros((2, len(self._borders) - 1, moves.SUMMED + 2))
        self._room = np.empty((2, n, 2)), np.empty((n, 2)), sums
        self._ahead, self._direction = np.empty((n, 2)), np.empty((3, n, 2))
        super().__init__(self._sorted(disks.replace(images=np.zeros((n, 2), int))), team=team)
        if held and model.mass:  # at rest when the walls begin to slide
            middle = 0.5 * disks.cell[1, 1]
            self.velocities[held:, 0] = rate * (middle - self.reference.positions[held:, 1])
        self.started = False

    def list(self, disks):
        """See `ListedDisks`; γ_ref is the strain now."""
        super().list(disks)
        self.since = 0
        domains = Domains.build(disks, self.skin, self._borders, self.team)
        self.lists = domains, domains.room()
        if self.solves:
            weights, number = self.model.law.on_contacts, domains.number
            graph = Graph.room(domains, disks.n, self.held, weights[0] != weights[1])
            search = Search(*self._direction, np.empty((2, number, 3)), np.empty(number))
            self._contacts = compiled.ContactSolve(graph, search)

    def fold(self):
        """See `ListedDisks`."""
        self.list(self._sorted(super().disks))

    def _sorted(self, disks):
        """The disks; after each strain of SORTED folded, and sorted with their arrays so that domains are compact."""
        if abs(self.strain - self._sorted_at) < SORTED:
            return disks
        self._sorted_at, disks = self.strain, disks.folded()
        if len(self._borders) == 2:
            return disks
        order = domain_order(disks, self.held)
        for name in (*self.ARRAYS[1:], "inertia", "order"):
            setattr(self, name, getattr(self, name)[order])
        return disks.reordered(order)

    @property
    def _given_order(self):
        """Permutation (N,) from the internal order to that of the disks given."""
        return np.argsort(self.order)

    @property
    def solves(self) -> bool:
        """Whether velocities are found by conjugate gradients."""
        return self.scheme.method != "verlet" and bool(self.model.law.damps_contacts or self.model.mass)

    @property
    def box(self):
        """See `ListedDisks`."""
        return 0.0, self.shear

    @property
    def strain(self) -> float:
        """Total strain γ since the start."""
        return self.steps * self.rate * self.scheme.step

    @property
    def shear(self) -> float:
        """g = γ − γ_ref."""
        return self.since * self.rate * self.scheme.step

    @property
    def here(self) -> Packing:
        """The packing at present, folded, in the internal order."""
        return super().disks.folded()

    @property
    def disks(self) -> Packing:
        """The packing at present, folded."""
        return self.here.reordered(self._given_order)

    def residual(self, u, rolling=None):
        """m u̇ (N, 2) at velocities u (N, 2); see `steps.residual_at`."""
        forces, listed, room = np.empty_like(u), self.lists[0], block_room()
        for d in range(listed.number):
            compiled.residual_at(listed, d, self.offsets, self.shear, self.task(), u, forces, rolling, room)
        return forces

    def task(self, part: float = 1.0) -> moves.StepConstants:
        """Constants of the compiled steps from here, with time steps of `part` of the scheme's."""
        unit, scheme = self.unit, self.scheme
        return moves.StepConstants(
            law=self.reference.potential.constants,
            weights=tuple(unit * w for w in self.model.law.on_contacts),
            drag=unit * self.model.drag,
            mass=float(self.model.mass),
            strongest=self.strongest,
            rate=float(self.rate),
            background=unit * self.model.law.eta_f * self.reference.area,
            held=self.held,
            listed=(self.largest, self.skin, INNER_SKIN_RATIO * self.skin),
            step=part * scheme.step,
            heun=scheme.heun,
            tolerance=float(scheme.tolerance),
            since=self.since,
        )

    def _space(self, velocities):
        return moves.StepArrays(*self.lists, self.offsets, self._ahead, velocities, *self._room, self.tally)

    def survey(self) -> dict:
        """Contacts at present: Z of disks that move, rattlers included, clusters, disks of the largest, largest δ/σ."""
        (domains, _), o, shear, held = self.lists, self.offsets, self.shear, self.held
        graph = Graph.room(domains, len(o), held, False)
        number, largest, deepest = survey_of(domains, o, shear, graph)
        return {
            "coordination": float(graph.number[held:].mean()),
            "clusters": number,
            "largest_cluster": largest,
            "deepest_overlap": deepest,
        }

    def velocities_now(self) -> np.ndarray:
        """Non-affine velocities (N, 2) at the present positions, in the order of `disks`; see `velocities_here`."""
        return self.velocities_here()[self._given_order]

    def velocities_here(self) -> np.ndarray:
        """Non-affine velocities (N, 2) at the present positions, in the order of `here`.

        They are those of which the next step computes its stresses and dissipation. With contact damping or backward
        Euler they are solved for here, as those of the last step belong to the contacts before it.
        """
        if self.scheme.method == "verlet":  # half a step on
            return self.velocities + 0.5 * self.scheme.step * self.accelerations
        if not self.solves:
            return self.residual(np.zeros_like(self.velocities)) / (self.unit * self.model.drag)
        u = self.velocities.copy()
        place = self._space(u), self.task(), self._contacts, self.lists[0], self.offsets, self.shear, u
        compiled.balance(0, 1, np.zeros(1, np.int64), *place, block_room())
        return u

    def spins_now(self) -> np.ndarray | None:
        """Angular velocities (N,) at the same time, in the order of `disks`; None if disks do not roll."""
        if not self.model.law.couples_rotations:
            return None
        return (self.spins + 0.5 * self.scheme.step * self.spin_rates)[self._given_order]

    def state(self) -> dict:
        """The whole state as arrays and numbers, for `restore` to the last bit.

        Disks are in the order in which they were given; `seen` is the tally.
        """
        back = self._given_order
        arrays, reference = (
            {name: getattr(self, name)[back] for name in self.ARRAYS},
            self.reference.reordered(back),
        )
        arrays |= {name: getattr(reference, name) for name in PLACES}
        counts = {name: getattr(self, name) for name in ("steps", "since", "rebuilds", "substeps")}
        arrays |= {"seen": self.tally.copy(), "skin": self.skin, "started": self.started, **counts}
        return arrays | {"images": reference.images, "order": self.order, "sorted_at": self._sorted_at}

    def restore(self, state: dict) -> None:
        """Return to the state that `state` gave."""
        self.skin = float(state["skin"])
        # older files have no images, and no order: disks are as given
        disks, self.order = self.disks, np.asarray(state.get("order", np.arange(len(self.order))), int)
        self._sorted_at = float(state.get("sorted_at", -np.inf))
        places = {name: np.asarray(state[name], float) for name in PLACES}
        images = state.get("images", disks.images)
        self.list(disks.replace(images=images, **places).reordered(self.order))
        self.inertia = 0.5 * self.model.mass * self.reference.radii**2
        for name in self.ARRAYS:
            setattr(self, name, np.array(state[name], float)[self.order])
        self.tally = np.array(state["seen"], float)
        self.steps, self.since, self.rebuilds = (int(state[name]) for name in ("steps", "since", "rebuilds"))
        self.substeps = int(state.get("substeps", 0))  # not in older files
        self.started = bool(state["started"])
