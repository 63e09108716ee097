"""The forces of a probe on the particles of a network that bear load, without net force on any connected component."""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.laws.loads import ForceLoad, force_load
from jampetsc.laws.probes import ProbedParticles
from jampetsc.response.contact_network import DistributedNetwork, find_pieces

MIN_FORCE_RATIO = 1e-10  # of the forces that are left without their mean: smaller ones are rounding


@dataclass(frozen=True, eq=False)
class ProbeLoads:
    """Right-hand sides of a probe, and what they make up."""

    loads: list[ForceLoad]  # L
    weights: np.ndarray  # (P, L): χ of each of P outcomes is this sum of the χ of the loads
    particles: ProbedParticles

    def susceptibility(self, G, bounds, volume: float):
        """χ (M, P), complex, and bounds on |Δχ|, |Δχ'|, |Δχ''|, (M, P, 3), of G* = −χ/V, (M, L), with its (M, L, 3)."""
        return -volume * G @ self.weights.T, volume * np.einsum("pl,mlb->mpb", self.weights, bounds)


def probe_loads(probe, source, network: DistributedNetwork) -> ProbeLoads:
    """The loads of a probe of `laws.probes` on a packing or network with these bonds. Collective.

    Rattlers and nodes without bonds bear no load. The mean force of each connected component is taken away, under drag
    as well, and with it the drift of a whole component: a net force F on n particles adds F²/(iω n w_d kτ₁) to χ.

    Raises InputError where nothing is left, and as the probe.
    """
    numbers = np.sort(np.concatenate(network.comm.allgather(network.particles)))
    particles = ProbedParticles(
        source.positions[network.particles], network.particles, numbers, source.cell, source.n
    )
    pieces, weights = find_pieces(network), probe.weights(particles)
    loads, kept = [], []
    for number, (forces, sizes) in enumerate(probe.columns(particles)):
        mean = pieces.mean(network, forces)
        forces, sizes = forces - mean, sizes + np.abs(mean)
        left, size = network.sum(np.array([np.sum(forces**2), np.sum(sizes**2)]))
        if left > MIN_FORCE_RATIO**2 * size:
            loads.append(force_load(str(probe), forces, sizes))
            kept.append(number)
    if not weights[:, kept].any(axis=1).all():
        raise InputError(
            f"{named('load')} {probe}: acts on all particles alike, so that nothing moves against the rest. Give "
            "another one."
        )
    return ProbeLoads(loads, weights[:, kept], particles)
