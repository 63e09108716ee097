"""Quasistatic shear: energy, stress, pressure and coordination along the strain, jammed states marked."""

import numpy as np
from matplotlib.lines import Line2D

from jampetsc.contacts.disks import PLACES, Disks
from jampetsc.contacts.potentials import Potential
from jampetsc.plots.style import GREY, PAGE, colours, figure, letter_panels, save
from jampetsc.plots.units import flow_units

HEIGHT = 2.3  # inches of one row of panels


def plot_slow_shear(results, path) -> None:
    """U/N on a log scale, σ, p and Z over γ of one run or several; unjammed states are light, means dashed."""
    units = flow_units(results)
    panels = (
        ("energy", units.label("U/N", "energy"), units.k),
        ("shear_stress", units.label(r"\sigma", "stress"), units.k),
        ("pressure", units.label("p", "stress"), units.k),
        ("coordination", "$Z$", 1.0),
    )
    with figure(PAGE, 2 * HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(2, 2, sharex=True)
        loose = False
        for result, colour in zip(results, colours(len(results)), strict=True):
            a, strain = result.attributes, result["strain"]
            jammed, discard = result["jammed"] == 1, float(a["discard"])
            loose = loose or not jammed.all()
            for ax, (name, _, unit) in zip(axes.flat, panels, strict=True):
                values = result[name] / unit
                if name == "energy":
                    values = values / float(a["particle_count"])
                _draw(ax, strain, values, jammed, colour)
                if name != "energy":
                    mean = float(a[f"{name}_mean"]) / unit
                    ax.plot([discard, strain[-1]], [mean, mean], color=colour, lw=1.3, ls=(0, (4, 2)))
            if "plastic" in result:
                events = strain[result["plastic"] == 1]
                place = axes[0, 1].get_xaxis_transform()
                axes[0, 1].plot(events, np.full(len(events), 0.02), "|", color=colour, ms=4, transform=place)
        axes[0, 0].set_yscale("log")
        cut = float(results[0].attributes["energy_cut"])
        if loose:
            axes[0, 0].axhline(cut, color=GREY, lw=0.6, ls=":")
        for ax, (_, text, _) in zip(axes.flat, panels, strict=True):
            ax.set_ylabel(text)
            ax.margins(x=0)
        for ax in axes[1]:
            ax.set_xlabel(r"$\gamma$")
        handles = [Line2D([], [], color="0.2", lw=0.7, label="jammed")]
        if loose:
            handles.append(
                Line2D([], [], color="0.2", alpha=0.5, marker=".", ms=1.5, ls="none", label="not jammed")
            )
        if any("plastic" in result and result["plastic"].any() for result in results):
            handles.append(
                Line2D([], [], color="0.2", marker="|", ms=4, ls="none", label="plastic events, in (b)")
            )
        handles.append(Line2D([], [], color="0.2", lw=1.3, ls=(0, (4, 2)), label="means"))
        axes[0, 0].legend(handles=handles)
        letter_panels(axes.flat)
        save(fig, path)


def _draw(ax, strain, values, jammed, colour):
    """A line through jammed states, dots for the others."""
    ax.plot(strain, np.where(jammed, values, np.nan), color=colour, lw=0.6)
    ax.plot(strain[~jammed], values[~jammed], ".", color=colour, ms=1.5, alpha=0.5, markeredgewidth=0)
    single = jammed & ~np.r_[False, jammed[:-1]] & ~np.r_[jammed[1:], False]
    ax.plot(strain[single], values[single], "_", color=colour, ms=2)


def last_minimum(result) -> Disks:
    """The last minimum of a shear file, to the last bit."""
    a = result.attributes
    potential = Potential(str(a["potential"]), str(a["stiffness"]), float(a["k"]))
    return Disks(**{name: result[f"state/{name}"] for name in (*PLACES, "radii")}, potential=potential)
