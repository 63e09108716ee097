"""A transition between Newtonian and Bagnoldian flow, scanned up and down in Q = √(m k_e)/(k_d d_s) (V, sec. 6.4).

    .venv/bin/python -m papers.tables.transition figures/sharp-transition-quick --n 256 --picture x.png

Flows of CD at one φ and one γ̇. Each begins where the one before has ended, so that a state that lasts on both sides of
the transition would show as two branches. Near the transition flows are longer, as states change slowly there. What is
there already (table.csv) is read, not computed.
"""

from pathlib import Path

import numpy as np

from benchmarks.common import saved_page
from jampetsc.io.reader import load
from jampetsc.plots import style
from jampetsc.plots.page import draw_points
from papers.programs import folder_and_picture, read_rows, write_rows

PHI = 0.74
QUALITIES = 13, 21  # ends of the scan
TRANSITION = 17, 19  # ends of the range of longer flows
NAMES = ("stress", "stress_error", "largest_cluster")
COLUMNS = ("command", "file", "state", "direction", "n", "phi", "rate", "quality", *NAMES)


def compute(folder: Path, n, points, rate, strain, longer, seed):
    """Write the table of both scans, row by row; a scan that was interrupted is made again from its begin.

    longer      strain of flows in the range TRANSITION; `strain` is that of the others
    """
    import jampetsc

    path = folder / "table.csv"
    rows = read_rows(path)
    steps = np.linspace(*QUALITIES, points)
    for direction, qualities in (("up", steps), ("down", steps[::-1])):
        if sum(row["direction"] == direction for row in rows) == len(qualities):
            continue
        rows = [row for row in rows if row["direction"] != direction]
        last, start = (), {"n": n, "phi": PHI, "seed": seed}
        for quality in qualities:
            distance = longer if TRANSITION[0] <= quality <= TRANSITION[1] else strain
            discard = distance / 3
            how = {
                "model": jampetsc.models.CD(quality=quality),
                "rate": rate,
                "strain": distance,
                "discard": discard,
            }
            flow = jampetsc.flow(*last, **start, **how)
            last, start, facts = (flow.last,), {}, flow.attributes
            rows.append({
                "command": "transition", "state": "done", "direction": direction, "n": n, "phi": PHI, "rate": rate,
                "quality": quality, "stress": facts["shear_stress_mean"], "stress_error": facts["shear_stress_error"],
                "largest_cluster": flow["largest_cluster"][flow["strain"] > discard].mean() / n,
            })  # fmt: skip
        write_rows(path, COLUMNS, rows)


def scans(table):
    """{direction: (Q, σ, its error, share of the largest cluster), each (M,), Q increasing}."""
    found = {}
    for direction in ("up", "down"):
        rows = table.where(direction=direction)
        order = np.argsort(rows["quality"])
        found[direction] = tuple(rows[name][order] for name in ("quality", *NAMES))
    return found


def falls(quality, stress, error, apart=1):
    """(Q between which σ falls most, ln of the ratio, its error) of a scan with increasing Q.

    apart       steps of the scan from one Q to the other
    """
    logs, relative = np.log(stress), error / stress
    change, own = logs[:-apart] - logs[apart:], np.hypot(relative[:-apart], relative[apart:])
    place = int(np.argmax(change))
    return np.sqrt(quality[place] * quality[place + apart]), change[place], own[place]


def draw(found, path):
    """σ and the share of the largest cluster against Q, of both scans."""
    with saved_page(path) as page:
        axes = page.panels(
            1, 2, style.PAGE, 2.9, x="$Q$", y=[r"$\sigma\ [k]$", "largest cluster $/N$"], log=["y", ""]
        )
        for (direction, (q, stress, error, cluster)), (_, look) in zip(
            found.items(), style.looks(found), strict=True
        ):
            draw_points(axes[0], q, stress, error, ms=3.5, lw=0.8, label=f"$Q$ {direction}", **look)
            axes[1].plot(q, cluster, ms=3.5, lw=0.8, label=style.hidden(direction), **look)
        page.legend(axes[0], first="lower left")


def main():
    args = folder_and_picture(
        __doc__, "draw σ and clusters against Q", n=256, points=9, rate=1e-5, strain=3.0, longer=20.0, seed=1
    )
    compute(args.folder, args.n, args.points, args.rate, args.strain, args.longer, args.seed)
    found = scans(load(args.folder))
    print("| scan | N | Q | σ | largest cluster |\n|---|---|---|---|---|")
    for direction, numbers in found.items():
        for q, stress, error, cluster in zip(*numbers, strict=True):
            print(f"| {direction} | {args.n} | {q:g} | {stress:.3e} ± {error:.1e} | {cluster:.2f} |")
    if args.picture:
        draw(found, args.picture)


if __name__ == "__main__":
    main()
