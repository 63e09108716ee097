"""The command line: `--long` words are the program's, `-single_dash` words are PETSc's.

Finds the command's module, gives it its arguments, and turns an error into one line and an exit status:
1 unexpected or from the system, 2 bad input, 3 not converged, 130 interrupted, 141 nobody reads the output.
SIGTERM is the system's: what was finished is on disk at every moment. For Ctrl-C see `interrupts`.
"""

import argparse
import contextlib
import errno
import importlib
import os
import re
import shlex
import sys
import time

from jampetsc import progress, streams
from jampetsc.commands import JOBS, job_class
from jampetsc.errors import InputError, JampetscError
from jampetsc.options.parameters import suggest_name
from jampetsc.options.parser import add_job, parse_job, run_command
from jampetsc.petsc import launchers, session, solver_options
from jampetsc.version import VERSION

REMEDIES = {errno.ENOSPC: ". Free some space, or write elsewhere.", errno.EACCES: ". Check its permissions."}
REQUIRED = "the following arguments are required: "  # how argparse begins
MORE_MEMORY = "Use more nodes, or a smaller packing."
SHORT_OPTIONS = ("-h", "-q", "-v")  # short options of the program's own
FAILURE_TIMEOUT = 2.0  # seconds that a failed rank waits for the others to report the same


