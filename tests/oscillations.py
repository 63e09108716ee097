"""Solvers of oscillations of a packing, as tests of several rooms ask for them."""

from samples import network_of

from jampetsc.oscillation.power_law import MAX_SLOPE_RATIO
from jampetsc.oscillation.steady_oscillation import SteadyOscillation
from jampetsc.petsc.session import current


def mean_diameter(disks):
    """The length in the power law."""
    return 2.0 * float(disks.radii.mean())


def steady_oscillation(disks, physics, steps, stiffest=MAX_SLOPE_RATIO):
    """A SteadyOscillation of these disks. Collective."""
    network = network_of(disks, physics, current().comm)
    return SteadyOscillation(network, physics.law, mean_diameter(disks), steps, stiffest)
