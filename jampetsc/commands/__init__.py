"""The subcommands, one module each, listed in `COMMANDS`. `jampetsc.cli` imports the one that is asked for.

A command module has

    add_parser(subparsers)      adds its parser (`subparsers.add_parser("sweep", help=…)`) and calls
                                parser.set_defaults(run=run), with takes_petsc=lambda args: True where PETSc's
                                single-dash options may be given; otherwise the command line refuses them
    check(args)                 refuses what is wrong whatever the files hold, before any work; `run` begins with it,
                                and a study calls it for all its tasks: parser.set_defaults(run=run, check=check)
    run(args, petsc_argv)       does the work and returns the exit status; `petsc_argv` is for `session.start`

and keeps its heavy imports (numpy, h5py, numba, matplotlib) inside `run`, so that `--help` is instant.
"""

import importlib

COMMANDS = {
    "pack": "jampetsc.commands.pack",
    "import": "jampetsc.commands.importing",
    "sweep": "jampetsc.commands.sweep",
    "quasistatic": "jampetsc.commands.quasistatic",
    "modes": "jampetsc.commands.modes",
    "oscillate": "jampetsc.commands.oscillate",
    "flow": "jampetsc.commands.flow",
    "shear": "jampetsc.commands.shear",
    "jam": "jampetsc.commands.jam",
    "spectrum": "jampetsc.commands.spectrum",
    "correlate": "jampetsc.commands.correlate",
    "collapse": "jampetsc.commands.collapse",
    "study": "jampetsc.commands.study",
    "trade": "jampetsc.commands.trade",
    "info": "jampetsc.commands.info",
    "merge": "jampetsc.commands.merge",
    "export": "jampetsc.commands.export",
    "matrices": "jampetsc.commands.matrices",
    "plot": "jampetsc.commands.plot",
    "examples": "jampetsc.commands.examples",
}


REPLACES = {
    "plot",
    "trade",
    "study",
    "info",
    "examples",
}  # that have no result to refuse: pictures and tables are drawn again


def add_command(name, subparsers) -> None:
    """Add the parser of a command, with the options that all commands have."""
    importlib.import_module(COMMANDS[name]).add_parser(subparsers)
    parser = subparsers.choices[name]
    parser.set_defaults(command=name)
    parser.add_argument(
        "--quiet", action="store_true", default=None, help="do not tell how far the run has come"
    )
    if name not in REPLACES:
        parser.add_argument(
            "--overwrite",
            action="store_true",
            default=None,
            help="replace a finished result of other settings, which is refused otherwise",
        )


def parsers_of(family, names) -> dict:
    """{command: its parser}, made by the class of parsers `family`, for what is no command line but means one."""
    subparsers = family(prog="jampetsc").add_subparsers(dest="command")
    for name in names:
        add_command(name, subparsers)
    return subparsers.choices
