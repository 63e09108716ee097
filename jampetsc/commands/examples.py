"""`jampetsc examples --copy DIR`: the example programs, options files and Slurm scripts that come with the package."""


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "examples",
        help="copy the example programs, options files of PETSc and Slurm scripts that come with jampetsc",
        description="Copy what comes with jampetsc into a new folder: examples/ (programs in Python), options/ (files "
        "of PETSc options, also known as -options_file jampetsc:NAME) and slurm/ (scripts for a cluster).",
        epilog="Example: jampetsc examples --copy jampetsc-examples",
    )
    parser.add_argument(
        "--copy", metavar="DIR", required=True, help="folder to make; it must not be there yet"
    )
    parser.set_defaults(run=run)


def run(args, petsc_argv) -> int:
    """Copy the files and say where they are."""
    import shutil
    from pathlib import Path

    from jampetsc.errors import InputError
    from jampetsc.shipped_files import FOLDER

    try:
        shutil.copytree(FOLDER, args.copy, ignore=shutil.ignore_patterns("__pycache__"))
    except FileExistsError as error:
        raise InputError(f"--copy {args.copy}: is there already: name a new folder") from error
    for path in sorted(Path(args.copy).glob("*/*")):
        print(path)
    return 0
