"""Exact identities of the dense reference, which judges the package everywhere; published elastic constants."""

import numpy as np
import pytest
from dense import Reference
from samples import LAWS, SAMPLES, laws_of, physics, polydisperse, reference
from whole_arrays import dense

from jampetsc.laws.damping import UNDAMPED
from jampetsc.laws.relative_motion import transverse_axes
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import build_network

MINIMA = ("published", "polydisperse", "isostatic")


@pytest.mark.parametrize("sample", MINIMA)
def test_ends_of_the_frequencies(sample):
    """G₀ of the elastic problem and η₀ from its field (identity 2) at ω = 1e-10; far above, the least dissipation that
    any field allows (identity 3), less than that of the affine one.
    """
    for law in laws_of(sample):
        exact = reference(sample, law)
        low = exact.modulus(1e-10)
        assert low.real == pytest.approx(exact.quasistatic()[1], rel=1e-9), law
        assert low.imag / 1e-10 == pytest.approx(exact.eta0(), rel=1e-9), law
        if LAWS[law].law.normal == 1.0 and not LAWS[law].law.drag and "1e-07" not in law:
            assert exact.modulus(1e8).imag / 1e8 == pytest.approx(exact.eta_infinity(), rel=1e-10), law
            assert exact.eta_infinity() <= 0.95 * float(exact.B[-1, -1] / exact.area)


@pytest.mark.parametrize("sample", ["published", "isostatic", "strips"])
def test_proportional_damping_is_kelvin_voigt(sample):
    """β = 0, no pre-stress, one stiffness: B = τ₁ K, so G* = G₀ (1 + iωτ₁) (identity 4)."""
    exact = Reference(SAMPLES[sample](), physics(beta=0.0, prestress=False, tau1=0.3))
    G0 = exact.quasistatic()[1]
    for omega in np.geomspace(1e-8, 1e6, 5):
        G = exact.modulus(omega)
        np.testing.assert_allclose([G.real, G.imag], [G0, G0 * omega * 0.3], rtol=1e-9)


@pytest.mark.parametrize("sample", ["published", "isostatic"])
def test_all_sliding_is_one_curve(sample):
    """No pre-stress, one stiffness: G*_β = (1 + iωτ₁) F(κ), κ = iωβτ₁/(1 + iωτ₁), as K + iωB = (1 + iωτ₁)(∥ + κ⊥ᶜ).

    κ of β = 1 and a real ω is had at β = ½ and another, complex ω: that has the same F.
    """
    balanced, weak = (
        Reference(SAMPLES[sample](), physics(beta=beta, prestress=False)) for beta in (1.0, 0.5)
    )
    for omega in (1e-3, 0.3):
        kappa = 1j * omega / (1 + 1j * omega)
        s = kappa / (0.5 - kappa)  # iω of β = ½
        A = (weak.K + s * weak.B).astype(complex)
        x = np.linalg.lstsq(A[:-1, :-1], -A[:-1, -1], rcond=1e-12)[0]
        G = (A[-1, -1] + A[-1, :-1] @ x) / float(weak.area)
        assert G / (1 + s) == pytest.approx(balanced.modulus(omega) / (1 + 1j * omega), rel=1e-8)


@pytest.mark.parametrize("sample", MINIMA)
def test_stokes_at_high_frequency_is_affine(sample):
    """G* → G_affine + iω η_F (identity 5); the next term of G'' is |k_γ|²/(ω V kτ₁)."""
    omega, exact = 1e5, Reference(SAMPLES[sample](), physics("stokes", eta_f=0.7))
    G, border = exact.modulus(omega), exact.K[:-1, -1]
    assert G.real == pytest.approx(float(exact.K[-1, -1] / exact.area), rel=1e-8)
    assert (G.imag - omega * 0.7) * omega == pytest.approx(float(border @ border / exact.area), rel=1e-4)


STRAINS = {"xx": [[1, 0], [0, 0]], "yy": [[0, 0], [0, 1]], "xy": [[0, 0.5], [0.5, 0]]}


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("index", range(10))
def test_published_elastic_constants(session, index):
    """The six constants C_ijkl jax-md gives for each of its packings, to about as many digits as they have."""
    disks, record = polydisperse(index)
    pencil = assemble(build_network(disks, session.comm), UNDAMPED, pinned=False)
    c, network = pencil.compatibility, pencil.network
    contacts = network.contacts[network.contacts.i < network.contacts.j]
    frame = np.stack((contacts.normal, *transverse_axes(contacts.normal)), axis=1)
    g = np.stack([np.einsum("cfa,ab,cb->cf", frame, one, contacts.r).ravel() for one in STRAINS.values()])
    border = g @ (c.w_K[:, None] * dense(c.C))
    relaxed = np.linalg.lstsq(dense(pencil.K), border.T, rcond=1e-13)[0]
    constants = (g @ (c.w_K[:, None] * g.T) - border @ relaxed) / network.volume
    xx, yy, xy = range(3)
    found = constants[[xx, yy, xy, xx, xx, yy], [xx, yy, xy, yy, xy, xy]]
    np.testing.assert_allclose(found, record["Cijkl"], rtol=2e-6, atol=1e-7)
