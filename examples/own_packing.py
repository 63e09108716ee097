"""G*(ω) of disks of one's own: arrays of a simulation in numpy and scipy, a packing, a sweep.

    python examples/own_packing.py [N] [FILE]

Overlaps δ cost U = ½ k δ² here, k = 1, in a sheared periodic box. A FILE of another program, such as a LAMMPS dump, is
read instead: jampetsc.import_packing has its formats and options.
"""

import sys

import numpy as np
from scipy.optimize import minimize

import jampetsc


def simulated(n, phi=0.92, xy=0.1, seed=1):
    """(positions, radii, box) of a minimum of the energy, by all pairs: N below a thousand."""
    rng = np.random.default_rng(seed)
    radii = np.where(np.arange(n) < n // 2, 0.5, 0.7)
    L = np.sqrt(np.pi * np.sum(radii**2) / phi)
    cell = np.array([[L, 0.0], [xy * L, L]])
    i, j = np.triu_indices(n, 1)

    def energy(x):
        fraction = (x.reshape(n, 2)[j] - x.reshape(n, 2)[i]) @ np.linalg.inv(cell)
        bond = (fraction - np.round(fraction)) @ cell
        distance = np.linalg.norm(bond, axis=1)
        overlap = np.maximum(radii[i] + radii[j] - distance, 0.0)
        pull = bond * (overlap / distance)[:, None]  # dU/dx_i
        force = np.zeros((n, 2))
        np.add.at(force, i, pull)
        np.add.at(force, j, -pull)
        return 0.5 * np.sum(overlap**2), force.ravel()

    start = rng.random((n, 2)) @ cell
    minimum = minimize(
        energy, start.ravel(), jac=True, method="BFGS", options={"gtol": 1e-9, "maxiter": 10000}
    )
    print(f"energy here       {minimum.fun:.9g}")
    return minimum.x.reshape(n, 2), radii, (L, L, xy * L)


if len(sys.argv) > 2:
    packing = jampetsc.import_packing(sys.argv[2])
else:
    positions, radii, box = simulated(int(sys.argv[1]) if len(sys.argv) > 1 else 64)
    packing = jampetsc.Packing(positions, radii, box, potential="harmonic", k=1.0)
print(f"energy of packing {packing.record['energy']:.9g}, p = {packing.record['pressure']:.4g} k")
print(f"forces balance to {packing.record['max_force']:.1e} k")
sweep = jampetsc.sweep(packing, omega=[1e-4, 1e-2, 1.0])
for omega, G in zip(sweep.omega, sweep.G, strict=True):
    print(f"omega = {omega:.0e} / tau1: G' = {G.real:.6g} k, G'' = {G.imag:.6g} k")
