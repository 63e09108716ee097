"""Low modes of K: their floppiness, their contribution to the response to a load, and proof that none was missed.

A mode φ of eigenvalue λ moves the contacts by a∥, a⊥ (BT eq. 4): λ = Σ_c [k a∥² − (f/r) a⊥²] with |φ| = 1.
Masses are one; in a network with masses Kφ = λMφ with φᵀMφ = 1, and ψ = M^(½)φ is found, an eigenvector of
M^(−½)KM^(−½). Floppy modes slide, a⊥ ≫ a∥. The count is certified by Sylvester's law: as many eigenvalues below μ,
just above the last mode, as LDLᵀ of K − μ has negative pivots.

With F = k_E·φ, the force of a unit load E on a mode φ of eigenvalue λ, the non-affine response and the moduli are

    ũ = −Σ (F/λ) φ ,     (G_affine − G₀) V = Σ F²/λ .

Modes are orthogonal, so ũᵀMũ is a sum over them as well, |ũ|² where all masses are one. The motions Δu∥ and Δu⊥ that
ũ gives the contacts are not: the share of a mode is its projection on the whole, Σ_c Δu Δu_mode / Σ_c Δu². It can be
negative; over all modes the shares sum to one. Without pre-stress and with one stiffness of all contacts the share of
Δu∥ is the share of G_affine − G₀; with its affine part, which is left out here, the whole Δu∥ is then orthogonal to all
modes, for its forces are in balance.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.laws.damping import UNDAMPED
from jampetsc.laws.loads import Load
from jampetsc.petsc.eigen import lowest
from jampetsc.petsc.inertia import PREFIX, SHIFT, count_below
from jampetsc.response.assembly import Pencil, assemble
from jampetsc.response.compatibility import along_and_across
from jampetsc.response.contact_network import DistributedNetwork
from jampetsc.response.elastic import ElasticResponse
from jampetsc.response.factor_memory import require_memory
from jampetsc.response.mass_matrix import mass_weighted
from jampetsc.response.minimum_check import require_minimum
from jampetsc.response.slow_response import QUANTITIES, distributions

GAP = 1e-7  # eigenvalues closer than this, relatively, form a cluster: a count cannot separate them
ATTEMPTS = 4  # with more modes each time, if a cluster is cut or the count shows that some were missed
# largest ‖Kφ − λφ‖ accepted, in units of the stiffness; |Δλ| is less: its square over the gap
RESIDUAL = 1e-9
ALIKE = 1e-6  # largest |φ_i·φ_j − δ_ij| accepted: a mode found twice must not count as two
LOWEST = (10, 50, 200)  # numbers of lowest modes whose joint motion is recorded, as far as found
AFFINE = 1e-12  # a non-affine part of the modulus this small, relative to the affine one, is rounding


@dataclass(frozen=True, eq=False)
class Contributions:
    """Contributions of m modes. Medians are of |Δu∥|, |Δu⊥| and |u_na| per unit strain, over all contacts or disks."""

    # "nonaffine", "normal", "transverse", "modulus" -> (m,) of ũᵀMũ, Σ(Δu∥)², Σ(Δu⊥)², G_affine − G₀
    share: dict
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

    values (m,) λ > 0, increasing; vectors (m, n_local, D) φ with φᵀMφ = 1; force (m,) F, the same on all ranks
    """
    elastic = ElasticResponse(pencil.network) if values[0] > SHIFT * _stiffness(pencil.network) else None
    return (
        elastic and _contributions(pencil, elastic, values, vectors, force),
        _load_contributions(pencil, elastic, values, vectors, loads) if loads else None,
    )


def _stiffness(network):
    """Stiffness of the stiffest contact, the unit of eigenvalues. Collective."""
    return network.max(network.contacts.stiffness)


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
    squares = network.sum(np.append(np.sum(motions**2, axis=0), _square_in_masses(pencil, field)))
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


