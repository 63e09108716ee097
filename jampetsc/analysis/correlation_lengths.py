"""Collapse of the correlation lengths under Stokes drag (BT Fig. 7), and how far from one curve they are."""

import numpy as np

from jampetsc.analysis.scaling import collapse_spread
from jampetsc.errors import InputError

LOG_EXPONENT = 0.65  # of −ln p in BT's collapse of the Stokes length
SHORTEST, LONGEST = 1.3, 0.13  # lengths that can collapse: above so many diameters and below so many L


def stokes_collapse(omega, length, pressure, exponent=LOG_EXPONENT):
    """(ω/p^½, l (−ln p)^exponent): collapse of the correlation length under Stokes drag, p in units of k.

    BT print the exponent 0.65. Lengths measured with this program, p from 1e-5 to 1e-2 and N up to 32768,
    grow as p falls at equal ω/p^½ and collapse with −0.65. Raises InputError unless 0 < p < 1.
    """
    if not 0 < pressure < 1:
        raise InputError(f"pressure {pressure:g}: the collapse of lengths needs 0 < p < k")
    return np.asarray(omega) / np.sqrt(pressure), np.asarray(length) * (-np.log(pressure)) ** exponent


def medium_collapse(omega, length, G):
    """(√(|G*|/ω), l): the length under Stokes drag against that of an elastic medium (docs/physics.md).

    G (F,) complex in k is that of the solid alone, without iωη_F; ω in 1/τ₁.
    """
    return np.sqrt(np.abs(G) / omega), np.asarray(length)


def length_spread(lengths, collapse) -> float:
    """How far from one curve collapsed lengths are: rms of the standard deviation of ln y between files.

    lengths    sequence of (omega, l/d (F,) complex for Re and Im, L/d, …)
    collapse   (omega, l/d, …) -> (x, y) with the rest of each entry, such as `stokes_collapse`

    Lengths near the size of a disk or of the cell are left out. Raises InputError if nothing overlaps.
    """
    scaled = []
    for omega, length, size, *more in lengths:
        parts = [
            np.where((part > SHORTEST) & (part < LONGEST * size), part, 0.0)
            for part in (length.real, length.imag)
        ]
        x, y = collapse(omega, parts[0] + 1j * parts[1], *more)
        scaled.append((x, y, 1.0))
    return collapse_spread(scaled, end=np.inf)
