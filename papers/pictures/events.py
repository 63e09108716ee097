"""The first change of contacts in slow shear: its strain against pN², and whether a contact opens or closes."""

import numpy as np

import jampetsc
from jampetsc.analysis.statistics import median_interval
from jampetsc.plots.event_plots import CLOSES, OPENS, UNSTABLE
from jampetsc.plots.page import draw_points
from jampetsc.plots.style import PAGE, hidden, looks
from papers.pictures.shared import drawn

# slope of γ_c N² at small and at large pN², and where it is drawn
LINES = (1.0, (1e-4, 3e-2)), (0.5, (1e1, 1e5))


def first_change(result):
    """(|γ|, kind) of the first event under force; where none is left at once it opens. (inf, nan) without one."""
    kinds = result["events/kind"]
    rows = np.flatnonzero(kinds <= UNSTABLE)
    if len(rows):
        return abs(float(result["events/strain"][rows[0]])), int(kinds[rows[0]])
    end = result.attributes.get("came_apart")
    return (np.inf, np.nan) if end is None else (abs(float(end)), OPENS)


def ensembles(table):
    """{N: rows (pN², median of γN², its two ends, share that opens, its error)} of the runs of a study."""
    found = {}
    for chosen, runs in table.where(command="shear", state="done").groups(["n", "pressure"]):
        n, p = int(chosen["n"]), float(chosen["pressure"])
        strain, kinds = np.transpose([first_change(run) for run in runs.results()])
        opens, closes = np.count_nonzero(kinds == OPENS), np.count_nonzero(kinds == CLOSES)
        share = (opens + 1) / (opens + closes + 2)  # Laplace's rule, whose error is not zero at an end
        error = np.sqrt(share * (1 - share) / (opens + closes + 3))
        median = np.median(strain), *median_interval(strain)
        found.setdefault(n, []).append((p * n**2, *(n**2 * value for value in median), share, error))
    return {n: np.array(sorted(rows)) for n, rows in sorted(found.items())}


@drawn("first-changes")
def first_changes(page, folder):
    """Medians of γN² of the first change against pN², with slopes 1 and ½; share of first changes that open."""
    found = ensembles(jampetsc.load(folder))
    axes = page.panels(
        1, 2, PAGE, 2.9, x=r"$pN^2/k$", y=[r"$\gamma_c N^2$", "share that opens"], log=["xy", "x"]
    )  # fmt: skip
    for (n, rows), (_, look) in zip(found.items(), looks(found), strict=True):
        x, median, low, high, share, error = rows.T
        known = np.isfinite(high)
        label = f"$N={n}$"
        ends = np.array([median[known] - low[known], high[known] - median[known]])
        draw_points(axes[0], x[known], median[known], ends, ls="none", ms=3.5, label=label, **look)
        draw_points(axes[1], x, share, error, ls="none", ms=3.5, label=hidden(label), **look)
    _draw_slopes(axes[0], found)
    axes[1].axhline(0.5, color="0.6", lw=0.6, label=hidden("half"))
    axes[1].set_ylim(0.0, 1.0)
    page.legend(axes[0], first="upper left")


def _draw_slopes(ax, found):
    """Lines of the two slopes through the points of their range."""
    rows = np.concatenate(list(found.values()))
    rows = rows[np.isfinite(rows[:, 1])]
    for slope, (low, high) in LINES:
        inside = (rows[:, 0] >= low) & (rows[:, 0] <= high)
        if inside.any():
            level = np.exp(np.mean(np.log(rows[inside, 1]) - slope * np.log(rows[inside, 0])))
            x = np.array([low, high])
            ax.plot(
                x, level * x**slope, color="0.5", lw=0.8, ls="--", zorder=1, label=hidden(f"slope {slope:g}")
            )
