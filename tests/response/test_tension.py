"""Bounds where pre-stress stiffens (networks under tension), where terms of a load cancel, and where a part is zero."""

import contextlib
import json
from functools import cache

import numpy as np
import pytest
from dense import NetworkReference, Reference
from samples import DATA, on_ranks, published
from springs import pulling_springs
from sweeps import Sweep, errors
from whole_arrays import dense

import jampetsc
from jampetsc.analysis.error_bounds import ZERO_PART_RATIO
from jampetsc.errors import ConvergenceError
from jampetsc.laws.damping import Law, Physics
from jampetsc.laws.loads import Load
from jampetsc.packing.lattices import build_lattice
from jampetsc.packing.spring_network import Network
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import build_network
from jampetsc.response.direct import FrequencySolver
from jampetsc.response.rational import RationalSweep, largest_rate
from jampetsc.response.residual import transfer

TABLE = json.loads((DATA / "tension.json").read_text())
POORLY_ACROSS = Physics(Law("poor across", normal=1.0, transverse=1e-4))


def published_tension():
    """24 nodes and springs of rest length zero, tests/data/README.md."""
    return Network(
        *(TABLE[name] for name in ("positions", "bonds", "cell", "stiffness", "tension", "images"))
    )


def stretched_lattice(strength=100.0):
    """A triangular lattice whose bonds pull with `strength` times their stiffness per length."""
    network = build_lattice("triangular", (4, 4)).diluted(0.9, 3)
    return network.replace(tension=strength * network.stiffness * network.linear_bonds.distance)


@cache
def contacts_that_pull():
    """The contacts of 16 spheres, with random tension from 1e-3 k to 1e3 k."""
    network = Network.of_packing(jampetsc.pack(n=16, pressure=1e-2, seed=1, dimension=3))
    strength = 10.0 ** np.random.default_rng(1).uniform(-3.0, 3.0, len(network.bonds))
    return network.replace(tension=strength * network.stiffness * network.linear_bonds.distance)


NETWORKS = {
    "no rest length": published_tension,
    "lattice": stretched_lattice,
    "springs": pulling_springs,
    "spheres": contacts_that_pull,
}
LAWS = {
    "transverse": Physics(Law("transverse", normal=1.0, transverse=1e-4, tau1=0.3)),
    "drag": Physics(Law("drag", drag=0.02, tau1=3.0)),
    "all": Physics(Law("all", normal=1e-3, transverse=1.0, drag=1e-6)),
    "no pre-stress": Physics(Law("no pre-stress", normal=1.0, transverse=1e-4), prestress=False),
}


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", on_ranks(NETWORKS, ("springs",)))
def test_tension_raises_the_largest_rate(session, name, law):
    """K ≤ λ_max B, and what is carried from shift to frequency with it: (K + ωB)⁻¹ ≤ c (K + sB)⁻¹."""
    network = build_network(NETWORKS[name](), session.comm, LAWS[law].prestress)
    pencil = assemble(network, LAWS[law].law)
    top, free = largest_rate(pencil), np.delete(np.arange(pencil.unknowns), pencil.pins)
    K, B = (dense(matrix)[np.ix_(free, free)] for matrix in (pencil.K, pencil.B))
    assert np.isfinite(top)
    assert np.linalg.eigvalsh(top * B - K)[0] > -1e-12 * top * np.abs(B).max()
    shifts = top * np.array([1e-3, 1.0, 1e2])
    for s in shifts:
        for omega in shifts:
            less = transfer(top, s, omega) * (K + omega * B) - (K + s * B)
            assert np.linalg.eigvalsh(less)[0] > -1e-11 * np.abs(K + s * B).max()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_tension_that_nothing_damps_has_no_largest_rate(session):
    """Sliding does not count: spins follow a turning bond without it."""
    pulls, rests = (
        pulling_springs(),
        pulling_springs().replace(tension=np.zeros(len(pulling_springs().bonds))),
    )
    for weights in ({"normal": 1.0}, {"normal": 1.0, "sliding": 1.0}):
        found = [
            largest_rate(assemble(build_network(source, session.comm), Law("law", **weights)))
            for source in (pulls, rests)
        ]
        assert found[0] == np.inf > found[1]


