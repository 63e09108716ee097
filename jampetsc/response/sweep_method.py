"""A sweep by either method, from its packing to its file: progress, checkpoint, failures, fields."""

import dataclasses

import numpy as np

from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.io.results import noted, unstable_to_shear
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.session import current
from jampetsc.progress import Progress
from jampetsc.response.assembly import assemble
from jampetsc.response.certificate import Certified
from jampetsc.response.direct import FrequencySolver
from jampetsc.response.minimum_check import floppy_modes
from jampetsc.response.rational import RationalSweep
from jampetsc.response.run_record import run_record
from jampetsc.response.sweep_run import Run

FORMAT = "jampetsc-sweep"
BOUNDS = ("error_bound", "error_bound_storage", "error_bound_loss")  # on |ΔG*|, |ΔG'|, |ΔG''|


def solve(run: Run):
    """Sweep by the method of the run and write the file. Collective.

    Returns omega (M,), G (M,) and bounds (M, 3) on |ΔG*|, |ΔG'| and |ΔG''|, the same on all ranks. The rational method
    needs K to be positive semi-definite, see `Run.examined`: raises InputError where a factorisation shows that it is
    not, ConvergenceError where the accuracy cannot be certified. The direct one raises ConvergenceError, after writing
    the others, if some frequencies failed.
    """
    session = current()
    direct = run.method == "direct"
    with session.stage("assembly"):
        network = run.network(session.comm)
        pencil = assemble(network, run.physics.law)
    checkpoint = run.to.checkpoint(run.key(session.size), session.comm, ordered=not direct)
    try:
        found = (_directly if direct else _rationally)(run, pencil, checkpoint)
    except (ConvergenceError, InputError) as error:
        if reason := floppy_modes(network):
            error.args = (f"{error.args[0]}; {reason}",)
        raise
    checkpoint.remove()
    return found


def _rationally(run, pencil, checkpoint):
    session = current()
    with session.stage("assembly"):
        sweep = RationalSweep(pencil, run.omega, run.accuracy, run.parallel)
    with Progress(None, "sweep", session.rank) as progress:
        if checkpoint.done:
            _restore(sweep, checkpoint)
            progress.note(f"continuing {checkpoint.journal}: {len(checkpoint.done)} shifts are finished")
        try:
            while shifts := sweep.next_shifts():
                before = sweep.basis.size if sweep.basis else 0
                with session.stage("shift"):
                    sweep.add_shifts(shifts)
                basis = sweep.basis
                fields = {"vectors": basis.vectors[before:]} | ({} if before else {"x0": basis.x0})
                fields |= {} if sweep.certificate is None else vars(sweep.certificate)
                owner = list(sweep.factors.owner.items())
                done = {"first": basis.first, "shifts": basis.shifts[before:], "owner": owner}
                checkpoint.save(checkpoint.next, done, fields)
                listed = ", ".join(f"{shift:.2e}" for shift in shifts)
                progress.step(
                    f"shift {listed}  vectors {basis.size}  worst bound / allowed {sweep.worst():.1e}"
                )
        except NotPositiveDefinite as error:
            raise InputError(f"{run.packing}: {error.message(named)}; use {named('method')} direct") from None
    galerkin, G, bounds = sweep.galerkin, sweep.certificate.G, sweep.certificate.bounds
    fields = (
        (*pencil.split(galerkin.field(omega)), galerkin.field_bound(omega, sweep.error_at(omega)))
        for omega in run.field_omega
    )
    extra = {"factorisations": sweep.factorisations, "vectors": sweep.basis.size}
    reduced = {name: getattr(galerkin.spectrum, name) for name in ("G0", "eta_inf", "rates", "weights")}
    _write(run, pencil, run.omega, G, bounds, fields, extra, reduced)
    return run.omega, G, bounds


def _restore(sweep, checkpoint):
    steps = sorted(checkpoint.done)
    records, arrays = ([of(index) for index in steps] for of in (checkpoint.done.get, checkpoint.fields))
    vectors = np.concatenate([array["vectors"] for array in arrays])
    shifts = np.concatenate([record["shifts"] for record in records])
    found = {field.name: arrays[-1].get(field.name) for field in dataclasses.fields(Certified)}
    certificate = None if found["G"] is None else Certified(**found)
    owner = dict(records[-1]["owner"])
    sweep.restore(records[0]["first"], arrays[0]["x0"], vectors, shifts, owner, certificate)


