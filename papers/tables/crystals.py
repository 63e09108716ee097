"""Order of particles of one size under steady shear, in cells that fit a triangular lattice or not (V, sec. 4.3.1).

    .venv/bin/python -m papers.tables.crystals figures/crystals-quick --seeds 4 --picture x.png

Flows of RD0. A square cell fits where it has r rows of m disks, N = mr and r/m near 2/√3. Spheres of one and of two
sizes follow, whose order is Q₆. What is there already (table.csv) is read, not computed.
"""

import math
from pathlib import Path

import numpy as np

from benchmarks.common import saved_page
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.io.disk_motion import six_fold_order
from jampetsc.io.reader import load
from jampetsc.plots import style
from jampetsc.plots.page import draw_points
from papers.programs import folder_and_picture, read_rows, write_rows

FITTING, BETWEEN = (168, 195, 224), (181, 209)  # N: 12 × 14, 13 × 15, 14 × 16, and halfway in m and r
RATE, PHI, PHI_SPHERES = 1e-3, 0.80, 0.61
NEIGHBOURS, DEGREE = 12, 6  # of a sphere in a close packing; of the spherical harmonics
COLUMNS = "command file state dimension n phi rate strain sizes seed start order late".split()


def bond_order(positions, cell) -> float:
    """Q₆ = [4π/13 Σ_m |⟨Y₆ₘ⟩|²]^½ over the bonds of spheres to their 12 nearest neighbours.

    positions (N, 3) anywhere, cell (3, 3) with rows a₁, a₂, a₃. It is .575 in an fcc crystal, ~ 1/√N in a liquid
    (Steinhardt, Nelson & Ronchetti, Phys. Rev. B 28, 784 (1983)).
    """
    from scipy.spatial import cKDTree
    from scipy.special import lpmv

    fractions = np.linalg.solve(cell.T, np.asarray(positions, float).T).T
    inside = (fractions - np.floor(fractions)) @ cell
    shifts = np.stack(np.meshgrid(*[(0, -1, 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) @ cell
    images = (shifts[:, None] + inside).reshape(-1, 3)
    nearest = cKDTree(images).query(inside, NEIGHBOURS + 1)[1][:, 1:]
    bonds = (images[nearest] - inside[:, None]).reshape(-1, 3)
    cosine, angle = bonds[:, 2] / np.linalg.norm(bonds, axis=1), np.arctan2(bonds[:, 1], bonds[:, 0])
    total = 0.0
    for m in range(DEGREE + 1):
        # 4π/13 of the norm of Y₆ₘ; −m has the modulus of m
        weight = (2 - (m == 0)) * math.factorial(DEGREE - m) / math.factorial(DEGREE + m)
        total += weight * abs(np.mean(lpmv(m, DEGREE, cosine) * np.exp(1j * m * angle))) ** 2
    return math.sqrt(total)


def order_of(flow) -> np.ndarray:
    """|⟨ψ₆⟩| of disks, Q₆ of spheres, at each snapshot, (S,)."""
    if flow["snapshots/positions"].shape[-1] == 2:
        return six_fold_order(flow)[1]
    states = zip(flow["snapshots/positions"], flow["snapshots/cell"], strict=True)
    return np.array([bond_order(*state) for state in states])


def compute(folder: Path, seeds, strain, spheres, sphere_seeds, sphere_strain):
    """Write the table, row by row."""
    import jampetsc

    path = folder / "table.csv"
    rows = read_rows(path)
    cases = [(2, n, PHI, "monodisperse", strain, seeds) for n in sorted((*FITTING, *BETWEEN))]
    cases += [
        (3, spheres, PHI_SPHERES, sizes, sphere_strain, sphere_seeds)
        for sizes in ("monodisperse", "bidisperse")
    ]
    made = {tuple(row[name] for name in ("dimension", "n", "sizes", "seed")) for row in rows}
    for dimension, n, phi, sizes, distance, count in cases:
        for seed in range(1, count + 1):
            if (str(dimension), str(n), sizes, str(seed)) in made:
                continue
            start = {"dimension": dimension, "n": n, "phi": phi, "sizes": sizes, "seed": seed}
            run = {"rate": RATE, "strain": distance, "discard": 0.0, "snapshots": 41}
            order = order_of(jampetsc.flow(model=jampetsc.models.RD0(), **start, **run))
            found = {"start": order[0], "order": order.mean(), "late": order[len(order) // 2 :].mean()}
            of = {"command": "crystals", "state": "done", "rate": RATE, "strain": distance}
            rows.append(of | start | found)
            write_rows(path, COLUMNS, rows)


def means(table, dimension, column="order"):
    """[(N, sizes, mean of a column over seeds, its error)] of disks or spheres."""
    rows = table.where(dimension=dimension)
    return [
        (int(key["n"]), key["sizes"], *mean_with_error(part[column]))
        for key, part in rows.groups(["n", "sizes"])
    ]


def draw(table, path):
    """Mean order of disks against N, and of spheres at the start and in the second half of the strain."""
    with saved_page(path) as page:
        axes = page.panels(1, 2, style.PAGE, 2.6, y=[r"$|\langle\psi_6\rangle|$", "$Q_6$"])
        n, _, order, error = np.array(means(table, 2), dtype=object).T
        for (name, chosen), look in style.looks((("fits", FITTING), ("halfway", BETWEEN))):
            here = np.isin(n.astype(int), chosen)
            values = (column[here].astype(float) for column in (n, order, error))
            draw_points(axes[0], *values, ls="none", ms=4, label=name, **look)
        axes[0].set(xlabel="$N$")
        names = ("monodisperse", "bidisperse")
        for (column, words), look in style.looks((("start", "random start"), ("late", "after shear"))):
            found = {sizes: (value, own) for _, sizes, value, own in means(table, 3, column)}
            values = np.array([found[name] for name in names])
            draw_points(axes[1], np.arange(2.0), *values.T, ls="none", ms=4, label=words, **look)
        axes[1].set(xticks=(0, 1), xticklabels=("one size", "two sizes"), xlim=(-0.5, 1.5))
        for ax in axes:
            page.legend(ax, first="upper right")


def main():
    args = folder_and_picture(
        __doc__,
        "draw order against N, and of spheres",
        seeds=4,
        strain=50.0,
        spheres=256,
        sphere_seeds=2,
        sphere_strain=10.0,
    )
    compute(args.folder, args.seeds, args.strain, args.spheres, args.sphere_seeds, args.sphere_strain)
    table = load(args.folder)
    print("| D | N | sizes | order at the start | mean | second half |\n|---|---|---|---|---|---|")
    for dimension in (2, 3):
        columns = [means(table, dimension, name) for name in ("start", "order", "late")]
        for (n, sizes, *start), (*_, a, b), (*_, c, d) in zip(*columns, strict=True):
            print(f"| {dimension} | {n} | {sizes} | {start[0]:.3f} | {a:.3f} ± {b:.3f} | {c:.3f} ± {d:.3f} |")
    if args.picture:
        draw(table, args.picture)


if __name__ == "__main__":
    main()
