"""Sizes in ratios up to 1 : 100: what was scaled by a mean diameter is right for the largest and the smallest."""

import numpy as np
import pytest

import jampetsc
from jampetsc import models
from jampetsc.errors import ConvergenceError
from jampetsc.laws.flow_models import scheme_for
from jampetsc.minimisation import minimise
from jampetsc.minimisation.descent import Descent, Goal
from jampetsc.minimisation.hessian import Bonds, Pattern
from jampetsc.minimisation.newton import BOND_FORCE_FLOOR, FORCE_FLOOR, Limits, Point
from jampetsc.minimisation.size_laws import radii_of
from jampetsc.packing.contacts import FORCE_ROUNDING, force_threshold
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.packing import Packing, proved_minimum
from jampetsc.packing.potentials import Potential

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]

FEW_LARGE = np.r_[[50.0] * 4, [0.5] * 76]  # 1 : 100
MANY_SMALL = np.r_[[8.0] * 4, [0.5] * 60]
LISTS = {
    "few large": FEW_LARGE,
    "many small": MANY_SMALL,
    "half": np.r_[[0.5] * 16, [50.0] * 16],
    "log-normal": radii_of("lognormal:1", 48),
    "power law": radii_of("powerlaw:2:30", 48),
    "steep power law": radii_of("powerlaw:3:100", 48),
}


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", LISTS)
def test_packings_of_wide_sizes(session, name, dimension):
    """Proved minima at rest to the tolerance or to rounding."""
    for pressure in (1e-2, 1e-6) if name == "log-normal" else (1e-5,):
        disks = jampetsc.pack(radii=LISTS[name], pressure=pressure, dimension=dimension)
        assert proved_minimum(disks) and disks.pressure == pytest.approx(pressure, rel=1e-5)
        descent = Descent(disks, Goal(pressure))
        point = Point.of(descent)
        assert point.residual.within(Limits(descent, 1e-10).at(point))


def test_rounding_does_not_choose_the_minimum(session):
    """The packing is that of a tolerance above rounding."""
    how = {"radii": FEW_LARGE, "pressure": 1e-5}
    fine, coarse = jampetsc.pack(**how), jampetsc.pack(**how, tolerance=1e-8)
    assert fine.phi == pytest.approx(coarse.phi, rel=1e-7)
    assert fine.record["limited_by"] == "rounding" and coarse.record["limited_by"] == "tolerance"


@pytest.mark.parametrize("stiffness", ["constant", "inverse-square-diameter"])
def test_the_floor_of_forces_is_that_of_the_bonds(stiffness):
    """√Σ (k r)² of the disk with most; of like sizes the number of a mean bond, as it always was."""
    k, bonds = 3.0, 24
    angles = 2.0 * np.pi * np.arange(bonds) / bonds
    around = 9.9 * np.column_stack((np.cos(angles), np.sin(angles)))
    places, radii = np.vstack((np.zeros(2), around)) + 20.0, np.r_[9.0, np.full(bonds, 1.0)]
    law = Potential("harmonic", stiffness, k)
    descent = Descent(Packing.from_positions(places, radii, 40.0 * np.eye(2), law), Goal())
    scale = 10.0 if stiffness == "inverse-square-diameter" else 1.0
    floor = Limits(descent, 1e-20).at(Point.of(descent), 1e-9).force
    usual = FORCE_FLOOR * descent.usual_stiffness(1e-9) * descent.diameter
    assert floor == pytest.approx(max(BOND_FORCE_FLOOR * np.sqrt(bonds) * 9.9 * k / scale**2, usual))
    alike = Descent(
        jampetsc.Packing(places, np.full(len(radii), 1.0), 40.0, stiffness=stiffness, k=k), Goal()
    )
    usual = FORCE_FLOOR * alike.usual_stiffness(1e-9) * 2.0
    assert Limits(alike, 1e-20).at(Point.of(alike), 1e-9).force == usual