def main(argv=None):
    """Run `jampetsc argv` and return the exit status. Errors are printed once, by one rank."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # OpenBLAS also reads it when numpy is imported
    os.environ.pop(
        "NUMBA_NUM_THREADS", None
    )  # of threads that nothing here uses; numba does not start with 0
    streams.prepare()
    try:
        status = dispatch(sys.argv[1:] if argv is None else argv)
        sys.stdout.flush()
        return status
    except JampetscError as error:
        return _fail(str(error), error.exit_code)
    except MemoryError as error:
        details = f" ({_one_line(error)})" if str(error) else ""
        return _fail(f"out of memory{details}. {MORE_MEMORY}", 1)
    except BrokenPipeError:
        streams.flush_or_drop(sys.stdout)
        return 141
    except OSError as error:
        return _fail(_system_message(error), 1)
    except KeyboardInterrupt as error:
        return _fail(str(error) or "interrupted: nothing is kept.", 130)
    except Warning as error:  # also of a library
        return _fail(
            f"PYTHONWARNINGS makes this warning an error: {_one_line(error).rstrip('.')}. Unset it.", 1
        )
    except Exception as error:
        if not session.petsc_error(error):
            raise
        return _fail(*session.explain_error(error))


def dispatch(argv):
    """Parse `argv` (without the program's name) and run its command; returns the exit status.

    Raises InputError for a word that is neither the program's nor PETSc's.
    """
    words, petsc_argv = split_petsc(argv or ["--help"])
    if "_ARGCOMPLETE" in os.environ:
        _complete()
    parser, commands = command_parser(words)
    try:
        args, unknown = parser.parse_known_args(words)
    except InputError as error:
        if "missing" not in str(error):
            raise
        command = commands.choices.get(words[0])
        options = command._option_string_actions if command else words
        for word in words:  # a required option may be missing because it was misspelt
            if word.startswith("--") and word.partition("=")[0] not in options:
                raise InputError(_unknown_word(word, command)) from None
        values = [token for token in petsc_argv if not solver_options.OPTION.match(token)]
        hint = f" Options of PETSc took {', '.join(values)}. Put these last." if values else ""
        raise InputError(f"{error}{hint}") from None
    if unknown:
        raise InputError(_unknown_word(unknown[0], commands.choices[args.command]))
    job = parse_job(args)
    takes_petsc = job.scalar is not None
    if petsc_argv and not takes_petsc:
        raise InputError(
            f"{args.command} {petsc_argv[0]}: an option of PETSc, which this command does not use. Leave it out; "
            "options of jampetsc begin with --."
        )
    if petsc_argv:
        solver_options.check(args.command, {name: job_class(name).SOLVERS for name in JOBS}, petsc_argv)
    progress.report(-1 if args.quiet else 1 if args.verbose else 0)
    if not takes_petsc and not _is_working_rank(argv):
        return 0
    return run_command(job, args, petsc_argv)


def split_petsc(argv):
    """(program's words, PETSc's words) of a command line.

    As PETSc reads it: an option is one dash and a letter, and the next word is its value unless that is an
    option too. So a file name must not follow a PETSc option that has no value of its own.
    """
    words, petsc = [], []
    value_may_follow = False
    for token in argv:
        option = bool(solver_options.OPTION.match(token)) and token not in SHORT_OPTIONS
        value = value_may_follow and not token.startswith("--")
        (petsc if option or value else words).append(token)
        value_may_follow = option
    return words, petsc


class Parser(argparse.ArgumentParser):
    """argparse without abbreviations of options, which raises InputError and prints help on one rank only."""

    def __init__(self, **settings):
        settings.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        super().__init__(**{**settings, "add_help": False, "allow_abbrev": False})
        self._negative_number_matcher = re.compile(r"-\.?\d")  # argparse takes -1e-4 for an option
        self.add_argument("-h", "--help", action="help", help="show this text and exit")

    def error(self, message):
        message = message.removeprefix("argument ")
        if message.startswith(REQUIRED):
            message = f"{message.removeprefix(REQUIRED)}: missing"
        raise InputError(f"{message}. See {self.prog} --help.")

    def _print_message(self, message, file=None):  # help and version
        if _is_working_rank(sys.argv):
            super()._print_message(message, file)


def command_parser(words):
    """(parser, its subparsers) for these words: of the command that they name, or else of all commands."""
    parser = Parser(
        prog="jampetsc",
        description="How jammed packings of soft disks and spheres respond to slow and fast shear.",
        epilog="examples:\n"
        "  jampetsc pack --n 1024 --pressure 1e-3 --out p.h5\n  jampetsc sweep p.h5 --out sweep.h5\n  jampetsc plot "
        "sweep.h5 --out moduli.png\n\njampetsc COMMAND --help says more. Options with a single dash are PETSc's and "
        "go last,\nfor example -options_file FILE or -log_view. In parallel: mpirun -n RANKS jampetsc …",
    )
    parser.add_argument("--version", action="version", version=f"jampetsc {VERSION}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    name = words[0] if words else "--help"
    if name not in JOBS and not name.startswith("-"):
        raise InputError(
            f"{shlex.quote(name)}: no such command{suggest_name(name, JOBS) or '.'} See jampetsc --help."
        )
    is_command = name in JOBS
    names = [name] if is_command else [] if name == "--version" else JOBS
    for command in names:
        add_job(job_class(command), subparsers, is_command)
    return parser, subparsers


def _complete():
    """Tell the shell what may follow, where argcomplete is installed, and end; see docs/install.md."""
    with contextlib.suppress(ImportError):
        import argcomplete

        words = os.environ["COMP_LINE"].split()[1:2]
        argcomplete.autocomplete(command_parser(words if words and words[0] in JOBS else ["--help"])[0])


def _unknown_word(token, parser):
    """The message for a word that argparse left over."""
    word = token.partition("=")[0]
    if not word.startswith("-"):
        return f"{token}: one argument too many. See {parser.prog} --help."
    near = suggest_name(word, parser._option_string_actions)
    return f"{word}: no such option{near or '.'} See {parser.prog} --help."


def _is_working_rank(request):
    """Whether this process runs a command that needs no MPI: of ranks with the same command line only one does.

    `request` is the command line. If mpirun started several ranks, MPI is started to compare them and then ended, so
    that nobody waits for the rank that works. An MPI that was running before is left running.
    """
    was_loaded, MPI = "mpi4py.MPI" in sys.modules, _mpi()
    if not MPI:
        return True
    requests = MPI.COMM_WORLD.allgather((request, os.getcwd()))
    is_first = requests.index(requests[MPI.COMM_WORLD.rank]) == MPI.COMM_WORLD.rank
    if not was_loaded:
        MPI.Finalize()
    return is_first


def _fail(message, status):
    """Print `message` once and return `status`; abort the MPI job unless all ranks fail within FAILURE_TIMEOUT."""
    MPI = _mpi()  # a rank that left before another has printed would end the job without a word
    if not MPI:
        _print_error(message)
        return status
    comm = MPI.COMM_WORLD
    all_here, deadline = comm.Ibarrier(), time.monotonic() + FAILURE_TIMEOUT
    while not all_here.Test():
        if time.monotonic() > deadline:
            _print_error(f"rank {comm.rank}: {message}")
            comm.Abort(status)
        time.sleep(0.01)
    if comm.allgather(message).index(message) == comm.rank:
        _print_error(message)
    comm.Barrier()  # mpirun ends the others when the first one leaves, printed or not
    return status


def _mpi():
    """mpi4py's MPI if this is one of several ranks or MPI was started already, and was not ended; else None."""
    if launchers.has_several_ranks():
        with contextlib.suppress(ImportError):
            importlib.import_module("mpi4py.MPI")
    MPI = sys.modules.get("mpi4py.MPI")
    return MPI if MPI and MPI.Is_initialized() and not MPI.Is_finalized() else None


def _print_error(message):
    streams.say("".join(f"{streams.ERROR}{line}\n" for line in message.splitlines()))
    streams.flush_or_drop(sys.stdout)


def _system_message(error):
    """One line for an OSError."""
    name = f"{error.filename}: " if error.filename else ""
    reason = os.strerror(error.errno) if error.errno else _one_line(error)
    return f"{name}{reason}{REMEDIES.get(error.errno, '')}"


def _one_line(error):
    return " ".join(str(error).split())
