"""Medians and logarithmic histograms of magnitudes."""

import numpy as np
import pytest

from jampetsc.analysis.statistics import Distribution


@pytest.mark.parametrize("unit", [1.0, 1e-30, 3e17])
def test_a_histogram_reaches_ten_decades_below_that_of_the_largest_value(unit):
    """What is smaller than all its edges is in the first bin, nothing is lost."""
    values = unit * 2.0 * 10.0 ** -np.arange(0.0, 13.0)
    found = Distribution.of(values)
    top = found.edges[-1]
    assert top > values[0] >= top / 10 * (1 - 1e-12)
    assert found.edges[0] == 0.0 and found.edges[1] == pytest.approx(1e-10 * top)
    assert (
        len(found.edges) == len(found.counts) + 1 == 102
    )  # as docs/reference/files.md has it: ten to a decade
    np.testing.assert_allclose(found.edges[2:] / found.edges[1:-1], 10**0.1)
    beyond = int(np.count_nonzero(values < 1e-10 * top))
    assert found.counts[0] == beyond == 3 and found.counts.sum() == 13 and found.counts.max() == 3


def test_a_value_on_an_edge_is_in_the_bin_above():
    """As numpy's histogram has it, but for the last edge, on which no value lies."""
    edges = Distribution.of(np.ones(1)).edges
    values = edges[edges <= 1.0]
    found = Distribution.of(values)
    np.testing.assert_array_equal(found.edges, edges)
    np.testing.assert_array_equal(found.counts, edges[:-1] <= 1.0)
    for power in range(-40, 41):  # of ten: none is lost to rounding
        for value in np.nextafter(10.0**power, (0.0, 10.0**power, np.inf)):
            one = Distribution.of(np.array([value]))
            (here,) = np.flatnonzero(one.counts)
            assert one.edges[here] <= value < one.edges[here + 1] and one.counts[here] == 1


@pytest.mark.parametrize(
    "vectors", [[[3, 4], [-5, 12], [0, -1]], [[2, -2, 1], [3, 4, 12], [0, 0, -1]]], ids=["2D", "3D"]
)
def test_vectors_are_told_by_their_length(vectors):
    found = Distribution.of(np.array(vectors, float))
    lengths = np.linalg.norm(vectors, axis=1)
    assert found.median == np.median(lengths) and found.mean == pytest.approx(lengths.mean())
    assert found.rms == pytest.approx(np.sqrt(np.mean(lengths**2)))


def test_vectors_that_vanish_are_in_the_first_bin():
    still = Distribution.of(np.zeros((4, 2)))
    assert still.counts[0] == 4 == still.counts.sum() and still.rms == 0.0 and np.isfinite(still.edges).all()
