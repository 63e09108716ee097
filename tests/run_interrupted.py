"""A program of the tests, also under mpirun: python tests/run_interrupted.py COUNT ARGUMENTS…

`jampetsc ARGUMENTS`, killed by SIGKILL as soon as COUNT steps are on disk. With fewer vectors per factorisation than
usual, so that sweeps of small packings have steps to lose.
"""

import os
import signal
import sys

from jampetsc.cli import main as cli
from jampetsc.io.checkpoint import Checkpoint
from jampetsc.linear import rational


def main(count, arguments):
    save = Checkpoint.save

    def save_and_die(self, *step):
        save(self, *step)
        if len(self.done) >= count:
            if self.comm is not None:
                self.comm.Barrier()
            os.kill(os.getpid(), signal.SIGKILL)

    Checkpoint.save, rational.VECTORS = save_and_die, 4
    return cli.main(arguments)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2:]))
