"""Low modes of K: their floppiness, their contribution to the response to a load, and proof that none was missed.

A mode φ of eigenvalue λ moves the contacts by a∥, a⊥ (BT eq. 4): λ = Σ_c [k a∥² − (f/r) a⊥²] with |φ| = 1.
Floppy modes slide, a⊥ ≫ a∥. Their contribution to the response to shear is in `contributions`.

The count is certified by Sylvester's law: as many eigenvalues below μ, just above the last mode, as LDLᵀ of K
− μ has negative pivots.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.laws.damping import UNDAMPED
from jampetsc.laws.loads import Load
from jampetsc.network.contact_network import DistributedNetwork
from jampetsc.petsc.eigen import lowest
from jampetsc.petsc.inertia import PREFIX, SHIFT, count_below
from jampetsc.response.assembly import Pencil, assemble
from jampetsc.response.contributions import Contributions, LoadContributions, contributions_of
from jampetsc.response.factor_memory import require_memory
from jampetsc.response.minimum_check import require_minimum

GAP = 1e-7  # eigenvalues closer than this, relatively, form a cluster: a count cannot separate them
ATTEMPTS = 4  # with more modes each time, if a cluster is cut or the count shows that some were missed
# largest ‖Kφ − λφ‖ accepted, in units of the stiffness; |Δλ| is less: its square over the gap
RESIDUAL = 1e-9
ALIKE = 1e-6  # largest |φ_i·φ_j − δ_ij| accepted: a mode found twice must not count as two


@dataclass(frozen=True, eq=False)
class VibrationalModes:
    """m modes of one network, eigenvalues increasing, translations left out."""

    network: DistributedNetwork
    eigenvalues: np.ndarray  # (m,) λ, in k
    vectors: np.ndarray  # (m, n_local, D) φ, |φ| = 1
    residuals: np.ndarray  # (m,) ‖Kφ − λφ‖, in k
    normal: np.ndarray  # (m,) mean over contacts of a∥²
    transverse: np.ndarray  # (m,) mean over contacts of a⊥²
    participation_ratio: np.ndarray  # (m,) (Σ|φ_i|²)²/(n Σ|φ_i|⁴), 1 if all disks move alike
    shear_force: (
        np.ndarray
    )  # (m,) F = k_E·φ per unit amplitude of the load, simple shear unless another is given
    contributions: Contributions | None  # to the response to the load; None if that is not unique, or affine
    tensor: LoadContributions | None  # to the responses to the loads of a tensor
    inertia_count: int  # eigenvalues below `inertia_shift`, translations left out, by inertia: equals m
    inertia_shift: float  # μ, in k
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
    """The lowest `count` modes, or all `below` an eigenvalue (in k), or all there are if both are None.
    Collective.

    Where the last one is in a cluster of equal eigenvalues, the whole cluster is returned. Unless it is `proved`
    that K has no negative modes, this is checked. Contributions are to the response to `load`, simple shear if not
    given, and to several loads `tensor`. Needs the real build.

    Raises InputError for a packing that is not a minimum, for more modes than there are and for none below;
    ConvergenceError when they are not found or their number does not agree with inertia.
    """
    stiffness = network.max(network.contacts.stiffness)
    pencil = assemble(network, UNDAMPED, pinned=False)
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
        kept, shift = _cut(pairs.values, count, available, stiffness)
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
    values = pencil.network.sum(np.array([c.w_K @ c.motions(vector) ** 2 for vector in pairs.vectors]))
    return replace(pairs, values=values)[np.argsort(values, kind="stable")]


def _cut(values, count, available, stiffness):
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
    for row, vector in enumerate(pairs.vectors):
        squares = np.sum(vector.reshape(-1, dimension) ** 2, axis=1)
        motions = pencil.compatibility.motions(vector).reshape(-1, dimension)
        along, *across = np.sum(motions**2, axis=0)
        sums[row] = along, sum(across), np.sum(squares**2), push @ vector
    sums = network.sum(sums)
    contacts, force = network.contact_count, sums[:, 3]
    fields = pairs.vectors.reshape(m, -1, dimension)
    contributions, of_loads = contributions_of(pencil, pairs.values, fields, force, loads)
    return VibrationalModes(
        network, pairs.values, fields, pairs.residuals,
        normal=sums[:, 0] / contacts, transverse=sums[:, 1] / contacts,
        participation_ratio=1.0 / (network.n * sums[:, 2]),
        shear_force=force, contributions=contributions, tensor=of_loads,
        inertia_count=m, inertia_shift=shift, complete=complete,
        method=pairs.method, restarts=pairs.iterations,
    )  # fmt: skip
