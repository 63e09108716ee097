"""Steady oscillations with power-law damping: against time integration, the linear sweep, and exact relations."""

from functools import cache

import launch
import numpy as np
import pytest
from oscillations import steady_oscillation
from powerlaw import Motion, slow_moduli
from samples import physics, published
from sweeps import Sweep
from whole_arrays import unknowns

from jampetsc.errors import ConvergenceError
from jampetsc.io.packing_file import write_packing
from jampetsc.io.reader import load
from jampetsc.oscillation import cycle_solver
from jampetsc.oscillation import steady_oscillation as steady
from jampetsc.oscillation.cycle_equations import Equations
from jampetsc.oscillation.cycle_solver import solve_cycle
from jampetsc.oscillation.drive import Drive
from jampetsc.oscillation.half_cycle import Cycle
from jampetsc.oscillation.harmonic_preconditioner import HarmonicPreconditioner
from jampetsc.oscillation.power_law import MAX_SLOPE_RATIO
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.session import current

pytestmark = pytest.mark.scalar("real")
OMEGA, STRESS = 2e-6, 1e-4  # for α = ½, the middle of the crossover of the published packing


def shaker(alpha, steps=64, stiffest=MAX_SLOPE_RATIO, **options):
    """A SteadyOscillation of the published packing with power-law damping. Collective."""
    return steady_oscillation(published(), physics(exponent=alpha, **options), steps, stiffest)


def drive_of(omega, stress=None, strain=None):
    return Drive(omega, stress if strain is None else strain, strain is None)


@cache
def shaken(alpha, steps=64, omega=OMEGA, stress=STRESS, strain=None, stiffest=MAX_SLOPE_RATIO):
    """The SteadyResult of the published packing, solved once. Collective."""
    oscillation = shaker(alpha, steps, stiffest)
    return oscillation.solve(drive_of(omega, stress, strain))


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize(
    ("alpha", "omega", "imposed"),
    [
        (1.0, 0.1, {"stress": STRESS}),
        (1.5, 5.0, {"stress": STRESS}),
        (2.0, 100.0, {"strain": 1e-3}),
        (2 / 3, 1e-3, {"stress": STRESS}),
        (0.5, OMEGA, {"stress": STRESS}),
        (0.5, OMEGA, {"strain": 1e-3}),
    ],
)
def test_against_integration_in_time(alpha, omega, imposed):
    """A cycle integrated from the steady state that was found comes back to it, with the same modulus."""
    oscillation = shaker(alpha)
    found, network = oscillation.solve(drive_of(omega, **imposed)), oscillation.network
    motion = Motion(published(), physics(exponent=alpha), omega, **imposed)
    rows = unknowns(network, motion.exact.dofs, motion.exact.disks)
    orders = np.arange(1, 2 * len(found.velocity), 2)
    frequencies = omega * np.tan(orders * np.pi / 64) / np.tan(np.pi / 64)
    parts = current().comm.allgather(found.velocity)
    rate = parts[0][:, -1] / np.sqrt(network.volume)
    field = np.column_stack((*(part[:, :-1] for part in parts), rate)) / (1j * frequencies[:, None])
    Q = np.zeros(len(motion.K))
    Q[[*rows, -1]] = field.sum(axis=0).real
    middle, *_ = motion.half_cycle(Q)
    Q = 0.5 * (middle - Q)
    end, strain, stress = motion.half_cycle(Q, start=np.pi / omega)
    assert (Q + end) @ motion.K @ (Q + end) < 1e-6 * (Q @ motion.K @ Q)
    G = stress / strain
    assert abs(found.G - G) < found.error + 1e-6 * abs(G)
    assert found.error < 3e-3 * abs(G)


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("imposed", [{"stress": 3e-5}, {"strain": 3e-5}])
@pytest.mark.parametrize(
    "options",
    [{}, {"beta": 0.0, "prestress": False}, {"rotations": False, "tau1": 2.0, "normal": 0.25, "beta": 3.0}],
)
def test_linear_damping_is_the_sweep(options, imposed):
    omega = np.array([1e-4, 3e-2, 5.0])
    sweep = Sweep(published(), physics(**options), omega, 1e-8, current().comm).solved()
    oscillation = shaker(1.0, 16, **options)
    for at, bound, G in zip(omega, sweep.bounds[:, 0], sweep.G, strict=True):
        found = oscillation.solve(drive_of(at, **imposed))
        assert abs(found.G - G) <= found.error + bound
        assert found.error < 1e-6 * abs(G)
        assert np.all(abs(found.harmonics) < 1e-6)


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("alpha", [0.4, 2 / 3])
@pytest.mark.parametrize("imposed", [{"stress": STRESS}, {"stress": None, "strain": 1e-3}])
def test_energy(alpha, imposed):
    """What is put in is dissipated, and is what the first harmonic says."""
    found = shaken(alpha, 16, **imposed)
    assert abs(found.energy_balance) < 1e-6
    strain = imposed.get("strain") or STRESS / abs(found.G)
    assert found.work == pytest.approx(np.pi * found.G.imag * strain**2, rel=1e-7)
    assert 1e-3 < abs(found.harmonics[0]) < 0.2


