"""The job `trade`: what speed costs in accuracy, for the user's packing and machine."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from jampetsc.commands.sweep import OMEGA
from jampetsc.errors import InputError, named
from jampetsc.options.parameters import ValueType, parameter
from jampetsc.options.physics_options import PackingJob
from jampetsc.options.values import FREQUENCIES, TIME_UNIT, Numbers, format_numbers, split_list
from jampetsc.packing.packing import Packing
from jampetsc.shipped_files import located

GROUPS = ("accuracy", "method", "physics", "frequencies")


def _groups(value):
    for word in split_list(value):
        if word not in GROUPS:
            raise ValueError(f"{word}: not supported. Choose among {', '.join(GROUPS)}.")
    return split_list(value)


def _files(value):
    paths = tuple(located(str(path)) for path in split_list(value))
    for path in paths:
        if not Path(path).is_file():
            raise ValueError(f"{path}: no such file. Check its name.")
    return paths


@dataclass(frozen=True, eq=False)
class Trade(PackingJob):
    """Measure what speed costs in accuracy.

    Runs a sweep of one packing with each of many settings, and compares time, memory, factorisations, errors of G' and
    G'' and critical slopes with the most accurate sweep. Writes a table (CSV) and, beside it, a picture of
    time against error (.png), and recommends settings by rules that it states.

      accuracy     accuracies 1e-2 ... 1e-10 of the rational sweep
      method       method direct with MUMPS and with the options files
      physics      rotations, pre-stress, Stokes drag instead of contact damping: deviation from the law given
      frequencies  few frequencies solved one by one, and interpolation between them
    """

    FORMAT: ClassVar = "table"
    scalar: ClassVar = None  # its runs are processes of their own
    OUT_HELP: ClassVar = "table, .csv; the picture goes beside it as .png"
    AGAIN: ClassVar = True
    GIVES: ClassVar = "str, the table and the advice"
    EPILOG: ClassVar = """examples:
  jampetsc trade p.h5 --out trade.csv
  jampetsc trade p.h5 --choices accuracy,physics --ensemble --beta 0.1 --out trade.csv
  jampetsc trade p.h5 --choices method --options-files jampetsc:mumps,jampetsc:iterative --ranks 2 --out trade.csv

Times are meaningful only on a machine without other load."""

    choices: tuple = parameter(
        ",".join(GROUPS),
        "groups of settings to vary",
        value_type=ValueType(_groups, ",".join, metavar="LIST", python="texts"),
    )
    ensemble: bool = parameter(False, "also compare the packing with 4 new ones of N/4 and 16 of N/16 disks")
    omega: Numbers = parameter(OMEGA, "frequencies ω", value_type=FREQUENCIES, unit=TIME_UNIT)
    ranks: int | None = parameter(
        None, "ranks of each run under mpirun (default: without mpirun)", low=1, high=100_000
    )
    options_files: tuple | None = parameter(
        None,
        "options files for method direct (default: iterative, superlu_dist, low_memory of jampetsc)",
        value_type=ValueType(_files, ",".join, metavar="FILE[,FILE…]", python="names of files"),
    )

    @property
    def frequencies(self) -> str:
        """Frequencies of the runs, as on a command line."""
        return format_numbers(self.omega)

    def check(self):
        """Refuse a packing in memory, which other processes cannot read."""
        if isinstance(self.packing, Packing):
            raise InputError(f"{named('packing')}: in memory. Give its file, which the runs read.")

    def check_outputs(self, to):
        """Refuse other endings, files that may not be replaced, and launchers or packings with which no run starts."""
        from jampetsc.io.outputs import PICTURE, TABLE
        from jampetsc.io.packing_file import read_packing
        from jampetsc.petsc import launchers
        from jampetsc.studies import trade_process

        if to.path is None or to.path.suffix.lower() != ".csv":
            raise InputError(f"{named('out')} {to.path}: unknown ending. Give it the ending .csv.")
        if launchers.has_several_ranks():
            raise InputError(
                "trade: started under mpirun, but it starts its own processes. Run it without mpirun, with "
                f"{named('ranks')}."
            )
        trade_process.launcher(self.ranks)
        inputs = [self.packing, *(self.options_files or ())]
        to.check(TABLE, inputs)
        to.check(PICTURE, inputs, to.path.with_suffix(".png"))
        read_packing(self.packing)

    def work(self, to):
        """Measure and write both files. Raises JampetscError only if the reference fails."""
        from jampetsc.studies.trade_runs import measure_trade

        return measure_trade(self, to.path)
