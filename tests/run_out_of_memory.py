"""A factorisation that the memory allowed does not suffice for: python tests/run_out_of_memory.py"""

import resource
import sys

import numpy as np
from scipy.sparse import diags, identity, kron

from jampetsc.errors import ConvergenceError
from jampetsc.petsc import session

running = session.start("real", sys.argv[1:])
from jampetsc.petsc.cholesky import Cholesky  # noqa: E402

line = diags([-1.0, 2.0, -1.0], [-1, 0, 1], (700, 700))
grid = (kron(line, identity(700)) + kron(identity(700), line)).tocsr()
pointers, columns = grid.indptr.astype(np.int32), grid.indices.astype(np.int32)
matrix = running.PETSc.Mat().createAIJ(grid.shape, csr=(pointers, columns, grid.data), comm=running.comm)
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + (150 << 20),) * 2)
try:
    Cholesky(matrix, "trial_", "a large grid").factorise()
except ConvergenceError as error:
    print(error)
