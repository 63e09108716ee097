"""Time and memory of one factor of K + sB of a packing and of a solve with it, by any solver of PETSc.

    .venv/bin/python benchmarks/factors.py PACKING … [--copies 2] [-shift_pc_factor_mat_solver_type mumps …]

For packings of spheres: jampetsc pack --dimension 3 --n 4000 --pressure 0.02 --seed 1 --out s4000.h5. `--copies 2` has
a packing twice along each axis. Options with one dash are PETSc's: those that begin with -shift_fieldsplit_ choose
conjugate gradients with a factor of the displacements alone, those that begin with -shift_pc_ a factor of the
whole matrix, as -shift_pc_type cholesky. Every factor is made in a process of its own, with rotations and without, and
solves for a random right-hand side to rounding. Times are of the processor; the size is of the process.
"""

import argparse
import itertools
import resource
import sys
import time

from common import run_program

SHIFT = 1e-2  # s


def measure(path, copies, shift, rotations, options) -> str:
    """A row of the table."""
    import numpy as np

    from jampetsc.laws.damping import ContactDamping
    from jampetsc.petsc import session
    from jampetsc.petsc.shifted import ShiftedFactor, shifted
    from jampetsc.response.assembly import assemble
    from jampetsc.response.contact_network import build_network
    from jampetsc.response.shift_factors import splits_spins

    running = session.start("real", options)
    packing = repeated(path, copies)
    pencil = assemble(
        build_network(packing, running.comm, prestress=False), ContactDamping(rotations=rotations)
    )
    matrix, before = shifted(pencil.K, pencil.B, shift), resident()
    start = time.process_time()
    factor = ShiftedFactor(matrix, "K + sB", spins=pencil.spins if splits_spins(pencil) else None)
    made = time.process_time()
    rhs = pencil.K.createVecRight()
    rhs.setArray(np.random.default_rng(1).standard_normal(rhs.getLocalSize()))
    factor.solve(rhs, rhs)
    solved, n, ksp = time.process_time(), pencil.unknowns, factor.cholesky.ksp
    size, peak = resident() - before, 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    kind = "whole" if ksp.getType() == "preonly" else f"{ksp.getType()} {ksp.getPC().getType()}"
    return (
        f"{path} {packing.n} {'rotations' if rotations else 'none':9s} s = {shift:g} {kind} n = {n}: factor "
        f"{made - start:.2f} s, {size / 1e9:.3f} GB (peak {peak / 1e9:.2f}), {size / n ** (4 / 3):.0f} per n^(4/3); "
        f"solve {solved - made:.2f} s, {ksp.getIterationNumber()} iterations at the end"
    )


def repeated(path, copies):
    """The packing of a file, so many times along each axis of its cell."""
    import numpy as np

    from jampetsc.io.packing_file import read_packing
    from jampetsc.packing.packing import Packing

    packing = read_packing(path)
    if copies == 1:
        return packing
    cell, steps = packing.cell, itertools.product(range(copies), repeat=packing.dimension)
    positions = np.concatenate([packing.positions + np.array(step) @ cell for step in steps])
    radii = np.tile(packing.radii, copies**packing.dimension)
    return Packing.from_positions(positions, radii, copies * cell, packing.potential)


def resident() -> int:
    """Bytes of this process in memory."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def main():
    """Print a row for each packing, with rotations and without."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("packings", nargs="+", metavar="PACKING")
    parser.add_argument("--copies", type=int, default=1, help="of the packing along each axis")
    parser.add_argument("--shift", type=float, default=SHIFT, help="s")
    parser.add_argument("--rotations", choices="01", help="with rotations (1) or without (0) alone")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    words = sys.argv[1:]
    first = next((i for i, word in enumerate(words) if word.startswith("-shift_")), len(words))
    asked, options = parser.parse_args(words[:first]), words[first:]
    if asked.one:
        rotations = asked.rotations == "1"
        print(measure(asked.packings[0], asked.copies, asked.shift, rotations, options), flush=True)
        return
    for path, rotations in itertools.product(asked.packings, asked.rotations or "01"):
        own = [
            "--one",
            path,
            "--copies",
            str(asked.copies),
            "--shift",
            str(asked.shift),
            "--rotations",
            rotations,
        ]
        run_program([sys.executable, __file__, *own, *options], stdout=None, stderr=None)


if __name__ == "__main__":
    main()