def _square_in_masses(pencil, field):
    """This rank's part of ũᵀMũ of a field (n_local, D) without mean; with masses without tᵀMũ. Collective."""
    if pencil.mass is None:
        return np.sum(field**2)
    return np.sum(pencil.mass.diagonal * pencil.mass.centred(field.ravel()) ** 2)


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


@dataclass(frozen=True, eq=False)
class VibrationalModes:
    """m modes of one network, eigenvalues increasing, translations left out."""

    network: DistributedNetwork
    eigenvalues: np.ndarray  # (m,) λ, in the unit of k over that of the mass
    vectors: np.ndarray  # (m, n_local, D) φ, φᵀMφ = 1
    residuals: np.ndarray  # (m,) ‖M^(−½)(Kφ − λMφ)‖, likewise
    normal: np.ndarray  # (m,) mean over contacts of a∥²
    transverse: np.ndarray  # (m,) mean over contacts of a⊥²
    # (m,) (Σ m_i|φ_i|²)²/(n Σ m_i²|φ_i|⁴), 1 if all disks have as much energy
    participation_ratio: np.ndarray
    # (m,) F = k_E·φ per unit amplitude of the load, simple shear unless another is given
    shear_force: np.ndarray
    contributions: Contributions | None  # to the response to the load; None if that is not unique, or affine
    tensor: LoadContributions | None  # to the responses to the loads of a tensor
    inertia_count: int  # eigenvalues below `inertia_shift`, translations left out, by inertia: equals m
    inertia_shift: float  # μ, in the unit of k
    complete: bool  # these are all modes of K
    method: str
    restarts: int

    @property
    def floppiness(self):
        """rms a⊥ over rms a∥, (m,); infinite for a mode that only slides."""
        with np.errstate(divide="ignore"):
            return np.sqrt(self.transverse / self.normal)


def lowest_modes(
    network: DistributedNetwork,
    count: int | None = None,
    below: float | None = None,
    proved: bool = False,
    load: Load | None = None,
    tensor: tuple = (),
) -> VibrationalModes:
    """The lowest `count` modes, or all `below` an eigenvalue, or all there are if both are None. Collective.

    Where the last one is in a cluster of equal eigenvalues, the whole cluster is returned. Unless it is `proved`
    that K has no negative modes, this is checked. Contributions are to the response to `load`, simple shear if not
    given, and to several loads `tensor`. Needs the real build.

    Raises InputError for a packing that is not a minimum, for more modes than there are and for none below;
    ConvergenceError when they are not found or their number does not agree with inertia.
    """
    stiffness = _stiffness(network)
    if below is not None and not below > SHIFT * stiffness:
        raise InputError(
            f"{named('below')} {below:g}: must be above {SHIFT * stiffness:g}. Softer modes are not distinguished from "
            "translations."
        )
    pencil = mass_weighted(assemble(network, UNDAMPED, pinned=False))
    require_memory(network, pencil.unknowns, PREFIX)
    if not proved:
        require_minimum(network)
    if below is not None:
        count = count_below(pencil.K, below, "K − λ") - pencil.pieces.translations
        if count <= 0:
            raise InputError(
                f"{named('below')} {below:g}: no mode below it. Raise it, or give a number with {named('count')}."
            )
    available = pencil.unknowns - pencil.pieces.translations
    requested = available if count is None else count
    pairs, kept, shift = _certified(pencil, requested, available, stiffness)
    return _describe(pencil.under(load or pencil.load), pairs[:kept], shift, kept == available, tensor)


