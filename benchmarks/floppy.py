"""Floppy motion against pressure (BT eqs. 19-21): medians per unit strain, fitted slopes with bootstrap
errors.

    .venv/bin/python benchmarks/floppy.py [--n 1024] [--seeds 1:10] [--pressures 1e-2,1e-3,1e-4] [--modes 50]

BT expect |Δu∥| ~ p^¼, |Δu⊥| ~ p^−¼, |u_na| ~ p^−¼ for p → 0 and N → ∞; at N = 1024 the slopes still drift, to
about +0.31, −0.22 and −0.30 without pre-stress. Then two checks on claims: the mean of |Δu∥| over its rms
(0.80 for a normal distribution; a plateau of the mean alone would show here), and the share of Σ|u_na|² that
the lowest modes carry. Errors come from drawing whole packings again.
"""

import argparse
import subprocess
import sys

import numpy as np
from common import FOLDER, both_included, environment, machine

from jampetsc.analysis.statistics import draws_of

NAMES = ("normal", "transverse", "nonaffine")
SYMBOLS = ("|Δu∥|", "|Δu⊥|", "|u_na|")
EXPECTED = (0.25, -0.25, -0.25)


def ensemble(n, pressures, seeds):
    """{(pressure, seed): file}, made by `jampetsc pack` where they are missing."""
    FOLDER.mkdir(exist_ok=True)
    files = {(p, seed): FOLDER / f"n{n}-p{p}-s{seed}.h5" for p in pressures for seed in seeds}
    for seed in seeds:
        if all(files[p, seed].exists() for p in pressures):
            continue
        out = FOLDER / f"n{n}-p{{pressure}}-s{seed}.h5"
        command = ["pack", "--n", n, "--pressure", ",".join(pressures), "--seed", seed, "--out", out]
        subprocess.run([sys.executable, "-m", "jampetsc", *map(str, command)], check=True, env=environment())
    return files


def measure(files, modes):
    """Rows (p, seed, pre-stress or not, three medians, mean/rms of Δu∥, G₀, share of the low modes)."""
    from jampetsc.core.laws import damping_law
    from jampetsc.errors import InputError
    from jampetsc.io.packing_file import read_packing
    from jampetsc.linear.modes import lowest_modes
    from jampetsc.linear.quasistatic import solve
    from jampetsc.linear.viscosity import Viscosity
    from jampetsc.mechanics.network import build_network
    from jampetsc.petsc import session

    comm = session.start("real").comm
    rows = []
    for (p, seed), path in files.items():
        law = damping_law(beta=0.0)
        for prestress in (False, True):
            network = build_network(read_packing(path), comm, prestress)
            viscosity = Viscosity(network, law)
            try:
                found = solve(network, law, viscosity)
            except InputError as error:
                print(f"{path.name}: left out: {error}")
                continue
            finally:
                viscosity.destroy()
            by_name = found.distributions()
            share = lowest_modes(network, modes).carried.share["nonaffine"].sum() if modes else np.nan
            rows.append(
                (float(p), seed, prestress, *(by_name[name].median for name in NAMES),
                 by_name["normal"].mean / by_name["normal"].rms, found.G0, share)
            )  # fmt: skip
    return np.array(rows, float)


def ensemble_slope(x, y, group, repeats=400):
    """(slope, its standard error) of ln y against ln x over an ensemble, by bootstrap over packings.

    x, y (M,) positive; group (M,) names the packing (a seed) that a point comes from: the same one at several
    pressures is not independent, so whole packings are drawn. The fit is through medians of y at each x.
    """
    x, y, group = np.asarray(x), np.asarray(y), np.asarray(group)

    def fit(rows):
        u = np.unique(x[rows])
        v = [np.median(y[rows][x[rows] == value]) for value in u]
        return np.polyfit(np.log(u), np.log(v), 1)[0]

    members = [np.flatnonzero(group == name) for name in np.unique(group)]
    draws = [fit(np.concatenate([members[k] for k in row])) for row in draws_of(len(members), repeats)]
    return float(fit(np.arange(len(x)))), float(np.std(draws))


def show(rows, title, modes):
    """Print one table: medians over packings at each pressure, and the slopes."""
    print(f"\n{title}")
    print(
        "       p  packings" + "".join(f"{name:>9}" for name in SYMBOLS) + "  mean/rms Δu∥  G₀/√p  G₀ < 0",
        end="",
    )
    print(f"  share of {modes} modes" if modes else "")
    for p in np.unique(rows[:, 0]):
        here = rows[rows[:, 0] == p]
        middle = np.median(here, axis=0)
        print(f"{p:8.0e}  {len(here):8d}" + "".join(f"{x:9.4f}" for x in middle[3:6]), end="")
        print(f"  {middle[6]:12.3f}  {middle[7] / np.sqrt(p):5.3f}  {np.sum(here[:, 7] < 0):6d}", end="")
        print(f"  {middle[8]:.3f}" if modes else "")
    for column, (symbol, expected) in enumerate(zip(SYMBOLS, EXPECTED, strict=True), 3):
        slope, error = ensemble_slope(rows[:, 0], rows[:, column], rows[:, 1])
        print(f"  {symbol:6} ~ p^{slope:+.3f} ± {error:.3f}   (BT: {expected:+.2f})")


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", type=int, default=1024, help="disks (default 1024)")
    parser.add_argument("--seeds", type=both_included, default="1:10", help="A:B, B included (default 1:10)")
    parser.add_argument("--pressures", default="1e-2,1e-3,1e-4", help="default 1e-2,1e-3,1e-4")
    parser.add_argument(
        "--modes", type=int, default=50, help="low modes whose share is told, 0 for none (default 50)"
    )
    args = parser.parse_args()
    print(f"{machine()}; N = {args.n}, seeds {args.seeds[0]} to {args.seeds[-1]}")
    rows = measure(ensemble(args.n, args.pressures.split(","), args.seeds), args.modes)
    for prestress in (False, True):
        title = "with pre-stress" if prestress else "without pre-stress"
        show(rows[rows[:, 2] == prestress], title, args.modes)


if __name__ == "__main__":
    main()
