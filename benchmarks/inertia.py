"""G*(ω) with inertia: the rational sweep beside the overdamped one and one complex factorisation for each frequency.

    .venv/bin/python benchmarks/inertia.py [--n 1024,4096] [--pressure 1e-4] [--quality 0.1,1,10] [--sample 8]

141 frequencies from 1e-10 to 1e4 to 1e-6, β = 1 with rotations and pre-stress. Processor seconds, the best of three
runs; that of MUMPS (complex symmetric LDLᵀ, `--method direct`) is of `--sample` frequencies over the range, scaled to
141. "alone" are frequencies that the reduced space leaves to single solves. The true error is that against MUMPS.
"""

import argparse
import sys
import time

import numpy as np
from common import machine, packing, report, worker

OMEGA = np.geomspace(1e-10, 1e4, 141)
RUNS = 3


def rational(path, quality):
    """Processor seconds of the sweep, without masses for Q = 0."""
    import jampetsc

    disks = jampetsc.load(path)
    settings = {} if quality == 0.0 else {"mass": quality**2}
    seconds = []
    for _ in range(RUNS + 1):  # the first one compiles, or loads, the pair search
        start = time.process_time()
        result = jampetsc.sweep(disks, omega=OMEGA, **settings)
        seconds.append(time.process_time() - start)
    numbers = {name: int(result.attributes[name]) for name in ("factorisations", "vectors")}
    report(
        seconds=min(seconds[1:]),
        G=[[value.real, value.imag] for value in result.G],
        alone=int(result.attributes.get("direct_frequencies", 0)),
        **numbers,
    )


def direct(path, quality, sample):
    """Processor seconds of complex factorisations, scaled to all frequencies, and G* of the sample."""
    import jampetsc
    from jampetsc.petsc import session

    session.start("complex")
    disks, chosen = jampetsc.load(path), OMEGA[:: max(1, len(OMEGA) // sample)]
    jampetsc.sweep(disks, omega=chosen[:1], mass=quality**2, method="direct")
    start = time.process_time()
    result = jampetsc.sweep(disks, omega=chosen, mass=quality**2, method="direct")
    seconds = (time.process_time() - start) * len(OMEGA) / len(chosen)
    report(seconds=seconds, G=[[value.real, value.imag] for value in result.G])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", default="1024,4096")
    parser.add_argument("--pressure", default="1e-4")
    parser.add_argument("--quality", default="0.1,1,10")
    parser.add_argument("--sample", type=int, default=8)
    args = parser.parse_args()
    print(machine())
    print(
        "     N     Q  seconds  over overdamped  MUMPS over it  vectors  factors  alone  memory over  true error"
    )
    for n in map(int, args.n.split(",")):
        path = packing(n, args.pressure)
        plain = worker(__file__, "rational", path, 0.0)
        for quality in map(float, args.quality.split(",")):
            sweep = worker(__file__, "rational", path, quality)
            peer = worker(__file__, "direct", path, quality, args.sample)
            G, exact = (np.array(own["G"]) for own in (sweep, peer))
            step = max(1, len(OMEGA) // args.sample)
            error = np.max(np.abs(G[::step] - exact) / np.abs(exact))
            print(
                f"{n:6d} {quality:5g} {sweep['seconds']:8.2f} {sweep['seconds'] / plain['seconds']:16.2f} "
                f"{peer['seconds'] / sweep['seconds']:14.1f} {sweep['vectors']:8d} {sweep['factorisations']:8d} "
                f"{sweep['alone']:6d} {sweep['memory'] / plain['memory']:12.2f} {error:11.1e}",
                flush=True,
            )


if __name__ == "__main__":
    if len(sys.argv) > 1 and sys.argv[1] in ("rational", "direct"):
        kind, path, quality, *sample = sys.argv[1:]
        {"rational": rational, "direct": direct}[kind](path, float(quality), *map(int, sample))
    else:
        sys.exit(main())
