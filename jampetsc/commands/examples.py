"""Example programs, options files and scripts that come with the package."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from jampetsc.errors import InputError, named
from jampetsc.options.job import Job
from jampetsc.options.parameters import parameter
from jampetsc.shipped_files import FOLDER


@dataclass(frozen=True, eq=False)
class Examples(Job):
    """Copy the example programs, options files of PETSc and Slurm scripts that come with jampetsc.

    Into a new folder: examples/ (programs in Python), options/ (files of PETSc options, also known as
    -options_file jampetsc:NAME) and slurm/ (scripts for a cluster).
    """

    scalar: ClassVar = None
    FORMAT: ClassVar = "no file"
    OUT: ClassVar = ""
    AGAIN: ClassVar = True
    GIVES: ClassVar = "str, the files"
    EPILOG: ClassVar = "examples:\n  jampetsc examples --copy mine"

    copy: Path = parameter(help="new folder to copy into", metavar="DIR")

    def check_outputs(self, to):
        """Refuse a folder that exists."""
        if self.copy.exists():
            raise InputError(f"{named('copy')} {self.copy}: exists. Give the name of a new folder.")

    def work(self, to):
        shutil.copytree(FOLDER, self.copy, ignore=shutil.ignore_patterns("__pycache__"))
        return "\n".join(str(path) for path in sorted(self.copy.glob("*/*")))
