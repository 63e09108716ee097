"""PETSc's options on the command line: the solver that each is for, and messages about wrong ones.

Each solver's options begin with a prefix of its own. An option of no solver of the command is a mistake, refused
before anything starts; PETSc names at its end the options that nothing has read (`Session.report_unused`).
"""

import difflib
import itertools
import os
import re
from pathlib import Path

from jampetsc.errors import InputError
from jampetsc.io.atomic import open_regular
from jampetsc.shipped_files import PREFIX, located

SOLVERS = {  # prefix: parts of PETSc and SLEPc that read the words after it
    "newton_": "ksp pc mat",
    "shift_": "ksp pc mat",
    "freq_": "ksp pc mat",
    "inertia_": "ksp pc mat",
    "modes_": "eps st",
    "osc_": "snes ksp",
    "osc_factor_": "pc mat",
}
# Beginnings of options that PETSc itself reads, when it starts or ends and for objects without a prefix.
GLOBAL_OPTIONS = tuple(
    "binary_ blas_ check_ checkfunctionlist checkstack citations cuda_ debugger_ default_device device_ display draw_ "
    "error_output fp_trap get_total_flops help hip_ history info is_view kokkos_ log_ malloc mat_view memory_view "
    "monitor mpi_ mpiuni no_signal_handler not_shared_tmp nox objects_ omp_ on_error options_ petsc_ python random_ "
    "root_device saws_ sf_ shared_tmp skip_petscrc start_in_debugger stop_for_debugger tmp use_gpu vec_view "
    "vecscatter_ version viewer_ x_virtual".split()
)
MAX_FILES = 100  # options files of one run
OPTION = re.compile(r"-[A-Za-z]")


def is_global_option(name: str) -> bool:
    """Whether an option, without its dash, is read by PETSc itself and not by a solver."""
    return name.lower().startswith(GLOBAL_OPTIONS)


def check(command: str, owned: dict, petsc_argv) -> None:
    """Raise InputError for words that PETSc cannot read, and for an option of no solver of this command.

    owned   {command: prefixes of its solvers' options} of all commands
    """
    for name in option_names(petsc_argv):
        if not name.lower().startswith(owned[command]) and not is_global_option(name):
            raise InputError(f"PETSc option -{name}: {_remedy(command, name, owned)}")


def option_names(petsc_argv) -> list[str]:
    """Names, without the dash, of the options in these words, and in the options files that they or such files name.

    Raises InputError for words that petsc4py cannot pass on, and for options files that PETSc would refuse with a long
    message, or would read without end.
    """
    for word in petsc_argv:
        if not word.isprintable():
            raise InputError(f"{ascii(word)[1:-1]}: PETSc takes printable text only. Use another name.")
    return _names_among(petsc_argv, [], ())


def _names_among(words, files, inside):
    """Names in words as of a command line; files: all that were read, inside: all that are being read."""
    names = []
    for word, value in itertools.pairwise([*words, ""]):
        if OPTION.match(word):
            names.append(word[1:])
        if word.lower() == "-options_file":
            names += _names_in(value, files, inside)
    return names


def _names_in(file, files, inside):
    if not file:
        raise InputError("-options_file: no name of a file. Give one.")
    if inside and file.startswith(PREFIX):
        raise InputError(
            f"{inside[-1]}: -options_file {file}: PETSc takes paths only. Give the path of the file."
        )
    file = located(file)
    files.append(file)
    if len(files) > MAX_FILES:
        raise InputError(f"{files[0]}: names more than {MAX_FILES} options files. Put them into one.")
    try:
        with open_regular(file) as opened:
            lines = opened.read().decode(errors="replace").splitlines()
        is_inside = any(os.path.samefile(file, other) for other in inside)
    except OSError as error:
        where = f", named in {inside[-1]}" if inside else ""
        raise InputError(f"{file}: {error.strerror}{where}. Give a PETSc options file.") from error
    if is_inside:
        raise InputError(
            f"{file}: named by itself, in {inside[-1]}, so reading would not end. Remove that line."
        )
    if Path(file).suffix in (".yml", ".yaml"):
        return []  # YAML, PETSc's other format, is not checked
    names = []
    for number, line in enumerate(lines, 1):
        word, *more = line.partition("#")[0].split()[:2] or [""]
        if word and not re.match(r"-[A-Za-z]|alias$", word):
            raise InputError(
                f"{file}: line {number}: {word}: not an option. Begin options with -, comments with #."
            )
        if word != "alias":
            names += _names_among([word, *(part.strip("\"'") for part in more)], files, (*inside, file))
    return names


def _remedy(command, name, owned):
    """Why an option is not one of a command, and which one may have been meant."""
    prefixes = owned[command]
    owners = [
        owner
        for owner, heads in owned.items()
        if name.lower().startswith(heads) and len(heads) < len(SOLVERS)
    ]
    if owners:
        return f"an option of jampetsc {' and '.join(owners)}, and {command} has no use for it. Leave it out."
    if not prefixes:
        return f"{command} has no solver. Leave it out."
    head, _, rest = name.partition("_")
    meant = [f"-{prefix}{name}" for prefix in prefixes if head.lower() in SOLVERS[prefix].split()]
    meant = meant or [f"-{near}{rest}" for near in difflib.get_close_matches(f"{head}_", prefixes, n=1)]
    hint = f" (did you mean {' or '.join(meant)}?)" if meant else ""
    return f"options of {command} begin with -{', -'.join(prefixes)}{hint}. Correct or remove it."
