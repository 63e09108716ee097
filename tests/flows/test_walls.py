"""Flow between sliding rough walls: rigid rows, dense numpy, the balance of momentum and energy, and the command."""

import numpy as np
import pytest
from sheared import ROWS

import jampetsc
from jampetsc import main as cli
from jampetsc.analysis.correlated_series import layer_heights, mean_profile
from jampetsc.errors import InputError
from jampetsc.flows import walls
from jampetsc.flows.steady_shear import SteadyShear
from jampetsc.flows.walls import (
    LAYERS,
    between_walls,
    phi_between,
    stress_on_walls,
    velocity_profile,
    wall_columns,
)
from jampetsc.io.disk_motion import velocity_profiles
from jampetsc.laws.flow_models import Model, Scheme
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.kernel import bond_forces
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import simple_shear
from papers.claims.flow import middle_share

SOFT = Potential("harmonic", "inverse-square-diameter")


@pytest.fixture(scope="module")
def channel():
    return between_walls(1.2 * radii_of("bidisperse", 64), 0.86, 3, SOFT)


def shear(name, channel, rate=0.02, step=0.05):
    law, mass = ROWS[name]
    disks, held = channel
    return SteadyShear(
        disks, Model(law, mass), rate, Scheme(step, "verlet" if mass else "euler", 1e-12), wall_disks=held
    )


def test_the_start(channel):
    disks, held = channel
    assert disks.n - held == 64 and phi_between(disks, held) == pytest.approx(0.86, rel=1e-12)
    y = disks.positions[:, 1]
    height = disks.cell[1, 1]
    assert 0.7 < disks.cell[0, 0] / height < 1.4
    assert np.abs(y[:held] - height * np.round(y[:held] / height)).max() < 1e-12
    contacts = find_contacts(disks)
    assert (contacts.overlap / contacts.sigma).max() < 0.3
    assert not ((contacts.i < held) & (contacts.j < held)).any()
    assert len(set(np.round(disks.radii[:held], 12))) == 2  # rough


@pytest.mark.parametrize("name", ["RD0", "CD0", "rolling"])
def test_walls_are_rigid_and_move_with_the_affine_flow(channel, name):
    run = shear(name, channel)
    disks, held = channel
    row = disks.positions[:held]
    run.advance(700)  # to strain 0.7: the cell is folded
    assert run.rebuilds > 1
    now = run.disks.positions[:held]
    # relative positions within the row, images aside
    apart = (now - now[0] - (row - row[0])) @ np.linalg.inv(run.disks.cell)
    assert np.abs(apart - np.round(apart)).max() < 1e-12
    assert (run.nonaffine_velocities()[:held] == 0).all() and (run.spins[:held] == 0).all()
    assert np.abs(run.nonaffine_velocities()[held:]).max() > 0
    heights = run.disks.positions[held:, 1]
    assert 0.3 < heights.min() and heights.max() < disks.cell[1, 1] - 0.3  # nothing went through


@pytest.mark.parametrize("name", ROWS)
def test_forces_on_the_walls_balance_those_between_them(channel, name):
    """σ_w = σ + Σ y F_x/V with y from the middle: without mass and drag F = 0 and σ_w = σ."""
    run = shear(name, channel)
    run.advance(300)
    u, forces, held = run.nonaffine_velocities(), np.empty_like(run.offsets), run.wall_disks
    rolling = None
    if run.model.law.couples_rotations:
        rolling = run.spins, run.reference.radii, np.empty(len(run.spins))
    task = run.step_constants()
    sums = bond_forces(
        run.pairs,
        run.offsets,
        simple_shear(run.shear),
        task.potential,
        forces,
        (u, task.rate, task.weights),
        rolling,
    )
    disks = run.disks
    y = (disks.positions[:, 1] - 0.5 * disks.cell[1, 1])[held:]
    bulk = -(sums.elastic_xy + sums.viscous_xy) / disks.volume
    bulk_yy = (sums.elastic_yy + sums.viscous_yy) / disks.volume
    stress, pressure = stress_on_walls(run, u)
    assert stress == pytest.approx(bulk + y @ forces[held:, 0] / disks.volume, rel=1e-11)
    assert pressure == pytest.approx(bulk_yy - y @ forces[held:, 1] / disks.volume, rel=1e-11)
    if name in ("CD0", "unequal"):
        assert stress == pytest.approx(bulk, rel=1e-8) and pressure == pytest.approx(bulk_yy, rel=1e-8)
    else:
        assert abs(stress / bulk - 1) > 1e-4


