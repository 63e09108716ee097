"""The quasistatic response to shear, G₀, η₀ and η_∞, from a handful of real solves (BT: 'Relation to
floppiness').

Per unit strain: Δu∥ = a∥ and Δu⊥ = a⊥ of each contact and the non-affine displacement u_na of each disk. BT
eqs. 19–21 expect them to scale like p^¼, p^−¼ and p^−¼. Without pre-stress k Σ (Δu∥)² = G₀ V exactly, and
every run checks it.

On BT's plateau of the mean |Δu∥| at low pressure: none is seen here. Without pre-stress the rms of Δu∥ is
√(G₀V/kN_c), an identity that these solves keep to 1e-13 down to p = 1e-6, and the mean follows it: mean/rms
lies between 0.71 and 0.82 at every pressure from 1e-2 to 1e-6 (N = 256 and 1024, 6 to 12 packings each,
with and without pre-stress; 0.80 for a normal distribution), and the largest hundredth of the contacts
makes up 6 to 16 % of Σ(Δu∥)², so there is no long tail either. What levels off below pN² ≈ 1 is G₀ itself,
by finite size. See benchmarks/claims/motion.py.
"""

import time
from dataclasses import dataclass

import numpy as np

from jampetsc.errors import about
from jampetsc.io.outlet import Outlet
from jampetsc.io.packing_file import read_identified, source_name
from jampetsc.io.results import noted, unstable_to_shear
from jampetsc.laws.damping import Physics
from jampetsc.network.contact_network import Network, build_network
from jampetsc.petsc.session import current
from jampetsc.response.assembly import Pencil, assemble
from jampetsc.response.contributions import distributions
from jampetsc.response.elastic import ElasticResponse
from jampetsc.response.minimum_check import examine_balance
from jampetsc.response.refined_solve import Relaxed
from jampetsc.response.run_record import run_record
from jampetsc.response.viscosity import ViscousResponse, infinite_viscosity, quasistatic_flow

FORMAT = "jampetsc-quasistatic"
# members of `SlowResponse` that are attributes of the file
ATTRIBUTES = "G0 G_affine bulk_modulus eta0 omega_star identity_difference field_error".split()
BARE = "no_prestress"  # name of the results for K without pre-stress, if the job has pre-stress


@dataclass(frozen=True, eq=False)
class SlowResponse:
    """Quasistatic response of one network under one law. Arrays hold this rank's part, per unit strain."""

    network: Network
    nonaffine: np.ndarray  # (n_local, 2) u_na, without the mean of each connected piece
    field: np.ndarray  # (n_local, 2) the same as `quasistatic_flow` takes it
    normal: np.ndarray  # (contacts_local,) Δu∥
    transverse: np.ndarray  # (contacts_local,) Δu⊥
    flow: ViscousResponse  # η₀ and the rotations
    G0: float  # in k
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


def solve(network: Network, pencil: Pencil) -> SlowResponse:
    """The quasistatic response of a network, and its dissipation under the law of `pencil`. Collective.

    Raises InputError where K is not positive definite (its negative or floppy modes are counted),
    ConvergenceError where a solve is not accurate.
    """
    shear, compression, nonaffine, affine = _elastic(network)
    field = nonaffine if pencil.law.holds_translations else shear.x.reshape(-1, 2)
    return SlowResponse(
        network,
        nonaffine,
        field,
        *shear.motions.T,
        quasistatic_flow(pencil, field),
        G0=shear.value / network.area,
        G_affine=affine / network.area,
        bulk_modulus=_bulk_modulus(network, compression),
        identity_difference=shear.defect,
        field_error=max(shear.error, compression.error),
    )


def _elastic(network):
    """Responses to shear and compression, u_na and k_γγ, without the factor they were found with."""
    elastic = ElasticResponse(network)
    shear, compression = elastic.shear(), elastic.compression()
    return shear, compression, elastic.pencil.split(shear.x)[0], elastic.pencil.k_gg


def _bulk_modulus(network, compression: Relaxed):
    """−V dp/dV = (d²U/dε²)/(4V) + p/2 for the linear strain ε; p = 0 without pre-stress."""
    return compression.value / (4.0 * network.area) + (0.5 * network.pressure if network.prestress else 0.0)


