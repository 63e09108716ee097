"""`assemble` and `jampetsc matrices`: G* of what they give, by numpy, is that of the dense reference."""

import importlib.util

import numpy as np
import pytest
import samples
from dense import Reference
from samples import physics
from scipy.io import mmread
from scipy.sparse import csr_array
from scipy.sparse.linalg import spsolve

import jampetsc
from jampetsc import main as cli
from jampetsc.errors import InputError
from jampetsc.response.assembled_matrices import NAMES, SPARSE, PackingMatrices

pytestmark = pytest.mark.scalar("real")
OMEGA = (1e-3, 1.0)
LAWS = [
    physics(),
    physics(beta=0.1, prestress=False),
    physics(rotations=False),
    physics("stokes", tau1=0.5),
    physics("stokes", prestress=False),
]


def modulus(m, omega):
    """G* = [k_γγ + iωb_γγ − cᵀ(K + iωB)⁻¹c]/V, c = k_γ + iωb_γ, pins left out."""
    kept = np.setdiff1d(np.arange(len(m.dofs)), m.pins)
    A = (m.K + 1j * omega * m.B).tocsc()[kept][:, kept]
    c = (m.k_gamma + 1j * omega * m.b_gamma)[kept]
    return (m.k_gg + 1j * omega * m.b_gg - c @ spsolve(A, c)) / m.area


@pytest.fixture
def packing(session, shared_path):
    return samples.put(shared_path / "p.h5", samples.isostatic(), session.comm)


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_they_are_those_of_the_dense_reference(session, law):
    """With nothing held; and so is G* of them, without the rows of pins."""
    disks = samples.isostatic()
    matrices, exact = jampetsc.assemble(disks, law.law, prestress=law.prestress), Reference(disks, law)
    whole = matrices.to_scipy()
    matrices.destroy()
    rows = [exact.disks.index(disk) * exact.dofs + component for disk, component in whole.dofs]
    assert sorted(rows) == list(range(len(exact.K) - 1))
    for name in SPARSE:
        dense, border = getattr(exact, name).astype(float), f"{name.lower()}_g"
        np.testing.assert_allclose(getattr(whole, name).toarray(), dense[np.ix_(rows, rows)], atol=1e-13)
        found = np.append(getattr(whole, f"{border}amma"), getattr(whole, f"{border}g"))
        np.testing.assert_allclose(found, dense[[*rows, -1], -1], atol=1e-12)
    assert sorted(whole.particles) == sorted(exact.disks)
    for omega in OMEGA:
        found, wanted = modulus(whole, omega), exact.modulus(omega)
        np.testing.assert_allclose([found.real, found.imag], [wanted.real, wanted.imag], rtol=1e-9)


def test_a_model_for_pymor_has_the_same_moduli(session, packing):
    matrices = jampetsc.assemble(packing, jampetsc.ContactDamping(beta=0.1))
    if importlib.util.find_spec("pymor") is None:
        with pytest.raises(InputError, match=r"requires the package pymor\. Run: .* -m pip install pymor"):
            matrices.to_pymor()
        return
    model, whole = matrices.to_pymor(), matrices.to_scipy()
    for omega in OMEGA:
        (found,) = model.transfer_function.eval_tf(1j * omega).ravel()
        assert found * 1j * omega == pytest.approx(modulus(whole, omega), rel=1e-10)


def read(out):
    """The Matrices in what the command has written."""
    if out.suffix == ".npz":
        held = np.load(out)
        sparse = {name: csr_array((held[name], held["indices"], held["indptr"])) for name in SPARSE}
        return PackingMatrices(**sparse, **{name: held[name] for name in NAMES if name not in SPARSE})
    if out.suffix == ".mtx":
        found = {name: mmread(out.with_name(f"{out.stem}-{name}.mtx")) for name in NAMES}
        return PackingMatrices(
            **{name: csr_array(found.pop(name)) for name in SPARSE},
            **{name: value if name == "dofs" else value[:, 0] for name, value in found.items()},
        )
    from petsc4py import PETSc

    viewer = PETSc.Viewer().createBinary(str(out), "r", comm=PETSc.COMM_SELF)
    K, B = (csr_array(PETSc.Mat().load(viewer).getValuesCSR()[::-1]) for _ in SPARSE)
    k_gamma, b_gamma, numbers = (PETSc.Vec().load(viewer).getArray().copy() for _ in range(3))
    particles, pins = (PETSc.IS().load(viewer).getIndices().copy() for _ in range(2))
    dofs = np.column_stack((np.repeat(particles, 3), np.tile(np.arange(3), len(particles))))
    return PackingMatrices(K, B, k_gamma, b_gamma, *numbers, particles, dofs, pins)


@pytest.mark.parametrize("ending", [".npz", ".mtx", ".petsc"])
def test_files_hold_what_assemble_gives(session, packing, shared_path, ending):
    out = shared_path / f"K{ending}"
    for _ in range(2):  # the second time in the place of the first
        assert cli.dispatch(["matrices", str(packing), "--out", str(out), "--beta", "0.5"]) == 0
    session.comm.Barrier()
    found, whole = read(out), jampetsc.assemble(packing, jampetsc.ContactDamping(beta=0.5)).to_scipy()
    for name in NAMES:
        one, other = (getattr(m, name) for m in (found, whole))
        if name in SPARSE:
            one, other = one.toarray(), other.toarray()
        np.testing.assert_allclose(np.squeeze(one), other, rtol=1e-15, atol=0.0)