def test_a_prescribed_flow_has_its_profile(channel):
    run = shear("CD0", channel)
    run.advance(30)
    y = run.disks.positions[:, 1] / run.disks.cell[1, 1] - 0.5
    unit, u = run.rate * run.disks.cell[1, 1], np.zeros_like(run.offsets)
    layer = (LAYERS * (y[run.wall_disks :] + 0.5)).astype(int)
    filled = np.unique(layer)  # some layers beside the walls have none of the 64 disks
    assert len(filled) > 10
    linear = velocity_profile(run, u)  # u = 0: affine flow
    assert np.array_equal(np.isfinite(linear), np.isin(np.arange(LAYERS), filled))
    assert linear[filled] == pytest.approx(layer_heights(LAYERS)[filled], abs=0.5 / LAYERS)
    u[:, 0] = unit * (0.7 * np.sin(np.pi * y) ** 3 - y)  # a v_x of the test
    wanted = [np.mean(0.7 * np.sin(np.pi * y[run.wall_disks :][layer == one]) ** 3) for one in filled]
    assert velocity_profile(run, u)[filled] == pytest.approx(np.array(wanted), abs=1e-12)


@pytest.mark.parametrize("name", ["RD0", "CD", "RD"])
def test_disks_with_a_mass_are_at_rest_when_walls_begin_to_slide(channel, name):
    profile = wall_columns(shear(name, channel))["velocity_profile"]
    wanted = pytest.approx(1.0, abs=0.1) if name == "RD0" else pytest.approx(0.0, abs=1e-12)
    assert middle_share(np.nan_to_num(profile)) == wanted


def test_the_mean_stress_on_walls_is_that_of_the_bulk():
    """With mass: σ with its kinetic part, within the errors."""
    run = shear("CD", between_walls(1.2 * radii_of("bidisperse", 16), 0.84, 1, SOFT), rate=0.05, step=0.1)
    run.advance(200)
    walls, bulk = [], []
    for _ in range(400):
        run.tally[:] = 0
        run.advance(5)
        bulk.append(-(run.tally[0] + run.tally[2] + run.tally[4]) / 5 / run.disks.volume)
        walls.append(stress_on_walls(run, run.nonaffine_velocities())[0])
    blocks = (np.array(walls) - np.array(bulk)).reshape(10, -1).mean(1)
    assert abs(blocks.mean()) < 4 * blocks.std(ddof=1) / np.sqrt(10)
    assert abs(blocks.mean()) < 0.05 * np.mean(bulk)


def test_rows_that_leave_no_room():
    with pytest.raises(InputError, match="leave no room for a disk of diameter 12"):
        between_walls(np.r_[np.full(30, 0.5), 6.0], 0.8, 2, SOFT)
    with pytest.raises(InputError, match=r"rows of disks 4.9 apart, .* no room for a disk of diameter 2.8"):
        between_walls(np.array([0.4, 0.4, 1.4, 1.4]), 0.86, 0, SOFT)  # the largest of the row counts, too


def run(*words):
    return cli.main([str(word) for word in words])


