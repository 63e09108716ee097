"""Any load: moduli, bounds and the tensor against the dense reference and published numbers (tests/data/README.md)."""

import numpy as np
import pytest
from dense import Reference
from samples import (
    LAWS,
    TABLE_LAWS,
    TENSOR_TABLE,
    errors_of,
    on_ranks,
    physics,
    polydisperse,
    published,
    sizes_of,
    table_tensor,
)
from samples import network_of as build
from scipy.io import mmread

import jampetsc as jp
from jampetsc.analysis.elasticity import anisotropy, bulk_modulus, least_modulus, modulus_along, shear_modulus
from jampetsc.errors import InputError
from jampetsc.laws.loads import (
    TENSOR,
    Load,
    LoadChoice,
    compression,
    named_loads,
    pure_shear,
    simple_shear,
    symmetric_loads,
    uniaxial,
)
from jampetsc.packing.contacts import measure
from jampetsc.response.assembly import assemble
from jampetsc.response.direct_sweep import sweep_directly
from jampetsc.response.modulus_sweep import sweep_rationally
from jampetsc.response.slow_response import solve_quasistatic
from jampetsc.response.vibrations import lowest_modes

TABLE = TENSOR_TABLE[2]
SEVERAL = ("contact beta=0.1", "stokes eta_f=1")  # laws on several ranks
ANY = Load("0.3,-1,0.2,0.7", ((0.3, -1.0), (0.2, 0.7)))


def pencil_of(disks, physics, comm):
    return assemble(build(disks, physics, comm), physics.law)


@pytest.mark.scalar("real", "complex")
@pytest.mark.parametrize("name", on_ranks(TABLE_LAWS, SEVERAL))
def test_the_tensor_by_the_direct_method(session, name):
    """To 1e-9 of the largest constant, and within its bounds, though these are some 1e-13."""
    disks, law = polydisperse(TABLE["index"])[0], TABLE_LAWS[name]
    found = sweep_directly(
        pencil_of(disks, law, session.comm), np.array(TABLE["omega"]), 1e-9, symmetric_loads(2),
        positive_semidefinite=True,
    ).tensor  # fmt: skip
    expected = table_tensor(2, name)
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.all(np.abs(found.C - expected) <= 1e-9 * size)
    assert np.all(found.bounds <= 1e-9 * size[..., None])
    assert np.all(
        errors_of(found.C - expected) <= found.bounds + 1e-13 * sizes_of(expected)
    )  # of the table itself


@pytest.mark.scalar("real")
@pytest.mark.parametrize("name", on_ranks(TABLE_LAWS, SEVERAL))
def test_the_tensor_by_the_rational_method(session, name):
    disks, law = polydisperse(TABLE["index"])[0], TABLE_LAWS[name]
    found = sweep_rationally(
        pencil_of(disks, law, session.comm), np.array(TABLE["omega"]), 1e-5, symmetric_loads(2)
    )
    C, bounds = found.tensor.C, found.tensor.bounds
    expected = table_tensor(2, name)
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.all(errors_of(C - expected) <= bounds + 1e-13 * sizes_of(expected))
    assert np.all(bounds <= 1e-5 * size[..., None])
    np.testing.assert_allclose(found.tensor.reduced.modulus(TABLE["omega"]), C, atol=1e-12 * size.max())
    np.testing.assert_allclose(C, C.transpose(0, 2, 1), rtol=0, atol=1e-13 * size.max())
    np.testing.assert_allclose(found.G, shear_modulus(expected), rtol=1e-5)
    assert np.all(np.abs(found.G - shear_modulus(expected)) <= found.bounds[:, 0] + 1e-13 * size.max())
    assert np.all(found.bounds[:, 1:] <= 3e-5 * np.abs(np.stack((found.G.real, found.G.imag), axis=1)))


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("name", ["contact beta=1 no pre-stress", "stokes eta_f=1"])
def test_bounds_hold_where_the_accuracy_is_low(session, name):
    """The error of pairs, too, where it is far above rounding."""
    law, omega = TABLE_LAWS[name], np.geomspace(1e-3, 10.0, 5)
    found = sweep_rationally(pencil_of(published(), law, session.comm), omega, 0.1, symmetric_loads(2)).tensor
    reference = Reference(published(), law, [load.gradient for load in symmetric_loads(2)])
    errors = errors_of(found.C - [reference.tensor(w).astype(complex) for w in omega])
    assert np.all(errors <= found.bounds) and errors.max() > 1e-9


