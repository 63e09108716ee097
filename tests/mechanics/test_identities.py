"""Exact identities of the response and published elastic constants: what must hold for K, B and G*(ω)."""

import numpy as np
import pytest
from dense import Reference
from gathered import dense
from samples import LAWS, SAMPLES, isostatic, laws_of, network_of, physics, polydisperse, reference

from jampetsc.core.laws import UNDAMPED
from jampetsc.core.state import measure
from jampetsc.linear.direct import FrequencySolver
from jampetsc.mechanics.assembly import assemble
from jampetsc.mechanics.compatibility import build_compatibility
from jampetsc.mechanics.network import build_network
from jampetsc.petsc.session import current

# K, B and the response themselves are compared with dense matrices on 3 ranks by test_assembly and test_direct
# G* on several ranks is compared with the dense reference
pytestmark = [pytest.mark.scalar("complex", "real"), pytest.mark.most_ranks(1)]
MINIMA = ("published", "polydisperse", "isostatic")


def moduli(disks, physics, omega):
    """G* at each ω, complex (M,). Collective."""
    pencil = assemble(network_of(disks, physics, current().comm), physics.law)
    solver = FrequencySolver(pencil)
    values = np.array([solver.solve(w, 1e-6).G for w in omega])
    solver.destroy()
    pencil.destroy()
    return values


@pytest.mark.parametrize("sample", MINIMA)
def test_low_frequencies_without_low_frequencies(session, sample):
    """G₀ of the elastic problem and η₀ from its field (identity 2), against G' and G''/ω at ω = 1e-10."""
    for law in laws_of(sample):
        exact = reference(sample, law)
        (G,) = moduli(SAMPLES[sample](), LAWS[law], [1e-10])
        assert G.real == pytest.approx(exact.quasistatic()[1], rel=1e-9), law
        assert G.imag / 1e-10 == pytest.approx(exact.eta0(), rel=1e-9), law


@pytest.mark.parametrize("sample", ["published", "polydisperse", "two images"])
def test_high_frequencies(session, sample):
    """η_∞ is the least dissipation any field allows (identity 3): less than that of the affine one."""
    for law in (physics(), physics(rotations=False), physics(prestress=False)):
        if str(law) not in laws_of(sample):
            continue
        exact = reference(sample, str(law))
        (G,) = moduli(SAMPLES[sample](), law, [1e8])
        assert G.imag / 1e8 == pytest.approx(exact.eta_infinity(), rel=1e-10)
        assert exact.eta_infinity() < 0.95 * float(exact.B[-1, -1] / exact.area)


@pytest.mark.parametrize("sample", ["published", "isostatic", "strips"])
def test_proportional_damping_is_kelvin_voigt(session, sample):
    """β = 0, no pre-stress, one stiffness: B = τ₁ K, so G* = G₀ (1 + iωτ₁) (identity 4)."""
    omega = np.geomspace(1e-8, 1e6, 8)
    law = physics(beta=0.0, prestress=False, tau1=0.3)
    G = moduli(SAMPLES[sample](), law, omega)
    G0 = Reference(SAMPLES[sample](), law).quasistatic()[1]
    np.testing.assert_allclose(G.real, G0, rtol=1e-9)
    np.testing.assert_allclose(G.imag, G0 * omega * 0.3, rtol=1e-9)


@pytest.mark.parametrize("sample", ["published", "isostatic"])
def test_all_sliding_is_one_curve(session, sample):
    """No pre-stress, one stiffness: G*_β = (1 + iωτ₁) F(κ), κ = iωβτ₁/(1 + iωτ₁), as K + iωB = (1 + iωτ₁)(∥ + κ⊥ᶜ).

    κ of β = 1 and a real ω is had at β = ½ and another, complex ω: that of dense matrices has the same F.
    """
    omega = np.array([1e-3, 0.3])
    balanced, weak = (physics(beta=beta, prestress=False) for beta in (1.0, 0.5))
    F = moduli(SAMPLES[sample](), balanced, omega) / (1 + 1j * omega)
    kappa = 1j * omega / (1 + 1j * omega)
    s = kappa / (0.5 - kappa)  # iω of β = ½
    exact = Reference(SAMPLES[sample](), weak)
    border = exact.K[:-1, -1], exact.B[:-1, -1]
    for one, at in zip(F, s, strict=True):
        K, B, k, b = (np.asarray(part, float) for part in (exact.K[:-1, :-1], exact.B[:-1, :-1], *border))
        x = np.linalg.lstsq(K + at * B, -(k + at * b), rcond=1e-12)[0]
        stiffness = float(exact.K[-1, -1]) + at * float(exact.B[-1, -1]) + (k + at * b) @ x
        assert stiffness / float(exact.area) / (1 + at) == pytest.approx(one, rel=1e-8)


