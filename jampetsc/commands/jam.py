"""Which of many packings jam."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from jampetsc.analysis.jammed_samples import at_densities
from jampetsc.errors import InputError
from jampetsc.io.results import note_lines
from jampetsc.minimise.sizes import MAX_DISKS, MIN_DISKS, SIZES
from jampetsc.options.job import Job
from jampetsc.options.parameters import optional_parameter, parameter
from jampetsc.options.starts import PHI_RANGE
from jampetsc.options.task_inputs import NO_FILE, TaskInputs
from jampetsc.options.values import SEEDS, Numbers, number_list
from jampetsc.packing.potentials import EXPONENTS

PROTOCOLS = ("random", "shear", "compress")  # the names of `flows.jamming.PROTOCOLS`
MAX_SAMPLES = 1_000_000  # most samples of one run
GROUPS = ("shear and compress", "shear", "compress")
shear_compress_parameter, shear_parameter, compress_parameter = (
    partial(optional_parameter, group=group) for group in GROUPS
)


@dataclass(frozen=True, eq=False)
class Jam(Job):
    """The fraction of packings that jam, and their pressures.

    Makes many samples at each packing fraction, jammed or not, with their energies and pressures (Vågberg et al., PRE
    83, 030303 (2011); thesis sec. 4.7), by one of three protocols. random: random disks, quenched. shear: minima at
    several strains of a quasistatic shear of such disks. compress: a liquid is cooled and quenched, sheared if a strain
    is given, then compressed or decompressed to its phi_J; also how far large and small disks have separated.
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

    n: int = parameter(help="number of disks", low=MIN_DISKS, high=MAX_DISKS, metavar="N")
    phi: Numbers = parameter(
        help="packing fractions: M from A to B evenly, or a list with commas",
        value_type=number_list(*PHI_RANGE, "A:B:M|LIST", "; disks jam near 0.84", even=True),
    )
    seeds: Sequence[int] = parameter(
        help="a sample at each packing fraction for each seed, both ends included", value_type=SEEDS
    )
    sizes: str = parameter(SIZES[0], "half of each radius 1:1.4, or all alike", choices=SIZES)
    potential: str = parameter("harmonic", "energy of an overlap", choices=EXPONENTS)
    tolerance: float = parameter(1e-6, "max|F|/(p d) of a minimum", low=1e-13, high=1e-2, metavar="T")
    protocol: str = parameter("random", "how samples are made", choices=PROTOCOLS)
    separated: bool = parameter(False, "large disks start on one side of the cell, small on the other")
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
        """Refuse options of other protocols and too many samples."""
        if self.count > MAX_SAMPLES:
            raise InputError(f"{self.count} samples: at most {MAX_SAMPLES} in one result")

    @property
    def made_protocol(self):
        """The `flows.jamming.Protocol` of the samples."""
        from jampetsc.flows.jamming import Protocol

        names = ("step", "strain", "discard", "every", "temperature", "cooling_rate", "sweeps")
        options = {name: getattr(self, name) for name in names}
        return Protocol.of(self.protocol, separated=self.separated, **options)

    @property
    def count(self) -> int:
        """Samples in all."""
        return len(self.phi) * len(self.seeds) * self.made_protocol.rows

    def work(self, to):
        from jampetsc.commands.samples import make
        from jampetsc.petsc.hessian_solver import HessianSolver

        return _summary(self.n, make(self, HessianSolver(), to), to)


def _summary(n, record, to) -> str:
    """A line for every φ."""
    from jampetsc.commands.samples import notes_of

    columns = {name: record.series(name) for name in record.columns}
    lines = [f"{to}: {len(record)} samples of {n} disks"]
    for one in at_densities(columns):
        if one.jammed is None:
            lines.append(f"  phi = {one.phi:.6g}: no minimum found")
            continue
        mean = f", p of the jammed {one.pressure:.4g}" if np.isfinite(one.pressure) else ""
        others = "".join(f", {name} {value:.5g} ± {error:.2g}" for name, (value, error) in one.means.items())
        lines.append(
            f"  phi = {one.phi:.6g}: jammed {one.jammed.value:.3f} ± {one.jammed.error:.2g} (as of "
            f"{one.jammed.independent:.0f} independent samples){mean}{others}"
        )
    return "\n".join(lines + note_lines(notes_of(record)))
