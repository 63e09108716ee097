"""The sweep frequency by frequency: progress, checkpoint, failures, result file."""

import numpy as np

from jampetsc.errors import ConvergenceError, named
from jampetsc.linear.direct import FrequencySolver
from jampetsc.linear.run import Run, split_field, write_sweep
from jampetsc.mechanics.assembly import assemble
from jampetsc.petsc.session import current
from jampetsc.progress import Progress


def solve(run: Run):
    """Solve every frequency that no earlier run has finished and write the file. Collective.

    Returns (omega, G, bounds) as for `write_sweep`. Raises ConvergenceError, after writing the others, if
    some frequencies failed.
    """
    session = current()
    with session.stage("assembly"):
        network = run.network(session.comm)
        pencil = assemble(network, run.physics.law)
        solver = FrequencySolver(pencil, positive_semidefinite=run.negative_modes == 0)
    checkpoint = run.to.checkpoint(run.key(session.size), session.comm)
    failures = {}
    todo = [index for index in range(len(run.omega)) if index not in checkpoint.done]
    with Progress(len(run.omega), "sweep", session.rank, done=len(checkpoint.done)) as progress:
        if checkpoint.done:
            progress.note(f"continuing {checkpoint.journal}: {len(checkpoint.done)} frequencies are finished")
        for index in todo:
            omega = run.omega[index]
            try:
                with session.stage("frequency"):
                    result = solver.solve(omega, run.accuracy)
            except ConvergenceError as error:
                failures[index] = error
                progress.step(f"failed: {error}")
                continue
            record, fields = {"G": result.G, "bounds": [result.error_bound, *result.parts]}, None
            if omega in run.field_omega:
                displacement, rotation = split_field(pencil, solver.x)
                fields = {"displacement": displacement} | ({} if rotation is None else {"rotation": rotation})
                record["field_bound"] = solver.functional.field_bound(result, solver.x)
            checkpoint.save(index, record, fields)
            progress.step(
                f"omega {omega:.3e}  G' {result.G.real:.6e}  G'' {result.G.imag:.6e}  bound {result.error_bound:.1e}  "
                f"iterations {solver.iterations}"
            )
    finished = sorted(checkpoint.done)
    if not finished:
        raise next(iter(failures.values()))
    omega = run.omega[finished]
    G = np.array([checkpoint.done[index]["G"] for index in finished])
    bounds = np.array([checkpoint.done[index]["bounds"] for index in finished])

    stored = [index for index in finished if run.omega[index] in run.field_omega]
    extra = {"factorisations": solver.factorisations, "unknowns": pencil.unknowns}
    if failures:
        extra["failed_omega"] = run.asked(run.omega[sorted(failures)])
    kept = Run(**{**vars(run), "field_omega": run.omega[stored]})
    write_sweep(kept, network, omega, G, bounds, _stored_fields(checkpoint, stored), extra)
    solver.destroy()
    pencil.destroy()
    if failures:
        first = failures[min(failures)]
        raise ConvergenceError(
            f"{len(failures)} of {len(run.omega)} frequencies failed, the others are in {run.to}; the first: "
            f"{first.told(named)}"
        )
    checkpoint.remove()
    return omega, G, bounds


def _stored_fields(checkpoint, indices):
    for index in indices:
        arrays = checkpoint.fields(index)
        yield arrays["displacement"], arrays.get("rotation"), checkpoint.done[index]["field_bound"]
