"""The commands as python functions: `jampetsc.sweep("p.h5", beta=0.1)` gives what `load` gives for the command's file.

    import jampetsc
    packing = jampetsc.pack(n=256, pressure=1e-3, seed=1, out="p.h5")
    sweep = jampetsc.sweep("p.h5", beta=1e-3, fields=[1e-3, 1.0])
    slow = jampetsc.quasistatic(packing, no_prestress=True)
    flow = jampetsc.flow(packing, model="CD0", rate=1e-3, strain=5)
    table = jampetsc.study("study.toml", out="folder")

Keywords are the long options with _ for -; from_, for --from, takes a packing as it is. True is a switch that is
given, a list is written with commas. PETSc is loaded by the first call that needs it. A command runs in this process,
under mpirun on all ranks together.
"""

import atexit
import contextlib
import difflib
import io
import itertools
import os
import shutil
import tempfile
from pathlib import Path

import numpy as np

from jampetsc import cli, session
from jampetsc.collective import by_rank_0
from jampetsc.commands import parsers_of
from jampetsc.contacts.disks import Disks
from jampetsc.contacts.laws import DEFAULT, Law, Physics, damping_law
from jampetsc.errors import InputError
from jampetsc.jobs.correlate import Correlate
from jampetsc.jobs.export import Export
from jampetsc.jobs.functions import function_of
from jampetsc.jobs.info import Info
from jampetsc.jobs.merge import Merge
from jampetsc.jobs.modes import Modes
from jampetsc.jobs.oscillate import Oscillate
from jampetsc.jobs.pack import Pack
from jampetsc.jobs.quasistatic import Quasistatic
from jampetsc.jobs.spectrum import Spectrum
from jampetsc.jobs.sweep import Sweep
from jampetsc.mechanics.matrices import Matrices, matrices_of
from jampetsc.storage.packing_file import read_packing, write_packing
from jampetsc.storage.provenance import recorded_as
from jampetsc.storage.reader import load
from jampetsc.storage.request import asked
from jampetsc.studies.kinds import KINDS

FUNCTIONS = (*KINDS, "collapse", "study")

pack, sweep, quasistatic, modes, oscillate, spectrum, correlate, export, merge, info = map(
    function_of,
    (Pack, Sweep, Quasistatic, Modes, Oscillate, Spectrum, Correlate, Export, Merge, Info),
)

_number = itertools.count(1)
_folder = None  # of files that were given no name; goes with the process


def run(command, *inputs, out=None, **options):
    """What `jampetsc command inputs… --out out` writes, loaded. Collective.

    command   one of FUNCTIONS: those that a study may have, collapse and study
    inputs    files, or what `load` and these functions have given: Disks or results
    out       where to keep the file; None: a temporary one, gone when this process ends
    options   the command's long options, see `jampetsc COMMAND --help`; from_ for --from. Files as `inputs`

    Raises InputError for an option or a value that the command refuses, ConvergenceError where it does not get there.
    """
    from jampetsc.studies.options import positional_of, words_of

    if command not in FUNCTIONS:
        raise InputError(f"{command}: no such function: there are {', '.join(FUNCTIONS)}")
    parser = parsers_of(cli.Parser, [command])[command]
    known = {
        option[2:].replace("-", "_"): action for action in parser._actions for option in action.option_strings
    }
    words, scratch = [], []
    for name, value in options.items():
        name = name.removesuffix("_")  # from_: what python has for itself
        if isinstance(value, Disks) or hasattr(value, "path"):
            written, value = isinstance(value, Disks), _file(value)
            scratch += [value] * written
        if name not in known or name == "help":
            near = difflib.get_close_matches(name, known, n=1)
            raise InputError(
                f"{command}: {name}: no such option{f'; did you mean {near[0]}?' if near else ''}"
            )
        if value is not None:
            words += words_of(known[name], _one(value))
    if inputs and positional_of(parser) is None:
        raise InputError(f"{command}: takes no file, but {len(inputs)} are given")
    files = [_file(one) for one in inputs]
    scratch += [name for one, name in zip(inputs, files, strict=True) if isinstance(one, Disks)]
    kept, out = out is not None, _temporary() if out is None else os.fspath(out)
    line = [*files, "--out", out, *words]
    args = parser.parse_args(line)
    with recorded_as(["jampetsc", command, *line]), asked(args), contextlib.redirect_stdout(io.StringIO()):
        if args.takes_petsc(args):
            args.run(args, [])
        else:
            by_rank_0(session.communicator(), lambda: args.run(args, []))
    found = load(out)
    if isinstance(found, Disks) and not kept:  # in memory; a result reads its file when it is asked
        scratch.append(out)
    comm = session.communicator()
    if comm is not None:
        comm.Barrier()
    if comm is None or comm.rank == 0:
        for name in scratch:
            Path(name).unlink(missing_ok=True)
    return found


