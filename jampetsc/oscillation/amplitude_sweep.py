"""Steady oscillations of one packing at several amplitudes and frequencies, distributed over the ranks.

With moving contacts the amplitudes of a frequency are a chain: each begins where the next smaller one that has a result
ended, the smallest at linear response. Its end is in the record of a point, so that a chain that is resumed is the
same. Frequencies are independent, and shared between ranks.
"""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.laws.damping import Law
from jampetsc.laws.loads import Load
from jampetsc.oscillation.dashpots import LINEAR_BELOW
from jampetsc.oscillation.drive import Drive
from jampetsc.oscillation.harmonic_preconditioner import FACTOR_PREFIX
from jampetsc.oscillation.oscillation_start import Start
from jampetsc.oscillation.power_law import relative_softening
from jampetsc.oscillation.rank_outcomes import Outcomes, outcome_of, solve_alone
from jampetsc.oscillation.repeated_cycles import START_STEPS, repeat_cycles
from jampetsc.oscillation.steady_oscillation import SteadyOscillation
from jampetsc.packing.packing import Packing
from jampetsc.petsc.session import current
from jampetsc.progress import Progress
from jampetsc.response.contact_network import DistributedNetwork, build_network
from jampetsc.response.elastic import ElasticResponse
from jampetsc.response.factor_memory import require_memory

COUNTS = ("newton_steps", "linear_iterations", "factorisations", "steps_taken", "cycles")
INTEGERS = (*COUNTS, "averaged_cycles")
END = "end"  # in the record of a point: see `Start.record`


@dataclass(frozen=True)
class AmplitudeSweep:
    """Results of all points (amplitude, frequency); point number i of A × M is (i // M, i % M)."""

    arrays: dict  # {dataset: (A, M, …)}, nan or, for counts, 0 where a point failed
    failures: dict  # {number of a point: ConvergenceError}
    solver: str  # "cycle": a whole cycle at once; "steps": time steps
    regularisation: float  # force below which a contact is linear, over the force at the rms velocity


def sweep_amplitudes(
    disks: Packing,
    network: DistributedNetwork,
    law: Law,
    *,
    omega,
    amplitudes,
    control: str,
    contacts: str = "fixed",
    steps: int = 64,
    cycles: int | None = None,
    resume: dict | None = None,
    save: Callable[[int, dict], None] | None = None,
    load: Load | None = None,
) -> AmplitudeSweep:
    """Oscillations of a packing at every amplitude and frequency. Collective.

    network     of the disks, which is stable under this control (`require_stability`)
    law         damping of contacts, with its exponent
    omega       (M,) frequencies in 1/time
    amplitudes  (A,) of the stress, in the unit of k, of spheres over that of length; or of the strain
    control     the imposed quantity, "stress" or "strain"
    contacts    "fixed", or "moving": they open and close
    steps       of a cycle, a multiple of 8
    cycles      with moving contacts: their number in each of two runs; None: until they repeat
    resume      {number of a point: record} of finished points, which are not solved again
    save        called on every rank with number and record of each point that is solved, in lists and numbers
    load        of fixed contacts; simple shear if not given

    Raises ConvergenceError if all points fail.
    """
    solver = PointSolver(disks, network, law, contacts == "moving", steps, cycles, load)
    unit = network.k if control == "stress" else 1.0  # of a `Drive`
    points = [Drive(float(w), float(a) / unit, control == "stress") for a in amplitudes for w in omega]
    records, failures = _solve_points(solver, points, len(omega), unit, dict(resume or {}), save)
    if not records:
        raise next(iter(failures.values()))
    arrays = _stack_records(records, (len(amplitudes), len(omega)))
    return AmplitudeSweep(arrays, failures, solver.name, solver.regularisation)


def require_stability(network: DistributedNetwork, control: str, load: Load) -> None:
    """Raise InputError for a packing that is unstable under this control, "stress" or "strain". Collective.

    An imposed strain fixes the shape of the cell. Under a stress the cell yields, so that a negative modulus of the
    load is one more negative mode: the equations still have a periodic solution then, but an unstable one.
    """
    elastic = ElasticResponse(network)  # refuses packings with negative or floppy modes
    modulus = elastic.respond(load).value / network.volume if control == "stress" else np.inf
    if not modulus > 0.0:
        raise InputError(
            f"modulus {modulus:.2g} of load {load.name}: too low to impose a stress. Impose a {named('strain')}, or "
            f"relax the shear of its cell (pack {named('stabilise')} shear)."
        )


