"""Low modes at equal λ/p, where their floppiness is compared."""

import numpy as np

from jampetsc.plots.page import draw_points
from jampetsc.plots.style import GREY, PAGE, entry, looks, power_or_number
from papers.claims.low_modes import BAND
from papers.pictures.shared import drawn, results

BINS = 6  # per decade of λ/p


@drawn("bt-modes-levels")
def levels(page, folder):
    """Δu⊥ over Δu∥ of single modes against λ/p, geometric means over packings, and times p^½; shaded: the band."""
    files = results(folder, command="modes")
    largest = max(one.attributes["particle_count"] for one in files)
    files = [one for one in files if one.attributes["particle_count"] == largest]
    reach, groups = min(one["eigenvalues"][-1] / one.attributes["pressure"] for one in files), {}
    for one in files:
        groups.setdefault(float(f"{one.attributes['pressure']:.3g}"), []).append(one)
    ratio = r"$\Delta u_\perp/\Delta u_\parallel$"
    y = [ratio, rf"{ratio}$\;(p/k)^{{1/2}}$"]
    axes = page.panels(1, 2, PAGE, 2.9, x=r"$\lambda/p$", y=y, log="xy")
    for p, look in looks(sorted(groups)):
        level = np.concatenate([one["eigenvalues"] / one.attributes["pressure"] for one in groups[p]])
        value = np.log(np.concatenate([one["floppiness"] for one in groups[p]]))
        place = np.floor(BINS * np.log10(level)).astype(int)
        means = [
            (
                np.log(level[place == n]).mean(),
                value[place == n].mean(),
                value[place == n].std() / np.sqrt(np.sum(place == n)),
            )
            for n in np.unique(place)
        ]
        x, middle, error = np.transpose(means)
        for ax, power in zip(axes, (0.0, 0.5), strict=True):
            scaled = np.exp(middle) * p**power
            draw_points(
                ax, np.exp(x), scaled, scaled * error, ms=3.5, lw=0.8, label=f"${power_or_number(p)}$", **look
            )
    for ax in axes:
        ax.axvspan(BAND, reach, color=GREY, alpha=0.15, lw=0, zorder=0)
    handles = [entry(f"${power_or_number(p)}$", **look) for p, look in looks(sorted(groups))]
    page.legend(axes[0], handles, f"$p/k$;  $N={largest}$", "lower left")
