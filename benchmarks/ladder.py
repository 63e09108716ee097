"""Packings of one seed at several pressures, each made from the one before, against independent ones.

    .venv/bin/python benchmarks/ladder.py [--n 1024] [--seeds 1:20] [--ladders 1e-2,1e-3,1e-4 1e-3,1e-4 1e-4,1e-3,1e-2]

The first packing of each ladder is the independent one. Prints what `benchmarks/ensemble.py` does of each: means with
standard errors, the difference from the independent ones of the same seeds with its error, and that error as if they
were of other seeds; then how exponents between two pressures and differences of φ scatter from seed to seed, and what
it costs: force evaluations, and processor time.
"""

import argparse
import itertools

import numpy as np
from common import both_included, machine, processor
from ensemble import QUANTITIES, of_packing

from jampetsc.minimisation import protocols
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.potentials import Potential
from jampetsc.petsc import session as door
from jampetsc.petsc.hessian_solver import HessianSolver

INDEPENDENT = "independent"
SHOWN = (0, 1, 3, 4)  # of QUANTITIES
GROWING = {"Z - 4 + 4/N": 1, "G0, no pre-stress": 3}  # with √p, which was divided out


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", type=int, default=1024)
    parser.add_argument("--seeds", type=both_included, default="1:20")
    parser.add_argument("--ladders", nargs="+", default=["1e-2,1e-3,1e-4", "1e-3,1e-4", "1e-4,1e-3,1e-2"])
    args = parser.parse_args()
    door.start(scalar="real")
    solver = HessianSolver()
    ladders = {text: tuple(map(float, text.split(","))) for text in args.ladders}
    pressures = sorted({p for ladder in ladders.values() for p in ladder}, reverse=True)
    one_seed(64, 0, ladders, pressures, solver)  # compiled before the clocks start
    found = [one_seed(args.n, seed, ladders, pressures, solver) for seed in args.seeds]
    table = {key: np.array([one[key] for one in found]) for key in found[0]}
    print(f"N = {args.n}, {len(found)} seeds")
    for pressure in pressures:
        agreement(table, pressure, [name for name in ladders if pressure in ladders[name][1:]])
    for pair in itertools.pairwise(pressures):
        spread(table, pair, [name for name, ladder in ladders.items() if set(pair) <= set(ladder)])
    for name, ladder in ladders.items():
        cost(table, name, ladder)
    print(machine())


def one_seed(n, seed, ladders, pressures, solver) -> dict:
    """{(ladder or INDEPENDENT, p): (*QUANTITIES, evaluations, seconds)}."""
    made, found = {}, {}

    def pack(key, start, fresh):
        effort = protocols.Effort()
        target = protocols.Target(key[1])
        seconds, disks = processor(
            lambda: protocols.make_packing(start, target, solver, fresh=fresh, effort=effort)
        )
        made[key], found[key] = disks, (*of_packing(disks, key[1], solver), effort.evaluations, seconds)

    for pressure in pressures:
        phi = protocols.start_phi(pressure)
        start = protocols.random_start(radii_of("bidisperse", n), phi, seed, Potential())
        pack((INDEPENDENT, pressure), start, True)
    for name, ladder in ladders.items():
        for place, pressure in enumerate(ladder):
            if not place:
                key = INDEPENDENT, pressure
                made[name, pressure], found[name, pressure] = made[key], found[key]
                continue
            above = made[name, ladder[place - 1]]
            pack((name, pressure), protocols.changed(above, protocols.Target(pressure)), False)
    return found


def mean_told(values, digits=5) -> str:
    """Mean ± standard error."""
    return f"{values.mean():.{digits}f} ± {values.std(ddof=1) / np.sqrt(len(values)):.{digits}f}"


def agreement(table, pressure, ladders):
    """Means at a pressure, and how far those of ladders are from the independent ones."""
    print(f"p = {pressure:g}")
    for place in SHOWN:
        alone = table[INDEPENDENT, pressure][:, place]
        print(f"  {QUANTITIES[place]:26s} independent         {mean_told(alone)}")
        for name in ladders:
            column = table[name, pressure][:, place]
            unpaired = np.sqrt((alone.var(ddof=1) + column.var(ddof=1)) / len(alone))
            print(
                f"  {'':26s} {name:19s} {mean_told(column)}   more by {mean_told(column - alone)} ({unpaired:.5f})"
            )


def spread(table, pair, ladders):
    """Scatter over seeds of what is taken of two pressures, and how much of it pairing has removed."""
    high, low = pair
    print(f"p = {high:g} and {low:g}: mean ± standard error, standard deviation of one seed, correlation")
    for what, place in [*GROWING.items(), ("difference of phi", 0)]:
        for name in (INDEPENDENT, *ladders):
            above, below = (table[name, p][:, place] for p in pair)
            if place:
                above, below = (np.log10(column * p**0.5) for column, p in ((above, high), (below, low)))
            each = (above - below) / (np.log10(high / low) if place else 1.0)
            told = f"{'exponent of ' if place else ''}{what}"
            print(
                f"  {told:30s} {name:19s} {mean_told(each)}   {each.std(ddof=1):.5f}   "
                f"{np.corrcoef(above, below)[0, 1]:+.2f}"
            )


def cost(table, name, ladder):
    """What all packings of a ladder cost, beside independent ones at the same pressures."""
    whole = {key: sum(table[key, p][:, -2:] for p in ladder).mean(axis=0) for key in (INDEPENDENT, name)}
    (alone, alone_s), (steps, seconds) = whole[INDEPENDENT], whole[name]
    print(
        f"{name}: {steps:.0f} force evaluations and {seconds:.3f} s a seed, independent {alone:.0f} and "
        f"{alone_s:.3f} s: {alone / steps:.2f} times as many, {alone_s / seconds:.2f} times as long"
    )


if __name__ == "__main__":
    main()