@pytest.mark.scalar("real")
@pytest.mark.parametrize("name", on_ranks(list(LAWS)[::4], list(LAWS)[:1]))
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
    assert [LoadChoice(name) for name in names] == list(names)
    assert all(LoadChoice(name).of(2) == (load,) for name, load in named_loads(2).items())
    assert LoadChoice(TENSOR).of(3) == symmetric_loads(3) and len(symmetric_loads(3)) == 6
    for value in ("0.3,-1,0.2,0.7", [[0.3, -1.0], [0.2, 0.7]], ANY, np.array([0.3, -1, 0.2, 0.7])):
        (load,) = LoadChoice(value).of(2)
        assert load.rows == ANY.rows
    assert LoadChoice(compression(2)) == "compression" and LoadChoice(pure_shear()) == "pure-xy"
    assert uniaxial(3, "z").name == "zz" and simple_shear(3, "zx").rows[2] == (1.0, 0.0, 0.0)
    for wrong in ("shear", "1,2,3", "nan,0,0,1", "0,0,0,0", [[1.0]]):
        with pytest.raises(InputError, match="load"):
            LoadChoice(wrong)
    for text in ("zz", "1,0,0,0,1,0,0,0,1"):
        with pytest.raises(InputError, match="not a load in 2 dimensions"):
            LoadChoice(text).of(2)


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


LIMITS = {
    "C0": lambda reference, load: reference.quasistatic(load)[1],
    "eta0": lambda reference, load: reference.eta0(load),
    "eta_inf": lambda reference, load: reference.eta_infinity(load),
}


@pytest.mark.scalar("real")
@pytest.mark.parametrize("name", on_ranks(list(TABLE_LAWS)[::2], list(TABLE_LAWS)[:1]))
def test_the_quasistatic_tensor(session, name):
    """C₀, η₀ and η_∞ against the limits of the dense reference: diagonal by its energies, pairs by polarisation."""
    law, loads = TABLE_LAWS[name], symmetric_loads(2)
    found = solve_quasistatic(build(published(), law, session.comm), law.law, tensor=loads).tensors[""]
    for a in range(3):
        for b in range(a, 3):
            pair = [loads[a].gradient + sign * loads[b].gradient for sign in (1, -1)]
            reference = Reference(published(), law, pair)
            for quantity, limit in LIMITS.items():
                values = getattr(found, quantity)
                expected = (
                    limit(reference, 0) - limit(reference, 1) if a != b else limit(reference, 0)
                ) / 4.0
                assert values[a, b] == pytest.approx(expected, abs=1e-9 * np.abs(values).max())
                assert values[b, a] == pytest.approx(values[a, b], abs=1e-12 * np.abs(values).max())


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("index", range(10))
def test_elastic_constants_that_jax_md_published(session, index):
    """Six of each packing, in the order of its file."""
    disks, record = polydisperse(index)
    law = physics()
    C = solve_quasistatic(build(disks, law, session.comm), law.law, tensor=symmetric_loads(2)).tensors[""].C0
    order = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]  # xxxx, yyyy, xyxy, xxyy, xxxy, yyxy
    published_constants = np.asarray(record["Cijkl"])
    assert [C[pair] for pair in order] == pytest.approx(published_constants, abs=1e-9)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_the_bulk_modulus_is_that_of_deformed_packings(session):
    """−V dp/dV by differences of the pressure of packings that are minimised again after a change of volume."""
    disks, law = jp.minimise(polydisperse(2)[0], tolerance=1e-12), physics()
    found = solve_quasistatic(build(disks, law, session.comm), law.law, tensor=symmetric_loads(2))
    bulk, step = bulk_modulus(found.tensors[""].C0, disks.pressure), 1e-6
    assert bulk == pytest.approx(found.responses[""].bulk_modulus, rel=1e-10)
    pressures = []
    for strain in (step, -step):  # linear
        changed = type(disks).from_positions(
            disks.positions * (1 + strain), disks.radii, disks.cell * (1 + strain), disks.potential
        )
        pressures.append(jp.minimise(changed, tolerance=1e-12).pressure)
    assert bulk == pytest.approx((pressures[1] - pressures[0]) / (4.0 * step), rel=1e-4)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_a_result_of_the_tensor(session):
    """C at any frequency, the moduli of all directions, and the same numbers by both methods."""
    disks, omega = published(), [1e-3, 1e-2, 1.0]
    rational, direct = (
        jp.sweep(disks, jp.ContactDamping(0.3), omega=omega, load="tensor", method=method)
        for method in ("rational", "direct")
    )
    assert (
        rational.attributes["load"] == "tensor" and "F = 1 + eps E" in rational.attributes["stress_measure"]
    )
    np.testing.assert_allclose(rational["C"], direct["C"], rtol=0, atol=2e-6)
    np.testing.assert_allclose(rational.modulus(omega), rational["C"], rtol=0, atol=1e-12)
    assert rational.modulus(0.1).shape == (3, 3) and direct.modulus([1.0]).shape == (1, 3, 3)
    single = jp.sweep(
        disks, jp.ContactDamping(0.3), omega=[0.1], load=[[0.0, 0.5], [0.5, 0.0]], method="direct"
    )
    assert rational.modulus(0.1)[2, 2] == pytest.approx(single.G[0], rel=1e-5)
    np.testing.assert_allclose(rational.shear_modulus, shear_modulus(rational["C"]), rtol=1e-12)
    pressure = rational.attributes["pressure"]
    np.testing.assert_allclose(rational["bulk_modulus"], bulk_modulus(rational["C"], pressure), rtol=1e-12)
    squeezed = jp.sweep(disks, jp.ContactDamping(0.3), omega=omega, load=jp.loads.compression(2))
    assert squeezed.load == "compression"
    np.testing.assert_allclose(squeezed.G + pressure / 2.0, rational["bulk_modulus"], rtol=1e-5)
    with pytest.raises(InputError, match="load compression, not a shear"):
        squeezed.shear_modulus  # noqa: B018
    with pytest.raises(InputError, match=r"no single spectrum\. Give a sweep of one load"):
        rational.spectrum  # noqa: B018
    with pytest.raises(InputError, match="run the sweep with method rational"):
        direct.modulus(0.5)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("sweep", [sweep_rationally, sweep_directly])
