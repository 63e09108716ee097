"""Is a certified bound ever false? Random laws, loads, packings and networks against a dense reference.

    .venv/bin/python benchmarks/bounds.py [--cases 500] [--first 0]

Each case draws from its number: a packing of p = 1e-7 to 1e-1, or a network (a diluted lattice on either side of
rigidity, or random springs); a law, whose weights span ten decades or are zero; one load, a random displacement
gradient among them, or the tensor; five frequencies from 1e-12 to 1e6; an accuracy from 1e-10 to 0.1; a method.
G* and C* are compared with the reference of the tests, in extended precision: a bound is false where the error is
larger by more than the reference can hold. A sweep may be refused instead; every reason is counted. Exit status 1
for a false bound.
"""

import argparse
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from common import machine

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))  # the dense reference

PRESSURES, ACCURACIES, FREQUENCIES = (-7.0, -1.0), (-10.0, -1.0), (-12.0, 6.0)  # decades
WEIGHTS = (-6.0, 4.0)
SIZES = (16, 24, 32)  # disks of a packing
COUNT = 5  # frequencies of a case
DOUBLE = 4.5e-16  # relative error of a reference value in double precision
KNOWN = 1e-12  # relative error above which it is not all rounding


@dataclass(frozen=True, eq=False)
class Case:
    """One sweep: what it is of, and its options."""

    source: object  # Packing or Network
    kind: str  # of the source, in words
    physics: object  # law and pre-stress
    load: object  # name or gradient
    omega: np.ndarray
    accuracy: float
    method: str

    def __str__(self):
        load = self.load if isinstance(self.load, str) else np.round(self.load, 3).tolist()
        return f"{self.kind}, {self.physics!r}, load {load}, {self.method}, accuracy {self.accuracy:.1e}"


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a case: errors over bounds (…), or the reason of a refusal."""

    case: Case
    ratios: np.ndarray | None = None  # error over bound
    loose: np.ndarray | None = None  # bound over error, where the error is not all rounding
    refused: str = ""

    @property
    def false_bounds(self) -> int:
        """Number of errors above their bound."""
        return 0 if self.ratios is None else int(np.count_nonzero(self.ratios > 1.0))


def power(rng, decades) -> float:
    """A number of random logarithm."""
    return float(10.0 ** rng.uniform(*decades))


def draw(number: int) -> Case:
    """The case of a number, the same on every machine; every fifth of packings is of spheres."""
    from jampetsc.laws.damping import Physics

    rng = np.random.default_rng([2026, number])
    dimension = 3 if number % 5 == 3 else 2
    source, kind = draw_packing(rng, dimension) if rng.random() < 0.6 else draw_network(rng)
    prestress = bool(rng.random() < 0.7)
    return Case(
        source,
        kind,
        Physics(draw_law(rng, source.radii is not None), prestress),
        draw_load(rng, len(source.cell)),
        np.sort([power(rng, FREQUENCIES) for _ in range(COUNT)]),
        power(rng, ACCURACIES),
        "rational" if rng.random() < 0.8 else "direct",
    )


def draw_packing(rng, dimension):
    """(packing, words)."""
    import jampetsc

    n, pressure, seed = int(rng.choice(SIZES)), power(rng, PRESSURES), int(rng.integers(1, 10**6))
    potential = str(rng.choice(["harmonic", "hertzian"], p=[0.8, 0.2]))
    settings = {"pressure": pressure, "seed": seed, "potential": potential, "dimension": dimension}
    packing = jampetsc.pack(n=n, **settings)
    return packing, f"{potential} packing in {dimension}D of {n}, p = {pressure:.1e}"


def draw_network(rng):
    """(network, words): a lattice with some of its bonds, of equal or unequal stiffness, at rest or under tension."""
    from springs import random_springs

    from jampetsc.packing.lattices import build_lattice

    if rng.random() < 0.3:
        push = float(rng.choice([0.0, 1e-3, 0.05]))
        return random_springs(
            push, seed=int(rng.integers(10**6)), radii=True
        ), f"springs that push by {push:g}"
    lattice, size = str(rng.choice(["triangular", "square"])), int(rng.integers(4, 7))
    keep = float(rng.uniform(0.45, 1.0))
    network = build_lattice(lattice, (size, size)).diluted(keep, int(rng.integers(10**6)))
    stiffness, tension = network.stiffness, network.tension
    if rng.random() < 0.5:
        stiffness = 10.0 ** rng.uniform(-3.0, 1.0, len(stiffness))
    if rng.random() < 0.3:
        tension = 0.05 * rng.random(len(tension)) * stiffness  # they pull
    return network._with(stiffness=stiffness, tension=tension), f"{lattice} lattice, keep {keep:.2f}"


def draw_law(rng, rolls):
    """A law that dissipates: of BT, or of random weights; disks without radii do not roll."""
    from jampetsc.laws.damping import Law, damping_law

    if rng.random() < 0.3:
        if rng.random() < 0.5:
            return damping_law("stokes", eta_f=float(rng.choice([0.0, power(rng, WEIGHTS)])))
        return damping_law(beta=power(rng, WEIGHTS), rotations=bool(rolls))
    names = ["normal", "transverse", "drag", "eta_f"] + (["sliding"] if rolls else [])
    weights = {name: power(rng, WEIGHTS) for name in names if rng.random() < 0.5}
    if not weights.keys() - {"eta_f"}:
        weights["drag"] = power(rng, WEIGHTS)
    return Law("random", **weights)


def draw_load(rng, dimension):
    """The tensor, a load with a name, or a gradient."""
    from jampetsc.laws.loads import named_loads

    choice = rng.random()
    if choice < 0.5:
        return "tensor"
    if choice < 0.75:
        return str(rng.choice(sorted(named_loads(dimension))))
    return rng.normal(size=(dimension, dimension))


def examine(case: Case) -> Outcome:
    """Sweep a case and compare it with the reference."""
    from dense import NetworkReference, Reference

    import jampetsc
    from jampetsc.errors import JampetscError
    from jampetsc.laws.loads import load_text, loads_of
    from jampetsc.packing.packing import Packing

    try:
        result = jampetsc.sweep(
            case.source,
            case.physics.law,
            prestress=case.physics.prestress,
            load=case.load,
            omega=case.omega,
            accuracy=case.accuracy,
            method=case.method,
        )
    except JampetscError as error:
        return Outcome(case, refused=str(error))
    loads = [load.gradient for load in loads_of(load_text(case.load), len(case.source.cell))]
    kind = Reference if isinstance(case.source, Packing) else NetworkReference
    reference = kind(case.source, case.physics, loads)
    if len(loads) == 1:
        exact, values, prefix = np.array([reference.modulus(omega) for omega in case.omega]), result.G, ""
    else:
        exact, values, prefix = np.array([reference.tensor(omega) for omega in case.omega]), result["C"], "C_"
    error = values - exact
    found = np.stack([error, error.real, error.imag], axis=-1)
    sizes = np.abs(np.stack([exact, exact.real, exact.imag], axis=-1))
    names = ("error_bound", "error_bound_storage", "error_bound_loss")
    bounds = np.stack([result[prefix + name] for name in names], axis=-1)
    errors, sizes = np.abs(found).astype(float), sizes.astype(float)
    ratios = np.maximum(errors - DOUBLE * sizes, 0.0) / bounds
    known = errors > KNOWN * sizes
    return Outcome(case, ratios, bounds[known] / errors[known])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=500)
    parser.add_argument("--first", type=int, default=0)
    args = parser.parse_args()
    print(machine())
    kinds, refusals, worst, count, false_bounds, loose = Counter(), Counter(), 0.0, 0, 0, []
    for number in range(args.first, args.first + args.cases):
        outcome = examine(draw(number))
        kinds[outcome.case.kind.split(",")[0].split(" of ")[0].split(" that ")[0]] += 1
        if outcome.refused:
            refusals[reason_of(outcome.refused)] += 1
            continue
        false_bounds += outcome.false_bounds
        if outcome.false_bounds:
            print(f"FALSE: case {number}: {outcome.case}: error/bound {outcome.ratios.max():.3g}", flush=True)
        worst, count = max(worst, float(outcome.ratios.max())), count + outcome.ratios.size
        loose += outcome.loose.tolist()
    print(f"{args.cases} cases: {', '.join(f'{count} {kind}' for kind, count in kinds.most_common())}")
    for reason, times in refusals.most_common():
        print(f"  {times} refused: {reason}")
    print(f"{count} bounds, the largest error/bound {worst:.2f}; bound/error: median {np.median(loose):.1f}")
    print(f"{false_bounds} false bounds")
    return int(false_bounds > 0)


def reason_of(message: str) -> str:
    """A message without its numbers, and without what it is about."""
    words = message.partition(": ")[2] if message.startswith(("the packing", "the network")) else message
    return " ".join(word for word in words.split() if not any(letter.isdigit() for letter in word))[:110]


if __name__ == "__main__":
    sys.exit(main())
