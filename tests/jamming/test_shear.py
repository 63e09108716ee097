"""`jampetsc shear`: minima along a quasistatic path, its file, and continuation after a kill."""

from dataclasses import replace

import numpy as np
import pytest
from sheared import stop_after

import jampetsc
from jampetsc import main as cli
from jampetsc.analysis.strain_series import StrainSeries
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.jamming import stepwise_shear
from jampetsc.jamming.stepwise_shear import (
    ENERGY_CUT,
    PATH_COLUMNS,
    StepwiseShear,
    measure_minimum,
    shear_stepwise,
)
from jampetsc.laws.relative_motion import transverse_axes
from jampetsc.minimisation import warm_start
from jampetsc.minimisation.descent import Effort, Goal
from jampetsc.minimisation.minimise import minimise, settle
from jampetsc.minimisation.protocols import random_start
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing import contacts
from jampetsc.packing.contacts import measure
from jampetsc.packing.packing import deformed, proved_minimum
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import simple_shear
from jampetsc.petsc.hessian_solver import NewtonSolver

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]  # one run is one process

SOFT = Potential("harmonic", "inverse-square-diameter")


def shear(out, **more):
    """Result in a file of 64 disks above jamming, with lines of progress."""
    given = {"n": 64, "phi": 0.86, "seed": 2, "step": 1e-3, "strain": 0.06} | more
    return jampetsc.shear(**given, out=out, progress=True)


def test_energy_grows_by_the_work_of_the_stress(session, tmp_path):
    """dU/dγ = V σ along minima, except where disks rearrange; and the last state is a minimum."""
    last = tmp_path / "last.h5"
    result = shear(tmp_path / "qs.h5", last=last)
    strain, energy, stress = (result[name] for name in ("strain", "energy", "shear_stress"))
    assert np.allclose(strain, 1e-3 * np.arange(1, 61))
    disks = jampetsc.load(last)
    assert result.last.fingerprint == disks.fingerprint
    work = disks.volume * 0.5 * (stress[1:] + stress[:-1]) * 1e-3
    off = np.abs(np.diff(energy) - work) / np.abs(np.diff(energy)).max()
    assert np.median(off) < 1e-3
    state = measure(disks)
    assert state.max_force < 1e-6 * state.pressure * 1.3
    assert state.energy == pytest.approx(energy[-1], rel=1e-9)
    assert state.pressure == pytest.approx(result["pressure"][-1], rel=1e-9)
    assert disks.cell[1, 0] / disks.cell[1, 1] == pytest.approx(0.06)
    assert result["jammed"].all() and (result["nonaffine"] > 0).all()
    facts = result.attributes
    kept = strain > 0.03 * (1 + 1e-12)
    assert facts["pressure_mean"] == pytest.approx(result["pressure"][kept].mean())
    assert facts["energy_cut"] == ENERGY_CUT and facts["discard"] == 0.03


def test_shear_begins_without_stress_from_a_packing_at_a_packing_fraction_that_has_none(session):
    """σ(γ) = G₀ γ from the first step on."""
    packing = jampetsc.pack(n=24, phi=0.9, seed=1, stabilise="shear")
    result = jampetsc.shear(packing, step=1e-6, strain=3e-6, tolerance=1e-12)
    wanted = packing.record["shear_modulus"] * result["strain"]
    np.testing.assert_allclose(result["shear_stress"], wanted, rtol=1e-3)


@pytest.fixture
def jammed(session):
    """48 disks at φ = 0.87 to shear stepwise_shear, and the solver of their quench."""
    from jampetsc.petsc.hessian_solver import NewtonSolver

    return settle(random_start(1.2 * radii_of("bidisperse", 48), 0.87, 1, SOFT), 1e-6), NewtonSolver()


def test_plastic_events_are_the_steps_that_cannot_be_reversed(jammed):
    """A step back restores the energy, except after a plastic event."""
    slow = StepwiseShear(jammed[0], 2e-3, jammed[1], 1e-8)
    elastic, plastic = [], []
    for _ in range(70):
        before, here = slow.minimum if slow.steps else None, slow.disks
        step = slow.advance()
        back = StepwiseShear(slow.disks, -2e-3, jammed[1], 1e-8)
        back.advance()
        loss = back.minimum.energy - measure_minimum(here).energy
        assert before is None or before.energy == pytest.approx(measure_minimum(here).energy, rel=1e-9)
        (plastic if step.plastic else elastic).append(abs(loss) / measure_minimum(here).energy)
    assert len(plastic) >= 3 and len(elastic) > 40
    assert np.median(elastic) < 1e-6 and np.quantile(elastic, 0.95) < 1e-3 < min(plastic)


