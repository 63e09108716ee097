"""Disks under steady shear: time steps from one neighbour list to the next, and the state to continue from."""

import numpy as np

from jampetsc.errors import ConvergenceError, named
from jampetsc.flows.clusters import survey_of
from jampetsc.flows.integrators import (
    ContactSolve,
    Turning,
    balance,
    contact_steps,
    drag_steps,
    massive_steps,
    residual_at,
)
from jampetsc.flows.resistance import Graph, Search
from jampetsc.flows.step_kernels import (
    BLOWN_UP,
    DONE,
    STALE,
    SUMMED,
    TALLY,
    UNSOLVED,
    StepArrays,
    StepConstants,
)
from jampetsc.laws.flow_models import INERTIA, Model, Scheme, stiffest
from jampetsc.packing.kernel import block_room
from jampetsc.packing.neighbour_list import ListedPacking, NeighbourList, borders, domain_order
from jampetsc.packing.packing import PLACES, Packing, deformed
from jampetsc.packing.strain import simple_shear
from jampetsc.packing.threads import Team

INNER_SKIN_RATIO = 0.2  # skin of the inner list, of which forces are computed, relative to that of the list
SORT_STRAIN = 0.5  # strain between two sorts of the disks, which keep domains compact
# in units of the largest diameter, longest move of a disk in a part of a divided step
MAX_PART_MOVE_RATIO = 0.25
MIN_STEP_PART = 2.0**-30  # part of a time step; if a disk jumps in this one too, the step is refused
# cost of a list in force evaluations; high, as width costs only when the inner list is made
REBUILD_COST = 25.0
MIN_LIST_STEPS = 3.0  # time steps whose shear alone a list must serve: large particles make it stale soon


