"""Pictures of steady shear: series and order over strain, profiles between walls, g_y(x); labels of runs.

Quantities are in the units of the files (`units.flow_units`): Vågberg's if `jampetsc flow` made the disks.
"""

from itertools import pairwise

import numpy as np

from jampetsc.analysis.correlated_series import layer_heights, mean_profile
from jampetsc.analysis.velocity_correlation import DEFAULT_BIN_WIDTH, DEFAULT_LANE_WIDTH
from jampetsc.errors import InputError
from jampetsc.io.disk_motion import correlate_lanes, six_fold_order, velocity_profiles
from jampetsc.plots.page import band
from jampetsc.plots.picture import count, differing, grouped, picture
from jampetsc.plots.style import DASHED, GREY, PAGE, colours, entry, hidden, looks, number
from jampetsc.plots.units import flow_units

HEIGHT = 2.7  # inches of one row of panels
_QUANTITIES = (("shear_stress", r"\sigma"), ("pressure", "p"))
NAMED = 12  # runs that a legend names
ORDERS = (r"$\langle|\psi_6|\rangle$", r"$|\langle\psi_6\rangle|$")
WINDOWS = (0.0, 0.1, 0.3, 1.0)  # strains between which the start is shown; the last window is the steady part
PANELS = 3  # kinds of flow between walls


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


def draw_mean(ax, result, name, unit, colour, width) -> None:
    """The mean of NAME over the steady part of a run, dashed along its strain."""
    a = result.attributes
    mean, span = float(a[f"{name}_mean"]) / unit, [float(a["discard"]), result["strain"][-1]]
    ax.plot(span, [mean, mean], color=colour, lw=width, ls=DASHED, label=hidden(f"{result.path.stem}, mean"))


def draw_series(results, page) -> str:
    """σ and p over the strain, of one file or several, with the means of the steady part."""
    units = flow_units(results)
    names = [units.label(symbol, "stress") for _, symbol in _QUANTITIES]
    axes = page.panels(1, 2, PAGE, HEIGHT, x=r"$\gamma$", y=names)
    for ax, (name, _) in zip(axes, _QUANTITIES, strict=True):
        for result, colour in zip(results, colours(len(results)), strict=True):
            values = result[name].sum(1) / units.k
            ax.plot(result["strain"], values, color=colour, lw=0.6, label=result.path.stem)
            draw_mean(ax, result, name, units.k, colour, 1.6)
        ax.set(ylim=(0, None), xmargin=0)
    handles = [entry("means", GREY, lw=1.6, ls=DASHED)]
    if 1 < len(results) <= NAMED:
        handles = axes[0].get_legend_handles_labels()[0] + handles
    page.legend(axes[1], handles)
    return f"stress and pressure of {count(results, 'run', 'runs')} over the strain"


