"""The response of networks of springs against the dense reference, and against what is known of lattices exactly."""

from functools import cache

import numpy as np
import pytest
from dense import NetworkReference
from samples import SAMPLES, on_ranks, physics
from springs import floppy_lattice, pulling_springs, random_springs, shuffled
from whole_arrays import dense, unknowns, whole

import jampetsc
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.io.packing_file import write_network
from jampetsc.laws.damping import Physics, damping_law
from jampetsc.laws.loads import compression, simple_shear
from jampetsc.packing.lattices import build_lattice
from jampetsc.packing.spring_network import Network
from jampetsc.petsc.session import current
from jampetsc.plots.draw import draw
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import build_network
from jampetsc.response.elastic import ElasticResponse
from jampetsc.response.rational import RationalSweep

NETWORKS = {"springs": random_springs, "pulling": pulling_springs, "floppy": floppy_lattice}
ALL_WEIGHTS = physics("custom", normal=0.5, transverse=0.3, sliding=0.7, drag=0.2, eta_f=0.4)
DRAG = physics("stokes", eta_f=0.3, tau1=0.7)
CONTACT = physics(beta=0.3)
OMEGA = np.geomspace(1e-3, 1e2, 6)


@cache
def reference(name, physics):
    """The dense reference of a network, made once per process."""
    return NetworkReference(NETWORKS[name](), physics)


def sweep_of(source, physics, omega=OMEGA, accuracy=1e-8):
    """G* of a certified rational sweep. Collective."""
    network = build_network(source, current().comm, physics.prestress)
    sweep = RationalSweep(assemble(network, physics.law), omega, accuracy)
    while shifts := sweep.next_shifts():
        sweep.add_shifts(shifts)
    assert sweep.certificate.within(accuracy).all()
    return sweep.certificate.G


@pytest.mark.scalar("real", "complex")
@pytest.mark.parametrize("law", [ALL_WEIGHTS, CONTACT, Physics(ALL_WEIGHTS.law, prestress=False)], ids=str)
def test_matrices_of_springs_that_push_and_pull(session, law):
    exact = reference("springs", law)
    network = build_network(random_springs(), session.comm, law.prestress)
    assert (network.n, network.rattlers, network.contact_count) == (exact.n, 2, exact.contacts)
    pencil = assemble(network, law.law, pinned=False)
    rows = unknowns(network, exact.dofs, exact.disks)
    for name, border, corner in (("K", pencil.k_gamma, pencil.k_gg), ("B", pencil.b_gamma, pencil.b_gg)):
        wanted = getattr(exact, name).astype(float)
        about = {"rtol": 0, "atol": 1e-13 * np.abs(wanted).max()}
        np.testing.assert_allclose(dense(getattr(pencil, name)), wanted[np.ix_(rows, rows)], **about)
        np.testing.assert_allclose(whole(border), wanted[rows, -1], **about)
        assert corner == pytest.approx(wanted[-1, -1], rel=1e-13)


CASES = [("pulling", ALL_WEIGHTS), ("pulling", CONTACT), ("pulling", DRAG), ("floppy", DRAG)]


