"""Lengths and stiffnesses have no absolute size: the same quench and the same slow shear in any units.

By powers of four, so that rounding is the same, and with it every evaluation and every decision on the way.
"""

import numpy as np
import pytest
from dense import NewtonSteps

from jampetsc.jamming.stepwise_shear import StepwiseShear
from jampetsc.minimisation import protocols
from jampetsc.minimisation.descent import Effort, Goal
from jampetsc.minimisation.minimise import relax
from jampetsc.minimisation.protocols import Target, make_packing, random_start
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import measure
from jampetsc.packing.potentials import STIFFNESSES, Potential

EXPONENTS = (2.0, 2.5)
UNITS = [(4.0, 1.0), (0.25, 1.0), (1.0, 1024.0), (1.0, 2.0**-10)]  # of length and of stiffness


def energy_unit(length, k, law):
    """By how much an energy is larger: V = (k/α) (δ/scale)^α."""
    return k * (length**law.exponent if law.stiffness == "constant" else 1.0)


def quenched(length, k, exponent, stiffness, target, dimension=2):
    """A packing of 16 disks or spheres, and by how much its energies are larger."""
    law = Potential(None, stiffness, k, exponent)
    energy = energy_unit(length, k, law)
    if target.pressure:
        target = Target(target.pressure * energy / length**dimension, stabilise=target.stabilise)
    dense = {2: 0.9, 3: 0.7}[dimension]
    start = random_start(
        length * radii_of("bidisperse", 16), target.phi or dense, 3, law, dimension=dimension
    )
    return make_packing(start, target, NewtonSteps()), energy


@pytest.mark.parametrize(
    "target",
    [Target(1e-4), Target(3e-3, stabilise="shear"), Target(phi=0.9), Target(phi=0.9, stabilise="shear")],
    ids=str,
)
@pytest.mark.parametrize(("exponent", "stiffness"), [(a, s) for a in EXPONENTS for s in STIFFNESSES])
def test_a_quench_is_the_same_in_any_units(exponent, stiffness, target):
    """Where the cell moves, in any unit of length the last steps, Newton's, round otherwise."""
    usual, _ = quenched(1.0, 1.0, exponent, stiffness, target)
    assert usual.record["evaluations"] > 30 and usual.record["newton_steps"] >= 1
    for length, k in UNITS[2:] if target.pressure or target.stabilise == "shear" else UNITS:
        found, energy = quenched(length, k, exponent, stiffness, target)
        np.testing.assert_array_equal(found.positions, length * usual.positions)
        for name in ("evaluations", "newton_steps", "limited_by", "rattlers", "phi"):
            assert found.record[name] == usual.record[name], name
        stresses = dict.fromkeys(("pressure", "shear_stress", "shear_modulus"), energy / length**2)
        for name, unit in {"energy": energy, "max_force": energy / length, **stresses}.items():
            assert found.record[name] == pytest.approx(unit * usual.record[name], rel=1e-9), name


@pytest.mark.parametrize("exponent", [2.25, 4.0])
@pytest.mark.parametrize("stiffness", STIFFNESSES)
@pytest.mark.parametrize("target", [Target(1e-1), Target(phi=1.1)], ids=str)
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_quench_of_any_power_is_the_same_in_any_units(exponent, stiffness, target, dimension):
    """But for rounding, as powers round. So dense particles have one minimum nearby."""
    usual, _ = quenched(1.0, 1.0, exponent, stiffness, target, dimension)
    found, energy = quenched(4.0, 1024.0, exponent, stiffness, target, dimension)
    np.testing.assert_allclose(found.positions, 4.0 * usual.positions, rtol=1e-5, atol=1e-5)
    assert found.record["rattlers"] == usual.record["rattlers"]
    stresses = dict.fromkeys(("pressure", "shear_modulus"), energy / 4.0**dimension)
    for name, unit in {"energy": energy, "phi": 1.0, **stresses}.items():
        assert found.record[name] == pytest.approx(unit * usual.record[name], rel=1e-5), name


@pytest.mark.parametrize(
    ("exponent", "stiffness", "target"),
    zip((2.0, 2.5), STIFFNESSES, (Target(1e-1, stabilise="all"), Target(phi=0.72)), strict=True),
)
def test_a_quench_of_spheres_is_the_same_in_any_units(exponent, stiffness, target):
    """Stresses are energies over volumes."""
    usual, _ = quenched(1.0, 1.0, exponent, stiffness, target, 3)
    found, energy = quenched(4.0, 1024.0, exponent, stiffness, target, 3)
    np.testing.assert_allclose(found.cell, 4.0 * usual.cell, rtol=1e-6, atol=1e-6)
    stresses = dict.fromkeys(("pressure", "shear_modulus"), energy / 4.0**3)
    for name, unit in {"energy": energy, "phi": 1.0, **stresses}.items():
        assert found.record[name] == pytest.approx(unit * usual.record[name], rel=1e-6), name


