"""A packing at a pressure or a packing fraction."""

import time
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from jampetsc.collective import on_root, own_cores
from jampetsc.errors import InputError, about, named
from jampetsc.io.packing_file import check_packing, source_name
from jampetsc.minimisation.size_laws import DEFAULT_SIZES, SIZES_HELP
from jampetsc.minimisation.sizes import MAX_DISKS, MIN_DISKS, Radii, radii_asked, sizes_text
from jampetsc.options.job import NO_FILE, Job, TaskInputs
from jampetsc.options.parameters import optional_parameter, parameter
from jampetsc.options.potential_options import EXPONENT, potential_identity
from jampetsc.options.values import MAX_SEED, MAX_THREADS, PACKING, RADII, SIZES, STRESS_UNIT
from jampetsc.packing.packing import MINIMISED_PHIS, PARTICLES, Packing
from jampetsc.packing.potentials import DEFAULT_POTENTIAL, EXPONENTS, STIFFNESSES, Potential
from jampetsc.packing.units import is_within, stress_unit_of
from jampetsc.petsc import session

PRESSURES = (1e-8, 1.0)  # over `stress_unit_of` the particles, see `pressure_range`
TOLERANCES = (1e-13, 1e-4)
PHI_REMEDY = (
    "Give a pressure instead, or a packing fraction above jamming; `jampetsc flow` shears particles below it."
)
ENSEMBLE = "Give a list of them in the table [pack] of a `jampetsc study`, which makes all packings."
WHAT, HOW = "packing", "start and run"
packing_parameter = partial(optional_parameter, group=WHAT)
making_parameter = partial(optional_parameter, group=HOW)
ALTERNATIVES = (("pressure", "phi"), ("seed", "from_"))  # at most one of each is allowed
PARTICLE_PARAMETERS = (
    "n",
    "dimension",
    "potential",
    "exponent",
    "stiffness",
    "sizes",
    "radii",
)  # fixed by a packing to start from


def pressure_range(radii, potential: Potential, dimension: int) -> tuple[float, float]:
    """Lowest and highest pressure of packings of these radii (N,)."""
    low, high = PRESSURES
    unit = stress_unit_of(radii, potential, dimension)
    return potential.force_limit(low) * unit, high * unit


@dataclass(frozen=True, eq=False)
class Pack(Job):
    """Make a packing.

    A packing of soft disks or spheres at rest: a minimum of the enthalpy at a given pressure, or of the energy at a
    given packing fraction, from random particles or from another packing. `study` makes ensembles of them.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(NO_FILE, one_rank=True)
    FORMAT: ClassVar = "jampetsc-packing"
    OUT_HELP: ClassVar = "packing file"
    EPILOG: ClassVar = """examples:
  jampetsc pack --n 1024 --pressure 1e-3 --seed 1 --out p1e-3.h5
  jampetsc pack --pressure 1e-4 --from p1e-3.h5 --out p1e-4.h5
  jampetsc pack --n 1024 --phi 0.86 --seed 1 --stabilise shear --out start.h5   # for `jampetsc shear`: sigma(0) = 0
  jampetsc pack --dimension 3 --n 1024 --pressure 1e-3 --out spheres.h5

One rank makes the packing, on several threads. `mpirun -n 4 jampetsc study STUDY.toml --out FOLDER` makes many, one
on each rank at a time, where STUDY.toml holds for instance

  [pack]
  n = 1024
  pressure = [1e-2, 1e-3]
  seeds = "1:20"

The same seed gives the same packing to the last bit on any number of threads and ranks and on every x86 processor with
AVX2 and FMA (x86-64-v3: Intel since 2013, AMD since 2017), with one version of jampetsc and of its libraries.
Above 32768 disks or 1024 spheres, and with options -newton_, last digits depend on BLAS, and another minimum may be
reached.
On other processors (arm64), and with JAMPETSC_CPU=native in the environment, a seed gives another packing of the same
ensemble. The attribute instruction_set of the file says which processors it was compiled for.

