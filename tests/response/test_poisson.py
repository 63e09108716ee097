"""Poisson's ratio of averages over all directions, in a plane and in space."""

import re

import numpy as np
import pytest

import jampetsc
from jampetsc import main as cli
from jampetsc.analysis.elasticity import bulk_modulus, poisson_ratio, shear_modulus

# central forces at rest obey Cauchy's relations, and so does the mean over all directions: λ = μ
CAUCHY = {"triangular": 1 / 3, "fcc": 1 / 4}


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_bar_of_an_isotropic_solid_gets_thinner_by_the_ratio(dimension):
    D, lame, mu = dimension, 0.7, 0.4
    C = np.zeros((D * (D + 1) // 2,) * 2)
    C[:D, :D] = lame + 2 * mu * np.eye(D)
    C[range(D, len(C)), range(D, len(C))] = mu
    compliance = np.linalg.inv(C)
    ratio = poisson_ratio(bulk_modulus(C, 0.0), shear_modulus(C), D)
    assert ratio == pytest.approx(-compliance[0, 1] / compliance[0, 0], rel=1e-13)
    assert ratio == pytest.approx(lame / ((D - 1) * lame + 2 * mu), rel=1e-13)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("lattice", CAUCHY)
def test_lattices_of_central_forces(session, shared_path, capsys, lattice):
    file = shared_path / "lattice.h5"
    options = ["--size", "3", "--out", str(file)]
    assert cli.dispatch(["springs", "--lattice", lattice, *options]) == 0
    law = ["--law", "stokes", "--load", "tensor"]
    slow, sweep = (str(shared_path / f"{name}.h5") for name in ("slow", "sweep"))
    assert cli.dispatch(["quasistatic", str(file), *law, "--out", slow]) == 0
    assert cli.dispatch(["sweep", str(file), *law, "--omega", "1e-3,1", "--out", sweep]) == 0
    assert cli.dispatch(["info", sweep]) == 0
    written = session.comm.bcast(capsys.readouterr().out)
    ratio = CAUCHY[lattice]
    assert jampetsc.load(slow).attributes["poisson_ratio"] == pytest.approx(ratio, rel=1e-12)
    said = [float(value) for value in re.findall(r"Poisson ratio +([\d.]+)", written)]
    np.testing.assert_allclose(said, ratio, rtol=1e-3)  # without pre-stress again, sweep, info
    assert len(said) in (3, 4) and len(re.findall("at omega 0.001, ", written)) == 2


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_packings(session, jammed):
    result = jampetsc.quasistatic(jammed, load="tensor")
    a, D = result.attributes, jammed.dimension
    for group, prefix in (("", ""), ("no_prestress/", "no_prestress_")):
        K, C = a[f"{prefix}bulk_modulus"], result[f"{group}C0"]
        pressure = a["pressure"] if prefix == "" else 0.0
        assert np.mean(C[:D, :D]) + pressure * (D - 1) / D == pytest.approx(K, rel=1e-9)
        G = a[f"{prefix}shear_modulus"]
        expected = (K - G) / (K + G) if D == 2 else (3 * K - 2 * G) / (2 * (3 * K + G))
        assert a[f"{prefix}poisson_ratio"] == pytest.approx(expected, rel=1e-12)
    assert "poisson_ratio" not in jampetsc.quasistatic(jammed).attributes
