"""Frequency grids as the command line writes them: `1e-10:1e4:141` or `0.1,1,10`."""

import numpy as np

from jampetsc.errors import InputError
from jampetsc.response.limits import LARGEST, SMALLEST


def parse_omega(text: str, option: str = "--omega", within=(SMALLEST, LARGEST)):
    """Frequencies (M,) in units of 1/τ₁, increasing and without repeats, none of them outside `within`.

    `low:high:count` is a logarithmic grid, a comma-separated list is taken as it is. Raises InputError.
    """
    try:
        if ":" in text:
            low, high, count = text.split(":")
            omega = np.array([float(low), float(high)])
            points = int(count)
        else:
            omega = np.unique([float(word) for word in text.split(",")])
            points = 0
    except ValueError:
        raise InputError(
            f"{option} {text}: write low:high:count, such as 1e-10:1e4:141, or w1,w2,…"
        ) from None
    least, most = within
    if not np.isfinite(omega).all() or omega.min() < least or omega.max() > most:
        raise InputError(
            f"{option} {text}: frequencies must lie between {least:g} and {most:g} (for the limits ω → 0 and ∞ "
            "see `jampetsc quasistatic`)"
        )
    if points == 0 and ":" not in text:
        return omega
    if points < 2 or points > 100_000 or omega[0] >= omega[1]:
        raise InputError(f"{option} {text}: need low < high and a count from 2 to 100000")
    return np.geomspace(omega[0], omega[1], points)
