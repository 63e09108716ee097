"""D²min is what a fit of a local strain leaves, and how many particles move is counted by the participation."""

import numpy as np
import pytest

from jampetsc.analysis.rearrangement import least_square_deviation, participation


@pytest.mark.parametrize("dimension", [2, 3])
def test_least_square_deviation_is_the_rest_of_a_fit(dimension):
    rng = np.random.default_rng(dimension)
    n = 12
    places, moved = rng.normal(size=(n, dimension)), rng.normal(size=(n, dimension))
    i, j = np.triu_indices(n, 1)
    close = np.linalg.norm(places[j] - places[i], axis=1) < 3.5
    i, j = i[close], j[close]
    values = least_square_deviation(i, j, places[j] - places[i], moved)
    for k in range(n):
        near = np.r_[j[i == k], i[j == k]]
        r, u = places[near] - places[k], moved[near] - moved[k]
        rest = u - r @ np.linalg.lstsq(r, u, rcond=None)[0]
        assert values[k] == pytest.approx(np.sum(rest**2) / len(near))
    strain = rng.normal(size=(dimension, dimension))
    affine = least_square_deviation(i, j, places[j] - places[i], places @ strain)
    assert np.nanmax(affine) < 1e-12
    alone = least_square_deviation(i[:0], j[:0], places[:0], moved)
    assert np.isnan(alone).all()


def test_participation_counts_particles_that_move_alike():
    moved = np.zeros((10, 2))
    moved[:4] = [0.3, 0.4]
    assert participation(moved) == pytest.approx(4.0)
