"""G*(ω) frequency by frequency: published values, the dense reference, and a bound that is never exceeded."""

import numpy as np
import pytest
from gathered import unknowns
from samples import LAWS, ORACLE, SAMPLES, laws_of, modulus, network_of, physics, published, reference

from jampetsc.contacts.disks import Disks
from jampetsc.errors import ConvergenceError
from jampetsc.mechanics.assembly import assemble
from jampetsc.response.direct import FrequencySolver

pytestmark = pytest.mark.scalar("complex", "real")

OMEGA = (1e-10, 1e-6, 1e-3, 1.0, 1e3)


class Solver(FrequencySolver):
    """A solver that frees its pencil as well; a context manager."""

    def __init__(self, disks, physics, comm):
        super().__init__(assemble(network_of(disks, physics, comm), physics.law))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.destroy()
        self.pencil.destroy()


def compare(found, wanted, accuracy, what):
    """G' and G'' each within `accuracy`, and within their bounds."""
    for here, there, bound in zip(
        (found.G.real, found.G.imag), (wanted.real, wanted.imag), found.parts, strict=True
    ):
        assert abs(here - there) <= accuracy * abs(there), what
        assert abs(here - there) <= bound, what
    assert abs(found.G - wanted) <= found.error_bound, what


@pytest.mark.parametrize("case", ORACLE["cases"], ids=lambda case: case["case"])
def test_published_moduli(session, case):
    """Nine laws at eleven frequencies in 50-digit arithmetic; printed to 14 digits."""
    parameters = dict(case["parameters"])
    law = physics(parameters.pop("law"), **parameters)
    with Solver(published(), law, session.comm) as solver:
        for omega, storage, loss in zip(case["omega"], case["G_storage"], case["G_loss"], strict=True):
            G = solver.solve(omega, 1e-9).G
            assert G.real == pytest.approx(storage, rel=1e-12), omega
            assert G.imag == pytest.approx(loss, rel=1e-12), omega


@pytest.mark.parametrize("sample", SAMPLES)
def test_against_the_dense_reference(session, sample):
    """Also of packings that are no minima: K may have negative modes, the solve does not mind."""
    # sliding rows of the gears hardly resist without pre-stress: G' is 1e-7 of the affine modulus there
    accuracy = 1e-8 if sample == "gears" else 1e-10
    for law in laws_of(sample):
        with Solver(SAMPLES[sample](), LAWS[law], session.comm) as solver:
            for omega in OMEGA:
                found = solver.solve(omega, 1e-6)
                compare(found, modulus(sample, law, omega), accuracy, (law, omega))


@pytest.mark.parametrize("name", [str(physics()), str(physics("stokes"))])
def test_field(session, name):
    """x is the non-affine motion per unit strain, up to translations of each piece under contact damping."""
    law, exact = LAWS[name], reference("strips", name)
    with Solver(SAMPLES["strips"](), law, session.comm) as solver:
        solver.solve(0.1, 1e-6)
        x = np.concatenate(session.comm.allgather(solver.x))
        rows = unknowns(solver.pencil.network, law.law.dofs, exact.disks)
    wanted = exact.solution(0.1)[0].astype(complex)[rows]
    difference = (x - wanted).reshape(-1, law.law.dofs)
    if not law.law.drag:
        second = rows[:: law.law.dofs] >= law.law.dofs * 24
        for piece in (second, ~second):
            difference[piece, :2] -= difference[piece, :2].mean(axis=0)
    np.testing.assert_allclose(difference, 0, atol=1e-10 * np.abs(wanted).max())


