"""Numbers are absolute: other units of length, force and time scale all inputs and all outputs by the same factors."""

import re
from functools import cache

import numpy as np
import pytest
import samples
from spheres import few_spheres

import jampetsc
from jampetsc.errors import InputError
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]
LENGTH, FORCE, TIME = 3.0, 7.0, 0.2  # factors of the other units
KINDS = [("constant", 2), ("inverse-square-diameter", 2), ("constant", 3)]


class Factors:
    """Factors of numbers in the other units, by stiffness convention and dimension."""

    def __init__(self, stiffness, dimension):
        self.stress = FORCE / LENGTH ** (dimension - 1)
        self.k = FORCE / LENGTH if stiffness == "constant" else FORCE * LENGTH
        self.tau1 = FORCE * TIME / LENGTH / self.k  # kτ₁ is a force over a velocity
        self.mass, self.energy = FORCE * TIME**2 / LENGTH, FORCE * LENGTH


@cache
def both(stiffness, dimension):
    """(a packing at rest, the same one in the other units, their factors)."""
    disks = samples.published() if dimension == 2 else few_spheres()
    if stiffness != "constant":
        disks = disks.replace(potential=Potential("harmonic", stiffness), record={})
        disks = jampetsc.pack(from_=disks, pressure=1e-3)
    factors = Factors(stiffness, dimension)
    law = Potential("harmonic", stiffness, factors.k)
    return (
        disks,
        Packing.from_positions(LENGTH * disks.positions, LENGTH * disks.radii, LENGTH * disks.cell, law),
        factors,
    )


def require_scaled(first, second, factor, rtol=1e-6):
    np.testing.assert_allclose(np.asarray(second), factor * np.asarray(first), rtol=rtol)


@pytest.mark.parametrize(("stiffness", "dimension"), KINDS)
def test_a_pressure_that_is_printed_is_the_one_to_give(session, stiffness, dimension):
    """`info` prints p, `pack` from it makes p; a stress out of range is told in the unit of the option."""
    disks, other, factors = both(stiffness, dimension)
    printed = float(re.search(r"(?m)^ *pressure p +(\S+)", jampetsc.info(other))[1])
    require_scaled(disks.pressure, printed, factors.stress)
    again = jampetsc.pack(from_=other, pressure=printed)
    assert again.pressure == pytest.approx(printed, rel=1e-9) and again.phi == pytest.approx(
        other.phi, rel=1e-6
    )
    require_scaled(
        jampetsc.pack(from_=disks, pressure=2e-3).phi,
        jampetsc.pack(from_=other, pressure=2e-3 * factors.stress).phi,
        1.0,
        1e-8,
    )
    unit = factors.stress * (1.0 if stiffness == "constant" else (2.0 * disks.radii.mean()) ** -2)
    unit /= (2.0 * disks.radii.mean()) ** (dimension - 2)
    for pressure in (1.01 * unit, 0.99e-8 * unit):
        with pytest.raises(InputError, match=rf"pressure \S+: must lie in \[{1e-8 * unit:.6g}, {unit:.6g}\]"):
            jampetsc.pack(from_=other, pressure=pressure)


@pytest.mark.parametrize(("stiffness", "dimension"), KINDS)
def test_radii_in_another_unit_give_the_same_packing(session, stiffness, dimension):
    radii, length = (
        np.tile([0.5, 0.7], 8),
        4.0,
    )  # a power of two: rounding decides which minimum a quench ends in
    k_fixed = (
        length ** (2 - dimension) if stiffness == "constant" else length**-dimension
    )  # of the stress, at k = 1
    how = {"stiffness": stiffness, "dimension": dimension, "tolerance": 1e-6, "seed": 3}
    disks = jampetsc.pack(radii=radii, pressure=1e-2, **how)
    other = jampetsc.pack(radii=length * radii, pressure=1e-2 * k_fixed, **how)
    require_scaled(disks.phi, other.phi, 1.0)
    require_scaled(disks.record["shear_modulus"], other.record["shear_modulus"], k_fixed, 1e-4)
    assert disks.coordination == other.coordination


@pytest.mark.parametrize(("stiffness", "dimension"), KINDS)
def test_linear_responses_scale(session, stiffness, dimension):
    disks, other, factors = both(stiffness, dimension)
    viscosity = factors.stress * TIME
    law, scaled = jampetsc.ContactDamping(beta=0.5), jampetsc.ContactDamping(beta=0.5, tau1=factors.tau1)
    first, second = jampetsc.quasistatic(disks, law), jampetsc.quasistatic(other, scaled)
    for name, factor in {
        "G0": factors.stress, "bulk_modulus": factors.stress, "eta0": viscosity, "eta_inf": viscosity,
        "omega_star": 1 / TIME, "pressure": factors.stress, "k": factors.k, "nonaffine_rms": LENGTH,
    }.items():  # fmt: skip
        require_scaled(first.attributes[name], second.attributes[name], factor)
    omega = np.geomspace(1e-4, 1e2, 7)
    first = jampetsc.sweep(disks, law, omega=omega, fields=[1.0])
    second = jampetsc.sweep(other, scaled, omega=omega / TIME, fields=[1.0 / TIME])
    require_scaled(first.omega, second.omega, 1 / TIME)
    require_scaled(first.G, second.G, factors.stress, 1e-5)
    first = jampetsc.modes(disks, count=3)
    below = 1.01 * first["eigenvalues"][2] * FORCE / LENGTH
    second = jampetsc.modes(other, below=below)
    require_scaled(first["eigenvalues"], second["eigenvalues"][:3], FORCE / LENGTH)
    require_scaled(first.attributes["nonaffine_median"], second.attributes["nonaffine_median"], LENGTH)


