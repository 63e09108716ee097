"""Time steps of steady shear, from one pair list to the next."""

import numpy as np

from jampetsc.errors import ConvergenceError, named
from jampetsc.flows import moves
from jampetsc.flows import steps as compiled
from jampetsc.flows.sheared import ShearedDisks
from jampetsc.laws.flow_models import Model, Scheme, stiffest
from jampetsc.packing.packing import deformed
from jampetsc.packing.threads import Team

MAX_MOVE_RATIO = 0.25  # in units of the largest diameter, longest move of a disk in a part of a divided step
MIN_STEP_PART = 2.0**-30  # part of a time step; if a disk jumps in this one too, the step is refused
REBUILD = 25.0  # cost of a list in force evaluations; high, as width costs only when near pairs are chosen


class SteadyShear(ShearedDisks):
    """Disks that `advance` shears, by the threads of `team`, whose number does not change the result."""

    def __init__(self, disks, model: Model, rate: float, scheme: Scheme, team: Team | None = None, held=0):
        super().__init__(disks, model, rate, scheme, team, held)
        # time steps beyond 2 c/k are unstable: a few divided ones would not help
        weights = [self.unit * weight for weight in model.law.on_contacts if weight]
        self.divides = bool(
            weights and not model.mass and scheme.step * stiffest(disks) <= 2.0 * min(weights)
        )

    def advance(self, steps: int) -> None:
        """Take `steps` time steps. Raises ConvergenceError where the time step is too long.

        Without mass, contact damping leaves clusters nearly free, and overlaps of a start drive them apart fast: a step
        in which a disk would jump is divided, see `_divide`, if it is stable for the contacts themselves.
        """
        if not self.started:
            self._start()
        while steps > 0:
            if self.divides:
                before = self.offsets.copy(), self.velocities.copy(), self.tally.copy()
            done, status = self._run(steps)
            # stale before the first step of a list: its skin is too narrow for the move of the predictor
            jumps = status == moves.BLOWN_UP or (status == moves.STALE and not done + self.since)
            if jumps and self.divides:
                self.offsets, self.velocities, self.tally = before
                if done <= 1:
                    self._divide()
                    steps -= 1
                    continue
                done, status = self._run(done - 1)  # the same steps, without the one that jumps
            steps -= done
            self.steps += done
            self.since += done
            if status == moves.STALE and self.since:
                self.tune(self.since * self._effort, REBUILD)
                self.rebuilds += 1
                self.fold()
            elif status != moves.DONE:
                self._refuse(status)

    def _divide(self):
        """One time step in parts, halved until no disk moves by more than MAX_MOVE_RATIO; each part has a new list."""
        self.fold()
        tally, sums, completed, part = self.tally, np.zeros_like(self.tally), 0.0, 0.5
        while completed < 1.0:
            before = self.velocities.copy()
            self.tally = np.zeros_like(tally)
            done, status = self._run(1, part)
            if status == moves.UNSOLVED:
                self._refuse(status)
            farthest = np.sqrt(np.max(np.sum(self.offsets**2, axis=1)))
            if done and farthest <= MAX_MOVE_RATIO * self.largest:
                sums += part * self.tally
                completed += part
                self.list(
                    deformed(self.reference, self.offsets, 0.0, part * self.rate * self.scheme.step).folded()
                )
                self.substeps += 1
                self.rebuilds += 1
                continue
            self.offsets, self.velocities, part = np.zeros_like(self.offsets), before, 0.5 * part
            if part < MIN_STEP_PART:
                self._refuse(moves.BLOWN_UP)
        self.tally = tally + sums
        self.steps += 1

    def _refuse(self, status):
        if status == moves.UNSOLVED:
            raise ConvergenceError(
                f"strain {self.strain:.6g}: velocities not found to {self.scheme.tolerance:g}: "
                f"raise {named('tolerance')}"
            )
        raise ConvergenceError(
            f"strain {self.strain:.6g}: a disk moves by more than half a diameter in one step of "
            f"{self.scheme.step:g}: give a smaller {named('step')}"
        )

    def _start(self):
        """For velocity Verlet, find the accelerations and set the velocities half a step back."""
        self.started = True
        if self.scheme.method != "verlet":
            return
        torques = np.zeros(len(self.spins))
        rolling = (self.spins, self.reference.radii, torques) if self.model.law.couples_rotations else None
        forces = self.residual(self.velocities, rolling)
        self.accelerations = forces / self.model.mass
        self.spin_rates = torques / self.inertia
        half = 0.5 * self.scheme.step
        self.velocities = self.velocities - half * self.accelerations
        self.spins = self.spins - half * self.spin_rates

    @property
    def _effort(self) -> float:
        """Cost of those parts of a time step that grow with the list, in elastic force evaluations."""
        each = 1.5 if self.scheme.method == "verlet" else 5.0 if self.model.law.damps_contacts else 1.0
        return 2.0 * each if self.scheme.heun else each

    def _run(self, steps, part=1.0):
        """At most `steps` time steps, of `part` of the scheme's, with the present list: (steps done, status)."""
        space, rest, run = self._space(self.velocities), (), compiled.drag_steps
        if self.scheme.method == "verlet":
            run, turning = compiled.massive_steps, None
            if self.model.law.couples_rotations:
                turning = compiled.Turning(
                    self.spins, self.spin_rates, self.reference.radii, self.inertia,
                    *(np.empty_like(self.spins) for _ in range(3)),
                )  # fmt: skip
            space, rest = space._replace(forces=self.accelerations), (turning,)
        elif self.solves:
            run, rest = compiled.contact_steps, (self._contacts,)
        return self.team.run(run, self.lists[0].number, space, self.task(part), *rest, steps)[::-1]
