"""The same physics told otherwise: another cell of the same lattice, other units, two copies side by side."""

from dataclasses import replace

import numpy as np
import pytest
import samples
from dense import Reference

import jampetsc
from jampetsc import models
from jampetsc.commands import describe
from jampetsc.errors import InputError
from jampetsc.packing.packing import Packing

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]
TOLD = {  # length, k, τ₁ and how often a1 is added to a2
    "a2 - 9 a1, lengths x 1e3": (1e3, 1.0, 1.0, -9),
    "k x 1e6, lengths x 1e-3, tau1 x 1e3": (1e-3, 1e6, 1e3, 0),
}


def told(length=1.0, k=1.0, turns=0):
    """The published packing in these units and this cell."""
    disks = samples.published()
    cell = disks.cell + turns * np.array([[0.0, 0.0], disks.cell[0]])
    potential = replace(disks.potential, k=k)
    return Packing.from_positions(length * disks.positions, length * disks.radii, length * cell, potential)


def answers(length=1.0, k=1.0, tau1=1.0, turns=0):
    """What the commands find, without units: lengths over `length`, stresses and stiffnesses over k, times over τ₁."""
    disks, law = told(length, k, turns), jampetsc.ContactDamping(tau1=tau1)
    omega = np.array([1e-4, 1e-2, 1.0]) / tau1
    sweep = jampetsc.sweep(disks, omega=omega, fields=omega[1:], law=law)
    slow = jampetsc.quasistatic(disks, law=law)
    modes = jampetsc.modes(disks, count=5)
    turned = jampetsc.oscillate(disks, omega=0.01 / tau1, stress=1e-6 * k, alpha=0.7, steps=16, law=law)
    moved = jampetsc.oscillate(
        disks, omega=0.1 / tau1, strain=1e-3, contacts="moving", steps=16, cycles=3, law=law
    )
    flow = jampetsc.flow(
        disks, model=models.CD0(tau1=tau1), rate=0.01 / tau1, strain=0.1, discard=0, snapshots=5
    )
    lanes, along = jampetsc.correlate(sweep, lane=2), jampetsc.correlate(flow)
    return {
        "G": sweep.G / k,
        "field": sweep["fields/displacement"] / length,
        "moduli": [slow.attributes[name] / k for name in ("G0", "bulk_modulus")],
        "viscosities": [slow.attributes[name] / (k * tau1) for name in ("eta0", "eta_inf")],
        "nonaffine": slow["nonaffine"] / length,
        "eigenvalues": modes["eigenvalues"] / k,
        "oscillation": turned["G"] / k,
        "moving": moved["G"] / k,
        "stress": flow["shear_stress"] / k,
        "pressure": flow["pressure"] / k,
        "dissipation": flow["dissipation"] / (k * length**2) * tau1,
        "velocities": flow["snapshots/velocities"] / length * tau1,
        "C": lanes["C"],
        "delta": lanes["delta"] / length,
        "lane": lanes["lane_width"] / length,
        "g_y": along["g_y"],
        "x": along["x"] / length,
    }


@pytest.fixture(scope="module")
def usual():
    return answers()


@pytest.mark.parametrize("way", TOLD)
def test_results_without_units_stay(session, way, usual):
    length, k, tau1, turns = TOLD[way]
    for name, found in answers(length, k, tau1, turns).items():
        size = np.nanmax(np.abs(usual[name]))
        np.testing.assert_allclose(found, usual[name], rtol=1e-6, atol=1e-7 * size, err_msg=name)


@pytest.mark.parametrize("dimension", [2, 3])
def test_lanes_along_y_are_those_along_x_of_the_mirror_image(session, dimension):
    """Exchanging x and y changes simple shear by a rotation alone, to which normal damping has no force."""
    disks = jampetsc.pack(n=24, dimension=dimension, pressure=1e-2, seed=3)
    order = [1, 0, 2][:dimension]
    potential = replace(disks.potential, k=2.0)
    disks, mirrored = (
        Packing.from_positions(
            0.5 * disks.positions[:, axes],
            0.5 * disks.radii,
            0.5 * disks.cell[np.ix_(axes, axes)],
            potential,
        )
        for axes in (range(dimension), order)
    )
    sweep, image = (
        jampetsc.sweep(some, omega=[0.1], fields=[0.1], law=jampetsc.ContactDamping(beta=0.0))
        for some in (disks, mirrored)
    )
    for axes in (("y", "x"), ("x", "y"), ("both", "both")):
        found, expected = (
            jampetsc.correlate(some, lane=2, phase="strain", along=axis)
            for some, axis in zip((sweep, image), axes, strict=True)
        )
        assert found.attributes["along"] == axes[0]
        np.testing.assert_allclose(found["C"], expected["C"], atol=1e-6)
    single = [jampetsc.correlate(sweep, lane=2, along=axis) for axis in "xy"]
    pairs = [result.attributes["pairs"] for result in single]
    assert found.attributes["pairs"] == sum(pairs)


