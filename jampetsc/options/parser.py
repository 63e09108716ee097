"""A job as a command: its parser is made from its parameters."""

import textwrap

from jampetsc import streams
from jampetsc.errors import InputError, JampetscError, in_words, option_word
from jampetsc.options.execution import run_job
from jampetsc.options.job import Job
from jampetsc.options.parameters import FILES, OPTION, build_job, format_value, parameters
from jampetsc.petsc import session


def add_job(job, subparsers, whole=True) -> None:
    """Add the command of a class of jobs to argparse's subparsers; whole: with all its options."""
    first, _, rest = job.__doc__.strip().partition("\n")
    parser = subparsers.add_parser(
        job.NAME,
        help=first.strip().rstrip("."),
        description="\n".join([first.strip(), textwrap.dedent(rest).rstrip()]),
        epilog=job.EPILOG,
    )
    parser.set_defaults(command=job.NAME)
    if not whole:
        return
    groups = {}
    for name, declaration in parameters(job).items():
        if declaration.group and declaration.group not in groups:
            groups[declaration.group] = parser.add_argument_group(declaration.group)
        _add(groups.get(declaration.group, parser), name, declaration)
    if job.OUT:
        parser.add_argument("--out", metavar="FILE", required=job.OUT == "required", help=job.OUT_HELP)
    volume = parser.add_mutually_exclusive_group()
    quiet = "print no progress"
    volume.add_argument("-q", "--quiet", action="store_true", default=None, help=quiet)
    volume.add_argument("-v", "--verbose", action="store_true", default=None, help="print more about the run")
    if job.OUT and not job.AGAIN:
        overwrite = (
            "compute again and replace a finished result (default: keep one of the same settings and inputs)"
        )
        parser.add_argument("--overwrite", action="store_true", default=None, help=overwrite)
    parser.set_defaults(job=job)


def _add(parser, name, declaration):
    if declaration.place != OPTION:
        count = "+" if declaration.place == FILES else None if declaration.required else "?"
        parser.add_argument(
            name,
            nargs=count,
            metavar=declaration.metavar or declaration.value_type.metavar or name.upper(),
            help=declaration.help,
        )
    elif isinstance(declaration.default, bool):
        switch = {"action": "store_const", "const": not declaration.default, "default": None}
        parser.add_argument(declaration.word, dest=name, help=_help(declaration), **switch)
    else:
        parser.add_argument(
            *filter(None, (declaration.word, declaration.also)),
            dest=name,
            required=declaration.required,
            metavar=declaration.metavar
            or declaration.value_type.metavar
            or (None if declaration.choices else name.upper()),
            help=_help(declaration),
        )


def _help(declaration):
    """The line of help, with choices, unit and default."""
    words = [declaration.off or declaration.help]
    if declaration.choices:
        words.append(f"({', '.join(declaration.choices)})")
    if declaration.unit:
        words.append(f"in {declaration.unit}")
    if (
        not declaration.required
        and declaration.default is not None
        and not isinstance(declaration.default, bool)
    ):
        words.append(f"(default {format_value(declaration.default)})")
    return " ".join(words).replace("%", "%%")


def parse_job(args) -> Job:
    """The job that parsed arguments describe. Raises InputError, with parameters written as options."""
    try:
        return build_job(args.job, {name: getattr(args, name) for name in parameters(args.job)})
    except JampetscError as error:
        raise InputError(error.message(option_words(args.job))) from None


def option_words(job):
    """A function (name of a parameter) -> the option of the job's command, for messages."""
    declared = parameters(job)
    return lambda name: declared[name].word if name in declared else option_word(name)


def run_command(job, args, petsc_argv=()) -> int:
    """Run a job, print its summary and return the exit status. Collective.

    args        the parsed arguments, for `out` and `overwrite`
    petsc_argv  PETSc's own options
    """
    needs_petsc = job.scalar is not None
    try:
        out = getattr(args, "out", None)
        out = job.place if out is None else out
        overwrite = getattr(args, "overwrite", False)
        to = run_job(job, out, out, petsc_argv=petsc_argv, overwrite=overwrite, alone=not needs_petsc)
    except JampetscError as error:
        error.args = (error.message(option_words(type(job))),)
        raise
    comm = session.communicator() if needs_petsc else None
    if to.summary and (comm is None or comm.rank == 0):
        print(streams.visible(in_words(to.summary, option_words(type(job))), "\n\t"))
    return to.status