def test_the_descent_finds_the_minimum_of_a_quench(jammed):
    """Minima of the same energy as L-BFGS and a proof find from the same affine step, in a fifth of the evaluations."""
    disks, solver = jammed
    slow = StepwiseShear(disks, 5e-4, solver, 1e-9)
    cost, same = Effort(), 0
    evaluations = 0
    for _ in range(20):
        affine = deformed(slow.disks, np.zeros((48, 2)), simple_shear(5e-4))
        evaluations += slow.advance().evaluations
        quenched = measure_minimum(minimise(affine, Goal(), solver, tolerance=1e-9, effort=cost).disks)
        same += slow.minimum.energy == pytest.approx(quenched.energy, rel=1e-9)
        assert slow.minimum.contact_number == measure_minimum(slow.disks).contact_number
        assert slow.minimum.shear_stress == pytest.approx(measure_minimum(slow.disks).shear_stress, rel=1e-9)
        state = measure(slow.disks)
        assert state.max_force < 1e-9 * state.pressure * slow.diameter
    assert same >= 18
    assert evaluations < 0.2 * cost.evaluations


def stiffness_matrix(disks):
    """K (2N, 2N) with pre-stress of the load-bearing contacts, dense."""
    contacts, K = measure(disks).contacts, np.zeros((disks.n, 2, disks.n, 2))
    normal, across = (
        np.einsum("ma,mb->mab", a, a) for a in (contacts.normal, *transverse_axes(contacts.normal))
    )
    blocks = contacts.stiffness[:, None, None] * normal - contacts.force_per_length[:, None, None] * across
    for i, j, block in zip(contacts.i, contacts.j, blocks, strict=True):
        for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            K[a, :, b] += sign * block
    return K.reshape(2 * disks.n, -1)


@pytest.mark.parametrize(
    ("n", "phi", "seed", "step", "rows", "tolerance", "left"),
    [
        (16, 0.9, 1, 1e-3, 50, 1e-6, 1),  # a crystal, which keeps its symmetry
        (64, 1.0, 2, 3e-3, 28, 1e-6, 1),
        (36, 0.92, 5, 2e-3, 24, 1e-3, 1),  # loose forces: a saddle that was left is left for good
    ],
)
def test_every_state_of_a_crystal_is_a_minimum(session, n, phi, seed, step, rows, tolerance, left):
    from jampetsc.petsc.hessian_solver import NewtonSolver

    start = settle(random_start(radii_of("monodisperse", n), phi, seed, SOFT), 1e-6)
    slow = StepwiseShear(start, step, NewtonSolver(), tolerance)
    for _ in range(rows):
        done = slow.advance()
        assert np.linalg.eigvalsh(stiffness_matrix(slow.disks))[0] > -1e-8
        assert done.proved or not slow.needs_proof
    assert slow.effort.saddles >= left


def test_disorder_is_proved_only_now_and_then(jammed):
    slow = StepwiseShear(jammed[0], 1e-4, jammed[1], 1e-6)
    assert [slow.advance().proved for _ in range(51)] == [False] * 49 + [True, False]


def test_the_last_state_has_a_proof_of_its_own(session, tmp_path):
    """Not that of the packing it began as; and none where no disks touch."""
    start = jampetsc.pack(n=32, phi=0.88, seed=1)
    assert proved_minimum(start)
    jampetsc.shear(start, step=1e-3, strain=5e-3, last=tmp_path / "last.h5")
    last = jampetsc.load(tmp_path / "last.h5")
    assert proved_minimum(last) and last.fingerprint != start.fingerprint and "pressure" not in last.record
    jampetsc.shear(n=32, phi=0.7, seed=1, step=1e-3, strain=2e-3, last=tmp_path / "loose.h5")
    assert "negative_modes" not in jampetsc.load(tmp_path / "loose.h5").record


