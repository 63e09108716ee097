"""Monte Carlo: states come with the Boltzmann weight, energies are those of the pair list's disks, lists stay valid."""

import numpy as np
import pytest

from jampetsc.minimisation.protocols import random_start
from jampetsc.minimisation.sizes import radii_of
from jampetsc.minimisation.thermal import ACCEPTED, COLD, Around, Thermal, annealed, energy_of
from jampetsc.packing.contacts import measure
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential

POTENTIALS = [Potential("harmonic", "inverse-square-diameter", 2.0), Potential("hertzian", "constant", 1.5)]
POTENTIALS += [Potential(exponent=3.5, k=1.5)]
CELL = np.array([[1.6, 0.0], [0.3, 1.5]])
RADII = np.array([0.5, 0.6])


def energy_at(relative, potential):
    """U of two disks by their distance vectors (…, 2), all images, written independently."""
    total, sigma = 0.0, RADII.sum()
    unit = sigma if potential.stiffness == "inverse-square-diameter" else 1.0
    for a in range(-2, 3):
        for b in range(-2, 3):
            overlap = np.maximum(sigma - np.linalg.norm(relative + a * CELL[0] + b * CELL[1], axis=-1), 0)
            total = total + potential.k / potential.exponent * (overlap / unit) ** potential.exponent
    return total


@pytest.mark.parametrize("potential", POTENTIALS)
def test_two_disks_are_distributed_as_boltzmann_says(potential):
    temperature = 0.03
    fractions = (np.arange(120) + 0.5) / 120
    where = np.stack(np.meshgrid(fractions, fractions, indexing="ij"), axis=-1) @ CELL
    energies = energy_at(where, potential)
    weights = np.exp(-energies / temperature)
    mean, square = (np.sum(weights * energies**power) / weights.sum() for power in (1, 2))
    far = np.sum(weights[energies < temperature]) / weights.sum()
    disks = Packing.from_positions(np.array([[0.0, 0.0], [0.8, 0.9]]), RADII, CELL, potential)
    thermal = Thermal(disks, np.random.default_rng(3))
    found = []
    for _ in range(12_000):
        thermal.sweep(temperature)
        found.append(thermal.reference.positions + thermal.offsets)
    places = np.array(found)[2000:]
    blocks = energy_at(places[:, 1] - places[:, 0], potential).reshape(25, -1)
    for value, expected in ((blocks, mean), (blocks**2, square), (blocks < temperature, far)):
        means = value.mean(axis=1)
        error = means.std(ddof=1) / np.sqrt(len(means))
        assert error < 0.08 * expected and abs(means.mean() - expected) < 4 * error


def test_energy_of_a_disk_and_of_all():
    potential = POTENTIALS[0]
    disks = random_start(radii_of("bidisperse", 40), 0.9, 1, potential)
    around, still = Around.of(NeighbourList.build(disks, 0.3), 40), np.zeros((40, 2))
    alone = [energy_of(a, (0.0, 0.0), around, still, potential.constants) for a in range(40)]
    assert np.sum(alone) / 2 == pytest.approx(measure(disks).energy)
    moved = still.copy()
    moved[7] = 0.05, -0.03
    change = energy_of(7, tuple(moved[7]), around, still, potential.constants) - alone[7]
    other = Packing.from_positions(disks.positions + moved, disks.radii, disks.cell, potential)
    assert change == pytest.approx(measure(other).energy - measure(disks).energy)


def test_no_contact_is_missed_however_far_disks_go():
    """At no temperature energy only falls: one missed contact would let it rise."""
    potential = POTENTIALS[0]
    disks = random_start(radii_of("bidisperse", 40), 0.7, 2, potential)
    thermal = Thermal(disks, np.random.default_rng(1))
    energy, before = measure(disks).energy, thermal.disks.positions
    for _ in range(300):
        thermal.sweep(1e-300)
        now = measure(thermal.disks).energy
        assert now <= energy + 1e-12
        energy = now
    moved = thermal.disks.positions - before
    moved -= np.round(moved @ np.linalg.inv(disks.cell)) @ disks.cell
    assert np.abs(moved).max() > 1.0  # beyond the skin: the list was made anew


def test_cooling_leaves_a_deeper_energy_the_slower_it_is():
    potential = Potential("harmonic", "inverse-square-diameter")
    energies = []
    for rate in (1.0, 0.02):
        start = random_start(radii_of("bidisperse", 32), 0.95, 5, potential)
        found = annealed(start, 1e-2, rate, 20, np.random.default_rng(2))
        energies.append(measure(found).energy / 32)
    tuned = Thermal(start, np.random.default_rng(4))
    shares = [tuned.sweep(1e-3, tune=True) for _ in range(300)]
    assert np.mean(shares[200:]) == pytest.approx(ACCEPTED, abs=0.05)
    assert COLD < energies[1] < 0.7 * energies[0]
    assert np.array_equal(found.radii, start.radii) and np.array_equal(found.cell, start.cell)


def test_every_disk_moves():
    """Also the last one, and each about as often."""
    disks = random_start(radii_of("bidisperse", 10), 0.5, 1, POTENTIALS[0])
    thermal = Thermal(disks, np.random.default_rng(1))
    thermal.reach, moved = 1e-3, np.zeros(10)
    for _ in range(200):
        before = thermal.offsets.copy()
        thermal.sweep(1e3)
        moved += (thermal.offsets != before).any(axis=1)
    assert moved.min() > 0.5 * 200 * (1 - np.exp(-1)) and np.abs(thermal.offsets).max() < 0.1
    assert (thermal.offsets.min(axis=0) < 0).all() and (thermal.offsets.max(axis=0) > 0).all()


def test_the_reach_is_tuned_up_to_what_a_list_allows():
    disks = random_start(radii_of("bidisperse", 16), 0.5, 1, POTENTIALS[0])
    thermal = Thermal(disks, np.random.default_rng(1))
    longest = thermal.reach
    assert longest == pytest.approx(0.125)  # a quarter of the skin, half a mean diameter
    assert thermal.sweep(1e9, tune=True) == 1.0 and thermal.reach == longest
    thermal.reach = 0.1 * longest
    share = thermal.sweep(1e9, tune=True)
    assert thermal.reach == pytest.approx(0.1 * longest * np.exp(share - 0.4))
    kept = thermal.reach
    thermal.sweep(1e9)
    assert thermal.reach == kept


def test_cooling_goes_down_to_the_cold(monkeypatch):
    """ln T falls by the rate before every sweep, after the sweeps at the first temperature; the last is at COLD k."""
    asked = []
    monkeypatch.setattr(Thermal, "sweep", lambda _, at, tune=False: asked.append((at, tune)))
    potential = Potential("harmonic", "inverse-square-diameter", 3.0)
    annealed(random_start(radii_of("bidisperse", 16), 0.5, 1, potential), 0.3, 2.0, 4, None)
    temperatures = [temperature for temperature, _ in asked]
    assert temperatures[:4] == [0.3] * 4 and all(tune for _, tune in asked)
    np.testing.assert_allclose(temperatures[4:], 0.3 * np.exp(-2.0 * np.arange(1, len(asked) - 3)))
    assert temperatures[-1] <= 3e-8 < temperatures[-2]
