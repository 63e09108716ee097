"""Every file in options/ does what it is for, over the whole range of frequencies, and a user's own option wins."""

from functools import cache

import numpy as np
import pytest
from dense import Reference
from launch import ROOT, run
from samples import physics, polydisperse

import jampetsc
from jampetsc.commands.sweep import Sweep
from jampetsc.io.packing_file import write_packing

OMEGA = "1e-10:1e4:8"
PROGRAM = "../jampetsc/__main__.py"
FOR_SWEEPS = ("mumps", "superlu_dist", "iterative", "low_memory")
FOR_SHIFTS = ("spin_split",)
FOR_MODES = ("modes_cholmod", "modes_many", "modes_mumps")


@cache
def moduli(law, omega):
    """G* of the packing at these frequencies by the dense reference."""
    dense = Reference(polydisperse(3)[0], law)
    return np.array([dense.modulus(w) for w in omega])


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    path = tmp_path_factory.mktemp("options") / "packing.h5"
    write_packing(path, polydisperse(3)[0])
    return path


def test_every_file_is_tested():
    tested = FOR_SWEEPS + FOR_SHIFTS + FOR_MODES
    assert sorted(path.stem for path in (ROOT / "options").glob("*.opts")) == sorted(tested)


@pytest.mark.parametrize(
    ("name", "law", "ranks"),
    [
        *[(name, physics(), ranks) for name in FOR_SWEEPS if name != "low_memory" for ranks in (0, 2)],
        *[(name, physics("stokes", eta_f=0.0), 0) for name in ("low_memory", "iterative")],
        *[(name, physics(), ranks) for name in FOR_SHIFTS for ranks in (0, 2)],
    ],
    ids=str,
)
def test_sweep_by_each_file(name, law, ranks, packing, tmp_path):
    out = tmp_path / "sweep.h5"
    method, accuracy = ("rational", 1e-9) if name in FOR_SHIFTS else ("direct", 1e-6)
    omega = "1e-6,1e-2" if ranks else OMEGA
    words = Sweep(packing, law.law, method=method, omega=omega, accuracy=accuracy).words()
    file = ROOT / "options" / f"{name}.opts" if ranks else f"jampetsc:{name}"
    done = run(ranks, PROGRAM, "sweep", packing, "--out", out, *words, "-options_file", file)
    assert done.returncode == 0, done.stderr
    sweep = jampetsc.load(out)
    exact = moduli(law, tuple(sweep.omega))
    np.testing.assert_allclose(sweep.G_storage, exact.real, rtol=1e-9)
    np.testing.assert_allclose(sweep.G_loss, exact.imag, rtol=1e-9)


@pytest.mark.parametrize("name", FOR_MODES)
def test_modes_by_each_file(name, packing, tmp_path):
    out, file = tmp_path / "modes.h5", f"jampetsc:{name}"
    done = run(0, PROGRAM, "modes", packing, "--out", out, "--count", 12, "-options_file", file)
    assert done.returncode == 0, done.stderr
    found, dense = jampetsc.load(out), Reference(polydisperse(3)[0], physics("stokes"))
    assert found.attributes["method"] == "krylovschur"
    exact = np.linalg.eigvalsh(dense.K[:-1, :-1].astype(float))[2:]  # but for the translations
    np.testing.assert_allclose(found["eigenvalues"], exact[: len(found["eigenvalues"])], rtol=1e-9)


def test_an_option_of_the_user_wins_over_file_and_default(packing, tmp_path):
    out = tmp_path / "sweep.h5"
    file = ROOT / "options" / "mumps.opts"
    done = run(0, PROGRAM, "sweep", packing, "--out", out, "--method", "direct", "--omega", "1e-3,1",
               "-options_file", file, "-freq_pc_type", "lu", "-freq_ksp_type", "gmres")  # fmt: skip
    assert done.returncode == 0, done.stderr
    used = jampetsc.load(out).attributes["petsc_options"]
    assert "-freq_pc_type lu" in used and "-freq_ksp_type gmres" in used
