"""Loading PETSc, SLEPc and MPI into this process, for `session` alone, and what can go wrong with that in words."""

import itertools
import re
import sys
from pathlib import Path

from jampetsc.errors import InputError
from jampetsc.launcher import without_daemon


def check_words(petsc_argv):
    """InputError for words that petsc4py cannot hand on, and for an options file that PETSc would refuse at length."""
    for word in petsc_argv:
        if not word.isprintable():
            raise InputError(f"{ascii(word)[1:-1]}: PETSc takes printable text only: use another name")
    for flag, name in itertools.pairwise([*petsc_argv, ""]):
        if flag != "-options_file":
            continue
        if not name:
            raise InputError("-options_file: needs the name of a file")
        try:
            lines = Path(name).read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError as error:
            raise InputError(f"{name}: {error.strerror}: give a PETSc options file") from error
        if Path(name).suffix in (".yml", ".yaml"):
            continue
        for number, line in enumerate(lines, 1):
            word = line.partition("#")[0].split()[:1]
            if word and not re.match(r"-[A-Za-z]|alias$", word[0]):
                raise InputError(f"{name}: line {number}: {word[0]}: options begin with -, comments with #")


def load(petsc_argv):
    """(PETSc, SLEPc or None, COMM_WORLD), initialised with petsc_argv. Collective.

    Raises InputError where they are missing, do not fit together, or do not start with these words.
    """
    try:
        import petsc4py

        with without_daemon():
            from mpi4py import MPI

        petsc4py.init(["jampetsc", *petsc_argv], comm=MPI.COMM_WORLD)
        from petsc4py import PETSc
    except ImportError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"petsc4py and mpi4py: {reason}: install them for {sys.executable}") from error
    except RuntimeError as error:  # PETSc.Error; PETSc has printed the details
        given = " ".join(petsc_argv)
        raise InputError(f"{given}: PETSc does not start with this: see its message above") from error
    try:
        import slepc4py

        slepc4py.init(["jampetsc"])
        from slepc4py import SLEPc
    except ModuleNotFoundError:
        SLEPc = None
    except (ImportError, ValueError) as error:  # what loading a SLEPc of another PETSc gives
        raise InputError(
            f"{Path(slepc4py.__file__).parent} was not built for {Path(PETSc.__file__).parents[1]}: "
            "set PETSC_DIR and SLEPC_DIR to one pair, or unset both"
        ) from error
    return PETSc, SLEPc, MPI.COMM_WORLD