def _one(value):
    """An option's value: a list or an array as the commands write it."""
    if isinstance(value, list | tuple | np.ndarray):
        return ",".join(
            repr(one) if isinstance(one, float) else str(one) for one in np.asarray(value).tolist()
        )
    return (
        value.item()
        if isinstance(value, np.generic)
        else os.fspath(value)
        if isinstance(value, Path)
        else value
    )


def _file(source):
    """Name of the file of an input."""
    if isinstance(source, Disks):
        path = _temporary()
        by_rank_0(session.communicator(), lambda: write_packing(path, source))
        return path
    return os.fspath(getattr(source, "path", source))


def _temporary():
    """A new name in a folder that goes with this process. Collective."""
    global _folder
    comm = session.communicator()
    if _folder is None or not Path(_folder).is_dir():
        _folder = by_rank_0(comm, lambda: tempfile.mkdtemp(prefix="jampetsc-"))
        if comm is None or comm.rank == 0:
            atexit.register(shutil.rmtree, _folder, ignore_errors=True)
    return os.path.join(_folder, f"{next(_number)}.h5")


def assemble(packing, law=DEFAULT, *, prestress=True, tau1=1.0, **options) -> Matrices:
    """K, B and the border of a packing; `.to_scipy()` has them on every rank. Collective.

    packing     its file, or Disks
    law         a family of damping laws, with its `options` (beta=0.1, rotations=False, …), or a `contacts.laws.Law`
    prestress   K keeps the f/r term of its contacts

    Raises InputError for a packing that is not rigid, and for a law that there is not.
    """
    comm = session.start("real").comm
    disks = packing if isinstance(packing, Disks) else read_packing(os.fspath(packing), comm)
    if not isinstance(law, Law):
        law = damping_law(law, tau1=tau1, **options)
    return matrices_of(disks, Physics(law, prestress), comm)


def flow(*start, out=None, **options):
    """Steady shear at a rate, see `run` and `jampetsc flow --help`; a Result. Collective.

    start   a packing or a flow to go on from; nothing where n and phi say what to make
    """
    return run("flow", *start, out=out, **options)


def shear(*start, out=None, **options):
    """Quasistatic shear, start as of `flow`, see `run` and `jampetsc shear --help`; a Result. Collective."""
    return run("shear", *start, out=out, **options)


def jam(*, out=None, **options):
    """Which of many packings jam, see `run` and `jampetsc jam --help`; a Result. Collective."""
    return run("jam", out=out, **options)


def collapse(*files, out=None, **options):
    """A scaling form fitted to flows, see `run` and `jampetsc collapse --help`; a Result. Collective."""
    return run("collapse", *files, out=out, **options)


def study(description, *, out, **options):
    """The table of a study, see `run` and `jampetsc study --help`; an Ensemble. Collective.

    description   file that says what to do (TOML)
    out           folder of all its files; what is there already is not done again

    A task that fails is a row of the table, not an error.
    """
    return run("study", description, out=out, **options)