class PointSolver:
    """Solves points of one packing.

    comm            of the ranks that share the points
    on_one_rank     whether each rank solves points alone; else all ranks work on one point
    """

    def __init__(self, disks, network, law, moving, steps, cycles, load):
        self._disks, self._law, self._steps, self._cycles = disks, law, steps, cycles
        self.comm = network.comm
        self.on_one_rank, self.name = moving, "steps" if moving else "cycle"
        if moving:
            self.regularisation = LINEAR_BELOW**law.exponent if law.exponent != 1.0 else 0.0
            # each rank has a factor of its own
            unknowns = network.n * law.dofs(network.dimension)
            require_memory(network, unknowns, FACTOR_PREFIX, network.comm.size)
        else:
            self.regularisation = relative_softening(law.exponent)
        with current().alone() if moving else contextlib.nullcontext():
            if moving:
                network = build_network(disks, current().MPI.COMM_SELF, network.prestress)
            rho0, steps = 2.0 * float(disks.radii.mean()), START_STEPS if moving else steps
            self._oscillation = SteadyOscillation(network, law, rho0, steps, load=load)

    def solve(self, drive: Drive, end: dict | None = None) -> dict:
        """The record of one point; raises ConvergenceError.

        end   of another amplitude, at which this one begins; None: at linear response
        """
        if not self.on_one_rank:
            return self._oscillation.solve(drive).record()
        if end is None:
            start, disks = self._oscillation.start(drive), self._disks
        else:
            start, disks = Start.after(end, self._disks, drive)
        result, final, disks = repeat_cycles(disks, self._law, start, self._steps, self._cycles)
        return result.record() | {END: final.record(disks)}


def _solve_batch(solver, points) -> list:
    """The record of each (drive, end of the amplitude before), or its ConvergenceError. Collective."""

    def solve(point):
        return solver.solve(*point)

    if solver.on_one_rank:
        return solve_alone(solve, points, solver.comm)
    return [outcome_of(solve, point) for point in points]


def _solve_points(solver, points, frequencies, unit, records, save):
    """({number: record} of all finished points, {number: ConvergenceError}); `records` are finished already.

    frequencies   their number: points of one amplitude follow each other
    unit          of the amplitudes of the points
    """
    session, comm = current(), solver.comm
    missing = [number for number in range(len(points)) if number not in records]
    batch_size = comm.size if solver.on_one_rank else 1
    with Progress(len(points), "oscillate", comm.rank, done=len(records)) as progress:
        done = Outcomes(records, save, progress)
        if records:
            progress.note(f"resuming: {len(records)} points are finished")
        while missing:
            row = missing[0] // frequencies
            batch = [number for number in missing[:batch_size] if number // frequencies == row]
            missing = missing[len(batch) :]
            starts = [
                (
                    points[number],
                    _end_before(done.records, number, frequencies) if solver.on_one_rank else None,
                )
                for number in batch
            ]
            with session.stage("oscillation"):
                outcomes = _solve_batch(solver, starts)
            for number, outcome in zip(batch, outcomes, strict=True):
                drive = points[number]
                point = f"omega {drive.omega:.3e}  {drive.control} {unit * drive.amplitude:.1e}"
                done.add(number, outcome, point, _summarise)
    return done.records, done.failures


def _end_before(records, number, frequencies) -> dict | None:
    """Where the next smaller amplitude with a result at the frequency of a point ended; None without one."""
    earlier = range(number - frequencies, -1, -frequencies)
    return next((records[other][END] for other in earlier if other in records), None)


def _summarise(record) -> str:
    """G*, error and counts of a point, for the line of progress."""
    counts = ", ".join(
        f"{count.removesuffix('_steps').removesuffix('_iterations').replace('_', ' ')} {record[count]}"
        for count in COUNTS
        if count in record
    )
    G = record["G"]
    return f"G' {G.real:.6e}  G'' {G.imag:.6e}  error {record['error']:.1e}  {counts}"


def _stack_records(records, shape):
    """Datasets (A, M, …) from the records of finished points."""
    arrays = {}
    for name, example in next(iter(records.values())).items():
        if name == END:
            continue
        dtype = bool if name == "repeats" else int if name in INTEGERS else np.result_type(np.array(example))
        empty = np.nan if dtype not in (bool, int) else 0
        values = np.full((shape[0] * shape[1], *np.shape(example)), empty, dtype)
        for number, record in records.items():
            values[number] = record[name]
        arrays[name] = values.reshape(*shape, *values.shape[1:])
    return arrays