def test_the_command(tmp_path, capsys):
    out, last = tmp_path / "w.h5", tmp_path / "last.h5"
    words = "flow --n 32 --phi 0.86 --walls --model CD0 --rate 3e-2 --tolerance 1e-8 --snapshots 2".split()
    assert run(*words, "--strain", 0.4, "--discard", 0.1, "--out", out, "--last", last) == 0
    assert "on the walls: sigma = " in capsys.readouterr().out
    result = jampetsc.load(out)
    facts, walls = result.attributes, int(result.attributes["walls"])
    assert facts["particle_count"] == 32 and facts["phi"] == pytest.approx(0.86)
    assert result["snapshots/positions"].shape == (2, 32 + walls, 2)
    assert (result["snapshots/velocities"][:, :walls] == 0).all()
    assert jampetsc.load(last).n == 32 + walls
    kept = result["strain"] > 0.1 * (1 + 1e-12)
    assert facts["wall_shear_stress_mean"] == pytest.approx(result["wall_shear_stress"][kept].mean())
    assert facts["wall_pressure_mean"] == pytest.approx(result["wall_pressure"][kept].mean())
    assert facts["wall_shear_stress_mean"] == pytest.approx(facts["shear_stress_mean"], rel=0.05)
    # continues with its walls; earlier rows stay as they are, to the last bit
    names = ("shear_stress", "wall_shear_stress", "wall_pressure", "velocity_profile")
    before = {name: result[name] for name in names}
    assert run("flow", out, "--strain", 0.2) == 0
    farther = jampetsc.load(out)
    assert farther["strain"][-1] == pytest.approx(0.6, rel=0.02) and farther.attributes["walls"] == walls
    kept = {name: farther[name][: len(before[name])] for name in names}
    assert all(np.array_equal(kept[name], before[name], equal_nan=True) for name in names)
    on_walls, between = (farther.attributes[f"{name}_mean"] for name in ("wall_shear_stress", "shear_stress"))
    assert on_walls == pytest.approx(between, rel=0.05)
    assert run("plot", out, "--kind", "snapshot", "--out", tmp_path / "w.png") == 0
    assert "32 disks" in capsys.readouterr().out
    assert run("plot", out, "--kind", "profile", "--out", tmp_path / "v.png") == 0
    assert "velocity between walls of 1 run in windows" in capsys.readouterr().out
    v, error = mean_profile(velocity_profiles([farther], 0.3, 0.6))
    assert np.nanmax(np.abs(v - layer_heights(LAYERS))) < 0.1 and np.nanmin(error) > 0
    assert run("correlate", out, "--out", tmp_path / "g.h5") == 2
    assert "not homogeneous" in capsys.readouterr().err
    assert run("flow", last, "--walls", *words[6:10], "--strain", 1, "--out", tmp_path / "x.h5") == 2
    assert "--walls: fixed by" in capsys.readouterr().err


def test_the_start_between_walls_does_not_depend_on_stiffness():
    starts = [between_walls(1.2 * radii_of("bidisperse", 16), 0.86, 3, Potential(k=k))[0] for k in (1.0, 4.0)]
    np.testing.assert_allclose(starts[0].positions, starts[1].positions, rtol=0, atol=1e-9)


def test_disks_start_between_the_rows(monkeypatch):
    """Whole disks, over the whole height between rows; gaps in a row are a twentieth of the diameters."""
    monkeypatch.setattr(walls, "SETTLING", (0, 0.05))
    radii = 1.2 * radii_of("bidisperse", 200)
    disks, held = between_walls(radii, 0.86, 1, SOFT)
    y, height = disks.positions[held:, 1], disks.cell[1, 1]
    above, below = y - disks.radii[held:], height - disks.radii[held:] - y
    assert 0 <= above.min() < 0.1 and 0 <= below.min() < 0.1
    row = disks.radii[:held]
    np.testing.assert_allclose(np.diff(disks.positions[:held, 0]), 1.05 * (row[1:] + row[:-1]))
    assert disks.cell[0, 0] == pytest.approx(2.1 * row.sum())
    assert np.array_equal(np.sort(disks.radii[held:]), np.sort(radii))
