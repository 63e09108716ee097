"""The Hessian that a quench ends with, factorised by CHOLMOD, and as 2×2 blocks, as the quench of few disks does.

    .venv/bin/python benchmarks/factors.py [--n 4096] [--pressure 1e-4] [--seeds 1:3]

Both orders are of approximate minimum degree: CHOLMOD's of coordinates, PETSc's of disks. Shortest processor times, in
turn, and what blocks save of the whole quench with its number of factorisations, each for three solves.
"""

import argparse
from functools import partial

import numpy as np
from common import both_included, in_turn, machine, processor

from jampetsc.minimise import ldl, protocols, warm_start
from jampetsc.minimise.descent import Descent, Goal
from jampetsc.minimise.newton import DAMPING, Pattern, Point
from jampetsc.minimise.sizes import radii_of
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import UNSTRAINED
from jampetsc.packing.threads import Team
from jampetsc.petsc import session
from jampetsc.petsc.hessian_solver import NewtonSolver

ROUNDS = 10
SOLVES = 3  # for each factor: the forces, and the strains of the cell


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", type=int, default=4096)
    parser.add_argument("--pressure", type=float, default=1e-4)
    parser.add_argument("--seeds", type=both_included, default="1:3")
    args = parser.parse_args()
    session.start(scalar="real")
    solver = NewtonSolver()
    quench(64, args.pressure, 1, solver)  # compiled before the clocks start
    for seed in args.seeds:
        compare(args.n, args.pressure, seed, solver)
    print(machine())


def quench(n, pressure, seed, solver):
    """(processor seconds, effort, packing)."""
    effort, start_phi = protocols.Effort(), protocols.start_phi(pressure)
    start = protocols.random_start(radii_of("bidisperse", n), start_phi, seed, Potential())
    seconds, disks = processor(
        lambda: protocols.make_packing(start, protocols.Target(pressure), solver, effort=effort)
    )
    return seconds, effort, disks


def compare(n, pressure, seed, solver):
    """Print the times of both for the Hessian of one packing, with the damping of a first Newton step."""
    whole, effort, disks = quench(n, pressure, seed, solver)
    descent, mu = Descent(disks, Goal(pressure), Team()), DAMPING * pressure
    pairs, law = descent.pairs, disks.potential.constants
    pattern = Pattern(pairs, n)
    values = pattern.fill(Point.of(descent).bonds, np.ones(n, bool), mu)
    blocks, touching = warm_start.springs(pairs, np.zeros((n, 2)), UNSTRAINED, law, 0.0, 1.0)
    order = partial(solver.order, n, pairs.i[touching], pairs.j[touching])
    matter = pairs.i, pairs.j, blocks, touching
    by_blocks = partial(ldl.factorise, order(), *matter, ldl.diagonal_of(*matter, np.full(n, mu)))
    factor = by_blocks()[1]
    b = np.random.default_rng(1).standard_normal((n, 2))
    runs = {
        "CHOLMOD": partial(solver.factorise, pattern.indptr, pattern.indices, values),
        "its solve": partial(solver.solve, b.ravel()),
        "order of disks": order,
        "blocks": by_blocks,
        "their solve": partial(ldl.solve, factor, b, np.empty((n, 2)), np.empty((n, 2))),
    }
    for run in runs.values():
        run()
    took = in_turn(ROUNDS, {name: partial(processor, run) for name, run in runs.items()})
    ms = {name: 1e3 * min(seconds for seconds, _ in found) for name, found in took.items()}
    less = ms["CHOLMOD"] - ms["order of disks"] - ms["blocks"]
    less += SOLVES * (ms["its solve"] - ms["their solve"])
    print(
        f"N = {n}, p = {pressure:g}, seed {seed}: "
        + ", ".join(f"{name} {t:.3g} ms" for name, t in ms.items())
    )
    print(
        f"    {len(factor[2]) / n:.1f} blocks a disk below the diagonal; blocks save "
        f"{0.1 * less * effort.newton_steps / whole:.1f} % of a quench of {effort.newton_steps} factorisations "
        f"and {effort.evaluations} force evaluations, {whole:.2f} s",
        flush=True,
    )


if __name__ == "__main__":
    main()
