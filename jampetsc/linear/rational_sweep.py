"""The rational sweep as a job: progress, checkpoint, fields, result file."""

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.linear.rational import RationalSweep
from jampetsc.linear.run import Run, split_field, write_sweep
from jampetsc.mechanics.assembly import assemble
from jampetsc.mechanics.compatibility import build_compatibility
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.session import current
from jampetsc.progress import Progress


def solve(run: Run):
    """Sweep and write the file. Collective.

    Returns (omega, G, bounds) as for `write_sweep`. K must be positive semi-definite, see `stability`: raises
    InputError where a factorisation shows that it is not, ConvergenceError where the accuracy cannot be
    certified.
    """
    session = current()
    with session.stage("assembly"):
        network = run.network(session.comm)
        pencil = assemble(network, run.physics.law)
        compatibility = build_compatibility(pencil)
    sweep = RationalSweep(pencil, compatibility, run.omega, run.accuracy, run.parallel)
    checkpoint = run.to.checkpoint(run.key(session.size), session.comm, ordered=True)
    with Progress(None, "sweep", session.rank) as progress:
        if checkpoint.done:
            if not _restore(sweep, checkpoint):
                raise InputError(
                    f"{checkpoint.journal}: what it holds does not solve this packing: remove it to start again"
                )
            progress.note(f"continuing {checkpoint.journal}: {len(checkpoint.done)} shifts are finished")
        try:
            while shifts := sweep.next_shifts():
                before = sweep.basis.size if sweep.basis else 0
                with session.stage("shift"):
                    sweep.add_shifts(shifts)
                basis = sweep.basis
                fields = {"vectors": basis.vectors[before:]} | ({} if before else {"x0": basis.x0})
                done = {"first": basis.first, "shifts": basis.shifts[before:]}
                checkpoint.save(checkpoint.next, done, fields)
                listed = ", ".join(f"{shift:.2e}" for shift in shifts)
                progress.step(
                    f"shift {listed}  vectors {basis.size}  worst bound / allowed {sweep.worst():.1e}"
                )
        except NotPositiveDefinite as error:
            raise InputError(f"{run.packing}: {error.told(named)}; use {named('method')} direct") from None
    galerkin, G, bounds = sweep.finish()
    spectrum = galerkin.spectrum
    write_sweep(
        run,
        network,
        run.omega,
        G,
        bounds,
        (
            (*split_field(pencil, galerkin.field(omega)), galerkin.field_bound(omega, sweep.error_at(omega)))
            for omega in run.field_omega
        ),
        {"factorisations": sweep.factorisations, "vectors": sweep.basis.size, "unknowns": pencil.unknowns},
        {
            "G0": spectrum.G0,
            "eta_inf": spectrum.eta_inf,
            "rates": spectrum.rates,
            "weights": spectrum.weights,
        },
    )
    checkpoint.remove()
    sweep.destroy()
    compatibility.destroy()
    pencil.destroy()
    return run.omega, G, bounds


def _restore(sweep, checkpoint):
    records = [checkpoint.done[index] for index in sorted(checkpoint.done)]
    arrays = [checkpoint.fields(index) for index in sorted(checkpoint.done)]
    return sweep.restore(
        records[0]["first"],
        arrays[0]["x0"],
        np.concatenate([array["vectors"] for array in arrays]),
        np.concatenate([record["shifts"] for record in records]),
    )
