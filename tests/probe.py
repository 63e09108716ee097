"""A command of the tests, to see how the command line treats errors: python tests/probe.py probe FILE …"""

import functools
import itertools
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from jampetsc.options.job import Job
from jampetsc.options.parameters import FILE, parameter


@dataclass(frozen=True)
class Probe(Job):
    """Do what the tests ask for."""

    FORMAT: ClassVar = "no file"
    OUT: ClassVar = ""
    SOLVERS: ClassVar = ("probe_",)

    file: str = parameter(help="what the deed is done to", place=FILE)
    do: str = parameter("nothing", "name of the deed")
    on_rank: int | None = parameter(None, "the only rank that does it (default: all)")
    scalar_: str | None = parameter(None, "start PETSc with these scalars", choices=("real", "complex"))

    @property
    def scalar(self):
        """As it was asked for."""
        return self.scalar_

    def work(self, to):
        """Do the deed."""
        from jampetsc.petsc import session

        running = session.current() if self.scalar else None
        rank = running.rank if running else 0
        if running and running.petsc_argv:
            solve(running)
        if self.on_rank in (None, rank):
            globals()[self.do](self)
        if running:
            running.comm.Barrier()  # where the others wait when one rank fails
        print(f"done on {rank}")


def solve(running):
    """A diagonal system, with options prefix probe_ and defaults of its own."""
    running.set_defaults({"probe_ksp_type": "preonly", "probe_pc_type": "jacobi"})
    matrix = running.PETSc.Mat().createAIJ(6, nnz=1, comm=running.comm)
    for row in range(*matrix.getOwnershipRange()):
        matrix.setValue(row, row, 2)
    matrix.assemble()
    ksp = running.PETSc.KSP().create(running.comm)
    ksp.setOptionsPrefix("probe_")
    ksp.setOperators(matrix)
    ksp.setFromOptions()
    ksp.setUp()
    if running.rank == 0:
        print("types", ksp.type, ksp.pc.type)


def nothing(args):
    pass


def progress(args):
    from jampetsc.progress import Progress

    with Progress(1, "work") as bar:
        bar.note("a note")
        bar.step("a step")


def open_file(args):
    if os.open(os.devnull, os.O_RDONLY) <= 2:
        raise AssertionError("what a library prints would go into this file")


def make(args):
    Path(args.file).touch()


def input_error(args):
    from jampetsc.errors import InputError

    raise InputError(f"{args.file}: radius -1: must be positive")


def bug(args):
    raise ZeroDivisionError("a bug")


def be_deaf(args):
    from jampetsc.petsc.session import current

    Path(f"{args.file}{current().rank}").write_text(str(os.getpid()))
    # minutes inside one instruction, where no handler of python runs, and first a word from there
    sum(itertools.chain(map(functools.partial(os.write, 1), [b"waiting\n"]), range(10**10)))


def talk(args):
    for _ in range(100000):
        print("a line that fills the pipe")


if __name__ == "__main__":
    from jampetsc import commands
    from jampetsc import main as cli
    from jampetsc.petsc import solver_options

    solver_options.SOLVERS["probe_"] = "ksp pc"
    commands.JOBS.clear()
    commands.JOBS["probe"] = "probe:Probe"
    sys.modules["jampetsc.commands.probe"] = sys.modules["__main__"]
    sys.exit(cli.main())
