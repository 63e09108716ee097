"""A command of the tests, to see how the command line treats errors: python tests/probe.py probe FILE …"""

import functools
import itertools
import os
import sys
from pathlib import Path


def add_parser(subparsers):
    parser = subparsers.add_parser("probe", help="do what the tests ask for")
    parser.add_argument("file", metavar="FILE")
    parser.add_argument("--do", default="nothing", help="name of the deed")
    parser.add_argument("--on-rank", type=int, help="the only rank that does it (default: all)")
    parser.add_argument("--scalar", choices=["real", "complex"], help="start PETSc with these scalars")
    parser.set_defaults(run=run, takes_petsc=lambda args: args.scalar is not None)


def run(args, petsc_argv):
    from jampetsc import session

    rank = 0
    if args.scalar:
        running = session.start(args.scalar, petsc_argv)
        rank = running.rank
        if petsc_argv:
            solve(running)
    if args.on_rank in (None, rank):
        globals()[args.do](args)
    if args.scalar:
        running.comm.Barrier()  # where the others wait when one rank fails
    print(f"done on {rank}")
    return 0


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


def read(args):
    Path(args.file).read_text()


def read_hdf5(args):
    import h5py

    h5py.File(args.file)


def disk_full(args):
    with open("/dev/full", "w") as file:
        file.write("x")


def out_of_memory(args):
    raise MemoryError


def interrupt(args):
    raise KeyboardInterrupt


def be_deaf(args):
    from jampetsc.session import current

    Path(f"{args.file}{current().rank}").write_text(str(os.getpid()))
    # hours inside one instruction, where no handler of python runs, and first a word from there
    sum(itertools.chain(map(functools.partial(os.write, 1), [b"waiting\n"]), range(10**13)))


def talk(args):
    for _ in range(100000):
        print("a line that fills the pipe")


if __name__ == "__main__":
    from jampetsc import cli, commands, solver_options

    solver_options.SOLVERS["probe_"], solver_options.COMMANDS["probe"] = "ksp pc", ("probe_",)
    commands.COMMANDS.clear()
    commands.COMMANDS["probe"] = "probe"
    sys.exit(cli.main())
