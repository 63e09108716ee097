"""Any load: moduli, bounds and the tensor against the dense reference and published numbers (tests/data/README.md)."""

import json

import numpy as np
import pytest
from dense import Reference
from samples import DATA, LAWS, physics, polydisperse, published
from samples import network_of as build

from jampetsc.analysis.elasticity import anisotropy, bulk_modulus, modulus_along, shear_modulus
from jampetsc.errors import InputError
from jampetsc.laws.damping import Law, Physics
from jampetsc.laws.loads import (
    TENSOR,
    Load,
    compression,
    load_text,
    loads_of,
    named_loads,
    pure_shear,
    simple_shear,
    symmetric_loads,
    uniaxial,
)
from jampetsc.packing.contacts import measure
from jampetsc.response.assembly import assemble
from jampetsc.response.modulus_sweep import sweep_directly, sweep_rationally

((TABLE,),) = [rows for rows in json.loads((DATA / "tensor.json").read_text()).values() if rows[0]["D"] == 2]
WEIGHTS = {
    "contact beta=1": (dict(normal=1, sliding=1), True),
    "contact beta=0.1": (dict(normal=1, sliding=0.1), True),
    "contact beta=1 no rotations": (dict(normal=1, transverse=1), True),
    "contact beta=1 no pre-stress": (dict(normal=1, sliding=1), False),
    "contact beta=0": (dict(normal=1), True),
    "stokes eta_f=1": (dict(drag=1, eta_f=1), True),
}
ANY = Load("0.3,-1,0.2,0.7", ((0.3, -1.0), (0.2, 0.7)))


def law_of(name):
    weights, prestress = WEIGHTS[name]
    return Physics(Law(name, **weights), prestress)


def pencil_of(disks, physics, comm):
    return assemble(build(disks, physics, comm), physics.law)


def table(name):
    """C* (M, 3, 3) of the table."""
    return np.array(TABLE["laws"][name]["tensor"]) @ [1, 1j]


@pytest.mark.scalar("real", "complex")
@pytest.mark.parametrize("name", WEIGHTS)
def test_the_tensor_by_the_direct_method(session, name):
    """To 1e-9 of the largest constant, and within its bounds, though these are some 1e-13."""
    disks, law = polydisperse(TABLE["index"])[0], law_of(name)
    found = sweep_directly(
        pencil_of(disks, law, session.comm), np.array(TABLE["omega"]), 1e-9, symmetric_loads(2),
        positive_semidefinite=True,
    ).tensor  # fmt: skip
    expected = table(name).reshape(found.C.shape)
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.all(np.abs(found.C - expected) <= 1e-9 * size)
    assert np.all(found.bounds <= 1e-9 * size)
    assert np.all(np.abs(found.C - expected) <= found.bounds + 1e-13 * size)  # of the table itself


@pytest.mark.scalar("real")
@pytest.mark.parametrize("name", WEIGHTS)
def test_the_tensor_by_the_rational_method(session, name):
    disks, law = polydisperse(TABLE["index"])[0], law_of(name)
    found = sweep_rationally(
        pencil_of(disks, law, session.comm), np.array(TABLE["omega"]), 1e-5, symmetric_loads(2)
    )
    C, bounds = found.tensor.C, found.tensor.bounds
    expected = table(name).reshape(C.shape)
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.all(np.abs(C - expected) <= bounds + 1e-13 * size)
    assert np.all(bounds <= 1e-5 * size)
    np.testing.assert_allclose(found.tensor.reduced.modulus(TABLE["omega"]), C, atol=1e-12 * size.max())
    np.testing.assert_allclose(C, C.transpose(0, 2, 1), rtol=0, atol=1e-13 * size.max())
    np.testing.assert_allclose(found.G, shear_modulus(expected), rtol=1e-5)
    assert np.all(np.abs(found.G - shear_modulus(expected)) <= found.bounds[:, 0] + 1e-13 * size.max())


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("name", ["contact beta=1 no pre-stress", "stokes eta_f=1"])
def test_bounds_hold_where_the_accuracy_is_low(session, name):
    """The error of pairs, too, where it is far above rounding."""
    law, omega = law_of(name), np.geomspace(1e-3, 10.0, 5)
    found = sweep_rationally(pencil_of(published(), law, session.comm), omega, 0.1, symmetric_loads(2)).tensor
    reference = Reference(published(), law, [load.gradient for load in symmetric_loads(2)])
    error = np.abs(found.C - [reference.tensor(w).astype(complex) for w in omega])
    assert np.all(error <= found.bounds) and error.max() > 1e-9


