"""What a sweep certifies is the residual as it is, however the space was made and whichever rank computes what."""

from contextlib import suppress
from functools import cache

import numpy as np
import pytest
import scipy.linalg
from samples import SAMPLES, network_of, physics, reference
from sweeps import Sweep, errors
from whole_arrays import dense, spread, whole

from jampetsc.errors import ConvergenceError
from jampetsc.packing.packing import Packing
from jampetsc.petsc import mumps
from jampetsc.petsc.cholesky import NotPositiveDefinite, least_eigenvalue
from jampetsc.petsc.session import current
from jampetsc.petsc.shifted import ShiftedFactor, shifted
from jampetsc.response import shift_factors as factors
from jampetsc.response.assembly import ROW, assemble
from jampetsc.response.certificate import EPSILON, field_bound
from jampetsc.response.direct import FrequencySolver
from jampetsc.response.factor_memory import factor_bytes
from jampetsc.response.galerkin import Galerkin, graded_eigenpairs
from jampetsc.response.krylov_basis import RationalBasis, field_at
from jampetsc.response.rational import largest_rate
from jampetsc.response.residual import ResidualBound, energy_between, positive, transfer
from jampetsc.response.shift_factors import Factors, closest

# what is bounded here is compared with dense matrices on 3 ranks by test_rational
pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(2)]
OMEGA = np.geomspace(1e-8, 1e3, 12)
LAWS = [physics(), physics("stokes"), physics(rotations=False)]


def exact(sample, law):
    return np.array([reference(sample, str(law)).modulus(omega) for omega in OMEGA])


def bound_of(found, residual):
    """The ResidualBound of a Sweep as it is, of this Residual."""
    sweep = found.sweep
    return ResidualBound(residual, sweep.factors, *sweep.missing, sweep.largest_rate, OMEGA)


@pytest.fixture(scope="module")
def swept():
    """swept(law): the finished Sweep of 64 disks, made once for each law."""

    @cache
    def solved(law):
        return Sweep(SAMPLES["polydisperse"](), law, OMEGA, 1e-3, current().comm).solved()

    yield solved
    solved.cache_clear()


def continued(found, x0, vectors, shifts, parallel="auto"):
    """The RationalSweep of a Sweep of 16 disks that goes on from another basis, to its end or until it is refused."""
    other = Sweep(SAMPLES["published"](), found.physics, OMEGA, 1e-6, found.network.comm, parallel)
    with suppress(ConvergenceError):
        other.sweep.restore(found.basis.first, x0, vectors, shifts, found.sweep.factors.owner)
        other.solved()
    return other.sweep


def pencil_of(session, law, sample="polydisperse"):
    return assemble(network_of(SAMPLES[sample](), law, session.comm), law.law)


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_columns_and_weights_make_the_residual(session, swept, law):
    """R w(iω) = k_γ + iω b_γ + (K + iωB) x(iω), and what rounding did to it is below what is said of it."""
    found = swept(law)
    pencil = found.pencil
    galerkin = Galerkin(found.basis)
    residual = galerkin.residual()
    K, B = dense(pencil.K), dense(pencil.B)
    k, b = whole(pencil.k_gamma), whole(pencil.b_gamma)
    for omega in (1e-7, 1e-2, 30.0):
        x, r = (
            np.concatenate(session.comm.allgather(local))
            for local in (galerkin.field(omega), residual.columns @ residual.weights([omega])[:, 0])
        )
        wanted = k + 1j * omega * b + (K + 1j * omega * B) @ x
        terms = np.abs(k) + omega * np.abs(b) + (np.abs(K) + omega * np.abs(B)) @ np.abs(x)
        assert np.all(np.abs(r - wanted) <= 1e-13 * terms.max())


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("law", [LAWS[0], LAWS[2]], ids=str)
def test_rounding_of_the_columns_is_below_what_is_said_of_it(session, swept, law):
    """Against sums over contacts in extended precision, in the norm of D⁻¹, and not below it by much."""
    found = swept(law)
    c, galerkin = found.compatibility, Galerkin(found.basis)
    residual = galerkin.residual()
    still, modes = residual.motions[:, 0], residual.motions[:, 1:]
    C = dense(c.C).astype(np.longdouble)
    forces = [c.w_K * still.astype(np.longdouble)]
    forces.append(c.w_B * (still - modes.astype(np.longdouble) @ residual.loads))
    forces += [(c.w_K - rate * c.w_B) * mode for rate, mode in zip(residual.rates, modes.T, strict=True)]
    off = residual.columns - C.T @ np.array(forces).T
    K, B = np.diag(dense(found.pencil.K)), np.diag(dense(found.pencil.B))
    for s in (1e-6, 1e-2, 10.0):
        diagonal = K + s * B
        said = residual.rounding(s, diagonal)
        made = np.sqrt(np.sum(off**2 / diagonal[:, None], axis=0)).astype(float)
        assert np.all(made <= said) and np.all(said <= 1e4 * made)


