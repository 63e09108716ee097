"""A program of the tests, also under mpirun: python tests/run_killed_study.py COUNT MOMENT ARGUMENTS…

`jampetsc ARGUMENTS`, killed by SIGKILL when a rank keeps the record of its task number COUNT: "before" that, "within",
so that its line is torn, or "after" it.
"""

import os
import signal
import sys

from jampetsc import cli
from jampetsc.studies.journal import Journal


def main(count, moment, arguments):
    append, kept = Journal.append, []

    def append_and_die(self, record):
        kept.append(record)
        last = len(kept) == count
        if not (last and moment == "before"):
            append(self, record)
        if last and moment == "within":
            os.truncate(self.path, self._end - 5)
        if last:
            os.kill(os.getpid(), signal.SIGKILL)

    Journal.append = append_and_die
    return cli.main(arguments)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2], sys.argv[3:]))
