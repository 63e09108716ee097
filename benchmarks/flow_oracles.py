"""Stress, pressure and contacts under steady shear against figures of an independent program.

    .venv/bin/python benchmarks/flow_oracles.py [--points quick|256|1024|massive|quasistatic] [--seeds 1:2]

The figures come from a prototype that shares no code with jampetsc (bidisperse harmonic disks in a square cell,
k_e = k_d = d_s = 1; one or two seeds of another generator, sheared at falling rates). Each line gives jampetsc's mean
over the seeds, the figure, and their difference in standard errors of both. Seeds of small systems remember their
start, at 1e-2 by several per cent: the error of jampetsc's mean is the larger of the scatter of seeds and the errors
from the autocorrelation.
"""

import argparse
import contextlib
import io
import sys
import tempfile
from pathlib import Path

import numpy as np
from common import both_included

import jampetsc
from jampetsc import main as cli
from jampetsc.analysis.correlated_series import mean_of_facts

STRAINS = {1e-2: 40, 1e-3: 20, 1e-4: 6}
QUANTITIES = ("shear_stress", "pressure", "contact_number")
# (model, N, φ, rate): ((σ, error), (p, error), (Z, error))
FIGURES = {
    ("RD0", 256, 0.8, 1e-2): ((2.84e-3, 0.16e-3), (8.5e-3, 0.3e-3), (3.059, 0.012)),
    ("RD0", 256, 0.8, 1e-3): ((7.44e-4, 0.10e-4), (2.29e-3, 0.03e-3), (3.249, 0.004)),
    ("RD0", 256, 0.8, 1e-4): ((9.5e-5, 0.3e-5), (3.07e-4, 0.14e-4), (3.228, 0.008)),
    ("RD0", 256, 0.8433, 1e-2): ((4.77e-3, 0.07e-3), (0.01638, 0.00013), (3.573, 0.005)),
    ("RD0", 256, 0.8433, 1e-3): ((1.886e-3, 0.016e-3), (7.94e-3, 0.05e-3), (3.886, 0.004)),
    ("RD0", 256, 0.8433, 1e-4): ((6.79e-4, 0.17e-4), (3.72e-3, 0.13e-3), (4.003, 0.012)),
    ("RD0", 256, 0.86, 1e-2): ((5.74e-3, 0.06e-3), (0.0204, 0.0002), (3.745, 0.003)),
    ("RD0", 256, 0.86, 1e-3): ((2.47e-3, 0.03e-3), (0.01182, 0.00007), (4.116, 0.003)),
    ("RD0", 1024, 0.8, 1e-2): ((3.121e-3, 0.020e-3), (9.09e-3, 0.05e-3), (3.092, 0.003)),
    ("RD0", 1024, 0.8, 1e-3): ((7.35e-4, 0.06e-4), (2.268e-3, 0.019e-3), (3.249, 0.004)),
    ("RD0", 1024, 0.8433, 1e-2): ((4.89e-3, 0.04e-3), (0.01655, 0.00005), (3.5718, 0.0018)),
    ("RD0", 1024, 0.8433, 1e-3): ((1.884e-3, 0.018e-3), (7.94e-3, 0.04e-3), (3.888, 0.002)),
    ("RD0", 1024, 0.8433, 1e-4): ((6.79e-4, 0.09e-4), (3.81e-3, 0.04e-3), (4.0183, 0.0017)),
    ("RD0", 1024, 0.86, 1e-3): ((2.471e-3, 0.014e-3), (0.01181, 0.00003), (4.115, 0.002)),
    ("CD0", 256, 0.8, 1e-2): ((0.01166, 0.00010), (0.01318, 0.00017), (3.123, 0.004)),
    ("CD0", 256, 0.8, 1e-3): ((2.03e-3, 0.02e-3), (3.67e-3, 0.05e-3), (3.294, 0.009)),
    ("CD0", 256, 0.8433, 1e-2): ((0.01475, 0.00008), (0.02103, 0.00012), (3.490, 0.004)),
    ("CD0", 256, 0.8433, 1e-3): ((3.65e-3, 0.05e-3), (9.98e-3, 0.07e-3), (3.840, 0.004)),
    ("CD0", 256, 0.8433, 1e-4): ((9.93e-4, 0.18e-4), (4.37e-3, 0.07e-3), (3.984, 0.011)),
    ("CD0", 256, 0.86, 1e-2): ((0.01572, 0.00018), (0.0242, 0.0002), (3.631, 0.004)),
    ("CD0", 256, 0.86, 1e-3): ((4.41e-3, 0.05e-3), (0.01383, 0.00014), (4.047, 0.003)),
    ("CD0", 1024, 0.8, 1e-2): ((0.01184, 0.00002), (0.01337, 0.00005), (3.1237, 0.0018)),
    ("CD0", 1024, 0.8433, 1e-2): ((0.01458, 0.00004), (0.02067, 0.00007), (3.4946, 0.0018)),
    ("CD0", 1024, 0.8433, 1e-3): ((3.639e-3, 0.016e-3), (9.89e-3, 0.05e-3), (3.8420, 0.0017)),
    ("CDn", 256, 0.78, 1e-2): ((5.88e-4, 0.10e-4), (1.61e-3, 0.03e-3), None),
    ("CDn", 256, 0.78, 3e-3): ((6.91e-5, 0.11e-5), (1.97e-4, 0.04e-4), None),
    ("CDt", 256, 0.78, 1e-2): ((0.01014, 0.00011), (0.01075, 0.00017), None),
    ("CDt", 256, 0.78, 3e-3): ((3.89e-3, 0.06e-3), (5.08e-3, 0.12e-3), None),
    ("CD", 256, 0.78, 1e-2): ((0.01066, 0.00009), (0.01115, 0.00011), None),
    ("CD", 256, 0.78, 3e-3): ((4.09e-3, 0.04e-3), (5.33e-3, 0.07e-3), None),
    ("RD", 256, 0.78, 1e-2): ((2.16e-3, 0.12e-3), (6.0e-3, 0.3e-3), None),
    ("RD", 256, 0.78, 3e-3): ((1.08e-3, 0.02e-3), (2.93e-3, 0.05e-3), None),
}
# (N, φ) sheared quasistatically, steps 1e-3 over strain 8 at N = 64, 2e-3 over 4 at 256: σ, p, jammed fraction
SLOW = {
    (64, 0.835): ((2.9e-5, 0.6e-5), (2.7e-4, 0.5e-4), (0.36, 0.06)),
    (64, 0.84): ((9.8e-5, 0.7e-5), (1.00e-3, 0.05e-3), (0.80, 0.02)),
    (64, 0.845): ((1.66e-4, 0.11e-4), (2.02e-3, 0.13e-3), (0.970, 0.014)),
    (64, 0.86): ((4.4e-4, 0.4e-4), (6.43e-3, 0.13e-3), None),
    (256, 0.845): ((9.7e-5, 0.8e-5), (1.04e-3, 0.08e-3), (0.983, 0.008)),
    (256, 0.86): ((4.2e-4, 0.2e-4), (5.37e-3, 0.07e-3), None),
}
FIGURES |= {("QS", *key, 0.0): figures for key, figures in SLOW.items()}
QUASISTATIC = ("shear_stress", "pressure", "jammed")