@pytest.mark.parametrize("law", LAWS[:2], ids=str)
def test_what_a_poor_solve_leaves_of_an_energy_is_in_its_bound(session, swept, law):
    """vᵀA⁻¹v = e + ρᵀA⁻¹ρ for any x with A x = v − ρ: here x is no more than a fifth of what it should be."""
    s = 1e-2
    found = swept(law)
    pencil, q, residual = found.pencil, found.sweep.missing[0], Galerkin(found.basis).residual()
    side = Factors(pencil, "matrix")
    side.factorise([s])
    K, B = dense(pencil.K), dense(pencil.B)
    A, v = K + s * B, np.concatenate(session.comm.allgather(q))
    x = 0.2 * np.linalg.solve(A, v)
    rest = v - A @ x
    e, left = float(x @ v + x @ rest), float(np.sqrt(np.sum(rest**2 / np.diag(A))))
    infinite, top = np.full(len(OMEGA), np.inf), found.sweep.largest_rate

    def bound(left):
        made = ResidualBound(residual, side, q, {s: (e, left)}, top, OMEGA)
        return made.shift_bounds[0], made.within(infinite)

    lower, said = bound(left)
    columns, weights = np.concatenate(session.comm.allgather(residual.columns)), residual.weights(OMEGA)
    r = columns @ weights
    exact = np.array(
        [np.vdot(f, np.linalg.solve(K + w * B, f)).real for w, f in zip(OMEGA, r.T, strict=True)]
    )
    assert np.all(said >= np.sqrt(2.0) * exact)
    at_rest, twice = bound(0.0)[1], bound(2.0 * left)[1]
    large = exact > 1e-6 * exact.max()  # where q is what is left, far above what is due to rounding
    assert large.any() and np.any(at_rest[large] < np.sqrt(2.0) * exact[large])
    D = np.concatenate(session.comm.allgather(lower.diagonal))
    share = left**2 * transfer(top, lower.shift, s) / lower.least * np.max(np.diag(A) / D) / e
    np.testing.assert_allclose(said[large] / at_rest[large], 1.0 + share, rtol=1e-2)
    np.testing.assert_allclose(twice[large] / at_rest[large], 1.0 + 4.0 * share, rtol=1e-2)


def test_what_is_no_number_is_no_bound(session, swept):
    found = swept(physics())
    residual = Galerkin(found.basis).residual()
    residual.columns[:, 2] = np.nan
    assert np.all(bound_of(found, residual).within(np.ones(len(OMEGA))) == np.inf)


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("law", LAWS, ids=str)
def test_the_bound_holds_for_a_space_made_by_poor_solves(session, law):
    """Refused, or within its bound, with x₀ and vectors off by a share: φ and q, for exact solves, only steer."""
    disks, wanted, generator = SAMPLES["published"](), exact("published", law), np.random.default_rng(0)
    found = Sweep(disks, law, OMEGA, 1e-6, session.comm).solved()
    basis, judged = found.basis, []
    for noise in (1e-10, 1e-5, 1e-2):
        spoiled = [x * (1.0 + noise * generator.standard_normal(x.shape)) for x in (basis.x0, *basis.vectors)]
        for x in spoiled:
            found.pencil.project(x)
        if certificate := continued(found, spoiled[0], spoiled[1:], basis.shifts).certificate:
            judged.append(noise)
            assert np.all(errors(certificate.G, wanted)[0] <= certificate.bounds)
    assert judged[:2] == [1e-10, 1e-5]


