"""Which of many packings jam."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from jampetsc.analysis.jammed_samples import at_densities
from jampetsc.collective import agreed, on_root
from jampetsc.errors import InputError, named
from jampetsc.io.results import note_lines, noted
from jampetsc.jamming.sample_protocol import PROTOCOLS, SampleProtocol
from jampetsc.minimisation.size_laws import DEFAULT_SIZES, SIZES_HELP, radii_of
from jampetsc.minimisation.sizes import MAX_DISKS, MIN_DISKS, in_small_diameters
from jampetsc.options.job import NO_FILE, Job, TaskInputs
from jampetsc.options.parameters import optional_parameter, parameter
from jampetsc.options.potential_options import EXPONENT, potential_identity
from jampetsc.options.starts import (
    PHI_RANGE,
    STIFFNESS,
    UNITS,
    minimum_tolerance_parameter,
    random_particles_lines,
)
from jampetsc.options.values import SEEDS, SIZES, Numbers, number_list
from jampetsc.packing.packing import PARTICLES
from jampetsc.packing.potentials import DEFAULT_POTENTIAL, EXPONENTS, Potential
from jampetsc.packing.units import name_stress_unit, units_line
from jampetsc.petsc import session
from jampetsc.progress import Progress

MAX_SAMPLES = 1_000_000  # most samples of one run
GROUPS = ("shear and compress", "shear", "compress")
shear_compress_parameter, shear_parameter, compress_parameter = (
    partial(optional_parameter, group=group) for group in GROUPS
)


@dataclass(frozen=True, eq=False)
class Jam(Job):
    """The fraction of packings that jam, and their pressures.

    Makes many samples at each packing fraction, jammed or not, with their energies and pressures (Vågberg et al., PRE
    83, 030303 (2011); thesis sec. 4.7), by one of three protocols. random: random particles, quenched. shear: minima
    at several strains of a quasistatic shear of such particles. compress: a liquid is cooled and quenched, sheared if
    a strain is given, then compressed or decompressed to its phi_J; also how far large and small particles have
    separated.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(NO_FILE)
    EPILOG: ClassVar = """examples:
  jampetsc jam --n 64 --phi 0.83:0.85:9 --seeds 1:500 --out f64.h5
  mpirun -n 2 jampetsc jam --n 256 --phi 0.84,0.8425 --seeds 1:100 --out f256.h5
  jampetsc jam --n 64 --phi 0.84 --seeds 1:4 --protocol shear --discard 1 --strain 4 --out qs64.h5
  jampetsc jam --n 64 --phi 0.84 --seeds 1:40 --protocol compress --cooling-rate 1e-3 --out slow64.h5

A killed run continues when the same command is given again. Options of the Newton steps have the prefix
-newton_."""
    SOLVERS: ClassVar = ("newton_",)

    n: int = parameter(help="number of particles", low=MIN_DISKS, high=MAX_DISKS, metavar="N")
    dimension: int = parameter(2, "2: disks, 3: spheres", low=2, high=3, metavar="D")
    phi: Numbers = parameter(
        help="packing fractions: M from A to B evenly, or a list with commas",
        value_type=number_list(
            *PHI_RANGE, "A:B:M|LIST", "; disks jam near 0.84, spheres near 0.64", even=True
        ),
    )
    seeds: Sequence[int] = parameter(
        help="a sample at each packing fraction for each seed, both ends included", value_type=SEEDS
    )
    sizes: str = parameter(DEFAULT_SIZES, SIZES_HELP, value_type=SIZES)
    potential: str = parameter(DEFAULT_POTENTIAL, "energy of an overlap", choices=EXPONENTS)
    exponent: float | None = optional_parameter(**EXPONENT)
    tolerance: float = minimum_tolerance_parameter()
    protocol: str = parameter("random", "how samples are made", choices=tuple(PROTOCOLS))
    separated: bool = parameter(False, "large particles start on one side of the cell, small on the other")
    step: float | None = shear_compress_parameter(
        "strain of one step (default 1e-3)", low=1e-8, high=0.1, metavar="DG"
    )
    strain: float | None = shear_compress_parameter(
        "how far each seed is sheared (default 2; compress: not)", low=1e-8, high=1e4, metavar="S"
    )
    discard: float | None = shear_parameter(
        "strain before the first sample (default 1)", low=0.0, high=1e4, metavar="S"
    )
    every: float | None = shear_parameter(
        "strain between samples (default 0.02)", low=1e-8, high=1e4, metavar="S"
    )
    temperature: float | None = compress_parameter(
        "of the liquid, in k_e (default 1e-3)", low=1e-8, high=10.0, metavar="T"
    )
    cooling_rate: float | None = compress_parameter(
        "by how much ln T falls per sweep (default 1e-2)", low=1e-6, high=10.0, metavar="R"
    )
    sweeps: int | None = compress_parameter(
        "sweeps before that (default 200)", low=0, high=10_000_000, metavar="S"
    )

    def check(self):
        """Refuse options of other protocols, too many samples, and sizes that so few particles cannot have."""
        radii_of(self.sizes, self.n)
        _ = self.made_potential  # raises InputError
        if self.count > MAX_SAMPLES:
            raise InputError(
                f"{named('phi')}, {named('seeds')}: {self.count} samples (at most {MAX_SAMPLES} in one result). Give "
                "fewer."
            )

    @property
    def made_potential(self) -> Potential:
        """The potential of the samples. Raises InputError."""
        return Potential(self.potential, STIFFNESS, exponent=self.exponent)

    @property
    def made_protocol(self) -> SampleProtocol:
        """The protocol of the samples with its options."""
        names = ("step", "strain", "discard", "every", "temperature", "cooling_rate", "sweeps")
        options = {name: getattr(self, name) for name in names}
        return SampleProtocol.of(self.protocol, separated=self.separated, **options)

    @property
    def implied(self):
        """See `Job`."""
        return self.made_protocol.facts

    def identity(self):
        """See `Job`."""
        return super().identity() | potential_identity(self.made_potential)

    @property
    def count(self) -> int:
        """Samples in all."""
        return len(self.phi) * len(self.seeds) * self.made_protocol.rows

    def work(self, to):
        from jampetsc.commands.run_files import run_provenance, save_rows, saved_rows
        from jampetsc.jamming.samples import batch_size, make_samples
        from jampetsc.jamming.stepwise_shear import energy_cut
        from jampetsc.petsc.hessian_solver import HessianSolver

        start_time, running, protocol = time.perf_counter(), session.current(), self.made_protocol
        comm, checkpoint, resume = running.comm, None, None
        with agreed(comm):
            if comm.rank == 0:
                checkpoint = to.checkpoint()
                resume = saved_rows(checkpoint)
        resume = comm.bcast(resume and resume[0])
        radii = in_small_diameters(radii_of(self.sizes, self.n))
        potential = self.made_potential
        size, starts = batch_size(protocol, comm.size), len(self.phi) * len(self.seeds)
        finished = len(resume["phi"]) // protocol.rows if resume else 0
        with Progress(-(-starts // size), "jam", comm.rank, finished // size) as progress:
            columns = make_samples(
                protocol,
                radii,
                phis=self.phi.tolist(),
                seeds=self.seeds,
                potential=potential,
                solver=HessianSolver(),
                tolerance=self.tolerance,
                comm=comm,
                dimension=self.dimension,
                resume=resume,
                save=lambda columns: on_root(comm, lambda: save_rows(checkpoint, columns, {})),
                report=lambda samples, phi: progress.step(
                    f"{samples} of {self.count} samples, phi = {phi:.6g}"
                ),
            )
        facts = {
            **{name: value for name, value in potential.record.items() if name != "k"},
            "stress_unit": name_stress_unit(potential, self.dimension),
            "units": UNITS,
            "energy_cut": energy_cut(potential),
            "protocol": protocol.name,
            "particle_count": self.n,
            **({"dimension": 3} if self.dimension == 3 else {}),
            "sizes": self.sizes,
            "tolerance": self.tolerance,
        }
        notes = _notes(columns)
        with to.writer(self.FORMAT, comm) as writer:
            for name, values in columns.items():
                writer.dataset(name, values)
            provenance = run_provenance(time.perf_counter() - start_time, running, running.size)
            writer.attributes(**provenance | facts | protocol.facts, notes=noted(notes))
        on_root(comm, lambda: checkpoint.remove())
        units = units_line(facts["stress_unit"], 1.0, diameter=2.0 * float(radii.mean()))
        first, *rows = _summary(self, columns, to)
        return "\n".join([first, *random_particles_lines(facts), *rows, units, *note_lines(notes)])


def _notes(columns) -> list[str]:
    """Notes on samples, see `io.results`."""
    lost = int(np.count_nonzero(~np.isfinite(columns["jammed"])))
    return [f"no minimum found: {lost} samples, nan in the result"] if lost else []


def _summary(job, columns, to) -> list[str]:
    """A line for every φ."""
    lines = [f"{to}: {len(columns['phi'])} samples of {job.n} {PARTICLES[job.dimension]}"]
    for density in at_densities(columns):
        if density.jammed is None:
            lines.append(f"  phi = {density.phi:.6g}: no minimum found")
            continue
        pressure = f", p of the jammed {density.pressure:.4g}" if np.isfinite(density.pressure) else ""
        means = "".join(
            f", {name} {value:.5g} ± {error:.2g}" for name, (value, error) in density.means.items()
        )
        lines.append(f"  phi = {density.phi:.6g}: {_share_text(density.jammed)}{pressure}{means}")
    return lines


def _share_text(share) -> str:
    """How many samples of one φ are jammed."""
    independent = round(share.independent)
    size = f"effective sample size {independent}"
    if share.samples == 1:
        return f"the one sample {'jammed' if share.value else 'did not jam'}"
    if share.value in (0.0, 1.0):
        return f"{'all' if share.value else 'none'} of {share.samples} samples jammed ({size})"
    return f"jammed {share.value:.3f} ± {share.error:.2g} ({size})"