@pytest.mark.most_ranks(1)
def test_order_of_the_steps():
    """Halving the steps takes off three quarters of the error, and the estimate covers what is left."""
    runs = [shaken(0.5, steps) for steps in (16, 32, 64)]
    best = runs[-1].G + (runs[-1].G - runs[-2].G) / 3
    errors = np.array([abs(run.G - best) for run in runs[:-1]])
    assert np.all(errors <= [run.error for run in runs[:-1]])
    ratios = errors[:-1] / errors[1:]
    assert np.all((ratios > 2.5) & (ratios < 6.5)), ratios


@pytest.mark.most_ranks(1)
def test_what_the_solver_leaves_is_in_the_error(monkeypatch):
    """Stopped at once where half of the steps have led: the difference of both then says nothing."""
    exact = shaken(0.5, 16).G
    monkeypatch.setattr(steady, "TOLERANCE", 0.1)
    found = shaken.__wrapped__(0.5, 16)
    assert 1e-4 * abs(exact) < abs(found.G - exact) <= found.error


@pytest.mark.most_ranks(1)
def test_regularisation_does_not_matter():
    """A softening that is large changes G*, less when halved; the one in use does not."""
    tried = (4.0, 8.0, 1e4, MAX_SLOPE_RATIO, 10 * MAX_SLOPE_RATIO)
    ends = {stiffest: shaken(0.5, 16, stiffest=stiffest) for stiffest in tried}
    exact = ends[10 * MAX_SLOPE_RATIO].G
    off = {stiffest: abs(run.G - exact) for stiffest, run in ends.items()}
    assert off[4.0] > 1.5 * off[8.0] > 1e-6 * abs(exact)
    assert off[MAX_SLOPE_RATIO] < 1e-8 * abs(exact) and off[1e4] < 1e-6 * abs(exact)
    for stiffest in (4.0, 8.0):
        assert ends[stiffest].regularisation_effect > 0.1 * off[stiffest]
    assert ends[MAX_SLOPE_RATIO].regularisation_effect < 1e-7 * abs(exact)


def test_only_what_is_left_of_the_equations_counts(monkeypatch):
    """SNES may be told to call anything converged."""
    monkeypatch.setitem(cycle_solver.NEWTON_DEFAULTS, "snes_type", "ksponly")
    oscillation = shaker(0.5, 16)
    contacts, law = oscillation.contacts, oscillation.power.softened(1e-8)
    equations = Equations(contacts, Cycle(16, OMEGA), law, Drive(OMEGA, STRESS, True), STRESS, 1.0)
    with pytest.raises(ConvergenceError, match=r"SNES reason \d+\).* times the tolerance"):
        solve_cycle(equations, np.full(equations.size, 1e-9), 1e-9 * STRESS)


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize("alpha", [0.5, 2 / 3])
def test_slow_limit(alpha):
    """At low frequency contacts move as in slow shear, and G'' is what that dissipates."""
    omega = 1e-12 if alpha == 0.5 else 1e-9
    oscillation = shaker(alpha, rotations=False)
    found = oscillation.solve(drive_of(omega, strain=1e-4))
    storage, loss = slow_moduli(oscillation.network, published(), alpha, omega, 1e-4)
    assert found.G.imag == pytest.approx(loss, rel=1e-2)
    assert found.G.real == pytest.approx(storage, rel=1e-2)
    assert found.G.imag < 0.05 * found.G.real


