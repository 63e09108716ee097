"""Disks under steady shear: their state, and how it goes on from one pair list to the next."""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.contacts.disks import PLACES, Disks
from jampetsc.contacts.pairs import SKIN_START, PairList, deformed, tuned_skin
from jampetsc.errors import ConvergenceError, named
from jampetsc.flows import steps as compiled
from jampetsc.flows.models import Model, Scheme, stiffest
from jampetsc.flows.resistance import centre_clusters, contact_graph, deepest_overlap

NEAR = 0.2  # of the skin of a list is that of the near pairs which forces are computed of; with these
REACH = 0.25  # of the largest diameter: what a disk moves at most in a part of a step that was divided
SMALLEST = 2.0**-30  # of a time step: such a part has no end
REBUILD = 25.0  # evaluations may go into a list: its width costs only where near pairs are chosen


@dataclass(frozen=True)
class Survey:
    """What is looked at now and then: contacts, their clusters, the deepest overlap."""

    coordination: float  # Z, mean number of contacts of disks that move, rattlers included
    clusters: int  # connected ones, single disks included
    largest_cluster: int  # its disks
    deepest: float  # largest δ/σ


class Shear:
    """N disks sheared at a rate γ̇ under Lees–Edwards conditions.

    After `advance` the packing is `disks`, in a cell with tilt |γ| ≤ ½ Lx/Ly, at total strain `strain`; `velocities`
    (N, 2) are the non-affine ones. `seen` sums what every time step saw (see `steps.TALLY`). The first `held` disks
    are those of walls, which go with the affine flow (see `walls`).
    """

    ARRAYS = ("offsets", "velocities", "accelerations", "spins", "spin_rates")

    def __init__(self, disks: Disks, model: Model, rate: float, scheme: Scheme, together=None, held: int = 0):
        self.model, self.rate, self.scheme = model, rate, scheme
        self.held = held
        self.together = together  # `flows.together.Together`, where PETSc finds velocities
        n = disks.n
        law = model.law
        self.unit = unit = float(disks.potential.k * law.tau1)  # kτ₁, of all weights
        self.weights = tuple(unit * w for w in law.on_contacts)
        self.physics = (
            unit * model.drag,
            float(model.mass),
            float(rate),
            unit * law.eta_f * disks.area,
            held,
        )
        weights = [
            weight for weight in self.weights if weight
        ]  # steps beyond 2 c/k are unstable, in parts too
        self.divides = bool(
            weights and not model.mass and scheme.step * stiffest(disks) <= 2.0 * min(weights)
        )
        self.largest = 2.0 * float(disks.radii.max())
        self.diameter = 2.0 * float(disks.radii.mean())
        self.inertia = 0.5 * model.mass * disks.radii**2  # uniform disks
        self.skin = SKIN_START * self.diameter
        self.steps = 0  # time steps done in all
        self.since = 0  # of them, since the list was made
        self.rebuilds = 0
        self.substeps = 0  # parts of steps that were divided
        self.velocities = np.zeros((n, 2))
        self.accelerations = np.zeros((n, 2))
        self.spins, self.spin_rates = np.zeros(n), np.zeros(n)
        self.seen = np.zeros(len(compiled.TALLY))
        self._list(replace(disks, images=np.zeros((n, 2), int)).folded())
        if held and model.mass:  # at rest when the walls begin to slide
            middle = 0.5 * disks.cell[1, 1]
            self.velocities[held:, 0] = rate * (middle - self.reference.positions[held:, 1])
        self.started = False

    def _list(self, disks):
        self.reference = disks  # at γ_ref, where the list was made
        self.pairs = PairList.build(disks, self.skin)
        self.offsets = np.zeros((disks.n, 2))
        self.since = 0

    @property
    def strain(self) -> float:
        """Total strain γ since the start."""
        return self.steps * self.rate * self.scheme.step

    @property
    def shear(self) -> float:
        """g = γ − γ_ref."""
        return self.since * self.rate * self.scheme.step

    @property
    def disks(self) -> Disks:
        """The packing as it is now, folded."""
        return deformed(self.reference, self.offsets, 0.0, self.shear).folded()

    def advance(self, steps: int) -> None:
        """So many time steps. Raises ConvergenceError where the time step is too long for them.

        Without mass, contact damping leaves nearly free clusters that a start like any other drives apart fast: a step
        in which a disk would jump is divided, see `_divide`, if it is short enough for the contacts themselves.
        """
        if not self.started:
            self._start()
        while steps > 0:
            before = self.offsets.copy(), self.velocities.copy(), self.seen.copy()
            done, status = self._run(steps)
            # a list that is stale before its first step is too narrow for what its predictor moves
            jumps = status == compiled.BLOWN_UP or (status == compiled.STALE and not done + self.since)
            if jumps and self.divides:
                self.offsets, self.velocities, self.seen = before
                if done <= 1:
                    self._divide()
                    steps -= 1
                    continue
                done, status = self._run(done - 1)  # the same once more, without the jump
            steps -= done
            self.steps += done
            self.since += done
            if status == compiled.STALE and self.since:
                self.skin = tuned_skin(self.skin, self.since * self._effort, self.diameter, REBUILD)
                self.rebuilds += 1
                self._list(self.disks)
            elif status != compiled.DONE:
                self._refuse(status)

    def _divide(self):
        """One time step in parts, halved until no disk moves by more than REACH in one; each part on a new list."""
        self._list(self.disks)
        seen, sums, at, part = self.seen, np.zeros_like(self.seen), 0.0, 0.5
        while at < 1.0:
            before = self.velocities.copy()
            self.seen = np.zeros_like(seen)
            done, status = self._run(1, part)
            if status == compiled.UNSOLVED:
                self._refuse(status)
            farthest = np.sqrt(np.max(np.sum(self.offsets**2, axis=1)))
            if done and farthest <= REACH * self.largest:
                sums += part * self.seen
                at += part
                self._list(
                    deformed(self.reference, self.offsets, 0.0, part * self.rate * self.scheme.step).folded()
                )
                self.substeps += 1
                self.rebuilds += 1
                continue
            self.offsets, self.velocities, part = np.zeros_like(self.offsets), before, 0.5 * part
            if part < SMALLEST:
                self._refuse(compiled.BLOWN_UP)
        self.seen = seen + sums
        self.steps += 1

    def _refuse(self, status):
        if status == compiled.UNSOLVED:
            raise ConvergenceError(
                f"strain {self.strain:.6g}: velocities not found to {self.scheme.tolerance:g}: "
                f"raise {named('tolerance')}"
            )
        raise ConvergenceError(
            f"strain {self.strain:.6g}: a disk moves by more than half a diameter in one step of "
            f"{self.scheme.step:g}: give a smaller {named('step')}"
        )

    def _start(self):
        """Velocities and accelerations half a step apart, as velocity Verlet wants them."""
        self.started = True
        if self.scheme.method != "verlet":
            return
        forces, spins = np.empty_like(self.offsets), None
        torques = np.zeros(len(self.spins))
        if self.model.law.couples_rotations:
            spins = (self.spins, self.reference.radii, torques)
        compiled.residual_at(
            self.pairs.arrays, self.offsets, self.shear, self._law, self.weights, self.physics, self.velocities,
            forces, spins,
        )  # fmt: skip
        self.accelerations = forces / self.model.mass
        self.spin_rates = torques / self.inertia
        half = 0.5 * self.scheme.step
        self.velocities = self.velocities - half * self.accelerations
        self.spins = self.spins - half * self.spin_rates

    @property
    def _effort(self) -> float:
        """Cost of a time step that depends on the length of the list, in elastic force evaluations."""
        each = 1.5 if self.scheme.method == "verlet" else 5.0 if self.model.law.damps_contacts else 1.0
        return 2.0 * each if self.scheme.heun else each

    @property
    def _law(self):
        return self.reference.potential.constants

    def _run(self, steps, part=1.0):
        """Time steps, or such a part of them, with the list there is: (how many, status)."""
        listed, clock = (self.largest, self.skin, NEAR * self.skin), (part * self.scheme.step, self.since)
        forces = np.empty_like(self.offsets)
        common = (self.pairs.arrays, listed, self._law)
        if self.scheme.method == "verlet":
            rolling = None
            if self.model.law.couples_rotations:
                rolling = (self.spins, self.spin_rates, self.reference.radii, self.inertia)
            return compiled.massive_steps(
                *common, self.weights, self.physics, clock, self.offsets, self.velocities, self.accelerations,
                forces, rolling, self.seen, steps,
            )  # fmt: skip
        if self.model.law.damps_contacts or self.model.mass:
            run = self.together.steps if self.together else compiled.contact_steps
            return run(
                *common, self.weights, self.physics, clock, self.offsets, self.velocities, forces,
                self.scheme.tolerance, self.scheme.heun, self.seen, steps,
            )  # fmt: skip
        return compiled.drag_steps(
            *common, self.physics, clock, self.offsets, self.velocities, forces, self.scheme.heun, self.seen, steps
        )  # fmt: skip

    def look(self) -> Survey:
        """Contacts as they are now."""
        place = (self.pairs.arrays, self.offsets, self.shear)
        n, held = len(self.offsets), self.held
        graph = contact_graph(*place, n, held, False)
        number, largest = centre_clusters(graph, np.zeros_like(self.offsets))
        contacts = int(graph[0][n] - graph[0][held])
        return Survey(contacts / (n - held), number, largest, deepest_overlap(*place))

    def velocities_now(self) -> np.ndarray:
        """Non-affine velocities (N, 2) at the positions as they are now: those that the next step begins with.

        With them it takes its stresses and what is dissipated. By backward Euler they are the solution for that step:
        those of the last one belong to the contacts that there were before it.
        """
        if self.scheme.method == "verlet":  # half a step on
            return self.velocities + 0.5 * self.scheme.step * self.accelerations
        u, forces = self.velocities.copy(), np.empty_like(self.offsets)
        place = (self.pairs.arrays, self.offsets, self.shear, self._law, self.weights, self.physics)
        if self.model.law.damps_contacts or self.model.mass:
            balance = self.together.balance if self.together else compiled.balance
            balance(*place, self.scheme.step, u, forces, self.scheme.tolerance)
            return u
        compiled.residual_at(*place, np.zeros_like(u), forces, None)
        return forces / self.physics[0]

    def spins_now(self) -> np.ndarray | None:
        """Angular velocities (N,) at the same moment; None where disks do not roll."""
        if not self.model.law.couples_rotations:
            return None
        return self.spins + 0.5 * self.scheme.step * self.spin_rates

    def state(self) -> dict:
        """Everything that goes on from here, as arrays and numbers; `restore` takes it back to the last bit."""
        arrays = {name: getattr(self, name).copy() for name in self.ARRAYS}
        arrays |= {name: getattr(self.reference, name) for name in PLACES}
        counts = {name: getattr(self, name) for name in ("steps", "since", "rebuilds", "substeps")}
        arrays |= {"seen": self.seen.copy(), "images": self.reference.images}
        return arrays | {"skin": self.skin, "started": self.started, **counts}

    def restore(self, state: dict) -> None:
        """Go on from what `state` gave."""
        self.skin = float(state["skin"])
        places = {name: np.asarray(state[name], float) for name in PLACES}
        images = state.get("images", self.reference.images)  # which older files do not have
        self._list(replace(self.reference, images=images, **places))
        for name in (*self.ARRAYS, "seen"):
            setattr(self, name, np.array(state[name], float))
        self.steps, self.since, self.rebuilds = (int(state[name]) for name in ("steps", "since", "rebuilds"))
        self.substeps = int(state.get("substeps", 0))  # which older files do not have
        self.started = bool(state["started"])
