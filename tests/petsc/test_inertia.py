"""Counting eigenvalues by inertia, against the eigenvalues of the dense matrices."""

import numpy as np
import pytest
from samples import LAWS, SAMPLES, physics, reference
from scipy.linalg import block_diag
from whole_arrays import spread

from jampetsc.errors import ConvergenceError, InputError
from jampetsc.petsc.inertia import Inertia, ShiftedInertia, count_below, count_eigenvalues
from jampetsc.response import minimum_check as minimum
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import build_network
from jampetsc.response.minimum_check import (
    BY_CHOLESKY,
    BY_INERTIA,
    asymmetry,
    count_modes,
    examine,
    negative_modes,
    require_minimum,
    require_unique_response,
)

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(2)]


def signs(matrix):
    """Numbers of negative, zero and positive eigenvalues of a dense matrix, scaled to a unit diagonal."""
    matrix = matrix.astype(float)
    diagonal = np.diag(matrix)
    scale = 1 / np.sqrt(np.where(diagonal != 0, np.abs(diagonal), 1))
    values = np.linalg.eigvalsh(matrix * np.outer(scale, scale))
    return tuple(
        int(np.count_nonzero(chosen)) for chosen in (values < -1e-11, abs(values) < 1e-11, values > 1e-11)
    )


@pytest.mark.parametrize("sample", SAMPLES)
def test_counts_are_those_of_the_dense_eigenvalues(session, sample):
    network = build_network(SAMPLES[sample](), session.comm)
    for name in (str(physics()), str(physics("stokes"))):
        pencil, exact = assemble(network, LAWS[name].law), reference(sample, name)
        for matrix in "KB":
            found = count_eigenvalues(getattr(pencil, matrix), matrix, pencil.pins)
            negative, zero, positive = signs(getattr(exact, matrix)[:-1, :-1])
            assert numbers(found) == (negative, zero - len(pencil.pins), positive)


def symmetric(session, dense):
    """A PETSc Mat with these entries that is known to be symmetric."""
    matrix = spread(session.comm, np.asarray(dense, float))
    matrix.setOption(session.PETSc.Mat.Option.SYMMETRIC, True)
    return matrix


def numbers(found):
    return found.negative, found.zero, found.positive


def test_an_eigenvalue_at_the_very_value_is_not_counted_silently(session):
    """The pivots of A − value are exact here, one of them zero: on which side it lies nobody can say."""
    matrix = symmetric(session, np.diag(np.arange(1.0, 7.0)))
    assert count_below(matrix, 2.5, "A") == 2
    with pytest.raises(ConvergenceError, match="A: 1 pivots of L D Lᵀ are zero to rounding"):
        count_below(matrix, 2.0, "A")


@pytest.mark.most_ranks(1)
def test_a_factor_without_pivoting_certifies_nothing(session):
    """A diagonal of 1e-7 beside entries of order one: 1e-9 of them are lost, which the solves show."""
    dense = np.random.default_rng(1).normal(size=(12, 12))
    dense += dense.T
    np.fill_diagonal(dense, 1e-7)
    matrix, options = symmetric(session, dense), session.PETSc.Options()
    assert ShiftedInertia(matrix, "A").count_certified(0.0) == np.sum(np.linalg.eigvalsh(dense) < 0)
    settings = {
        "inertia_mat_mumps_cntl_1": 0.0,
        "inertia_mat_mumps_icntl_8": 0,
    }  # neither pivoting nor scaling
    for name, value in settings.items():
        options.setValue(name, value)
    with pytest.raises(ConvergenceError, match=r"A: the factor has a residual of .*, above rounding"):
        ShiftedInertia(matrix, "A").count_certified(0.0)
    for name in settings:
        options.delValue(name)


@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_asymmetry_is_measured(session, unit):
    dense = np.eye(6)
    assert asymmetry(spread(session.comm, 0.0 * dense)) == asymmetry(spread(session.comm, dense)) == 0.0
    dense[0, 5] = 0.5
    assert asymmetry(spread(session.comm, unit * dense)) == pytest.approx(np.sqrt(2 * 0.25 / 6.25))


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("sample", SAMPLES)
def test_examination(session, sample):
    exact = reference(sample, str(physics()))
    network = build_network(SAMPLES[sample](), session.comm, prestress=False)  # both kinds of K are counted
    facts = examine(network, physics().law)
    plane = [row for row in range(3 * exact.n) if row % 3 < 2]
    negative, zero, positive = signs(exact.K[np.ix_(plane, plane)])
    assert numbers(facts.with_prestress) == (negative, zero, positive)
    assert (facts.without_prestress.negative, facts.without_prestress.zero) == (0, facts.translations)
    assert (facts.damping.negative, facts.damping.zero) == (0, 0)
    assert facts.damping.positive == facts.unknowns - facts.pins == 3 * exact.n - exact.free_moves().shape[1]
    assert facts.contacts == exact.contacts
    pairs = len(set(zip(exact.i, exact.j, strict=True)))
    assert facts.nonzeros == 9 * (exact.n + 2 * pairs)
    assert max(facts.asymmetry_K, facts.asymmetry_B) < 1e-15
    pieces = exact.pieces()
    assert (facts.pieces, facts.gears) == (len(pieces), sum(piece[0][1] != 0 for piece in pieces))
    assert facts.dofs == 3


def test_a_response_is_unique_without_modes_but_translations(session):
    """Those of every piece."""
    require_unique_response(build_network(SAMPLES["published"](), session.comm))
    strips = build_network(SAMPLES["strips"](), session.comm, prestress=False)
    assert count_modes(strips).zero == 4
    require_unique_response(strips)


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize(
    ("negative", "zero", "says"),
    [
        (1, 2, "K has 1 negative mode: not a minimum"),
        (2, 5, "K has 2 negative modes: not a minimum"),
        (0, 3, "K has 1 floppy mode besides its translations"),
        (0, 4, "K has 2 floppy modes besides"),
        (0, 2, None),
    ],
)
def test_one_mode_is_enough(session, monkeypatch, negative, zero, says):
    network = build_network(SAMPLES["published"](), session.comm)
    monkeypatch.setattr(minimum, "count_modes", lambda _: Inertia(negative, zero, 32 - negative - zero))
    if says is None:
        return require_unique_response(network)
    with pytest.raises(InputError, match=says):
        require_unique_response(network)


def test_negative_modes_are_none_by_cholesky_or_counted(session, monkeypatch):
    sound, gears = (build_network(SAMPLES[name](), session.comm) for name in ("published", "gears"))
    assert negative_modes(sound) == (0, BY_CHOLESKY)
    number, how = negative_modes(gears)
    assert number == count_modes(gears).negative > 1 and how == BY_INERTIA
    monkeypatch.setattr(minimum.ShiftedFactor, "prove", lambda _: False)
    assert negative_modes(sound) == (0, BY_INERTIA)
    require_minimum(sound)
    with pytest.raises(InputError, match=f"K has {number} negative modes"):
        require_minimum(gears)


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("unit", [4.0, 4e-9])
@pytest.mark.parametrize("size", [0.7e-12, 1.4e-12])
def test_what_counts_as_zero_is_1e_12_of_the_diagonal(session, size, unit):
    """[[1, x], [x, 1]] has 1 − x and 1 + x, here times a unit: x = 1 ∓ size, on either side of zero."""
    pairs = [[[1.0, x], [x, 1.0]] for x in (1.0 - size, 1.0 + size)]
    found = count_eigenvalues(symmetric(session, unit * block_diag(*pairs)), "A")
    assert numbers(found) == ((0, 2, 2) if size < 1e-12 else (1, 0, 3))
