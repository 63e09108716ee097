"""The subcommands, one module each, listed in `COMMANDS`. `jampetsc.cli` imports the one that is asked for.

A command module has

    add_parser(subparsers)      adds its parser (`subparsers.add_parser("sweep", help=…)`) and calls
                                parser.set_defaults(run=run), with takes_petsc=lambda args: True where PETSc's
                                single-dash options may be given; otherwise the command line refuses them
    check(args)                 refuses what is wrong whatever the files hold, before any work; `run` begins with it,
                                and a study calls it for all its tasks: parser.set_defaults(run=run, check=check)
    run(args, petsc_argv)       does the work and returns the exit status; `petsc_argv` is for `session.start`

has AGAIN = True if its result is made anew without asking, as pictures are, and keeps its heavy imports (numpy, h5py,
numba, matplotlib) inside `run`, so that `--help` is instant.
"""

import importlib

COMMANDS = {
    "pack": "jampetsc.jobs.pack:Pack",
    "import": "jampetsc.jobs.importing:Import",
    "sweep": "jampetsc.jobs.sweep:Sweep",
    "quasistatic": "jampetsc.jobs.quasistatic:Quasistatic",
    "modes": "jampetsc.commands.modes",
    "oscillate": "jampetsc.commands.oscillate",
    "flow": "jampetsc.jobs.flow:Flow",
    "shear": "jampetsc.jobs.shear:Shear",
    "jam": "jampetsc.jobs.jam:Jam",
    "spectrum": "jampetsc.commands.spectrum",
    "correlate": "jampetsc.commands.correlate",
    "collapse": "jampetsc.jobs.collapse:Collapse",
    "study": "jampetsc.jobs.study:Study",
    "trade": "jampetsc.jobs.trade:Trade",
    "info": "jampetsc.jobs.info:Info",
    "merge": "jampetsc.jobs.merge:Merge",
    "export": "jampetsc.jobs.export:Export",
    "matrices": "jampetsc.jobs.matrices:Matrices",
    "plot": "jampetsc.commands.plot",
}


def add_command(name, subparsers) -> None:
    """Add the parser of a command, with the options that all commands have."""
    from jampetsc.words.jobs import add_common, add_job

    module, _, job = COMMANDS[name].partition(":")
    module = importlib.import_module(module)
    if job:
        add_job(getattr(module, job), subparsers)
    else:
        module.add_parser(subparsers)
        add_common(subparsers.choices[name], getattr(module, "AGAIN", False))
    subparsers.choices[name].set_defaults(command=name)


def parsers_of(family, names) -> dict:
    """{command: its parser}, made by the class of parsers `family`, for what is no command line but means one."""
    subparsers = family(prog="jampetsc").add_subparsers(dest="command")
    for name in names:
        add_command(name, subparsers)
    return subparsers.choices
