"""ψ₆ of a triangular lattice, of rows that slid past each other, of random points; and in flow files."""

import numpy as np
import pytest
from picture_contents import held

from jampetsc.analysis.order import bond_order
from jampetsc.errors import InputError
from jampetsc.io.disk_motion import STORED_ORDER, six_fold_order


def lattice(rows, columns, slid=0.0):
    """Places and cell of a triangular lattice of rows along x; every row slid that far beyond the one below."""
    up = np.sqrt(0.75)
    row, column = np.divmod(np.arange(rows * columns), columns)
    x = np.column_stack((column + (0.5 + slid) * row, up * row))
    return x, np.array([[columns, 0.0], [(0.5 + slid) * rows, up * rows]])


@pytest.mark.parametrize(
    ("rows", "columns", "turn", "slid"),
    [(6, 5, 0.0, 0.0), (6, 5, 0.2, 0.0), (6, 6, 0.0, 1.0), (1, 1, 0.0, 0.0), (2, 1, 0.0, 0.0)],
)
def test_a_triangular_lattice_is_perfectly_ordered(rows, columns, turn, slid):
    """Of few disks, neighbours of their own images, too, and after a whole period; but not on the way there."""
    x, cell = lattice(rows, columns, slid)
    matrix = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    shifts = np.random.default_rng(0).integers(-2, 3, x.shape) @ cell  # images do not matter
    psi = bond_order((x + shifts) @ matrix, cell @ matrix)
    np.testing.assert_allclose(psi, np.exp(6j * turn), atol=1e-9)
    half_way = np.abs(bond_order(*lattice(6, 6, 0.3)))
    assert np.ptp(half_way) < 1e-9 and 0.3 < half_way[0] < 0.9


def test_random_points_have_no_common_direction():
    psi = bond_order(np.random.default_rng(2).random((900, 2)) * [40.0, 25.0], np.diag([40.0, 25.0]))
    assert 0.3 < np.abs(psi).mean() < 0.5 and np.abs(psi.mean()) < 3 / np.sqrt(900)


@pytest.mark.parametrize("walls", [0, 7])
def test_order_of_a_flow_is_that_of_the_disks_that_move_in_each_snapshot(walls):
    rng, cell = np.random.default_rng(1), np.array([[6.0, 0.0], [1.0, 5.0]])
    cells, positions = np.array([cell, cell]), rng.random((2, 30, 2)) @ cell
    snapshots = {"snapshots/positions": positions, "snapshots/cell": cells, "snapshots/radii": np.ones(30)}
    flow = held(snapshots, {"walls": walls} if walls else {})
    psi = [bond_order(x, cell)[walls:] for x in positions]
    local, whole = six_fold_order(flow)
    np.testing.assert_allclose(local, np.mean(np.abs(psi), axis=1))
    np.testing.assert_allclose(whole, np.abs(np.mean(psi, axis=1)))
    kept = held(dict(zip(STORED_ORDER, (local, whole), strict=True)), flow.attributes)
    np.testing.assert_array_equal(six_fold_order(kept), (local, whole))
    with pytest.raises(InputError, match=r"a\.h5: no snapshots\. Run the flow with"):
        six_fold_order(held({}, {}))
