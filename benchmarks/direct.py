"""Seconds per frequency of `sweep --method direct` against scipy's SuperLU on the same matrices, and memory.

    .venv/bin/python benchmarks/direct.py [--n 1024,4096,32768] [--pressure 1e-4] [--frequencies 8]

The peer is scipy.sparse.linalg.splu in symmetric mode with MMD_AT_PLUS_A ordering and relax=1, the fastest of what was
tried (with its default relaxation of supernodes it takes 10 to 40 times as long at N = 32768). Both factorise K + iωB
(β = 1, rotations, pre-stress) once per frequency; ours certifies each G* as well.
"""

import argparse
import sys
import time

import numpy as np
from common import machine, packing, report, worker


def matrices(path):
    """(pencil, network) of a packing in the complex build."""
    from jampetsc.io.packing_file import read_packing
    from jampetsc.laws.damping import damping_law
    from jampetsc.petsc import session
    from jampetsc.response.assembly import assemble
    from jampetsc.response.contact_network import build_network

    running = session.start("complex")
    network = build_network(read_packing(path), running.comm)
    return assemble(network, damping_law()), network


def ours(path, omega):
    """Time FrequencySolver over the frequencies, the symbolic factorisation included."""
    from jampetsc.response.direct import FrequencySolver

    pencil, network = matrices(path)
    solver = FrequencySolver(pencil, positive_semidefinite=True)  # `pack` proves it
    solver.solve(omega[0] / 2.0, 1e-6)  # analysis, once per sweep
    start = time.perf_counter()
    results = [solver.solve(w, 1e-6) for w in omega]
    seconds = network.max(time.perf_counter() - start) / len(omega)
    if network.comm.rank == 0:
        report(seconds=seconds, G=[[r.G.real, r.G.imag] for r in results], unknowns=pencil.unknowns)


def superlu(path, omega):
    """The same with scipy."""
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    pencil, network = matrices(path)
    K, B = (
        csc_array((m.getValuesCSR()[2], *m.getValuesCSR()[1::-1]), shape=m.getSize())
        for m in (pencil.K, pencil.B)
    )
    k, b = pencil.k_gamma.getArray(), pencil.b_gamma.getArray()
    values = []
    start = time.perf_counter()
    for w in omega:
        c = k + 1j * w * b
        factor = splu(
            K + 1j * w * B,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            relax=1,
            options={"SymmetricMode": True},
        )
        values.append((pencil.k_gg + 1j * w * pencil.b_gg - c @ factor.solve(c)) / network.volume)
    seconds = (time.perf_counter() - start) / len(omega)
    report(seconds=seconds, G=[[v.real, v.imag] for v in values])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", default="1024,4096,32768")
    parser.add_argument("--pressure", default="1e-4")
    parser.add_argument("--frequencies", type=int, default=8)
    parser.add_argument("--worker", nargs=2, metavar=("KIND", "FILE"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    omega = np.geomspace(1e-6, 1e2, args.frequencies)
    if args.worker:
        {"ours": ours, "superlu": superlu}[args.worker[0]](args.worker[1], omega)
        return
    print(machine())
    head = f"{'N':>7} {'unknowns':>9} {'1 rank':>9} {'2 ranks':>9} {'SuperLU':>9}"
    print(f"{head}  ratio  {'memory/GB: ours, SuperLU':>25}   differ")
    for n in map(int, args.n.split(",")):
        path = packing(n, args.pressure)
        count = ("--frequencies", args.frequencies)
        one = worker(__file__, "--worker", "ours", path, *count)
        two = worker(__file__, "--worker", "ours", path, *count, ranks=2)
        peer = worker(__file__, "--worker", "superlu", path, *count)
        differ = np.max(np.abs(np.array(one["G"]) / np.array(peer["G"]) - 1.0))
        print(
            f"{n:7d} {one['unknowns']:9d} {one['seconds']:8.3f}s {two['seconds']:8.3f}s {peer['seconds']:8.3f}s "
            f"{peer['seconds'] / one['seconds']:6.2f} {one['memory']:12.2f} {peer['memory']:11.2f}   {differ:.0e}",
            flush=True,
        )


if __name__ == "__main__":
    sys.exit(main())
