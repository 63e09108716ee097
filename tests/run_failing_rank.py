"""A program of the tests, under mpirun: python tests/run_failing_rank.py RANK ARGUMENTS…

`jampetsc ARGUMENTS`, a study in which this rank cannot keep the record of its first task, as if its disk were full.
"""

import sys

from jampetsc.cli import main as cli
from jampetsc.errors import JampetscError
from jampetsc.petsc.session import current
from jampetsc.studies import run


def main(rank, arguments):
    keep = run.keep_record

    def keep_or_fail(folder, record):
        if current().world.rank == rank:
            raise JampetscError(f"{folder}: disk full")
        keep(folder, record)

    run.keep_record = keep_or_fail
    return cli.main(arguments)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2:]))
