"""Pictures of results, one module per family; without PETSc, MPI or a display."""

import os

from jampetsc.errors import InputError

try:
    import matplotlib  # noqa: F401
except ValueError:
    if "MPLBACKEND" not in os.environ:
        raise
    raise InputError(
        f"MPLBACKEND={os.environ['MPLBACKEND']}: not a backend of matplotlib. Unset it."
    ) from None
