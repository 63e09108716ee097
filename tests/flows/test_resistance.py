"""The resistance of contacts, compiled, against dense numpy: graph, matrix, diagonal, clusters, and the solve."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from sheared import crowd

from jampetsc.flows import clusters, resistance
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.packing import deformed
from jampetsc.packing.strain import simple_shear

LIKE = (np.zeros(1),) * 2  # a tuple of the types of the loops, for which they are compiled already


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


@pytest.fixture(params=[(0.4, 1, 1.0), (0.86, 1, 1.0), (0.86, 3, 2.5)], ids=["loose", "dense", "domains"])
def placed(request):
    """(disks at present, offsets, shear since the list was made, domains); in the last case one disk is very large."""
    phi, number, giant = request.param
    disks = crowd(24, phi=phi)
    disks = disks.replace(radii=disks.radii * np.where(np.arange(24) == 9, giant, 1.0))
    shear = 0.08
    offsets = np.random.default_rng(1).normal(0, 0.03, (24, 2))
    domains = NeighbourList.build(disks, 0.5, 24 * np.arange(number + 1) // number)
    return deformed(disks, offsets, simple_shear(shear)), offsets, shear, domains


def graph_of(placed, weights, held=0):
    """The contact graph of all domains."""
    disks, offsets, shear, domains = placed
    graph = resistance.Graph.room(domains, disks.n, held, weights[0] != weights[1])
    for d in range(domains.number):
        resistance.find_contacts_of(domains, d, offsets, simple_shear(shear), graph)
    return graph


@pytest.mark.parametrize("held", [0, 5])
@pytest.mark.parametrize("weights", [(1.0, 1.0, 0.0), (1.3, 0.4, 0.0), (0.2, 0.9, 0.0)], ids=str)
def test_the_matrix_is_that_of_the_contacts(placed, weights, held):
    disks, number = placed[0], placed[3].number
    graph, contacts = graph_of(placed, weights, held), find_contacts(disks)
    z = np.bincount(np.concatenate((contacts.i, contacts.j)), minlength=24)
    np.testing.assert_array_equal(graph.number, z)
    assert number == 1 or z[9] > resistance.WIDTH
    for hold in (0.0, 0.7):
        matrix = dense(disks, weights, hold, held)
        x, y = np.random.default_rng(2).normal(size=(24, 2)), np.full((24, 2), 7.0)
        product = sum(resistance.multiply(graph, d, weights, hold, x, y, LIKE) for d in range(number))
        wanted = (matrix @ x.ravel()).reshape(24, 2)
        wanted[:held] = 0.0
        np.testing.assert_allclose(y, wanted, rtol=0, atol=1e-13)
        assert product == pytest.approx(np.vdot(x, wanted), rel=1e-12)
        diagonal, inverse = np.diag(dense(disks, weights, hold)).reshape(24, 2), np.empty((24, 2))
        for d in range(number):
            resistance.invert_diagonal(graph, d, weights, hold, inverse, LIKE)
        np.testing.assert_allclose(inverse, 1.0 / np.where(diagonal > 0, diagonal, 1.0), rtol=1e-12)


def clusters_of(contacts):
    """(how many, (24,) cluster of each disk)."""
    links = coo_array((np.ones(len(contacts)), (contacts.i, contacts.j)), shape=(24, 24))
    return connected_components(links, directed=False)


@pytest.mark.parametrize("held", [0, 5])
def test_the_mean_velocity_of_every_cluster_is_subtracted(placed, held):
    disks, domains = placed[0], placed[3]
    graph = graph_of(placed, (1.0, 1.0), held)
    number, of = clusters_of(find_contacts(disks))
    u = np.random.default_rng(5).normal(size=(24, 2))
    wanted = u.copy()
    for cluster in range(number):
        if not (of[:held] == cluster).any():
            wanted[of == cluster] -= u[of == cluster].mean(axis=0)
    for d in range(domains.number):
        clusters.find_clusters_of(graph, d, u, LIKE)
    assert clusters.unite_clusters(domains, graph) == (number, np.bincount(of).max())
    for d in range(domains.number):
        clusters.centre_clusters_of(graph, d, u, LIKE)
    np.testing.assert_allclose(u, wanted, atol=1e-14)


@pytest.mark.parametrize("tolerance", [0.1, 1e-6])
def test_a_solve_meets_its_tolerance_and_is_not_far_more_exact(placed, tolerance):
    """The tolerance is relative to the right-hand side, not to the first residual, whatever the initial u."""
    disks, number = placed[0], placed[3].number
    weights, hold = (1.3, 0.4, 0.0), 1e-3
    graph, matrix = graph_of(placed, weights), dense(disks, weights, hold)
    search = resistance.Search(*np.empty((3, 24, 2)), np.empty((2, number, 3)), np.zeros(number))

    def solve(residual, u, tolerance):
        alone = 0, 1, np.zeros(1, np.int64)
        return resistance.solve(*alone, graph, weights, hold, residual, u, tolerance, search, LIKE)

    rng, reached = np.random.default_rng(3), []
    for start in (0.0, 1.0, 1e-2):
        u = rng.normal(size=(24, 2))
        b = matrix @ u.ravel()
        u *= 1.0 + start * rng.normal(size=u.shape)
        u[start == 0.0] = 0.0
        residual = (b - matrix @ u.ravel()).reshape(24, 2)
        iterations = solve(residual, u, tolerance)
        left = np.linalg.norm(b - matrix @ u.ravel()) / np.linalg.norm(b)
        assert left <= tolerance * (1 + 1e-6)
        np.testing.assert_allclose(residual.ravel(), b - matrix @ u.ravel(), rtol=0, atol=1e-9)
        assert 0 <= iterations <= 4 * 24
        reached.append(left / tolerance)
        assert solve((b - matrix @ u.ravel()).reshape(24, 2), u, 2 * tolerance) == 0
    assert max(reached) > 0.1


def test_a_survey_finds_the_clusters_and_the_deepest_overlap(placed):
    disks, offsets, shear, domains = placed
    graph, contacts = resistance.Graph.room(domains, 24, 0, False), find_contacts(disks)
    deepest = np.max(contacts.overlap / contacts.sigma, initial=0.0)
    of = clusters_of(contacts)[1]
    found = clusters.survey_of(domains, offsets, shear, graph)
    assert found[:2] == (of.max() + 1, np.bincount(of).max())
    assert found[2] == pytest.approx(deepest, rel=1e-10)
