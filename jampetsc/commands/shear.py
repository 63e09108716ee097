"""Quasistatic shear."""

from dataclasses import dataclass
from typing import ClassVar

from jampetsc.errors import InputError, named
from jampetsc.options.parameters import parameter
from jampetsc.options.starts import ShearJob
from jampetsc.options.task_inputs import PACKING_OR_N, TaskInputs
from jampetsc.petsc import session

MAX_STEPS = 1e8  # steps of a run
FARTHEST = 1e4  # strain of a run


@dataclass(frozen=True, eq=False)
class Shear(ShearJob):
    """Quasistatic shear: affine step, minimise, repeat.

    Shears soft disks in small affine steps, each followed to the minimum of the energy (Vågberg, thesis sec. 4.7).
    """

    STUDY_INPUTS: ClassVar = TaskInputs(PACKING_OR_N, one_rank=True)
    EPILOG: ClassVar = """examples:
  jampetsc shear --n 64 --phi 0.845 --step 1e-3 --strain 8 --out qs.h5
  jampetsc shear p.h5 --step 1e-3 --strain 1 --out from-p.h5

A killed run continues when the same command is given again. Options of the Newton steps of its quenches have the
prefix -newton_."""
    SOLVERS: ClassVar = ("newton_",)

    step: float = parameter(help="strain of one step", above=0.0, high=0.1, metavar="DG")
    strain: float = parameter(help="how far to shear", above=0.0, high=FARTHEST, metavar="S")
    tolerance: float = parameter(
        1e-6, "max|F|/(p d) of a minimum", low=1e-13, high=1e-2, metavar="T", group="run"
    )

    def check(self):
        super().check()
        if self.strain < self.step:
            raise InputError(
                f"{named('strain')} {self.strain:g}: must lie in [{named('step')}, {FARTHEST:g}]"
            )
        if self.strain / self.step > MAX_STEPS:
            raise InputError(
                f"{named('step')} {self.step:g}: {self.strain / self.step:.2g} steps, at most {MAX_STEPS:.0e}: give a "
                "larger one"
            )

    def protocol(self, attributes):
        return f"quasistatic shear, steps of {attributes['step']:g}"

    def work(self, to):
        from jampetsc.commands.shear_run import execute
        from jampetsc.petsc.hessian_solver import HessianSolver

        size = session.current().size
        if size > 1:
            raise InputError(f"shear on {size} ranks: one run is one process; a study runs many")
        return execute(self, HessianSolver(), to)
