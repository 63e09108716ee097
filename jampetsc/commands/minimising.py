"""A packing at rest from one that is not: `pack` at the packing fraction that it has."""

from jampetsc.commands.pack import Pack
from jampetsc.errors import InputError
from jampetsc.options.functions import make_function
from jampetsc.packing.packing import MINIMISED_PHIS, PARTICLES, Packing


def minimise(packing: Packing, **options) -> Packing:
    """A proved minimum of the energy in the cell of a packing, reached from its positions.

    options   as for `jampetsc.pack`, such as `tolerance`

    Collective. Raises as `jampetsc.pack`, and InputError for disks of a packing fraction out of [0.8, 1.5] and
    spheres out of [0.6, 1.2].
    """
    low, high = MINIMISED_PHIS[packing.dimension]
    if not low <= packing.phi <= high:
        raise InputError(
            f"phi = {packing.phi:.6g}: minimise keeps it, and it must lie in [{low:g}, {high:g}] for "
            f"{PARTICLES[packing.dimension]}. To change it call jampetsc.pack(from_=packing, phi=…)."
        )
    return make_function(Pack)(from_=packing, phi=packing.phi, **options)