@pytest.mark.scalar("real")
@pytest.mark.parametrize("name", list(LAWS)[::4])
def test_single_loads_against_the_reference(session, name):
    law, omega = LAWS[name], np.array([1e-2, 1.0])
    pencil = pencil_of(published(), law, session.comm)
    loads = [ANY, compression(), pure_shear()]
    reference = Reference(published(), law, [load.gradient for load in loads])
    for number, load in enumerate(loads):
        expected = np.array([reference.modulus(w, number) for w in omega])
        for sweep in (sweep_rationally, sweep_directly):
            found = sweep(pencil, omega, 1e-6, [load])
            error = found.G - expected
            bounds = np.stack((np.abs(error), np.abs(error.real), np.abs(error.imag)), axis=1)
            assert np.all(bounds <= found.bounds + 1e-15 * np.abs(expected)[:, None])
            assert np.all(found.bounds[:, 1] <= 1e-6 * np.abs(expected.real))


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("law", [physics(beta=0.0), physics("stokes")], ids=str)
def test_any_modulus_follows_from_the_tensor_and_the_stress(session, law):
    """M_E = s:C:s + σ:(EᵀE − s²), exactly, where a rotation dissipates nothing; the fluid adds 2 s′:s″ to C."""
    disks = polydisperse()[0]
    pencil, stress = pencil_of(disks, law, session.comm), measure(disks).stress
    C = sweep_directly(pencil, np.array([0.1]), 1e-9, symmetric_loads(2)).tensor.C[0]
    rng = np.random.default_rng(5)
    for gradient in (simple_shear().gradient, *rng.normal(size=(3, 2, 2))):
        load = Load("any", tuple(map(tuple, gradient)))
        G = sweep_directly(pencil, np.array([0.1]), 1e-9, [load]).G[0]
        s = 0.5 * (gradient + gradient.T)
        expected = modulus_along(C, s) + np.sum(stress * (gradient.T @ gradient - s @ s))
        assert G == pytest.approx(expected, rel=1e-10)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_turned_by_a_right_angle(session):
    """x → −y, y → x: xx and yy change places, xy changes its sign."""
    square = polydisperse()[0]
    positions = square.positions @ [[0.0, 1.0], [-1.0, 0.0]]
    turned = type(square).from_positions(positions, square.radii, square.cell, square.potential)
    pencils = [pencil_of(disks, physics(beta=0.3), session.comm) for disks in (square, turned)]
    C, other = (
        sweep_directly(pencil, np.array([0.3]), 1e-9, symmetric_loads(2)).tensor.C[0] for pencil in pencils
    )
    turn = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    np.testing.assert_allclose(other, turn @ C @ turn, atol=1e-10)


def test_loads_are_read_as_they_are_written():
    names = {**named_loads(2), TENSOR: None}
    assert [load_text(name) for name in names] == list(names)
    assert all(loads_of(name, 2) == (load,) for name, load in named_loads(2).items())
    assert loads_of(TENSOR, 3) == symmetric_loads(3) and len(symmetric_loads(3)) == 6
    for value in ("0.3,-1,0.2,0.7", [[0.3, -1.0], [0.2, 0.7]], ANY, np.array([0.3, -1, 0.2, 0.7])):
        (load,) = loads_of(load_text(value), 2)
        assert load.rows == ANY.rows
    assert load_text(compression(2)) == "compression" and load_text(pure_shear()) == "pure-xy"
    assert uniaxial(3, "z").name == "zz" and simple_shear(3, "zx").rows[2] == (1.0, 0.0, 0.0)
    for wrong in ("shear", "1,2,3", "nan,0,0,1", "0,0,0,0", [[1.0]]):
        with pytest.raises(InputError, match="load"):
            load_text(wrong)
    for text in ("zz", "1,0,0,0,1,0,0,0,1"):
        with pytest.raises(InputError, match="not a load in 2 dimensions"):
            loads_of(text, 2)


@pytest.mark.parametrize("dimension", [2, 3])
def test_averages_over_directions(dimension):
    """The shear modulus and the bulk modulus do not change when C is turned; an isotropic C has no anisotropy."""
    loads = [load.gradient for load in symmetric_loads(dimension)]
    rng = np.random.default_rng(dimension)
    root = rng.normal(size=(dimension**2, dimension**2))
    full = (root @ root.T).reshape((dimension,) * 4)
    full = sum(full.transpose(order) for order in ((0, 1, 2, 3), (1, 0, 2, 3), (0, 1, 3, 2), (1, 0, 3, 2)))
    turn = np.linalg.qr(rng.normal(size=(dimension, dimension)))[0]
    turned = np.einsum("ai,bj,ck,dl,ijkl->abcd", turn, turn, turn, turn, full)
    C, other = (
        np.array([[np.einsum("ij,ijkl,kl", a, one, b) for b in loads] for a in loads])
        for one in (full, turned)
    )
    for average in (shear_modulus, anisotropy, lambda C: bulk_modulus(C, 0.3)):
        assert average(other) == pytest.approx(average(C), rel=1e-12)
    deviators = [load.deviator for load in symmetric_loads(dimension)]
    isotropic = np.array(
        [[2.0 * np.trace(a) * np.trace(b) + 0.6 * np.sum(x * y) for b, y in zip(loads, deviators, strict=True)]
         for a, x in zip(loads, deviators, strict=True)]
    )  # fmt: skip
    assert shear_modulus(isotropic) == pytest.approx(0.3, rel=1e-12)
    assert bulk_modulus(isotropic, 0.0) == pytest.approx(2.0, rel=1e-12)
    assert anisotropy(isotropic) < 1e-14 < anisotropy(C)
