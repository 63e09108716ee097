"""What the lowest modes are and what they carry of slow shear, against pressure: floppiness, shares, medians."""

import numpy as np

from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import InputError, named
from jampetsc.plots.floppy import QUANTITIES, groups_of
from jampetsc.plots.logaxes import power_law
from jampetsc.plots.page import points
from jampetsc.plots.picture import count, picture
from jampetsc.plots.style import DASHED, DOTTED, GREY, MARKERS, OPEN, PAGE, colours, entry, hidden

HEIGHT = 3.1  # inches
_DASHES = ("-", DASHED, DOTTED)


@picture("lowest-modes", "modes")
def plot_lowest(results, page):
    """Means over the files of one pressure, with errors, against p/k:

    (a) floppiness, rms Δu⊥ over rms Δu∥, of the lowest 10, 50 and 200 modes together, with slope −½ (λ ~ p);
    (b) what they carry of Σ|u_na|², Σ(Δu⊥)² and Σ(Δu∥)², affine parts left out;
    (c) medians of the whole response (filled, BT Fig. 5) and of what the most of these modes make up alone (open).

    Raises InputError for files of several N, and for files that do not hold the numbers of modes that others do.
    """
    groups = groups_of(results)
    if len({size for size, _ in groups}) > 1:
        raise InputError(
            f"{results[0].path}: files of several N: choose one (of a study with {named('where')} n=…)"
        )
    for result in results:
        if "lowest/count" not in result or not len(result["lowest/count"]):
            raise InputError(
                f"{result.path}: does not tell what its modes carry of slow shear: find 10 or more, and anew "
                "if the file is an older one"
            )
    counts = results[0]["lowest/count"]
    if any(list(result["lowest/count"]) != list(counts) for result in results):
        raise InputError(f"{results[0].path}: files with other numbers of modes: find as many in each")
    p = np.array([level for _, level in groups])

    def averages(value, log=True):
        """(mean, error) at each pressure of a number per file; of its logarithm, brought back, if `log`."""
        found = [[value(results[row]) for row in rows] for rows in groups.values()]
        means, errors = np.transpose([mean_with_error(np.log(some) if log else some) for some in found])
        errors = np.nan_to_num(errors)
        return (np.exp(means), np.exp(means) * errors) if log else (means, errors)

    axes = page.panels(1, 3, PAGE, HEIGHT)
    labels = "floppiness of the lowest modes", "share of the lowest modes", "median per unit strain"
    for ax, what in zip(axes, labels, strict=True):
        ax.set(xlabel="$p/k$", ylabel=what, xscale="log", yscale="log")
    axes[1].set(yscale="linear", ylim=(-0.03, 1.03))
    of_modes = [  # modes together -> how they are drawn
        (m, {"linestyle": dash, "marker": marker, "label": hidden(f"lowest {m}")})
        for m, dash, marker in zip(counts, _DASHES, MARKERS, strict=False)
    ]
    shades = colours(len(QUANTITIES))
    for m, look in of_modes:
        points(axes[0], p, *averages(lambda one, m=m: _floppiness(one, m)), color="0.2", **look)
    power_law(axes[0], p, axes[0].containers[0].lines[0].get_ydata(), -0.5)
    for (name, (symbol, slope)), shade in zip(QUANTITIES.items(), shades, strict=True):
        for m, look in of_modes:
            share = averages(lambda one, m=m, name=name: one[f"cumulative/{name}"][m - 1], log=False)
            points(axes[1], p, *share, color=shade, **look | {"label": hidden(f"${symbol}$, lowest {m}")})
        whole = averages(lambda one, name=name: one.attributes[f"{name}_median"])
        alone = averages(lambda one, name=name: one[f"lowest/{name}_median"][-1])
        look = {"color": shade, "marker": "o"}
        points(axes[2], p, *whole, label=hidden(f"${symbol}$, whole"), **look)
        points(axes[2], p, *alone, **look | OPEN, label=hidden(f"${symbol}$, lowest {counts[-1]}"))
        power_law(axes[2], p, whole[0], slope)
    handles = [entry(**look | {"label": f"lowest {m}"}) for m, look in of_modes]
    drawn = zip(QUANTITIES.values(), shades, strict=True)
    handles += [entry(f"${symbol}$", shade) for (symbol, _), shade in drawn]
    handles += [entry("(c) whole", marker="o")]
    handles += [entry(f"(c) lowest {counts[-1]}", marker="o", **OPEN)]
    handles += [entry(r"$p^{-1/2}$, $p^{\pm 1/4}$", GREY, ls=":", lw=0.8)]
    page.legend(axes[0], handles)
    return f"what the lowest modes carry of slow shear, of {count(results, 'packing', 'packings')}"


def _floppiness(result, count):
    """rms Δu⊥ over rms Δu∥ of the lowest modes together, each of unit length."""
    return np.sqrt(result["transverse"][:count].sum() / result["normal"][:count].sum())
