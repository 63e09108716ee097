"""Memory that a sparse factor of K, B or K + sB needs, estimated before it is made.

Nested dissection of n unknowns leaves n log n entries in two dimensions and n^(4/3) in three (George, SIAM J. Numer.
Anal. 10, 345 (1973)); docs/performance.md has the measurements behind the constants.
"""

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.petsc.session import current
from jampetsc.petsc.shifted import PREFIX

PLANE_BYTES = 60.0  # of a factor and its matrix per n log₂ n: 60 to 61 at N = 32768 to 900 000
SPACE_BYTES = 410.0  # per n^(4/3), with six unknowns for each sphere: 300 to 410 at n = 24 000 to 190 000
GIGABYTE = 1e9


def factor_bytes(dimension: int, unknowns: int, dofs: int = 6) -> float:
    """Bytes of a real factor and its matrix, about.

    dofs   unknowns of each disk: spheres that are separated are as many for any, each with dofs² entries
    """
    n = max(unknowns, 2)
    if dimension == 2:
        return PLANE_BYTES * n * np.log2(n)
    return SPACE_BYTES * (dofs / 6.0) ** (2.0 / 3.0) * n ** (4.0 / 3.0)


def max_unknowns(size: float) -> int:
    """Largest number of unknowns in three dimensions of which a factor needs this many bytes."""
    return int((size / SPACE_BYTES) ** 0.75)


def require_memory(network, unknowns: int, prefix: str, copies: float = 1.0) -> None:
    """Raise InputError where a factor needs more than the memory of all ranks of a network. Collective.

    prefix   of the solver: with options of the user it is not judged, as these may keep factors on disk
    copies   bytes of a number of the factor, over the bytes of a real one
    """
    needed = copies * factor_bytes(network.dimension, unknowns, max(unknowns // max(network.n, 1), 1))
    available = float(network.sum(current().memory()))
    if needed <= available or current().has_options(prefix):
        return
    rolls = unknowns > network.dimension * network.n
    raise InputError(
        f"factor of {unknowns} unknowns: needs about {needed / GIGABYTE:.3g} GB of {available / GIGABYTE:.3g} GB. "
        f"Use more nodes, or have it on disk with -{prefix}pc_factor_mat_solver_type mumps "
        f"-{prefix}mat_mumps_icntl_22 1."
        + f" Without rotations ({named('rotations')}) fewer unknowns are left." * rolls
        + " With -options_file jampetsc:spin_split spins are left out of the factor."
        * (rolls and prefix == PREFIX)
    )