def test_disks_are_jammed_by_their_energy_in_units_of_k(jammed):
    """The same disks, stiff or soft, follow the same path."""
    disks, solver = jammed
    found = []
    for k in (1.0, 2.0**-50):
        slow = StepwiseShear(disks.replace(potential=replace(SOFT, k=k)), 5e-4, solver, 1e-6)
        plastic = slow.advance().plastic
        assert slow.minimum.jammed and measure_minimum(slow.disks).jammed and not plastic
        found.append(slow.minimum.energy / k)
    assert found[1] == pytest.approx(found[0], rel=1e-6) and found[0] * 2.0**-50 < 48 * ENERGY_CUT


def test_a_step_begins_with_the_last_displacement_unless_disks_rearranged(jammed):
    """Displacements of a hundredth of a diameter and more are not repeated."""
    disks, solver = jammed
    slow, large = StepwiseShear(disks, 2e-3, solver, 1e-7), 0
    for _ in range(40):
        slow.advance()
        moved = slow.displacement
        longest = np.abs(moved).max()
        assert np.abs(moved.mean(axis=0)).max() < 1e-15
        large += longest >= 0.01 * slow.diameter
        assert np.array_equal(
            slow.last_displacement, moved if longest < 0.01 * slow.diameter else 0.0 * moved
        )
    assert 0 < large < 40


def test_displacements_in_a_quench_are_to_the_nearest_image(jammed, monkeypatch):
    """Disks that leave the cell enter on the other side."""
    monkeypatch.setattr(stepwise_shear, "MAX_STEP_EVALUATIONS", 0)  # every step ends by a quench
    disks, solver = jammed
    disks = minimise(disks, Goal(), solver, tolerance=1e-6).disks
    crossed = 0
    for disk in range(6):
        edge = disks.replace(base=disks.base - disks.base[disk], offset=disks.offset - disks.offset[disk])
        slow = StepwiseShear(edge, 1e-3, solver, 1e-6)
        before = slow.disks.positions
        assert slow.advance().nonaffine < 0.05
        crossed += np.abs(slow.disks.positions - before).max() > 1.0
    assert crossed > 0


def test_all_ways_of_descent_end_in_the_same_minimum(jammed, monkeypatch):
    """With the present factor, with a new one at once, without one for a while, and by a quench."""
    found, costs = [], []
    for constants in (
        {},
        {"MAX_OLD_FACTOR_STEPS": 1},
        {"MAX_OLD_FACTOR_STEPS": 1, "MAX_NEW_FACTOR_STEPS": 2, "DESCENT_TOLERANCE": 1e-9},
        {"MAX_STEP_EVALUATIONS": 0},
    ):
        with monkeypatch.context() as context:
            for name, value in constants.items():
                context.setattr(stepwise_shear, name, value)
            slow = StepwiseShear(*jammed[:1], 2e-4, jammed[1], 1e-9)
            steps = [slow.advance() for _ in range(4)]
            found.append(
                [slow.minimum.energy, slow.minimum.shear_stress, *(step.nonaffine for step in steps)]
            )
            costs.append(sum(step.evaluations for step in steps))
    assert min(costs[2:]) > 3 * max(costs[:2])  # so the ways differ
    assert np.allclose(found[1:], found[0], rtol=1e-6)


def test_means_do_not_depend_on_the_step(session, tmp_path):
    """σ and p with Δγ and Δγ/4, whose trajectories differ after the first event, agree within their errors."""
    runs = (shear(tmp_path / f"{step}.h5", discard=0.5, step=step, strain=2.0) for step in (4e-3, 1e-3))
    whole, fine = (run.attributes for run in runs)
    for name in ("shear_stress", "pressure"):
        error = np.hypot(whole[f"{name}_error"], fine[f"{name}_error"])
        assert abs(whole[f"{name}_mean"] - fine[f"{name}_mean"]) < 4 * error
        assert error < 0.5 * whole[f"{name}_mean"]


def test_disks_below_jamming_have_no_energy(session, tmp_path):
    result = shear(tmp_path / "qs.h5", phi=0.80, step=1e-2, strain=0.2)
    loose = result["jammed"] == 0
    assert loose.any() and (result["energy"][loose] <= 64 * ENERGY_CUT).all()
    assert result.attributes["jammed_mean"] < 1
    assert not result["plastic"][1:][loose[:-1]].any()


