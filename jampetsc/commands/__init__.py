"""The subcommands: every job, and `plot`. `jampetsc.cli` makes the parser of the one that is asked for."""

from jampetsc.jobs import JOBS, job_class

COMMANDS = (*JOBS, "plot")


def add_command(name, subparsers) -> None:
    """Add the parser of a command, with the options that all commands have."""
    from jampetsc.words.jobs import add_common, add_job

    if name == "plot":
        from jampetsc.commands import plot

        plot.add_parser(subparsers)
        add_common(subparsers.choices[name], plot.AGAIN)
    else:
        add_job(job_class(name), subparsers)
    subparsers.choices[name].set_defaults(command=name)
