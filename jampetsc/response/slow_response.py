"""The quasistatic response to shear, G₀, η₀ and η_∞, from a handful of real solves (BT: 'Relation to floppiness').

Per unit strain: Δu∥ = a∥ and Δu⊥ = a⊥ of each contact and the non-affine displacement u_na of each disk. BT
eqs. 19–21 expect them to scale like p^¼, p^−¼ and p^−¼. Without pre-stress k Σ (Δu∥)² = G₀ V exactly, and
every run checks it. On BT's plateau of the mean |Δu∥| at low pressure see papers/claims/motion.py.

The two limits of G''/ω follow without any frequency. η₀ V γ² is the dissipation form of B at the quasistatic field,
minimised over the angles (torques vanish as ω → 0):

    η₀ = (kτ₁/V) [ Σ a∥² + β min_θ Σ (a⊥ − ρ_i θ_i − ρ_j θ_j)² ]     damping by contacts, split as in BT eq. 22
    η₀ = (kτ₁/V) Σ |ũ_i|² + η_F                                      by the fluid

and the sum of both with their weights where both dissipate. η_∞ V γ² is the minimum of B over all fields and angles.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.statistics import Distribution
from jampetsc.errors import InputError
from jampetsc.laws.damping import Law
from jampetsc.laws.loads import compression
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.session import current
from jampetsc.petsc.shifted import PREFIX, ShiftedFactor
from jampetsc.petsc.sparse_matrices import set_diagonal
from jampetsc.response.assembly import Pencil, assemble
from jampetsc.response.compatibility import along_and_across
from jampetsc.response.contact_network import DistributedNetwork
from jampetsc.response.elastic import ElasticResponse, relax
from jampetsc.response.factor_memory import require_memory
from jampetsc.response.shift_factors import factored_unknowns, splits_spins

QUANTITIES = ("normal", "transverse", "nonaffine")
BARE = "no_prestress"  # name of the results for K without pre-stress, where K has it


@dataclass(frozen=True, eq=False)
class ViscousResponse:
    """η₀ of one quasistatic field, in its parts, and how the disks turn in it. Viscosities in kτ₁."""

    parts: dict  # "normal" and "transverse" of contacts, "drag" and "fluid": those that the law has
    rotation: np.ndarray | None  # (n_local,), in 3D (n_local, 3), θ per unit strain where disks roll
    sliding: np.ndarray | None  # (contacts_local,) a⊥ᶜ where disks roll, in 3D its length
    motions: np.ndarray  # (rows_local,) of the contacts
    field: np.ndarray  # (unknowns_local,)

    @property
    def eta0(self) -> float:
        """η₀."""
        return sum(self.parts.values())


def quasistatic_flow(pencil: Pencil, field, turn=None) -> ViscousResponse:
    """η₀ of a quasistatic field under the law of a pencil. Collective.

    turn    the `spin_solver` of the pencil under any load, so that several fields share it
    field   (n_local, D), non-affine displacements per unit strain, where K acts on spins with these: (n_local, dofs).
            With drag, the mean displacement of each piece must be zero; without, the displacements of pinned disks.
    """
    network, law, c = pencil.network, pencil.law, pencil.compatibility
    start = np.zeros((len(field), pencil.dofs))
    start[:, : field.shape[1]] = field
    x, motions = start.ravel(), c.motions(start.ravel()) + c.g
    if pencil.rolls and not network.turns_elastically:
        turn = turn or spin_solver(pencil)
        flow = relax(c, c.w_B, turn, c.g, "rotations of the quasistatic flow", x, c.drag)
        x, motions = flow.x, flow.motions.ravel()
    parts = _fluid_parts(pencil, x) if not law.is_of_contacts else {}
    rotation = sliding = None
    if pencil.rolls:
        rotation, axes = pencil.split(x)[1], [0, *c.axes_of("sliding")]
        sliding = along_and_across(motions.reshape(-1, c.forms)[:, axes])[1].copy() if axes[1:] else None
    if law.damps_contacts:
        by_axis = motions.reshape(-1, c.forms)
        costs = network.sum(np.einsum("cf,cf->f", c.w_B.reshape(by_axis.shape), by_axis**2)) / network.volume
        parts = {"normal": float(costs[0]), "transverse": float(costs[1:].sum()), **parts}
    return ViscousResponse(parts, rotation, sliding, motions, x)


def _fluid_parts(pencil, x):
    """Parts of η₀ that the fluid adds for a field x: of each drag, and of its own strain. Collective."""
    network, c, dofs = pencil.network, pencil.compatibility, pencil.dofs
    is_spin = np.arange(len(x)) % dofs >= pencil.dimension
    kinds = {"drag": ~is_spin} | ({"spin_drag": is_spin} if pencil.law.spin_drag else {})
    parts = {
        name: network.sum(float(np.where(kind, c.drag, 0.0) @ x**2)) / network.volume
        for name, kind in kinds.items()
    }
    return parts | {"fluid": c.drag_gg / network.volume}


def spin_solver(pencil: Pencil):
    """solve(rhs, out) for the spins only, with B_θθ, the spins of a disk pinned in each piece of gears; None where no
    disk rolls, or K turns them. Collective.
    """
    if not pencil.rolls or pencil.network.turns_elastically:
        return None
    PETSc, network, law = current().PETSc, pencil.network, pencil.law
    dofs, dimension = pencil.dofs, pencil.dimension
    rows = PETSc.IS().createGeneral(pencil.spins.astype(PETSc.IntType), comm=network.comm)
    block = pencil.B.createSubMatrix(rows, rows)
    disks, component = np.divmod(pencil.pins, dofs)
    pinned = (disks * (dofs - dimension) + component - dimension)[component >= dimension]
    set_diagonal(block, pinned, network.damping(law))
    factor = _factor(block, law)
    work = block.createVecRight()

    def solve(rhs, out):
        work.setArray(rhs.getArray().reshape(-1, dofs)[:, dimension:].ravel())
        factor.solve(work, work)
        out.zeroEntries()
        out.getArray().reshape(-1, dofs)[:, dimension:] = work.getArray().reshape(-1, dofs - dimension)
        if law.holds_spins:
            pencil.project(out.getArray())

    return solve


def infinite_viscosity(pencil: Pencil) -> float:
    """η_∞ under law and load of a pencil, in kτ₁, as `infinite_viscosities`. Collective."""
    return float(infinite_viscosities(pencil, [pencil.load])[0, 0])


def infinite_viscosities(pencil: Pencil, loads):
    """η_∞ between loads under the law of a pencil, (L, L) in kτ₁. Collective.

    Raises InputError where B has zero modes besides translations and gears, or its factor needs more than the memory.
    """
    law, c = pencil.law, pencil.compatibility
    if not law.damps_contacts:  # disks that follow the affine flow dissipate nothing but η_F
        zero = np.zeros((len(loads), len(c.g))), np.zeros((len(loads), len(c.drag)))
        return dissipation_between(pencil, loads, *zero)
    require_memory(pencil.network, factored_unknowns(pencil), PREFIX)
    block = pencil.B.copy()
    idle = pencil.spins[: 0 if law.couples_rotations else None]  # B does not act on these
    set_diagonal(block, np.union1d(pencil.pins, idle), pencil.network.damping(law))
    factor = _factor(block, law, pencil.spins if splits_spins(pencil) else None)
    relaxed = [
        relax(c, c.w_B, factor.solve, c.under(load).g, "flow of least dissipation", drag=c.drag)
        for load in loads
    ]
    return dissipation_between(
        pencil, loads, [flow.motions.ravel() for flow in relaxed], [flow.x for flow in relaxed]
    )


def dissipation_between(pencil: Pencil, loads, motions, fields):
    """(aᵀ W_B a′ + xᵀ drag x′ + what the fluid adds)/V of pairs of loads, (L, L). Collective.

    motions, fields   a (rows_local,) and x (unknowns_local,) for each load
    """
    c, motions, fields = pencil.compatibility, np.asarray(motions), np.asarray(fields)
    value = pencil.network.sum((motions * c.w_B) @ motions.T + (fields * c.drag) @ fields.T)
    fluid = [[c.fluid_gg(load, other) for other in loads] for load in loads]
    return (value + fluid) / pencil.network.volume


def _factor(block, law, spins=None):
    try:
        return ShiftedFactor(block, f"B of {law}", spins=spins)
    except NotPositiveDefinite:
        raise InputError(
            f"B of {law} has moves without dissipation besides translations: η is not unique. "
            "Raise the pressure, or the weights of the law."
        ) from None


@dataclass(frozen=True, eq=False)
class SlowResponse:
    """Quasistatic response of one network under one law and load. Arrays hold this rank's part, per unit amplitude."""

    network: DistributedNetwork
    nonaffine: np.ndarray  # (n_local, D) u_na, without the mean of each connected piece
    field: np.ndarray  # (n_local, D) or (n_local, dofs), the same as `quasistatic_flow` takes it
    normal: np.ndarray  # (contacts_local,) Δu∥
    transverse: np.ndarray  # (contacts_local,) Δu⊥, in 3D its length
    flow: ViscousResponse  # η₀ and the rotations
    G0: float  # M_E of the load, in k
    G_affine: float  # modulus if nothing relaxed
    bulk_modulus: float  # −V dp/dV, in k
    identity_difference: float  # relative difference of G₀V and kΣ(Δu∥)² (with pre-stress −Σ(f/r)(Δu⊥)²)
    field_error: float  # relative, in the energy norm

    @property
    def eta0(self) -> float:
        """η₀, in kτ₁."""
        return self.flow.eta0

    @property
    def omega_star(self) -> float:
        """ω* = G₀/η₀."""
        return self.G0 / self.eta0


