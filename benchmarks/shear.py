"""Quasistatic shear beside plain minimisation of the same steps: force evaluations and processor time per step.

    .venv/bin/python benchmarks/shear.py [--steps 200] [--points 64:0.86:1e-3,…]

After every affine step of jampetsc's run the same step is also minimised from the affine positions by nonlinear
conjugate gradients (Polak–Ribière, with restarts; as Vågberg, thesis sec. 4.7), by FIRE and by L-BFGS, all on the
compiled forces of jampetsc and to the same max |F| ≤ 1e-6 p d. In turn, twenty steps each, within one run, lists
included, compilation not.
Steps that end without a contact are left out. Point: N:φ:Δγ.
"""

import argparse
import time

import common
import numba
import numpy as np

from jampetsc import session
from jampetsc.contacts.kernel import FAST, bond_forces
from jampetsc.contacts.pairs import PairList, deformed, is_stale
from jampetsc.contacts.potentials import Potential
from jampetsc.contacts.threads import Team
from jampetsc.packing.descent import Descent, Goal
from jampetsc.packing.fire import fall
from jampetsc.packing.minimise import settle
from jampetsc.packing.protocols import random_start
from jampetsc.packing.sizes import radii_of

TOLERANCE = 1e-6
POINTS = "64:0.86:1e-3,64:0.845:1e-3,256:0.86:1e-3,256:0.86:1e-4,1024:0.86:1e-4"
MOST = 200_000  # evaluations of a step
BLOCK = 20  # steps in a row by each, as in a run


@numba.njit(fastmath=FAST, error_model="numpy")
def conjugate_gradients(pairs, listed, law, o, f, d, state, goal, most):
    """Steps of Polak–Ribière with a secant along each direction; state = (slope before, |F|² before, last length).

    Returns (there, evaluations); not there: the list is stale, or `most` are spent.
    """
    n = len(o)
    trial, ahead = np.empty_like(o), np.empty_like(f)
    bond_forces(pairs, o, 0.0, 0.0, law, f, None, None)
    evaluations = 1
    fresh = state[1] == 0.0
    while evaluations < most:
        top = 0.0
        for k in range(n):
            top = max(top, f[k, 0] ** 2 + f[k, 1] ** 2)
        if top <= goal * goal:
            return True, evaluations
        if fresh:
            d[:] = f
            fresh = False
        slope = np.sum(f * d)
        if slope <= 0.0:
            d[:] = f
            slope = np.sum(f * d)
        length = state[2]
        for k in range(n):
            for axis in range(2):
                trial[k, axis] = o[k, axis] + length * d[k, axis]
        bond_forces(pairs, trial, 0.0, 0.0, law, ahead, None, None)
        evaluations += 1
        end = np.sum(ahead * d)
        if abs(end) > 0.1 * slope:  # to where the secant of the slope ends
            better = length * min(max(slope / (slope - end), 0.1), 10.0) if slope > end else 2.0 * length
            for k in range(n):
                for axis in range(2):
                    trial[k, axis] = o[k, axis] + better * d[k, axis]
            bond_forces(pairs, trial, 0.0, 0.0, law, ahead, None, None)
            evaluations += 1
            length = better
        state[2] = length
        turn = max(np.sum(ahead * (ahead - f)) / np.sum(f * f), 0.0)
        far = 0.0
        for k in range(n):
            for axis in range(2):
                o[k, axis] = trial[k, axis]
                f[k, axis] = ahead[k, axis]
                d[k, axis] = f[k, axis] + turn * d[k, axis]
            far = max(far, o[k, 0] ** 2 + o[k, 1] ** 2)
        if is_stale(np.sqrt(far), 0.0, 0.0, listed[0], listed[1]):
            break
    state[1] = 1.0
    return False, evaluations


def by_conjugate_gradients(disks, goal):
    """Force evaluations to max |F| ≤ goal."""
    widest, evaluations = 2.0 * float(disks.radii.max()), 0
    d, f, state = np.empty((disks.n, 2)), np.empty((disks.n, 2)), np.array([0.0, 0.0, 0.5])
    while evaluations < MOST:
        pairs, o = PairList.build(disks, 0.4), np.zeros((disks.n, 2))
        there, more = conjugate_gradients(
            pairs.arrays, (widest, 0.4), disks.potential.constants, o, f, d, state, goal, MOST
        )
        evaluations += more
        if there:
            break
        disks = deformed(disks, o, 0.0, 0.0)
    return evaluations


def by_fire(disks, goal):
    """As `by_conjugate_gradients`."""
    descent = Descent(disks, Goal(), Team())
    fall(descent, goal, MOST)
    return descent.evaluations


def by_lbfgs(disks, goal):
    """As `by_conjugate_gradients`."""
    descent = Descent(disks, Goal(), Team())
    descent.descend(goal, 1.0, MOST)
    return descent.evaluations


PEERS = {"nonlinear CG": by_conjugate_gradients, "FIRE": by_fire, "L-BFGS": by_lbfgs}


def measure(n, phi, step, steps):
    """Two lines of the table: jampetsc and its peers."""
    from jampetsc.flows.slowly import SlowShear
    from jampetsc.solvers.local import NewtonSolver

    potential = Potential("harmonic", "inverse-square-diameter")
    start = settle(random_start(1.2 * radii_of("bidisperse", n), phi, 1, potential), 1e-6)
    slow = SlowShear(start, step, NewtonSolver(), TOLERANCE)
    for _ in range(20):
        slow.advance()
    cost = {name: [] for name in ("jampetsc", *PEERS)}
    for _ in range(0, steps, BLOCK):
        starts = []
        for _ in range(BLOCK):
            affine = deformed(slow.disks, np.zeros((n, 2)), 0.0, step).folded()
            began = time.process_time()
            evaluations = slow.advance().evaluations
            mine = time.process_time() - began, evaluations
            if slow.found.jammed:
                cost["jampetsc"].append(mine)
                starts.append((affine, TOLERANCE * slow.found.pressure * slow.diameter))
        for name, minimise in PEERS.items():
            for affine, goal in starts:
                began = time.process_time()
                evaluations = minimise(affine, goal)
                cost[name].append((time.process_time() - began, evaluations))
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
    args = parser.parse_args()
    session.start("real", [])
    print(common.machine(), flush=True)
    for point in args.points.split(","):
        n, phi, step = point.split(":")
        measure(int(n), float(phi), float(step), args.steps)


if __name__ == "__main__":
    main()