@pytest.mark.most_ranks(1)
def test_what_is_asked_is_what_is_certified(session):
    """--accuracy is kept, not twice of it, down to where rounding makes it impossible."""
    refused = 0
    for accuracy in np.geomspace(1e-12, 1e-15, 18):
        try:
            found = Sweep(SAMPLES["isostatic"](), physics(), [1e-3], accuracy, session.comm).solved()
            G, (_, storage, loss) = found.G[0], found.bounds[0]
            assert storage <= accuracy * abs(G.real) and loss <= accuracy * abs(G.imag)
        except ConvergenceError:
            refused += 1
    assert 0 < refused < 18


@pytest.mark.least_ranks(2)
@pytest.mark.parametrize("parallel", ["shifts", "matrix"])
@pytest.mark.parametrize("spoil", ["x0", "a vector", "a shift", "nothing"])
def test_a_basis_from_outside_makes_no_bound_false(session, spoil, parallel):
    """As from a checkpoint; what does not belong together is refused in the end, or does no harm."""
    law = physics()
    found = Sweep(SAMPLES["published"](), law, OMEGA, 1e-6, session.comm, parallel).solved()
    basis = found.basis
    x0, vectors, shifts = basis.x0.copy(), basis.vectors.copy(), list(basis.shifts)
    if spoil == "x0":
        x0 *= 1.0 + 1e-3
    elif spoil == "a vector":
        vectors[2] = np.roll(vectors[2], 3)
    elif spoil == "a shift":
        shifts[5] *= 1.1
    sweep = continued(found, x0, vectors, shifts, parallel)
    if spoil == "nothing":
        assert sweep.certificate.within(1e-6).all()
        assert sweep.factorisations <= found.sweep.factorisations
    if sweep.certificate is not None:
        assert np.all(errors(sweep.certificate.G, exact("published", law))[0] <= sweep.certificate.bounds)


@pytest.mark.most_ranks(1)
def test_vectors_close_to_the_space_are_not_taken(session, swept):
    """What is new in them has too few right digits; a part of 1e-4 has enough."""
    found = swept(physics("stokes"))
    pencil, old = found.pencil, found.basis
    one, two = old.vectors[0], old.vectors[1]  # orthonormal in B
    for new, taken in ((0.0, False), (3e-6, False), (3e-5, True)):
        basis = RationalBasis(pencil, np.inf, old.x0)
        assert basis.append(one.copy(), 1.0) and basis.append(one + new * two, 2.0) == taken
        assert basis.size == len(basis.shifts) == len(basis.K) == len(basis.t) == 1 + taken


def test_a_factor_serves_for_shifts_close_by():
    """Within a ratio of 1.5 either way; the first one that does."""
    assert closest([1.0, 10.0], 1.49) == closest([1.0, 10.0], 0.67) == 1.0
    assert closest([1.0, 10.0], 1.51) is closest([1.0, 10.0], 0.66) is closest([], 1.0) is None
    assert closest([1.0, 1.2], 1.3) == 1.0 and closest([10.0, 1.0], 1.0) == 1.0


