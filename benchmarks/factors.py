"""Time and memory of one factor of K + sB of a packing, with and without rotations, by any solver of PETSc.

    .venv/bin/python benchmarks/factors.py PACKING … [-shift_pc_factor_mat_solver_type mumps …]

For packings of spheres: jampetsc pack --dimension 3 --n 4000 --pressure 0.02 --seed 1 --out s4000.h5. Options with one
dash are PETSc's. Every factor is made in a process of its own. The last column is in bytes per n^(4/3), n unknowns.
"""

import resource
import subprocess
import sys
import time

SHIFT = 1e-2  # s


def measure(path, rotations, options) -> str:
    """A row of the table."""
    from jampetsc.io.packing_file import read_packing
    from jampetsc.laws.damping import ContactDamping
    from jampetsc.network.contact_network import build_network
    from jampetsc.petsc import session
    from jampetsc.petsc.shifted import ShiftedFactor, shifted
    from jampetsc.response.assembly import assemble

    running = session.start("real", options)
    disks = read_packing(path)
    pencil = assemble(
        build_network(disks, running.comm, prestress=False), ContactDamping(rotations=rotations)
    )
    matrix, before = shifted(pencil.K, pencil.B, SHIFT), resident()
    start = time.perf_counter()
    factor = ShiftedFactor(matrix, "K + sB")
    seconds, size = time.perf_counter() - start, resident() - before
    peak, n = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, pencil.unknowns
    kind = factor.cholesky.ksp.getPC().getFactorSolverType()
    return (
        f"{path} {disks.n} {'rotations' if rotations else 'none':9s} {kind} n = {n}: {seconds:.2f} s, "
        f"{size / 1e9:.3f} GB (peak {peak / 1e9:.2f}), {size / n ** (4 / 3):.0f}"
    )


def resident() -> int:
    """Bytes of this process in memory."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def main():
    """Print a row for each packing, with rotations and without."""
    if sys.argv[1] == "--one":
        path, rotations, *options = sys.argv[2:]
        print(measure(path, rotations == "1", options), flush=True)
        return
    paths = [word for word in sys.argv[1:] if word.endswith(".h5")]
    options = [word for word in sys.argv[1:] if word not in paths]
    for path in paths:
        for rotations in "01":
            subprocess.run([sys.executable, __file__, "--one", path, rotations, *options], check=True)


if __name__ == "__main__":
    main()
