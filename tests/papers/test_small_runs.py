"""Estimators of the small runs on data whose answer is known: contacts that decay, layers, and exponents in X."""

import numpy as np
import pytest

from papers.claims.power_law import effective, exponent_in, x_of
from papers.tables import layers, lifetimes
from papers.tables.nonlinear import Packing


def test_the_half_life_is_where_half_of_the_contacts_are_left():
    strain = np.geomspace(1e-3, 1.0, 40)
    assert lifetimes.half_life(np.exp(-strain / 0.1), strain) == pytest.approx(0.1 * np.log(2), rel=1e-2)
    assert lifetimes.half_life(np.full(40, 0.9), strain) == np.inf
    assert lifetimes.half_life(np.array([0.2]), np.array([0.08])) == pytest.approx(0.05)


def test_contacts_that_part_and_those_that_stay():
    """Three disks in a row: one contact stays, the other is gone from the third snapshot on."""
    places = np.array([[[0, 5], [0.9, 5], [1.8 + apart, 5]] for apart in (0.0, 0.0, 0.5, 0.5)])
    flow = {
        "snapshots/positions": places,
        "snapshots/cell": np.tile(10.0 * np.eye(2), (4, 1, 1)),
        "snapshots/radii": np.full(3, 0.5),
        "snapshots/strain": np.arange(4.0),
    }
    shares, strain = lifetimes.contact_survival(flow)
    assert strain == pytest.approx([1.0, 2.0])
    assert shares == pytest.approx([(2 + 1 + 1) / 5, (1 + 1) / 4])


def test_a_collision_without_damping_lasts_for_half_a_period():
    heavy = lifetimes.collision_time(1e6, np.array([0.5]))
    assert heavy == pytest.approx(np.pi * np.sqrt(1e6 / 2.0), rel=1e-5)


def test_the_spread_of_layers_is_that_beyond_their_errors():
    rng = np.random.default_rng(1)
    noise = [layers.spread(0.1 * rng.normal(size=10), np.full(10, 0.1)) for _ in range(400)]
    assert abs(np.mean(np.sign(noise) * np.square(noise))) < 1e-3
    bent = 0.3 * np.sin(2 * np.pi * np.arange(10) / 10)
    assert layers.spread(bent, np.zeros(10)) == pytest.approx(0.3 / np.sqrt(2))


@pytest.mark.parametrize("dimension", [2, 3])
def test_layers_have_the_velocity_and_the_volume_of_their_disks(dimension):
    positions = np.array(
        [[1.0, 0.5, 0.3], [3.0, 0.5, 1.2], [1.0, -0.5, 0.9]]
    )  # the last in the uppermost layer
    velocities = np.array([[1.0, 0, 7.0], [3.0, 0, 7.0], [5.0, 0, 7.0]])
    cell = np.diag([4.0, 10.0, 3.0])[:dimension, :dimension]
    velocity, density = layers.layers_of(
        positions[:, :dimension], velocities[:, :dimension], np.full(3, 0.5), cell
    )
    share = {2: np.pi / 4 / 4, 3: np.pi / 6 / 12}[dimension]  # of a particle in a layer of height 1
    assert velocity[[0, 9]] == pytest.approx([2.0, 5.0])
    assert density[[0, 9]] == pytest.approx([2 * share, share])


@pytest.mark.parametrize("power", [1.0, 1.6])
def test_exponents_in_x_are_those_planted(power):
    X = np.geomspace(1e-2, 1.0, 8)
    packings = [
        Packing(
            np.log(np.column_stack((X, X))),
            X,
            np.full((3, 8), 0.01),
            np.tile(c * X**power, (3, 1)),
            X,
            1e-4,
            None,
        )
        for c in (1.0, 2.0, 3.0)
    ]
    found = exponent_in(x_of, packings, effective, "critical")
    assert found.value == pytest.approx(power) and found.statistical < 1e-9
