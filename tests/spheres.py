"""Packings of spheres that the tests share, and jax-md's with their published numbers."""

import json
from functools import cache

import h5py
import numpy as np
from samples import DATA
from scipy.optimize import minimize

from jampetsc.packing.contacts import find_contacts, measure, net_forces
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential

JAXMD = DATA / "jaxmd-3d_bi_N128_Lp-1.0.nc"
FEW_SPHERES = json.loads((DATA / "few-spheres.json").read_text())  # positions by kind of potential


def bidisperse(index=0):
    """One of jax-md's packings, 128 spheres of two sizes in a cube at p ≈ 0.1, and its record."""
    with h5py.File(JAXMD) as file:
        record = {name: file[name][index] for name in ("pos", "rad", "box", "Energy", "Stress", "Cijkl")}
    cell = record["box"].reshape(3, 3)
    positions = record["pos"].reshape(-1, 3) @ cell
    law = Potential(stiffness="inverse-square-diameter")
    return Packing.from_positions(positions, record["rad"], cell, law), record


@cache
def few_spheres(kind="harmonic"):
    """A minimum of the energy of 14 spheres in a tilted cell, p ≈ 0.01, several touching through two images."""
    cell, radii, _ = few_spheres_start()
    return Packing.from_positions(np.array(FEW_SPHERES[kind]), radii, cell, Potential(kind))


def few_spheres_start(n=14, side=2.58, tilt=0.3):
    """(cell, radii, random positions) from which `few_spheres` were relaxed."""
    cell = side * np.array([(1.0, 0, 0), (tilt, 0.95, 0), (-0.2, tilt, 0.9)])
    return cell, np.tile([0.5, 0.6], n)[:n], np.random.default_rng(7).uniform(size=(n, 3)) @ cell


def relaxed(positions, radii, cell, kind="harmonic", rounds=3):
    """The minimum of the energy near these positions (N, 3); rounds of BFGS, each from the end of the one before."""
    n = len(radii)

    def packing_at(x):
        return Packing.from_positions(x.reshape(n, 3), radii, cell, Potential(kind))

    def energy(x):
        packing = packing_at(x)
        contacts = find_contacts(packing)
        gradient = -net_forces(n, contacts).ravel()
        return float(np.sum(packing.potential.energy(contacts.overlap, contacts.sigma))), gradient

    x = positions.ravel()
    for _ in range(rounds):
        x = minimize(energy, x, jac=True, method="BFGS", options={"gtol": 1e-14}).x
    return packing_at(x)


def body_centred():
    """A slightly irregular body-centred cubic lattice: bipartite, so that spheres turn like gears about any axis."""
    rng = np.random.default_rng(5)
    corners = np.stack(np.meshgrid(*[np.arange(2)] * 3, indexing="ij"), -1).reshape(-1, 3)
    side = 0.97 * 2.0 / np.sqrt(3.0)
    places = side * np.vstack((corners, corners + 0.5)) + rng.normal(0, 0.01, (16, 3))
    return Packing.from_positions(places, np.full(16, 0.5), 2.0 * side * np.eye(3))


SPHERES = {"few": few_spheres, "body-centred": body_centred, "hertzian": lambda: few_spheres(kind="hertzian")}


if __name__ == "__main__":  # makes tests/data/few-spheres.json again, and prints what the samples are
    cell, radii, start = few_spheres_start()
    for kind in FEW_SPHERES:
        FEW_SPHERES[kind] = relaxed(start, radii, cell, kind).positions.tolist()
    (DATA / "few-spheres.json").write_text(json.dumps(FEW_SPHERES, indent=1) + "\n")
    for name, make in SPHERES.items():
        state = measure(make())
        print(name, state.pressure, state.max_force, state.coordination, state.rattlers.sum(), make().phi)
