"""Contribution of each mode to the quasistatic response to a load, and the motion in the lowest modes alone.

With F = k_E·φ, the force of a unit load E on a mode φ of eigenvalue λ, the non-affine response and the moduli are

    ũ = −Σ (F/λ) φ ,     (G_affine − G₀) V = Σ F²/λ .

Modes are orthogonal, so |ũ|² is a sum over them as well. The motions Δu∥ and Δu⊥ that ũ gives the contacts are not:
the share of a mode is its projection on the whole, Σ_c Δu Δu_mode / Σ_c Δu². It can be negative; over all
modes the shares sum to one. Without pre-stress and with one stiffness of all contacts the share of Δu∥ is that of
G_affine − G₀; with its affine part, which is left out here, the whole Δu∥ is then orthogonal to all modes, for its
forces are in balance.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.statistics import Distribution
from jampetsc.petsc.inertia import SHIFT
from jampetsc.response.assembly import Pencil
from jampetsc.response.compatibility import along_and_across
from jampetsc.response.elastic import ElasticResponse

LOWEST = (10, 50, 200)  # numbers of lowest modes whose joint motion is recorded, as far as found
AFFINE = 1e-12  # a non-affine part of the modulus this small, relative to the affine one, is rounding
QUANTITIES = ("normal", "transverse", "nonaffine")


@dataclass(frozen=True, eq=False)
class Contributions:
    """Contributions of m modes. Medians are of |Δu∥|, |Δu⊥| and |u_na| per unit strain, over all contacts or disks."""

    share: dict  # "nonaffine", "normal", "transverse", "modulus" -> (m,) of Σ|ũ|², Σ(Δu∥)², Σ(Δu⊥)², G_affine − G₀
    count: np.ndarray  # (q,) entries of LOWEST that are at most m
    median: dict  # QUANTITIES -> (q,) of the motion that the lowest `count` modes make alone, no affine part
    whole: dict  # QUANTITIES -> the median of the whole response, the affine part of Δu∥ and Δu⊥ included


def contributions_of(
    pencil: Pencil, values, vectors, force, loads=()
) -> tuple[Contributions | None, "LoadContributions | None"]:
    """Contributions of modes to the response of their network to the load of the pencil, and to moduli of `loads`, with
    one factor of K. Collective.

    The first is None where zero modes leave the response undetermined, and where it is affine, as in a crystal; the
    second without `loads`.

    values (m,) λ > 0 in k, increasing; vectors (m, n_local, D) φ of unit length; force (m,) F, the same on all ranks
    """
    elastic = ElasticResponse(pencil.network) if values[0] > SHIFT else None
    return (
        elastic and _contributions(pencil, elastic, values, vectors, force),
        _load_contributions(pencil, elastic, values, vectors, loads) if loads else None,
    )


def _contributions(pencil, elastic, values, vectors, force):
    network = pencil.network
    shear = elastic.respond(pencil.load)
    field, _ = elastic.pencil.split(shear.x)
    loaded = elastic.pencil.under(pencil.load)
    imposed, affine = loaded.compatibility.g.reshape(shear.motions.shape), loaded.k_gg
    if affine - shear.value <= AFFINE * abs(affine):
        return None
    comm, motions = network.comm, shear.motions - imposed
    weights = -force / values
    count = np.array([number for number in LOWEST if number <= len(values)], int)
    median = {name: np.empty(len(count)) for name in QUANTITIES}
    products, alone, moved = (
        np.empty((len(values), motions.shape[1])),
        np.zeros_like(motions),
        np.zeros_like(field),
    )
    for row, (weight, vector) in enumerate(zip(weights, vectors, strict=True)):
        motion = weight * pencil.compatibility.motions(vector.ravel()).reshape(motions.shape)
        products[row] = np.sum(motion * motions, axis=0)
        alone += motion
        moved += weight * vector
        for place in np.flatnonzero(count == row + 1):
            for name, distribution in distributions(comm, *along_and_across(alone), moved).items():
                median[name][place] = distribution.median
    squares = network.sum(np.append(np.sum(motions**2, axis=0), np.sum(field**2)))
    products = network.sum(products)
    normal = products[:, 0] / squares[0]
    transverse = products[:, 1:].sum(axis=1) / squares[1:-1].sum()
    share = {
        "nonaffine": weights**2 / squares[-1],
        "normal": normal,
        "transverse": transverse,
        "modulus": force**2 / values / (affine - shear.value),
    }
    whole = distributions(comm, *along_and_across(shear.motions), field)
    return Contributions(share, count, median, {name: part.median for name, part in whole.items()})


@dataclass(frozen=True, eq=False)
class LoadContributions:
    """Contributions of m modes to the quasistatic moduli of L loads."""

    force: np.ndarray  # (m, L) F of a unit amplitude of each load
    modulus: np.ndarray  # (m, L) share of M_affine − M_E(0); nan where that is zero, or not unique


def _load_contributions(pencil, elastic, values, vectors, loads):
    network, pencils = pencil.network, [pencil.under(load) for load in loads]
    push = np.array([loaded.k_gamma.getArray() for loaded in pencils])
    force = network.sum(vectors.reshape(len(values), -1) @ push.T)
    share = np.full(force.shape, np.nan)
    if elastic is not None:
        for number, loaded in enumerate(pencils):
            relaxed = loaded.k_gg - elastic.respond(loaded.load).value
            if relaxed > AFFINE * abs(loaded.k_gg):
                share[:, number] = force[:, number] ** 2 / values / relaxed
    return LoadContributions(force, share)


def distributions(comm, *parts) -> dict:
    """QUANTITIES -> Distribution over all ranks' contacts, (…,) and (…,), and disks, (…, D). Collective."""
    named = zip(QUANTITIES, parts, strict=True)
    return {name: Distribution.of(np.concatenate(comm.allgather(part))) for name, part in named}
