"""A program of the tests, also under mpirun: python tests/run_killed_study.py COUNT MOMENT ARGUMENTS…

`jampetsc ARGUMENTS`, killed by SIGKILL when a rank keeps the record of its task number COUNT: "before" that, "within",
so that it is torn, or "after" it.
"""

import os
import signal
import sys

from jampetsc.cli import main as cli
from jampetsc.studies import run


def main(count, moment, arguments):
    keep, kept = run.keep_record, []

    def keep_and_die(folder, record):
        kept.append(record)
        last = len(kept) == count
        if not (last and moment == "before"):
            keep(folder, record)
        if last and moment == "within":
            os.truncate(folder / "journal" / record["task"], 80)
        if last:
            os.kill(os.getpid(), signal.SIGKILL)

    run.keep_record = keep_and_die
    return cli.main(arguments)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2], sys.argv[3:]))
