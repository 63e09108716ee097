"""Lists and grids of numbers on a command line."""

import numpy as np
import pytest

from jampetsc.options.values import FREQUENCIES, format_numbers


def test_lists_of_numbers_are_increasing_and_grids_logarithmic_unless_told_otherwise():
    for text, expected in (
        ("1e-2:1e2:5", [0.01, 0.1, 1, 10, 100]),
        ("lin:1:2:3", [1, 1.5, 2]),
        ("2,1,2", [1, 2]),
    ):
        np.testing.assert_allclose(FREQUENCIES.read(text), expected)


@pytest.mark.parametrize("kind", ["", "lin:"])
@pytest.mark.parametrize("low", [1e-9, 1.0, 3.7])
@pytest.mark.parametrize("ulps", [1, 2, 3, 5, 50])
def test_a_grid_finer_than_rounding_has_no_number_twice(kind, low, ulps):
    """Nor any beyond its ends, and both of these; what is written for it gives it again."""
    high = float(low + ulps * np.spacing(low))
    grid = FREQUENCIES.read(f"{kind}{low!r}:{high!r}:7")
    assert (np.diff(grid) > 0).all() and (grid[0], grid[-1]) == (low, high) and len(grid) <= min(7, ulps + 1)
    np.testing.assert_array_equal(FREQUENCIES.read(format_numbers(grid)), grid)
