"""Whether a seed is the same packing and the same flow on other processors, as far as this one can imitate them.

    .venv/bin/python benchmarks/processors.py [--n 1024,4096] [--pressure 1e-4] [--seed 1]

Every line is one command in as many processes as there are IMITATIONS: numba told another processor, BLAS with the
kernels of others and on two threads, numpy without its vectors, the C library without fused multiplication. Where there
is a C compiler, another C library has last digits that are off by one, in half of what exp, pow and so on give. Told
are φ, force evaluations or rows, and what differs: nothing, or the largest difference of φ and of a coordinate.
"""

import argparse
import hashlib
import json
import os
import shutil
import tempfile
from pathlib import Path

import numpy as np
from common import machine, report, run_program, worker

import jampetsc

VECTORS = "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL"
HWCAPS = ",".join(f"-{name}" for name in ("AVX2_Usable", "FMA_Usable", "AVX2", "FMA", "AVX512F", "AVX512VL"))
IMITATIONS = {
    "as it is": {},
    "numba generic": {"NUMBA_CPU_NAME": "generic"},
    "numba skylake-avx512": {"NUMBA_CPU_NAME": "skylake-avx512"},
    "BLAS Prescott": {"OPENBLAS_CORETYPE": "Prescott"},
    "BLAS Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "BLAS Zen": {"OPENBLAS_CORETYPE": "Zen"},
    "BLAS SkylakeX": {"OPENBLAS_CORETYPE": "SkylakeX"},
    "BLAS on 2 threads": {"OPENBLAS_NUM_THREADS": "2"},
    "numpy without vectors": {"NPY_DISABLE_CPU_FEATURES": VECTORS},
    "libm without FMA": {"GLIBC_TUNABLES": f"glibc.cpu.hwcaps={HWCAPS}"},
    "all of these": {
        "NUMBA_CPU_NAME": "generic",
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": VECTORS,
        "GLIBC_TUNABLES": f"glibc.cpu.hwcaps={HWCAPS}",
    },
}

ONE_ARGUMENT = "exp expm1 exp2 log log10 log2 log1p sin cos tan asin acos atan sinh cosh tanh cbrt".split()
TWO_ARGUMENTS = "pow atan2 hypot".split()
OFF_BY_ONE = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <stdint.h>
#include <string.h>
static double changed(double value) {
    uint64_t bits;
    memcpy(&bits, &value, 8);
    if (isfinite(value) && value != 0.0 && fabs(value) != 1.0 && (bits ^ bits >> 3) & 1) bits += 1;
    memcpy(&value, &bits, 8);
    return value;
}
typedef double one(double);
typedef double two(double, double);
#define ONE(f) double f(double x) { return changed(((one *)dlsym(RTLD_NEXT, #f))(x)); }
#define TWO(f) double f(double x, double y) { return changed(((two *)dlsym(RTLD_NEXT, #f))(x, y)); }
"""


def imitations(folder) -> dict:
    """IMITATIONS and, where there is a C compiler, a C library with other last digits, made in `folder`."""
    compiler = shutil.which("cc")
    if compiler is None:
        return IMITATIONS
    source, library = Path(folder, "off.c"), Path(folder, "off.so")
    functions = [f"ONE({name})" for name in ONE_ARGUMENT] + [f"TWO({name})" for name in TWO_ARGUMENTS]
    source.write_text("\n".join([OFF_BY_ONE, *functions, ""]))
    run_program([compiler, "-O1", "-fno-builtin", "-shared", "-fPIC", "-o", library, source, "-ldl"])
    return IMITATIONS | {"libm off by one": {"LD_PRELOAD": str(library)}}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", default="1024,4096", help="disks of the packings, or empty for flows alone")
    parser.add_argument("--pressure", type=float, default=1e-4)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ours", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.ours:
        ours(json.loads(args.ours))
        return
    with tempfile.TemporaryDirectory() as folder:
        compare_all(args, imitations(folder))
    print(machine())


def compare_all(args, others: dict):
    """A line for every kind of packing and flow."""
    for n in (int(n) for n in args.n.split(",") if n):
        packing = {"n": n, "pressure": args.pressure, "seed": args.seed}
        compare(packing, others)
        compare(packing | {"stabilise": "shear"}, others)
        compare(packing | {"potential": "hertzian"}, others)
        compare({"n": n, "phi": 0.86, "seed": args.seed}, others)
    small = {"n": 256, "phi": 0.86, "seed": args.seed}
    for model in ({"model": "RD0"}, {"model": "CDn", "mass": 1.0}, {"model": "CD0"}):
        compare(small | {"flow": model | {"rate": 1e-3, "strain": 1.0}}, others)
    compare(small | {"shear": {"step": 1e-3, "strain": 0.2}}, others)


def compare(what: dict, others: dict):
    """Print what differs between all imitations, {name: variables}."""
    found = {}
    for name, variables in others.items():
        os.environ.update(variables)
        found[name] = worker(Path(__file__).resolve(), "--ours", json.dumps(what))
        for variable in variables:
            del os.environ[variable]
    first = found["as it is"]
    print(
        f"{json.dumps(what)}: phi = {first['phi']:.9f}, {first['steps']} steps, {first['target']}", flush=True
    )
    for name, other in found.items():
        if other["digest"] != first["digest"] or other["target"] != first["target"]:
            far = np.abs(np.array(other["positions"]) - np.array(first["positions"])).max()
            print(
                f"    {name}: phi {other['phi'] - first['phi']:+.1e}, {other['steps']} steps, coordinates {far:.1e}"
            )
    if all(other["digest"] == first["digest"] for other in found.values()):
        print(f"    the same to the last bit in {len(found)} of {len(found)}", flush=True)


def ours(what: dict):
    """Make one packing, and shear it if that is asked for; report what came out."""
    flow, shear = what.pop("flow", None), what.pop("shear", None)
    disks = jampetsc.pack(threads=1, **what)
    steps, target, digest = disks.record["evaluations"], disks.record["instruction_set"], hashlib.sha256()
    if flow or shear:
        if flow:
            options = {name: flow.pop(name) for name in ("mass",) if name in flow}
            model = getattr(jampetsc.models, flow.pop("model"))(**options)
            result = jampetsc.flow(disks, model, **flow)
        else:
            result = jampetsc.shear(disks, **shear)
        steps, disks = len(result["shear_stress"]), result.last
        for name in sorted(result):
            digest.update(np.ascontiguousarray(result[name]))
    digest.update(disks.fingerprint.encode())
    report(
        phi=disks.phi,
        steps=steps,
        digest=digest.hexdigest(),
        target=target,
        positions=disks.positions.tolist(),
    )


if __name__ == "__main__":
    main()
