"""Numbers of states between frequencies against dense spectra; edges at a mode; files, ranks and units."""

import numpy as np
import pytest
from dense import Reference
from picture_contents import figure_of, lines
from samples import SAMPLES, crystal, on_ranks, physics, polydisperse, put, wide
from spheres import few_spheres

import jampetsc
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.laws.damping import UNDAMPED
from jampetsc.packing.potentials import Potential
from jampetsc.petsc.inertia import FACTOR_ROUNDING, ShiftedInertia
from jampetsc.plots.mode_plots import pooled_density
from jampetsc.response import shift_factors
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import build_network
from jampetsc.response.mode_counts import count_between

pytestmark = pytest.mark.scalar("real")


PACKINGS = {
    name: SAMPLES[name]
    for name in ("published", "k = 2.5", "hertzian", "polydisperse", "isostatic", "strips")
} | {"spheres": few_spheres}


def eigenvalues_of(disks, prestress):
    """(λ of the dense K, increasing, number of translations)."""
    law = physics("stokes") if prestress else physics("stokes", prestress=False, eta_f=1e-5)
    exact = Reference(disks, law)

    return np.linalg.eigvalsh(exact.K[:-1, :-1].astype(float)), exact.free_moves().shape[1]


def require_counts(counts, values, translations):
    """Numbers of `ModeCounts` are those of these eigenvalues, translations included."""
    below = np.searchsorted(values, counts.edges**2)
    np.testing.assert_array_equal(counts.counts, np.diff(below))
    assert (counts.below, counts.above) == (below[0] - translations, len(values) - below[-1])
    assert counts.below + counts.counts.sum() + counts.above == len(values) - translations


@pytest.mark.parametrize("prestress", [True, False])
@pytest.mark.parametrize("name", on_ranks(PACKINGS, ("k = 2.5", "spheres")))
def test_counts_are_those_of_dense_spectra(session, name, prestress, monkeypatch):
    """Side by side and on shared factors; some modes lie outside of the edges."""
    disks = PACKINGS[name]()
    values, translations = eigenvalues_of(disks, prestress)
    free = np.sqrt(np.abs(values[translations:]))
    edges = np.geomspace(np.median(free) / 8, np.quantile(free, 0.9), 7)
    network = build_network(disks, session.comm, prestress)
    require_counts(count_between(network, edges), values, translations)
    monkeypatch.setattr(shift_factors, "ALONE_BYTES", 0.0)
    require_counts(count_between(network, edges), values, translations)


@pytest.mark.most_ranks(1)
def test_counts_of_sizes_far_apart(session):
    disks = wide()
    values, translations = eigenvalues_of(disks, False)
    network = build_network(disks, session.comm, False)
    edges = np.sqrt(values[translations] * values[-1]) ** 0.5 * np.geomspace(0.01, 30.0, 8)
    require_counts(count_between(network, edges), values, translations)


@pytest.mark.most_ranks(2)
def test_an_edge_at_a_mode_is_refused_and_one_beside_it_counts(session):
    """Simple and equal eigenvalues, 1e-9 on either side: to 1e-15 none knows on which side it lies."""
    for disks in (polydisperse(3)[0], crystal()):
        values, translations = eigenvalues_of(disks, True)
        network = build_network(disks, session.comm)
        for at in (np.sqrt(values[translations + 5]), np.sqrt(values[-3])):
            with pytest.raises(
                InputError, match=r"states [\d.]+: a mode lies there to rounding.* another edge"
            ):
                count_between(network, np.array([at, 2.0 * at]), proved=True)
            beside = at * np.array([1 - 1e-9, 1 + 1e-9])
            require_counts(count_between(network, beside, proved=True), values, translations)


