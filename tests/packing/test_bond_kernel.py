"""The bond kernel against sums over pairs in plain numpy, for every weight of a damping law, with and without spins."""

import numpy as np
import pytest
import sheared
from samples import POTENTIALS

from jampetsc.laws.damping import Law
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.kernel import bond_forces
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.packing import deformed
from jampetsc.packing.strain import growth_and_shear

WEIGHTS = {
    "CD": (1, 1, 0),
    "CDn": (1, 0, 0),
    "CDt": (0, 1, 0),
    "rolling": (1.3, 0, 0.7),
    "all": (0.3, 0.8, 2.1),
}


@pytest.fixture(scope="module")
def crowd():
    """Enough disks for more than one block of pairs, in a tilted cell."""
    return sheared.crowd(700, phi=1.1)


@pytest.mark.parametrize("name", WEIGHTS)
@pytest.mark.parametrize("spinning", [False, True])
@pytest.mark.parametrize("potential", POTENTIALS, ids=repr)
def test_against_sums_over_contacts(crowd, name, spinning, potential):
    disks, rng = crowd.replace(potential=potential), np.random.default_rng(2)
    weights = tuple(float(w) for w in WEIGHTS[name])
    if not spinning:
        weights = (*weights[:2], 0.0)
    offsets, u, spin = (rng.normal(0, s, (disks.n, 2)) for s in (0.02, 1.0, 1.0))
    spin = spin[:, 0].copy()
    strain, shear, rate = 0.01, -0.03, 0.3
    pairs, forces, torques = NeighbourList.build(disks, 0.3), np.empty((disks.n, 2)), np.empty(disks.n)
    assert len(pairs.i) > 1024
    sums = bond_forces(
        pairs, offsets, growth_and_shear(strain, shear), potential.constants, forces,
        (u, rate, weights), (spin, disks.radii, torques) if spinning else None,
    )  # fmt: skip
    moved = deformed(disks, offsets, growth_and_shear(strain, shear))
    law = Law(
        name, **dict(zip(("normal", "transverse", "sliding"), weights, strict=True)), tau1=1.0 / potential.k
    )  # weights count kτ₁
    springs, viscous, turned, virial, work = sheared.forces(moved, law, rate, u, spin)
    c, wanted = find_contacts(moved), springs + viscous
    assert np.abs(forces - wanted).max() < 1e-12 * np.abs(wanted).max()
    if spinning:
        assert np.abs(torques - turned).max() < 1e-12 * max(np.abs(turned).max(), 1)
    assert sums.dissipation == pytest.approx(work, rel=1e-12)
    found = [sums.viscous_xx, sums.viscous_xy, sums.viscous_yy]
    assert np.allclose(found, virial.ravel()[[0, 1, 3]], rtol=0, atol=1e-11 * np.abs(virial).max())
    energy = potential.energy(c.overlap, c.sigma).sum()
    assert sums.energy / potential.exponent == pytest.approx(energy, rel=1e-12)
    elastic = (c.normal * c.force[:, None]).T @ c.r
    found = [sums.elastic_xx, sums.elastic_xy, sums.elastic_yy]
    assert np.allclose(found, [elastic[0, 0], elastic[0, 1], elastic[1, 1]], rtol=1e-11)
