"""Ensemble averages against independently made packings (random start, quenched at fixed p).

    .venv/bin/python benchmarks/ensemble.py [--n 1024] [--seeds 1:20] [--pressures 1e-2,1e-3,1e-4,1e-5]

N is 1024 or 4096, for which there are references. Prints φ, (Z − 4 + 4/N)/√p, the fraction of rattlers, and G₀/√p
without and with pre-stress: mean ± standard error, the reference, and the difference in units of both standard errors
together. With pre-stress G₀ < 0 occurs and the distribution has a long tail: the median, the fraction below zero, and
how often twenty of these samples, drawn at random, have a mean as low as the reference's are printed, too.
"""

import argparse
from dataclasses import replace

import numpy as np
from common import both_included, machine, processor

from jampetsc.analysis.statistics import mean_with_error
from jampetsc.minimisation import protocols
from jampetsc.minimisation.hessian import Bonds, Pattern, border
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import measure
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.potentials import Potential
from jampetsc.petsc import session as door
from jampetsc.petsc.hessian_solver import HessianSolver

QUANTITIES = ("phi", "dz/sqrt(p)", "rattlers", "G0/sqrt(p), no pre-stress", "G0/sqrt(p), pre-stress")
# (N, p): means and standard errors; None: not known, error 0: not given. Those of N = 1024 down to 1e-4 were quenched
# by FIRE in another program, the others by L-BFGS in a prototype (10 samples at 1e-5, 4 at N = 4096).
REFERENCE = {
    (1024, 1e-2): ((0.86452, 0.00020), (5.30, 0.03), (0.010, 0.0), (1.138, 0.018), (0.658, 0.032)),
    (1024, 1e-3): ((0.84372, 0.00027), (4.99, 0.05), (0.033, 0.0), (1.033, 0.027), (0.469, 0.063)),
    (1024, 1e-4): ((0.84093, 0.00022), (4.42, 0.09), (0.045, 0.0), (0.848, 0.045), (0.170, 0.100)),
    (1024, 1e-5): ((0.84041, 0.00034), (3.63, 0.37), None, None, None),
    (4096, 1e-2): ((0.86522, 0.00023), (5.26, 0.0), None, None, None),
    (4096, 1e-3): ((0.84427, 0.00023), (5.02, 0.0), None, None, None),
    (4096, 1e-4): ((0.84233, 0.00030), (4.83, 0.0), None, None, None),
    (4096, 1e-5): ((0.84242, 0.00017), (4.45, 0.21), None, None, None),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", type=int, default=1024)
    parser.add_argument("--seeds", type=both_included, default="1:20")
    parser.add_argument("--pressures", default="1e-2,1e-3,1e-4,1e-5")
    args = parser.parse_args()
    door.start(scalar="real")
    solver = HessianSolver()
    for pressure in map(float, args.pressures.split(",")):
        seconds, found = processor(
            lambda p=pressure: [sample(args.n, p, seed, solver) for seed in args.seeds]
        )
        table = np.array(found)
        print(f"p = {pressure:g}, N = {args.n}: {len(table)} packings, {seconds:.1f} s of processor time")
        for name, column, reference in zip(QUANTITIES, table.T, REFERENCE[args.n, pressure], strict=True):
            mean, error = mean_with_error(column)
            line = f"  {name:26s} {mean:8.5f} ± {error:.5f}"
            if reference is not None:
                deviation = (mean - reference[0]) / np.hypot(error, reference[1])
                line += f"   reference {reference[0]:8.5f} ± {reference[1]:.5f}   {deviation:+.1f} standard errors"
            print(line)
        moduli = table[:, -1]
        line = f"  median G0/sqrt(p) {np.median(moduli):.3f}, below zero: {np.mean(moduli < 0):.2f}"
        reference = REFERENCE[args.n, pressure][-1]
        if reference is not None:
            draws = np.random.default_rng(1).choice(moduli, (100_000, 20)).mean(axis=1)
            line += f"; means of twenty as low as {reference[0]}: {np.mean(draws <= reference[0]):.4f}"
        print(line, flush=True)
    print(machine())


def sample(n, pressure, seed, solver):
    """QUANTITIES of one packing."""
    start = protocols.random_start(
        radii_of("bidisperse", n), protocols.start_phi(pressure), seed, Potential()
    )
    return of_packing(protocols.make_packing(start, protocols.Target(pressure), solver), pressure, solver)


def of_packing(disks, pressure, solver):
    """QUANTITIES of disks at a pressure."""
    state = measure(disks)
    root = np.sqrt(pressure)
    return (
        disks.phi,
        (state.coordination - 4 + 4 / disks.n) / root,
        state.rattlers.mean(),
        unstressed_modulus(disks, state, solver) / root,
        disks.record["shear_modulus"] / root,
    )


def unstressed_modulus(disks, state, solver):
    """G₀ of the load-bearing contacts without pre-stress: (c − bᵀ K⁻¹ b) / V."""
    bonds = Bonds.of(NeighbourList.build(disks, 1e-9), disks.potential)
    bearing = bonds.force > state.threshold
    bearing &= ~(state.rattlers[bonds.pairs.i] | state.rattlers[bonds.pairs.j])
    bonds = replace(bonds, force=np.zeros_like(bonds.force), stiffness=bonds.stiffness * bearing)
    free = ~state.rattlers
    free[np.argmax(free)] = False
    pattern = Pattern(bonds.pairs, disks.n)
    if not solver.factorise(pattern.indptr, pattern.indices, pattern.fill(bonds, free)):
        raise SystemExit("K without pre-stress is not positive definite: below jamming?")
    rows, corner = border(bonds, disks.n, disks.volume, 0.0)
    row = np.where(free[:, None], rows[..., 1], 0.0).ravel()
    return (corner[1, 1] - row @ solver.solve(row)) / disks.volume


if __name__ == "__main__":
    main()
