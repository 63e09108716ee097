"""Susceptibilities of slow forces, χ → χ₀ − iωχ₁ for ω → 0: K factorised once, two or three solves per load.

χ₀ = fᵀK⁻¹f with the bound of `certificate`, whose K + iωB is K here. χ₁ = xᵀBx is the dissipation of the quasistatic
field, minimised over the spins that K does not act on.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import ConvergenceError
from jampetsc.laws.damping import Law
from jampetsc.response.assembly import assemble
from jampetsc.response.certificate import Functional, SingularBound
from jampetsc.response.contact_network import DistributedNetwork
from jampetsc.response.elastic import ElasticResponse
from jampetsc.response.slow_response import BARE, elastic_field, quasistatic_flow, spin_solver

ANY_OMEGA = 1.0  # of a pencil without damping
REFINEMENTS = 3
MAX_ERROR = 1e-6  # of χ₀, relative


@dataclass(frozen=True, eq=False)
class SlowSusceptibility:
    """Of each load of one network under one law."""

    static: np.ndarray  # (L,) χ₀
    bounds: np.ndarray  # (L,) on |Δχ₀|
    slopes: np.ndarray  # (L,) χ₁


def slow_susceptibilities(network: DistributedNetwork, law: Law, loads) -> dict[str, SlowSusceptibility]:
    """Of forces under a law, {"": with pre-stress, "no_prestress": without it, where K has it}. Collective.

    Raises as `ElasticResponse`, and ConvergenceError where χ₀ is not certain to MAX_ERROR.
    """
    networks = {"": network} | ({BARE: network.unstressed()} if network.prestress else {})
    damped = assemble(network, law)
    turn = spin_solver(damped)
    return {name: _susceptibilities(item, damped, turn, loads) for name, item in networks.items()}


def _susceptibilities(network, damped, turn, loads):
    elastic = ElasticResponse(network)
    bound = SingularBound(ANY_OMEGA, elastic.pencil.diagonals[0], elastic.factor.least_eigenvalue())
    rows = []
    for load in loads:
        functional = Functional(elastic.pencil.under(load))
        x = np.zeros(elastic.pencil.K.getLocalSize()[0])
        step, out = elastic.pencil.K.createVecs()
        for _ in range(REFINEMENTS):
            step.setArray(functional.trial(ANY_OMEGA, x.astype(complex)).left.real)
            elastic.factor.solve(step, out)
            x = x - out.getArray()
        certified = functional.certify(functional.trial(ANY_OMEGA, x.astype(complex)), bound)
        static, error = -network.volume * certified.G.real, network.volume * float(certified.bounds[1])
        if not error <= MAX_ERROR * static:
            raise ConvergenceError(
                f"susceptibility of {load.name}: {static:.6g} only certain to {error:.1e}: the matrix is too "
                "ill-conditioned; try another factorisation, such as -shift_pc_factor_mat_solver_type mumps"
            )
        pencil = damped.under(load)
        flow = quasistatic_flow(pencil, elastic_field(pencil, elastic.pencil, x), turn)
        rows.append((static, error, network.volume * flow.eta0))
    return SlowSusceptibility(*np.array(rows).T)