@pytest.mark.parametrize("sample", MINIMA)
def test_stokes_at_high_frequency_is_affine(session, sample):
    """G* → G_affine + iω η_F (identity 5); the next term of G'' is |k_γ|²/(ω V kτ₁)."""
    omega, eta_f, law = 1e5, 0.7, physics("stokes", eta_f=0.7)
    exact = reference(sample, str(physics("stokes")))
    (G,) = moduli(SAMPLES[sample](), law, [omega])
    assert G.real == pytest.approx(float(exact.K[-1, -1] / exact.area), rel=1e-8)
    border = exact.K[:-1, -1]
    wanted = float(border @ border / exact.area)
    assert (G.imag - omega * eta_f) * omega == pytest.approx(wanted, rel=1e-4)


STRAINS = {"xx": [[1, 0], [0, 0]], "yy": [[0, 0], [0, 1]], "xy": [[0, 0.5], [0.5, 0]]}


def elastic_constants(disks, prestress):
    """C_ijkl for symmetric linear strains, from the package's K and C: {"xxyy": …}. Collective."""
    pencil = assemble(build_network(disks, current().comm, prestress), UNDAMPED, pinned=False)
    c, network = build_compatibility(pencil), pencil.network
    once = network.contacts.i < network.contacts.j
    contacts = network.contacts[once]
    frame = np.stack((contacts.normal, contacts.transverse), axis=1)
    local = np.stack(
        [np.einsum("cfa,ab,cb->cf", frame, strain, contacts.r).ravel() for strain in STRAINS.values()]
    )
    gather = network.comm.allgather
    g, w = np.concatenate(gather(local), axis=1), np.concatenate(gather(c.w_K))
    C, K = dense(c.C), dense(pencil.K)
    border = g @ (w[:, None] * C)
    relaxed = np.linalg.lstsq(K, border.T, rcond=1e-13)[0]
    constants = (g @ (w[:, None] * g.T) - border @ relaxed) / network.area
    c.destroy()
    pencil.destroy()
    names = list(STRAINS)
    return {a + b: constants[names.index(a), names.index(b)] for a in names for b in names}


@pytest.mark.scalar("real")
@pytest.mark.parametrize("index", range(10))
def test_published_elastic_constants(session, index):
    """The six constants jax-md gives for each of its packings, to about as many digits as they have."""
    disks, record = polydisperse(index)
    found = elastic_constants(disks, prestress=True)
    names = ("xxxx", "yyyy", "xyxy", "xxyy", "xxxy", "yyxy")
    np.testing.assert_allclose([found[name] for name in names], record["Cijkl"], rtol=2e-6, atol=1e-7)


@pytest.mark.parametrize("index", range(3))
def test_simple_shear_and_symmetric_strain(session, index):
    """In second order simple shear stretches the cell against the stress: G = C_xyxy + (3 σ_yy − σ_xx)/4.

    That is C_xyxy − p/2 under isotropic pressure.
    """
    disks, record = polydisperse(index)
    (G,) = moduli(disks, physics(), [1e-8])
    stress = record["Stress"].reshape(2, 2)
    assert G.real == pytest.approx(record["Cijkl"][2] + (3 * stress[1, 1] - stress[0, 0]) / 4, rel=2e-6)


def test_one_state_of_self_stress(session):
    """With one more contact than 2n − 2 and no pre-stress, the forces f themselves are the only self-stress.

    Then M = k (Σ f a)² / (V Σ f²) for the modulus of any strain that stretches contacts by a: with a = r/2
    the bulk modulus k (Σ f r)² / (4 V Σ f²) (identity 6), with a = n_x r_y the shear modulus.
    """
    disks = isostatic()
    contacts = measure(disks).contacts
    assert len(contacts) == 2 * len(np.union1d(contacts.i, contacts.j)) - 1
    f, r, n = contacts.force, contacts.distance, contacts.normal
    norm = disks.area * np.sum(f**2)
    shear = np.sum(f * n[:, 0] * contacts.r[:, 1]) ** 2 / norm
    if session.scalar_type == "complex":
        (G,) = moduli(disks, physics(prestress=False), [1e-10])
        assert G.real == pytest.approx(shear, rel=1e-6)  # the quench left forces balanced to 1e-9
        return
    C = elastic_constants(disks, prestress=False)
    bulk = (C["xxxx"] + C["yyyy"] + 2 * C["xxyy"]) / 4
    assert bulk == pytest.approx(np.sum(f * r) ** 2 / (4 * norm), rel=1e-6)
    assert C["xyxy"] == pytest.approx(shear, rel=1e-6)
