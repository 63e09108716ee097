"""Is a certified bound ever false? Random laws, loads, packings and networks against ball arithmetic.

    .venv/bin/pip install python-flint
    .venv/bin/python benchmarks/bounds.py [--cases 3000] [--first 0] [--masses]

Each case draws from its number: a packing of p = 1e-7 to 1e-1, or a network (a diluted lattice on either side of
rigidity, random springs, the contacts of a packing, springs without rest length) at rest, pushing or under tensions of
1e-3 to 1e3 k; a law, whose weights span 1e-12 to 1e6 or are zero; tangential springs in a third; one load, a random
displacement gradient or a rotation among them, or the tensor, in two fifths forces, a wave or a few particles; five
frequencies from 1e-12 to 1e6; an accuracy from 1e-10 to 0.1; a method; masses of 1e-4 to 1e4 kτ₁² in two fifths, in all
with --masses. A third has other units: stiffness to 1e±8, lengths and τ₁ to 1e±6. G*, C*, χ and G(k) are compared with
`ball_reference`, to 40 digits: a bound is false where the error is larger. A sweep may be refused instead; every reason
is counted. Exit status 1 for a false bound.
"""

import argparse
import sys
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from ball_reference import BallReference, Singular, difference
from common import machine

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))  # networks of the tests

PRESSURES, ACCURACIES, FREQUENCIES = (-7.0, -1.0), (-10.0, -1.0), (-12.0, 6.0)  # decades
SPRINGS, MASSES = (-4.0, 2.0), (-4.0, 4.0)
WEIGHTS, EXTREME_WEIGHTS, TENSIONS = (-6.0, 4.0), (-12.0, 6.0), (-3.0, 3.0)
STIFFNESSES, LENGTHS, TIMES = (-8.0, 8.0), (-6.0, 6.0), (-6.0, 6.0)  # decades of units
SIZES = (16, 24, 32)  # disks of a packing
COUNT = 5  # frequencies of a case
ROUNDED = 1e-12  # relative error below which a bound says nothing of how tight it is


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
    masses: object = None  # `Masses`

    def __str__(self):
        load = self.load if isinstance(self.load, str) else np.round(self.load, 3).tolist()
        masses = "" if self.masses is None else f", {self.masses}"
        return (
            f"{self.kind}, {self.physics!r}, load {load}, {self.method}, accuracy {self.accuracy:.1e}{masses}"
        )


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


def draw(number: int, massive: bool = False) -> Case:
    """The case of a number, the same on every machine; massive: with masses whatever is drawn."""
    from jampetsc.laws.damping import Physics

    rng = np.random.default_rng([2026, number])
    dimension = 3 if rng.random() < 0.3 else 2
    source, kind = draw_packing(rng, dimension) if rng.random() < 0.4 else draw_network(rng, dimension)
    law = draw_law(rng, source.radii is not None)
    omega = np.sort([power(rng, FREQUENCIES) for _ in range(COUNT)])
    if rng.random() < 0.3:
        k, tau1 = power(rng, STIFFNESSES), power(rng, TIMES)
        length = 2.0 ** round(rng.uniform(*LENGTHS) * np.log2(10.0))  # so that no coordinate is rounded
        source, kind = in_units(source, k, length), f"{kind}, k = {k:.1e}, lengths {length:.1e}"
        law, omega = replace(law, tau1=tau1), omega / tau1
    prestress = bool(rng.random() < 0.7)
    case = Case(
        source,
        kind,
        Physics(law, prestress),
        draw_load(rng, dimension),
        omega,
        power(rng, ACCURACIES),
        "rational" if rng.random() < 0.8 else "direct",
    )
    return draw_masses(rng, draw_forces(rng, draw_spins(rng, case)), 1.0 if massive else 0.4)


def in_units(source, k, length):
    """A packing or network with k times the stiffness and `length` times the lengths, a power of two."""
    from jampetsc.packing.packing import Packing
    from jampetsc.packing.particles import join

    if not isinstance(source, Packing):
        scaled = {name: getattr(source, name) * length for name in ("positions", "cell")}
        radii = None if source.radii is None else source.radii * length
        forces = {"stiffness": source.stiffness * k, "tension": source.tension * k * length}
        return source.replace(**scaled, **forces, radii=radii, k=source.k * k)
    positions, low = (part * length for part in join(source.base, source.offset))
    cell, cell_low = (part * length for part in join(source.cell_base, source.cell_offset))
    potential = replace(source.potential, k=source.potential.k * k)
    scaled = Packing.from_positions(
        positions, source.radii * length, cell, potential, positions_low=low, cell_low=cell_low
    )
    return scaled.with_measurements()


