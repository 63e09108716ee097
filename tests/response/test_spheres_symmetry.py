"""Responses in three dimensions that must agree: of copies, rotated axes, another order, a plane in space."""

import itertools

import numpy as np
import pytest
from dense import NetworkReference
from samples import physics, published
from spheres import few_spheres, relaxed

from jampetsc.analysis.elasticity import modulus_along
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.laws.loads import Load, symmetric_loads
from jampetsc.packing.contacts import measure
from jampetsc.packing.lattices import build_lattice
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import build_network
from jampetsc.response.direct_sweep import sweep_directly
from jampetsc.response.minimum_check import count_modes
from jampetsc.response.modulus_sweep import sweep_rationally
from jampetsc.response.slow_response import solve_quasistatic

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(2)]
OMEGA = np.array([1e-2, 1.0])


def tensor(source, law, comm):
    """C* (M, L, L) of a packing or network, certified to 1e-9."""
    pencil = assemble(build_network(source, comm, law.prestress), law.law)
    return sweep_directly(pencil, OMEGA, 1e-9, symmetric_loads(pencil.dimension)).tensor.C


def test_copies_rotations_and_permutations(session):
    disks, law, rng = few_spheres(), physics(beta=0.3), np.random.default_rng(2)
    C = tensor(disks, law, session.comm)
    near = {"rtol": 0, "atol": 1e-9 * np.abs(C).max()}

    numbers = np.array(list(itertools.product((0, 1), repeat=3)))
    places = (disks.positions + (numbers @ disks.cell)[:, None]).reshape(-1, 3)
    copies = Packing.from_positions(places, np.tile(disks.radii, 8), 2 * disks.cell)
    np.testing.assert_allclose(tensor(copies, law, session.comm), C, **near)

    np.testing.assert_allclose(
        tensor(disks.reordered(rng.permutation(disks.n)), law, session.comm), C, **near
    )

    # another cell of the same lattice
    oblique = disks.cell.copy()
    oblique[2] += 2.0 * disks.cell[0] - disks.cell[1]
    oblique[1] -= disks.cell[0]
    same = Packing.from_positions(disks.positions, disks.radii, oblique)
    np.testing.assert_allclose(tensor(same, law, session.comm), C, **near)
    assert np.abs(same.folded().cell).max() < np.abs(oblique).max()

    # cell vectors in another order, then turned until they are lower triangular again: cell · axes
    axes, upper = np.linalg.qr(disks.cell[[2, 0, 1]].T)
    signs = np.sign(np.diag(upper))
    axes, cell = axes * signs, np.tril((upper * signs[:, None]).T)
    turned = tensor(Packing.from_positions(disks.positions @ axes, disks.radii, cell), law, session.comm)
    assert np.abs(turned - C).max() > 0.01 * np.abs(C).max()
    for load in rng.normal(size=(4, 3, 3)):
        load = load + load.T
        np.testing.assert_allclose(
            modulus_along(turned, load), modulus_along(C, axes @ load @ axes.T), rtol=1e-9
        )


def test_a_plane_in_space(session):
    """A network in a plane, at rest and under drag, has the response of two dimensions to loads in the plane.

    Motions out of the plane are floppy, yet not driven.
    """
    disks, law, depth = published(), physics("stokes", eta_f=0.0, prestress=False), 3.0
    flat = Network.of_packing(disks)
    cell = np.zeros((3, 3))
    cell[:2, :2], cell[2, 2] = flat.cell, depth
    solid = Network(
        np.column_stack((flat.positions, np.full(flat.n, 0.4))), flat.bonds, cell, flat.stiffness, 0.0,
        np.column_stack((flat.images, np.zeros(len(flat.bonds)))), dimension=3,
    )  # fmt: skip
    expected, found = (tensor(one, law, session.comm) for one in (flat, solid))
    rows = [0, 1, 5]
    np.testing.assert_allclose(
        depth * found[:, rows][:, :, rows], expected, rtol=0, atol=1e-10 * np.abs(expected).max()
    )
    across = np.delete(found, [0, 1, 5], axis=1)
    np.testing.assert_allclose(across, 0.0, atol=1e-12)
    networks = [build_network(one, session.comm, False) for one in (flat, solid)]
    floppy = [count_modes(one).zero for one in networks]
    assert floppy[1] == floppy[0] + networks[0].n  # all moves out of the plane
    pencil = assemble(networks[1], law.law)
    simple = sweep_rationally(pencil, OMEGA, 1e-8)
    plane = sweep_rationally(assemble(networks[0], law.law), OMEGA, 1e-8)
    np.testing.assert_allclose(depth * simple.G, plane.G, rtol=1e-7)


def test_the_face_centred_cubic_lattice(session):
    """All motion is affine: C_xxxx = √2 k, C_xxyy = C_xyxy = k/√2, and drag adds the fluid alone."""
    law = physics("stokes", eta_f=0.5)
    C = tensor(build_lattice("fcc", (2, 2, 3)), law, session.comm)
    pairs = {(0, 0): np.sqrt(2.0), (0, 1): np.sqrt(0.5), (3, 3): np.sqrt(0.5), (0, 3): 0.0, (4, 5): 0.0}
    for (row, column), expected in pairs.items():
        np.testing.assert_allclose(C[:, row, column].real, expected, atol=1e-13)
    np.testing.assert_allclose(C[:, 5, 5].imag / OMEGA, 0.5, rtol=1e-12)
    np.testing.assert_allclose(C[:, 0, 0].imag / OMEGA, 0.5 * 4.0 / 3.0, rtol=1e-12)


