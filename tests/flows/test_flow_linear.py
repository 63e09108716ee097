"""Linear response meets flow: stress after a small step of strain is G(t) of the packing's certified spectrum."""

import launch
import numpy as np
import pytest

import jampetsc
from jampetsc.flows.steady_shear import SteadyShear
from jampetsc.laws.damping import damping_law
from jampetsc.laws.flow_models import Model, Scheme
from jampetsc.packing.contacts import find_contacts, stress_tensor

STEP = 1e-7  # of strain: few contacts change
LAWS = {
    "drag": ("stokes", {"eta_f": 0.0}, "--law stokes --eta-f 0"),
    "contacts": ("contact", {"rotations": False}, "--no-rotations"),
    "unequal": (
        "contact",
        {"rotations": False, "beta": 0.3, "normal": 2.0},
        "--no-rotations --beta 0.3 --normal 2",
    ),
}


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)  # the sweep has its own tests on ranks, and flow runs on one rank
@pytest.mark.parametrize("name", LAWS)
def test_step_strain(session, shared_path, monkeypatch, name):
    family, options, words = LAWS[name]
    monkeypatch.chdir(shared_path)
    launch.here("pack --n 64 --pressure 1e-2 --seed 3 --stabilise shear --out packing.h5")
    launch.here(f"sweep packing.h5 --out sweep.h5 --omega 1e-4:1e3:8 --accuracy 1e-8 {words}")
    spectrum, disks = jampetsc.load("sweep.h5").spectrum, jampetsc.load("packing.h5")
    model = Model(damping_law(family, **options))

    # The step takes one short time step at an enormous rate: contact damping decides how disks move in it.
    short = 1e-7
    jump = SteadyShear(disks, model, STEP / short, Scheme(short, "euler", 1e-14))
    jump.advance(1)
    relaxing = SteadyShear(jump.disks, model, 0.0, Scheme(0.01, "heun", 1e-7))
    rest = stress_tensor(find_contacts(disks), disks.volume)[0, 1]
    times, found = [], []
    for pause in (50, 50, 100, 300, 500, 1000, 2000):
        relaxing.tally[:] = 0.0
        times.append(0.01 * relaxing.steps)
        relaxing.advance(1)
        found.append((-(relaxing.tally[0] + relaxing.tally[2]) / disks.volume - rest) / STEP)
        relaxing.advance(pause - 1)
    exact = spectrum.stress_relaxation(np.array(times[1:]))  # without the Dirac part of the step itself
    assert exact[0] > 1.05 * exact[-1]
    assert np.abs(np.array(found[1:]) / exact - 1).max() < 2e-3