@pytest.mark.parametrize("sample", ["published", "gears", "strips"])
def test_where_the_packing_is_pinned_does_not_matter(session, sample):
    """Moving everything by a vector changes the order of the disks and with it which one is pinned."""
    disks, law = SAMPLES[sample](), physics()
    values, held = [], set()
    for shift in ([0.0, 0.0], [3.3, 1.7], [-2.0, 5.1]):
        moved = Disks.from_positions(disks.positions + shift, disks.radii, disks.cell)
        with Solver(moved, law, session.comm) as solver:
            values.append([solver.solve(omega, 1e-8).G for omega in OMEGA])
            particles = np.concatenate(session.comm.allgather(solver.pencil.network.particles))
            held.add(tuple(particles[solver.pencil.pins // law.law.dofs]))
    assert len(held) > 1
    for other in values[1:]:
        np.testing.assert_allclose(np.real(other), np.real(values[0]), rtol=1e-10)
        np.testing.assert_allclose(np.imag(other), np.imag(values[0]), rtol=1e-10)


@pytest.mark.parametrize("sample", ["published", "polydisperse", "strips"])
def test_the_bound_holds_for_poor_solves(session, sample):
    """GMRES stopped at a residual of a tenth: what it does not reach it must know about."""
    poor = 0
    for law in laws_of(sample)[:: 3 if sample == "published" else 1]:
        with Solver(SAMPLES[sample](), LAWS[law], session.comm) as solver:
            solver.ksp.setType("gmres")
            solver.ksp.getPC().setType("jacobi")
            solver.ksp.setTolerances(rtol=0.1, max_it=3000)
            for omega in OMEGA:
                try:
                    found = solver.solve(omega, 1e-3)
                except ConvergenceError:
                    continue
                compare(found, modulus(sample, law, omega), 1e-3, (law, omega))
                poor += found.error > 1e-12 * abs(found.G)
    assert poor > 2


def test_the_bound_is_the_error_of_a_wrong_field(session):
    """Of a field that is off by noise the bound tells the size of the error, and never less."""
    law, omega = str(physics()), 0.01
    exact = modulus("published", law, omega)
    with Solver(published(), LAWS[law], session.comm) as solver:
        solver.solve(omega, 1e-10)
        right = solver.x
        noise = np.random.default_rng(session.rank).normal(size=(2, len(right)))
        pins = solver.pencil.pins - solver.pencil.K.getOwnershipRange()[0]
        noise[:, pins[(pins >= 0) & (pins < noise.shape[1])]] = 0.0
        for size in (1e-1, 1e-3, 1e-5):
            x = right + size * (noise[0] + 1j * noise[1])
            r = solver.functional.residual(omega, x)
            found = solver.functional.certify(omega, x, solver._apply_inverse(omega, r), r)
            error = abs(found.G - exact)
            assert error <= found.error_bound
            assert error > 0.01 * found.error_bound  # it is of second order in the noise, and so is the bound


def test_what_cannot_be_solved_is_an_error(session):
    with Solver(published(), physics(), session.comm) as solver:
        solver.ksp.setType("gmres")
        solver.ksp.getPC().setType("none")
        solver.ksp.setTolerances(max_it=2)
        with pytest.raises(ConvergenceError, match=r"ω = 0\.01: KSP stopped with DIVERGED_M"):
            solver.solve(0.01, 1e-6)
        solver.ksp.setTolerances(rtol=0.5, max_it=3000)
        with pytest.raises(ConvergenceError, match=r"ω = 0\.01: G' = .* only known to .* after refinement"):
            solver.solve(0.01, 1e-10)


def test_a_factor_of_another_frequency_will_do(session):
    """With -freq_ksp_reuse_preconditioner a factor serves until it no longer converges."""
    law = str(physics())
    with Solver(published(), LAWS[law], session.comm) as solver:
        solver.reuse = True
        solver.ksp.setType("gmres")
        solver.ksp.setTolerances(rtol=1e-8, max_it=30)
        grid = np.geomspace(1e-6, 1e2, 17)
        for omega in grid:
            compare(solver.solve(omega, 1e-9), modulus("published", law, omega), 1e-9, omega)
        assert solver.factorisations < len(grid)
