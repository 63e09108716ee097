"""141 frequencies from 1e-10 to 1e4: the rational sweep against one complex factorisation per frequency, and pyMOR.

    .venv/bin/python benchmarks/sweep.py [--n 1024,4096,32768] [--pressure 1e-4] [--sample 12] [--against TREE]

β = 1 with rotations and pre-stress, accuracy 1e-6 in G' and in G'' each. Peers, on the same matrices in the
same run:
  MUMPS    complex symmetric LDLᵀ per frequency, symbolic analysis reused (`sweep --method direct`)
  SuperLU  scipy.sparse.linalg.splu, symmetric mode, MMD_AT_PLUS_A, relax=1 (see direct.py)
  pyMOR    IRKA of order 24 on the same pencil, where pyMOR is installed (pip install pymor)
The sweep's times are the best of three runs. The first two peers are timed on `--sample` frequencies spread over the
range and scaled to 141: each costs the same. The true error is that against MUMPS at those frequencies.
"factorisations" is the sweep's processor time in units of one real Cholesky factorisation; "tensor" the processor time
of all constants of `--load tensor`, in units of the sweep's. `--against` has another tree
of jampetsc, with an environment of its own, do the same sweep in turn with this one, and leaves out the peers.
"""

import argparse
import importlib.util
import resource
import sys
import time
from pathlib import Path

import numpy as np
from common import machine, packing, report, run_program, worker
from direct import ours, superlu

OMEGA = np.geomspace(1e-10, 1e4, 141)


def rational(path, chosen):
    """Wall seconds of all that `jampetsc sweep` does between reading the packing and writing the file."""
    from jampetsc.io.packing_file import read_packing
    from jampetsc.laws.damping import damping_law
    from jampetsc.petsc import session
    from jampetsc.petsc.shifted import ShiftedFactor, shifted
    from jampetsc.response.assembly import assemble
    from jampetsc.response.contact_network import build_network
    from jampetsc.response.rational import RationalSweep

    running = session.start("real")
    disks = read_packing(path)
    build_network(disks, running.comm)  # compiles, or loads, the pair search
    running.PETSc.Log.begin()
    start, used = time.perf_counter(), time.process_time()
    network = build_network(disks, running.comm)
    pencil = assemble(network, damping_law())
    assembled = time.perf_counter()
    sweep = RationalSweep(pencil, OMEGA, 1e-6)
    while shifts := sweep.next_shifts():
        sweep.add_shifts(shifts)
    grown = time.perf_counter()
    G, bounds = sweep.certificate.G, sweep.certificate.bounds
    end, used = time.perf_counter(), time.process_time() - used
    solves = running.PETSc.Log.Event("MatSolve").getPerfInfo()["count"]
    once = time.process_time()
    ShiftedFactor(shifted(pencil.K, pencil.B, 1e-3), "K + sB")
    once = time.process_time() - once
    if running.rank == 0:
        report(
            seconds=end - start,
            assembly=assembled - start,
            basis=grown - assembled,
            projection=end - grown,
            processor=used,
            solves=solves,
            factorisation=once,
            factorisations=sweep.factorisations,
            vectors=sweep.basis.size,
            G=[[g.real, g.imag] for g in G[chosen]],
            certified=float(np.max(bounds[:, 1:] / np.abs(np.column_stack((G.real, G.imag))))),
        )


def tensor(path):
    """Processor seconds of a sweep and of the tensor of all symmetric loads, the best of three runs in turn."""
    from jampetsc.io.packing_file import read_packing
    from jampetsc.laws.damping import damping_law
    from jampetsc.laws.loads import symmetric_loads
    from jampetsc.petsc import session
    from jampetsc.response.assembly import assemble
    from jampetsc.response.contact_network import build_network
    from jampetsc.response.modulus_sweep import sweep_rationally

    running, disks = session.start("real"), read_packing(path)

    def seconds(loads):
        start = time.process_time()
        sweep_rationally(assemble(build_network(disks, running.comm), damping_law()), OMEGA, 1e-6, loads)
        return time.process_time() - start

    single, several = zip(*((seconds(None), seconds(symmetric_loads(2))) for _ in range(4)), strict=True)
    report(single=min(single[1:]), tensor=min(several[1:]))  # the first compiles, or loads, the pair search


