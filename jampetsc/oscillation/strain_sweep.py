"""Step strains of one packing, distributed over the ranks, each with the modes of the state at which it ends."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError
from jampetsc.laws.damping import Law
from jampetsc.laws.loads import Load
from jampetsc.oscillation.harmonic_preconditioner import FACTOR_PREFIX
from jampetsc.oscillation.rank_outcomes import Outcomes, solve_alone
from jampetsc.oscillation.step_strain import step_strain
from jampetsc.packing.packing import Packing
from jampetsc.petsc.session import current
from jampetsc.progress import Progress
from jampetsc.response.contact_network import DistributedNetwork, build_network
from jampetsc.response.factor_memory import require_memory
from jampetsc.response.minimum_check import negative_modes

UNKNOWN_MODES = -1  # number of negative modes of a state that is not at rest, or not rigid


@dataclass(frozen=True)
class StrainSweep:
    """Results of all strains; S strains, T times."""

    arrays: dict  # {dataset: (S, …)}, nan or, for counts, 0 where a strain failed
    failures: dict  # {number of a strain: ConvergenceError}


def sweep_strains(
    disks: Packing,
    network: DistributedNetwork,
    law: Law,
    load: Load,
    *,
    strains,
    times,
    accuracy: float,
    resume: dict | None = None,
    save: Callable[[int, dict], None] | None = None,
) -> StrainSweep:
    """Relaxation of a packing at rest after each of some step strains. Collective.

    network   of the disks, which is stable
    load      E, zero below its diagonal
    strains   (S,) positive
    times     (T,) at which G is measured; a relaxation that is at rest before keeps its last values
    accuracy  see `step_strain`
    resume    {number of a strain: record} of finished strains
    save      called on every rank with number and record of each strain

    Raises ConvergenceError if all strains fail.
    """
    session, comm = current(), network.comm
    require_memory(network, network.n * law.dofs(network.dimension), FACTOR_PREFIX, comm.size)

    def solve(strain):
        result = step_strain(disks, law, load, strain, times, accuracy)
        at_rest = np.isfinite(result.relaxed_time)
        return {**result.record(), "negative_modes": _modes(result.final) if at_rest else UNKNOWN_MODES}

    missing = [number for number in range(len(strains)) if number not in (resume or {})]
    finished = len(strains) - len(missing)
    with Progress(len(strains), "relax", comm.rank, done=finished) as progress:
        done = Outcomes(resume, save, progress)
        if finished:
            progress.note(f"resuming: {finished} of {len(strains)} strains are finished")
        while missing:
            batch, missing = missing[: comm.size], missing[comm.size :]
            with session.stage("relaxation"):
                outcomes = solve_alone(solve, [float(strains[number]) for number in batch], comm)
            for number, outcome in zip(batch, outcomes, strict=True):
                done.add(number, outcome, f"strain {strains[number]:.3g}", _summary)
    if not done.records:
        raise next(iter(done.failures.values()))
    return StrainSweep(_stacked(done.records, len(strains), len(times)), done.failures)


def _modes(disks) -> int:
    """Negative modes of K of disks at rest; UNKNOWN_MODES if they are not rigid."""
    try:
        return negative_modes(build_network(disks, current().MPI.COMM_SELF))[0]
    except InputError:
        return UNKNOWN_MODES


def _summary(record) -> str:
    """The ends of a relaxation, for the line of progress."""
    rest = (
        f"at rest from t = {record['relaxed_time']:.3g}" if np.isfinite(record["relaxed_time"]) else "moving"
    )
    return (
        f"G(0+) {record['initial_G']:.6e}  G {record['G'][-1]:.6e}  error {max(record['error']):.1e}  {rest}, "
        f"steps {record['steps_taken']}, newton {record['newton_steps']}"
    )


def _stacked(records, strains, times):
    """Datasets (S, …) from the records of finished strains; a series at rest keeps its last value."""
    arrays = {}
    for name, first in next(iter(records.values())).items():
        shape = (strains, times) if isinstance(first, list) else (strains,)
        is_count = isinstance(first[0] if isinstance(first, list) else first, int)
        values = np.full(shape, 0 if is_count else np.nan, int if is_count else float)
        for number, record in records.items():
            value = record[name]
            values[number] = value + value[-1:] * (times - len(value)) if isinstance(value, list) else value
        arrays[name] = values
    return arrays