@dataclass(frozen=True, eq=False)
class Outcome:
    """The results of `run`, for the summary."""

    network: Network
    responses: dict  # "" and, where K has pre-stress, "no_prestress" → Quasistatic
    distributions: dict  # the same names → {"normal": Distribution, …}
    eta_inf: float
    scan: np.ndarray  # (b, 4): β, η₀, η₀ without pre-stress, η_∞

    @property
    def notes(self) -> list[str]:
        """See `io.results`."""
        return unstable_to_shear(self.responses[""].G0, "G0")


def run(packing, to: Outlet, physics: Physics, betas=()) -> Outcome:
    """Solve for a packing in memory or a file, under `physics`, and for η₀, η_∞ at other β, and write it. Collective.

    Raises InputError for a packing that is not a rigid minimum.
    """
    started = time.perf_counter()
    session = current()
    disks, identity = read_identified(packing, session.comm)
    to.made_from(disks)
    with about(source_name(packing)):
        examine_balance(source_name(packing), disks, session.comm)
        outcome = _solve_all(build_network(disks, session.comm, physics.prestress), physics.law, betas)
    with session.stage("output"), to.writer(FORMAT, session.comm) as writer:
        _write(writer, outcome)
        writer.attributes(**run_record(disks, identity, physics.parameters, outcome.network, started))
    return outcome


def _solve_all(network, law, betas):
    session = current()
    networks = {"": network} | ({BARE: network.unstressed()} if network.prestress else {})
    pencil = assemble(network, law)
    with session.stage("quasistatic"):
        responses = {name: solve(one, pencil) for name, one in networks.items()}
    with session.stage("eta_inf"):
        eta_inf = infinite_viscosity(pencil)
    del pencil  # the matrices of other laws take its place
    with session.stage("beta"):
        scan = [(beta, *_viscosities(network, law.altered(beta=beta), responses)) for beta in betas]
    return Outcome(
        network,
        responses,
        {
            name: distributions(network.comm, one.normal, one.transverse, one.nonaffine)
            for name, one in responses.items()
        },
        eta_inf,
        np.array(scan).reshape(-1, 4),
    )


def _viscosities(network, law, responses):
    """(η₀, η₀ without pre-stress, η_∞) of another law: the quasistatic fields do not depend on it."""
    pencil = assemble(network, law)
    eta0 = [quasistatic_flow(pencil, response.field).eta0 for response in responses.values()]
    return eta0[0], eta0[-1], infinite_viscosity(pencil)


def _write(writer, outcome):
    network = outcome.network
    c, particles = network.contacts, network.particles
    once = c.i < c.j
    writer.distributed("particles", particles)
    writer.distributed("contacts/pairs", np.column_stack((c.i, c.j))[once])
    writer.distributed("contacts/bonds", c.r[once])
    for name, response in outcome.responses.items():
        group, prefix = (f"{name}/", f"{name}_") if name else ("", "")
        writer.distributed(f"{group}contacts/normal", response.normal)
        writer.distributed(f"{group}contacts/transverse", response.transverse)
        writer.distributed(f"{group}nonaffine", response.nonaffine)
        if response.flow.rotation is not None:
            writer.distributed(f"{group}contacts/sliding", response.flow.sliding)
            writer.distributed(f"{group}rotation", response.flow.rotation)
        values = {key: getattr(response, key) for key in ATTRIBUTES}
        values |= {f"eta0_{part}": value for part, value in response.flow.parts.items()}
        for quantity, found in outcome.distributions[name].items():
            writer.dataset(f"{group}histogram/{quantity}/edges", found.edges)
            writer.dataset(f"{group}histogram/{quantity}/counts", found.counts)
            values |= {f"{quantity}_{kind}": getattr(found, kind) for kind in ("median", "mean", "rms")}
        writer.attributes(**{f"{prefix}{key}": value for key, value in values.items()})
    writer.attributes(eta_inf=outcome.eta_inf, notes=noted(outcome.notes))
    if len(outcome.scan):
        names = ("beta", "eta0", f"{BARE}_eta0", "eta_inf")
        for name, column in zip(names, outcome.scan.T, strict=True):
            writer.dataset(f"beta_scan/{name}", column)