@pytest.mark.most_ranks(1)
def test_the_command_has_the_mean_diameter_for_its_length_and_leaves_no_checkpoint(session, tmp_path):
    packing, out = tmp_path / "p.h5", tmp_path / "o.h5"
    write_packing(packing, published())
    launch.here(f"oscillate {packing} --out {out} --alpha 0.5 --omega {OMEGA} --stress {STRESS} --steps 16")
    assert load(out)["G"][0, 0] == pytest.approx(shaken(0.5, 16).G, rel=1e-6)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["o.h5", "p.h5"]


@pytest.mark.parametrize("diagonal", [0.2, -1.0, np.nan])
def test_a_factor_that_fails_on_one_rank_fails_on_all(session, diagonal):
    """Ranks share the harmonics, each with factors of its own; so much of its diagonal is not positive definite."""
    oscillation = shaker(0.5, 16)
    contacts = oscillation.contacts
    preconditioner = HarmonicPreconditioner(contacts, Cycle(16, OMEGA), True)
    stiffness = np.ones((contacts.count, len(contacts.damped)))
    preconditioner.update(stiffness)
    if session.rank == session.size - 1:
        preconditioner.K.setdiag(diagonal * preconditioner.K.diagonal())
    with pytest.raises(NotPositiveDefinite, match=r"K/Ω \+ B at Ω = "):
        preconditioner.update(1e-12 * stiffness)


@pytest.mark.least_ranks(2)
@pytest.mark.parametrize("imposed", [{"stress": STRESS}, {"strain": 1e-3}])
def test_all_ranks_together_find_what_one_finds(session, monkeypatch, imposed):
    """Each number, also what a poor solver leaves and what a large softening changes; and with as little work."""
    monkeypatch.setattr(steady, "TOLERANCE", 1e-4)

    how = {"stress": None, **imposed, "stiffest": 8.0}
    together = shaken.__wrapped__(0.5, 16, **how)
    with session.alone():
        alone = shaken.__wrapped__(0.5, 16, **how)
    for name in ("G", "harmonics", "work", "speed"):
        np.testing.assert_allclose(getattr(together, name), getattr(alone, name), rtol=1e-4)
    for name in ("error", "regularisation_effect"):
        assert getattr(together, name) == pytest.approx(getattr(alone, name), rel=0.02)
        assert getattr(together, name) > 1e-4 * abs(alone.G)
    assert together.energy_balance == pytest.approx(alone.energy_balance, abs=1e-4)
    assert together.newton_steps <= alone.newton_steps + 1
    assert together.linear_iterations <= 1.2 * alone.linear_iterations + 5
    names = ("G", "error", "work", "energy_balance", "speed", "newton_steps")
    scalars = tuple(getattr(together, name) for name in names)
    assert len(set(session.comm.allgather(scalars))) == 1


@pytest.mark.most_ranks(1)
def test_few_iterations():
    """What the preconditioner, the start from half of the steps and Newton's own steps save."""
    runs = shaken(1.0, 16, 0.1), shaken(0.5, 16), shaken(0.5, 64)
    counts = [(run.newton_steps, run.linear_iterations) for run in runs]
    most = [(5, 13), (15, 182), (15, 336)]  # now (4, 12), (12, 146), (12, 269)
    assert np.all(np.array(counts) <= most), counts
