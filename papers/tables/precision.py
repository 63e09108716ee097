"""Residual forces of coordinates in doubles and in two parts: table and picture of run/figure split-coordinates.

    .venv/bin/python -m papers.tables.precision figures/split-coordinates-quick --picture x.png

Net forces on the disks of a packing against their distance from the origin, the middle of the cell: with every
coordinate as jampetsc has it, base + offset, and rounded to one double. rms over octaves of the distance, in p d, up to
the edges of the cell. What is there already (forces.csv) is read, not computed.
"""

import csv

import numpy as np

from benchmarks.common import saved_page
from jampetsc.io.reader import load
from jampetsc.packing.contacts import find_contacts, net_forces, typical_force
from jampetsc.packing.neighbours import lengths
from jampetsc.packing.packing import Packing
from jampetsc.plots import style
from papers.programs import folder_and_picture

FORCES = "forces.csv"
COLUMNS = ("n", "pressure", "distance", "disks", "two_parts", "doubles")
FEWEST = 8  # disks of an octave


def forces_of(disks, rounded):
    """|F| (N,) of all contacts; rounded: of coordinates in one double."""
    if rounded:
        disks = Packing.from_positions(disks.positions, disks.radii, disks.cell, disks.potential)
    return lengths(net_forces(disks.n, find_contacts(disks)))


def centred(disks):
    """The packing in a cell whose middle is the origin."""
    turns = np.round(np.linalg.solve(disks.cell.T, disks.positions.T).T)
    base, offset = disks.base - turns @ disks.cell_base, disks.offset - turns @ disks.cell_offset
    return disks.replace(base=base, offset=offset)


def residuals(disks):
    """(distances from the origin over that of the edge, distances, |F|/(p d^(D−1)) (2, M)) of the M disks inside."""
    disks = centred(disks)
    distance, unit = lengths(disks.positions), typical_force(disks, disks.record["pressure"])
    edge = 0.5 * np.min(np.diag(disks.cell)) - 2.0 * disks.radii.max()
    inside = distance < edge
    forces = np.array([forces_of(disks, rounded) / unit for rounded in (False, True)])
    return distance[inside] / edge, distance[inside], forces[:, inside]


def rows_of(packings):
    """Rows of COLUMNS of the packings at a pressure, an octave of the distance each."""
    share, distance, forces = (
        np.concatenate(part, axis=-1) for part in zip(*map(residuals, packings), strict=True)
    )
    octave = np.floor(np.log2(share)).astype(int)
    for one in np.unique(octave):
        inside = octave == one
        if inside.sum() >= FEWEST:
            centre = float(np.exp(np.mean(np.log(distance[inside]))))
            rms = np.sqrt(np.mean(forces[:, inside] ** 2, axis=1)).tolist()
            yield packings[0].n, packings[0].record["pressure"], centre, int(inside.sum()), *rms


def gradients(folder):
    """{name: (rows,) array} of COLUMNS for the packings of a study in `folder`, from forces.csv if that is there."""
    path = folder / FORCES
    if not path.exists():
        table = load(folder).where(command="pack")
        rows = [row for _, some in table.groups(["pressure"]) for row in rows_of(some.results())]
        with path.open("w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])
    return {name: np.atleast_1d(column) for name, column in zip(COLUMNS, read(path), strict=True)}


def read(path):
    """The columns of forces.csv."""
    return np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2).T


def draw(found, path):
    """Residual forces against the distance from the origin, for each pressure."""
    with saved_page(path) as page:
        ax = page.panels(
            1, 1, 3.8, 3.0, x="distance from the origin ($d$)", y="rms $|F|$ ($p\\,d$)", log="xy"
        )
        levels = np.unique(found["pressure"])
        for p, colour in zip(levels, style.colours(len(levels)), strict=True):
            at = found["pressure"] == p
            for name, fmt in (("doubles", "o-"), ("two_parts", "s--")):
                label = f"{name.replace('_', ' ')}, $p$ = {p:g}"
                ax.plot(found["distance"][at], found[name][at], fmt, ms=3, lw=0.6, color=colour, label=label)
        page.legend(ax)


def main():
    args = folder_and_picture(__doc__, "draw forces against distances")
    found = gradients(args.folder)
    print("| N | p | distance | disks | two parts | doubles |\n|---|---|---|---|---|---|")
    for n, p, distance, count, two, one in zip(*found.values(), strict=True):
        print(f"| {n:.0f} | {p:g} | {distance:.3g} | {count:.0f} | {two:.2e} | {one:.2e} |")
    if args.picture:
        draw(found, args.picture)


if __name__ == "__main__":
    main()
