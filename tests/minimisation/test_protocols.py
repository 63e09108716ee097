"""Quenched packings: converged, minima, with the right statistics, the same every time."""

import numpy as np
import pytest
from dense import Reference
from samples import physics

from jampetsc.minimisation import protocols
from jampetsc.minimisation.descent import Goal
from jampetsc.minimisation.isotropic import stretched
from jampetsc.minimisation.minimise import minimise
from jampetsc.minimisation.protocols import Target
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import measure
from jampetsc.packing.packing import deformed
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import simple_shear
from jampetsc.petsc.hessian_solver import NewtonSolver

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]  # a packing is one rank's own


def pack(n, target, seed=1, potential=None, sizes="bidisperse"):
    phi = target.phi or protocols.start_phi(target.pressure)
    start = protocols.random_start(radii_of(sizes, n), phi, seed, potential or Potential())
    return protocols.make_packing(start, target, NewtonSolver())


CASES = [
    (16, 1e-1, "harmonic", "constant", "bidisperse"),
    (16, 1e-4, "hertzian", "constant", "bidisperse"),
    (16, 1e-7, "harmonic", "constant", "bidisperse"),
    (17, 1e-3, "harmonic", "inverse-square-diameter", "bidisperse"),
    (64, 1e-2, "hertzian", "inverse-square-diameter", "bidisperse"),
    (64, 1e-3, "harmonic", "constant", "monodisperse"),
    (64, 1e-6, "harmonic", "inverse-square-diameter", "bidisperse"),
    (100, 1e-7, "hertzian", "constant", "bidisperse"),
]


@pytest.mark.parametrize(("n", "pressure", "kind", "stiffness", "sizes"), CASES)
def test_converged_minimum(n, pressure, kind, stiffness, sizes):
    disks = pack(n, Target(pressure), potential=Potential(kind, stiffness), sizes=sizes)
    state = measure(disks)
    assert state.max_force <= max(1e-10 * pressure, 2e-15)
    assert abs(state.pressure - pressure) <= max(1e-10 * pressure, 4e-16 / np.sqrt(n))
    exact = Reference(disks, physics(rotations=False))
    modes = np.linalg.eigvalsh(exact.K[:-1, :-1].astype(float))
    assert modes[2] > 0 and abs(modes[:2]).max() < 1e-12
    assert disks.record["negative_modes"] == 0
    assert disks.record["shear_modulus"] == pytest.approx(exact.modulus(0.0).real, rel=1e-3, abs=1e-6)
    assert 3.5 < state.coordination < 6.1


@pytest.mark.parametrize(("n", "pressure", "seed"), [(16, 1e-2, 1), (64, 1e-4, 2), (256, 1e-3, 3)])
def test_shear_stabilised(n, pressure, seed):
    disks = pack(n, Target(pressure, stabilise="shear"), seed)
    state = measure(disks)
    assert abs(state.stress[0, 1]) <= 1e-10 * pressure
    assert abs(state.pressure - pressure) <= 1e-10 * pressure
    assert disks.cell[1, 0] != 0
    assert disks.record["shear_modulus"] > 0


@pytest.mark.parametrize(("n", "pressure", "seed"), [(16, 1e-2, 2), (64, 1e-4, 2)])
def test_stable_to_all_strains(n, pressure, seed):
    """Isotropic stress, and the enthalpy grows with any stretch of the sides."""
    disks = pack(n, Target(pressure, stabilise="all"), seed)
    state = measure(disks)
    np.testing.assert_allclose(state.stress, -pressure * np.eye(2), rtol=0, atol=3e-10 * pressure)
    assert (
        disks.record["protocol"].endswith(", then isotropic stress") and disks.record["shear_modulus"] > 0.0
    )
    enthalpies = []
    for stretch in (-0.01 * pressure, 0.0, 0.01 * pressure):
        goal = Goal(pressure, shear=True)
        found = minimise(stretched(disks, (stretch,)), goal, NewtonSolver(), tolerance=1e-12).disks
        enthalpies.append(measure(found).energy + pressure * found.volume)
    assert enthalpies[1] < min(enthalpies[0], enthalpies[2])
    only_shear = measure(pack(n, Target(pressure, stabilise="shear"), seed)).stress
    assert abs(only_shear[0, 0] - only_shear[1, 1]) > 1e-6 * pressure


def sheared(disks, strain):
    """The disks, moved with their cell by a small shear strain."""
    return deformed(disks, np.zeros((disks.n, 2)), simple_shear(strain))


