"""Minimisers and dynamics from the same starts: do single states differ, and do their mean energies (V, sec. 4.7)?

    .venv/bin/python -m papers.tables.relaxation figures/relaxation-quick --n 64 --starts 160 --picture x.png

Starts are the states of RD0 sheared at γ̇ = 1e-2. From each, minima are found by nonlinear conjugate gradients (V's
choice), by `minimise` (L-BFGS with longer moves, then Newton's method), and by RD0 itself, whose cell stands still but
for a strain of 1e-12 in all. What is there already (table.csv) is read, not computed.
"""

from pathlib import Path

import numpy as np

from benchmarks.common import saved_page
from benchmarks.conjugate_gradients import conjugate
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.io.reader import load
from jampetsc.plots import style
from papers.programs import folder_and_picture, read_rows, write_rows

PHI, RATE, STRAIN = 0.86, 1e-2, 2.0  # of the starts
STILL = 1e-12  # strain while disks relax
DURATION = 3e4  # in k_d d²/k_e
SAME = 1e-3  # relative difference of energies above which two states are not the same
FORCE = 1e-10  # max |F| in k_e/d of conjugate gradients
MOST = 20_000  # of their force evaluations, a few hundred are usual; starts where they do not suffice are left out
MINIMISERS = {"gradients": "conjugate gradients", "minimise": "minimise"}
COLUMNS = "command,file,state,n,phi,seed,gradients,minimise,dynamics,earlier".split(",")


def relaxed(n, seed):
    """The row of one start: U/N of its minima, and U/N of the dynamics at half of the time."""
    import jampetsc
    from jampetsc.jamming.stepwise_shear import measure_minimum
    from jampetsc.minimisation.descent import Goal
    from jampetsc.minimisation.minimise import minimise
    from jampetsc.petsc.hessian_solver import NewtonSolver

    drag = jampetsc.models.RD0()
    start = jampetsc.flow(n=n, phi=PHI, seed=seed, model=drag, rate=RATE, strain=STRAIN, discard=0.0).last
    # so few rows after discard that work and dissipation are not compared
    still = {"rate": STILL / DURATION, "strain": STILL, "discard": 0.9 * STILL}
    slow = jampetsc.flow(start, model=drag, **still)
    descended, evaluations = conjugate(start, FORCE, MOST)
    ends = {
        "gradients": descended,
        "minimise": minimise(start, Goal(), NewtonSolver(), tolerance=1e-8).disks,
        "dynamics": slow.last,
    }
    found = {name: measure_minimum(disks).energy / n for name, disks in ends.items()}
    if evaluations >= MOST:
        found["gradients"] = np.nan
    earlier = slow["energy"][len(slow["energy"]) // 2] / n
    return {
        "command": "relaxation",
        "state": "done",
        "n": n,
        "phi": PHI,
        "seed": seed,
        "earlier": earlier,
    } | found


def compute(folder: Path, n, starts):
    """Write the table of the starts with seeds 1 … starts, row by row, those that are there left as they are."""
    from jampetsc.petsc import session

    path = folder / "table.csv"
    rows = read_rows(path)
    done = {int(row["seed"]) for row in rows}
    session.start("real")
    for seed in range(1, starts + 1):
        if seed not in done:
            rows.append(relaxed(n, seed))
            write_rows(path, COLUMNS, rows)


def compared(table, minimiser):
    """((ratio of ⟨U⟩, its error), (share of starts with another state, its error)) of dynamics and a minimiser.

    The error of the ratio is that of the differences of pairs.
    """
    table = table.taken(np.isfinite(table[minimiser]))
    one, other = table[minimiser], table["dynamics"]
    difference, error = mean_with_error(other - one)
    share, of_share = mean_with_error(1.0 * (np.abs(other / one - 1.0) > SAME))
    return (1.0 + difference / one.mean(), error / one.mean()), (share, of_share)


def unfinished(table):
    """Largest relative change of U of the dynamics in the second half of the time."""
    return float(np.max(np.abs(table["earlier"] / table["dynamics"] - 1.0)))


def draw(table, path):
    """U/N of the dynamics against that of the minimisers."""
    with saved_page(path) as page:
        axes = page.panels(1, len(MINIMISERS), style.PAGE, 3.0, x=[f"$U/N$ of {name}" for name in MINIMISERS.values()],
                           y="$U/N$ of RD0 at rest")  # fmt: skip
        for ax, name in zip(axes, MINIMISERS, strict=True):
            most = np.nanmax((table[name], table["dynamics"]))
            ax.plot([0, most], [0, most], "-", lw=0.6, color=style.GREY)
            ax.plot(table[name], table["dynamics"], "o", mfc="none", ms=3, color="k")


def main():
    args = folder_and_picture(__doc__, "draw one energy against the other", n=64, starts=160)
    compute(args.folder, args.n, args.starts)
    table = load(args.folder)
    print(
        "| minimiser | N | starts | ⟨U⟩ of the dynamics over its own | other states |\n|---|---|---|---|---|"
    )
    for name, words in MINIMISERS.items():
        (ratio, error), (share, of_share) = compared(table, name)
        told = f"{ratio:.3f} ± {error:.3f} | {share:.2f} ± {of_share:.2f}"
        print(f"| {words} | {args.n} | {table.rows} | {told} |")
    print(f"largest change of U of the dynamics in the second half of the time: {unfinished(table):.1e}")
    if args.picture:
        draw(table, args.picture)


if __name__ == "__main__":
    main()
