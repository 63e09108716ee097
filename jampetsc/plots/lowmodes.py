"""What the lowest modes are and what they carry of slow shear, against pressure: floppiness, shares, medians."""

import numpy as np
from matplotlib.lines import Line2D

from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import InputError
from jampetsc.plots.floppy import QUANTITIES, groups_of
from jampetsc.plots.logaxes import place_legend, set_log_axes, set_ticks
from jampetsc.plots.style import GREY, MARKERS, PAGE, colours, figure, letter_panels, save

HEIGHT = 3.1  # inches
_DASHES = ("-", (0, (4, 1.6)), (0, (1, 1.2)))


def plot_lowest(results, path) -> None:
    """Means over the files of one pressure, with errors, against p/k:

    (a) floppiness, rms Δu⊥ over rms Δu∥, of the lowest 10, 50 and 200 modes together, with slope −½ (λ ~ p);
    (b) what they carry of Σ|u_na|², Σ(Δu⊥)² and Σ(Δu∥)², affine parts left out;
    (c) medians of the whole response (filled, BT Fig. 5) and of what the most of these modes make up alone (open).

    Raises InputError for files of several N, and for files that do not hold the numbers of modes that others do.
    """
    groups = groups_of(results)
    if len({size for size, _ in groups}) > 1:
        raise InputError(f"{results[0].path}: files of several N: choose one (of a study with --where n=…)")
    for result in results:
        if "lowest/count" not in result or not len(result["lowest/count"]):
            raise InputError(
                f"{result.path}: does not tell what its modes carry of slow shear: find 10 or more, and anew "
                "if the file is an older one"
            )
    count = results[0]["lowest/count"]
    if any(list(result["lowest/count"]) != list(count) for result in results):
        raise InputError(f"{results[0].path}: files with other numbers of modes: find as many in each")
    p = np.array([level for _, level in groups])

    def averages(value, log=True):
        """(mean, error) at each pressure of a number per file; of its logarithm, brought back, if `log`."""
        found = [[value(results[row]) for row in rows] for rows in groups.values()]
        means, errors = np.transpose([mean_with_error(np.log(some) if log else some) for some in found])
        errors = np.nan_to_num(errors)
        return (np.exp(means), np.exp(means) * errors) if log else (means, errors)

    with figure(PAGE, HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(1, 3)
        lines = [[], [], []]

        def draw(panel, values, **look):
            axes[panel].errorbar(p, *values, elinewidth=0.6, markeredgewidth=0.7, **look)
            lines[panel].append((p, values[0]))

        for m, dash, marker in zip(count, _DASHES, MARKERS, strict=False):
            draw(0, averages(lambda one, m=m: _floppiness(one, m)), color="0.2", ls=dash, marker=marker)
        for (name, _), shade in zip(QUANTITIES.items(), colours(len(QUANTITIES)), strict=True):
            for m, dash, marker in zip(count, _DASHES, MARKERS, strict=False):
                share = averages(lambda one, m=m, name=name: one[f"cumulative/{name}"][m - 1], log=False)
                draw(1, share, color=shade, ls=dash, marker=marker)
            whole = averages(lambda one, name=name: one.attributes[f"{name}_median"])
            alone = averages(lambda one, name=name: one[f"lowest/{name}_median"][-1])
            draw(2, whole, color=shade, marker="o", ls="-")
            draw(2, alone, color=shade, marker="o", mfc="white", ls=_DASHES[1])
        for panel, slopes in ((0, [-0.5]), (2, [slope for _, slope in QUANTITIES.values()])):
            for slope, (_, y) in zip(slopes, lines[panel][:: 1 if panel == 0 else 2], strict=False):
                guide = np.exp(np.mean(np.log(y)) + slope * (np.log(p) - np.mean(np.log(p))))
                axes[panel].plot(p, guide, ":", color=GREY, linewidth=0.8, zorder=1)
        for panel in (0, 2):
            set_log_axes(axes[panel], lines[panel])
        axes[1].set(xscale="log", xlim=axes[0].get_xlim(), ylim=(-0.03, 1.03))
        set_ticks(axes[1].xaxis, *np.log10(axes[0].get_xlim()))
        letter_panels(axes)
        axes[0].set(xlabel="$p/k$", ylabel="floppiness of the lowest modes")
        axes[1].set(xlabel="$p/k$", ylabel="share of the lowest modes")
        axes[2].set(xlabel="$p/k$", ylabel="median per unit strain")
        handles = [
            Line2D([], [], color="0.2", ls=dash, marker=marker, label=f"lowest {m}")
            for m, dash, marker in zip(count, _DASHES, MARKERS, strict=False)
        ]
        handles += [
            Line2D([], [], color=shade, label=f"${symbol}$")
            for (symbol, _), shade in zip(QUANTITIES.values(), colours(len(QUANTITIES)), strict=True)
        ]
        handles += [
            Line2D([], [], color="0.2", marker="o", label="(c) whole"),
            Line2D(
                [], [], color="0.2", marker="o", mfc="white", ls=_DASHES[1], label=f"(c) lowest {count[-1]}"
            ),
            Line2D([], [], color=GREY, ls=":", lw=0.8, label=r"$p^{-1/2}$, $p^{\pm 1/4}$"),
        ]
        place_legend(fig, axes[0], "", handles, lines[0])
        save(fig, path)


def _floppiness(result, count):
    """rms Δu⊥ over rms Δu∥ of the lowest modes together, each of unit length."""
    return np.sqrt(result["transverse"][:count].sum() / result["normal"][:count].sum())
