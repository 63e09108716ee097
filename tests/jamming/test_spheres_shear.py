"""Quasistatic shear and samples of spheres; the factor of their Hessian."""

import numpy as np
import pytest
from sheared import stop_after

import jampetsc as jp
from jampetsc import models
from jampetsc.jamming import samples
from jampetsc.jamming.stepwise_shear import StepwiseShear, measure_minimum
from jampetsc.minimisation import ldl, warm_start
from jampetsc.minimisation.descent import Goal
from jampetsc.minimisation.hessian import Bonds, Pattern
from jampetsc.minimisation.minimise import minimise, settle
from jampetsc.minimisation.protocols import random_start
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import measure
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.packing import deformed
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import simple_shear

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]


@pytest.fixture(scope="module")
def spheres():
    radii, law = 1.2 * radii_of("bidisperse", 40), Potential("harmonic", "inverse-square-diameter")
    return settle(random_start(radii, 0.72, 1, law, dimension=3), 1e-6)


def test_the_factor_is_that_of_the_hessian(spheres):
    """Of springs of the pairs, and of the values of a pattern; what is indefinite is found."""
    rng, n = np.random.default_rng(1), spheres.n
    pairs, o = NeighbourList.build(spheres, 0.3), 0.01 * rng.normal(size=(n, 3))
    bonds = Bonds.of(pairs, spheres.potential, o, simple_shear(0.02))
    pattern = Pattern(pairs, n, 3)
    values = pattern.fill(bonds, np.ones(n, bool), 0.3)
    dense = np.zeros((3 * n, 3 * n))
    for row in range(3 * n):
        part = slice(pattern.indptr[row], pattern.indptr[row + 1])
        dense[row, pattern.indices[part]] = dense[pattern.indices[part], row] = values[part]
    order = rng.permutation(n).astype(np.uint32)
    law, b, work = spheres.potential.constants, rng.normal(size=(n, 3)), np.empty((n, 3))
    definite, factor = ldl.factorise(order, *ldl.space_blocks_of(pattern.indptr, pattern.indices, values))
    assert definite and np.linalg.eigvalsh(dense)[0] > 0
    followed = warm_start.factor_of(order, pairs, o, 0.02, law, 0.0, 0.3, 0.0)
    for one in (factor, followed):
        x = np.empty((n, 3))
        ldl.solve(one, b, x, work)
        np.testing.assert_allclose(dense @ x.ravel(), b.ravel(), rtol=0, atol=1e-11)
    below = np.linalg.eigvalsh(dense)[0] + 1e-6
    values[pattern.diagonal] -= below
    definite, factor = ldl.factorise(order, *ldl.space_blocks_of(pattern.indptr, pattern.indices, values))
    assert not definite and not any(map(len, (factor[0], factor[2], factor[3])))


def test_minima_along_shear_are_those_of_quenches(session, spheres):
    """As L-BFGS and a proof find from the same affine step; `restore` repeats them to the last bit."""
    from jampetsc.petsc.hessian_solver import HessianSolver

    solver, step = HessianSolver(), 5e-4
    slow, same, energies = StepwiseShear(spheres, step, solver, 1e-9), 0, []
    for _ in range(8):
        affine = deformed(slow.disks, np.zeros((40, 3)), simple_shear(step))
        slow.advance()
        quenched = measure_minimum(minimise(affine, Goal(), solver, tolerance=1e-9).disks)
        here, state = measure_minimum(slow.disks), measure(slow.disks)
        same += slow.minimum.energy == pytest.approx(quenched.energy, rel=1e-9)
        assert slow.minimum.pressure == pytest.approx(here.pressure, rel=1e-9)
        assert slow.minimum.shear_stress == pytest.approx(here.shear_stress, rel=1e-8)
        assert state.max_force < 1e-9 * state.pressure * slow.diameter**2
        energies.append(slow.minimum.energy)
    assert same >= 7
    again = StepwiseShear(spheres, step, solver, 1e-9)
    again.restore(slow.state())
    assert again.minimum == slow.minimum and again.disks.fingerprint == slow.disks.fingerprint


def test_commands_take_spheres(session):
    """A modulus from the first steps; samples that jam, cooled ones too; `flow` refuses in a line."""
    packing = jp.pack(n=32, dimension=3, phi=0.7, seed=1, stabilise="shear")
    result = jp.shear(packing, step=1e-6, strain=2e-6, tolerance=1e-12)
    wanted = packing.record["shear_modulus"] * result["strain"]
    np.testing.assert_allclose(result["shear_stress"], wanted, rtol=1e-3)
    samples = jp.jam(n=24, dimension=3, phi=[0.55, 0.72], seeds=[1, 2])
    assert samples["jammed"].tolist() == [0, 0, 1, 1] and samples["contact_number"][-1] > 5
    cooled = jp.jam(n=24, dimension=3, phi=0.66, seeds=[1], protocol="compress", sweeps=5, cooling_rate=0.5)
    assert 0.55 < cooled["phi_J"][0] < 0.72


RUNS = {
    "shear": {"n": 24, "phi": 0.7, "step": 1e-3, "strain": 6e-3, "sizes": "bidisperse"},
    "flow": {"n": 16, "phi": 0.66, "model": models.CD0(), "rate": 1e-2, "strain": 0.1},
    "jam": {"n": 16, "phi": [0.6, 0.7], "seeds": [1, 2]},
}


@pytest.mark.parametrize("command", RUNS)
def test_killed_runs_of_spheres_continue_to_the_last_bit(session, tmp_path, monkeypatch, command):
    """From what they have saved, in a file of their own."""
    monkeypatch.setitem(samples.BATCH_SIZE, "random", 2)
    make = getattr(jp, command)
    whole = make(dimension=3, **RUNS[command], out=tmp_path / "whole.h5")
    with monkeypatch.context() as context:
        stop_after(context, 1)
        with pytest.raises(KeyboardInterrupt):
            make(dimension=3, **RUNS[command], out=tmp_path / "out.h5")
    assert (tmp_path / "out.h5.resume").exists() and not (tmp_path / "out.h5").exists()
    parts = make(dimension=3, **RUNS[command], out=tmp_path / "out.h5")
    assert {"shear_stress", "energy"} & set(whole)
    for name in whole:
        assert np.array_equal(parts[name], whole[name]), name


def test_a_packing_of_spheres_that_is_lost_comes_out_as_it_was(session, tmp_path):
    """One that starts from another at a higher pressure, to the last bit."""
    first, lower = tmp_path / "high.h5", tmp_path / "low.h5"
    jp.pack(n=16, dimension=3, pressure=1e-2, seed=2, out=first)
    before = jp.pack(from_=first, pressure=1e-3, out=lower).fingerprint
    lower.unlink()
    assert jp.pack(from_=first, pressure=1e-3, out=lower).fingerprint == before