@pytest.mark.scalar("real")
@pytest.mark.parametrize(("name", "law"), CASES, ids=str)
def test_modulus_of_springs(session, name, law):
    """Also of a floppy network, whose zero modes drag resists."""
    exact = np.array([reference(name, law).modulus(omega) for omega in OMEGA])
    G = sweep_of(NETWORKS[name](), law)
    np.testing.assert_allclose(G.real, exact.real, rtol=1e-8)
    np.testing.assert_allclose(G.imag, exact.imag, rtol=1e-8)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_functions_and_files_take_networks(session, tmp_path):
    """A sweep certifies that K is a sum of squares; all that belongs to packings is left out of its file."""
    network = pulling_springs()
    exact = reference("pulling", DRAG)
    write_network(tmp_path / "n.h5", network)
    for source, sweep in ((network, {"method": "rational"}), (str(tmp_path / "n.h5"), {"method": "direct"})):
        result = jampetsc.sweep(source, DRAG.law, omega=[1e-2, 1.0], **sweep)
        np.testing.assert_allclose(result.G, [exact.modulus(omega) for omega in (1e-2, 1.0)], rtol=1e-6)
        facts = result.attributes
        assert facts["positive_semidefinite"].startswith(
            "by construction (no bond pushes); but forces are not balanced"
        )
        assert (facts["bond_count"], facts["particle_count"], facts["packing_sha256"]) == (
            72,
            18,
            network.fingerprint,
        )
        assert not {"phi", "rattlers", "coordination", "force_threshold"} & facts.keys()
        assert result.packing.fingerprint == network.fingerprint
    slow = jampetsc.quasistatic(network, DRAG.law)
    assert slow.attributes["G0"] == pytest.approx(exact.quasistatic()[1], rel=1e-10)
    assert slow.attributes["eta0"] == pytest.approx(exact.eta0(), rel=1e-10)
    modes = jampetsc.modes(network, count=3)
    values = np.linalg.eigvalsh(exact.K[:-1, :-1].astype(float))
    np.testing.assert_allclose(modes["eigenvalues"], values[2:5], rtol=1e-9)
    matrices = jampetsc.assemble(network, DRAG.law).to_scipy()
    assert np.abs(matrices.K).sum() == pytest.approx(float(np.abs(exact.K[:-1, :-1]).sum()), rel=1e-12)
    with np.load(jampetsc.export(modes, mode=2, out=tmp_path / "mode.npz")) as exported:
        np.testing.assert_array_equal(exported["mode"][modes["particles"]], modes["modes"][1])
        np.testing.assert_array_equal(exported["tension"], network.tension)
    with pytest.raises(
        InputError, match=r"modes\.data: this format has no motion of nodes\. Choose the ending"
    ):
        jampetsc.export(modes, out=tmp_path / "modes.data")
    with pytest.raises(InputError, match=r"K has \d+ floppy modes besides its translations"):
        jampetsc.quasistatic(floppy_lattice(), DRAG.law)
    assert "72" in jampetsc.info(network, matrices=True, law=DRAG.law)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_motion_of_networks_is_correlated_and_drawn(session, tmp_path):
    """Of nodes without radii the unit of length is the mean bond; a file of the network stands beside the sweep."""
    network = floppy_lattice(keep=0.8)
    write_network(tmp_path / "n.h5", network)
    jampetsc.sweep(str(tmp_path / "n.h5"), DRAG.law, omega=[1.0], fields=[1.0], out=tmp_path / "s.h5")
    inside = jampetsc.sweep(network, DRAG.law, omega=[1.0], fields=[1.0])
    found = [jampetsc.correlate(one) for one in (jampetsc.load(tmp_path / "s.h5"), inside)]
    np.testing.assert_array_equal(found[0]["C"], found[1]["C"])
    assert found[0].attributes["mean_diameter"] == pytest.approx(1.0)
    assert len(draw([jampetsc.load(tmp_path / "s.h5")], "fields").axes) == 2
    times = jampetsc.spectrum(inside)
    assert times.attributes["G0"] == pytest.approx(inside.spectrum.G0) and times["creep/J"].min() > 0.0
    assert times.attributes["load"] == "xy"


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_study_of_networks(session, shared_path):
    (shared_path / "STUDY.toml").write_text(
        '[springs]\nlattice = "triangular"\nsize = 4\nkeep = [0.8, 0.9]\nseed = 2\n\n'
        '[sweep]\nlaw = "stokes"\neta_f = 0\nomega = "1e-2,1"\n'
    )
    table = jampetsc.study(shared_path / "STUDY.toml", out=shared_path / "study")
    sweeps = table.where(command="sweep")
    assert sweeps.rows == 2 and set(sweeps["state"]) == {"done"} and sorted(sweeps["keep"]) == [0.8, 0.9]


@pytest.mark.scalar("real")
@pytest.mark.least_ranks(2)
@pytest.mark.parametrize("name", ["pulling", "floppy"])
def test_the_order_of_nodes_and_bonds_does_not_count(session, name):
    network = NETWORKS[name]()
    np.testing.assert_allclose(sweep_of(shuffled(network), DRAG), sweep_of(network, DRAG), rtol=1e-12)


@pytest.mark.scalar("real")
@pytest.mark.parametrize("name", on_ranks(["published", "isostatic", "hertzian"], ["isostatic"]))
def test_the_contacts_of_a_packing_are_a_network_of_its_response(session, name):
    packing = SAMPLES[name]()
    network = Network.of_packing(packing)
    for law in (physics(), physics("stokes")):
        np.testing.assert_allclose(sweep_of(network, law), sweep_of(packing, law), rtol=1e-12)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.parametrize(("size", "k"), [((6, 6), 1.0), ((5, 3), 2.0)])
