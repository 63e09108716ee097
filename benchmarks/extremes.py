"""The rational sweep at the ends of every range: is it right, is a bound ever violated, how far is it from the error?

    .venv/bin/python benchmarks/extremes.py [--n 16,64,1024] [--pressure 1e-1,1e-2,…,1e-7] [--accuracy 1e-2,1e-6,1e-10]
                                            [--points 89] [--references 9] [--ranks 1]

Frequencies from 1e-14 to 1e8, 18 laws with and without pre-stress (β from 0 to 1e4, also without normal damping, η_F
from 0 to 1e10), one sweep for each accuracy, compared at `--references` frequencies with

  N ≤ 64   the dense reference of the tests in extended precision; where mpmath is installed that one is compared with
           50-digit arithmetic at N = 16
  N > 64   one L D Lᵀ of the real form of K + iωB per frequency, which has a bound of its own (added to the sweep's)

A sweep ends certified, or refused with its reason. "error/bound" is the largest of all, "bound/error" the median for
|G*| where the error is not all rounding (more than 1e-12). Exit status 1 if a bound was violated or an accuracy not
met. `--n 100000 --pressure 1e-2 --references 1` is the large one.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from common import machine, packing, report, worker

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))  # the dense reference

LOW, HIGH = 1e-14, 1e8
DENSE = 64
DIGITS = 50


def laws():
    """All laws with what varies most first."""
    from jampetsc.laws.damping import Physics, damping_law

    for prestress in (True, False):
        for beta in (0.0, 1e-10, 1e-6, 1e-3, 1.0, 1e4):
            yield Physics(damping_law(beta=beta), prestress)
        for beta in (1e-10, 1e-3, 1.0, 1e4):
            yield Physics(damping_law(beta=beta, rotations=False), prestress)
        for normal in (0.0, 1e-6):
            yield Physics(damping_law(normal=normal, rotations=False), prestress)
        for eta_f in (0.0, 1e-10, 1e-5, 1.0, 1e5, 1e10):
            yield Physics(damping_law("stokes", eta_f=eta_f), prestress)


def digits(reference, omega):
    """G*(ω) of the same contacts by elimination with 50 digits, complex double."""
    import mpmath

    mpmath.mp.dps = DIGITS

    def number(x):
        high = float(x)
        return mpmath.mpf(high) + mpmath.mpf(float(x - high))

    moves = reference.free_moves()
    held = set()  # an unknown for each move that costs nothing, as the largest entry of its column
    if not reference.law.drag:
        held = {int(np.argmax(np.abs(move) > 0)) for move in moves.T}
    m = reference.n * reference.dofs
    law, damping = reference.law, number(reference.k) * mpmath.mpf(reference.law.tau1)
    s = mpmath.mpc(0, mpmath.mpf(float(omega)))
    A = [[mpmath.mpc(0)] * (m + 1) for _ in range(m + 1)]
    for c, (i, j) in enumerate(zip(reference.i, reference.j, strict=True)):
        r = [number(x) for x in reference.r[c]]
        distance = mpmath.sqrt(r[0] ** 2 + r[1] ** 2)
        n = [x / distance for x in r]
        t = [-n[1], n[0]]
        of_i, of_j = i * reference.dofs, j * reference.dofs

        def form(v, turns, of_i=of_i, of_j=of_j, r=r, i=i, j=j):
            entries = {of_i: -v[0], of_i + 1: -v[1], of_j: v[0], of_j + 1: v[1], m: v[0] * r[1]}
            if turns and reference.dofs == 3:
                entries |= {of_i + 2: -number(reference.radii[i]), of_j + 2: -number(reference.radii[j])}
            return entries

        tension = number(reference.force[c]) / number(reference.distance[c]) if reference.prestress else 0
        terms = [
            (form(n, False), number(reference.stiffness[c]) + s * damping * mpmath.mpf(law.normal)),
            (form(t, False), s * damping * mpmath.mpf(law.transverse) - tension),
            (form(t, True), s * damping * mpmath.mpf(law.sliding)),
        ]
        for entries, weight in terms:
            for a, x in entries.items():
                for b, y in entries.items():
                    A[a][b] += weight * x * y
    for a in range(m):
        A[a][a] += s * damping * mpmath.mpf(law.drag) * (a % reference.dofs < 2)
    A[m][m] += s * damping * mpmath.mpf(law.eta_f) * number(reference.area)
    for p in held:
        for a in range(m + 1):
            A[a][p] = A[p][a] = mpmath.mpc(0)
        A[p][p] = mpmath.mpc(1)
    for k in range(m):  # no exchanges: real or imaginary part is positive definite
        for a in range(k + 1, m + 1):
            if A[a][k] != 0:
                factor = A[a][k] / A[k][k]
                for b in range(k + 1, m + 1):
                    if A[k][b] != 0:
                        A[a][b] -= factor * A[k][b]
    return complex(A[m][m] / number(reference.area))


def references(disks, network, physics, omega):
    """(G* (R,), bounds of its own (R, 3), largest relative difference from 50 digits or None)."""
    if disks.n <= DENSE:
        from dense import Reference

        reference = Reference(disks, physics)
        G = np.array([reference.modulus(w) for w in omega])
        off = None
        if disks.n <= 16:
            try:
                there = [digits(reference, w) for w in omega[[0, len(omega) // 2, -1]]]
            except ImportError:
                pass
            else:
                here = G[[0, len(omega) // 2, -1]]
                off = max(
                    max(abs(a.real / b.real - 1), abs(a.imag / b.imag - 1))
                    for a, b in zip(here, there, strict=True)
                )
        return G, np.zeros((len(omega), 3)), off
    from jampetsc.response.assembly import assemble
    from jampetsc.response.direct import FrequencySolver

    pencil = assemble(replace(network, prestress=physics.prestress), physics.law)
    solver = FrequencySolver(pencil)
    found = [solver.solve(w, np.inf) for w in omega]  # to what it can say, which counts as its own error
    return np.array([f.G for f in found]), np.array([f.bounds for f in found]), None


def sweep(network, physics, omega, accuracy):
    """(G*, bounds, factorisations, vectors)."""
    from jampetsc.response.assembly import assemble
    from jampetsc.response.rational import RationalSweep

    pencil = assemble(replace(network, prestress=physics.prestress), physics.law)
    rational = RationalSweep(pencil, omega, accuracy)
    while shifts := rational.next_shifts():
        rational.add_shifts(shifts)
    G, bounds = rational.certificate.G, rational.certificate.bounds
    return G, bounds, rational.factorisations, rational.basis.size


def run_one(path, accuracies, points, count):
    """All laws on one packing; hands one record per law and accuracy to `report`."""
    from jampetsc.errors import ConvergenceError
    from jampetsc.io.packing_file import read_packing
    from jampetsc.petsc import session
    from jampetsc.response.contact_network import build_network

    running = session.start("real")
    disks = read_packing(path)
    network = build_network(disks, running.comm)
    omega = np.geomspace(LOW, HIGH, points)
    at = np.unique(np.linspace(0, points - 1, count).astype(int))
    records = []
    for physics in laws():
        exact, own, off = references(disks, network, physics, omega[at])
        for accuracy in accuracies:
            record = {"law": str(physics), "accuracy": accuracy, "off": off}
            try:
                G, bounds, record["factorisations"], record["vectors"] = sweep(
                    network, physics, omega, accuracy
                )
            except ConvergenceError as error:
                records.append(record | {"refused": str(error)})
                continue
            d = G[at] - exact
            error = np.column_stack((abs(d), abs(d.real), abs(d.imag)))
            size = np.column_stack((abs(exact), abs(exact.real), abs(exact.imag)))
            error[error <= 4.5e-16 * size] = 0.0  # what the double of the reference cannot hold
            error = np.maximum(error - own, 0.0)
            known = error[:, 0] > 1e-12 * size[:, 0]
            records.append(
                record
                | {
                    "violation": float(np.max(error / bounds[at])),
                    "storage": float(np.max(error[:, 1] / size[:, 1])),
                    "loss": float(np.max(error[:, 2] / size[:, 2])),
                    "over": (bounds[at][known, 0] / error[known, 0]).tolist(),
                }
            )
    if running.rank == 0:
        report(records=records)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", default="16,64,1024")
    parser.add_argument("--pressure", default="1e-1,1e-2,1e-3,1e-4,1e-5,1e-6,1e-7")
    parser.add_argument("--accuracy", default="1e-2,1e-6,1e-10")
    parser.add_argument("--points", type=int, default=89)
    parser.add_argument("--references", type=int, default=9)
    parser.add_argument("--ranks", type=int, default=1)
    parser.add_argument("--one", help="packing file, in a worker")
    args = parser.parse_args()
    accuracies = [float(word) for word in args.accuracy.split(",")]
    if args.one:
        run_one(args.one, accuracies, args.points, args.references)
        return 0
    print(machine())
    print(
        f"{args.ranks} rank{'s' * (args.ranks > 1)}, {LOW:g} ≤ ω ≤ {HIGH:g}; errors are the worst of all laws, relative"
    )
    print(
        "     N       p  accuracy  sweeps refused  error G'  error G''  error/bound  bound/error  factorisations"
    )
    wrong, refusals, off = 0, {}, []
    for n in map(int, args.n.split(",")):
        for pressure in args.pressure.split(","):
            path = packing(n, pressure)
            options = (
                "--one",
                path,
                "--accuracy",
                args.accuracy,
                "--points",
                args.points,
                "--references",
                args.references,
            )
            records = worker(__file__, *options, ranks=args.ranks)["records"]
            off += [record["off"] for record in records if record["off"] is not None]
            for accuracy in accuracies:
                of_it = [record for record in records if record["accuracy"] == accuracy]
                done = [record for record in of_it if "refused" not in record]
                refusals |= {(n, pressure, r["law"], accuracy): r["refused"] for r in of_it if "refused" in r}
                if not done:
                    print(f"{n:6d} {pressure:>7} {accuracy:9.0e} {len(of_it):7d} {len(of_it):7d}")
                    continue
                worst = {key: max(record[key] for record in done) for key in ("violation", "storage", "loss")}
                over = [ratio for record in done for ratio in record["over"]]
                counts = [record["factorisations"] for record in done]
                print(
                    f"{n:6d} {pressure:>7} {accuracy:9.0e} {len(of_it):7d} {len(of_it) - len(done):7d}",
                    f"{worst['storage']:9.1e} {worst['loss']:10.1e} {worst['violation']:12.2f}",
                    f"{np.median(over):12.1f}" if over else f"{'–':>12}",
                    f"{min(counts):8d}–{max(counts)}",
                    flush=True,
                )
                wrong += worst["violation"] > 1 or max(worst["storage"], worst["loss"]) > accuracy
    if off:
        print(f"the reference against {DIGITS} digits: {max(off):.1e}")
    for (n, pressure, law, accuracy), reason in refusals.items():
        print(f"refused: N = {n}, p = {pressure}, {law}, accuracy {accuracy:g}: {reason}")
    print("no bound was violated" if not wrong else f"{wrong} lines are WRONG")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
