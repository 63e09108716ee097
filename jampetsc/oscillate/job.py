"""Steady oscillations at several amplitudes and frequencies: progress, checkpoint, failures, result file."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jampetsc.contacts.laws import Physics
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.mechanics.assembly import assemble
from jampetsc.mechanics.compatibility import build_compatibility
from jampetsc.mechanics.network import build_network
from jampetsc.oscillate.powerlaw import relative_softening
from jampetsc.oscillate.steady import HARMONICS, Point, SteadyOscillation
from jampetsc.progress import Progress
from jampetsc.response.elastic import ElasticResponse
from jampetsc.response.record import run_record
from jampetsc.session import current
from jampetsc.storage.checkpoint import Checkpoint
from jampetsc.storage.packing_file import read_identified
from jampetsc.storage.result_file import ResultWriter

FORMAT = "jampetsc-oscillate"
STORED = ("G", "error", "harmonics", "work", "energy_balance", "regularisation_effect")
COUNTS = ("newton_steps", "linear_iterations")


@dataclass(frozen=True, eq=False)
class Job:
    """What is asked for. Frequencies in 1/τ₁ units of time as the law has them."""

    packing: Path
    out: Path
    physics: Physics
    omega: np.ndarray  # (M,) increasing
    amplitude: np.ndarray  # (A,) of stress in units of k, or of strain
    stress_controlled: bool
    steps: int  # of a cycle, a multiple of 8

    def key(self, identity) -> dict:
        """What identifies the job to a checkpoint."""
        return {
            "packing": identity[1],
            "law": self.parameters,
            "omega": self.omega,
            "amplitude": self.amplitude,
            "control": self.control,
            "steps": self.steps,
        }

    @property
    def control(self) -> str:
        """What is imposed."""
        return "stress" if self.stress_controlled else "strain"

    @property
    def parameters(self) -> dict:
        """The law as a file tells it, with its exponent."""
        return {**self.physics.parameters, "alpha": self.physics.law.exponent}


def run(job: Job) -> dict:
    """Solve every point that no earlier run has finished and write the file. Collective.

    Returns arrays of the names of STORED, first axes (A, M), nan where a point failed. Raises InputError for a packing
    that is not a rigid minimum, ConvergenceError, after writing the others, if some points failed.
    """
    started = time.perf_counter()
    session = current()
    disks, identity = read_identified(job.packing, session.comm)
    with session.stage("assembly"):
        try:
            network = build_network(disks, session.comm, job.physics.prestress)
            ElasticResponse(network).destroy()  # refuses what has negative or floppy modes
        except InputError as error:
            raise InputError(f"{job.packing}: {error}") from None
        pencil = assemble(network, job.physics.law)
        compatibility = build_compatibility(pencil)
        oscillation = SteadyOscillation(compatibility, 2.0 * float(disks.radii.mean()), job.steps)
    checkpoint = Checkpoint(job.out, job.key(identity), session.comm)
    failures = _solve_all(job, oscillation, checkpoint)
    oscillation.destroy()
    for item in (compatibility, pencil):
        item.destroy()
    if not checkpoint.done:
        raise next(iter(failures.values()))
    arrays = _arrays(job, checkpoint.done)
    with session.stage("output"), ResultWriter(job.out, FORMAT, session.comm) as writer:
        writer.dataset("omega", job.omega)
        writer.dataset("amplitude", job.amplitude)
        for name, values in arrays.items():
            writer.dataset(name, values)
        writer.attributes(
            **run_record(disks, identity, job.parameters, network, started),
            control=job.control,
            contacts="fixed",
            steps=job.steps,
            regularisation=relative_softening(job.physics.law.exponent),
        )
    if failures:
        first = failures[min(failures)]
        raise ConvergenceError(
            f"{len(failures)} of {len(job.amplitude) * len(job.omega)} points failed, the others are in {job.out}; "
            f"the first: {first}"
        )
    checkpoint.remove()
    return arrays


def _solve_all(job, oscillation, checkpoint):
    """Solve and save what is not done; {index: ConvergenceError} of what failed."""
    session, failures = current(), {}
    total = len(job.amplitude) * len(job.omega)
    with Progress(total, "oscillate", session.rank, done=len(checkpoint.done)) as progress:
        if checkpoint.done:
            progress.note(f"continuing {checkpoint.journal}: {len(checkpoint.done)} points are finished")
        for index in range(total):
            if index in checkpoint.done:
                continue
            a, m = divmod(index, len(job.omega))
            point = Point(float(job.omega[m]), float(job.amplitude[a]), job.stress_controlled)
            name = f"omega {point.omega:.3e}  {job.control} {point.amplitude:.1e}"
            try:
                with session.stage("oscillation"):
                    found = oscillation.solve(point)
            except ConvergenceError as error:
                failures[index] = ConvergenceError(f"{name}: {error}")
                progress.step(f"failed: {name}: {error}")
                continue
            values = (
                found.G,
                found.error,
                list(found.harmonics),
                found.work,
                found.balance,
                found.regularisation,
            )
            counts = (found.newton, found.linear)
            checkpoint.save(index, dict(zip(STORED + COUNTS, values + counts, strict=True)))
            progress.step(
                f"{name}  G' {found.G.real:.6e}  G'' {found.G.imag:.6e}  error {found.error:.1e}  "
                f"Newton {found.newton}, linear {found.linear}"
            )
    return failures


def _arrays(job, done):
    """Datasets (A, M, …) out of the records of finished points."""
    shape = (len(job.amplitude), len(job.omega))
    kinds = {"G": complex, "harmonics": complex}
    arrays = {}
    for name in STORED:
        more = (HARMONICS,) if name == "harmonics" else ()
        values = np.full((shape[0] * shape[1], *more), np.nan, kinds.get(name, float))
        for index, record in done.items():
            values[index] = record[name]
        arrays[name] = values.reshape(*shape, *more)
    for name in COUNTS:
        values = np.zeros(shape[0] * shape[1], int)
        values[list(done)] = [done[index][name] for index in done]
        arrays[name] = values.reshape(shape)
    return arrays
