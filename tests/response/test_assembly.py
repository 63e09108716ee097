"""K, B and their border against the dense reference, on any number of ranks and in both scalar types."""

import numpy as np
import pytest
from samples import LAWS, SAMPLES, laws_of, network_of, physics, reference
from whole_arrays import csr, dense, unknowns, whole

from jampetsc.petsc.session import current
from jampetsc.response.assembly import ROW, assemble

EPSILON = np.finfo(float).eps
pytestmark = pytest.mark.scalar("real", "complex")


def form_of(pencil, exact, name):
    """K or B of the reference, with spins counted as those of the pencil are."""
    matrix = getattr(exact, name)
    follow = pencil.network.spins_follow_load(pencil.law)
    return (exact.turning_with_loads(matrix) if follow else matrix).astype(float)


def pinned(matrix, pins, value):
    """`matrix` with the rows and columns of `pins` replaced by `value` times those of the identity."""
    matrix = matrix.copy()
    matrix[pins], matrix[:, pins] = 0.0, 0.0
    matrix[pins, pins] = value
    return matrix


@pytest.fixture(scope="module", params=SAMPLES)
def cases(request):
    """For some laws a Pencil, its dense Reference, and the reference's row of each unknown."""
    made = []
    for law in laws_of(request.param, current().size):
        exact = reference(request.param, law)
        network = network_of(SAMPLES[request.param](), LAWS[law], current().comm)
        made.append((assemble(network, LAWS[law].law), exact, unknowns(network, exact.dofs, exact.disks)))
    return made


def test_matrices_and_border(cases):
    """In one pattern, zeros stored, so that K + sB needs no new one and no new symbolic factorisation."""
    for pencil, exact, rows in cases:
        for one, other in zip(csr(pencil.K)[:2], csr(pencil.B)[:2], strict=True):
            np.testing.assert_array_equal(one, other)
        for name, border, corner, on_pin in (
            ("K", pencil.k_gamma, pencil.k_gg, pencil.network.k),
            ("B", pencil.b_gamma, pencil.b_gg, 0.0),
        ):
            wanted = form_of(pencil, exact, name)
            about = {"rtol": 0, "atol": 1e-13 * np.abs(wanted).max(), "err_msg": f"{name}, {pencil.law}"}
            found = dense(getattr(pencil, name))
            np.testing.assert_allclose(
                found, pinned(wanted[np.ix_(rows, rows)], pencil.pins, on_pin), **about
            )
            np.testing.assert_allclose(found, found.T, **about | {"atol": 1e-3 * about["atol"]})
            gamma = wanted[rows, -1].copy()
            gamma[pencil.pins] = 0.0
            np.testing.assert_allclose(whole(border), gamma, **about)
            assert corner == pytest.approx(wanted[-1, -1], rel=1e-13), pencil.law


def test_diagonals_and_what_they_bound(cases):
    """|A| ≤ ROW max(diagonal), of all ranks: the norm that bounds what rounding and a solver's error can do."""
    for pencil, *_ in cases:
        K, B = (dense(matrix).real for matrix in (pencil.K, pencil.B))
        diagonal = np.concatenate(pencil.network.comm.allgather(pencil.diagonal(0.3)))
        np.testing.assert_allclose(diagonal, np.diag(K) + 0.3 * np.diag(B), rtol=1e-14)
        for matrix, largest in zip((K, B), pencil.largest, strict=True):
            assert largest == np.abs(np.diag(matrix)).max()
            assert np.linalg.norm(matrix, 2) <= ROW[2] * largest, pencil.law


def test_every_rank_may_have_all_rows(cases):
    for pencil, *_ in cases:
        alone = pencil.gathered()
        for name in ("K", "B"):
            np.testing.assert_array_equal(dense(getattr(alone, name)), dense(getattr(pencil, name)))
        for name in ("k_gamma", "b_gamma"):
            np.testing.assert_array_equal(getattr(alone, name).getArray(), whole(getattr(pencil, name)))
        local = np.random.default_rng(pencil.network.first).normal(size=pencil.K.getLocalSize()[0])
        every = np.concatenate(pencil.network.comm.allgather(local))
        for one, x in ((pencil, local), (alone, every)):
            one.project(x)
        np.testing.assert_allclose(np.concatenate(pencil.network.comm.allgather(local)), every, atol=1e-14)
        mean = every.reshape(-1, pencil.dofs)[:, :2].mean(axis=0)
        assert np.all(np.abs(mean) < 1e-14) == pencil.law.holds_translations


def test_as_many_pins_as_moves_that_cost_nothing(cases):
    for pencil, exact, _ in cases:
        total = (exact.K + exact.B)[:-1, :-1].astype(float)
        free = np.count_nonzero(np.linalg.svd(total, compute_uv=False) < 1e-12 * np.abs(total).max())
        if pencil.law.drag:
            assert len(pencil.pins) == free == 0
            continue
        moves = exact.free_moves()
        assert len(pencil.pins) == free == moves.shape[1], pencil.law
        for matrix in (exact.K, exact.B):  # the strain does not couple to them either
            assert np.abs(matrix[:, :-1] @ moves).max() < 1e-17 * np.abs(matrix).max()


def test_sums_of_squares(cases):
    """K = Cᵀ W_K C and B = Cᵀ W_B C + drag; borders and corners from g in the same way."""
    for pencil, exact, rows in cases:
        c = pencil.compatibility
        C = dense(c.C)
        g, w_K, w_B, drag = (
            np.concatenate(pencil.network.comm.allgather(local)) for local in (c.g, c.w_K, c.w_B, c.drag)
        )
        assert len(g) == c.forms * exact.contacts
        assert not C[:, pencil.pins].any()
        extended = np.column_stack((C, g))
        drag = np.diag([*drag, c.drag_gg])
        at = np.append(rows, -1)
        for name, weight, extra in (("K", w_K, 0.0), ("B", w_B, drag)):
            wanted = form_of(pencil, exact, name)[np.ix_(at, at)]
            about = {"rtol": 0, "atol": 1e-13 * np.abs(wanted).max(), "err_msg": f"{name}, {pencil.law}"}
            found = extended.T @ (weight[:, None] * extended) + extra
            np.testing.assert_allclose(found, pinned(wanted, pencil.pins, 0.0), **about)


@pytest.mark.parametrize("sample", ["isostatic", "hertzian"])
def test_weights_are_off_by_what_an_overlap_is_off(session, sample):
    """Positions off by a quarter of ε, overlaps by less than ε σ: force over distance has the fewest digits left."""
    found = []
    for move in (0.0, 1.0):
        disks = SAMPLES[sample]()
        shift = np.random.default_rng(5).uniform(-move, move, disks.offset.shape) * EPSILON / 4.0
        disks = disks.replace(offset=disks.offset + shift)
        c = assemble(network_of(disks, physics(), session.comm), physics().law).compatibility
        found.append((c.w_K.reshape(-1, c.forms), c.size_K.reshape(-1, c.forms)))
    (before, size), (after, _) = found
    off = np.abs(after - before)
    assert np.all(off <= EPSILON * (size + 4.0 * np.abs(before)))
    more = np.any(off[:, 1] > 4.0 * EPSILON * np.abs(before[:, 1]))  # than its own last digit
    assert any(session.comm.allgather(more))
