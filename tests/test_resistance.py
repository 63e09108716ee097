"""The resistance of contacts, compiled, against dense numpy: graph, matrix, diagonal, and the solve for velocities."""

import numpy as np
import pytest
from sheared import crowd

from jampetsc.contacts.pairs import PairList, deformed
from jampetsc.contacts.state import find_contacts
from jampetsc.flows import resistance


def dense(disks, weights, hold, held=0):
    """A + hold of the disks after the first `held`, (2N, 2N); unit rows for those."""
    contacts, n = find_contacts(disks), disks.n
    matrix = np.zeros((n, 2, n, 2))
    for a, b, normal in zip(contacts.i, contacts.j, contacts.normal, strict=True):
        block = weights[1] * np.eye(2) + (weights[0] - weights[1]) * np.outer(normal, normal)
        for one, other in ((a, b), (b, a)):
            matrix[one, :, one] += block
            matrix[one, :, other] -= block
    matrix = matrix.reshape(2 * n, 2 * n) + hold * np.eye(2 * n)
    matrix[: 2 * held] = 0.0
    matrix[: 2 * held, : 2 * held] = np.eye(2 * held)
    return matrix


@pytest.fixture(params=[0.4, 0.86], ids=["loose", "dense"])
def placed(request):
    """(disks of now, arguments of `contact_graph`): at offsets and a shear since the list was made."""
    disks = crowd(24, phi=request.param)
    pairs, offsets, shear = (
        PairList.build(disks, 0.5),
        np.random.default_rng(1).normal(0, 0.03, (24, 2)),
        0.08,
    )
    return deformed(disks, offsets, 0.0, shear), (pairs.arrays, offsets, shear, 24)


@pytest.mark.parametrize("held", [0, 5])
@pytest.mark.parametrize("weights", [(1.0, 1.0, 0.0), (1.3, 0.4, 0.0), (0.2, 0.9, 0.0)], ids=str)
def test_the_matrix_is_that_of_the_contacts(placed, weights, held):
    disks, place = placed
    graph = resistance.contact_graph(*place, held, weights[0] != weights[1])
    for hold in (0.0, 0.7):
        matrix = dense(disks, weights, hold, held)
        x, y = np.random.default_rng(2).normal(size=(24, 2)), np.full((24, 2), 7.0)
        product = resistance.resist(graph, weights, hold, x, y)
        wanted = (matrix @ x.ravel()).reshape(24, 2)
        wanted[:held] = 0.0
        np.testing.assert_allclose(y, wanted, rtol=0, atol=1e-13)
        assert product == pytest.approx(np.vdot(x, wanted), rel=1e-12)
        diagonal = np.diag(dense(disks, weights, hold)).reshape(24, 2)
        inverse = resistance.inverse_diagonal(graph, weights, hold, 24)
        np.testing.assert_allclose(inverse, 1.0 / np.where(diagonal > 0, diagonal, 1.0), rtol=1e-12)


@pytest.mark.parametrize("tolerance", [0.1, 1e-6])
def test_a_solve_is_as_good_as_its_tolerance_and_no_better_than_it_takes(placed, tolerance):
    """The residual over the right-hand side, not over what was left at the beginning; u is a start like any other."""
    disks, place = placed
    weights, hold = (1.3, 0.4, 0.0), 1e-3
    graph, matrix = resistance.contact_graph(*place, 0, True), dense(disks, weights, hold)
    rng, reached = np.random.default_rng(3), []
    for start in (0.0, 1.0, 1e-2):
        u = rng.normal(size=(24, 2))
        b = matrix @ u.ravel()
        u *= 1.0 + start * rng.normal(size=u.shape)
        u[start == 0.0] = 0.0
        residual = (b - matrix @ u.ravel()).reshape(24, 2)
        iterations = resistance.solve(graph, weights, hold, residual, u, tolerance)
        left = np.linalg.norm(b - matrix @ u.ravel()) / np.linalg.norm(b)
        assert left <= tolerance * (1 + 1e-6)
        np.testing.assert_allclose(residual.ravel(), b - matrix @ u.ravel(), rtol=0, atol=1e-9)
        assert 0 <= iterations <= 4 * 24
        reached.append(left / tolerance)
        again = resistance.solve(
            graph, weights, hold, (b - matrix @ u.ravel()).reshape(24, 2), u, 2 * tolerance
        )
        assert again == 0
    assert max(reached) > 0.1


def test_the_deepest_overlap_is_that_of_the_sheared_disks(placed):
    disks, (pairs, offsets, shear, _) = placed
    contacts = find_contacts(disks)
    deepest = np.max(contacts.overlap / contacts.sigma, initial=0.0)
    assert resistance.deepest_overlap(pairs, offsets, shear) == pytest.approx(deepest, rel=1e-10)
