"""The quasistatic response against dense references, identities and published constants; refusals; file."""

import numpy as np
import pytest
from samples import (
    LAWS,
    SAMPLES,
    gears,
    lattice,
    laws_of,
    network_of,
    physics,
    polydisperse,
    reference,
)
from whole_arrays import unknowns

import jampetsc
from jampetsc import ContactDamping
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.laws.loads import compression, simple_shear
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.response import elastic as elastic_module
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import build_network
from jampetsc.response.elastic import ElasticResponse
from jampetsc.response.slow_response import infinite_viscosity, solve

pytestmark = pytest.mark.scalar("real")

MINIMA = ("published", "hertzian", "polydisperse", "isostatic")


def whole(network, local):
    return np.concatenate(network.comm.allgather(local))


def response(disks, physics, comm):
    """(Quasistatic, η_∞)."""
    pencil = assemble(network_of(disks, physics, comm), physics.law)
    return solve(pencil.network, pencil)[0], infinite_viscosity(pencil)


def motions(exact, displacement):
    """Δu∥ and Δu⊥ of the dense reference for a field (n, 2) at unit strain, each sorted by size."""
    bond = displacement[exact.j] - displacement[exact.i]
    bond[:, 0] += exact.r[:, 1]
    n = exact.r / exact.distance[:, None]
    t = np.column_stack((-n[:, 1], n[:, 0]))
    return [np.sort(np.abs((axis * bond).sum(axis=1).astype(float))) for axis in (n, t)]


@pytest.mark.parametrize("sample", MINIMA)
def test_against_dense(session, sample):
    for law in laws_of(sample, session.size):
        exact = reference(sample, law)
        found, eta_inf = response(SAMPLES[sample](), LAWS[law], session.comm)
        field, G0 = exact.quasistatic()
        rows = unknowns(found.network, 1, exact.disks)
        scale = float(np.abs(field).max())
        nonaffine = whole(found.network, found.nonaffine)
        np.testing.assert_allclose(nonaffine, field[rows].astype(float), rtol=0, atol=1e-10 * scale)
        for name, wanted in zip(("normal", "transverse"), motions(exact, field), strict=True):
            values = np.sort(np.abs(whole(found.network, getattr(found, name))))
            np.testing.assert_allclose(values, wanted, rtol=0, atol=1e-10 * wanted.max())
        assert found.G0 == pytest.approx(G0, rel=1e-10, abs=1e-12)
        assert found.flow.eta0 == pytest.approx(exact.eta0(), rel=1e-10)
        assert found.omega_star == pytest.approx(G0 / exact.eta0(), rel=1e-9)
        assert eta_inf == pytest.approx(exact.eta_infinity(), rel=1e-10)
        assert found.identity_difference < 1e-10 and found.field_error < 1e-10


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("beta", [1e-7, 3.0, 1e4])
def test_angles_do_not_depend_on_beta(session, beta):
    """The disks turn alike at every β, so that η₀ is a straight line in β (BT eq. 22)."""
    one, _ = response(SAMPLES["published"](), physics(), session.comm)
    other, _ = response(SAMPLES["published"](), physics(beta=beta), session.comm)
    assert other.flow.parts["normal"] == pytest.approx(one.flow.parts["normal"], rel=1e-12)
    assert other.flow.parts["transverse"] == pytest.approx(beta * one.flow.parts["transverse"], rel=1e-12)
    np.testing.assert_allclose(other.flow.rotation, one.flow.rotation, rtol=1e-9, atol=1e-12)


@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("index", range(3))
def test_moduli_of_published_packings(session, index):
    """jax-md's constants: −V dp/dV = (C_xxxx + C_yyyy + 2 C_xxyy)/4 + p/2; and G₀ = C_xyxy + (3 σ_yy − σ_xx)/4, since
    simple shear stretches the cell against the stress in second order.
    """
    disks, record = polydisperse(index)
    found, _ = response(disks, physics(), session.comm)
    xxxx, yyyy, xyxy, xxyy, _, _ = record["Cijkl"]
    stress = record["Stress"].reshape(2, 2)
    bulk = (xxxx + yyyy + 2 * xxyy) / 4 + found.network.pressure / 2
    assert found.bulk_modulus == pytest.approx(bulk, rel=2e-6)
    assert found.G0 == pytest.approx(xyxy + (3 * stress[1, 1] - stress[0, 0]) / 4, rel=2e-6)


@pytest.mark.most_ranks(2)
def test_one_state_of_self_stress(session):
    """With 2n − 1 contacts and no pre-stress forces f are the only self-stress (identity 6): a strain that stretches
    contacts by a has the modulus k (Σ f a)²/(V Σ f²), a = r/2 in compression and n_x r_y in shear.
    """
    found, _ = response(SAMPLES["isostatic"](), physics(prestress=False), session.comm)
    network = found.network
    c = network.contacts[network.contacts.i < network.contacts.j]
    assert network.contact_count == 2 * network.n - 1
    stretches = c.distance / 2, c.normal[:, 0] * c.r[:, 1], c.force
    of_bulk, of_shear, square = network.sum(np.array([c.force @ a for a in stretches]))
    unit = network.k / (network.volume * square)
    assert found.bulk_modulus == pytest.approx(unit * of_bulk**2, rel=1e-6)  # forces are balanced to 1e-9
    assert found.G0 == pytest.approx(unit * of_shear**2, rel=1e-6)