@dataclass(frozen=True, eq=False)
class QuasistaticTensor:
    """Elastic constants and viscosities between L loads, (L, L) each, in k and kτ₁."""

    C0: np.ndarray
    eta0: np.ndarray
    eta_inf: np.ndarray


def solve(
    network: DistributedNetwork, pencil: Pencil, tensor=()
) -> tuple[SlowResponse, QuasistaticTensor | None]:
    """The quasistatic response of a network to the load of `pencil`, and its dissipation under its law. Collective.

    tensor   loads between which elastic constants and viscosities are found too, with the same factor of K

    Raises InputError where K is not positive definite (its negative or floppy modes are counted),
    ConvergenceError where a solve is not accurate.
    """
    expansion = compression(len(pencil.load.rows))
    responses, elastic = _elastic_responses(network, (pencil.load, expansion, *tensor))
    response, area = responses[pencil.load], network.volume
    nonaffine = elastic.split(response.x)[0]
    fields = {load: elastic_field(pencil, elastic, part.x) for load, part in responses.items()}
    slow = SlowResponse(
        network,
        nonaffine,
        fields[pencil.load],
        *along_and_across(response.motions[:, : elastic.dimension]),
        quasistatic_flow(pencil, fields[pencil.load]),
        G0=response.value / area,
        G_affine=elastic.under(pencil.load).k_gg / area,
        bulk_modulus=_bulk_modulus(network, responses[expansion].value / area),
        identity_difference=response.defect,
        field_error=max(response.error, responses[expansion].error),
    )
    if not tensor:
        return slow, None
    motions = np.array([responses[load].motions.ravel() for load in tensor])
    C0 = network.sum((motions * elastic.compatibility.w_K) @ motions.T) / area
    turn = spin_solver(pencil)
    flows = [quasistatic_flow(pencil.under(load), fields[load], turn) for load in tensor]
    eta0 = dissipation_between(
        pencil, tensor, [flow.motions for flow in flows], [flow.field for flow in flows]
    )
    return slow, QuasistaticTensor(C0, eta0, infinite_viscosities(pencil, tensor))


