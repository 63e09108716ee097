"""Quasistatic shear beside plain minimisation of the same steps: force evaluations and processor time per step.

    .venv/bin/python benchmarks/shear.py [--steps 200] [--points 64:0.86:1e-3,…]
    .venv/bin/python benchmarks/shear.py --runs 1:8 --points 64:0.84:1e-3

After every affine step of jampetsc's run the same step is also minimised from the affine positions by nonlinear
conjugate gradients (Polak–Ribière, with restarts; as Vågberg, thesis sec. 4.7), by FIRE and by L-BFGS, all on the
compiled forces of jampetsc and to the same max |F| ≤ 1e-6 p d. In turn, twenty steps each, within one run, lists
included, compilation not.
Steps that end without a contact are left out. Point: N:φ:Δγ.

With --runs each of these seeds is sheared to a strain of 5 by jampetsc, and by nonlinear CG alone: processor time of
the whole run, the share of states beyond strain 1 that jam, and their pressure. After a rearrangement the two go
different ways, so that only means can agree.
"""

import argparse

import common
import numpy as np
from common import processor
from conjugate_gradients import conjugate

from jampetsc.analysis.statistics import mean_with_error
from jampetsc.jamming.stepwise_shear import StepwiseShear, measure_minimum
from jampetsc.minimisation.descent import Descent, Goal
from jampetsc.minimisation.fire import fire_descent
from jampetsc.minimisation.minimise import settle
from jampetsc.minimisation.protocols import random_start
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.packing import deformed
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import simple_shear
from jampetsc.packing.threads import Team
from jampetsc.petsc import session
from jampetsc.petsc.hessian_solver import HessianSolver

TOLERANCE = 1e-6
POINTS = "64:0.86:1e-3,64:0.845:1e-3,256:0.86:1e-3,256:0.86:1e-4,1024:0.86:1e-4"
MOST = 200_000  # evaluations of a step
BLOCK = 20  # steps in a row by each, as in a run
STRAIN = 5.0  # of --runs


def by_conjugate_gradients(disks, goal):
    """Force evaluations to max |F| ≤ goal."""
    return conjugate(disks, goal, MOST)[1]


def by_fire(disks, goal):
    """As `by_conjugate_gradients`."""
    descent = Descent(disks, Goal(), Team())
    fire_descent(descent, goal, MOST)
    return descent.evaluations


def by_lbfgs(disks, goal):
    """As `by_conjugate_gradients`."""
    descent = Descent(disks, Goal(), Team())
    descent.descend(goal, 1.0, MOST)
    return descent.evaluations


PEERS = {"nonlinear CG": by_conjugate_gradients, "FIRE": by_fire, "L-BFGS": by_lbfgs}


def start_of(n, phi, seed):
    """Disks at rest."""
    potential = Potential("harmonic", "inverse-square-diameter")
    return settle(random_start(1.2 * radii_of("bidisperse", n), phi, seed, potential), 1e-6)


def run_of_jampetsc(disks, step, steps):
    """Pressures of the states of a run, 0 where they do not jam."""
    slow = StepwiseShear(disks, step, HessianSolver(), TOLERANCE)
    for _ in range(steps):
        slow.advance()
        yield slow.minimum.pressure * slow.minimum.jammed


def run_of_conjugate_gradients(disks, step, steps):
    """As `run_of_jampetsc`; the residual is held against the pressure there is, which is looked at now and then."""
    diameter, n = 2.0 * float(np.mean(disks.radii)), disks.n
    for _ in range(steps):
        disks, spent = deformed(disks, np.zeros((n, 2)), simple_shear(step)).folded(), 0
        state = measure_minimum(disks)
        while state.jammed and spent < MOST:
            disks, evaluations = conjugate(disks, TOLERANCE * state.pressure * diameter, 300)
            before, state, spent = state, measure_minimum(disks), spent + evaluations
            if evaluations < 300 and abs(state.pressure / before.pressure - 1.0) < 1e-3:
                break
        yield state.pressure * state.jammed


def compare_runs(n, phi, step, seeds):
    """A line for each seed and method, and one for the means."""
    print(
        f"N = {n}, phi = {phi}, step {step:g}, strain {STRAIN:g}: seconds, share that jams, p of all states"
    )
    for name, method in (("jampetsc", run_of_jampetsc), ("nonlinear CG", run_of_conjugate_gradients)):
        rows = []
        list(method(start_of(n, phi, 0), step, 2))  # compiles
        for seed in seeds:
            seconds, states = processor(list, method(start_of(n, phi, seed), step, round(STRAIN / step)))
            p = np.array(states)[round(1.0 / step) :]
            rows.append((seconds, np.mean(p > 0), np.mean(p)))
            print(
                f"    {name:12} seed {seed}: {rows[-1][0]:6.1f} s, {rows[-1][1]:.3f}, {rows[-1][2]:.3e}",
                flush=True,
            )
        mean, error = mean_with_error(rows)
        print(
            f"    {name:12} mean: {mean[0]:6.1f} s, {mean[1]:.3f} ± {error[1]:.3f}, {mean[2]:.2e} ± {error[2]:.1e}",
            flush=True,
        )


def measure(n, phi, step, steps):
    """Two lines of the table: jampetsc and its peers."""
    start = start_of(n, phi, 1)
    slow = StepwiseShear(start, step, HessianSolver(), TOLERANCE)
    for _ in range(20):
        slow.advance()
    cost = {name: [] for name in ("jampetsc", *PEERS)}
    for _ in range(0, steps, BLOCK):
        starts = []
        for _ in range(BLOCK):
            affine = deformed(slow.disks, np.zeros((n, 2)), simple_shear(step)).folded()
            seconds, done = processor(slow.advance)
            if slow.minimum.jammed:
                cost["jampetsc"].append((seconds, done.evaluations))
                starts.append((affine, TOLERANCE * slow.minimum.pressure * slow.diameter))
        for name, minimise in PEERS.items():
            cost[name] += [processor(minimise, *start) for start in starts]
    means = {name: np.mean(found[1:], axis=0) for name, found in cost.items()}
    ours = means.pop("jampetsc")
    print(f"N = {n}, phi = {phi}, step {step:g}: jampetsc {1e3 * ours[0]:.3f} ms, {ours[1]:.0f} evaluations")
    for name, (seconds, evaluations) in means.items():
        print(
            f"    {name:12} {1e3 * seconds:8.3f} ms, {evaluations:6.0f} evaluations: ratios "
            f"{seconds / ours[0]:.1f} in time, {evaluations / ours[1]:.1f} in evaluations",
            flush=True,
        )


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--points", default=POINTS)
    parser.add_argument("--runs", type=common.both_included, metavar="A:B", help="seeds of whole runs")
    args = parser.parse_args()
    session.start("real", [])
    print(common.machine(), flush=True)
    for point in args.points.split(","):
        n, phi, step = point.split(":")
        if args.runs:
            compare_runs(int(n), float(phi), float(step), args.runs)
        else:
            measure(int(n), float(phi), float(step), args.steps)


if __name__ == "__main__":
    main()
