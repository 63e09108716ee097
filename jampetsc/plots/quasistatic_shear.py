"""Quasistatic shear: energy, stress, pressure and coordination along the strain, jammed states marked."""

import numpy as np

from jampetsc.plots.picture import count, picture
from jampetsc.plots.shearing import draw_mean
from jampetsc.plots.style import DASHED, GREY, PAGE, colours, entry, hidden
from jampetsc.plots.units import flow_units

HEIGHT = 2.3  # inches of one row of panels


@picture("strain", "shear")
def plot_quasistatic_shear(results, page):
    """U/N on a log scale, σ, p and Z over γ of one run or several; unjammed states are light, means dashed."""
    units = flow_units(results)
    panels = {"energy": units.label("U/N", "energy"), "shear_stress": units.label(r"\sigma", "stress")}
    panels |= {"pressure": units.label("p", "stress"), "coordination": "$Z$"}
    named = {"x": r"$\gamma$", "y": list(panels.values()), "log": ["y", "", "", ""]}
    axes = page.panels(2, 2, PAGE, 2 * HEIGHT, **named, sharex=True)
    loose = any((result["jammed"] != 1).any() for result in results)
    plastic = [result["strain"][result["plastic"] == 1] if "plastic" in result else [] for result in results]
    for ax, name in zip(axes, panels, strict=True):
        for result, colour in zip(results, colours(len(results)), strict=True):
            disks = float(result.attributes["particle_count"])
            unit = {"energy": units.k * disks, "coordination": 1.0}.get(name, units.k)
            _draw(ax, result["strain"], result[name] / unit, result["jammed"] == 1, colour, result.path.stem)
            if name != "energy":
                draw_mean(ax, result, name, unit, colour, 1.3)
        ax.set_xmargin(0)
    for events, colour in zip(plastic, colours(len(results)), strict=True):
        below = {"transform": axes[1].get_xaxis_transform(), "ms": 4}
        axes[1].plot(events, np.full(len(events), 0.02), "|", color=colour, **below)
    handles = [entry("jammed", lw=0.7)]
    if loose:
        axes[0].axhline(float(results[0].attributes["energy_cut"]), color=GREY, lw=0.6, ls=":")
        handles.append(entry("not jammed", alpha=0.5, marker=".", ms=1.5, ls="none"))
    if any(map(len, plastic)):
        handles.append(entry("plastic events, in (b)", marker="|", ms=4, ls="none"))
    page.legend(axes[0], [*handles, entry("means", lw=1.3, ls=DASHED)])
    return f"energy, stress, pressure and coordination of {count(results, 'run', 'runs')} over the strain"


def _draw(ax, strain, values, jammed, colour, name):
    """A line through jammed states, dots for the others."""
    ax.plot(strain, np.where(jammed, values, np.nan), color=colour, lw=0.6, label=hidden(f"{name}, jammed"))
    loose = {"ms": 1.5, "alpha": 0.5, "markeredgewidth": 0, "label": hidden(f"{name}, not jammed")}
    ax.plot(strain[~jammed], values[~jammed], ".", color=colour, **loose)
    single = jammed & ~np.r_[False, jammed[:-1]] & ~np.r_[jammed[1:], False]
    ax.plot(strain[single], values[single], "_", color=colour, ms=2)
