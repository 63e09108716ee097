"""Packings at a pressure or a packing fraction, one or an ensemble."""

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
from jampetsc.minimise.sizes import MAX_DISKS, MIN_DISKS, OTHER_SIZES, SIZES, Radii, radii_asked, sizes_text
from jampetsc.options.job import Job
from jampetsc.options.parameters import ValueType, format_value, optional_parameter, parameter
from jampetsc.options.task_inputs import NO_FILE, TaskInputs
from jampetsc.options.values import MAX_SEED, MAX_THREADS, PACKING, RADII, SEEDS, split_list
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import EXPONENTS, STIFFNESSES, Potential
from jampetsc.petsc import session

PRESSURES = (1e-8, 1.0)
PHIS = (0.8, 1.5)
TOLERANCES = (1e-13, 1e-4)
WHAT, HOW = "what", "from where, and how"
packing_parameter = partial(optional_parameter, group=WHAT)
making_parameter = partial(optional_parameter, group=HOW)
ONE_OF = (("pressure", "phi"), ("seed", "seeds", "from_"))  # of each at most one is given
OF_DISKS = ("potential", "stiffness", "sizes", "radii")  # what a packing to start from has already


def _pressures(given):
    """A pressure as the user wrote it, since it becomes part of file names; several as a tuple."""
    written, found = isinstance(given, str), []
    for one in split_list(given):
        try:
            value = as_float(one)
        except (TypeError, ValueError):
            raise ValueError("must be a number, or several with commas between") from None
        found.append(one if written else repr(value))
        if not PRESSURES[0] <= value <= PRESSURES[1]:
            raise ValueError(f"{format_value(one)} must lie in [{PRESSURES[0]:g}, {PRESSURES[1]:g}]")
    if not found:
        raise ValueError("must be at least one number")
    several = len(found) > 1 or isinstance(given, list | tuple) or getattr(given, "ndim", 0)
    return tuple(found) if several else found[0]


@dataclass(frozen=True, eq=False)
class Pack(Job):
    """Make a packing, or an ensemble.

    A packing of soft disks at rest: a minimum of the enthalpy at a given pressure, or of the energy at a given packing
    fraction. A list of pressures or seeds gives a list of packings: for each seed, the pressures in the given order,
    each from random disks, or with `ladder` from the packing at the pressure before it.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(NO_FILE, one_rank=True)
    FORMAT: ClassVar = "jampetsc-packing"
    OUT_HELP: ClassVar = "packing file; {seed} and {pressure} are replaced"
    GIVES: ClassVar = "a Packing, or a list of them"
    EPILOG: ClassVar = """examples:
  jampetsc pack --n 1024 --pressure 1e-3 --seed 1 --out p1e-3.h5
  jampetsc pack --pressure 1e-4 --from p1e-3.h5 --out p1e-4.h5
  jampetsc pack --n 1024 --phi 0.86 --seed 1 --stabilise shear --out start.h5   # for `jampetsc shear`: sigma(0) = 0
  mpirun -n 4 jampetsc pack --n 1024 --pressure 1e-2,1e-3 --seeds 1:20 --out "p{pressure}-{seed}.h5"
  jampetsc pack --n 1024 --pressure 1e-3,1e-4 --ladder --seeds 1:20 --out "down-{pressure}-{seed}.h5"

One packing is made by one rank with several threads; several packings are shared among the ranks.

The same seed gives the same packing to the last bit on any number of threads and ranks and on every x86 processor with
AVX2 and FMA (x86-64-v3: Intel since 2013, AMD since 2017), with one version of jampetsc and of its libraries.
Above 32768 disks, and with options -newton_, last digits depend on BLAS; the minimum reached may then be another one.
On other processors (arm64), and with JAMPETSC_CPU=native in the environment, a seed gives another packing of the same
ensemble. The attribute instruction_set of the file says which processors it was compiled for.

