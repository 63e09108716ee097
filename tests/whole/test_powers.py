"""Potentials of any exponent, from the packing to its responses: each number by two ways."""

from functools import cache

import numpy as np
import pytest

import jampetsc
from jampetsc import main as cli
from jampetsc.packing.potentials import Potential

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]

K = 2.5
EXPONENTS = (2.25, 4.0)


@cache
def in_a_plane(exponent):
    """A packing at rest; forces are ∝ k."""
    words = {"potential": "power", "exponent": exponent, "stiffness": "inverse-square-diameter"}
    disks = jampetsc.pack(n=24, pressure=1e-2, stabilise="shear", seed=2, **words)
    assert disks.pressure == pytest.approx(1e-2, rel=1e-9)
    assert disks.potential == Potential(exponent=exponent, stiffness="inverse-square-diameter")
    stiff = disks.replace(potential=Potential(None, "inverse-square-diameter", K, exponent))
    assert stiff.pressure == pytest.approx(K * 1e-2, rel=1e-9)
    return stiff


@cache
def in_space(exponent):
    """Spheres on an fcc lattice, at rest under any potential: one quench in space less to compile."""
    basis = np.array([[0, 0, 0], [0, 1, 1], [1, 0, 1], [1, 1, 0]]) / 2
    cells = np.stack(np.meshgrid(*[np.arange(2)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    edge = 0.95 * 2**0.5
    places = edge * (cells + basis).reshape(-1, 3)
    return jampetsc.Packing(
        places, np.full(32, 0.5), 2 * edge * np.eye(3), "power", "constant", K, exponent=exponent
    )


@pytest.fixture(params=[in_a_plane, in_space], ids=lambda make: make.__name__)
def packing(request, session):
    return request.param(2.25)


@pytest.mark.parametrize("exponent", EXPONENTS)
@pytest.mark.parametrize("make", [in_a_plane, in_space])
def test_the_pressure_is_minus_the_slope_of_the_energy(session, make, exponent):
    """p = −∂U/∂V of the affine motion, by differences."""
    packing, h = make(exponent), 1e-5
    low, high = (energy(packing, (1 + change) * np.eye(packing.dimension)) for change in (-h, h))
    slope = (high - low) / (2 * h)
    assert packing.pressure == pytest.approx(-slope / (packing.dimension * packing.volume), rel=1e-5)


def energy(packing, motion):
    """That of the packing after an affine motion (D, D) of rows."""
    words = packing.potential.stiffness, K
    moved = jampetsc.Packing(
        packing.positions @ motion,
        packing.radii,
        packing.cell @ motion,
        "power",
        *words,
        exponent=packing.potential.exponent,
    )
    return moved.record["energy"]


def test_the_static_modulus_is_the_slope_of_the_stress(packing):
    """G₀ of the linear response, of the sweep at ω → 0, and of steps of shear, or of energies of the lattice."""
    static = jampetsc.quasistatic(packing).attributes["G0"]
    swept = jampetsc.sweep(packing, omega=[1e-8])
    assert swept.G.real[0] == pytest.approx(static, rel=1e-6)
    if packing.dimension == 3:
        h = 1e-4
        shears = [np.eye(3) + gamma * np.eye(3, k=-1) * [1, 0, 0] for gamma in (-h, 0, h)]
        low, middle, high = (energy(packing, motion) for motion in shears)
        assert (low - 2 * middle + high) / h**2 / packing.volume == pytest.approx(static, rel=1e-4)
        return
    step = 1e-7
    sheared = jampetsc.shear(packing, strain=2 * step, step=step, tolerance=1e-12, discard=0.0)
    stress = sheared["shear_stress"]
    assert (stress[1] - stress[0]) / step == pytest.approx(static, rel=1e-3)


def test_small_oscillations_with_moving_contacts_are_linear(packing):
    law = jampetsc.ContactDamping(beta=1.0, tau1=2.0)
    swept = jampetsc.sweep(packing, law, omega=[0.5])
    few = {"steps": 16, "cycles": 3}
    moving = jampetsc.oscillate(packing, law, omega=[0.5], strain=[1e-7], contacts="moving", **few)
    assert abs(moving["G"].ravel()[0] / swept.G[0] - 1.0) < 5e-3


def test_a_flow_dissipates_the_work_on_it(session):
    """In a plane: flows in space have all exponents in the tests of their forces."""
    packing, rate = in_a_plane(2.25), 1e-2
    flow = jampetsc.flow(packing, model="CD0", rate=rate, strain=0.1, discard=0.02)
    strain, energy, spent = (flow[name] for name in ("strain", "energy", "dissipation"))
    left = flow["shear_stress"].sum(axis=1) * rate * packing.volume - spent
    times = np.diff(strain)[1:] / rate
    # energies are means over a row: from the middle of the second row to that of the last
    stored = np.sum(times * 0.5 * (left[1:-1] + left[2:]))
    assert abs(stored - (energy[-1] - energy[1])) < 0.02 * np.sum(times * spent[2:])


def test_a_file_of_a_flow_keeps_the_exponent(session, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = "flow --model CD0 --rate 1e-2 --strain 0.1 --n 24 --phi 0.9 --potential power --exponent 3.25"
    assert cli.main([*words.split(), "--snapshots", "2", "--last", "last.h5", "--out", "f.h5"]) == 0
    result = jampetsc.load("f.h5")
    expected = Potential(exponent=3.25, stiffness="inverse-square-diameter")
    for disks in (result.last, result.snapshot(), result.listed, jampetsc.load("last.h5")):
        assert disks.potential == expected