@pytest.mark.parametrize(("law", "n", "phi", "seed"), [
    (Potential(), 16, 0.9, 3),  # in a cell of fixed shape this one has G₀ < 0
    (Potential("hertzian", "inverse-square-diameter", 1.7), 24, 0.95, 1),
])  # fmt: skip
def test_shear_stabilised_at_a_packing_fraction(law, n, phi, seed):
    """U is least in γ, too: dU/dγ = 0 and d²U/dγ² = V G₀ > 0 by finite differences, disks at rest at each γ."""
    fixed, disks = (pack(n, Target(phi=phi, stabilise=how), seed, law) for how in ("volume", "shear"))
    state, step = measure(disks), 1e-5
    assert disks.phi == pytest.approx(phi, rel=1e-14) and disks.cell[1, 0] != 0
    assert abs(state.stress[0, 1]) <= 1e-10 * state.pressure < 1e-3 * abs(measure(fixed).stress[0, 1])
    assert state.max_force <= 1e-10 * state.pressure
    energies = []
    for strain in (-step, 0.0, step):
        found = minimise(sheared(disks, strain), Goal(), NewtonSolver(), tolerance=1e-12)
        energies.append(measure(found.disks).energy)
        stress = float(measure(found.disks).stress[0, 1])
        assert stress == pytest.approx(
            disks.record["shear_modulus"] * strain, rel=1e-3, abs=1e-9 * state.pressure
        )
    low, least, high = energies
    curvature = (high - 2.0 * least + low) / step**2
    assert abs(high - low) / (2.0 * step) < 1e-4 * disks.volume * state.pressure
    assert (
        curvature == pytest.approx(disks.volume * disks.record["shear_modulus"], rel=0.02) and curvature > 0
    )
    assert disks.record["negative_modes"] == 0 and disks.record["protocol"].endswith(
        ", then shear_stress = 0"
    )


def test_ensemble_statistics():
    """N = 256: bands around independent values for N = 1024 (φ, Δz/√p, rattlers), but wider."""
    for pressure, phi, excess, rattlers in ((1e-2, 0.8645, 5.3, 0.010), (1e-3, 0.8437, 4.99, 0.033)):
        states, phis = [], []
        for seed in range(1, 11):
            disks = pack(256, Target(pressure), seed)
            states.append(measure(disks))
            phis.append(disks.phi)
        z = np.mean([state.coordination for state in states])
        assert abs(np.mean(phis) - phi) < 4e-3
        assert abs((z - 4 + 4 / 256) / np.sqrt(pressure) - excess) < 0.6
        assert abs(np.mean([state.rattlers.mean() for state in states]) - rattlers) < 0.015


@pytest.mark.parametrize(
    ("now", "wanted", "first", "decades"),
    [
        (1e-3, 1e-5, True, [1e-3, 1e-4]),
        (1e-3, 1e-6, True, [1e-3, 1e-4, 1e-5]),  # 1e-3/1e-6 is a little more than 1000
        (1e-3, 3e-5, True, [1e-3, 1e-4]),
        (1e-3, 1e-3, True, []),
        (1e-2, 1e-4, False, [1e-3]),
        (1e-2, 3e-4, False, [1e-3]),
        (1e-2, 3e-3, False, []),
        (1e-4, 1e-2, False, []),
        (1e-4, 1e-2, True, []),
    ],
)
def test_pressures_on_the_way_are_a_decade_apart(now, wanted, first, decades):
    assert protocols.pressures_between(now, wanted, first) == pytest.approx(decades)


def test_how_a_packing_was_made_is_in_its_record():
    """In the units of its stiffness: from 1e-3 k down, or from where it is; what ended it is told."""
    stiff = Potential(k=4.0)
    disks = pack(16, Target(4e-5), potential=stiff)
    start = protocols.start_phi(4e-5)
    wanted = f"random, phi = {start:.6g}, then p = 0.004, then p = 0.0004, then p = 4e-05"
    assert disks.record["protocol"] == wanted
    assert disks.record["limited_by"] == "tolerance" and disks.record["tolerance"] == 1e-10
    assert disks.record["stabilise"] == "volume" and disks.record["newton_steps"] > 0
    assert disks.record["evaluations"] > 50
    lower = protocols.make_packing(disks, Target(4e-8, tolerance=1e-12), NewtonSolver(), fresh=False)
    assert lower.record["protocol"] == "p = 4e-05, then p = 4e-06, then p = 4e-07, then p = 4e-08"
    assert lower.record["limited_by"] == "rounding" and lower.record["tolerance"] == 1e-12
    assert lower.record["rattlers"] == np.count_nonzero(measure(lower).rattlers)
    dense = pack(16, Target(phi=0.9), potential=stiff)
    state = measure(dense)
    assert dense.record["protocol"] == "random, phi = 0.9" and dense.phi == pytest.approx(0.9, rel=1e-14)
    assert dense.record["shear_stress"] == state.stress[0, 1] and state.max_force <= 1e-10 * state.pressure
    for name in ("pressure", "energy", "max_force", "coordination"):
        assert dense.record[name] == getattr(state, name)
