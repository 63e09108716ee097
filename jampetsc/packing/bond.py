"""The formulas of `strain` and `potentials` compiled: what every loop over pairs inlines."""

import numpy as np

from jampetsc.packing import strain
from jampetsc.packing.compiled import FAST, compiled
from jampetsc.packing.potentials import secant_stiffness

_inlined = compiled(FAST, cache=False, forceinline=True)
simple_shear, growth_and_shear = _inlined(strain.simple_shear), _inlined(strain.growth_and_shear)
bond_vector = _inlined(strain.bond_vector)
secant = _inlined(secant_stiffness)
# not FAST: whether a list serves is decided in exact order
_exact = compiled(False, cache=False)
stretch, determinant, strain_between = (
    _exact(strain.stretch),
    _exact(strain.determinant),
    _exact(strain.strain_between),
)


@compiled(False)
def pair_energy(rx, ry, sigma, law):
    """V of one pair at distance |r|; law = `potential.constants`."""
    overlap = sigma - np.sqrt(rx * rx + ry * ry)
    if overlap <= 0.0:
        return 0.0
    return secant(overlap, sigma, law) * overlap * overlap / (2.5 if law[1] else 2.0)
