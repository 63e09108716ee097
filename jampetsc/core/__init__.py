import os

from jampetsc.errors import InputError
from jampetsc.recompile import forget_outdated

if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):  # integers that stay so are python's floats
    raise InputError(
        f"NUMBA_DISABLE_JIT={os.environ['NUMBA_DISABLE_JIT']}: loops over contacts have to be compiled: unset it"
    )
forget_outdated()  # before any module here or above loads what it has compiled