@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("beta", [0.0, 1.0])
@pytest.mark.parametrize("rotations", [False, True])
def test_a_sweep_of_floppy_modes(session, beta, rotations):
    """Rows of a square lattice slide at no cost: G′ = 0, G″ = ωβkτ₁, and with β = 0 nothing dissipates."""
    law, omega = ContactDamping(beta=beta, rotations=rotations), np.array([1e-2, 1.0])
    if beta and not rotations:
        found = jampetsc.sweep(lattice(), law, omega=omega, prestress=False)
        assert np.all(np.abs(found.G.real) <= found["error_bound_storage"])
        np.testing.assert_allclose(found.G.imag, beta * omega, rtol=1e-12)
        return
    says = (
        r"K has 14 floppy modes besides" if beta else r"14 moves besides translations cost neither energy nor"
    )
    with pytest.raises((ConvergenceError, InputError), match=says):
        jampetsc.sweep(lattice(), law, omega=omega, prestress=False)


@pytest.mark.most_ranks(2)
def test_rotations_of_gears(session):
    """A bipartite network without pre-stress: one gear is held, and η₀ does not depend on which."""
    law = physics(prestress=False)
    exact = reference("gears", str(law))
    found, eta_inf = response(gears(), law, session.comm)
    assert found.flow.eta0 == pytest.approx(exact.eta0(), rel=1e-8)
    assert eta_inf == pytest.approx(exact.eta_infinity(), rel=1e-10)
    without = physics(prestress=False, rotations=False)
    assert response(gears(), without, session.comm)[0].flow.eta0 > found.flow.eta0


@pytest.mark.most_ranks(1)
def test_a_field_is_refined_and_its_error_told(session, monkeypatch):
    """A solver that gives too little by a share: each of two solves leaves that share of what was left."""
    elastic = ElasticResponse(build_network(SAMPLES["published"](), session.comm))
    c, g = elastic.pencil.compatibility, elastic.pencil.compatibility.g
    right = elastic.respond(simple_shear())
    imposed = np.sqrt(np.sum(np.abs(c.w_K) * g**2))
    size = np.sqrt(c.w_K @ (c.motions(right.x)) ** 2)

    def respond(share):
        def solve(rhs, out):
            elastic.factor.solve(rhs, out)
            out.scale(1.0 - share)

        return elastic_module.relax(c, c.w_K, solve, g, "a field")

    found = respond(1e-5)
    assert found.error == pytest.approx(1e-10 * size / imposed, rel=1e-3)
    assert found.value == pytest.approx(right.value, rel=1e-12) and found.defect < 1e-8
    left = right.x - found.x
    assert np.sqrt(c.w_K @ c.motions(left) ** 2) == pytest.approx(1e-10 * size, rel=1e-2)
    share = np.sqrt(1e-8 * imposed / size)  # leaves 1e-8 of the motion imposed
    with monkeypatch.context() as only:
        only.setattr(elastic_module, "LARGEST_DEFECT", np.inf)
        assert respond(0.95 * share).error < 1e-8
        with pytest.raises(ConvergenceError, match=r"a field: only certain to 1.1e-08, its energy to"):
            respond(1.05 * share)
    for share, name in ((1e-3, "LARGEST_ERROR"), (0.3, "LARGEST_DEFECT")):
        with monkeypatch.context() as only:
            for limit in {"LARGEST_ERROR", "LARGEST_DEFECT"} - {name}:
                only.setattr(elastic_module, limit, np.inf)
            with pytest.raises(ConvergenceError, match=r"a field: only certain to .* too ill-cond"):
                respond(share)


@pytest.mark.most_ranks(2)
def test_softness_that_no_count_confirms_is_the_factorisation_s(session, monkeypatch):
    def refused(*_):
        raise NotPositiveDefinite("K is not positive definite")

    network = build_network(SAMPLES["published"](), session.comm)
    monkeypatch.setattr(elastic_module, "ShiftedFactor", refused)
    with pytest.raises(NotPositiveDefinite):
        ElasticResponse(network)
    floppy = build_network(lattice(), session.comm, prestress=False)
    with pytest.raises(InputError, match="K has 14 floppy modes"):
        ElasticResponse(floppy)


@pytest.mark.most_ranks(2)
def test_what_is_not_proved_is_counted(session, monkeypatch):
    """A factorisation that proves nothing is no reason to believe it, and none to refuse a sound packing."""
    counted = []
    count = elastic_module.require_unique_response
    monkeypatch.setattr(
        elastic_module, "require_unique_response", lambda network: counted.append(1) or count(network)
    )
    network = build_network(SAMPLES["published"](), session.comm)
    ElasticResponse(network)
    assert not counted
    monkeypatch.setattr(elastic_module.ShiftedFactor, "prove", lambda _: False)
    ElasticResponse(network)
    assert counted


@pytest.mark.most_ranks(1)
def test_a_flow_without_dissipation_is_refused(session):
    """Rows that slide cost nothing where only normal motions are damped."""
    network = build_network(lattice(), session.comm, prestress=False)
    pencil = assemble(network, physics(beta=0.0, rotations=False).law)
    with pytest.raises(
        InputError, match=r"has moves without dissipation besides translations: η is not unique"
    ):
        infinite_viscosity(pencil)


@pytest.mark.most_ranks(1)
def test_the_error_told_is_that_of_the_worse_response(session):
    elastic = ElasticResponse(build_network(SAMPLES["polydisperse"](), session.comm))
    errors = {elastic.respond(load).error for load in (simple_shear(), compression())}
    found, _ = response(SAMPLES["polydisperse"](), physics(), session.comm)
    assert len(errors) == 2 and found.field_error == max(errors)
