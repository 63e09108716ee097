"""A job on the command line: the parser made from its parameters, and its run."""

import textwrap

from jampetsc import streams
from jampetsc.errors import InputError, JampetscError, in_words, option
from jampetsc.io.outlet import Outlet
from jampetsc.options.job import Job
from jampetsc.options.parameters import FILES, OPTION, made, parameters, shown
from jampetsc.petsc import session


def add_job(job, subparsers, whole=True) -> None:
    """Add the command of a class of jobs to argparse's subparsers; whole: with its options, not its help line alone."""
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
    for name, one in parameters(job).items():
        if one.group and one.group not in groups:
            groups[one.group] = parser.add_argument_group(one.group)
        _add(groups.get(one.group, parser), name, one)
    if job.OUT:
        parser.add_argument("--out", metavar="FILE", required=job.OUT == "required", help=job.OUT_HELP)
    volume = parser.add_mutually_exclusive_group()
    quiet = "print no progress"
    volume.add_argument("-q", "--quiet", action="store_true", default=None, help=quiet)
    volume.add_argument("-v", "--verbose", action="store_true", default=None, help="print more about the run")
    if job.OUT and not job.AGAIN:
        overwrite = (
            "compute again and replace a finished result, otherwise one of the same settings and inputs stays"
        )
        parser.add_argument("--overwrite", action="store_true", default=None, help=overwrite)
    parser.set_defaults(job=job)


def _add(parser, name, one):
    if one.place != OPTION:
        count = "+" if one.place == FILES else None if one.required else "?"
        parser.add_argument(
            name, nargs=count, metavar=one.metavar or one.kind.metavar or name.upper(), help=one.help
        )
    elif isinstance(one.default, bool):
        switch = {"action": "store_const", "const": not one.default, "default": None}
        parser.add_argument(one.word, dest=name, help=_help(one), **switch)
    else:
        parser.add_argument(
            *filter(None, (one.word, one.also)),
            dest=name,
            required=one.required,
            metavar=one.metavar or one.kind.metavar or (None if one.choices else name.upper()),
            help=_help(one),
        )


def _help(one):
    """The line of help, with choices, unit and default."""
    words = [one.off or one.help]
    if one.choices:
        words.append(f"({', '.join(one.choices)})")
    if one.unit:
        words.append(f"in {one.unit}")
    if not one.required and one.default is not None and not isinstance(one.default, bool):
        words.append(f"(default {shown(one.default)})")
    return " ".join(words).replace("%", "%%")


def job_of(args) -> Job:
    """The job that parsed arguments describe. Raises InputError, with parameters written as options."""
    try:
        return made(args.job, {name: getattr(args, name) for name in parameters(args.job)})
    except JampetscError as error:
        raise InputError(error.message(words_of(args.job))) from None


def words_of(job):
    """A function (name of a parameter) -> the option of the job's command, for messages."""
    known = parameters(job)
    return lambda name: known[name].word if name in known else option(name)


def run(job, args, petsc_argv=()) -> int:
    """Run a job, print its summary and return the exit status. Collective.

    args        the parsed arguments, for `out` and `overwrite`
    petsc_argv  PETSc's own options
    """
    needs_petsc = job.scalar is not None
    try:
        out = getattr(args, "out", None)
        out = job.place if out is None else out
        to = Outlet(out, out)
        overwrite = getattr(args, "overwrite", False)
        summary = job.perform(to, petsc_argv=petsc_argv, overwrite=overwrite, alone=not needs_petsc)
    except JampetscError as error:
        error.args = (error.message(words_of(type(job))),)
        raise
    comm = session.communicator() if needs_petsc else None
    if summary and (comm is None or comm.rank == 0):
        print(streams.visible(in_words(summary, words_of(type(job))), "\n\t"))
    return to.status
