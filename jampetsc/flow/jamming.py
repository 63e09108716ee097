"""Which random packings jam: uniformly random disks at a packing fraction, and the minimum of the energy downhill.

The fraction f(φ, N) of jammed samples and their pressures P(p) are Vågberg's RAND ensemble (thesis sec. 4.7, after
O'Hern et al., PRE 68, 011306 (2003)).
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.contacts.potentials import Potential
from jampetsc.errors import ConvergenceError
from jampetsc.flow.slowly import look_at
from jampetsc.packing.descent import Goal
from jampetsc.packing.minimise import minimise, settle
from jampetsc.packing.protocols import random_start

SETTLED = 1e-4  # max |F| in k_e/d, to which a random start is relaxed before it is minimised


@dataclass(frozen=True)
class Sample:
    """A random start and what became of it; nan where no minimum was found."""

    phi: float
    seed: int
    energy: float  # U/N
    pressure: float
    jammed: float  # 1 or 0
    coordination: float


def sample(radii, phi: float, seed: int, potential: Potential, solver, tolerance: float) -> Sample:
    """Quench random disks of these radii (N,) at φ; the seed decides where they start."""
    start = settle(random_start(radii, phi, seed, potential), SETTLED)
    try:
        found = look_at(minimise(start, Goal(), solver, tolerance=tolerance).disks)
    except ConvergenceError:
        return Sample(phi, seed, *[np.nan] * 4)
    return Sample(
        phi, seed, found.energy / len(radii), found.pressure, float(found.jammed), found.coordination
    )
