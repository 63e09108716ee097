"""The solver for `minimise.newton`: a Hessian of up to BLOCKS_UP_TO disks is factorised by `minimise.ldl`.

That gives the same to the last bit on every processor, whatever BLAS is installed; last digits decide which minimum a
quench ends in. Larger ones, and all where options begin with `newton_`, go to the library of `local.NewtonSolver`.
"""

import numpy as np

from jampetsc.minimise import ldl
from jampetsc.petsc.blocks import elimination_order
from jampetsc.petsc.local import PREFIX, NewtonSolver
from jampetsc.petsc.session import current

BLOCKS_UP_TO = 32768  # disks; beyond, CHOLMOD is faster: four times at 131072


class HessianSolver(NewtonSolver):
    """A `NewtonSolver` for matrices of 2×2 blocks, as `minimise.hessian.Pattern` has them."""

    def __init__(self):
        self._by_library, self._factor = True, None
        super().__init__()
        self._by_library = current().has_options(PREFIX)

    def factorise(self, indptr, indices, values) -> bool:
        """See `NewtonSolver.factorise`."""
        n, self._factor = len(indptr) // 2, None
        if self._by_library or n > BLOCKS_UP_TO:
            return super().factorise(indptr, indices, values)
        i, j, blocks, chosen, diagonal = ldl.blocks_of(indptr, indices, values)
        order = elimination_order(n, i[chosen], j[chosen])
        definite, self._factor = ldl.factorise(order, i, j, blocks, chosen, diagonal)
        return definite

    def solve(self, b):
        """See `NewtonSolver.solve`."""
        if self._factor is None:
            return super().solve(b)
        b = b.reshape(-1, 2)
        x, work = np.empty_like(b), np.empty_like(b)
        ldl.solve(self._factor, b, x, work)
        return x.ravel()
