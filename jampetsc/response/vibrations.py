"""Low modes of K: their floppiness, their contribution to the response to shear, and proof that none was missed.

A mode φ of eigenvalue λ moves the contacts by a∥, a⊥ (BT eq. 4): λ = Σ_c [k a∥² − (f/r) a⊥²] with |φ| = 1.
Floppy modes slide, a⊥ ≫ a∥. Their contribution to the response to shear is in `contributions`.

The count is certified by Sylvester's law: as many eigenvalues below μ, just above the last mode, as LDLᵀ of K
− μ has negative pivots.
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import ConvergenceError, InputError, about, named
from jampetsc.io.outlet import Outlet
from jampetsc.io.packing_file import read_identified, source_name
from jampetsc.laws.damping import UNDAMPED
from jampetsc.network.contact_network import Network, build_network
from jampetsc.packing.minimum_proof import proved_minimum
from jampetsc.petsc.eigen import lowest
from jampetsc.petsc.inertia import SHIFT, count_below
from jampetsc.petsc.session import current
from jampetsc.response.assembly import Pencil, assemble
from jampetsc.response.contributions import Contributions, contributions_of
from jampetsc.response.minimum_check import examine_balance, require_minimum
from jampetsc.response.run_record import run_record

FORMAT = "jampetsc-modes"
PER_MODE = "eigenvalues residuals normal transverse participation_ratio floppiness shear_force".split()
ATTRIBUTES = "inertia_count inertia_shift complete method restarts".split()  # of the file
GAP = 1e-7  # eigenvalues closer than this, relatively, form a cluster: a count cannot separate them
ATTEMPTS = 4  # with more modes each time, if a cluster is cut or the count shows that some were missed
# largest ‖Kφ − λφ‖ accepted, in units of the stiffness; |Δλ| is less: its square over the gap
RESIDUAL = 1e-9
ALIKE = 1e-6  # largest |φ_i·φ_j − δ_ij| accepted: a mode found twice must not count as two


@dataclass(frozen=True, eq=False)
class VibrationalModes:
    """m modes of one network, eigenvalues increasing, translations left out."""

    network: Network
    eigenvalues: np.ndarray  # (m,) λ, in k
    vectors: np.ndarray  # (m, n_local, 2) φ, |φ| = 1
    residuals: np.ndarray  # (m,) ‖Kφ − λφ‖, in k
    normal: np.ndarray  # (m,) mean over contacts of a∥²
    transverse: np.ndarray  # (m,) mean over contacts of a⊥²
    participation_ratio: np.ndarray  # (m,) (Σ|φ_i|²)²/(n Σ|φ_i|⁴), 1 if all disks move alike
    shear_force: np.ndarray  # (m,) F = k_γ·φ per unit strain
    contributions: Contributions | None  # of the response to shear; None if that is not unique, or affine
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
    network: Network, count: int | None = None, below: float | None = None, proved: bool = False
) -> VibrationalModes:
    """The lowest `count` modes, or all `below` an eigenvalue (in k), or all there are if both are None.
    Collective.

    Where the last one is in a cluster of equal eigenvalues, the whole cluster is returned. Unless it is `proved`
    that K has no negative modes, this is checked. Needs the real build.

    Raises InputError for a packing that is not a minimum, for more modes than there are and for none below;
    ConvergenceError when they are not found or their number does not agree with inertia.
    """
    stiffness = network.max(network.contacts.stiffness)
    pencil = assemble(network, UNDAMPED, pinned=False)
    if not proved:
        require_minimum(network)
    if below is not None:
        count = count_below(pencil.K, below, "K − λ") - pencil.pieces.translations
        if count <= 0:
            raise InputError(
                f"{named('below')} {below:g}: no mode lies there; raise it, or ask for a number with {named('count')}"
            )
    there = pencil.unknowns - pencil.pieces.translations
    wanted = there if count is None else count
    pairs, kept, shift = _certified(pencil, wanted, there, stiffness)
    return _describe(pencil, pairs[:kept], shift, kept == there)


def _certified(pencil, count, there, stiffness):
    """(pairs, m, μ): eigenpairs of which the first m ≥ count of all `there` are those below μ, by inertia."""
    wanted, pairs = count, None
    for _ in range(ATTEMPTS):
        if pairs is None:
            pairs = _with_quotients(lowest(pencil, wanted, stiffness), pencil)
        worst = pairs.residuals.max()
        if not worst <= RESIDUAL * stiffness:
            raise ConvergenceError(
                f"a mode has a residual of {worst:.1e}: tighten -modes_eps_tol or change the factorisation"
            )
        if pairs.method != "lapack":
            _require_different(pairs.vectors, pencil.network)
        kept, shift = _cut(pairs.values, count, there, stiffness)
        if kept == there:
            return pairs, kept, shift
        if kept is None:  # the last cluster is cut: find more of it
            wanted, pairs = min(there, wanted + 8), None
            continue
        counted = count_below(pencil.K, shift, "K − μ") - pencil.pieces.translations
        if counted == kept:
            return pairs, kept, shift
        # Lanczos finds one vector of equal eigenvalues, others only by rounding: search orthogonally to those found.
        more = lowest(pencil, max(1, min(counted, there) - kept), stiffness, known=pairs.vectors)
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


def _cut(values, count, there, stiffness):
    """(m, μ): the end of the cluster of eigenvalue number `count`, and a value in the gap above it.

    (None, None) if the values end before it.
    """
    for m in range(count, len(values)):
        low, high = values[m - 1], values[m]
        if high - low > GAP * abs(high) + SHIFT * stiffness:
            return m, float(0.5 * (low + high))
    return (there, float(values[-1])) if len(values) == there else (None, None)


def _describe(pencil: Pencil, pairs, shift, complete):
    network, m = pencil.network, len(pairs.values)
    sums = np.empty((m, 4))
    push = pencil.k_gamma.getArray()
    for row, vector in enumerate(pairs.vectors):
        squares = np.sum(vector.reshape(-1, 2) ** 2, axis=1)
        motions = pencil.compatibility.motions(vector).reshape(-1, 2)
        sums[row] = *np.sum(motions**2, axis=0), np.sum(squares**2), push @ vector
    sums = network.sum(sums)
    contacts, force = network.contact_count, sums[:, 3]
    fields = pairs.vectors.reshape(m, -1, 2)
    return VibrationalModes(
        network, pairs.values, fields, pairs.residuals,
        normal=sums[:, 0] / contacts, transverse=sums[:, 1] / contacts,
        participation_ratio=1.0 / (network.n * sums[:, 2]),
        shear_force=force, contributions=contributions_of(pencil, pairs.values, fields, force),
        inertia_count=m, inertia_shift=shift, complete=complete,
        method=pairs.method, restarts=pairs.iterations,
    )  # fmt: skip


def run(packing, to: Outlet, prestress: bool, count=None, below=None) -> VibrationalModes:
    """Find modes as `lowest_modes` does and write them.

    Collective. Raises as that does, naming the packing.
    """
    started = time.perf_counter()
    session = current()
    disks, identity = read_identified(packing, session.comm)
    to.made_from(disks)
    with about(source_name(packing)), session.stage("modes"):
        examine_balance(source_name(packing), disks, session.comm)
        network = build_network(disks, session.comm, prestress)
        modes = lowest_modes(network, count, below, proved=not prestress or proved_minimum(disks))
    with session.stage("output"), to.writer(FORMAT, session.comm) as writer:
        _write(writer, modes)
        writer.attributes(**run_record(disks, identity, {"prestress": prestress}, network, started))
    return modes


def _write(writer, modes):
    writer.distributed("particles", modes.network.particles)
    writer.distributed("modes", modes.vectors, axis=1)
    per_mode = {name: getattr(modes, name) for name in PER_MODE}
    contributions = modes.contributions
    if contributions is not None:
        per_mode |= {f"share/{name}": share for name, share in contributions.share.items()}
        per_mode |= {f"cumulative/{name}": np.cumsum(share) for name, share in contributions.share.items()}
        per_mode |= {"lowest/count": contributions.count}
        per_mode |= {f"lowest/{name}_median": found for name, found in contributions.median.items()}
        writer.attributes(**{f"{name}_median": found for name, found in contributions.whole.items()})
    for name, values in per_mode.items():
        writer.dataset(name, values)
    attributes = {name: getattr(modes, name) for name in ATTRIBUTES}
    writer.attributes(**attributes, contacts=modes.network.contact_count)
