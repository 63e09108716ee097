"""Exact numbers of modes between frequencies, by Sylvester's law of inertia, without eigenvectors.

K has as many eigenvalues below ω² as L D Lᵀ of K − ω² has negative pivots, masses being one; with masses of a network
M^(−½)KM^(−½) takes its place. Each frequency takes one factorisation. Few ranks with small factors take edges in turn,
each with all of K; else all share each factor.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.collective import agreed
from jampetsc.errors import InputError, named
from jampetsc.laws.damping import UNDAMPED
from jampetsc.petsc.inertia import MIN_VALUE_RATIO, PREFIX, ShiftedInertia, UncertainCount
from jampetsc.petsc.session import current
from jampetsc.progress import Progress
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import DistributedNetwork
from jampetsc.response.factor_memory import require_memory
from jampetsc.response.mass_matrix import mass_weighted
from jampetsc.response.minimum_check import require_minimum
from jampetsc.response.shift_factors import bytes_of_factor, side_by_side

MAX_EDGE_RATIO = 1e3  # largest edge over a bound on all frequencies


@dataclass(frozen=True, eq=False)
class ModeCounts:
    """Numbers of modes of one network between frequencies, translations left out. Their sum is that of all modes."""

    network: DistributedNetwork
    edges: np.ndarray  # (E,) frequencies √λ, increasing, in the unit of √k
    counts: np.ndarray  # (E − 1,) modes between neighbouring edges
    below: int  # modes below the first edge, with modes of no energy
    above: int  # modes above the last edge


def count_between(network: DistributedNetwork, edges, proved: bool = False) -> ModeCounts:
    """Exact numbers of modes between the frequencies `edges` (E,), E ≥ 2, increasing. Collective.

    Unless it is `proved` that K has no negative modes, this is checked. Needs the real build.

    Raises InputError for a packing that is not a minimum, for edges that are too low or too high and for an edge at a
    mode, to rounding; ConvergenceError as `ShiftedInertia.count_certified`.
    """
    pencil, comm = mass_weighted(assemble(network, UNDAMPED, pinned=False)), network.comm
    norm = pencil.K.norm(current().PETSc.NormType.INFINITY)  # above all eigenvalues
    low, high = np.sqrt(MIN_VALUE_RATIO * norm), MAX_EDGE_RATIO * np.sqrt(norm)
    for edge in (edges[0], edges[-1]):
        if not low <= edge <= high:
            raise InputError(
                f"{named('states')} {edge:g}: must lie between {low:.3g} and {high:.3g}. Softer modes are not "
                "distinguished from translations, stiffer ones do not exist."
            )
    alone = side_by_side(comm.size, bytes_of_factor(pencil), "auto")
    own = np.arange(comm.rank, len(edges), comm.size) if alone else np.arange(len(edges))
    below = np.zeros(len(edges), int)
    with agreed(comm):
        holder = replace(network, comm=current().MPI.COMM_SELF) if alone else network
        require_memory(holder, pencil.unknowns, PREFIX)
    if not proved:
        require_minimum(network)
    K = pencil.K.getRedundantMatrix(comm.size) if alone else pencil.K
    with agreed(comm), Progress(len(own), "edges", comm.rank) as progress:
        inertia = ShiftedInertia(K, "K − ω²")
        for number in own:
            try:
                below[number] = inertia.count_certified(edges[number] ** 2) - pencil.pieces.translations
            except UncertainCount as error:
                raise InputError(
                    f"{named('states')} {float(edges[number])!r}: a mode lies there to rounding, so it cannot be "
                    "counted. Give another edge."
                ) from error
            progress.step(f"ω = {edges[number]:.4g}: {below[number]} modes below")
    if alone:
        below = network.sum(below)
    above = pencil.unknowns - pencil.pieces.translations - below[-1]
    return ModeCounts(network, edges, np.diff(below), int(below[0]), int(above))
