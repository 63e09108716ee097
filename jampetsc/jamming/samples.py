"""Samples of disks at packing fractions, jammed or not, each at a minimum of the energy, and their jamming density.

`sample_protocol` has the protocols. φ_J of a sample is where the energy of its minimum vanishes as the cell grows.
"""

from collections.abc import Callable

import numpy as np

from jampetsc.analysis.jammed_samples import assortativity
from jampetsc.errors import ConvergenceError
from jampetsc.jamming.sample_protocol import SampleProtocol
from jampetsc.jamming.stepwise_shear import StepwiseShear, measure_minimum, quench
from jampetsc.minimisation.minimise import settle
from jampetsc.minimisation.protocols import random_start, rescaled
from jampetsc.minimisation.thermal import annealed
from jampetsc.packing.neighbours import neighbour_pairs
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential

PHI_STEP = 2e-3  # of the search for φ_J before it is bracketed
PHI_TOLERANCE = 1e-5  # largest final width of the bracket of φ_J
MAX_SEARCH_PHI = 1.0  # largest φ of the search for φ_J
MAX_NEIGHBOUR_GAP = 0.2  # largest gap between neighbours, in mean diameters
RELAXED_FORCE = 1e-4  # max |F| in k_e/d to which a random start is relaxed before it is minimised
PHI_ROUNDING = 1e-12  # packing fractions that differ by less have the same samples
BATCH_SIZE = {"random": 20, "shear": 1, "compress": 2}  # starts of a rank between two calls of `save`
_THERMAL = 1  # appended to the seeds of the random start, seeds the generator of its thermal moves


def find_jamming_density(disks: Packing, jammed: bool, solver, tolerance: float) -> tuple[float, Packing]:
    """(φ_J, disks of the loosest jammed state): φ_J is where the energy of a minimum vanishes as the cell grows.

    disks: the minimum; if not jammed, it is compressed first. φ_J is bracketed to PHI_TOLERANCE; every looser state is
    made from the loosest jammed one. Raises ConvergenceError where a minimum is not found, or none jams up to
    MAX_SEARCH_PHI.
    """
    while not jammed:
        if disks.phi + PHI_STEP > MAX_SEARCH_PHI:
            raise ConvergenceError(f"no jammed state up to phi = {disks.phi:.6g}")
        disks, state = quench(rescaled(disks, disks.phi + PHI_STEP), solver, tolerance)
        jammed = state.jammed
    loose = disks.phi
    while jammed:
        loose -= PHI_STEP
        minimum, state = quench(rescaled(disks, loose), solver, tolerance)
        jammed, disks = state.jammed, minimum if state.jammed else disks
    while disks.phi - loose > PHI_TOLERANCE:
        middle = 0.5 * (disks.phi + loose)
        minimum, state = quench(rescaled(disks, middle), solver, tolerance)
        disks, loose = (minimum, loose) if state.jammed else (disks, middle)
    return 0.5 * (disks.phi + loose), disks


def segregation(disks: Packing) -> float:
    """Separation of sizes: assortativity of neighbours as large or small, 0 if mixed at random; nan for one size.

    Neighbours are disks with a gap of less than MAX_NEIGHBOUR_GAP mean diameters.
    """
    large = disks.radii > disks.radii.mean()
    i, j, _ = neighbour_pairs(
        disks.positions, disks.radii, disks.cell, skin=2 * MAX_NEIGHBOUR_GAP * float(disks.radii.mean())
    )
    return assortativity(large, i, j)