@picture("order", "flow")
def plot_order(results, page):
    """⟨|ψ₆|⟩ and |⟨ψ₆⟩| over the strain: disks of one size order into layers, disks of two do not (Vågberg, Fig. 4.6).

    Kind by kind: thin lines runs, thick ones their mean. Raises InputError for files without snapshots, and for runs of
    one kind with snapshots at other strains.
    """
    kinds = grouped([(result, six_fold_order(result)) for result in results], lambda pair: kind_of(pair[0]))
    for (first, _), *others in kinds.values():
        for result, _ in others:
            if not np.array_equal(result["snapshots/strain"], first["snapshots/strain"]):
                raise InputError(
                    f"{result.path}: snapshots at other strains than {first.path.name}: a mean needs the same"
                )
    axes = page.panels(1, 2, PAGE, HEIGHT, x=r"$\gamma$", y=ORDERS)
    for part, ax in enumerate(axes):
        for (runs, label), look in looks(zip(kinds.values(), labels_of(list(kinds)), strict=True)):
            strain, thin = runs[0][0]["snapshots/strain"], {"color": look["color"], "lw": 0.3, "alpha": 0.6}
            for run, order in runs if len(runs) > 1 else ():
                ax.plot(strain, order[part], label=hidden(run.path.name), **thin)
            mean = np.mean([order[part] for _, order in runs], axis=0)
            ax.plot(strain, mean, markevery=max(1, len(strain) // 10), label=label, **look)
        ax.set(ylim=(0, 1), xmargin=0.01)
    page.legend(axes[1], title=f"thin: {len(results)} runs" if len(results) > len(kinds) else None)
    return f"six-fold order of {count(results, 'run', 'runs')} over the strain"


@picture("profile", "flow")
def plot_profiles(results, page):
    """y/H − ½ against v_x/(γ̇H) between walls in windows of strain: where the shear is at the start, and when steady.

    A panel for each kind and rate, runs averaged; dotted: linear, bars: standard errors. Raises InputError for files
    without profiles, and for more kinds than PANELS.
    """
    kinds = grouped(results, lambda one: (kind_of(one), float(one.attributes["rate"])))
    if len(kinds) > PANELS:
        raise InputError(f"{len(kinds)} kinds of flow: one picture of profiles shows {PANELS}; choose some")
    rates = {rate for _, rate in kinds}
    named = {"x": r"$v_x/(\dot\gamma H)$", "y": r"$y/H-\frac{1}{2}$"}
    axes = np.ravel(page.panels(1, len(kinds), PAGE, 3.0, **named, sharey=True))
    names = labels_of([kind for kind, _ in kinds])
    for ax, ((_, rate), runs), name in zip(axes, kinds.items(), names, strict=True):
        steady = min(float(run.attributes["discard"]) for run in runs)
        end = min(float(run["strain"][-1]) for run in runs)
        windows = [*pairwise([edge for edge in WINDOWS if edge < steady]), (steady, end)]
        ax.plot([-0.5, 0.5], [-0.5, 0.5], color=GREY, lw=0.8, ls=":", zorder=1)
        for (low, high), look in looks(windows):
            v, error = mean_profile(velocity_profiles(runs, low, high))
            bars = {"xerr": np.nan_to_num(error), "elinewidth": 0.6, "label": f"${low:g}$ to ${high:.3g}$"}
            ax.errorbar(v, layer_heights(len(v)), ms=3, lw=0.8, **bars, **look)
        ax.set(xlim=(-0.52, 0.52), ylim=(-0.5, 0.5))
        title = rf"{name}, $\dot\gamma={number(rate)}$" if len(rates) > 1 else name
        ax.set_title(title, loc="right", pad=3)
    page.legend(axes[0], title=r"$\gamma$", first="upper left")
    return f"velocity between walls of {count(results, 'run', 'runs')} in windows of strain"


def lanes_of(results) -> list:
    """[(label, x (D,), g_y (D,), error (D,))] of files of g_y, or of flow files with snapshots, kind by kind.

    Flow files are correlated with the defaults of `jampetsc correlate`. Raises InputError without snapshots.
    """
    found = []
    if results[0].format == "jampetsc-velocity-correlation":
        for result in results:
            a = result.attributes
            label = rf"{a['model']}, $\phi={float(a['phi']):.5g}$, $\dot\gamma={number(float(a['rate']))}$"
            found.append((label, result["x"], result["g_y"], result["g_y_error"]))
        return found
    groups = grouped(results, lambda one: (kind_of(one), float(one.attributes["rate"])))
    names = labels_of([kind for kind, _ in sorted(groups)])
    for ((_, rate), some), name in zip(sorted(groups.items()), names, strict=True):
        g = correlate_lanes(some, DEFAULT_LANE_WIDTH, DEFAULT_BIN_WIDTH)
        found.append((rf"{name}, $\dot\gamma={number(rate)}$", g.centres, g.values, g.errors))
    return found


@picture("lanes", "velocity-correlation", "flow")
def plot_lanes(results, page):
    """g_y against x of one or several files, with bands of one standard error."""
    curves = lanes_of(results)
    ax = page.panels(1, 1, PAGE, HEIGHT, x=flow_units(results).label("x", "length"), y="$g_y(x)$")
    ax.axhline(0.0, color=GREY, lw=0.6)
    for (label, x, g, error), look in looks(curves):
        band(ax, x, g - error, g + error, label, color=look["color"])
        ax.plot(x, g, label=label, **look)
    ax.set_xmargin(0.02)
    page.legend(ax, title="bands: one standard error")
    return f"g_y of {count(results, 'file', 'files')}"
