"""The samples that a `jam.Jam` asks for: every seed at every φ, divided among the ranks, and their result."""

import time

import numpy as np

from jampetsc.collective import agreed, on_root
from jampetsc.flows.jamming import samples
from jampetsc.flows.quasistatic_shear import ENERGY_CUT
from jampetsc.flows.record import Record, resumed, run_provenance, write_checkpoint
from jampetsc.io.results import noted
from jampetsc.minimise.sizes import in_small_diameters, radii_of
from jampetsc.options.starts import UNITS
from jampetsc.packing.potentials import Potential
from jampetsc.petsc import session
from jampetsc.progress import Progress

ROUND = {"random": 20, "shear": 1, "compress": 2}  # starts of a rank between two checkpoints
STIFFNESS = "inverse-square-diameter"


def make(job, solver, to) -> Record:
    """Make the samples of a Jam and write their result into the outlet `to`; their record, by φ and seed. Collective.

    solver: this rank's `petsc.hessian_solver.HessianSolver`.
    """
    began, running = time.perf_counter(), session.current()
    comm, protocol = running.comm, job.made_protocol
    radii = in_small_diameters(radii_of(job.sizes, job.n))
    potential = Potential(job.potential, STIFFNESS)
    columns = dict.fromkeys(protocol.columns, 0)
    checkpoint = kept = None
    with agreed(comm):
        if comm.rank == 0:
            checkpoint = to.checkpoint(job.settings() | protocol.facts)
            kept = resumed(checkpoint, columns)
    kept = comm.bcast(kept)
    record = kept[0] if kept else Record(columns)
    tasks = [(phi, seed) for phi in job.phi.tolist() for seed in job.seeds]
    size = ROUND[protocol.name] * comm.size
    rounds, done = -(-len(tasks) // size), len(record) // protocol.rows
    with Progress(rounds, "jam", comm.rank, done // size) as progress:
        while done < len(tasks):
            batch = tasks[done : done + size]
            local_samples = [
                samples(protocol, radii, *task, potential, solver, job.tolerance)
                for task in batch[comm.rank :: comm.size]
            ]
            batch_samples = [None] * len(batch)
            for rank, some in enumerate(comm.allgather(local_samples)):
                batch_samples[rank :: comm.size] = some
            for rows in batch_samples:
                for row in rows:
                    record.add(**row)
            done += len(batch)
            on_root(comm, lambda: write_checkpoint(checkpoint, record, {}))
            progress.step(f"{len(record)} of {job.count} samples, phi = {batch[-1][0]:.6g}")
    facts = {
        "stiffness": STIFFNESS,
        "units": UNITS,
        "energy_cut": ENERGY_CUT,
        "protocol": protocol.name,
        "particle_count": job.n,
        "sizes": job.sizes,
        "potential": job.potential,
        "tolerance": job.tolerance,
    }
    with to.writer(job.FORMAT, comm) as writer:
        for name in protocol.columns:
            writer.dataset(name, record.series(name))
        how = run_provenance(time.perf_counter() - began, running, running.size)
        writer.attributes(**how | facts | protocol.facts, notes=noted(notes_of(record)))
    on_root(comm, lambda: checkpoint.remove())
    return record


def notes_of(record) -> list[str]:
    """Notes on samples, see `io.results`."""
    lost = int(np.count_nonzero(~np.isfinite(record.series("jammed"))))
    return [f"no minimum found: {lost} samples, nan in the result"] if lost else []
