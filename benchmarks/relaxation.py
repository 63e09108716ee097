"""Minimiser and dynamics from the same starts: single states differ, the means of their energies do not (V, sec. 4.7).

    .venv/bin/python benchmarks/relaxation.py figures/relaxation-quick --n 64 --samples 100 --picture x.png

Starts are the states of RD0 sheared at γ̇ = 1e-2. Each goes to a minimum of the energy by `minimise`, and by RD0 itself,
whose cell stands still but for a strain of 1e-12 in all. What is there already (table.csv) is read, not computed.
"""

import csv
from pathlib import Path

import numpy as np
from common import folder_and_picture, saved_page

from jampetsc.analysis.statistics import mean_with_error
from jampetsc.io.reader import load
from jampetsc.plots import style

PHI, RATE, STRAIN = 0.86, 1e-2, 2.0  # of the starts
STILL = 1e-12  # strain while disks relax
DURATION = 3e4  # in k_d d²/k_e
SAME = 1e-3  # relative difference of energies above which two states are not the same
COLUMNS = "command,file,state,n,phi,seed,minimised,dynamics,earlier,dynamics_pressure,minimised_pressure".split(",")


def relaxed(n, seed):
    """The row of one start: U/N and p of both minima, and U/N of the dynamics at half of the time."""
    import jampetsc
    from jampetsc.flows.quasistatic_shear import minimum_of
    from jampetsc.minimise.descent import Goal
    from jampetsc.minimise.minimise import minimise
    from jampetsc.petsc.local import NewtonSolver

    drag = jampetsc.models.RD0()
    start = jampetsc.flow(n=n, phi=PHI, seed=seed, model=drag, rate=RATE, strain=STRAIN, discard=0.0).last
    first = minimum_of(minimise(start, Goal(), NewtonSolver(), tolerance=1e-8).disks)
    still = {"rate": STILL / DURATION, "strain": STILL, "discard": 0.9 * STILL}  # no balance of work and dissipation
    slow = jampetsc.flow(start, model=drag, **still)
    second = minimum_of(slow.last)
    return {
        "command": "relaxation", "file": "", "state": "done", "n": n, "phi": PHI, "seed": seed,
        "minimised": first.energy / n, "minimised_pressure": first.pressure,
        "dynamics": second.energy / n, "dynamics_pressure": second.pressure,
        "earlier": slow["energy"][len(slow["energy"]) // 2] / n,
    }  # fmt: skip


def compute(folder: Path, n, samples):
    """Write the table of starts 1 … samples, row by row, those that are there left as they are."""
    from jampetsc.petsc import session

    path = folder / "table.csv"
    folder.mkdir(parents=True, exist_ok=True)
    rows = list(csv.DictReader(path.open())) if path.exists() else []
    done = {int(row["seed"]) for row in rows}
    session.start("real")
    for seed in range(1, samples + 1):
        if seed not in done:
            rows.append(relaxed(n, seed))
            with path.open("w", newline="") as file:
                writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
                writer.writeheader()
                writer.writerows(rows)


def compared(table):
    """((ratio of ⟨U⟩, its error), share of pairs of states that differ, largest change in the second half of the time).

    The ratio is of dynamics over minimiser; its error from the differences of pairs.
    """
    one, other = table["minimised"], table["dynamics"]
    difference, error = mean_with_error(other - one)
    ratio = 1.0 + difference / one.mean(), error / one.mean()
    change = float(np.max(np.abs(table["earlier"] / other - 1.0)))
    return ratio, np.abs(other / one - 1.0) > SAME, change


def draw(table, path):
    """U/N of the dynamics against U/N of the minimiser."""
    with saved_page(path) as page:
        ax = page.panels(1, 1, 3.4, 3.2)
        ax.plot(table["minimised"], table["dynamics"], "o", mfc="none", ms=3, color="k")
        ends = [min(table["minimised"].min(), table["dynamics"].min()), table["minimised"].max()]
        ax.plot(ends, ends, "-", lw=0.6, color=style.GREY)
        ax.set_xlabel(r"$U/N$ of the minimiser ($k_e$)")
        ax.set_ylabel(r"$U/N$ of RD0 at rest ($k_e$)")


def main():
    args = folder_and_picture(__doc__, "draw one energy against the other", n=64, samples=100)
    compute(args.folder, args.n, args.samples)
    table = load(args.folder)
    (ratio, error), differ, change = compared(table)
    print("| N | starts | ⟨U⟩ dynamics/minimiser | states that differ | largest change in the second half |")
    print("|---|---|---|---|---|")
    print(f"| {args.n} | {table.rows} | {ratio:.3f} ± {error:.3f} | {differ.mean():.0%} | {change:.1e} |")
    if args.picture:
        draw(table, args.picture)


if __name__ == "__main__":
    main()