def elastic_field(pencil: Pencil, elastic: Pencil, x):
    """A field of K as `quasistatic_flow` takes it: without moves that only the fluid resists. Collective."""
    field = x.reshape(-1, elastic.dofs)
    if pencil.law.holds_translations:
        field = np.column_stack((elastic.split(x)[0], field[:, elastic.dimension :]))
    if pencil.law.holds_spins and elastic.rolls:
        field = field.copy()
        pencil.project_gears(field)
    return field


def _elastic_responses(network, loads):
    """{Load: Relaxed} and the pencil of K, without the factor that they were found with. Collective."""
    elastic = ElasticResponse(network)
    return {load: elastic.respond(load) for load in loads}, elastic.pencil


def _bulk_modulus(network, modulus):
    """−V dp/dV = M + p (D − 1)/D for the modulus M of compression; p = 0 without pre-stress."""
    D = network.dimension
    return modulus + (network.pressure * (D - 1) / D if network.prestress else 0.0)


@dataclass(frozen=True, eq=False)
class QuasistaticResult:
    """The responses of one network with its pre-stress and without, and viscosities of other laws."""

    network: DistributedNetwork
    responses: dict  # "" and, where K has pre-stress, "no_prestress" → SlowResponse
    distributions: dict  # the same names → {"normal": Distribution, …}
    eta_inf: float
    scan: np.ndarray  # (b, 4): β, η₀, η₀ without pre-stress, η_∞
    tensors: dict  # the same names → QuasistaticTensor, if loads of a tensor were given