Options of the Newton steps have the prefix -newton_, e.g. -newton_pc_factor_mat_solver_type mumps."""

    SOLVERS: ClassVar = ("newton_",)

    n: int | None = packing_parameter("number of disks", low=MIN_DISKS, high=MAX_DISKS)
    pressure: float | Sequence[float] | None = packing_parameter(
        "pressure p = Σ f r / (2V)",
        value_type=ValueType(
            _pressures,
            lambda pressures: pressures if isinstance(pressures, str) else ",".join(pressures),
            python="number or numbers",
        ),
        unit="k",
        metavar="P[,P…]",
    )
    phi: float | None = packing_parameter(
        "packing fraction, instead of a pressure; disks jam near 0.84",
        low=PHIS[0],
        high=PHIS[1],
        remedy="Give a pressure instead, or a packing fraction above jamming; `jampetsc flow` shears disks below it",
    )
    potential: str | None = packing_parameter("energy of an overlap (default harmonic)", choices=EXPONENTS)
    stiffness: str | None = packing_parameter(
        "convention of the contact stiffness (default constant)", choices=STIFFNESSES
    )
    sizes: str | None = packing_parameter(
        "disk sizes: bidisperse (50:50, ratio 1.4; default) or monodisperse",
        choices=SIZES,
        remedy=OTHER_SIZES,
    )
    radii: Radii | None = packing_parameter(
        "text file of radii, one per disk, or an array, instead of n and sizes", value_type=RADII
    )
    stabilise: str = parameter(
        "volume",
        "shear: the shape of the cell also relaxes, at the given p or φ, so that σ_xy = 0 and G₀ > 0",
        choices=("volume", "shear"),
        group=WHAT,
    )
    tolerance: float = parameter(
        1e-10, "max|F|/(p d) and |Δp|/p", low=TOLERANCES[0], high=TOLERANCES[1], metavar="T", group=WHAT
    )
    seed: int | None = making_parameter("of the random start (default 1)", low=0, high=MAX_SEED, metavar="S")
    seeds: Sequence[int] | None = making_parameter(
        "a packing for each seed, both ends included", value_type=SEEDS
    )
    from_: Packing | None = making_parameter("packing to start from, in its cell", value_type=PACKING)
    ladder: bool = parameter(
        False, "each pressure starts from the packing at the one before it, not from random disks", group=HOW
    )
    threads: int | None = making_parameter(
        "threads of a rank (default: its share of the cores of the node)",
        low=1,
        high=MAX_THREADS,
        metavar="T",
    )

    def check(self):
        for names in ONE_OF:
            given = [named(name) for name in names if getattr(self, name) is not None]
            if len(given) > 1:
                raise InputError(f"{given[1]}: not together with {given[0]}; leave one out")
        if self.pressure is None and self.phi is None:
            raise InputError(f"{named('pressure')} is missing: give it, or {named('phi')}")
        if self.ladder and self.pressure is None:
            raise InputError(f"{named('ladder')}: needs {named('pressure')}")
        if self.from_ is None:
            radii_asked(self.n, self.sizes, self.radii)
            return
        for name in OF_DISKS:
            if getattr(self, name) is not None:
                source = PACKING.serialise(self.from_)
                raise InputError(f"{named(name)}: belongs to the packing {source}; leave it out")

    @property
    def several(self) -> bool:
        """Whether the job makes a list of packings."""
        return isinstance(self.pressure, tuple) or self.seeds is not None

    def rung(self, above) -> "Pack":
        """The job that makes the same packing from the one at the pressure above it in a ladder."""
        return replace(self, **dict.fromkeys(("n", "seed", *OF_DISKS)), from_=above, ladder=False)

    def tasks(self, out, k=1.0) -> list:
        """Packings to make, each a `PackingTask`; out: their files, None in memory; k: of the packing to start from.

        Raises InputError for an `out` that gives several of them one name.
        """
        from jampetsc.commands.packings import PackingTask
        from jampetsc.minimise.protocols import Target

        if self.pressure is None:
            targets = {"": Target(phi=self.phi, **self._how)}
        else:
            pressures = self.pressure if isinstance(self.pressure, tuple) else (self.pressure,)
            targets = {word: Target(k * float(word), **self._how) for word in pressures}
        seeds = [None] if self.from_ is not None else self.seeds or [1 if self.seed is None else self.seed]
        if out is not None:
            self._check_name(out, {"{seed}": len(seeds), "{pressure}": len(targets)})
        found = []
        for seed in seeds:
            for step, (word, target) in enumerate(targets.items()):
                path = job = None
                rung = step if self.ladder else 0
                if out is not None:
                    path = Path(out.replace("{seed}", str(seed)).replace("{pressure}", word))
                    job = self._alone(word, seed, found[-1].path if rung else None)
                found.append(PackingTask(path, None if rung else seed, target, rung, job))
        return found

    def _alone(self, pressure, seed, above) -> "Pack":
        """The job that makes one of the packings, the same one for every way to request it; above: of a ladder."""
        one = replace(
            self, pressure=float(pressure) if pressure else None, seeds=None, seed=seed, ladder=False
        )
        if above is not None:
            return one.rung(above)
        if self.from_ is not None:  # whose disks it has
            return replace(one, n=None)
        defaults = {"potential": "harmonic", "stiffness": "constant"} | (
            {} if self.radii else {"sizes": SIZES[0]}
        )
        return replace(one, **{name: getattr(one, name) or usual for name, usual in defaults.items()})

    def _check_name(self, out, counts):
        """Raise InputError for a name that is the same for several packings, or has braces that mean nothing."""
        for field, count in counts.items():
            if count > 1 and field not in out:
                raise InputError(f"{named('out')} {out}: one name for {count} packings: put {field} into it")
        meaningless = {
            "{seed}": "from_" if self.from_ is not None else "",
            "{pressure}": "phi" if self.pressure is None else "",
        }
        for field in re.findall(r"\{[^{}]*\}?|\}", out):
            if field not in meaningless:
                raise InputError(
                    f"{named('out')} {out}: {field} stands for nothing: only {{seed}} and {{pressure}} do"
                )
            if meaningless[field]:
                raise InputError(
                    f"{named('out')} {out}: {field} has no meaning with {named(meaningless[field])}"
                )

    def check_outputs(self, to):
        """Refuse outputs that may not be replaced, and a file to start from that is not a packing."""
        if isinstance(self.from_, str):
            check_packing(self.from_)
        for task in [] if to.path is None else self.tasks(str(to.path)):
            check_output(
                task.path, self.FORMAT, self.paths
            )  # its settings are compared by `PackingTask.is_finished`

    def kept(self, to):
        """See `Job`; packings that are finished stay."""
        if to.path is None or not self.several:
            return super().kept(to)
        there = [task.path.exists() for task in self.tasks(str(to.path))]
        return f"{sum(there)} of {len(there)} packings are finished. The same command continues."

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
        begin = self._begin(comm)
        tasks = self.tasks(None if to.path is None else str(to.path), begin.k)
        found = {}

        def beginning(i):
            if not tasks[i].rung:
                return begin
            return start_from_packing(tasks[i - 1].path or found[i - 1][0], self._how)

        def missing(numbers):
            return [i for i in numbers if overwrite or not tasks[i].is_finished()]

        for rung in range(1 + max(task.rung for task in tasks)):
            numbers = [i for i, task in enumerate(tasks) if task.rung == rung]
            lost = {
                i: ConvergenceError(f"{tasks[i - 1].name}, which it starts from, failed")
                for i in numbers
                if rung and isinstance(found.get(i - 1), JampetscError)
            }
            left = on_root(comm, partial(missing, [i for i in numbers if i not in lost]))
            mine = left[running.rank :: running.size]
            team = Team(self.threads or own_cores(comm, bool(mine)))
            made = make_packings([(i, tasks[i], beginning(i)) for i in mine], team, running.rank)
            found |= lost | dict(pair for some in comm.allgather(made) for pair in some.items())
        found = dict(sorted(found.items()))
        failures = {i: one for i, one in found.items() if isinstance(one, JampetscError)}
        if failures:
            raise_failures(failures, tasks)
        if to.path is None:
            made = [disks for disks, _ in found.values()]
            to.packings(made if self.several else made[0])
        elif self.several:
            to.packings([task.path for task in tasks])
        return summarise_packings(tasks, {i: line for i, (_, line) in found.items()}, running.size)

    @property
    def _how(self):
        """Entries of the records of all packings."""
        return {"stabilise": self.stabilise, "tolerance": self.tolerance}

    def _begin(self, comm):
        """What packings start from, a `packings.PackingStart`, but for the later ones of a ladder. Collective."""
        from jampetsc.commands.packings import start_at_random, start_from_packing

        if self.from_ is None:  # of one rank for all: the file may have been replaced
            radii = comm.bcast(radii_asked(self.n, self.sizes, self.radii))
            potential = Potential(self.potential or "harmonic", self.stiffness or "constant")
            settings = {"sizes": sizes_text(self.sizes, self.radii), "requested_n": self.n or 0}
            return start_at_random(radii, potential, self._how | settings)
        begin, name = start_from_packing(self.from_, self._how, comm), source_name(self.from_)
        with about(name):
            n = begin.disks_of(self.tasks(None)[0]).n
        if self.n not in (None, n):
            raise InputError(
                f"{named('n')} {self.n}: {name} has {n} disks; leave it out with {named('from_')}"
            )
        return begin
