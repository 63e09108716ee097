"""Pictures of steady shear: series over strain and g_y(x); what tells runs apart.

Quantities are in the units that the files tell (`units.flow_units`): Vågberg's where `jampetsc flow` made the disks.
"""

from jampetsc.flows.velocity_correlation import BIN, FORMAT, LANE, correlate_lanes
from jampetsc.plots.page import band
from jampetsc.plots.picture import count, differing, grouped, picture
from jampetsc.plots.style import DASHED, GREY, PAGE, colours, entry, hidden, looks, number
from jampetsc.plots.units import flow_units

HEIGHT = 2.7  # inches of one row of panels
_QUANTITIES = (("shear_stress", r"\sigma"), ("pressure", "p"))
NAMED = 12  # runs that a legend names


def kind_of(result) -> tuple:
    """What flow curves have in common: model, φ, N, mass, sizes and potential of the disks."""
    a = result.attributes
    walls = " between walls" if "walls" in a else ""
    found = f"{a['model']}{walls}", round(float(a["phi"]), 6), int(a["particle_count"]), float(a["mass"])
    return *found, str(a.get("sizes", "")), str(a["potential"])


def labels_of(kinds) -> list[str]:
    """A legend's words for each of `kinds`: the parts that differ between them, the model where none does."""
    parts = [
        (model, rf"$\phi={phi:.6g}$", f"$N={n}$", f"$m={number(mass)}$" if mass else "no mass", *words)
        for model, phi, n, mass, *words in kinds
    ]
    varied = [len(set(column)) > 1 for column in zip(*kinds, strict=True)]
    varied[3] = varied[3] and len({(kind[0], kind[3]) for kind in kinds}) > len({kind[0] for kind in kinds})
    return [words or one[0] for words, one in zip(differing(parts, varied), parts, strict=True)]


def draw_series(results, page) -> str:
    """σ and p over the strain, of one file or several, with the means of the steady part."""
    units = flow_units(results)
    axes = page.panels(1, 2, PAGE, HEIGHT)
    for ax, (name, symbol) in zip(axes, _QUANTITIES, strict=True):
        for result, colour in zip(results, colours(len(results)), strict=True):
            strain, discard = result["strain"], float(result.attributes["discard"])
            ax.plot(strain, result[name].sum(1) / units.k, color=colour, lw=0.6, label=result.path.stem)
            mean = result.attributes[f"{name}_mean"] / units.k
            label = hidden(f"{result.path.stem}, mean")
            ax.plot([discard, strain[-1]], [mean, mean], color=colour, lw=1.6, ls=DASHED, label=label)
        ax.set(xlabel=r"$\gamma$", ylabel=units.label(symbol, "stress"), ylim=(0, None))
        ax.margins(x=0)
    handles = [entry("means", GREY, lw=1.6, ls=DASHED)]
    if 1 < len(results) <= NAMED:
        handles = axes[0].get_legend_handles_labels()[0] + handles
    page.legend(axes[1], handles)
    return f"stress and pressure of {count(results, 'run', 'runs')} over the strain"


def lanes_of(results) -> list:
    """[(label, x (D,), g_y (D,), error (D,))] of files of g_y, and of flow files with snapshots, kind by kind.

    Flow files are correlated as `jampetsc correlate` does unless told otherwise. Raises InputError without snapshots.
    """
    found = []
    for result in (one for one in results if one.format == FORMAT):
        a = result.attributes
        label = rf"{a['model']}, $\phi={float(a['phi']):.5g}$, $\dot\gamma={number(float(a['rate']))}$"
        found.append((label, result["x"], result["g_y"], result["g_y_error"]))
    flows = (one for one in results if one.format != FORMAT)
    groups = grouped(flows, lambda one: (kind_of(one), float(one.attributes["rate"])))
    names = labels_of([kind for kind, _ in sorted(groups)]) if groups else []
    for ((_, rate), some), name in zip(sorted(groups.items()), names, strict=True):
        g = correlate_lanes(some, LANE, BIN)
        found.append((rf"{name}, $\dot\gamma={number(rate)}$", g.centres, g.values, g.errors))
    return found


@picture("lanes", "velocity-correlation", "flow")
def plot_lanes(results, page):
    """g_y against x of one or several files, with bands of one standard error."""
    curves = lanes_of(results)
    ax = page.panels(1, 1, PAGE, HEIGHT)
    ax.axhline(0.0, color=GREY, lw=0.6)
    for (label, x, g, error), look in zip(curves, looks(len(curves)), strict=True):
        band(ax, x, g - error, g + error, label, color=look["color"])
        ax.plot(x, g, label=label, **look)
    ax.set(xlabel=flow_units(results).label("x", "length"), ylabel="$g_y(x)$")
    ax.margins(x=0.02)
    page.legend(ax, title="bands: one standard error")
    return f"g_y of {count(results, 'file', 'files')}"
