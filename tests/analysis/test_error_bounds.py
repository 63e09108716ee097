"""Bounds in relation to their values, and parts of G* that are zero to rounding."""

import numpy as np

from jampetsc.analysis.error_bounds import relative_bound, relative_part_bounds, zero_parts


def test_a_bound_of_what_vanishes():
    bound, value = np.array([0.0, 1e-3, 2.0, 0.0]), np.array([0.0, 0.0, -4.0, 3.0])
    np.testing.assert_array_equal(relative_bound(bound, value), [0.0, np.inf, 0.5, 0.0])
    assert relative_bound(1.0, 3 + 4j) == 0.2
    np.testing.assert_array_equal(relative_bound(1.0, np.array([2.0, 0.0])), [0.5, np.inf])


def test_a_part_below_its_bound_is_zero_where_the_bound_is_rounding_of_the_other():
    """And no relative bound is stated for it; a part that is only poorly known is not zero."""
    G = np.array([1.0 + 1e-20j, 1e-20 + 1.0j, 1.0 + 1e-20j, 1.0 + 1e-3j, 0.0])
    bounds = np.array([[1e-9, 1e-18], [1e-18, 1e-9], [1e-9, 1e-11], [1e-9, 1e-6], [1e-15, 1e-15]])
    found = zero_parts(G, bounds)
    np.testing.assert_array_equal(found, [[0, 1], [1, 0], [0, 0], [0, 0], [0, 0]])
    relative = relative_part_bounds(G, bounds)
    np.testing.assert_allclose(relative[:4], [[1e-9, 0.0], [0.0, 1e-9], [1e-9, 1e9], [1e-9, 1e-3]])
    assert np.isinf(relative[4]).all()
