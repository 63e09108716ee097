"""Oscillations in other units of length, stiffness and time, and of other amplitudes where contacts are fixed."""

from dataclasses import fields, replace

import numpy as np
import pytest
from oscillations import steady_oscillation
from samples import physics, published
from spheres import few_spheres

from jampetsc.errors import ConvergenceError
from jampetsc.oscillation import adaptive_steps
from jampetsc.oscillation.drive import Drive
from jampetsc.oscillation.repeated_cycles import repeat_cycles
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]
# units of stiffness, length and time, which change no digit, so that contacts open alike; a second amplitude
K, LENGTH, TIME, LARGER = 4.0, 2.0, 4.0, 7.0
# what each field of an answer is made of: (powers of) stress k/length^(D − 2), length, amplitude
SCALES = {
    name: powers
    for powers, names in {
        (1, 0, 0): "G error G_error regularisation_effect cycle_change modulus",
        (1, 0, 1): "stress_waveform",
        (1, 0, 2): "work",
        (0, 0, 1): "strain gamma rate drift strain_waveform reference",
        (0, 1, 1): "speed velocity displacement",
    }.items()
    for name in names.split()
}


def stress_unit(disks):
    """By how much k/length^(D − 2) is larger in the other units."""
    return K * LENGTH ** (2 - disks.dimension)


def packing(scaled, sample=published):
    disks = sample()
    if not scaled:
        return disks
    arrays = (LENGTH * array for array in (disks.positions, disks.radii, disks.cell))
    return Packing.from_positions(*arrays, Potential(k=K))


def law_of(alpha, scaled):
    return physics(exponent=alpha, tau1=TIME if scaled else 1.0, rotations=False)


def drive_of(alpha, X, amplitude, stress, scaled, larger=LARGER, sample=published):
    """Damping forces are about X times elastic ones; scaled, time is another and the amplitude `larger` times."""
    if scaled:
        amplitude *= larger
    omega = float(np.exp((np.log(X) + (1.0 - alpha) * np.log(amplitude)) / alpha))
    if scaled and stress:  # in units of k/length^(D − 2)
        amplitude *= stress_unit(sample()) / K
    return Drive(omega / (TIME if scaled else 1.0), amplitude, stress)


def compare(one, two, amplitude, rel=1e-6, left_out=(), sample=published):
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(two, field.name)
        if field.name == "drive" or field.name in left_out or a is None:
            continue
        k, length, powers = SCALES.get(field.name, (0, 0, 0))
        unit = stress_unit(sample()) ** k * LENGTH**length * amplitude**powers
        size = np.abs(a).max()
        if isinstance(a, int):  # counts, which rounding may change
            assert abs(a - b) <= 0.02 * a
            continue
        np.testing.assert_allclose(np.asarray(b) / unit, a, rtol=rel, atol=rel * size, err_msg=field.name)


def start_of(alpha, scaled, drive, sample=published):
    """The Start of this packing under a drive."""
    oscillation = steady_oscillation(packing(scaled, sample), law_of(alpha, scaled), 16, 1e3)
    return oscillation.start(drive)


@pytest.mark.parametrize("sample", [published, few_spheres])
@pytest.mark.parametrize("stress", [True, False])
def test_cycles_at_once(stress, sample):
    found = []
    for scaled in (False, True):
        oscillation = steady_oscillation(packing(scaled, sample), law_of(0.5, scaled), 16, 1e3)
        found.append(oscillation.solve(drive_of(0.5, 0.3, 1e-3, stress, scaled, sample=sample)))
    compare(*found, LARGER, 1e-6, ("velocity", "speed", "energy_balance"), sample)


@pytest.mark.parametrize(
    ("alpha", "stress", "amplitude", "sample"),
    [
        (0.5, True, 1e-6, published),
        (0.5, True, 0.5, published),
        (0.5, False, 0.9, published),
        (0.5, True, 1e-6, few_spheres),
        (0.4, True, 1e-6, few_spheres),
    ],
)
def test_starts(alpha, stress, amplitude, sample):
    """Also where contacts open, so that disks start at rest, as they do where the power is small."""
    found = []
    for scaled in (False, True):
        drive = drive_of(alpha, 0.3, amplitude, stress, scaled, 1.0, sample)
        found.append(start_of(alpha, scaled, drive, sample).near(packing(scaled, sample)))
    assert np.any(found[0].displacement) == (amplitude < 0.1 and alpha >= 0.45)
    compare(*found, 1.0, 1e-4, sample=sample)


def test_disks_start_at_rest_where_contacts_would_be_others():
    """Else a disk may be left with one neighbour, which it rolls off however short the first steps are."""
    disks = published()
    unit = start_of(0.5, False, drive_of(0.5, 0.3, 1.0, True, False))

    def at(share):
        parts = ("displacement", "velocity", "gamma", "rate")
        return replace(unit, **{name: share * getattr(unit, name) for name in parts})

    def touching(start):
        """Which pairs, at those nearest images, are closer than the sum of their radii."""
        x, F = disks.positions + start.displacement, np.array([[1.0, start.gamma], [0.0, 1.0]])
        r = x[None] - x[:, None]
        r -= np.rint(r @ np.linalg.inv(disks.cell)) @ disks.cell
        return np.hypot(*np.moveaxis(r @ F.T, -1, 0)) < disks.radii + disks.radii[:, None]

    kept, at_rest = [], at(0.0)
    for start in map(at, np.geomspace(1e-6, 1.0, 60)):
        kept.append(np.array_equal(touching(start), touching(at_rest)))
        near, wanted = start.near(disks), start if kept[-1] else at_rest
        for field in fields(near):
            assert np.array_equal(getattr(near, field.name), getattr(wanted, field.name)), field.name
    assert 5 < sum(kept) < 55


def test_a_packing_that_comes_apart_is_told_alike(monkeypatch):
    """Of so large a stress that contacts are left which hold nothing: the strain jumps, in steps however short."""
    monkeypatch.setattr(adaptive_steps, "MAX_HALVINGS", 4)  # enough to see that it does not end
    law, disks = law_of(1.0, True), packing(True)
    start = start_of(1.0, True, Drive(0.01 / law.law.tau1, 1e-3, True))
    with pytest.raises(
        ConvergenceError,
        match=r"^(energy error .* \d\.\de\+\d+ times|forces of a time step not balanced) .* less stress\.$",
    ):
        repeat_cycles(disks, law.law, start, 16, None)


@pytest.mark.parametrize(
    ("alpha", "X", "stress", "amplitude", "count", "sample"),
    [
        (1.0, 1e-2, True, 1e-4, 16, published),
        (0.5, 0.3, False, 2e-3, 8, published),
        (1.0, 1e-2, True, 1e-4, 8, few_spheres),
    ],
)
def test_moving_contacts(alpha, X, stress, amplitude, count, sample):
    """Also where steps are cut, and as often."""
    found = []
    for scaled in (False, True):
        drive = drive_of(alpha, X, amplitude, stress, scaled, 1.0, sample)
        start = start_of(alpha, scaled, drive, sample)
        found.append(repeat_cycles(packing(scaled, sample), law_of(alpha, scaled).law, start, count, 1)[0])
    assert (found[0].steps_taken > 1.6 * count) == stress
    compare(*found, 1.0, 1e-4, sample=sample)