def test_lanes_along_y_close_in_square_cells_alone(session):
    disks = jampetsc.pack(n=24, pressure=1e-2, seed=3)
    twice = np.concatenate((disks.positions, disks.positions + disks.cell[1]))
    high = Packing.from_positions(twice, np.tile(disks.radii, 2), np.diag([1.0, 2.0]) @ disks.cell)
    for message, some in {"tilted": told(turns=1), "must be equal": high}.items():
        sweep = jampetsc.sweep(some, omega=0.1, fields=0.1)
        with pytest.raises(InputError, match=f"{message}.* Choose lanes along x"):
            jampetsc.correlate(sweep, lane=2, along="both")


def test_an_emulsion_in_metres_pascals_and_seconds(session):
    """docs/howto/physical_units.md: spheres of 10 µm, k = 10 mN/m, water: stresses in k/d, viscosities in k τ₁/d."""
    d, k, water = 1e-5, 1e-2, 1e-3
    tau1 = 3 * np.pi * water * d / k
    unit = jampetsc.pack(dimension=3, n=16, pressure=1e-2, seed=1, stabilise="shear")
    drops = Packing(d * unit.positions, d * unit.radii, d * unit.cell, k=k)
    assert drops.pressure == pytest.approx(1e-2 * k / d)
    omega = np.array([1e-5, 1e-2, 10.0])
    usual = jampetsc.sweep(unit, jampetsc.StokesDrag(eta_f=water / (k * tau1) * d), omega=omega)
    metric = jampetsc.sweep(
        drops, jampetsc.StokesDrag(eta_f=water / (k * tau1), tau1=tau1), omega=omega / tau1
    )
    np.testing.assert_allclose(metric.G, usual.G * k / d, rtol=1e-9)
    fluid = jampetsc.sweep(drops, jampetsc.StokesDrag(eta_f=0.0, tau1=tau1), omega=omega / tau1)
    np.testing.assert_allclose((metric.G - fluid.G).imag, water * omega / tau1, rtol=1e-9)


def test_another_cell_of_the_lattice_is_described_alike():
    """But for its vectors, and what is zero to rounding."""

    def told_of(turns):
        lines = describe.describe_packing("p.h5", told(turns=turns)).splitlines()
        return [line for line in lines if not line.strip().startswith(("cell", "max |F|", "stress σ_xy"))]

    assert len(told_of(0)) > 8 and told_of(-9) == told_of(0)


def beside_itself(disks):
    """Two copies in a cell twice as wide."""
    cell = disks.cell
    twice = np.vstack((disks.positions, disks.positions + cell[0]))
    return Packing.from_positions(twice, np.tile(disks.radii, 2), [2.0 * cell[0], cell[1]], disks.potential)


def test_two_copies_of_a_minimum_may_be_none(session, capfd):
    """They may move against each other, u(x + a1) = −u(x), which one cell cannot; uniform strain does not make them."""
    disks, law = samples.polydisperse(3)[0], samples.physics(rotations=False)
    twice = beside_itself(disks)
    exact = Reference(twice, law)
    modes, vectors = np.linalg.eigh(exact.K[:-1, :-1].astype(float))
    assert modes[0] < -1e-3 and modes[1] > -1e-12, modes[:4]
    moved = np.zeros((twice.n, 2))
    moved[exact.disks] = vectors[:, 0].reshape(len(exact.disks), -1)[:, :2]
    np.testing.assert_allclose(moved[disks.n :], -moved[: disks.n], atol=1e-9)

    words = {"omega": [1e-4, 0.1], "law": law.law}
    one, two = jampetsc.sweep(disks, **words), jampetsc.sweep(twice, **words)
    assert np.all(np.abs(two.G - one.G) <= one.error_bound + two.error_bound)
    np.testing.assert_allclose(two.error_bound / np.abs(two.G), 0.0, atol=1e-6)
    assert one.attributes["positive_semidefinite"].startswith("proved")
    assert two.attributes["positive_semidefinite"].startswith(
        "no: 1 negative modes; error_bound is an estimate"
    )
    assert jampetsc.quasistatic(disks).attributes["G0"] == pytest.approx(one.G[0].real, rel=1e-3)
    for refused in (lambda: jampetsc.quasistatic(twice), lambda: jampetsc.modes(twice, count=2)):
        with pytest.raises(InputError, match=r"K has 1 negative mode: not a minimum of the energy"):
            refused()
