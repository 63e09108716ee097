"""50 low modes (SLEPc, K − σ by 2×2 blocks) against scipy's eigsh with SuperLU and SLEPc with CHOLMOD, on one core.

    .venv/bin/python benchmarks/modes.py [--sizes 4096,32768] [--pressure 1e-4] [--count 50] [--repeats 3]

All get the same K, the same shift and the same tolerance; processor times are the best of the
repeats, taken in turn.
"certified" adds what `jampetsc modes` does besides: the count of modes by inertia. (That K has no negative modes is
proved by `jampetsc pack`, and is in the file.)

    .venv/bin/python benchmarks/modes.py --states 60 --sizes 1024,2048,32768

Exact numbers of states between frequencies instead, against all modes by LAPACK where there are at most 4096 disks.
"""

import argparse
import resource
import sys

import numpy as np
from common import in_turn, machine, packing, processor, report, worker


def measure(path, count, repeats):
    """Seconds of both, in this process."""
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import eigsh

    from jampetsc.io.packing_file import read_packing
    from jampetsc.laws.damping import UNDAMPED
    from jampetsc.petsc import session
    from jampetsc.petsc.eigen import EXTRA_PAIRS, SHIFT, lowest
    from jampetsc.petsc.inertia import count_below
    from jampetsc.response.assembly import assemble
    from jampetsc.response.contact_network import build_network

    running = session.start("real")
    network = build_network(read_packing(path), running.comm)
    pencil = assemble(network, UNDAMPED, pinned=False)
    indptr, indices, values = pencil.K.getValuesCSR()
    K = csc_array((values, indices, indptr), shape=pencil.K.getSize())
    options = running.PETSc.Options()

    def with_cholmod():
        options.setValue("modes_st_ksp_rtol", 1e-13)  # any such option leaves the factor to CHOLMOD
        spent = processor(lowest, pencil, count, 1.0)
        options.delValue("modes_st_ksp_rtol")
        return spent

    values = lowest(pencil, count, 1.0).values
    runs = {
        "modes": lambda: processor(lowest, pencil, count, 1.0),
        "cholmod": with_cholmod,
        "count": lambda: processor(count_below, pencil.K, float(np.mean(values[count - 1 : count + 1])), "K"),
        # scipy does not know the translations: it finds them as well
        "scipy": lambda: processor(lambda: eigsh(K, count + EXTRA_PAIRS + 2, sigma=-SHIFT, tol=1e-12)),
    }
    spent = in_turn(repeats, runs)
    pairs, other, counted, (found, vectors) = (rounds[-1][1] for rounds in spent.values())
    order = np.argsort(found)[2 : count + 2]
    residual = np.linalg.norm(K @ vectors[:, order] - vectors[:, order] * found[order], axis=0).max()
    report(
        unknowns=pencil.unknowns,
        counted=counted - 2,
        differ=max(
            float(np.abs(x[:count] / pairs.values[:count] - 1).max()) for x in (found[order], other.values)
        ),
        residuals=[
            float(x) for x in (pairs.residuals[:count].max(), other.residuals[:count].max(), residual)
        ],
        **{name: min(seconds for seconds, _ in rounds) for name, rounds in spent.items()},
    )


def measure_states(path, edges):
    """Seconds and memory of `edges` numbers of states, and seconds of all modes, which LAPACK finds."""
    from jampetsc.io.packing_file import read_packing
    from jampetsc.petsc import session
    from jampetsc.petsc.eigen import MAX_LAPACK_UNKNOWNS
    from jampetsc.response.contact_network import build_network
    from jampetsc.response.mode_counts import count_between
    from jampetsc.response.vibrations import lowest_modes

    running = session.start("real")
    network = build_network(read_packing(path), running.comm)
    omega = np.geomspace(1e-3, 3.0, edges)
    seconds, found = processor(count_between, network, omega, True)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    unknowns, other = network.n * network.dimension, {}
    if unknowns <= MAX_LAPACK_UNKNOWNS:
        spent, modes = processor(lowest_modes, network, None, None, True)
        counts = np.histogram(np.sqrt(modes.eigenvalues), omega)[0]
        other = {"all": spent, "differ": int(np.abs(counts - found.counts).max())}
    report(unknowns=unknowns, states=seconds, peak=peak, counted=int(found.counts.sum()), **other)


def print_states(sizes, pressure, edges):
    """Print the table of `measure_states`."""
    print("      N  unknowns  states s  GB     counted  all modes s  ratio  largest difference of a number")
    for n in sizes:
        r = worker(__file__, "--measure", packing(n, pressure), "--states", edges)
        line = f"{n:7d}  {r['unknowns']:8d}  {r['states']:8.2f}  {r['peak']:.2f}  {r['counted']:8d}"
        if "all" in r:
            line += f"  {r['all']:11.1f}  {r['all'] / r['states']:5.1f}  {r['differ']}"
        print(line, flush=True)


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="4096,32768", help="numbers of disks (default 4096,32768)")
    parser.add_argument("--pressure", default="1e-4", help="pressure of the packings (default 1e-4)")
    parser.add_argument("--count", type=int, default=50, help="number of modes (default 50)")
    parser.add_argument(
        "--repeats", type=int, default=3, help="repeats, of which the best counts (default 3)"
    )
    parser.add_argument(
        "--states", type=int, metavar="EDGES", help="count states between as many frequencies"
    )
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.measure and args.states:
        measure_states(args.measure, args.states)
        return
    if args.measure:
        measure(args.measure, args.count, args.repeats)
        return
    print(machine())
    if args.states:
        print_states(map(int, args.sizes.split(",")), args.pressure, args.states)
        return
    print(
        "      N  unknowns   modes s   eigsh s  ratio CHOLMOD s  ratio  certified s  eigsh: ratio   counted  "
        "eigenvalues differ  residuals"
    )
    for n in map(int, args.sizes.split(",")):
        path = packing(n, args.pressure)
        words = ["--measure", path, "--count", args.count, "--repeats", args.repeats]
        r = worker(__file__, *words)
        whole = r["modes"] + r["count"]
        print(
            f"{n:7d}  {r['unknowns']:8d}  {r['modes']:8.3f}  {r['scipy']:8.3f}  {r['scipy'] / r['modes']:5.1f}  "
            f"{r['cholmod']:8.3f}  {r['cholmod'] / r['modes']:5.1f}  "
            f"{whole:11.3f}  {r['scipy'] / whole:12.1f}  {r['counted']:8d}  {r['differ']:18.1e}  "
            + ", ".join(f"{x:.0e}" for x in r["residuals"]),
            flush=True,
        )


if __name__ == "__main__":
    sys.exit(main())
