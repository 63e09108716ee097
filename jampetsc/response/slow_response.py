"""The quasistatic response to shear, G₀, η₀ and η_∞, from a handful of real solves (BT: 'Relation to
floppiness').

Per unit strain: Δu∥ = a∥ and Δu⊥ = a⊥ of each contact and the non-affine displacement u_na of each disk. BT
eqs. 19–21 expect them to scale like p^¼, p^−¼ and p^−¼. Without pre-stress k Σ (Δu∥)² = G₀ V exactly, and
every run checks it.

On BT's plateau of the mean |Δu∥| at low pressure: none is seen here. Without pre-stress the rms of Δu∥ is
√(G₀V/kN_c), an identity that these solves keep to 1e-13 down to p = 1e-6, and the mean follows it: mean/rms
lies between 0.71 and 0.82 at every pressure from 1e-2 to 1e-6 (N = 256 and 1024, 6 to 12 packings each,
with and without pre-stress; 0.80 for a normal distribution), and the largest hundredth of the contacts
makes up 6 to 16 % of Σ(Δu∥)², so it has no long tail either. G₀ itself levels off below pN² ≈ 1,
by finite size. See benchmarks/claims/motion.py.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.laws.damping import Law
from jampetsc.laws.loads import compression
from jampetsc.network.contact_network import DistributedNetwork
from jampetsc.petsc.session import current
from jampetsc.response.assembly import Pencil, assemble
from jampetsc.response.compatibility import along_and_across
from jampetsc.response.contributions import distributions
from jampetsc.response.elastic import ElasticResponse
from jampetsc.response.viscosity import (
    ViscousResponse,
    dissipation_between,
    infinite_viscosities,
    infinite_viscosity,
    quasistatic_flow,
)

BARE = "no_prestress"  # name of the results for K without pre-stress, where K has it


@dataclass(frozen=True, eq=False)
class SlowResponse:
    """Quasistatic response of one network under one law and load. Arrays hold this rank's part, per unit amplitude."""

    network: DistributedNetwork
    nonaffine: np.ndarray  # (n_local, D) u_na, without the mean of each connected piece
    field: np.ndarray  # (n_local, D) the same as `quasistatic_flow` takes it
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
    fields = {
        load: elastic.split(part.x)[0] if pencil.law.holds_translations else part.x.reshape(nonaffine.shape)
        for load, part in responses.items()
    }
    slow = SlowResponse(
        network,
        nonaffine,
        fields[pencil.load],
        *along_and_across(response.motions),
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
    flows = [quasistatic_flow(pencil.under(load), fields[load]) for load in tensor]
    eta0 = dissipation_between(
        pencil, tensor, [flow.motions for flow in flows], [flow.field for flow in flows]
    )
    return slow, QuasistaticTensor(C0, eta0, infinite_viscosities(pencil, tensor))


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