@pytest.mark.parametrize("sample", ["k = 2.5", "hertzian"])
@pytest.mark.parametrize("law", [*LAWS, physics(normal=0.5, tau1=3.0), physics("stokes", tau1=0.3)], ids=str)
def test_largest_rate_is_one(session, law, sample):
    """K ≤ λ_max B on all that is not pinned, with k ≠ 1 and in units of 1/τ₁, by the stiffest contact of all ranks.

    None where bonds move freely.
    """
    pencil = pencil_of(session, law, sample)
    top = largest_rate(pencil)
    K, B = dense(pencil.K), dense(pencil.B)
    free = np.delete(np.arange(len(K)), pencil.pins)
    least = np.linalg.eigvalsh((top * B - K)[np.ix_(free, free)])[0]
    assert least > -1e-12 * top * np.abs(B).max()
    assert len(set(session.comm.allgather(top))) == 1
    if law.law.normal:
        stiffest = np.concatenate(session.comm.allgather(pencil.network.contacts.stiffness)).max()
        damping = pencil.network.k * law.law.tau1 * law.law.normal
        assert top == pytest.approx(stiffest / damping, rel=1e-12)
    assert largest_rate(pencil_of(session, physics(normal=0.0, rotations=False))) == np.inf


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("law", LAWS[:2], ids=str)
def test_rounding_of_the_columns_is_in_the_bound(session, swept, law, monkeypatch):
    """As much of each as its weight has it, from what terms of motions reach to the diagonal of the shift bound."""
    found = swept(law)
    sweep, residual = found.sweep, Galerkin(found.basis).residual()

    def bound():
        made = bound_of(found, residual)
        return made, made.within(np.full(len(OMEGA), np.inf))

    usual = bound()[1]
    monkeypatch.setattr(residual, "rounding", lambda s, diagonal: np.full(len(residual.rates) + 2, 1e3))
    made, rounded = bound()
    lower = made.shift_bounds[0]
    K, B = np.diag(dense(found.pencil.K)), np.diag(dense(found.pencil.B))
    reach = np.maximum(K + lower.shift * B, found.compatibility.reach(lower.shift))
    stretch = np.max(reach / lower.diagonal)
    np.testing.assert_allclose(lower.rounding, 1e3 * np.sqrt(stretch), rtol=1e-12)
    weights = np.sum(np.abs(residual.weights(OMEGA)), axis=0)
    inverse = transfer(sweep.largest_rate, lower.shift, OMEGA) / lower.least
    assert np.all(rounded >= np.sqrt(2.0) * 1e6 * stretch * weights**2 * inverse * (1 - 1e-9))
    assert np.all(rounded > usual)


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_terms_of_motions_do_not_reach_beyond_what_is_said(session, law):
    """Σ (|w_K| + s w_B)(|C||x|)² + s Σ drag x² ≤ ROW xᵀDx, and D is no more than the diagonal of sums of squares."""
    pencil = pencil_of(session, law)
    c = pencil.compatibility
    C = np.abs(dense(c.C))
    sizes, viscous, drag, reach_K, reach_B = (
        np.concatenate(session.comm.allgather(a))
        for a in (np.abs(c.w_K), c.w_B, c.drag, c.reach_K, c.reach_B)
    )
    np.testing.assert_allclose(reach_K, sizes @ C**2, rtol=1e-13, atol=1e-300)
    np.testing.assert_allclose(reach_B, viscous @ C**2 + drag, rtol=1e-13, atol=1e-300)
    for s, x in zip((1e-6, 1e-2, 10.0), np.random.default_rng(1).normal(size=(3, C.shape[1])), strict=True):
        D = np.concatenate(session.comm.allgather(c.reach(s)))
        assert (sizes + s * viscous) @ (C @ np.abs(x)) ** 2 + s * (drag @ x**2) <= ROW[2] * (D @ x**2)


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("law", LAWS, ids=str)
def test_bounds_are_the_same_in_any_unit_of_length(session, law):
    """Angles, which have none, weigh as much beside lengths of 1e-6 as beside those of 1e6."""
    disks = SAMPLES["published"]()
    found = []
    for unit in (1.0, 2.0**20, 2.0**-20):
        scaled = Packing.from_positions(
            unit * disks.positions, unit * disks.radii, unit * disks.cell, disks.potential
        )
        sweep = Sweep(scaled, law, OMEGA, 1e-6, session.comm).solved()
        solver = FrequencySolver(sweep.pencil, positive_semidefinite=True)
        direct = [solver.solve(omega, 1e-6) for omega in (1e-8, 1e-2, 1e3)]
        found.append((sweep.G, sweep.bounds, [(one.G, *one.rounding) for one in direct]))
    for G, bounds, direct in found[1:]:
        np.testing.assert_allclose(G, found[0][0], rtol=1e-11)
        np.testing.assert_allclose(bounds, found[0][1], rtol=0.1)
        np.testing.assert_allclose(direct, found[0][2], rtol=1e-3)


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize(
    ("ranks", "unknowns", "asked", "alone"),
    [
        (1, 100, "auto", False),
        (2, 100, "auto", True),
        (4, 400_000, "auto", True),
        (4, 400_001, "auto", False),
        (5, 100, "auto", False),
        (5, 400_001, "shifts", True),
        (1, 100, "shifts", False),
        (2, 100, "matrix", False),
    ],
)
def test_how_ranks_are_used(ranks, unknowns, asked, alone):
    """Side by side where a matrix fits a rank's memory and no more shifts are made at once than are needed."""
    assert factors.side_by_side(ranks, factor_bytes(2, unknowns), asked) == alone