def wanted(points):
    """Keys of FIGURES that belong to a choice of points."""
    massive = ("RD", "CD", "CDn", "CDt")
    return {
        "quick": [k for k in FIGURES if k[1] == 256 and k[3] == 1e-2],
        "256": [k for k in FIGURES if k[1] == 256 and k[0] in ("RD0", "CD0")],
        "1024": [k for k in FIGURES if k[1] == 1024],
        "massive": [k for k in FIGURES if k[0] in massive],
        "quasistatic": [k for k in FIGURES if k[0] == "QS"],
    }[points]


def measured(model, n, phi, rate, seed, folder):
    """Attributes of one run."""
    out = folder / f"{model}-{n}-{phi}-{rate}-{seed}.h5"
    mass = ["--mass", "1"] if not model.endswith("0") else []
    strain = STRAINS.get(rate, 40)
    words = ["flow", "--n", n, "--phi", phi, "--seed", seed, "--model", model, *mass, "--rate", rate]
    discard = 2
    if model == "QS":
        step, strain, discard = (1e-3, 8, 1) if n == 64 else (2e-3, 4, 1)
        words = ["shear", "--n", n, "--phi", phi, "--seed", seed, "--step", step]
    with contextlib.redirect_stdout(io.StringIO()):
        status = cli.main(
            [str(word) for word in (*words, "--strain", strain, "--discard", discard, "--out", out)]
        )
    if status:
        sys.exit("jampetsc flow failed")
    return jampetsc.load(out).attributes


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument(
        "--points", choices=("quick", "256", "1024", "massive", "quasistatic"), default="quick"
    )
    parser.add_argument("--seeds", type=both_included, default="1:2", metavar="A:B")
    args = parser.parse_args()
    print(
        f"{'model':5} {'N':>5} {'phi':>7} {'rate':>6}  quantity: jampetsc ± error | figure ± error (difference)"
    )
    with tempfile.TemporaryDirectory() as folder:
        for key in wanted(args.points):
            runs = [measured(*key, seed, Path(folder)) for seed in args.seeds]
            parts = []
            for q, name in enumerate(QUASISTATIC if key[0] == "QS" else QUANTITIES):
                if FIGURES[key][q] is None:
                    continue
                mean, error = mean_of_facts(runs, name)
                figure, its = FIGURES[key][q]
                z = (mean - figure) / np.hypot(error, its)
                parts.append(f"{name}: {mean:.4g} ± {error:.1g} | {figure:.4g} ± {its:.1g} ({z:+.1f})")
            if key[0] != "QS":
                parts.append("balance " + ", ".join(f"{run['energy_balance']:.3f}" for run in runs))
            print(f"{key[0]:5} {key[1]:5} {key[2]:7} {key[3]:6g}  {'; '.join(parts)}", flush=True)


if __name__ == "__main__":
    main()