@pytest.mark.parametrize(("stiffness", "dimension"), [KINDS[0], KINDS[2]])
def test_power_laws_scale(session, stiffness, dimension):
    disks, other, factors = both(stiffness, dimension)
    law = jampetsc.ContactDamping(beta=1.0, tau1=factors.tau1)
    omega, stress = np.array([1e-3, 1e-1]), 1e-5
    first = jampetsc.sweep(disks, omega=omega, alpha=0.6, stress=stress)
    second = jampetsc.sweep(other, law, omega=omega / TIME, alpha=0.6, stress=stress * factors.stress)
    require_scaled(first.G, second.G, factors.stress, 1e-5)
    assert second.attributes["stress"] == stress * factors.stress
    require_scaled(first.modulus(0.02), second.modulus(0.02 / TIME), factors.stress, 1e-5)
    with pytest.raises(InputError, match=r"^the packing: omega|^stress \S+: must lie between"):
        jampetsc.sweep(other, law, omega=omega, alpha=0.6, stress=1e3 * factors.stress)
    how = {"alpha": 0.8, "steps": 16}
    first = jampetsc.oscillate(disks, omega=[0.1], stress=[1e-6], **how)
    second = jampetsc.oscillate(other, law, omega=[0.1 / TIME], stress=[1e-6 * factors.stress], **how)
    require_scaled(first["amplitude"], second["amplitude"], factors.stress)
    require_scaled(first["G"], second["G"], factors.stress, 1e-4)
    require_scaled(first["work"], second["work"], factors.stress, 1e-4)
    with pytest.raises(InputError, match=r"^stress \S+: must lie between"):
        jampetsc.oscillate(other, law, omega=[0.1 / TIME], stress=[2.0 * factors.stress], **how)


@pytest.mark.parametrize(("stiffness", "dimension"), KINDS)
def test_flows_and_shear_scale(session, stiffness, dimension):
    disks, other, factors = both(stiffness, dimension)
    how = {"strain": 0.02, "discard": 0.0}
    models = jampetsc.models.CDn(mass=1.0), jampetsc.models.CDn(mass=factors.mass, tau1=factors.tau1)
    first, second = (
        jampetsc.flow(start, model=model, rate=1e-2 / time, **how)
        for start, model, time in zip((disks, other), models, (1.0, TIME), strict=True)
    )
    for name, factor in {"time": TIME, "shear_stress": factors.stress, "energy": factors.energy}.items():
        np.testing.assert_allclose(
            second[name], factor * first[name], rtol=1e-5, atol=1e-6 * factor * abs(first[name]).max()
        )
    require_scaled(first.attributes["step"], second.attributes["step"], TIME)
    first, second = (jampetsc.shear(start, step=1e-3, strain=0.003) for start in (disks, other))
    require_scaled(first["pressure"], second["pressure"], factors.stress, 1e-5)
    require_scaled(first["energy"], second["energy"], factors.energy, 1e-5)


def test_frequencies_out_of_range_are_those_of_the_damping_time(session):
    law = jampetsc.ContactDamping(tau1=1e-3)
    with pytest.raises(InputError, match=r"^omega 2e\+15: must lie between 1e-13 and 1e\+15 \(limits"):
        jampetsc.sweep(samples.published(), law, omega=[1.0, 2e15])


def test_summaries_and_files_have_the_unit_of_stress(session, tmp_path, capsys):
    from jampetsc import main

    _, other, factors = both("inverse-square-diameter", 2)
    out = jampetsc.sweep(other, jampetsc.ContactDamping(tau1=0.5), omega=[1.0])
    assert out.attributes["stress_unit"] == "k/length²" and out.attributes["k"] == factors.k
    line = re.search(r"(?m)^ *units +(.*)", jampetsc.info(out))[1]
    assert line == f"stress as k/length² (k = {factors.k:g}), time as tau1 (tau1 = 0.5)"
    assert f"stress as k/length² (k = {factors.k:g})" in jampetsc.info(other)
    words = {
        "shear --n 16 --phi 0.86 --step 1e-3 --strain 2e-3": "stress as k/length² (k = 1), mean diameter 1.2",
        "pack --n 16 --phi 0.9": "stress as k (k = 1), mean diameter 1",
        "jam --n 16 --phi 0.9 --seeds 1:1": "stress as k/length² (k = 1), mean diameter 1.2",
    }
    for line, units in words.items():
        assert main.main([*line.split(), "--out", str(tmp_path / "o.h5"), "--overwrite", "--quiet"]) == 0
        assert f"\n  units: {units}\n" in capsys.readouterr().out
        (tmp_path / "o.h5").unlink()
