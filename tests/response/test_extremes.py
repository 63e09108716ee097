"""The ends of every range: certified and right, against extended precision.

`benchmarks/extremes.py` has the whole matrix, `benchmarks/bounds.py` hundreds of random laws, loads and networks.
"""

import bounds
import numpy as np
import pytest
from dense import Reference
from samples import SAMPLES, isostatic, physics, polydisperse, published
from sweeps import Sweep, judge

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]

OMEGA = np.geomspace(1e-14, 1e8, 12)
LAWS = [
    *(
        physics(beta=beta, prestress=prestress)
        for beta in (0.0, 1e-10, 1.0, 1e4)
        for prestress in (True, False)
    ),
    *(physics(beta=beta, rotations=False) for beta in (1e-10, 1e4)),
    *(physics("stokes", eta_f=eta) for eta in (0.0, 1e-10, 1e10)),
    physics("stokes", eta_f=0.0, prestress=False),
]


@pytest.mark.parametrize("law", LAWS, ids=str)
@pytest.mark.parametrize("sample", [published, isostatic], ids=["N = 16, p = 1e-3", "N = 24, p = 1e-7"])
def test_small_packings(session, sample, law):
    """22 decades of frequency; the space becomes complete before its bound does."""
    exact = Reference(sample(), law)
    wanted = np.array([exact.modulus(omega) for omega in OMEGA])
    for accuracy in (1e-2, 1e-10):
        found = Sweep(sample(), law, OMEGA, accuracy, session.comm).solved()
        judge(found.G, found.bounds, wanted, accuracy, (law, accuracy))
        assert found.galerkin.spectrum.weights.min(initial=0.0) >= 0.0


def test_random_cases():
    """Against ball arithmetic: a lattice under tension, packings in other units, masses, waves."""
    found = [bounds.examine(bounds.draw(number)) for number in (1, 3, 8, 15, 16)]
    found.append(bounds.examine(bounds.draw(243, massive=True)))  # drag holds a mean that rounding makes
    assert not any(one.refused for one in found) and sum(one.false_bounds for one in found) == 0
    ratios = np.concatenate([one.ratios.ravel() for one in found])
    assert ratios.max() > 0.1 and len(ratios) > 80  # of errors that a bound ten times as small would not hold


@pytest.mark.parametrize("omega", [1e-14, 1e8], ids=str)
@pytest.mark.parametrize(
    "law", [physics(beta=1e-10), physics(beta=1e4), physics("stokes", eta_f=1e10)], ids=str
)
def test_one_frequency_alone(session, law, omega):
    disks, _ = polydisperse(0)
    found = Sweep(disks, law, [omega], 1e-8, session.comm).solved()
    judge(found.G, found.bounds, np.array([Reference(disks, law).modulus(omega)]), 1e-8, law)


@pytest.mark.parametrize(
    ("sample", "law", "share"),
    [("hertzian", physics(normal=0.0), 1.0), ("published", physics(normal=1e-11), 0.2)],
    ids=str,
)
def test_motions_that_hardly_dissipate(session, sample, law, share):
    """Most cost nothing where only sliding does: a vector along them, whose norm in B is rounding, is of no use. One of
    rate 1e11, as long as 1e5 others, leaves its rounding in no other mode.
    """
    disks, omega = SAMPLES[sample](), np.geomspace(1e-8, 1e2, 15)
    exact = Reference(disks, law)
    wanted = np.array([exact.modulus(one) for one in omega])
    found = Sweep(disks, law, omega, 1e-6, session.comm).solved()
    judge(found.G, share * found.bounds, wanted, 1e-6, sample)


def test_a_negative_shear_modulus_is_no_instability(session):
    """The box is held, so K may be positive and G₀ negative: the strain is no unknown."""
    packings = ((disks, Reference(disks, physics())) for disks, _ in map(polydisperse, range(10)))
    disks, exact = next(one for one in packings if one[1].quasistatic()[1] < 0)
    wanted = np.array([exact.modulus(omega) for omega in OMEGA])
    found = Sweep(disks, physics(), OMEGA, 1e-6, session.comm).solved()
    assert found.galerkin.spectrum.G0 < 0
    judge(found.G, found.bounds, wanted, 1e-6, "negative")