class SteadyShear(ListedPacking):
    """N disks that `advance` shears at a rate γ̇ under Lees–Edwards conditions, on the threads of `team`.

    The packing is `disks`, in a cell with tilt |γ| ≤ ½ Lx/Ly, at total strain `strain`. `tally` has sums over time
    steps (see `step_kernels.TALLY`). The first `wall_disks` disks make up walls, which move with the affine flow
    (see `walls`). The number of threads does not change the result.

    Internally many disks are sorted by place: disk a of all arrays is disk order[a] of those given.
    """

    ARRAYS = ("offsets", "velocities", "accelerations", "spins", "spin_rates")

    def __init__(
        self,
        disks: Packing,
        model: Model,
        rate: float,
        scheme: Scheme,
        team: Team | None = None,
        wall_disks=0,
    ):
        self.model, self.rate, self.scheme, self.wall_disks = model, rate, scheme, wall_disks
        n = disks.n
        self.damping_unit = float(disks.potential.k * model.law.tau1)  # kτ₁, of all weights
        sigma = 2.0 * np.array([disks.radii.min(), disks.radii.max()])
        self.largest_force = float(disks.potential.force(sigma, sigma).max())
        self.inertia = INERTIA[disks.dimension] * model.mass * disks.radii**2
        self.steps = 0  # time steps in all
        self.list_age = 0  # those since the list was made
        self.rebuilds = 0
        self.substeps = 0  # parts of steps that were divided
        shape = disks.base.shape
        self.velocities, self.accelerations = np.zeros((2, *shape))
        self.spins, self.spin_rates = np.zeros((2, n) if disks.dimension == 2 else (2, n, 3))
        self.tally = np.zeros(len(TALLY))
        self._borders = np.minimum(borders(n), n)
        self.order, self._sorted_at = np.arange(n), -np.inf  # strain
        sums = np.zeros((2, len(self._borders) - 1, SUMMED + 2))
        self._work_arrays = np.empty((2, *shape)), np.empty(shape), sums
        self._next_offsets, self._direction = np.empty(shape), np.empty((3, *shape))
        super().__init__(self._sorted(disks.replace(images=np.zeros(shape, int))), team=team)
        if wall_disks and model.mass:  # at rest when the walls begin to slide
            middle = 0.5 * disks.cell[1, 1]
            self.velocities[wall_disks:, 0] = rate * (middle - self.reference.positions[wall_disks:, 1])
        self.has_started = False
        # time steps beyond 2 c/k are unstable: a few divided ones would not help
        weights = [self.damping_unit * weight for weight in model.law.on_contacts if weight]
        self.divides_steps = bool(
            weights and not model.mass and scheme.step * stiffest(disks) <= 2.0 * min(weights)
        )

    def list(self, disks):
        """See `ListedPacking`; γ_ref is the strain now."""
        super().list(disks)
        self.list_age = 0
        domains = NeighbourList.build(disks, self.skin, self._borders, self.team)
        self.lists = domains, domains.room()
        if self.solves_velocities:
            weights, number = self.model.law.on_contacts, domains.number
            graph = Graph.room(domains, disks.n, self.wall_disks, weights[0] != weights[1])
            search = Search(*self._direction, np.empty((2, number, 3)), np.empty(number))
            self._contact_solve = ContactSolve(graph, search)

    def fold(self):
        """See `ListedPacking`."""
        self.list(self._sorted(super().disks))

    def _sorted(self, disks):
        """The disks; after each SORT_STRAIN folded, and sorted with their arrays so that domains are compact."""
        if abs(self.strain - self._sorted_at) < SORT_STRAIN:
            return disks
        self._sorted_at, disks = self.strain, disks.folded()
        if len(self._borders) == 2:
            return disks
        order = domain_order(disks, self.wall_disks)
        for name in (*self.ARRAYS[1:], "inertia", "order"):
            setattr(self, name, getattr(self, name)[order])
        return disks.reordered(order)

    @property
    def _input_order(self):
        """Permutation (N,) from the internal order to that of the disks given."""
        return np.argsort(self.order)

    @property
    def solves_velocities(self) -> bool:
        """Whether velocities are found by conjugate gradients."""
        return self.scheme.method != "verlet" and bool(self.model.law.damps_contacts or self.model.mass)

    @property
    def cell_strain(self):
        """See `ListedPacking`."""
        return simple_shear(self.shear)

    @property
    def strain(self) -> float:
        """Total strain γ since the start."""
        return self.steps * self.rate * self.scheme.step

    @property
    def shear(self) -> float:
        """g = γ − γ_ref."""
        return self.list_age * self.rate * self.scheme.step

    @property
    def sorted_disks(self) -> Packing:
        """The packing at present, folded, in the internal order."""
        return super().disks.folded()

    @property
    def disks(self) -> Packing:
        """The packing at present, folded."""
        return self.sorted_disks.reordered(self._input_order)

    def residual(self, u, rolling=None):
        """m u̇ (N, D) at velocities u (N, D); see `integrators.residual_at`."""
        forces, listed, room = np.empty_like(u), self.lists[0], block_room(u.shape[1])
        for d in range(listed.number):
            residual_at(
                listed,
                d,
                self.offsets,
                self.shear,
                self.step_constants(),
                u,
                forces,
                rolling,
                room,
                listed.r0,
            )
        return forces

    def step_constants(self, part: float = 1.0) -> StepConstants:
        """Constants of the compiled steps from here, with time steps of `part` of the scheme's."""
        unit, scheme = self.damping_unit, self.scheme
        return StepConstants(
            potential=self.reference.potential.constants,
            weights=tuple(unit * w for w in self.model.law.on_contacts),
            drag=unit * self.model.drag,
            mass=float(self.model.mass),
            largest_force=self.largest_force,
            rate=float(self.rate),
            background=unit * self.model.law.eta_f * self.reference.volume,
            wall_disks=self.wall_disks,
            list_widths=(self.largest, self.skin, INNER_SKIN_RATIO * self.skin),
            step=part * scheme.step,
            heun=scheme.heun,
            tolerance=float(scheme.tolerance),
            list_age=self.list_age,
        )

    def _step_arrays(self, velocities):
        return StepArrays(
            *self.lists, self.offsets, self._next_offsets, velocities, *self._work_arrays, self.tally
        )

    def survey(self) -> dict:
        """Contacts at present: Z of disks that move, rattlers included, clusters, disks of the largest, largest δ/σ."""
        (domains, _), o, shear, wall_disks = self.lists, self.offsets, self.shear, self.wall_disks
        graph = Graph.room(domains, len(o), wall_disks, False)
        number, largest, deepest = survey_of(domains, o, shear, graph)
        return {
            "contact_number": float(graph.number[wall_disks:].mean()),
            "clusters": number,
            "largest_cluster": largest,
            "deepest_overlap": deepest,
        }

    def nonaffine_velocities(self) -> np.ndarray:
        """Non-affine velocities (N, D) at the present positions, in the order of `disks`; see `sorted_velocities`."""
        return self.sorted_velocities()[self._input_order]

    def sorted_velocities(self) -> np.ndarray:
        """Non-affine velocities (N, D) at the present positions, in the order of `sorted_disks`.

        The next step computes its stresses and dissipation of them. With contact damping or backward Euler they are
        solved for here, as the velocities of the last step belong to the contacts before it.
        """
        if self.scheme.method == "verlet":  # half a step on
            return self.velocities + 0.5 * self.scheme.step * self.accelerations
        if not self.solves_velocities:
            return self.residual(np.zeros_like(self.velocities)) / (self.damping_unit * self.model.drag)
        u = self.velocities.copy()
        place = (
            self._step_arrays(u),
            self.step_constants(),
            self._contact_solve,
            self.lists[0],
            self.offsets,
            self.shear,
            u,
        )
        balance(0, 1, np.zeros(1, np.int64), *place, block_room(u.shape[1]), self.lists[0].r0)
        return u

    def angular_velocities(self) -> np.ndarray | None:
        """Angular velocities (N,), of spheres (N, 3), at the same time; order as `disks`; None if they do not roll."""
        if not self.model.law.couples_rotations:
            return None
        return (self.spins + 0.5 * self.scheme.step * self.spin_rates)[self._input_order]

    def advance(self, steps: int) -> None:
        """Take `steps` time steps. Raises ConvergenceError where the time step is too long.

        Without mass, contact damping leaves clusters nearly free, and overlaps of a start drive them apart fast: a step
        in which a disk would jump is divided, see `_divide`, if it is stable for the contacts themselves.
        """
        if not self.has_started:
            self._start()
        while steps > 0:
            if self.divides_steps:
                before = self.offsets.copy(), self.velocities.copy(), self.tally.copy()
            done, status = self.run_steps(steps)
            # stale before the first step of a list: its skin is too narrow for the move of the predictor
            is_narrow = status == STALE and not done + self.list_age
            jumps = status == BLOWN_UP or is_narrow
            least = MIN_LIST_STEPS * self.rate * self.scheme.step * self.largest
            if is_narrow and not self.divides_steps and self.skin < least:
                self.skin = least
                self.fold()
                continue
            if jumps and self.divides_steps:
                self.offsets, self.velocities, self.tally = before
                if done <= 1:
                    self._divide()
                    steps -= 1
                    continue
                done, status = self.run_steps(done - 1)  # the same steps, without the one that jumps
            steps -= done
            self.steps += done
            self.list_age += done
            if status == STALE and self.list_age:
                self.tune(self.list_age * self._effort, REBUILD_COST)
                self.rebuilds += 1
                self.fold()
            elif status != DONE:
                self._refuse(status)

    def _divide(self):
        """One time step in parts, halved until moves are at most MAX_PART_MOVE_RATIO; each part has a new list."""
        self.fold()
        tally, sums, completed, part = self.tally, np.zeros_like(self.tally), 0.0, 0.5
        while completed < 1.0:
            before = self.velocities.copy()
            self.tally = np.zeros_like(tally)
            done, status = self.run_steps(1, part)
            if status == UNSOLVED:
                self._refuse(status)
            farthest = np.sqrt(np.max(np.sum(self.offsets**2, axis=1)))
            if done and farthest <= MAX_PART_MOVE_RATIO * self.largest:
                sums += part * self.tally
                completed += part
                self.list(
                    deformed(
                        self.reference, self.offsets, simple_shear(part * self.rate * self.scheme.step)
                    ).folded()
                )
                self.substeps += 1
                self.rebuilds += 1
                continue
            self.offsets, self.velocities, part = np.zeros_like(self.offsets), before, 0.5 * part
            if part < MIN_STEP_PART:
                self._refuse(BLOWN_UP)
        self.tally = tally + sums
        self.steps += 1

    def _refuse(self, status):
        if status == UNSOLVED:
            raise ConvergenceError(
                f"strain {self.strain:.6g}: velocities not found to {self.scheme.tolerance:g}: "
                f"raise {named('tolerance')}"
            )
        raise ConvergenceError(
            f"strain {self.strain:.6g}: a particle moves by more than half a diameter in one step of "
            f"{self.scheme.step:g}: give a smaller {named('step')}"
        )

    def _start(self):
        """For velocity Verlet, find the accelerations and set the velocities half a step back."""
        self.has_started = True
        if self.scheme.method != "verlet":
            return
        torques = np.zeros_like(self.spins)
        rolling = (self.spins, self.reference.radii, torques) if self.model.law.couples_rotations else None
        forces = self.residual(self.velocities, rolling)
        self.accelerations = forces / self.model.mass
        self.spin_rates = (torques.T / self.inertia).T
        half = 0.5 * self.scheme.step
        self.velocities = self.velocities - half * self.accelerations
        self.spins = self.spins - half * self.spin_rates

    @property
    def _effort(self) -> float:
        """Cost of those parts of a time step that grow with the list, in elastic force evaluations."""
        each = 1.5 if self.scheme.method == "verlet" else 5.0 if self.model.law.damps_contacts else 1.0
        return 2.0 * each if self.scheme.heun else each

    def run_steps(self, steps, part=1.0):
        """At most `steps` time steps, of `part` of the scheme's, with the present list: (steps done, status)."""
        arrays, rest, run = self._step_arrays(self.velocities), (), drag_steps
        if self.scheme.method == "verlet":
            run, turning = massive_steps, None
            if self.model.law.couples_rotations:
                turning = Turning(
                    self.spins, self.spin_rates, self.reference.radii, self.inertia,
                    *(np.empty_like(self.spins) for _ in range(3)),
                )  # fmt: skip
            arrays, rest = arrays._replace(forces=self.accelerations), (turning,)
        elif self.solves_velocities:
            run, rest = contact_steps, (self._contact_solve,)
        return self.team.run(
            run, self.lists[0].number, arrays, self.step_constants(part), arrays.pairs.r0, *rest, steps
        )[::-1]

    def state(self) -> dict:
        """The whole state as arrays and numbers, for `restore` to the last bit.

        Disks are in the order in which they were given; `tally` as the attribute.
        """
        back = self._input_order
        arrays, reference = (
            {name: getattr(self, name)[back] for name in self.ARRAYS},
            self.reference.reordered(back),
        )
        arrays |= {name: getattr(reference, name) for name in PLACES}
        arrays |= {
            "steps": self.steps,
            "list_age": self.list_age,
            "rebuilds": self.rebuilds,
            "substeps": self.substeps,
        }
        arrays |= {"tally": self.tally.copy(), "skin": self.skin, "started": self.has_started}
        return arrays | {"images": reference.images, "order": self.order, "sorted_at": self._sorted_at}

    def restore(self, state: dict) -> None:
        """Return to the state that `state` gave."""
        self.skin = float(state["skin"])
        disks = self.disks  # in the order of the input, by the present `order`
        self.order, self._sorted_at = np.asarray(state["order"], int), float(state["sorted_at"])
        places = {name: np.asarray(state[name], float) for name in PLACES}
        self.list(disks.replace(images=state["images"], **places).reordered(self.order))
        self.inertia = INERTIA[self.reference.dimension] * self.model.mass * self.reference.radii**2
        for name in self.ARRAYS:
            setattr(self, name, np.array(state[name], float)[self.order])
        self.tally = np.array(state["tally"], float)
        self.steps, self.list_age, self.rebuilds = (
            int(state[name]) for name in ("steps", "list_age", "rebuilds")
        )
        self.substeps = int(state["substeps"])
        self.has_started = bool(state["started"])
