"""The subcommands: every job, and `plot`. `jampetsc.cli` makes the parser of the one that is asked for."""

from jampetsc.jobs import JOBS, job_class

COMMANDS = (*JOBS, "plot")


def add_command(name, subparsers) -> None:
    """Add the parser of a command, with the options that all commands have."""
    if name == "plot":
        from jampetsc.commands import plot

        plot.add_parser(subparsers)
        again = plot.AGAIN
    else:
        from jampetsc.words.jobs import add_job

        add_job(job_class(name), subparsers)
        again = job_class(name).AGAIN
    parser = subparsers.choices[name]
    parser.set_defaults(command=name)
    told = parser.add_mutually_exclusive_group()
    told.add_argument(
        "-q", "--quiet", action="store_true", default=None, help="do not tell how far the run has come"
    )
    told.add_argument("-v", "--verbose", action="store_true", default=None, help="tell more of it")
    if not again:
        parser.add_argument(
            "--overwrite",
            action="store_true",
            default=None,
            help="replace a finished result of other settings, which is refused otherwise",
        )
