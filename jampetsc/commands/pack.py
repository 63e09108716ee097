"""Packings at a pressure or a packing fraction, one or an ensemble."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import ClassVar

from jampetsc.collective import on_root, own_cores
from jampetsc.errors import ConvergenceError, InputError, JampetscError, about, as_float, named
from jampetsc.io.outputs import check_output
from jampetsc.io.packing_file import check_packing, source_name
from jampetsc.minimisation.size_laws import DEFAULT_SIZES, SIZES_HELP
from jampetsc.minimisation.sizes import MAX_DISKS, MIN_DISKS, Radii, radii_asked, sizes_text
from jampetsc.options.job import NO_FILE, Job, TaskInputs
from jampetsc.options.parameters import ValueType, format_value, optional_parameter, parameter
from jampetsc.options.values import (
    MAX_SEED,
    MAX_THREADS,
    PACKING,
    RADII,
    SEEDS,
    SIZES,
    STRESS_UNIT,
    split_list,
)
from jampetsc.packing.packing import MINIMISED_PHIS, PARTICLES, Packing
from jampetsc.packing.potentials import EXPONENTS, STIFFNESSES, Potential
from jampetsc.packing.units import stress_unit_of
from jampetsc.petsc import session

PRESSURES = (1e-8, 1.0)  # over `stress_unit_of` the particles
TOLERANCES = (1e-13, 1e-4)
ROUNDING = 1e-12  # relative, of limits in other units
PHI_REMEDY = (
    "Give a pressure instead, or a packing fraction above jamming; `jampetsc flow` shears particles below it."
)
WHAT, HOW = "packing", "start and run"
packing_parameter = partial(optional_parameter, group=WHAT)
making_parameter = partial(optional_parameter, group=HOW)
ALTERNATIVES = (("pressure", "phi"), ("seed", "seeds", "from_"))  # at most one of each is allowed
DISK_PARAMETERS = (
    "dimension",
    "potential",
    "stiffness",
    "sizes",
    "radii",
)  # fixed by a packing to start from


def _pressures(value):
    """A pressure as the user wrote it, as it becomes part of file names; several as a tuple."""
    is_text, texts = isinstance(value, str), []
    for item in split_list(value):
        try:
            number = as_float(item)
        except (TypeError, ValueError):
            raise ValueError("must be a number, or several separated by commas") from None
        texts.append(item if is_text else repr(number))
        if not 0.0 < number < math.inf:
            raise ValueError(f"{format_value(item)} must be positive and finite")
    if not texts:
        raise ValueError("must be at least one number")
    several = len(texts) > 1 or isinstance(value, list | tuple) or getattr(value, "ndim", 0)
    return tuple(texts) if several else texts[0]


@dataclass(frozen=True, eq=False)
class Pack(Job):
    """Make a packing, or an ensemble.

    A packing of soft disks or spheres at rest: a minimum of the enthalpy at a given pressure, or of the energy at a
    given packing fraction. A list of pressures or seeds gives a list of packings: for each seed, the pressures in the
    given order, each from random disks, or with `ladder` from the packing at the preceding pressure.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(NO_FILE, one_rank=True)
    FORMAT: ClassVar = "jampetsc-packing"
    OUT_HELP: ClassVar = "packing file; {seed} and {pressure} in its name are replaced by their values"
    GIVES: ClassVar = "a Packing, or a list of them"
    EPILOG: ClassVar = """examples:
  jampetsc pack --n 1024 --pressure 1e-3 --seed 1 --out p1e-3.h5
  jampetsc pack --pressure 1e-4 --from p1e-3.h5 --out p1e-4.h5
  jampetsc pack --n 1024 --phi 0.86 --seed 1 --stabilise shear --out start.h5   # for `jampetsc shear`: sigma(0) = 0
  jampetsc pack --dimension 3 --n 1024 --pressure 1e-3 --out spheres.h5
  mpirun -n 4 jampetsc pack --n 1024 --pressure 1e-2,1e-3 --seeds 1:20 --out "p{pressure}-{seed}.h5"
  jampetsc pack --n 1024 --pressure 1e-3,1e-4 --ladder --seeds 1:20 --out "down-{pressure}-{seed}.h5"

One rank makes one packing, on several threads; several packings are shared among the ranks.

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
    pressure: float | Sequence[float] | None = packing_parameter(
        "pressure p = Σ f r / (D V)",
        value_type=ValueType(
            _pressures,
            lambda pressures: pressures if isinstance(pressures, str) else ",".join(pressures),
            python="number or numbers",
        ),
        unit=STRESS_UNIT,
        metavar="P[,P…]",
    )
    phi: float | None = packing_parameter(
        "packing fraction, instead of a pressure, of disks from 0.8 to 1.5, of spheres from 0.6 to 1.2 (they jam near "
        "0.84 and 0.64)",
        above=0.0,
    )
    potential: str | None = packing_parameter("energy of an overlap (default harmonic)", choices=EXPONENTS)
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
        "seed of the random start (default 1)", low=0, high=MAX_SEED, metavar="S"
    )
    seeds: Sequence[int] | None = making_parameter(
        "seeds of several packings, both ends included", value_type=SEEDS
    )
    from_: Packing | None = making_parameter("packing to start from, with its cell", value_type=PACKING)
    ladder: bool = parameter(
        False, "start each pressure from the packing at the preceding one, not from a random start", group=HOW
    )
    threads: int | None = making_parameter(
        "threads of a rank (default: its share of the cores of the node)",
        low=1,
        high=MAX_THREADS,
        metavar="T",
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
        if self.ladder and self.pressure is None:
            raise InputError(f"{named('ladder')}: a ladder without pressures. Give {named('pressure')}.")
        if self.from_ is None:
            radii = radii_asked(self.n, self.sizes, self.radii)
            self._check_phi(self.dimension or 2)
            self._check_pressures(stress_unit_of(radii, self._law, self.dimension or 2))
            return
        for name in DISK_PARAMETERS:
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

    @property
    def _pressure_words(self) -> tuple:
        """Words of the pressures."""
        return (
            self.pressure if isinstance(self.pressure, tuple) else (self.pressure,) if self.pressure else ()
        )

    def _check_pressures(self, unit):
        """Refuse pressures out of range for particles whose stress of order one is `unit`."""
        low, high = (end * unit for end in PRESSURES)
        for word in self._pressure_words:
            if not low * (1.0 - ROUNDING) <= float(word) <= high * (1.0 + ROUNDING):
                raise InputError(f"{named('pressure')} {word}: must lie in [{low:.6g}, {high:.6g}]")

    @property
    def _law(self):
        """The potential of random particles."""
        return Potential(self.potential or "harmonic", self.stiffness or "constant")

    @property
    def several(self) -> bool:
        """Whether the job makes a list of packings."""
        return isinstance(self.pressure, tuple) or self.seeds is not None

    def rung(self, above) -> "Pack":
        """The job that makes the same packing from the one at the pressure above it in a ladder."""
        return replace(self, **dict.fromkeys(("n", "seed", *DISK_PARAMETERS)), from_=above, ladder=False)

    def tasks(self, out) -> list:
        """Packings to make, each a `PackingTask`; out: their files, None in memory.

        Raises InputError for an `out` that gives several of them one name.
        """
        from jampetsc.commands.packings import PackingTask
        from jampetsc.minimisation.protocols import Target

        if self.pressure is None:
            targets = {"": Target(phi=self.phi, **self._how)}
        else:
            targets = {word: Target(float(word), **self._how) for word in self._pressure_words}
        seeds = [None] if self.from_ is not None else self.seeds or [1 if self.seed is None else self.seed]
        if out is not None:
            self._check_name(out, {"{seed}": len(seeds), "{pressure}": len(targets)})
        tasks = []
        for seed in seeds:
            for step, (word, target) in enumerate(targets.items()):
                path = job = None
                rung = step if self.ladder else 0
                if out is not None:
                    path = Path(out.replace("{seed}", str(seed)).replace("{pressure}", word))
                    job = self._alone(word, seed, tasks[-1].path if rung else None)
                tasks.append(PackingTask(path, None if rung else seed, target, rung, job))
        return tasks

    def _alone(self, pressure, seed, above) -> "Pack":
        """The job that makes one of the packings, the same one for every way to request it; above: of a ladder."""
        single = replace(
            self, pressure=float(pressure) if pressure else None, seeds=None, seed=seed, ladder=False
        )
        if above is not None:
            return single.rung(above)
        if self.from_ is not None:  # whose disks it has
            return replace(single, n=None)
        if single.dimension == 2:  # the default, which files of disks do not record
            single = replace(single, dimension=None)
        defaults = {"potential": "harmonic", "stiffness": "constant"} | (
            {} if self.radii else {"sizes": DEFAULT_SIZES}
        )
        return replace(single, **{name: getattr(single, name) or value for name, value in defaults.items()})

    def _check_name(self, out, counts):
        """Raise InputError for a name that is the same for several packings, or has braces that mean nothing."""
        for field, count in counts.items():
            if count > 1 and field not in out:
                raise InputError(f"{named('out')} {out}: one name for {count} packings. Put {field} into it.")
        meaningless = {
            "{seed}": "from_" if self.from_ is not None else "",
            "{pressure}": "phi" if self.pressure is None else "",
        }
        for field in re.findall(r"\{[^{}]*\}?|\}", out):
            if field not in meaningless:
                raise InputError(
                    f"{named('out')} {out}: unknown field {field}. Use {{seed}} and {{pressure}} only."
                )
            if meaningless[field]:
                raise InputError(
                    f"{named('out')} {out}: {field} is not defined with {named(meaningless[field])}. Leave it out."
                )

    def check_outputs(self, to):
        """Refuse outputs that may not be replaced, and a file to start from that is not a packing."""
        if isinstance(self.from_, str):
            check_packing(self.from_)
        for task in [] if to.path is None else self.tasks(str(to.path)):
            check_output(
                task.path, self.FORMAT, self.paths
            )  # its settings are compared by `PackingTask.is_finished`

    def kept_text(self, to):
        """See `Job`; packings that are finished stay."""
        if to.path is None or not self.several:
            return super().kept_text(to)
        finished = [task.path.exists() for task in self.tasks(str(to.path))]
        return f"{sum(finished)} of {len(finished)} packings are finished. The same command resumes."

    def work(self, to):
        """Make the packings that are missing, spread over the ranks. Collective."""
        from jampetsc.commands.packings import (
            make_packings,
            raise_failures,
            start_from_packing,
            summarise_packings,
        )
        from jampetsc.packing.threads import Team

        running = session.current()
        comm, overwrite = running.comm, to.request.overwrite
        start = self._begin(comm)
        tasks = self.tasks(None if to.path is None else str(to.path))
        outcomes = {}

        def beginning(i):
            if not tasks[i].rung:
                return start
            return start_from_packing(tasks[i - 1].path or outcomes[i - 1][0], self._how)

        def missing(numbers):
            return [i for i in numbers if overwrite or not tasks[i].is_finished()]

        for rung in range(1 + max(task.rung for task in tasks)):
            numbers = [i for i, task in enumerate(tasks) if task.rung == rung]
            blocked = {
                i: ConvergenceError(f"{tasks[i - 1].name}, from which it starts, failed")
                for i in numbers
                if rung and isinstance(outcomes.get(i - 1), JampetscError)
            }
            unfinished = on_root(comm, partial(missing, [i for i in numbers if i not in blocked]))
            own = unfinished[running.rank :: running.size]
            team = Team(self.threads or own_cores(comm, bool(own)))
            results = make_packings([(i, tasks[i], beginning(i)) for i in own], team, running.rank)
            outcomes |= blocked | dict(pair for rank in comm.allgather(results) for pair in rank.items())
        outcomes = dict(sorted(outcomes.items()))
        failures = {i: error for i, error in outcomes.items() if isinstance(error, JampetscError)}
        if failures:
            raise_failures(failures, tasks)
        if to.path is None:
            packings = [disks for disks, *_ in outcomes.values()]
            to.put_packings(packings if self.several else packings[0])
        elif self.several:
            to.put_packings([task.path for task in tasks])
        lines = {i: line for i, (_, line, _) in outcomes.items()}
        return summarise_packings(tasks, lines, running.size, [units for *_, units in outcomes.values()])

    @property
    def _how(self):
        """Entries of the records of all packings."""
        return {"stabilise": self.stabilise, "tolerance": self.tolerance}

    def _begin(self, comm):
        """What packings start from, a `packings.PackingStart`, but for the later ones of a ladder. Collective."""
        from jampetsc.commands.packings import start_at_random, start_from_packing

        if self.from_ is None:  # of one rank for all: the file may have been replaced
            radii = comm.bcast(radii_asked(self.n, self.sizes, self.radii))
            settings = {"sizes": sizes_text(self.sizes, self.radii), "requested_n": self.n or 0}
            record, keeps_order = self._how | settings, self.radii is not None
            return start_at_random(radii, self._law, record, self.dimension or 2, keeps_order)
        begin, name = start_from_packing(self.from_, self._how, comm), source_name(self.from_)
        with about(name):
            disks = begin.disks_of(self.tasks(None)[0])
            self._check_phi(disks.dimension)
            self._check_pressures(stress_unit_of(disks.radii, disks.potential, disks.dimension))
            n = disks.n
        if self.n not in (None, n):
            raise InputError(
                f"{named('n')} {self.n}: {name} has {n} particles. Leave it out with {named('from_')}."
            )
        return begin
