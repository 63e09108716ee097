"""Where linear response ends: a table of G* against strain, for docs/nonlinear.md.

    .venv/bin/python benchmarks/softening.py figures/softening/n256          # after run/figures/softening

Median over packings (least to largest). Linear response is that of the smallest strain in a file.
"""

import argparse
import re
from collections import defaultdict
from pathlib import Path

import numpy as np

from jampetsc.storage.reader import load


def told(values):
    """Median (least to largest)."""
    return f"{np.median(values):.3g} ({min(values):.3g} to {max(values):.3g})"


def main():
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("folder", type=Path)
    folder = words.parse_args().folder
    found = defaultdict(list)
    for path in sorted(folder.glob("oscillate-*.h5")):
        p = float(re.match(r"oscillate-(.+)-\d+\.h5", path.name).group(1))
        found[p].append(load(path))
    print(
        "| p | γ₀/p | G'/G'(0) | G''/G''(0) | third harmonic | change of the last cycle | error | balance |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for p, files in sorted(found.items(), reverse=True):
        for a, strain in enumerate(files[0]["amplitude"]):
            solved = [file for file in files if np.isfinite(file["G"][a, 0])]
            if not solved:
                continue
            G = [file["G"][:, 0] for file in solved]
            columns = (
                [one[a].real / one[0].real for one in G],
                [one[a].imag / one[0].imag for one in G],
                [abs(file["harmonics"][a, 0, 0]) for file in solved],
                [file["cycle_change"][a, 0] / abs(file["G"][a, 0]) for file in solved],
                [file["error"][a, 0] / abs(file["G"][a, 0]) for file in solved],
                [abs(file["energy_balance"][a, 0]) for file in solved],
            )
            print(f"| {p:g} | {strain / p:.3g} | " + " | ".join(told(column) for column in columns) + " |")


if __name__ == "__main__":
    main()
