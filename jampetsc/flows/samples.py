"""Many samples, jammed or not: seeds at several packing fractions, divided among the ranks, and their result."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

from jampetsc.collective import on_root
from jampetsc.core.potentials import Potential
from jampetsc.flows.facts import run_provenance
from jampetsc.flows.jamming import Protocol, samples
from jampetsc.flows.quasistatic_shear import ENERGY_CUT
from jampetsc.flows.record import Record, remove_checkpoint, resumed, write_checkpoint
from jampetsc.minimise.sizes import in_small_diameters, radii_of
from jampetsc.petsc import session
from jampetsc.progress import Progress

FORMAT = "jampetsc-jam"
ROUND = {"random": 20, "shear": 1, "compress": 2}  # starts of a rank between two checkpoints
STIFFNESS = "inverse-square-diameter"


@dataclass(frozen=True, eq=False)
class Samples:
    """Request for samples of n disks by a protocol, of every seed at every φ."""

    n: int
    phis: tuple  # M packing fractions
    seeds: Sequence[int]
    protocol: Protocol
    sizes: str = "bidisperse"
    potential: str = "harmonic"
    tolerance: float = 1e-6  # max|F|/(p d) of a minimum
    units: str | None = None  # units of the result, in words

    @property
    def tasks(self) -> list[tuple[float, int]]:
        """[(φ, seed)] of all starts."""
        return [(phi, seed) for phi in self.phis for seed in self.seeds]

    @property
    def count(self) -> int:
        """Samples in all."""
        return len(self.seeds) * len(self.phis) * self.protocol.rows

    @property
    def settings(self) -> dict:
        """Everything that determines the result, as plain values."""
        seeds = self.seeds
        listed = [seeds.start, seeds.stop] if isinstance(seeds, range) else {"each": list(seeds)}
        return {"seeds": listed, "phi": list(self.phis)} | self.facts | vars(self.protocol)

    @property
    def facts(self) -> dict:
        """Attributes that all samples share."""
        names = {"particle_count": "n", "sizes": "sizes", "potential": "potential", "tolerance": "tolerance"}
        return {fact: getattr(self, name) for fact, name in names.items()}


def execute(asked: Samples, solver, to) -> Record:
    """Make the samples, write their result into the outlet `to` and return their record, in order of tasks. Collective.

    solver: this rank's `petsc.local.NewtonSolver`.
    """
    began, running = time.perf_counter(), session.current()
    comm, protocol = running.comm, asked.protocol
    radii = in_small_diameters(radii_of(asked.sizes, asked.n))
    potential = Potential(asked.potential, STIFFNESS)
    columns = dict.fromkeys(protocol.columns, 0)
    kept = on_root(comm, lambda: resumed(to.kept, asked.settings, columns))
    record = kept[0] if kept else Record(columns)
    tasks, size = asked.tasks, ROUND[protocol.name] * comm.size
    rounds, done = -(-len(tasks) // size), len(record) // protocol.rows
    with Progress(rounds, "jam", comm.rank, done // size) as progress:
        while done < len(tasks):
            batch = tasks[done : done + size]
            mine = [
                samples(protocol, radii, *task, potential, solver, asked.tolerance)
                for task in batch[comm.rank :: comm.size]
            ]
            found = [None] * len(batch)
            for rank, some in enumerate(comm.allgather(mine)):
                found[rank :: comm.size] = some
            for one in found:
                for row in one:
                    record.add(**row)
            done += len(batch)
            state = {"samples": len(record)}
            on_root(comm, lambda state=state: write_checkpoint(to.kept, record, state, asked.settings))
            progress.step(f"{len(record)} of {asked.count} samples, phi = {batch[-1][0]:.6g}")
    with to.writer(FORMAT, comm) as writer:
        for name in protocol.columns:
            writer.dataset(name, record.series(name))
        own = {
            "stiffness": STIFFNESS,
            "units": asked.units,
            "energy_cut": ENERGY_CUT,
            "protocol": protocol.name,
        }
        how = run_provenance(time.perf_counter() - began, running, running.size)
        writer.attributes(**how | own | asked.facts | protocol.facts)
    on_root(comm, lambda: remove_checkpoint(to.kept))
    return record
