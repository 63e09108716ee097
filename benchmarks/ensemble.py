"""Ensemble averages at N = 1024 against independently made packings (random start, quenched at fixed p).

    .venv/bin/python benchmarks/ensemble.py [--n 1024] [--samples 20] [--pressures 1e-2,1e-3,1e-4]

Prints φ, (Z − 4 + 4/N)/√p, the fraction of rattlers, and G₀/√p without and with pre-stress: mean ± standard
error, the reference, and the difference in units of both standard errors together. With pre-stress G₀ < 0
occurs and the distribution has a long tail: the median and the fraction below zero are printed, too.
"""

import argparse
import time
from dataclasses import replace

import numpy as np
from common import machine

from jampetsc import session as door
from jampetsc.contacts.pairs import PairList
from jampetsc.contacts.potentials import Potential
from jampetsc.contacts.state import measure
from jampetsc.packing import protocols
from jampetsc.packing.hessian import Bonds, Pattern, border
from jampetsc.packing.sizes import radii_of
from jampetsc.solvers.local import NewtonSolver

QUANTITIES = ("phi", "dz/sqrt(p)", "rattlers", "G0/sqrt(p), no pre-stress", "G0/sqrt(p), pre-stress")
# Means and standard errors at N = 1024; a standard error of the rattlers was not given.
REFERENCE = {
    1e-2: ((0.86452, 0.00020), (5.30, 0.03), (0.010, 0.0), (1.138, 0.018), (0.658, 0.032)),
    1e-3: ((0.84372, 0.00027), (4.99, 0.05), (0.033, 0.0), (1.033, 0.027), (0.469, 0.063)),
    1e-4: ((0.84093, 0.00022), (4.42, 0.09), (0.045, 0.0), (0.848, 0.045), (0.170, 0.100)),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", type=int, default=1024)
    parser.add_argument("--samples", type=int, default=20)
    parser.add_argument("--pressures", default="1e-2,1e-3,1e-4")
    args = parser.parse_args()
    door.start(scalar="real")
    solver = NewtonSolver()
    for pressure in map(float, args.pressures.split(",")):
        began = time.perf_counter()
        table = np.array([sample(args.n, pressure, seed, solver) for seed in range(1, args.samples + 1)])
        print(
            f"p = {pressure:g}, N = {args.n}: {time.perf_counter() - began:.1f} s for {args.samples} packings"
        )
        for name, column, reference in zip(QUANTITIES, table.T, REFERENCE[pressure], strict=True):
            error = column.std(ddof=1) / np.sqrt(len(column))
            deviation = (column.mean() - reference[0]) / np.hypot(error, reference[1])
            print(
                f"  {name:26s} {column.mean():8.5f} ± {error:.5f}   "
                f"reference {reference[0]:8.5f} ± {reference[1]:.5f}   {deviation:+.1f} standard errors"
            )
        moduli = table[:, -1]
        print(f"  median G0/sqrt(p) {np.median(moduli):.3f}, below zero: {np.mean(moduli < 0):.2f}")
    print(machine())


def sample(n, pressure, seed, solver):
    """QUANTITIES of one packing."""
    start = protocols.random_start(
        radii_of("bidisperse", n), protocols.start_phi(pressure), seed, Potential()
    )
    disks = protocols.make_packing(start, protocols.Target(pressure), solver)
    state = measure(disks)
    root = np.sqrt(pressure)
    return (
        disks.phi,
        (state.coordination - 4 + 4 / n) / root,
        state.rattlers.mean(),
        unstressed_modulus(disks, state, solver) / root,
        disks.record["shear_modulus"] / root,
    )


def unstressed_modulus(disks, state, solver):
    """G₀ of the load-bearing contacts without pre-stress: (c − bᵀ K⁻¹ b) / V."""
    bonds = Bonds.of(PairList.build(disks, 1e-9), disks.potential)
    bearing = bonds.force > state.threshold
    bearing &= ~(state.rattlers[bonds.pairs.i] | state.rattlers[bonds.pairs.j])
    bonds = replace(bonds, force=np.zeros_like(bonds.force), stiffness=bonds.stiffness * bearing)
    free = ~state.rattlers
    free[np.argmax(free)] = False
    pattern = Pattern(bonds.pairs, disks.n)
    if not solver.factorise(pattern.indptr, pattern.indices, pattern.fill(bonds, free)):
        raise SystemExit("K without pre-stress is not positive definite: below jamming?")
    rows, corner = border(bonds, disks.n, disks.area, 0.0)
    row = np.where(free[:, None], rows[..., 1], 0.0).ravel()
    return (corner[1, 1] - row @ solver.solve(row)) / disks.area


if __name__ == "__main__":
    main()