def _directly(run, pencil, checkpoint):
    session, failures, factorisations = current(), {}, 0
    with session.stage("assembly"):
        solver = FrequencySolver(pencil, positive_semidefinite=run.negative_modes == 0)
    todo = [index for index in range(len(run.omega)) if index not in checkpoint.done]
    with Progress(len(run.omega), "sweep", session.rank, done=len(checkpoint.done)) as progress:
        if checkpoint.done:
            progress.note(f"continuing {checkpoint.journal}: {len(checkpoint.done)} frequencies are finished")
            solver.restore(*checkpoint.done[max(checkpoint.done)]["singular_bound"])
        for index in todo:
            omega, before = run.omega[index], solver.factorisations
            try:
                with session.stage("frequency"):
                    result = solver.solve(omega, run.accuracy)
            except ConvergenceError as error:
                failures[index] = error
                factorisations += solver.factorisations - before
                progress.step(f"failed: {error}")
                continue
            bound = solver.singular_bound
            record, fields = {"G": result.G, "bounds": result.bounds}, None
            record["singular_bound"] = bound.omega, bound.least
            record["factorisations"] = solver.factorisations - before
            if omega in run.field_omega:
                displacement, rotation = pencil.split(solver.x)
                fields = {"displacement": displacement} | ({} if rotation is None else {"rotation": rotation})
                record["field_bound"] = solver.functional.field_bound(result, solver.x)
            checkpoint.save(index, record, fields)
            progress.step(
                f"omega {omega:.3e}  G' {result.G.real:.6e}  G'' {result.G.imag:.6e}  bound {result.bounds[0]:.1e}  "
                f"iterations {solver.iterations}"
            )
    finished = sorted(checkpoint.done)
    if not finished:
        raise next(iter(failures.values()))
    omega = run.omega[finished]
    G, bounds = (np.array([checkpoint.done[index][name] for index in finished]) for name in ("G", "bounds"))
    stored = [index for index in finished if run.omega[index] in run.field_omega]
    factorisations += sum(checkpoint.done[index]["factorisations"] for index in finished)
    extra = {"factorisations": factorisations}
    if failures:
        extra["failed_omega"] = run.asked(run.omega[sorted(failures)])
    kept = dataclasses.replace(run, field_omega=run.omega[stored])
    _write(kept, pencil, omega, G, bounds, _stored_fields(checkpoint, stored), extra)
    if failures:
        first = failures[min(failures)]
        raise ConvergenceError(
            f"{len(failures)} of {len(run.omega)} frequencies failed, {run.to.others}; the first: "
            f"{first.message(named)}"
        )
    return omega, G, bounds


def _stored_fields(checkpoint, indices):
    for index in indices:
        arrays = checkpoint.fields(index)
        yield arrays["displacement"], arrays.get("rotation"), checkpoint.done[index]["field_bound"]


def _write(run: Run, pencil, omega, G, bounds, fields, extra: dict, reduced: dict | None = None) -> None:
    """Write the result file. Collective.

    omega and G (M,) and bounds (M, 3) on |ΔG*|, |ΔG'| and |ΔG''|, the same on all ranks; omega are among
    run.omega; fields yields (displacement (n_local, 2), rotation (n_local,) or None, relative bound) for each
    of run.field_omega in turn; extra holds attributes of the method, reduced the datasets of the group
    `reduced`.
    """
    network = pencil.network
    with run.to.writer(FORMAT, network.comm) as writer:
        writer.dataset("omega", run.asked(omega))
        if run.damping is not None:
            writer.dataset("equivalent_omega", omega)
        writer.dataset("G", G)
        for name, bound in zip(BOUNDS, bounds.T, strict=True):
            writer.dataset(name, bound)
        for name, values in (reduced or {}).items():
            writer.dataset(f"reduced/{name}", values)
        if len(run.field_omega):
            writer.dataset("fields/omega", run.asked(run.field_omega))
            writer.distributed("particles", network.particles)
            errors = []
            for displacement, rotation, error in fields:
                writer.append("fields/displacement", displacement)
                if rotation is not None:
                    writer.append("fields/rotation", rotation)
                errors.append(error)
            writer.dataset("fields/error_bound", np.array(errors))
        writer.attributes(
            **run_record(run.disks, run.identity, run.parameters, network, run.started),
            method=run.method,
            accuracy=run.accuracy,
            positive_semidefinite=run.positive_semidefinite,
            unknowns=pencil.unknowns,
            notes=noted(notes_of(run, run.asked(omega), G, bounds)),
            **extra,
        )


def notes_of(run: Run, omega, G, bounds) -> list[str]:
    """Notes on G (M,) at frequencies omega (M,) of the experiment, with bounds (M, 3), see `io.results`."""
    found, highest = [], G.real + bounds[:, 1]
    if highest.min() < 0.0:  # by more than its bound
        worst = int(np.argmin(highest))
        found += unstable_to_shear(G.real[worst], f"G' at omega {omega[worst]:.3g}")
    if run.damping is not None:
        k = run.disks.potential.k
        strain = run.damping.stress * k / abs(G).min()
        pressure = run.disks.record.get("pressure", np.inf) / k
        if strain > pressure:
            found.append(
                f"contacts would change, which is left out: strain amplitude up to {strain:.1e}, more than p/k = "
                f"{pressure:.1e}. `oscillate --contacts moving` has it"
            )
    return found
