"""One plain file out of a joint file and its parts."""

import os
from dataclasses import dataclass
from typing import ClassVar

from jampetsc.io.hdf5 import attributes, check_format, open_file
from jampetsc.io.outputs import is_same
from jampetsc.io.reader import load
from jampetsc.io.result_file import merge
from jampetsc.options.job import Job
from jampetsc.options.parameters import FILE, PATH, parameter


@dataclass(frozen=True, eq=False)
class Merge(Job):
    """Make one plain file of a result written by many ranks.

    The new file replaces the result and its parts, unless out names another file.
    """

    FORMAT: ClassVar = "that of the result"
    scalar: ClassVar = None
    OUT: ClassVar = "optional"
    OUT_HELP: ClassVar = "other file to write; FILE and its parts stay (default: replace FILE)"
    GIVES: ClassVar = "the result, loaded"
    EPILOG: ClassVar = "examples:\n  jampetsc merge sweep.h5 --out one.h5"

    file: os.PathLike = parameter(help="result of sweep, quasistatic, modes, …", place=FILE, value_type=PATH)

    def check_outputs(self, to):
        """Refuse a file of another kind; merging in place is left to `io.result_file.merge`."""
        if to.path and not is_same(to.path, self.file):
            with open_file(self.file) as h5:
                kind = check_format(self.file, attributes(h5))
            to.check(kind, self.paths)

    def work(self, to):
        joined = merge(self.file, to.path, to.request)
        if joined:
            return f"{to.path or self.file}: {joined} parts in one file"
        if to.path and not os.path.samefile(to.path, self.file):
            return f"{to}: copy of {self.file}, which was one file already"
        return f"{self.file}: one file already, nothing to do"

    def python_result(self, to):
        return load(to.path or self.file)
