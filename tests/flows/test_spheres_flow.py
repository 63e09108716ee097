"""Flows of spheres: forces across domains, runs that are resumed, the command."""

import numpy as np
import pytest
from dense import all_pairs
from sheared import ROWS, forces, spheres

import jampetsc as jp
from jampetsc import models
from jampetsc.errors import InputError
from jampetsc.flows.flow_run import define_flow, run_flow
from jampetsc.flows.steady_shear import SteadyShear
from jampetsc.io.disk_motion import six_fold_order
from jampetsc.laws.damping import Law
from jampetsc.laws.flow_models import Model, Scheme
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import Contacts
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential
from jampetsc.packing.threads import Team

ROLLING = Law("rolling", normal=1.0, transverse=0.2, sliding=0.7)


def test_forces_of_several_domains_and_on_two_threads():
    """Of blocks of pairs within and across domains, against sums over contacts; steps are the same to the last bit."""
    rng, n = np.random.default_rng(1), 4200
    cell = 16.0 * np.array([[1.0, 0.0, 0.0], [0.3, 1.0, 0.0], [-0.2, 0.1, 1.0]])
    places = rng.random((n, 3)) @ cell
    disks = Packing.from_positions(places, radii_of("bidisperse", n), cell, Potential("hertzian"))
    runs = [
        SteadyShear(disks, Model(ROLLING, 2.0), 0.1, Scheme(1e-3, "verlet", 1e-6), team)
        for team in (None, Team(2))
    ]
    run = runs[0]
    assert run.lists[0].number == 2
    u, spins, torques = rng.normal(size=(3, n, 3))
    found = run.residual(u, (spins, run.reference.radii, torques))
    elastic, viscous, turned, *_ = forces(run.reference, ROLLING, 0.1, u, spins)
    wanted = elastic + viscous
    wanted[:, 0] -= 2.0 * 0.1 * u[:, 1]
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    np.testing.assert_allclose(torques, turned, rtol=0, atol=1e-12 * np.abs(turned).max())
    for one in runs:
        one.advance(6)
    assert np.array_equal(runs[0].velocities, runs[1].velocities) and np.array_equal(
        runs[0].spins, runs[1].spins
    )


@pytest.mark.parametrize("exponent", [2.0, 2.25, 2.5, 4.0])
def test_forces_of_all_models_are_sums_over_all_pairs(exponent):
    """m u̇ and torques of every model and law, with velocities and spins, against all pairs and images in turn."""
    disks, rate, rng = spheres(20, phi=0.8, exponent=exponent), 0.1, np.random.default_rng(3)
    u, spins, torques = rng.normal(size=(3, disks.n, 3))
    i, j, r = all_pairs(disks.positions, disks.radii, disks.cell)
    r, law = r.astype(float), disks.potential
    distance, sigma = np.linalg.norm(r, axis=1), disks.radii[i] + disks.radii[j]
    force = law.k / sigma * ((sigma - distance) / sigma) ** (law.exponent - 1.0)
    overlap = sigma - distance
    pairs = Contacts(i, j, r, distance, force, law.contact_stiffness(overlap, sigma), overlap, sigma)
    assert len(i) > 3 * disks.n
    for name, (damping, mass) in ROWS.items():
        run = SteadyShear(
            disks, Model(damping, mass), rate, Scheme(1e-3, "verlet" if mass else "euler", 1e-6)
        )
        order = matching(run.reference, disks)
        rolling = (spins[order], run.reference.radii, torques) if damping.sliding else None
        found = run.residual(u[order], rolling)
        elastic, viscous, turned, *_ = forces(disks, damping, rate, u, spins, pairs)
        wanted = elastic + viscous - law.k * damping.tau1 * damping.drag * u
        wanted[:, 0] -= mass * rate * u[:, 1]
        np.testing.assert_allclose(
            found, wanted[order], rtol=0, atol=1e-12 * np.abs(wanted).max(), err_msg=name
        )
        if rolling:
            np.testing.assert_allclose(torques, turned[order], atol=1e-12 * np.abs(turned).max())


def matching(sorted_disks, disks):
    """For each of the sorted disks the number that it had."""
    return np.argmin(np.abs(sorted_disks.positions[:, None] - disks.folded().positions).sum(axis=2), axis=1)


@pytest.mark.parametrize(("law", "mass"), [(models.CD0().law, 0.0), (ROLLING, 1.0)])
def test_a_run_is_resumed_to_the_last_bit(monkeypatch, law, mass):
    """From any state that is saved, across sorts and new lists."""
    monkeypatch.setattr("jampetsc.flows.flow_run.SAVE_INTERVAL", -1.0)
    run = define_flow(spheres(32), Model(law, mass), 1e-2, 0.6, snapshots=3)
    saved = []
    whole = run_flow(run, save=lambda trajectory, state: saved.append((trajectory.copy(), state)))
    resumed = run_flow(run, resume=saved[len(saved) // 2])
    assert resumed.disks.fingerprint == whole.disks.fingerprint
    for name, array in whole.trajectory.arrays().items():
        assert np.array_equal(resumed.trajectory.arrays()[name], array), name
    assert whole.disks.dimension == 3 and ("snapshots/spins" in whole.trajectory.arrays()) == bool(mass)


def test_the_command(tmp_path):
    options = {"dimension": 3, "n": 24, "phi": 0.66, "rate": 1e-2, "strain": 0.3}
    flow = jp.flow(model=models.CD0(), snapshots=4, last=tmp_path / "last.h5", **options)
    assert flow.attributes["phi"] == pytest.approx(0.66) and flow.attributes["dimension"] == 3
    assert jp.load(tmp_path / "last.h5").dimension == 3 and flow.snapshot(0).velocities.shape == (24, 3)
    u = flow["snapshots/velocities"][-1]
    assert np.abs(u[:, 2]).max() > 1e-4 and np.abs(u.mean(0)).max() < 1e-12
    assert len(jp.flow(flow, strain=0.1)["strain"]) > len(flow["strain"])
    with pytest.raises(InputError, match="spheres, and six-fold order is of disks in a plane"):
        six_fold_order(flow)