def irka(path, chosen):
    """IRKA on x' E = A x + g u, y = gᵀx with E = B, A = −K, after the same shift of origin as ours."""
    from direct import matrices
    from pymor.models.iosys import LTIModel
    from pymor.reductors.h2 import IRKAReductor
    from scipy.sparse import csc_array

    pencil, network = matrices(path)
    K, B = (
        csc_array((m.getValuesCSR()[2].real, *m.getValuesCSR()[1::-1]), shape=m.getSize())
        for m in (pencil.K, pencil.B)
    )
    k, b = pencil.k_gamma.getArray().real, pencil.b_gamma.getArray().real
    from scipy.sparse.linalg import splu

    start = time.perf_counter()
    first = OMEGA[0]
    x0 = -splu((K + first * B).tocsc()).solve(k + first * b)
    g = b + B @ x0
    still = pencil.k_gg + 2 * k @ x0 + x0 @ (K @ x0), pencil.b_gg + 2 * b @ x0 + x0 @ (B @ x0)
    model = LTIModel.from_matrices(-K, g[:, None], g[None, :], E=B)
    reduced = IRKAReductor(model).reduce(24, maxit=20, tol=1e-4)
    s = 1j * OMEGA[chosen]
    transfer = np.array([reduced.transfer_function.eval_tf(z)[0, 0] for z in s])
    G = (still[0] + s * still[1] - (s - first) ** 2 * transfer) / network.volume
    report(seconds=time.perf_counter() - start, G=[[v.real, v.imag] for v in G])


def processor(tree, path):
    """Processor seconds of the sweep by the benchmark of a tree, its start with a tiny packing taken off."""
    spent = []
    for file in (packing(64, "1e-2"), path):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        words = [f"{tree}/.venv/bin/python", "benchmarks/sweep.py", "--worker", "rational", str(file)]
        run_program(words, cwd=tree)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return spent[1] - spent[0]


def relative_errors(values, reference):
    """Worst relative error of G' and of G''."""
    values, reference = np.array(values), np.array(reference)
    return np.max(np.abs(values / reference - 1.0), axis=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", default="1024,4096,32768")
    parser.add_argument("--pressure", default="1e-4")
    parser.add_argument("--sample", type=int, default=12)
    parser.add_argument("--against", metavar="TREE")
    parser.add_argument("--worker", nargs=2, metavar=("KIND", "FILE"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    chosen = np.unique(np.linspace(0, len(OMEGA) - 1, args.sample).round().astype(int))
    if args.worker:
        kind, path = args.worker
        run = {
            "rational": lambda: rational(path, chosen),
            "tensor": lambda: tensor(path),
            "MUMPS": lambda: ours(path, OMEGA[chosen]),
            "SuperLU": lambda: superlu(path, OMEGA[chosen]),
            "pyMOR": lambda: irka(path, chosen),
        }
        run[kind]()
        return
    peers = ["MUMPS", "SuperLU"] + ["pyMOR"] * (importlib.util.find_spec("pymor") is not None)
    print(machine())
    for n in map(int, args.n.split(",")):
        path = packing(n, args.pressure)

        def figures(kind, ranks=1, path=path):
            return worker(__file__, "--worker", kind, path, "--sample", args.sample, ranks=ranks)

        if args.against:
            trees = Path(__file__).resolve().parents[1], Path(args.against)
            mine, theirs = np.min([[processor(tree, path) for tree in trees] for _ in range(5)], axis=0)
            print(f"N = {n}: {mine:.2f} s of processor time, {args.against}: {theirs:.2f} s", flush=True)
            continue

        def best(ranks, figures=figures):
            return min((figures("rational", ranks) for _ in range(3)), key=lambda run: run["seconds"])

        mine, two = best(1), best(2)
        reference = figures("MUMPS")
        errors = relative_errors(mine["G"], reference["G"])
        print(
            f"N = {n}: rational {mine['seconds']:.2f} s, {mine['processor']:.2f} s of processor time = "
            f"{mine['processor'] / mine['factorisation']:.1f} factorisations of {mine['factorisation']:.3f} s; used "
            f"{mine['factorisations']}, {mine['solves']} solves, {mine['vectors']} vectors; "
            f"assembly {mine['assembly']:.2f}, basis and bound {mine['basis']:.2f}, projection "
            f"{mine['projection']:.2f} s\n    true error G' {errors[0]:.1e}, G'' {errors[1]:.1e}, certified "
            f"{mine['certified']:.1e}, memory {mine['memory']:.2f} GB\n    on 2 ranks, shifts side by side: "
            f"{two['seconds']:.2f} s, {mine['seconds'] / two['seconds']:.2f} times faster, {two['factorisations']} "
            "factorisations"
        )
        loads = figures("tensor")
        print(
            f"    tensor: {loads['tensor'] / loads['single']:.2f} sweeps ({loads['tensor']:.2f} s of processor time)"
        )
        for kind in peers:
            peer = reference if kind == "MUMPS" else figures(kind)
            seconds = peer["seconds"] if kind == "pyMOR" else peer["seconds"] * len(OMEGA)
            errors = relative_errors(peer["G"], reference["G"])
            print(
                f"    {kind:8} {seconds:8.1f} s, {seconds / mine['seconds']:6.1f} times ours; G' {errors[0]:.0e}, "
                f"G'' {errors[1]:.0e}, memory {peer['memory']:.2f} GB",
                flush=True,
            )


if __name__ == "__main__":
    sys.exit(main())