Options of the Newton steps have the prefix -newton_, e.g. -newton_pc_factor_mat_solver_type mumps."""

    SOLVERS: ClassVar = ("newton_",)

    n: int | None = packing_parameter("number of particles", low=MIN_DISKS, high=MAX_DISKS)
    dimension: int | None = packing_parameter("2: disks (default), 3: spheres", low=2, high=3, metavar="D")
    pressure: float | None = packing_parameter(
        "pressure p = Σ f r / (D V)", above=0.0, unit=STRESS_UNIT, metavar="P", several=ENSEMBLE
    )
    phi: float | None = packing_parameter(
        "packing fraction, instead of a pressure, of disks from 0.8 to 1.5, of spheres from 0.6 to 1.2 (they jam near "
        "0.84 and 0.64)",
        above=0.0,
    )
    potential: str | None = packing_parameter(
        f"energy of an overlap (default {DEFAULT_POTENTIAL})", choices=EXPONENTS
    )
    exponent: float | None = packing_parameter(**EXPONENT)
    stiffness: str | None = packing_parameter(
        "convention of the contact stiffness (default constant)", choices=STIFFNESSES
    )
    sizes: str | None = packing_parameter(f"{SIZES_HELP} (default {DEFAULT_SIZES})", value_type=SIZES)
    radii: Radii | None = packing_parameter(
        "text file of radii, line i that of particle i, or an array, instead of n and sizes", value_type=RADII
    )
    stabilise: str = parameter(
        "volume",
        "relaxed shape of the cell: volume alone, for a positive bulk modulus; shear as well, so that σ_xy = 0 (and "
        "σ_xz = σ_yz = 0), G₀ > 0; or all, so that σ_xx = σ_yy (= σ_zz) too and the moduli of all loads are positive",
        choices=("volume", "shear", "all"),
        group=WHAT,
    )
    tolerance: float = parameter(
        1e-10,
        "largest max|F|/(p d), in three dimensions max|F|/(p d²), and |Δp|/p of a packing",
        low=TOLERANCES[0],
        high=TOLERANCES[1],
        metavar="T",
        group=WHAT,
    )
    seed: int | None = making_parameter(
        "seed of the random start (default 1)", low=0, high=MAX_SEED, metavar="S", several=ENSEMBLE
    )
    from_: Packing | None = making_parameter("packing to start from, with its cell", value_type=PACKING)
    threads: int | None = making_parameter(
        "threads of a rank (default: its share of the cores of the node)",
        low=1,
        high=MAX_THREADS,
        metavar="T",
        in_identity=False,
    )

    def check(self):
        for names in ALTERNATIVES:
            present = [named(name) for name in names if getattr(self, name) is not None]
            if len(present) > 1:
                raise InputError(f"{present[1]}, {present[0]}: both given. Give one of them.")
        if self.pressure is None and self.phi is None:
            raise InputError(
                f"{named('pressure')}, {named('phi')}: missing. Give one of them, e.g. {named('pressure')} 1e-3."
            )
        if self.from_ is None:
            radii = radii_asked(self.n, self.sizes, self.radii)
            self._check_phi(self.dimension or 2)
            self._check_pressure(radii, self._potential, self.dimension or 2)
            return
        for name in PARTICLE_PARAMETERS:
            if getattr(self, name) is not None:
                source = PACKING.serialise(self.from_)
                raise InputError(f"{named(name)}: fixed by the packing {source}. Leave it out.")

    def _check_phi(self, dimension):
        """Refuse a packing fraction out of the range of this dimension."""
        low, high = MINIMISED_PHIS[dimension]
        if self.phi is not None and not low <= self.phi <= high:
            remedy = PHI_REMEDY if self.phi < low else "Give a smaller one."
            raise InputError(
                f"{named('phi')} {self.phi:g}: must lie in [{low:g}, {high:g}] for {PARTICLES[dimension]}. {remedy}"
            )

    def _check_pressure(self, radii, potential, dimension):
        """Refuse a pressure out of range for these particles."""
        low, high = pressure_range(radii, potential, dimension)
        if self.pressure is not None and not is_within(self.pressure, low, high):
            raise InputError(f"{named('pressure')} {self.pressure:g}: must lie in [{low:.6g}, {high:.6g}]")

    @property
    def implied(self):
        """See `Job`."""
        if self.from_ is not None:
            return {}
        sizes = {} if self.radii is not None else {"sizes": DEFAULT_SIZES}
        return {
            "dimension": 2,
            "stiffness": STIFFNESSES[0],
            "seed": 1,
        } | sizes

    def identity(self):
        """See `Job`."""
        return super().identity() | ({} if self.from_ is not None else potential_identity(self._potential))

    @property
    def _potential(self):
        """The potential of random particles."""
        return Potential(
            self.potential or DEFAULT_POTENTIAL, self.stiffness or STIFFNESSES[0], exponent=self.exponent
        )

    def check_outputs(self, to):
        """See `Job`; also refuse a file to start from that is not a packing."""
        if isinstance(self.from_, str):
            check_packing(self.from_)
        super().check_outputs(to)

    def work(self, to):
        """Make the packing on rank 0. Collective."""
        from jampetsc.packing.threads import Team

        comm = session.current().comm
        threads = self.threads or own_cores(comm, comm.rank == 0)
        disks, summary = on_root(comm, lambda: self._make(to, Team(threads)))
        if to.path is None:
            to.put_packing(disks)
        idle = f"one rank makes a packing: {comm.size - 1} of {comm.size} ranks had nothing to do\n"
        return f"{idle if comm.size > 1 else ''}{summary}"

    def _make(self, to, team):
        """(the packing, None where it went to a file; the summary)."""
        from jampetsc.commands.packings import make_from, packing_line
        from jampetsc.commands.run_files import run_units

        start_time = time.perf_counter()
        disks = make_from(self._start(), self.target, team)
        if to.path is not None:
            to.put_packing(disks)
        lines = packing_line(to, disks, time.perf_counter() - start_time), run_units(disks)
        return (disks if to.path is None else None), "\n".join(lines)

    @property
    def target(self):
        """What the packing is to have, a `protocols.Target`."""
        from jampetsc.minimisation.protocols import Target

        return Target(self.pressure, self.phi, self.stabilise, self.tolerance)

    def _start(self):
        """What the packing starts from, a `packings.PackingStart`."""
        from jampetsc.commands.packings import start_at_random, start_from_packing

        how = {"stabilise": self.stabilise, "tolerance": self.tolerance}
        if self.from_ is None:
            radii, keeps_order = radii_asked(self.n, self.sizes, self.radii), self.radii is not None
            record = how | {"sizes": sizes_text(self.sizes, self.radii), "requested_n": self.n or 0}
            seed = 1 if self.seed is None else self.seed
            return start_at_random(
                radii, self._potential, self.target, seed, record, self.dimension or 2, keeps_order
            )
        with about(source_name(self.from_)):
            start = start_from_packing(self.from_, self.target, how)
            disks = start.disks
            self._check_phi(disks.dimension)
            self._check_pressure(disks.radii, disks.potential, disks.dimension)
        return start