@pytest.mark.least_ranks(2)
@pytest.mark.parametrize("count", [3, 100])
def test_ranks_side_by_side_find_several_vectors_alone(session, count):
    """Orthonormal in B; where nothing new is left they end."""
    pencil = pencil_of(session, physics(rotations=False), "published")
    side, B = Factors(pencil, "shifts"), dense(pencil.B)
    side.factorise([1e-3, 1e-1])
    basis = RationalBasis(pencil, *side.field(pencil, 1e-3))
    side.extend(basis, [1e-3, 1e-1], count)
    vectors = np.concatenate(session.comm.allgather(basis.vectors), axis=1)
    np.testing.assert_allclose(vectors @ B @ vectors.T, np.eye(basis.size), atol=1e-8)
    if count == 3:
        assert basis.shifts == 3 * [1e-3] + 3 * [1e-1] and not basis.complete
    else:
        assert basis.complete and 10 < basis.size < len(B)


def test_shifts_go_to_ranks_in_turn(session):
    side = Factors(pencil_of(session, physics()), "shifts")
    side.factorise([1e-3, 1e-1])
    side.factorise([1.2e-3, 10.0])  # the first of which is near enough to one at hand
    assert side.shifts == list(side.energies(side.pencil.k_gamma.getArray())) == [1e-3, 1e-1, 10.0]
    if session.size == 2:
        assert list(side.owner.values()) == [0, 1, 0]
        assert sorted(side.held) == [[1e-3, 10.0], [1e-1]][session.rank]


@pytest.mark.least_ranks(2)
@pytest.mark.parametrize("what", ["factorise", "field", "extend", "energies", "least_eigenvalue"])
def test_what_fails_on_one_rank_fails_on_all(session, what):
    """A matrix that is not positive definite, or a factor that is not that of its matrix."""
    pencil = pencil_of(session, physics())
    side = Factors(pencil, "shifts")
    side.factorise([1e-2, 10.0])
    s = next(s for s, rank in side.owner.items() if rank == session.size - 1)
    basis = RationalBasis(pencil, *side.field(pencil, 1e-2))
    if s in side.held:
        cholesky = side.held[s].cholesky
        cholesky.ksp.getPC().setReusePreconditioner(True)
        cholesky.matrix.scale(3.0)
    force = pencil.k_gamma.getArray()
    calls = {
        "factorise": lambda: side.factorise([1.0, -0.1]),
        "field": lambda: side.field(pencil, s),
        "extend": lambda: side.extend(basis, [s], 1),
        "energies": lambda: side.energies(force),
        "least_eigenvalue": lambda: side.least_eigenvalue(s),
    }
    says = (
        "^K . sB at s = -0.1 is not pos"
        if what == "factorise"
        else f"^solve with K . sB at s = {s:g}: a residual"
    )
    with pytest.raises(ConvergenceError, match=says):
        calls[what]()


def test_energies_are_carried_from_shift_to_frequency():
    """(K + ωB)⁻¹ ≤ c (K + sB)⁻¹, with the worst K, 0 or λ_max B, in turn; none above where λ_max is infinite."""
    assert transfer(4.0, 1.0, 3.0) == (4.0 + 1.0) / (4.0 + 3.0)
    assert transfer(4.0, 3.0, 1.0) == 3.0
    assert transfer(4.0, 3.0, 3.0) == transfer(np.inf, 3.0, 3.0) == transfer(np.inf, 1.0, 3.0) == 1.0
    omega = np.array([0.5, 1.0, 1.5, 2.0, 2.9, 3.0, 6.0])
    found = energy_between(np.inf, {3.0: 1.0, 1.0: 2.0}, omega)
    # the chord lies above a convex function; near 3 that shift alone tells more
    np.testing.assert_allclose(found, [4.0, 2.0, 1.75, 1.5, 3.0 / 2.9, 1.0, 1.0])