def draw_packing(rng, dimension):
    """(packing, words)."""
    import jampetsc

    n, pressure, seed = int(rng.choice(SIZES)), power(rng, PRESSURES), int(rng.integers(1, 10**6))
    potential = str(rng.choice(["harmonic", "hertzian"], p=[0.8, 0.2]))
    settings = {"pressure": pressure, "seed": seed, "potential": potential, "dimension": dimension}
    packing = jampetsc.pack(n=n, **settings)
    return packing, f"{potential} packing in {dimension}D of {n}, p = {pressure:.1e}"


def draw_network(rng, dimension):
    """(network, words): bonds of equal or unequal stiffness, at rest, pushing, under tension or without rest length."""
    from springs import random_springs

    from jampetsc.packing.lattices import build_lattice
    from jampetsc.packing.spring_network import Network

    if dimension == 3:
        network, kind = Network.of_packing(draw_packing(rng, 3)[0]), "contacts in 3D"
    elif rng.random() < 0.3:
        push = float(rng.choice([0.0, 1e-3, 0.05]))
        network, kind = random_springs(push, seed=int(rng.integers(10**6))), f"springs that push by {push:g}"
    else:
        lattice, size = str(rng.choice(["triangular", "square"])), int(rng.integers(4, 7))
        keep = float(rng.uniform(0.45, 1.0))
        network = build_lattice(lattice, (size, size)).diluted(keep, int(rng.integers(10**6)))
        kind = f"{lattice} lattice, keep {keep:.2f}"
    stiffness, tension, stretch = network.stiffness, network.tension, network.linear_bonds.distance
    if rng.random() < 0.5:
        stiffness = stiffness * 10.0 ** rng.uniform(-3.0, 1.0, len(stiffness))
    choice = rng.random()
    if choice < 0.15:
        tension, kind = stiffness * stretch, f"{kind}, no rest length"
    elif choice < 0.55:
        strength = power(rng, TENSIONS)
        tension = strength * stiffness * stretch * (rng.random(len(stretch)) if rng.random() < 0.5 else 1.0)
        kind = f"{kind}, tension {strength:.1e}"
    return network.replace(stiffness=stiffness, tension=tension), kind


def draw_law(rng, rolls):
    """A law that dissipates: of BT, or of random weights; disks without radii do not roll."""
    from jampetsc.laws.damping import Law, damping_law

    if rng.random() < 0.3:
        if rng.random() < 0.5:
            return damping_law("stokes", eta_f=float(rng.choice([0.0, power(rng, WEIGHTS)])))
        return damping_law(beta=power(rng, WEIGHTS), rotations=bool(rolls))
    names = ["normal", "transverse", "drag", "eta_f"] + (["sliding"] if rolls else [])
    decades = EXTREME_WEIGHTS if rng.random() < 0.4 else WEIGHTS
    weights = {name: power(rng, decades) for name in names if rng.random() < 0.5}
    if not weights.keys() - {"eta_f"}:
        weights["drag"] = power(rng, decades)
    return Law("random", **weights)


def draw_spins(rng, case) -> Case:
    """The case, a third of them with tangential springs, half of those whose disks roll with drag on spins."""
    if case.source.radii is None:
        return case
    physics = case.physics
    if rng.random() < 1 / 3:
        physics = replace(physics, tangential_stiffness=power(rng, SPRINGS))
    if (physics.tangential_stiffness or physics.law.sliding) and rng.random() < 0.5:
        physics = replace(physics, law=replace(physics.law, spin_drag=power(rng, WEIGHTS), family=None))
    return replace(case, physics=physics)


def draw_load(rng, dimension):
    """The tensor, a load with a name, a rotation, or a gradient."""
    from jampetsc.laws.loads import named_loads

    choice = rng.random()
    if choice < 0.4:
        return "tensor"
    if choice < 0.6:
        return str(rng.choice(sorted(named_loads(dimension))))
    gradient = rng.normal(size=(dimension, dimension))
    return gradient - gradient.T if choice < 0.8 else gradient