def test_diamond_is_below_jamming(session):
    """Four contacts each are enough for a sphere, but not for all: 2n where 3n − 3 are needed."""
    faces = np.array([(0, 0, 0), (0, 2, 2), (2, 0, 2), (2, 2, 0)])
    places = 0.98 / np.sqrt(3.0) * np.vstack((faces, faces + 1))
    diamond = Packing.from_positions(places, np.full(8, 0.5), 4 * 0.98 / np.sqrt(3.0) * np.eye(3))
    with pytest.raises(InputError, match="16 contacts between 8 particles leave at least 5 floppy modes"):
        build_network(diamond, session.comm)


def with_another(network, place, neighbours):
    """A network with one more sphere at a place (3,), bonded to these."""
    bonds = [[neighbour, network.n] for neighbour in neighbours]
    return Network(
        np.vstack((network.positions, place)),
        np.vstack((network.bonds, bonds)),
        network.cell,
        images=np.vstack((network.images, np.zeros((len(bonds), 3)))),
        radii=np.append(network.radii, 0.5),
    )


@pytest.mark.parametrize("law, moves", [
    (physics(beta=0.3, prestress=False), (3, 1)),
    (physics("custom", sliding=0.7, drag=0.2, prestress=False), (1, 1)),
    (physics("custom", normal=0.5, transverse=0.3, sliding=0.7, drag=0.2, prestress=False), (1, 1)),
], ids=str)  # fmt: skip
def test_a_sphere_may_twist_about_bonds_of_one_line(session, law, moves):
    """Which costs nothing whatever the damping: one line says how many such moves there are, with the remedy.

    They are as many as a dense K + B has zeros, but for translations and gears, if these cost nothing.
    """
    network = Network.of_packing(few_spheres())
    alone = with_another(network, network.positions[0] + [0.3, 0.9, 0.4], [0])
    inside = np.flatnonzero(~network.images.any(axis=1))[0]  # a bond that does not leave the cell
    middle = network.positions[network.bonds[inside]].mean(axis=0)
    between = with_another(network, middle, network.bonds[inside])
    for more, expected in zip((alone, between), moves, strict=True):
        exact = NetworkReference(more, law)
        both = (exact.K + exact.B)[:-1, :-1].astype(float)
        scale = 1.0 / np.sqrt(np.diag(both))
        zeros = np.count_nonzero(np.linalg.eigvalsh(both * np.outer(scale, scale)) < 1e-10)
        assert zeros - exact.costless().shape[1] == expected
        pencil = assemble(build_network(more, session.comm, False), law.law)
        besides = "" if law.law.drag else " besides translations"
        says = f"{expected} moves?{besides} costs? neither .* twist freely"
        with pytest.raises((InputError, ConvergenceError), match=f"^{says}"):
            sweep_rationally(pencil, OMEGA, 1e-6)
    still = physics(rotations=False, prestress=False)
    assert np.abs(tensor(alone, still, session.comm)).max() > 0.1


@pytest.mark.most_ranks(1)
def test_moduli_of_any_load_and_finite_differences_of_the_energy(session):
    """M_E = s:C:s + σ:(EᵀE − s²) where a rotation dissipates nothing, and the curvature of the least energy."""
    disks, law, step = few_spheres(), physics(beta=0.0), 3e-5
    C, network = tensor(disks, law, session.comm), build_network(disks, session.comm)
    pencil, rng = assemble(network, law.law), np.random.default_rng(8)
    for gradient in np.triu(rng.normal(size=(2, 3, 3))):
        load = Load("of numbers", tuple(map(tuple, gradient.tolist())))
        s, sigma = 0.5 * (gradient + gradient.T), disks.stress
        expected = modulus_along(C, s) + np.sum(sigma * (gradient.T @ gradient - s @ s))
        np.testing.assert_allclose(sweep_directly(pencil, OMEGA, 1e-9, [load]).G, expected, rtol=1e-9)

    def strained(amplitude, gradient):
        F = np.eye(3) + amplitude * np.asarray(gradient)
        return measure(relaxed(disks.positions @ F.T, disks.radii, disks.cell @ F.T, rounds=1))

    ends = [strained(amplitude, gradient).energy for amplitude in (step, -step)]
    curvature = (sum(ends) - 2.0 * measure(disks).energy) / step**2
    slow = solve_quasistatic(network, law.law, load=load).responses[""]
    assert slow.G0 == pytest.approx(curvature / disks.volume, rel=1e-4)
    low, high = (strained(amplitude, np.eye(3) / 3.0).pressure for amplitude in (step, -step))
    assert slow.bulk_modulus == pytest.approx((high - low) / (2.0 * step), rel=1e-4)  # −V dp/dV