@pytest.mark.most_ranks(1)
def test_a_projected_pencil_that_is_none_is_told(session, monkeypatch):
    B, exact = np.eye(2), np.zeros(2)
    for K in (np.diag([1.0, -1e-3]), np.diag([1.0, 0.0])):
        with pytest.raises(
            ConvergenceError, match="the projected K is not positive definite: the packing is not a"
        ):
            graded_eigenpairs(K, B, exact)
    rates, vectors, _ = graded_eigenpairs(np.diag([1e-20, 4.0]), np.diag([1.0, 4.0]), exact)
    order = np.argsort(rates)
    np.testing.assert_allclose(rates[order], [1e-20, 1.0], rtol=1e-14)  # relatively exact, each of them
    np.testing.assert_allclose(np.abs(vectors[:, order]), np.diag([1.0, 0.5]), atol=1e-14)
    jacobi = scipy.linalg.lapack.dgejsv
    monkeypatch.setattr(
        scipy.linalg.lapack, "dgejsv", lambda *given, **words: (*jacobi(*given, **words)[:-1], 1)
    )
    with pytest.raises(ConvergenceError, match=r"one-sided Jacobi did not converge \(info 1\)"):
        graded_eigenpairs(np.diag([2.0, 1.0]), B, exact)


@pytest.mark.most_ranks(1)
def test_a_field_has_the_rounding_of_its_terms_and_one_of_nothing_no_relative_error(session):
    """In a crystal nothing moves against the strain: then exactly, or nothing is known."""
    found = Sweep(SAMPLES["published"](), physics(), [0.1], 1e-3, session.comm).solved()
    c, still = found.compatibility, np.zeros(found.pencil.K.getLocalSize()[0], complex)
    assert field_bound(found.pencil, 0.1, still, 0.0) == 0.0
    assert field_bound(found.pencil, 0.1, still, 1e-30) == np.inf
    # rounding comes on top of what the residual leaves, that of larger fields if x was summed from such
    x = np.random.default_rng(1).normal(size=(2, len(still))).T @ [1.0, 1j]
    motions = dense(c.C) @ x
    energy = (c.w_K + 0.1 * c.w_B) @ np.abs(motions) ** 2
    own = np.sqrt(c.reach(0.1) @ np.abs(x) ** 2)
    for squared, size in ((0.0, 0.0), (1e-28, 0.0), (1e-28, 3.0 * own)):
        wanted = np.sqrt(squared) + 4.0 * EPSILON * np.sqrt(ROW[2]) * max(own, size)
        assert field_bound(found.pencil, 0.1, x, squared, size) == pytest.approx(
            wanted / np.sqrt(energy), rel=1e-9, abs=0
        )


@pytest.mark.parametrize("energy", [-1e-20, np.nan, np.inf])
def test_what_is_no_energy_is_no_bound(energy):
    with pytest.raises(NotPositiveDefinite, match=r"K \+ sB at s = 0.1 is not positive definite"):
        positive({1.0: (2.0, 0.0), 0.1: (energy, 0.0)})
    assert positive({1.0: (0.0, 0.0)}) == {1.0: (0.0, 0.0)}


@pytest.mark.parametrize("unit", [1.0, 2.0**-100])
@pytest.mark.parametrize("law", LAWS[:2], ids=str)
@pytest.mark.parametrize("s", [1e-9, 1e-2, 10.0])
def test_what_a_factor_says_of_its_matrix(session, law, s, unit):
    """A lower bound on eigenvalues, scaled to a unit diagonal, under drag as they are on what is no translation;
    energies; and the first field of a sweep, to rounding of its equation.
    """
    pencil = pencil_of(session, law)
    drag, matrix = law.law.holds_translations, shifted(pencil.K, pencil.B, s)
    matrix.scale(unit)
    factor = ShiftedFactor(matrix, "A", pencil.project if drag else None)
    A, c = dense(pencil.K) + s * dense(pencil.B), whole(pencil.k_gamma) + s * whole(pencil.b_gamma)
    d = np.ones(len(A)) if drag else np.sqrt(np.diag(A))
    wanted = np.linalg.eigvalsh(A / np.outer(d, d))[2 if drag else 0] * (unit if drag else 1.0)
    assert 1e-3 * wanted < factor.least_eigenvalue() <= wanted
    e, left = factor.energy(pencil.k_gamma)
    force = whole(pencil.k_gamma)
    assert e * unit == pytest.approx(force @ np.linalg.solve(A, force), rel=1e-9)
    assert 0.0 < left < 1e-12 / np.sqrt(unit)
    x = unit * np.concatenate(session.comm.allgather(field_at(pencil, factor, s)))
    assert np.abs(A @ x + c).max() <= 4e-15 * (np.abs(A) @ np.abs(x) + np.abs(c)).max()


