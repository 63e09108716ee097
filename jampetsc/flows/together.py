"""Steps of contact damping whose velocities PETSc finds, on one rank or many: `steps.contact_steps` with a KSP."""

import numpy as np

from jampetsc.flows import steps as compiled
from jampetsc.flows.resistance import contact_graph, resist


class Together:
    """Does what `steps.balance` and `steps.contact_steps` do, with a `solvers.resistance.ContactSolver`. Collective."""

    def __init__(self, solver):
        self.solver, self.comm = solver, solver.comm

    def balance(self, pairs, o, g, law, weights, physics, dt, u, forces, tolerance):
        """As `steps.balance`; the tolerance is the solver's."""
        compiled.residual_at(pairs, o, g, law, weights, physics, u, forces, None)
        graph = contact_graph(pairs, o, g, len(u), physics[4], weights[0] != weights[1])
        hold = physics[0] + physics[1] / dt
        right = np.empty_like(u)
        resist(graph, weights, hold, u, right)
        right += forces
        iterations = self.solver.solve(graph, weights, hold, right, u)
        compiled.centre(graph, physics, u)
        return iterations

    def steps(self, pairs, listed, law, weights, physics, clock, o, u, forces, tolerance, heun, tally, steps):
        """As `steps.contact_steps`."""
        (dt, since), rate = clock, physics[2]
        for array in (o, u):
            self.comm.Bcast(array)  # ranks on different processors differ by an ulp
        for step in range(steps):
            g = (since + step) * rate * dt
            place = (law, weights, physics, dt)
            tally[8] += self.balance(pairs, o, g, *place, u, forces, tolerance)
            velocity = u
            if heun:
                ahead = np.empty_like(o)
                moved = compiled.move(o, u, g + 0.5 * rate * dt, dt, ahead)
                verdict = compiled.verdict_of(*moved, g + rate * dt, listed)
                if verdict != compiled.DONE:
                    return step, verdict
                velocity = u.copy()
                self.balance(pairs, ahead, g + rate * dt, *place, velocity, forces, tolerance)
                velocity = 0.5 * (u + velocity)
            verdict, _ = compiled.seen_and_moved(
                pairs, listed, law, weights, physics, dt, g, o, u, velocity, forces, tally
            )
            if verdict != compiled.DONE:
                return step + 1, verdict
        return steps, compiled.DONE
