"""Velocity profiles between walls in windows of strain: where the shear is at the start, and in the steady state."""

from itertools import pairwise

import numpy as np

from jampetsc.analysis.profiles import heights, mean_profile
from jampetsc.errors import InputError
from jampetsc.plots.shearing import kind_of, labels_of
from jampetsc.plots.style import GREY, MARKERS, PAGE, colours, figure, letter_panels, number, save

HEIGHT = 3.0  # inches
WINDOWS = (0.0, 0.1, 0.3, 1.0)  # strains between which the start is shown; the last window is the steady part
PANELS = 3


def plot_profiles(results, path) -> None:
    """y/H − ½ against v_x/(γ̇H), a panel for each kind and rate, runs averaged; dotted: linear, bars: standard errors.

    Raises InputError for files without profiles, and for more kinds than PANELS.
    """
    kinds = {}
    for result in results:
        kinds.setdefault((kind_of(result), float(result.attributes["rate"])), []).append(result)
    if len(kinds) > PANELS:
        raise InputError(f"{len(kinds)} kinds of flow: one picture of profiles shows {PANELS}; choose some")
    rates = {rate for _, rate in kinds}
    with figure(PAGE, HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(1, len(kinds), squeeze=False, sharey=True)[0]
        names = labels_of([kind for kind, _ in kinds])
        for ax, ((_, rate), runs), name in zip(axes, kinds.items(), names, strict=True):
            steady, end = (min(float(f(run)) for run in runs) for f in (_discard, _end))
            edges = [edge for edge in WINDOWS if edge < steady]
            windows = [*pairwise(edges), (steady, end)]
            ax.plot([-0.5, 0.5], [-0.5, 0.5], color=GREY, lw=0.8, ls=":", zorder=1)
            for (low, high), colour, marker in zip(windows, colours(len(windows)), MARKERS, strict=False):
                v, error = mean_profile(runs, low, high)
                look = {"color": colour, "marker": marker, "ms": 3, "lw": 0.8, "elinewidth": 0.6}
                ax.errorbar(
                    v, heights(len(v)), xerr=np.nan_to_num(error), label=f"${low:g}$ to ${high:.3g}$", **look
                )
            told = rf"{name}, $\dot\gamma={number(rate)}$" if len(rates) > 1 else name
            ax.set(xlabel=r"$v_x/(\dot\gamma H)$", xlim=(-0.52, 0.52), ylim=(-0.5, 0.5))
            ax.set_title(told, loc="right", pad=3)
        axes[0].set_ylabel(r"$y/H-\frac{1}{2}$")
        axes[0].legend(title=r"$\gamma$", title_fontsize=8.5)
        letter_panels(axes)
        save(fig, path)


def _discard(run):
    return run.attributes["discard"]


def _end(run):
    return run["strain"][-1]