@pytest.mark.parametrize("quality", [1.0, 0.5, 1e-3, 0.0])
def test_least_eigenvalue_does_not_believe_a_solver(quality):
    """Only residuals count: a solver that gives too little of the softest part, or nothing, hides nothing."""
    values = np.linspace(0.1, 1.0, 200)
    values[17] = 1e-6
    part = np.where(values < 1e-3, quality, 1.0)
    generator = np.random.default_rng(3)

    def step(x):
        solution = part * x / values
        return solution, float(np.linalg.norm(x - values * solution)), float(np.linalg.norm(solution))

    assert least_eigenvalue(lambda: generator.standard_normal(200), step) <= 1e-6


@pytest.mark.parametrize("lost", [(0.0, 0.5), (0.5, 0.25), (0.0, 0.0), (0.9, 0.0)])
def test_least_eigenvalue_is_no_more_than_residuals_allow(lost):
    """A start with just so much of the softest part as it may have, of which each solve loses some."""
    value, tau = 1e-6, 1e-3

    def starts():
        x, left = tau, [share * tau / value**k for k, share in enumerate(lost)]

        def step(x):
            residual = left.pop(0)
            return (x - residual) / value, residual + 1e-30, (x - residual) / value

        return x, step

    x, step = starts()
    found = least_eigenvalue(lambda: x, step, trials=1)
    assert 0.3 * value < found <= value * (1.0 + 1e-12)


def test_the_worst_of_all_ranks_is_why_a_solver_stopped(session):
    """PETSc asks each rank whether to stop, and tells it no more than its own reason."""
    reasons, last = session.PETSc.KSP.ConvergedReason, session.rank == session.size - 1
    matrix = spread(session.comm, np.eye(4))
    x, b = matrix.createVecs()

    def solve(reason):
        ksp = session.PETSc.KSP().create(session.comm)
        ksp.setType("richardson")
        ksp.setOperators(matrix)
        ksp.getPC().setType("none")
        ksp.setConvergenceTest(lambda ksp, iteration, norm: reason if iteration == 7 else 0)
        mumps.solve(ksp, b, x, "A", "; do")

    solve(reasons.CONVERGED_RTOL)
    for failed, told in ((reasons.DIVERGED_NANORINF, "DIVERGED_NANORINF"), (-1234, "-1234")):
        with pytest.raises(ConvergenceError, match=f"^A: KSP stopped with {told} after 7 iterations; do$"):
            solve(failed if last else reasons.CONVERGED_ITS)


@pytest.mark.parametrize("parallel", ["shifts", "matrix"])
def test_what_lapack_says_on_other_ranks_does_not_matter(session, monkeypatch, parallel):
    """On mixed processors it differs in the last digit: rank 0 decides, or ranks would part in collective calls."""
    law = physics()

    def sweep():
        found = Sweep(SAMPLES["polydisperse"](), law, OMEGA, 1e-6, session.comm, parallel).solved()
        spectrum = found.galerkin.spectrum
        fields = session.comm.allgather(found.galerkin.field(0.1))
        return found.G, found.bounds, spectrum.rates, spectrum.weights, np.concatenate(fields)

    def spoiled(function):
        def wrong(*args, **words):
            right = function(*args, **words)
            if isinstance(right, tuple):
                return (1.5 * right[0], *right[1:-1], right[-1])
            return 1.5 * right

        return wrong

    wanted = sweep()
    if session.rank:
        for module, names in (
            (np.linalg, ("eigh", "eigvalsh", "solve", "cholesky", "svd")),
            (scipy.linalg.lapack, ("dgejsv",)),
            (np, ("geomspace",)),
        ):
            for name in names:
                monkeypatch.setattr(module, name, spoiled(getattr(module, name)))
    # MUMPS on several ranks sums in the order in which messages arrive: last digits, of which small bounds are
    # made, differ from run to run; what is spoiled differs by half
    same = 0.0 if parallel == "shifts" else 0.1
    for found, right in zip(sweep(), wanted, strict=True):
        np.testing.assert_allclose(found, right, rtol=same, atol=1e-9 * same * np.abs(right).max())
