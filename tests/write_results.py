"""A program of the tests, also under mpirun: python tests/write_results.py HOW FILE [SEED]

HOW is `whole`, `forever` (again and again with the next seed) or `killed`, before a file has its name.
Or python tests/write_results.py several FOLDER RANKS-SEED…: FOLDER/RANKS-SEED/s.h5 of so many ranks.
"""

import os
import signal
import sys
import time

import numpy as np
from mpi4py import MPI

from jampetsc.errors import JampetscError
from jampetsc.io.hdf5 import OutputFile
from jampetsc.io.result_file import ResultWriter

N = 15  # rows in all, on any number of ranks
LAW = {"law": "contact", "beta": 0.5, "rotations": True, "prestress": False}
OMEGA = np.array([1e-3, 0.1, 10.0])


def arrays(seed):
    """What a sweep with fields stores, and rows along axis 0 besides."""
    rng = np.random.default_rng(seed)
    shared = {"omega": OMEGA, "G": rng.random(3) + 1j * rng.random(3), "error_bound": 1e-9 * rng.random(3)}
    shared["fields/omega"] = OMEGA[:2]
    displacement = rng.random((2, N, 2)) + 1j * rng.random((2, N, 2))
    rows = {"fields/rotation": (rng.random((2, N)) * 1j, 1), "particles": (np.arange(N), 0)}
    rows |= {"nonaffine": (rng.random((N, 2)), 0), "none": (np.zeros((0, 2)), 0)}
    return shared, displacement, rows


def owned(rank, size):
    """Rows of a rank: unequal, and with four ranks none on rank 1."""
    bounds = {1: (0, N), 2: (0, 4, N), 3: (0, 6, 7, N), 4: (0, 6, 6, 7, N)}[size]
    return slice(bounds[rank], bounds[rank + 1])


def write(comm, how, path, seed):
    mine = owned(comm.rank, comm.size)
    shared, displacement, rows = arrays(seed)
    with ResultWriter(path, "jampetsc-sweep", comm) as writer:
        writer.attributes(seed=seed, missing=None, **LAW)
        for name, array in shared.items():
            writer.dataset(name, array)
        for field in displacement:
            writer.append("fields/displacement", field[mine])
        for name, (array, axis) in rows.items():
            writer.distributed(name, array[(slice(None),) * axis + (mine,)] if len(array) else array, axis)
        if how == "killed":
            OutputFile.finish = lambda file: os.kill(os.getpid(), signal.SIGKILL)


def several(folder, *names):
    """Results of the first so many ranks."""
    world = MPI.COMM_WORLD
    for name in names:
        ranks, seed = map(int, name.split("-"))
        some = world.Split(0 if world.rank < ranks else MPI.UNDEFINED, world.rank)
        os.makedirs(f"{folder}/{name}", exist_ok=True)
        if some != MPI.COMM_NULL:
            write(some, "whole", f"{folder}/{name}/s.h5", seed)


def main(how, path, seed=1, *more):
    if how == "several":
        return several(path, seed, *more)
    write(MPI.COMM_WORLD, how, path, int(seed))
    if how == "forever":
        time.sleep(0.2)
        main(how, path, int(seed) + 1)
    return None


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except JampetscError as error:
        sys.stdout.write(f"{type(error).__name__}: {error}\n")  # in one piece: the ranks share a terminal
        sys.exit(error.exit_code)