def test_forces_of_rounding_are_those_of_the_longest_or_stiffest_contact():
    for radii, stiffness, unit in (
        ([0.5] * 10, "constant", 1.0),
        ([0.5] * 9 + [50.0], "constant", 50.0),
        ([0.5] * 9 + [0.005], "inverse-square-diameter", 50.0),
    ):
        places = np.column_stack((200.0 * np.arange(10), np.zeros(10)))
        disks = Packing.from_positions(
            places, radii, 2000.0 * np.eye(2), Potential("harmonic", stiffness, 2.0)
        )
        assert force_threshold(disks, 0.0) == pytest.approx(2.0 * FORCE_ROUNDING * unit)


def test_no_minimum_where_nothing_touches_is_an_error_in_words(monkeypatch):
    monkeypatch.setattr(minimise, "MAX_EVALUATIONS", 1)
    monkeypatch.setattr(minimise, "SLICE", 2)
    places = np.column_stack((2.0 * np.arange(16), np.zeros(16)))
    disks = Packing.from_positions(places, np.full(16, 0.5), 32.0 * np.eye(2))
    with pytest.raises(
        ConvergenceError, match=r"^no minimum after 2 force evaluations and 0 saddles: p = 0$"
    ):
        minimise.relax(disks, Goal(1e-3), 1e-9)


def stiffest_mode(disks):
    """Largest eigenvalue of the Hessian, by numpy."""
    pairs = NeighbourList.build(disks, 0.0)
    pattern = Pattern(pairs, disks.n, disks.dimension)
    values = pattern.fill(Bonds.of(pairs, disks.potential), np.ones(disks.n, bool))
    size = disks.n * disks.dimension
    dense = np.zeros((size, size))
    for row in range(size):
        part = slice(pattern.indptr[row], pattern.indptr[row + 1])
        dense[row, pattern.indices[part]] = dense[pattern.indices[part], row] = values[part]
    return np.linalg.eigvalsh(dense)[-1]


@pytest.fixture(scope="module", params=[2, 3])
def packing(request):
    return jampetsc.pack(radii=MANY_SMALL, pressure=1e-2, tolerance=1e-6, dimension=request.param)


def test_time_steps_are_stable_for_the_largest_particles(session, packing):
    """Of an explicit step under drag, and of velocity Verlet with a small drag."""
    highest = stiffest_mode(packing)
    assert scheme_for(models.RD0(), packing, 1e-6).step * highest < 2.0
    verlet = scheme_for(models.RD(mass=100.0), packing, 1e-6)
    assert verlet.method == "verlet" and verlet.step * np.sqrt(highest / 100.0) < 2.0


@pytest.mark.parametrize(("model", "rate"), [("RD0", 1e-3), ("CD0", 1e-3), (models.CDn(mass=1.0), 1e-2)])
def test_flows_of_wide_sizes_keep_their_energy_balance(session, packing, model, rate):
    """They raise an error where they do not."""
    result = jampetsc.flow(packing, model=model, rate=rate, strain=0.1)
    assert result.attributes["pressure_mean"] > 0.0 and np.isfinite(result.attributes["energy_balance"])


def test_a_list_serves_the_shear_of_long_steps(session):
    """One step of a large particle's shear is more than the skin of the first list."""
    result = jampetsc.flow(
        radii=np.r_[[50.0] * 3, [0.5] * 61], phi=0.5, model="RD0", rate=1.0, step=0.05, strain=0.5
    )
    assert result["strain"][-1] == pytest.approx(0.5)


@pytest.mark.parametrize("dimension", [2, 3])
def test_shear_and_sweep_of_wide_sizes(session, dimension):
    disks = jampetsc.pack(radii=LISTS["log-normal"], pressure=1e-3, dimension=dimension, stabilise="shear")
    sheared = jampetsc.shear(disks, step=1e-4, strain=1e-3)
    assert sheared["pressure"][0] == pytest.approx(1e-3, rel=0.05)
    sweep = jampetsc.sweep(disks, accuracy=1e-4, omega=[1e-3, 1.0])
    assert sweep.G.real.min() > 0.0 and sweep.error_bound.max() < 1e-4 * abs(sweep.G).max()