def test_a_tensor_continues_from_any_step(session, sweep):
    """Steps that are finished are not repeated, whichever load they belong to."""
    pencil, omega, steps = (
        pencil_of(polydisperse(3)[0], physics(), session.comm),
        np.geomspace(1e-4, 1.0, 4),
        {},
    )
    options = {"accuracy": 1e-8, "loads": symmetric_loads(2)}
    whole = sweep(pencil, omega, **options, save=lambda step, *found: steps.update({step: found}))
    assert len(steps) >= 3
    for number in range(1, len(steps) + 1):
        more = []
        resume = {step: steps[step] for step in range(number)}
        found = sweep(
            pencil, omega, **options, resume=resume, save=lambda step, *_, more=more: more.append(step)
        )
        assert more == list(range(number, len(steps)))
        np.testing.assert_allclose(found.tensor.C, whole.tensor.C, rtol=0, atol=1e-12)
        assert found.factorisations == whole.factorisations


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_a_quasistatic_result_of_any_load(session):
    disks = published()
    tensor, squeezed, plain = (jp.quasistatic(disks, load=load) for load in ("tensor", "compression", "xy"))
    C0, pressure = tensor["C0"], plain.attributes["pressure"]
    for result in (tensor, plain):
        bulk = result.attributes["bulk_modulus"]
        assert bulk == pytest.approx(squeezed.attributes["G0"] + pressure / 2.0, rel=1e-10)
    assert bulk_modulus(C0, pressure) == pytest.approx(tensor.attributes["bulk_modulus"], rel=1e-10)
    assert bulk_modulus(tensor["no_prestress/C0"], 0.0) == pytest.approx(
        tensor.attributes["no_prestress_bulk_modulus"], rel=1e-10
    )
    assert tensor.attributes["shear_modulus"] == pytest.approx(shear_modulus(C0))
    least, E = least_modulus(C0)
    assert tensor.attributes["least_modulus"] == least and np.sum(E**2) == pytest.approx(1.0)
    assert modulus_along(C0, E) == pytest.approx(least)
    assert least <= min(2.0 * C0[2, 2], np.linalg.eigvalsh(C0[:2, :2])[0]) + 1e-12
    for name in ("G0", "eta0", "eta_inf"):  # of simple shear
        assert tensor.attributes[name] == plain.attributes[name]
    stress = measure(disks).stress
    relation = C0[2, 2] + (3.0 * stress[1, 1] - stress[0, 0]) / 4.0
    assert plain.attributes["G0"] == pytest.approx(relation, rel=1e-9)
    row = np.argsort(squeezed["particles"])  # no rattlers
    i, j = row[squeezed["contacts/pairs"]].T
    u, r = squeezed["nonaffine"], squeezed["contacts/bonds"]
    motion = np.sum((u[j] - u[i] + r / 2.0) * r, axis=1) / np.hypot(*r.T)
    np.testing.assert_allclose(motion, squeezed["contacts/normal"], atol=1e-10)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_all_modes_together_make_up_the_response_to_each_load(session):
    """Σ F²/λ = (M_affine − M) V: the shares of every load add up to one."""
    network, law = build(polydisperse(1)[0], physics(), session.comm), physics().law
    modes = lowest_modes(network, load=compression(), tensor=symmetric_loads(2))
    np.testing.assert_allclose(modes.tensor.modulus.sum(axis=0), 1.0, rtol=1e-9)
    for name in ("modulus", "nonaffine", "transverse"):
        assert modes.contributions.share[name].sum() == pytest.approx(1.0, rel=1e-9)
    slow = solve_quasistatic(network, law, load=compression()).responses[""]
    relaxed = (slow.G_affine - slow.G0) * network.volume
    assert np.sum(modes.shear_force**2 / modes.eigenvalues) == pytest.approx(relaxed, rel=1e-9)
    trace = modes.tensor.force[:, 0] + modes.tensor.force[:, 1]
    np.testing.assert_allclose(trace / 2.0, modes.shear_force, atol=1e-12)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_the_tensor_follows_from_the_matrices(session):
    """C = V⁻¹ (z_EE′ − z_Eᵀ Z⁻¹ z_E′) with what `assemble` gives."""
    disks, law, s = published(), physics(beta=0.5), 0.1j
    whole = jp.assemble(disks, law.law, load="tensor").to_scipy()
    kept = np.setdiff1d(np.arange(len(whole.dofs)), whole.pins)
    Z = (whole.K + s * whole.B)[kept][:, kept].toarray()
    z, corner = (whole.k_gamma + s * whole.b_gamma)[kept], whole.k_gg + s * whole.b_gg
    C = (corner - z.T @ np.linalg.solve(Z, z)) / whole.area
    reference = Reference(disks, law, [load.gradient for load in symmetric_loads(2)])
    np.testing.assert_allclose(C, reference.tensor(0.1).astype(complex), rtol=0, atol=1e-11)
    single = jp.assemble(disks, law.law, load="yy").to_scipy()
    np.testing.assert_allclose(single.k_gamma, whole.k_gamma[:, 1], rtol=0, atol=1e-15)
    assert single.b_gg == pytest.approx(whole.b_gg[1, 1], rel=1e-13)
    with pytest.raises(InputError, match="to_pymor: matrices of a tensor"):
        whole.to_pymor()


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("ending", ["npz", "petsc", "mtx"])
def test_files_of_the_matrices_of_a_tensor(session, shared_path, ending):
    whole = jp.assemble(published(), load="tensor").to_scipy()
    files = jp.matrices(published(), load="tensor", out=shared_path / f"K.{ending}")
    if ending == "npz":
        with np.load(files[0]) as stored:
            np.testing.assert_array_equal(stored["k_gamma"], whole.k_gamma)
            np.testing.assert_array_equal(stored["k_gg"], whole.k_gg)
    elif ending == "mtx":
        (file,) = [file for file in files if file.name == "K-b_gamma.mtx"]
        np.testing.assert_array_equal(mmread(file), whole.b_gamma)
    else:
        PETSc = session.PETSc
        viewer = PETSc.Viewer().createBinary(str(files[0]), "r", comm=session.comm)
        for _ in range(2):
            PETSc.Mat().load(viewer)
        vectors = [PETSc.Vec().load(viewer).getArray().real.copy() for _ in range(7)]
        np.testing.assert_array_equal(np.column_stack(vectors[:3]), whole.k_gamma)
        np.testing.assert_array_equal(np.column_stack(vectors[3:6]), whole.b_gamma)
        np.testing.assert_array_equal(
            vectors[6], np.concatenate((np.ravel(whole.k_gg), np.ravel(whole.b_gg), [whole.area]))
        )