def make_samples(
    protocol: SampleProtocol,
    radii,
    *,
    phis,
    seeds,
    potential: Potential,
    solver,
    tolerance: float,
    comm,
    dimension: int = 2,
    resume: dict | None = None,
    save: Callable[[dict], None] | None = None,
    report: Callable[[int, float], None] | None = None,
) -> dict:
    """Samples of every seed at every φ, divided among the ranks: {column: (n,) array}, by φ and seed. Collective.

    radii       (N,) of the disks, or spheres with a `dimension` of 3
    phis, seeds of the samples
    solver      this rank's `petsc.hessian_solver.HessianSolver`
    tolerance   max |F| / (p d^(D−1)) of a minimum
    resume      columns as given to `save`, from which an interrupted run continues
    save        called on every rank with all columns so far after each batch
    report      called on every rank with the number of samples so far and their last φ after each batch
    """
    columns = {name: list(resume[name]) if resume else [] for name in protocol.columns}
    starts = [(phi, seed) for phi in phis for seed in seeds]
    size = batch_size(protocol, comm.size)
    finished = len(columns["phi"]) // protocol.rows
    while finished < len(starts):
        batch = starts[finished : finished + size]
        local = [
            sample_seed(protocol, radii, phi, seed, potential, solver, tolerance, dimension)
            for phi, seed in batch[comm.rank :: comm.size]
        ]
        samples = [None] * len(batch)
        for rank, rank_samples in enumerate(comm.allgather(local)):
            samples[rank :: comm.size] = rank_samples
        for name, values in columns.items():
            values.extend(row[name] for rows in samples for row in rows)
        finished += len(batch)
        if save is not None:
            save(_as_arrays(columns))
        if report is not None:
            report(finished * protocol.rows, batch[-1][0])
    return _as_arrays(columns)


def batch_size(protocol: SampleProtocol, ranks: int) -> int:
    """Starts of all ranks between two calls of `save`."""
    return BATCH_SIZE[protocol.name] * ranks


def _as_arrays(columns):
    return {name: np.array(values, float) for name, values in columns.items()}


def sample_seed(
    protocol: SampleProtocol,
    radii,
    phi: float,
    seed: int,
    potential: Potential,
    solver,
    tolerance: float,
    dimension: int = 2,
) -> list[dict]:
    """The samples of one seed at φ, of disks of these radii (N,): `SampleProtocol.rows` rows, nan without a minimum.

    The seed and φ determine the random start and the thermal moves: from the same places, samples at neighbouring φ
    would jam together, and fits to several φ take them as independent.
    """
    seeds = [seed, round(phi / PHI_ROUNDING)]
    start = settle(random_start(radii, phi, seeds, potential, protocol.separated, dimension), RELAXED_FORCE)
    rows = []
    try:
        if protocol.name == "shear":
            for row in _shear(protocol, start, solver, tolerance):
                rows.append(row)
        elif protocol.name == "compress":
            rows.append(_compress(protocol, start, seeds, solver, tolerance))
        else:
            rows.append(_minimum_row(quench(start, solver, tolerance)[1], start.n))
    except ConvergenceError:
        pass
    blank = dict.fromkeys(protocol.columns, np.nan) | {"phi": phi, "seed": seed}
    return [blank | row for row in rows + [{}] * (protocol.rows - len(rows))]


def _minimum_row(minimum, n):
    """Columns of a `MinimumState` of n disks, its energy per disk."""
    return {
        "energy": minimum.energy / n,
        "jammed": float(minimum.jammed),
        "pressure": minimum.pressure,
        "contact_number": minimum.contact_number,
    }


def _shear(protocol, start, solver, tolerance):
    """Generates the rows of samples along quasistatic shear."""
    shear = StepwiseShear(start, protocol.step, solver, tolerance)
    steps = round(protocol.discard / protocol.step)
    for _ in range(protocol.rows):
        steps += max(1, round(protocol.every / protocol.step))
        while shear.steps < steps:
            shear.advance()
        yield {"strain": shear.strain, **_minimum_row(measure_minimum(shear.disks), shear.disks.n)}


def _compress(protocol, start, seeds, solver, tolerance):
    """Row of the minimum that a cooled liquid is quenched to, with φ_J and segregation."""
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([*seeds, _THERMAL])))
    temperature = protocol.temperature * start.potential.k
    cold = annealed(start, temperature, protocol.cooling_rate, protocol.sweeps, generator)
    disks, minimum = quench(cold, solver, tolerance)
    if protocol.strain:
        shear = StepwiseShear(disks, protocol.step, solver, tolerance)
        for _ in range(round(protocol.strain / protocol.step)):
            shear.advance()
        disks, minimum = shear.disks, shear.minimum
    try:
        phi_J = find_jamming_density(disks, minimum.jammed, solver, tolerance)[0]
    except ConvergenceError:
        phi_J = np.nan
    return _minimum_row(minimum, disks.n) | {"phi_J": phi_J, "segregation": segregation(disks)}