def test_a_killed_run_continues_to_the_last_bit(session, tmp_path, monkeypatch):
    whole = shear(tmp_path / "whole.h5", strain=0.07)
    left = stop_after(monkeypatch, 60)  # after one `_restart_list` beside the first
    with pytest.raises(KeyboardInterrupt):
        shear(tmp_path / "out.h5", strain=0.07)
    assert not (tmp_path / "out.h5").exists()
    parts = shear(tmp_path / "out.h5", strain=0.07)
    assert left == [-10] and not (tmp_path / "out.h5.resume").exists()
    for name in ("energy", "shear_stress", "nonaffine", "evaluations"):
        assert np.array_equal(whole[name], parts[name])


def test_a_checkpoint_of_another_tolerance_is_not_used(session, tmp_path, monkeypatch, capsys):
    for more, goes_on in (({}, False), ({"tolerance": 1e-8}, False), ({"tolerance": 1e-8}, True)):
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            stop_after(patch, 1)
            shear(tmp_path / "out.h5", **more, strain=0.003)
        assert ("continues from strain 0.001" in capsys.readouterr().err) == goes_on


@pytest.mark.parametrize(("steps", "lines"), [(3, 3), (120, 50)])
def test_progress_has_fifty_lines_at_most(session, tmp_path, capsys, steps, lines):
    result = shear(tmp_path / "out.h5", strain=steps * 1e-3)
    log = capsys.readouterr().err.splitlines()
    assert len(log) == lines and log[0].startswith("[1/50] strain 0.00")
    assert log[-1] == f"[{lines}/50] strain {steps * 1e-3:.4g}, p {result['pressure'][-1]:.4g}"


@pytest.mark.most_ranks(2)
def test_one_run_is_one_process(session, shared_path):
    """All of several ranks refuse, before a file is made."""
    out = shared_path / "s.h5"
    line = f"shear --n 16 --phi 0.5 --step 0.01 --strain 0.01 --out {out}".split()
    if session.size == 1:
        assert cli.dispatch(line) == 0 and out.exists()
    else:
        with pytest.raises(
            InputError, match=f"^shear: started on {session.size} ranks, but one run is one process"
        ):
            cli.dispatch(line)
        assert not out.exists()


def test_a_path_of_minima_is_resumed_from_what_it_saves(jammed, monkeypatch):
    monkeypatch.setattr(stepwise_shear, "SAVE_INTERVAL", -1.0)  # after every step
    disks, solver = jammed
    saved = []
    whole = shear_stepwise(
        disks, 1e-3, 4, solver, 1e-7, save=lambda series, state: saved.append((series.arrays(), state))
    )
    assert [len(arrays["strain"]) for arrays, _ in saved] == [1, 2, 3, 4]
    series = StrainSeries(PATH_COLUMNS)
    series.restore(saved[1][0])
    parts = shear_stepwise(disks, 1e-3, 4, solver, 1e-7, resume=(series, saved[1][1]))
    assert len(series) == 2 and parts.disks.fingerprint == whole.disks.fingerprint
    for name, values in whole.series.arrays().items():
        assert np.array_equal(parts.series.column(name), values), name
    assert parts.averages["pressure"].mean == whole.averages["pressure"].mean


def test_where_a_contact_is_too_weak_for_a_proof_disks_are_shaken(session, monkeypatch):
    """Proofs leave out what bears less than a share of p d, here so large that a step from some packing has none."""

    def step_from(disks, shakes):
        sheared = StepwiseShear(disks, 1e-6, NewtonSolver(), 1e-8)
        sheared.needs_proof = True
        with monkeypatch.context() as patch:
            patch.setattr(contacts, "MIN_FORCE_RATIO", 0.03)
            patch.setattr(warm_start, "is_minimum", lambda *_: False)
            patch.setattr(stepwise_shear, "MAX_SHAKES", shakes)
            sheared.advance()
        return sheared

    for seed in range(50, 60):
        disks = jampetsc.pack(n=16, pressure=1e-3, seed=seed)
        try:
            step_from(disks, 0)
        except ConvergenceError:
            break
    sheared = step_from(disks, stepwise_shear.MAX_SHAKES)
    state = measure(sheared.disks)
    assert sheared.effort.shakes > 0 and sheared.steps == 1 and state.max_force <= 1e-8 * state.pressure
