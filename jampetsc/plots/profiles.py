"""Velocity profiles between walls in windows of strain: where the shear is at the start, and in the steady state."""

from itertools import pairwise

import numpy as np

from jampetsc.analysis.profiles import heights, mean_profile
from jampetsc.errors import InputError
from jampetsc.plots.picture import count, grouped, picture
from jampetsc.plots.shearing import kind_of, labels_of
from jampetsc.plots.style import GREY, PAGE, looks, number

HEIGHT = 3.0  # inches
WINDOWS = (0.0, 0.1, 0.3, 1.0)  # strains between which the start is shown; the last window is the steady part
PANELS = 3


@picture("profile", "flow")
def plot_profiles(results, page):
    """y/H − ½ against v_x/(γ̇H), a panel for each kind and rate, runs averaged; dotted: linear, bars: standard errors.

    Raises InputError for files without profiles, and for more kinds than PANELS.
    """
    kinds = grouped(results, lambda one: (kind_of(one), float(one.attributes["rate"])))
    if len(kinds) > PANELS:
        raise InputError(f"{len(kinds)} kinds of flow: one picture of profiles shows {PANELS}; choose some")
    rates = {rate for _, rate in kinds}
    axes = np.ravel(page.panels(1, len(kinds), PAGE, HEIGHT, sharey=True))
    names = labels_of([kind for kind, _ in kinds])
    for ax, ((_, rate), runs), name in zip(axes, kinds.items(), names, strict=True):
        steady = min(float(run.attributes["discard"]) for run in runs)
        end = min(float(run["strain"][-1]) for run in runs)
        windows = [*pairwise([edge for edge in WINDOWS if edge < steady]), (steady, end)]
        ax.plot([-0.5, 0.5], [-0.5, 0.5], color=GREY, lw=0.8, ls=":", zorder=1)
        for (low, high), look in zip(windows, looks(len(windows)), strict=True):
            v, error = mean_profile(runs, low, high)
            label = f"${low:g}$ to ${high:.3g}$"
            bars = {"xerr": np.nan_to_num(error), "elinewidth": 0.6}
            ax.errorbar(v, heights(len(v)), label=label, ms=3, lw=0.8, **bars, **look)
        told = rf"{name}, $\dot\gamma={number(rate)}$" if len(rates) > 1 else name
        ax.set(xlabel=r"$v_x/(\dot\gamma H)$", xlim=(-0.52, 0.52), ylim=(-0.5, 0.5))
        ax.set_title(told, loc="right", pad=3)
    axes[0].set_ylabel(r"$y/H-\frac{1}{2}$")
    page.legend(axes[0], title=r"$\gamma$", first="upper left")
    return f"velocity between walls of {count(results, 'run', 'runs')} in windows of strain"