@pytest.mark.most_ranks(1)
def test_a_certified_count_keeps_its_distance(session):
    """The factor may be wrong by FACTOR_ROUNDING of |K|; nearer eigenvalues are refused, also by fair pivots."""
    network = build_network(polydisperse(3)[0], session.comm)
    K = assemble(network, UNDAMPED, pinned=False).K
    values, norm = eigenvalues_of(polydisperse(3)[0], True)[0], K.norm(session.PETSc.NormType.INFINITY)
    inertia = ShiftedInertia(K, "K")
    for distance, refused in ((0.5 * FACTOR_ROUNDING, True), (1e-9, False)):
        at = values[40] + distance * norm
        if refused:
            with pytest.raises(ConvergenceError, match="K: an eigenvalue lies at"):
                inertia.count_certified(at)
        else:
            assert inertia.count_certified(at) == 41


@pytest.mark.most_ranks(1)
def test_edges_that_count_nothing_are_refused(session):
    network = build_network(SAMPLES["published"](), session.comm)
    for edges in ([1e-8, 1.0], [1.0, 1e5]):
        with pytest.raises(InputError, match=r"states.* must lie between .* and .*\. Softer modes"):
            count_between(network, np.array(edges))
    with pytest.raises(InputError, match="K has 8 negative modes"):
        count_between(build_network(SAMPLES["gears"](), session.comm), np.array([0.1, 1.0]))


@pytest.mark.most_ranks(2)
def test_files_of_states(session, shared_path, capsys):
    """The numbers of all modes, in units of √k; the picture is that of the spectrum in the same bins."""
    out, soft = shared_path / "s.h5", SAMPLES["published"]()
    path = put(shared_path / "p.h5", soft, session.comm)
    jampetsc.modes(path, states="0.1:1.5:6", out=out)
    counted, whole = jampetsc.load(out), jampetsc.modes(path, all=True, eigenvectors=False)
    edges = np.geomspace(0.1, 1.5, 6)
    np.testing.assert_allclose(counted["states/edges"], edges, rtol=1e-14)
    frequencies = np.sqrt(whole["eigenvalues"])
    np.testing.assert_array_equal(counted["states/counts"], np.histogram(frequencies, edges)[0])
    outside = [counted.attributes[f"states_{side}"] for side in ("below", "above")]
    assert outside == [np.sum(frequencies < 0.1), np.sum(frequencies > 1.5)]
    assert "eigenvalues" not in counted and counted.attributes["contacts"] == whole.attributes["contacts"]
    stiff = soft.replace(potential=Potential(k=2.5))
    scaled = jampetsc.modes(stiff, states=np.sqrt(2.5) * edges)
    np.testing.assert_array_equal(scaled["states/counts"], counted["states/counts"])
    assert jampetsc.modes(path, states="0.1:1.5:6", out=out)["states/counts"].sum() == sum(
        counted["states/counts"]
    )
    with pytest.raises(InputError, match=r"has states = 0\.1:1\.5:6, not 0\.1:1\.5:7"):
        jampetsc.modes(path, states="0.1:1.5:7", out=out)
    if session.size > 1:
        return
    (omega, density), (of_both, mean) = pooled_density([counted]), pooled_density([counted, scaled, whole])
    np.testing.assert_allclose((of_both, mean), (omega, density), rtol=1e-12)
    filled = counted["states/counts"] > 0
    np.testing.assert_allclose(
        density * (32 * np.diff(edges))[filled], counted["states/counts"][filled], rtol=1e-12
    )
    ax = figure_of(jampetsc.plots.mode_plots.plot_states, [counted]).axes[0]
    np.testing.assert_allclose(lines(ax)[0][:2], (omega, density), rtol=1e-12)
    for kind in ("participation", "modes", "mode"):
        with pytest.raises(InputError, match=r"numbers of states, not modes\. Run modes without states"):
            jampetsc.plot(counted, kind, **({"packing": path} if kind == "mode" else {}))
    other = jampetsc.modes(path, states=[0.1, 1.0])
    with pytest.raises(InputError, match=r"other edges than .*\. Draw files of equal states"):
        pooled_density([counted, other])
