"""A program of the tests, also under mpirun: python tests/run_with_disk_faults.py WHEN NUMBER ARGUMENTS…

`jampetsc ARGUMENTS`, to which something happens. It is killed by SIGKILL

    steps     as soon as NUMBER steps are on disk; with fewer vectors per factorisation than usual, so that sweeps of
              small packings have steps to lose
    before, within, after
              when a rank keeps the record of its task number NUMBER of a study: before that, so that it is torn, or
              after it

or, when it is `full`, rank NUMBER cannot keep the record of its first task, as if its disk were full.
"""

import os
import signal
import sys

from jampetsc import main as cli
from jampetsc.errors import JampetscError
from jampetsc.io.checkpoint import Checkpoint
from jampetsc.petsc.session import current
from jampetsc.response import rational
from jampetsc.studies import study_run


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def main(when, number, arguments):
    save, keep, kept = Checkpoint.save, study_run.keep_record, []

    def save_and_die(self, *step):
        save(self, *step)
        if len(self.done) >= number:
            if self.comm is not None:
                self.comm.Barrier()
            die()

    def keep_and_die(folder, record):
        kept.append(record)
        if when == "full" and current().world.rank == number:
            raise JampetscError(f"{folder}: disk full")
        last = when != "full" and len(kept) == number
        if not (last and when == "before"):
            keep(folder, record)
        if last and when == "within":
            os.truncate(folder / "journal" / record["task"], 80)
        if last:
            die()

    if when == "steps":
        Checkpoint.save, rational.VECTORS = save_and_die, 4
    else:
        study_run.keep_record = keep_and_die
    return cli.main(arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2]), sys.argv[3:]))