def _certified(pencil, count, available, stiffness):
    """(pairs, m, μ): eigenpairs of which the first m ≥ count of all `available` lie below μ, by inertia."""
    requested, pairs = count, None
    for _ in range(ATTEMPTS):
        if pairs is None:
            pairs = _with_quotients(lowest(pencil, requested, stiffness), pencil)
        worst = pairs.residuals.max()
        if not worst <= RESIDUAL * stiffness:
            raise ConvergenceError(
                f"a mode has a residual of {worst:.1e}: tighten -modes_eps_tol or change the factorisation"
            )
        if pairs.method != "lapack":
            _require_different(pairs.vectors, pencil.network)
        kept, shift = find_cluster_end(pairs.values, count, available, stiffness)
        if kept == available:
            return pairs, kept, shift
        if kept is None:  # the last cluster is cut: find more of it
            requested, pairs = min(available, requested + 8), None
            continue
        counted = count_below(pencil.K, shift, "K − μ") - pencil.pieces.translations
        if counted == kept:
            return pairs, kept, shift
        # Lanczos finds one vector of equal eigenvalues, others only by rounding: search orthogonally to those found.
        more = lowest(pencil, max(1, min(counted, available) - kept), stiffness, excluded=pairs.vectors)
        pairs = _with_quotients(_together(pairs, more), pencil)
    raise ConvergenceError(
        f"{len(pairs.values)} modes were found and their count does not agree with inertia: some of a cluster are "
        "missed; try a larger -modes_eps_ncv"
    )


def _require_different(vectors, network):
    """Raise ConvergenceError unless the modes (m, unknowns_local) are orthonormal: one found twice counts as two."""
    products = network.sum(vectors @ vectors.T)
    defect = np.abs(products - np.eye(len(products))).max(initial=0.0)
    if not defect <= ALIKE:
        raise ConvergenceError(
            f"modes are not orthonormal, but for {defect:.1e}: tighten -modes_eps_tol or change -modes_eps_type"
        )


def _together(pairs, more):
    """Both sets of eigenpairs joined."""
    return replace(
        pairs,
        values=np.append(pairs.values, more.values),
        vectors=np.vstack((pairs.vectors, more.vectors)),
        residuals=np.append(pairs.residuals, more.residuals),
        iterations=pairs.iterations + more.iterations,
    )


def _with_quotients(pairs, pencil):
    """The same pairs with λ = Σ w a², summed contact by contact: small eigenvalues keep their digits."""
    c = pencil.compatibility
    moves = pencil.mass_scale * pairs.vectors
    values = pencil.network.sum(np.array([c.w_K @ c.motions(move) ** 2 for move in moves]))
    return replace(pairs, values=values)[np.argsort(values, kind="stable")]


def find_cluster_end(values, count, available, stiffness):
    """(m, μ): the end of the cluster of eigenvalue number `count`, and a value in the gap above it.

    (None, None) if the values end before it.
    """
    for m in range(count, len(values)):
        low, high = values[m - 1], values[m]
        if high - low > GAP * abs(high) + SHIFT * stiffness:
            return m, float(0.5 * (low + high))
    return (available, float(values[-1])) if len(values) == available else (None, None)


def _describe(pencil: Pencil, pairs, shift, complete, loads):
    network, m, dimension = pencil.network, len(pairs.values), pencil.dimension
    sums = np.empty((m, 4))
    push = pencil.k_gamma.getArray()
    moves = pencil.mass_scale * pairs.vectors
    for row, (vector, move) in enumerate(zip(pairs.vectors, moves, strict=True)):
        squares = np.sum(vector.reshape(-1, dimension) ** 2, axis=1)
        motions = pencil.compatibility.motions(move).reshape(-1, dimension)
        along, *across = np.sum(motions**2, axis=0)
        sums[row] = along, sum(across), np.sum(squares**2), push @ move
    sums = network.sum(sums)
    contacts, force = network.contact_count, sums[:, 3]
    fields = moves.reshape(m, -1, dimension)
    contributions, of_loads = contributions_of(pencil, pairs.values, fields, force, loads)
    return VibrationalModes(
        network, pairs.values, fields, pairs.residuals,
        normal=sums[:, 0] / contacts, transverse=sums[:, 1] / contacts,
        participation_ratio=1.0 / (network.n * sums[:, 2]),
        shear_force=force, contributions=contributions, tensor=of_loads,
        inertia_count=m, inertia_shift=shift, complete=complete,
        method=pairs.method, restarts=pairs.iterations,
    )  # fmt: skip