def test_moduli_of_the_triangular_lattice(session, size, k):
    """G = (√3/4) k and the bulk modulus (√3/2) k: every motion is affine."""
    lattice = build_lattice("triangular", size)
    lattice = lattice.replace(stiffness=k * lattice.stiffness)
    elastic = ElasticResponse(build_network(lattice, session.comm))
    shear, bulk = (elastic.respond(load) for load in (simple_shear(), compression()))
    assert shear.value / lattice.volume == pytest.approx(np.sqrt(3.0) / 4.0 * k, rel=1e-13)
    assert bulk.value / lattice.volume == pytest.approx(np.sqrt(3.0) / 2.0 * k, rel=1e-13)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_moduli_grow_with_one_power_at_the_threshold(session):
    """keep = 0.65 of a triangular lattice with drag: G' and G'' ~ ω^Δ, measured 0.41 at 64 × 64, mean-field ½."""
    omega = np.geomspace(1e-4, 1e-2, 4)
    sweeps = [
        sweep_of(
            build_lattice("triangular", (32, 32)).diluted(0.65, seed),
            physics("stokes", eta_f=0.0),
            omega,
            1e-3,
        )
        for seed in (1, 2)
    ]
    G = np.mean(sweeps, axis=0)
    slopes = [np.polyfit(np.log(omega), np.log(part), 1)[0] for part in (G.real, G.imag)]
    assert 0.35 < min(slopes) and max(slopes) < 0.55 and abs(slopes[0] - slopes[1]) < 0.15, slopes


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_floppy_lattice_flows(session):
    """At low frequency G' ~ ω² and G'' ~ ω under drag; at high frequency G' is that of affine motion."""
    network = floppy_lattice()
    G = sweep_of(network, physics("stokes", eta_f=0.0), np.array([1e-5, 2e-5, 1e4]), accuracy=1e-4)
    assert G[1].real / G[0].real == pytest.approx(4.0, rel=1e-3)
    assert G[1].imag / G[0].imag == pytest.approx(2.0, rel=1e-3)
    bonds = network.linear_bonds
    affine = np.sum(bonds.stiffness * (bonds.r[:, 0] * bonds.r[:, 1] / bonds.distance) ** 2) / network.volume
    assert G[2].real == pytest.approx(affine, rel=1e-3)
    with pytest.raises(
        ConvergenceError, match=r"modes .*, which drag alone resists: .* Narrow the range of omega"
    ):
        jampetsc.sweep(network, physics("stokes", eta_f=0.0).law, omega=[1e-14, 1.0])


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_floppy_modes_that_no_load_drives_do_not_spoil_the_modulus(session):
    """A node whose bonds are in one line is free across it: K does not resist that, and no load drives it."""
    omega, law = np.array([1e-5, 1.0, 1e2]), physics("stokes", eta_f=0.0)
    for seed in (1, 3, 5):  # of which G* was lost to the rounding of such modes
        network = build_lattice("triangular", (6, 6)).diluted(0.7, seed)
        exact = np.array([NetworkReference(network, law).modulus(w) for w in omega])
        G = sweep_of(network, law, omega, accuracy=1e-6)
        np.testing.assert_allclose([G.real, G.imag], [exact.real, exact.imag], rtol=1e-6)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_moves_that_meet_neither_springs_nor_damping_are_counted(session):
    """Normal damping lets a floppy lattice flow; the number is that of the dense K + B."""
    network, law = floppy_lattice(), physics("custom", normal=1.0)
    exact = NetworkReference(network, law)
    values = np.linalg.eigvalsh((exact.K + exact.B)[:-1, :-1].astype(float))
    count = int(np.count_nonzero(values < 1e-10)) - exact.free_moves().shape[1]
    with pytest.raises(
        InputError, match=rf"{count} moves besides translations cost neither energy nor dissipation"
    ):
        jampetsc.sweep(network, law.law, omega=[1e-2, 1.0])


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_nodes_without_radii_do_not_roll(session):
    network = build_network(random_springs(radii=False), session.comm)
    with pytest.raises(
        InputError, match=r"network without radii: its nodes roll under this damping law\. Give"
    ):
        assemble(network, damping_law())
    assemble(network, damping_law(rotations=False))


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_elastic_constants_of_the_triangular_lattice(session):
    """C_xxxx = C_yyyy = 3√3/4, C_xxyy = C_xyxy = √3/4 of springs of k = 1: isotropic, of Poisson ratio 1/3."""
    lattice = build_lattice("triangular", (6, 6))
    found = jampetsc.quasistatic(lattice, jampetsc.ContactDamping(rotations=False), load="tensor")
    expected = np.sqrt(3.0) / 4.0 * np.array([[3.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(found["C0"], expected, rtol=0, atol=1e-12)
    assert found.attributes["bulk_modulus"] == pytest.approx(np.sqrt(3.0) / 2.0, rel=1e-12)
    assert found.attributes["shear_modulus"] == pytest.approx(np.sqrt(3.0) / 4.0, rel=1e-12)
