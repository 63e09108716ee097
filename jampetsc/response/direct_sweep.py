"""A sweep G*(ω) or C*(ω) of a pencil with one complex solve per frequency."""

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.petsc.session import current
from jampetsc.progress import Progress
from jampetsc.response.assembly import Pencil
from jampetsc.response.certificate import tensor_at
from jampetsc.response.direct import FrequencySolver
from jampetsc.response.modulus_sweep import (
    DisplacementField,
    FloppyModesExplained,
    ModulusSweep,
    TensorModuli,
    mean_shear,
)


class DirectSteps:
    """Frequencies that a `FrequencySolver` solves one after another. Collective.

    failures           {ω: ConvergenceError} of those that failed
    factorisations     their number for these; steps hold that of the others
    """

    def __init__(self, solver: FrequencySolver, accuracy: float, field_omega, progress: Progress):
        self.solver, self.accuracy, self._field_omega, self._progress = (
            solver,
            accuracy,
            field_omega,
            progress,
        )
        self.failures, self.factorisations = {}, 0

    def solve(self, omega: float):
        """(record, arrays) of the step of a frequency; None where it fails."""
        solver, previous = self.solver, self.solver.factorisations
        try:
            with current().stage("frequency"):
                results = solver.solve_loads(omega, self.accuracy)
        except ConvergenceError as error:
            self.failures[omega] = error
            self.factorisations += solver.factorisations - previous
            self._progress.step(f"failed: {error}")
            return None
        step = self._step(results, solver.factorisations - previous, omega in self._field_omega)
        result = results[0]
        storage, loss = ("-chi'/V", "-chi''/V") if solver.functional.pencil.exerts_forces else ("G'", "G''")
        self._progress.step(
            f"omega {omega:.3e}  {storage} {result.G.real:.6e}  {loss} {result.G.imag:.6e}  "
            f"bound {result.bounds[0]:.1e}  iterations {solver.iterations}"
        )
        return step

    def _step(self, results, factorisations, has_field):
        result, solver = results[0], self.solver
        bound = solver.singular_bound
        record = {
            "G": result.G, "bounds": result.bounds, "singular_bound": (bound.omega, bound.least),
            "factorisations": factorisations,
        }  # fmt: skip
        if solver.functional.pencil.exerts_forces:
            return record | {
                name: [getattr(each, name) for each in results] for name in ("G", "bounds")
            }, None
        if len(results) > 1:
            C, bounds = tensor_at(solver.functionals, solver.trials, results)
            return record | {"C": C, "C_bounds": bounds}, None
        if not has_field:
            return record, None
        displacement, rotation = solver.pencil.split(solver.x)
        record["field_bound"] = solver.functional.field_bound(result, solver.x, bound)
        return record, {"displacement": displacement} | ({} if rotation is None else {"rotation": rotation})


def sweep_directly(
    pencil: Pencil,
    omega,
    accuracy: float,
    loads=None,
    field_omega=(),
    positive_semidefinite: bool = False,
    resume: dict | None = None,
    save=None,
) -> ModulusSweep:
    """One complex solve per frequency, see `direct`; steps are the numbers of frequencies. Collective.

    omega, accuracy, loads, field_omega   as for `modulus_sweep.sweep_rationally`
    positive_semidefinite                 whether K is known to be

    Raises ConvergenceError if all frequencies fail.
    """
    steps = dict(resume or {})
    with current().stage("assembly"):
        solver = FrequencySolver(pencil, positive_semidefinite=positive_semidefinite, loads=loads)
    with (
        FloppyModesExplained(pencil),
        Progress(len(omega), "sweep", pencil.network.comm.rank, done=len(steps)) as progress,
    ):
        if steps:
            solver.restore(*steps[max(steps)][0]["singular_bound"])
        direct = DirectSteps(solver, accuracy, field_omega, progress)
        for index in [index for index in range(len(omega)) if index not in steps]:
            step = direct.solve(float(omega[index]))
            if step is not None:
                steps[index] = step
                if save is not None:
                    save(index, *step)
        if not steps:
            raise next(iter(direct.failures.values()))
    solved = sorted(steps)
    records = [steps[index][0] for index in solved]
    fields = [
        DisplacementField(
            float(omega[index]), arrays["displacement"], arrays.get("rotation"), record["field_bound"]
        )
        for index, (record, arrays) in sorted(steps.items())
        if omega[index] in field_omega
    ]
    omega = np.asarray(omega)[solved]
    work = direct.failures, direct.factorisations + sum(record["factorisations"] for record in records)
    if "C" in records[0]:
        tensor = TensorModuli(*(np.array([record[name] for record in records]) for name in ("C", "C_bounds")))
        return ModulusSweep(omega, *mean_shear(tensor), fields, *work, tensor=tensor)
    moduli = (np.array([record[name] for record in records]) for name in ("G", "bounds"))
    return ModulusSweep(omega, *moduli, fields, *work)
