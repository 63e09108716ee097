"""A program of the tests: python tests/write_packings.py forever|unprivileged FILE"""

import itertools
import os
import sys

import numpy as np

from jampetsc.core.disks import Disks
from jampetsc.errors import JampetscError
from jampetsc.io.atomic import check_writable
from jampetsc.io.packing_file import write_packing


def packing(seed, n):
    rng = np.random.default_rng(seed)
    side = 2.0 * np.sqrt(n)
    return Disks.from_positions(
        side * rng.random((n, 2)), np.full(n, 0.5), side * np.eye(2), record={"seed": seed}
    )


def forever(path):
    """A new packing under the same name again and again, until killed."""
    for seed in itertools.count():
        write_packing(path, packing(seed, 5000))
        print(seed, flush=True)


def unprivileged(path):
    """The question whether `path` can be written, asked without the rights of root."""
    if os.geteuid() == 0:
        os.setuid(65534)
    check_writable(path)


if __name__ == "__main__":
    try:
        globals()[sys.argv[1]](sys.argv[2])
    except JampetscError as error:
        print(error)
        sys.exit(error.exit_code)