@pytest.mark.parametrize("shear", [False, True])
@pytest.mark.parametrize("exponent", EXPONENTS)
def test_a_descent_at_a_pressure_is_the_same_in_any_units(exponent, shear):
    """Strains of the cell are weighed against moves of disks in units of their diameter."""

    def relaxed(length, k):
        law = Potential(None, STIFFNESSES[0], k, exponent)
        stress = energy_unit(length, k, law) / length**2
        start = random_start(length * radii_of("bidisperse", 16), 0.9, 3, law)
        effort, goal = Effort(), Goal(1e-3 * stress, shear)
        return relax(start, goal, 1e-6 * stress * length, effort=effort), effort.evaluations

    usual, evaluations = relaxed(1.0, 1.0)
    assert evaluations > 50
    for length, k in UNITS:
        found, needed = relaxed(length, k)
        assert needed == evaluations
        np.testing.assert_array_equal(found.positions, length * usual.positions)
        np.testing.assert_array_equal(found.cell, length * usual.cell)


@pytest.mark.parametrize("exponent", (*EXPONENTS, 2.25, 4.0))
def test_slow_shear_is_the_same_in_any_units(exponent):
    def steps(length, k):
        disks, energy = quenched(length, k, exponent, STIFFNESSES[1], Target(phi=0.88))
        slow = StepwiseShear(disks, 2e-3, NewtonSteps(), 1e-7)
        rows = [vars(slow.advance()) | vars(slow.minimum) for _ in range(25)]
        stress = energy / length**2
        units = {"energy": energy, "dissipated": energy, "shear_stress": stress, "pressure": stress}
        return [{name: value / units.get(name, 1.0) for name, value in row.items()} for row in rows]

    usual = steps(1.0, 1.0)
    assert max(row["evaluations"] for row in usual) > 30  # disks rearrange
    for length, k in UNITS:
        for found, wanted in zip(steps(length, k), usual, strict=True):
            assert found == pytest.approx(wanted, rel=1e-9, abs=1e-18)


def test_the_path_of_a_quench(monkeypatch):
    """Forces in units of k d, then of p d; the cell shears all the way where it does in the end."""
    asked = []

    def note(name, keys):
        def noted(disks, *given, **more):
            asked.append((name, *given[:keys]))
            if name == "minimise":
                raise KeyboardInterrupt
            return disks

        monkeypatch.setattr(protocols, name, noted)

    for name, keys in (("settle", 1), ("relax", 2), ("minimise", 1)):
        note(name, keys)
    start = random_start(2.0 * radii_of("bidisperse", 16), 0.9, 1, Potential(k=4.0))
    with pytest.raises(KeyboardInterrupt):
        make_packing(start, Target(4e-5, stabilise="shear"), None)
    names, *forces = zip(*((one[0], one[-1]) for one in asked), strict=True)
    assert names == ("settle", "relax", "relax", "minimise")
    assert forces[0][:3] == pytest.approx((8e-3, 8e-5, 8e-6))
    goals = [one[1] for one in asked[1:]]
    assert [goal.pressure for goal in goals] == pytest.approx([4e-3, 4e-4, 4e-5])
    assert all(goal.shear for goal in goals)


@pytest.mark.parametrize("pressure", [1e-4, 1e-2, 0.1, 0.3])
def test_a_quench_starts_near_its_end(pressure):
    start = random_start(radii_of("bidisperse", 16), protocols.start_phi(pressure), 3, Potential())
    found = make_packing(start, Target(pressure), NewtonSteps())
    assert -0.01 < start.phi - found.phi < 0.05 + 2.5 * pressure
    state = measure(found)
    for name, value in (("energy", state.energy), ("shear_stress", state.stress[0, 1]), ("phi", found.phi)):
        assert found.record[name] == value
    near = np.linalg.norm(np.diff(start.positions, axis=0), axis=1)
    assert np.median(near) < 0.6 * start.cell[0, 0] * 0.52  # random ones are half a cell apart


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_pressure_says_how_much_particles_overlap(dimension):
    """⟨f r⟩ = 2 D p V/(N_b Z) over the bearing contacts of the backbone; with r ≈ d the mean overlap follows."""
    length, k = 4.0, 2.0
    packing, _ = quenched(length, k, 2.0, "constant", Target(1e-4), dimension)
    contacts, d = packing.contacts(), 2 * packing.radii.mean()
    bearing = contacts.force > 1e-6 * packing.pressure * d ** (dimension - 1)
    count = packing.n - packing.record["rattlers"]
    force, overlap = contacts.force[bearing], contacts.overlap[bearing]
    assert 2 * bearing.sum() == pytest.approx(count * packing.coordination)
    mean = 2 * dimension * packing.pressure * packing.volume / (count * packing.coordination)
    assert np.mean(force * np.linalg.norm(contacts.r[bearing], axis=1)) == pytest.approx(mean, rel=1e-9)
    assert overlap.mean() == pytest.approx(mean / (k * d), rel=0.1)
    assert d == pytest.approx(length)