def solve_quasistatic(
    network: DistributedNetwork, law: Law, betas=(), load=None, tensor=()
) -> QuasistaticResult:
    """The quasistatic response of a network under a law, and η₀, η_∞ at other β. Collective; needs the real build.

    load     whose fields and moduli are found; simple shear if not given
    tensor   loads between which elastic constants and viscosities are found, see `symmetric_loads`

    Raises as `solve`.
    """
    session = current()
    networks = {"": network} | ({BARE: network.unstressed()} if network.prestress else {})
    pencil = _pencil(network, law, load)
    with session.stage("quasistatic"):
        solved = {name: solve(item, pencil, tensor) for name, item in networks.items()}
        responses = {name: slow for name, (slow, _) in solved.items()}
    with session.stage("eta_inf"):
        eta_inf = infinite_viscosity(pencil)
    del pencil  # the matrices of other laws take its place
    with session.stage("beta"):
        scan = [(beta, *_viscosities(network, law.altered(beta=beta), responses, load)) for beta in betas]
    return QuasistaticResult(
        network,
        responses,
        {
            name: distributions(network.comm, slow.normal, slow.transverse, slow.nonaffine)
            for name, slow in responses.items()
        },
        eta_inf,
        np.array(scan).reshape(-1, 4),
        {name: constants for name, (_, constants) in solved.items() if tensor},
    )


def _pencil(network, law, load):
    pencil = assemble(network, law)
    return pencil.under(load or pencil.load)


def _viscosities(network, law, responses, load):
    """(η₀, η₀ without pre-stress, η_∞) of another law: the quasistatic fields do not depend on it."""
    pencil = _pencil(network, law, load)
    eta0 = [quasistatic_flow(pencil, response.field).eta0 for response in responses.values()]
    return eta0[0], eta0[-1], infinite_viscosity(pencil)


def distributions(comm, *parts) -> dict:
    """QUANTITIES -> Distribution over all ranks' contacts, (…,) and (…,), and disks, (…, D). Collective."""
    named = zip(QUANTITIES, parts, strict=True)
    return {name: Distribution.of(np.concatenate(comm.allgather(part))) for name, part in named}