def draw_forces(rng, case) -> Case:
    """The case, two fifths of them with a wave or a few particles for a load."""
    if rng.random() > 0.4:
        return case
    if rng.random() < 0.3:
        return replace(case, load=f"points:{rng.integers(1, 4)}:{rng.integers(100)}")
    numbers = rng.integers(-3, 4, case.source.dimension)
    numbers[rng.integers(len(numbers))] = rng.integers(1, 4)
    polarisation = rng.choice(["transverse", "longitudinal"])
    return replace(case, load=f"wave:{','.join(map(str, numbers))}:{polarisation}")


def draw_masses(rng, case, share) -> Case:
    """The case, a share of them with masses, equal or by volume."""
    from jampetsc.laws.masses import Masses

    if rng.random() > share:
        return case
    unit = getattr(case.source, "k", None) or case.source.potential.k
    by = "volume" if case.source.radii is not None and rng.random() < 0.5 else "number"
    return replace(case, masses=Masses(power(rng, MASSES) * unit * case.physics.law.tau1**2, by))


def examine(case: Case) -> Outcome:
    """Sweep a case and compare it with the reference."""
    import jampetsc
    from jampetsc.errors import JampetscError
    from jampetsc.laws.loads import LoadChoice

    try:
        result = jampetsc.sweep(
            case.source,
            case.physics.law,
            prestress=case.physics.prestress,
            tangential_stiffness=case.physics.tangential_stiffness,
            load=case.load,
            omega=case.omega,
            accuracy=case.accuracy,
            method=case.method,
            **({} if case.masses is None else {"mass": case.masses.mass, "mass_by": case.masses.by}),
        )
    except JampetscError as error:
        return Outcome(case, refused=str(error))
    try:
        values, bounds, exact = compared(case, result, LoadChoice(case.load))
    except Singular:
        return Outcome(case, refused="the reference cannot tell K + iωB from a singular matrix")
    errors = np.array(
        [
            [difference(complex(v), e) for v, e in zip(*rows, strict=True)]
            for rows in zip(values, exact, strict=True)
        ]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = np.where(errors > 0.0, errors / bounds, 0.0)
    sizes = np.abs(np.stack([values, values.real, values.imag], axis=-1))
    known = errors > ROUNDED * sizes
    return Outcome(case, ratios, bounds[known] / errors[known])


def compared(case, result, choice):
    """(numbers (M, c) of a result, their bounds (M, c, 3), balls of them, rows of acb). Raises Singular."""
    names = ("error_bound", "error_bound_storage", "error_bound_loss")

    def columns(key, prefix=""):
        values = result[key].reshape(len(result.omega), -1)
        bounds = [result[prefix + name].reshape(len(result.omega), -1) for name in names]
        return values, np.stack(bounds, axis=-1)

    if choice.probe:
        parts = [columns("susceptibility", "susceptibility_"), *([columns("G")] if "G" in result else [])]
        values, bounds = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
        particles = result["probe/particles"] if "probe/particles" in result else ()
        none = np.zeros((0, *[case.source.dimension] * 2))
        reference = BallReference(case.source, case.physics, none, case.masses)
        probe = choice.probe if len(particles) else choice.probe.waves[0]
        exact = [reference.susceptibility(omega, probe, particles) for omega in result.omega]
        return values, bounds, exact
    loads = [load.gradient for load in choice.of(case.source.dimension)]
    reference = BallReference(case.source, case.physics, loads, case.masses)
    values, bounds = columns("G") if len(loads) == 1 else columns("C", "C_")
    exact = [[value for row in reference.tensor(omega) for value in row] for omega in result.omega]
    return values, bounds, exact


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=3000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--masses", action="store_true")
    args = parser.parse_args()
    from jampetsc.petsc import session

    session.start("real")  # which both methods take
    print(machine())
    kinds, refusals, worst, count, false_bounds, loose = Counter(), Counter(), 0.0, 0, 0, []
    for number in range(args.first, args.first + args.cases):
        outcome = examine(draw(number, args.masses))
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