@pytest.mark.scalar("real")
def test_bounds_of_springs_without_rest_length(session):
    """Against the published modulus: the bound was a hundred times too small at the highest frequencies."""
    omega = np.array(TABLE["omega"])
    for accuracy in (TABLE["accuracy"], 1e-8):
        found = Sweep(published_tension(), POORLY_ACROSS, omega, accuracy, session.comm).solved()
        for place, value in TABLE["G"].items():
            (i,) = np.flatnonzero(omega == float(place))
            error, _ = errors(found.G[[i]], [complex(*value)])
            assert np.all(error <= found.bounds[[i]])
            assert np.all(found.bounds[i, 1:] <= accuracy * np.abs(value))


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("name", NETWORKS)
def test_bounds_under_tension(session, name):
    omega = np.geomspace(1e-3, 1e8, 6)
    reference = NetworkReference(NETWORKS[name](), POORLY_ACROSS)
    exact = [reference.modulus(at) for at in omega]
    for accuracy in (1e-2, 1e-6):
        found = Sweep(NETWORKS[name](), POORLY_ACROSS, omega, accuracy, session.comm).solved()
        assert np.all(errors(found.G, exact)[0] <= found.bounds)


ROTATIONS = {2: [[0.0, 1.4], [-1.4, 0.0]], 3: [[0.0, 1.3, -0.3], [-1.3, 0.0, -0.8], [0.3, 0.8, 0.0]]}


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("drag", [0.0, 0.2])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_part_far_below_the_modulus_has_the_rounding_of_its_terms(session, dimension, drag):
    """A rotation stretches no bond but for rounding, whose energy is all of G' that a double has at low ω."""
    packing = published() if dimension == 2 else jampetsc.pack(n=16, pressure=0.05, seed=2, dimension=3)
    law = Physics(Law("law", normal=1.0, sliding=20.0, drag=drag), prestress=False)
    load = Load("rotation", tuple(map(tuple, ROTATIONS[dimension])))
    omega = np.array([1e-12, 1e-10, 1e-6, 1e-2])
    reference = Reference(packing, law, [load.gradient])
    exact = [reference.modulus(at) for at in omega]
    pencil = assemble(build_network(packing, session.comm, prestress=False), law.law).under(load)
    sweep, solver = RationalSweep(pencil, omega, 1e-2), FrequencySolver(pencil, positive_semidefinite=True)
    with contextlib.suppress(ConvergenceError):  # the lowest G' is not known to 1 %
        while shifts := sweep.next_shifts():
            sweep.add_shifts(shifts)
    solved = [solver.solve(at, np.inf) for at in omega]
    for found in (
        (sweep.certificate.G, sweep.certificate.bounds),
        zip(*((s.G, s.bounds) for s in solved), strict=True),
    ):
        G, bounds = (np.array(values) for values in found)
        assert np.all(errors(G, exact)[0] <= bounds)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("method", ["rational", "direct"])
@pytest.mark.parametrize(("load", "eta_f"), [("xy", 0.0), ("compression", 1.0), ("tensor", 0.0)])
def test_a_loss_that_vanishes_is_zero_to_rounding(session, load, eta_f, method):
    """Nothing moves against the strain in a perfect lattice, so drag dissipates nothing."""
    found = jampetsc.sweep(
        build_lattice("triangular", (4, 4)), jampetsc.StokesDrag(eta_f=eta_f), load=load,
        omega=[1e-6, 1.0, 1e3], method=method,
    )  # fmt: skip
    assert np.all(np.abs(found.G.imag) <= found["error_bound_loss"])
    assert np.all(found["error_bound_loss"] <= ZERO_PART_RATIO * np.abs(found.G))
    assert np.all(found["error_bound_storage"] <= 1e-6 * found.G.real)
    assert "G'': zero to rounding at 3 of 3 frequencies, at most" in str(found.attributes["notes"])


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize(
    "law", [jampetsc.StokesDrag(), jampetsc.ContactDamping(beta=0.0, rotations=False)], ids=str
)
def test_a_modulus_that_vanishes_is_refused(session, law):
    """A lattice turns as a whole without resistance, unless transverse motion dissipates."""
    lattice, omega = build_lattice("triangular", (4, 4)), [1e-6, 1.0]
    with pytest.raises(
        ConvergenceError, match=r"nothing resists the load: .* or where a rotation dissipates nothing"
    ):
        jampetsc.sweep(lattice, law, load=ROTATIONS[2], omega=omega)
    turning = jampetsc.sweep(
        lattice, jampetsc.ContactDamping(rotations=False), load=ROTATIONS[2], omega=omega
    )
    assert np.all(np.abs(turning.G.real) <= turning["error_bound_storage"])
    assert np.all(turning["error_bound_loss"] <= 1e-6 * turning.G.imag)
