"""A program of the tests, also under mpirun: python tests/run_checkpoint.py FILE COUNT [STOP_AT]

"Solves" COUNT frequencies, keeps each in the checkpoint of FILE, kills itself at the start of number STOP_AT,
and prints per rank which ones it had to solve.
"""

import os
import signal
import sys

import numpy as np
from mpi4py import MPI

from jampetsc.errors import JampetscError
from jampetsc.io.checkpoint import Checkpoint


def record(index):
    return {
        "omega": 10.0**-index / 3,
        "G": complex(1 / (index + 1), np.pi),
        "error_bound": np.float64(1e-9) / 7,
    }


def fields(index, rank):
    rng = np.random.default_rng([index, rank])
    return {"displacement": rng.random((4, 2)) * 1j, "rotation": rng.random(4)}


def main(path, count, stop_at="-1"):
    comm = MPI.COMM_WORLD
    job = {"packing": "a", "omega": np.arange(int(count)) / 3, "law": {"beta": 1.0}, "ranks": comm.size}
    checkpoint = Checkpoint(path, job, comm)
    solved = []
    for index in range(int(count)):
        if index in checkpoint.done:
            continue
        if index == int(stop_at):
            comm.Barrier()
            os.kill(os.getpid(), signal.SIGKILL)
        checkpoint.save(index, record(index), fields(index, comm.rank))
        solved.append(index)
    for index in range(int(count)):
        assert checkpoint.done[index] == record(index)
        for name, array in checkpoint.fields(index).items():
            assert np.array_equal(array, fields(index, comm.rank)[name])
    sys.stdout.write(f"rank {comm.rank} solved {solved}\n")


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except JampetscError as error:
        sys.stdout.write(f"{error}\n")
        sys.exit(error.exit_code)
