"""Events of quasistatic shear: σ(γ) with every event, drops of the energy, strain to the first change of contacts.

Contacts change first after a strain ∝ p/N where pN² is small, and ∝ √p/N where it is large (van Deen et al., PRE 90,
020202 (2014)): curves of packings of one N and p are one distribution.
"""

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.plots.picture import count_text, flow_units, picture
from jampetsc.plots.style import PAGE, colours, entry, hidden

HEIGHT = 2.5  # inches
OPENS, CLOSES, UNSTABLE = 0, 1, 2  # `events/kind`
MARKERS = {OPENS: ("opens", "o"), CLOSES: ("closes", "s"), UNSTABLE: ("unstable", "v")}


def has_events(result) -> bool:
    """Whether events were followed."""
    return "events/kind" in result


@picture("events", "shear", suits=has_events)
def plot_events(results, page):
    """σ along the strain with events marked; shares of larger drops, and of packings without a change of contacts.

    Drops are of all files, per particle. Raises InputError for files without events.
    """
    for result in results:
        if not has_events(result):
            raise InputError(f"{result.path}: no events. Shear with {named('events')}.")
    units = flow_units(results)
    labels = {
        "x": [r"$\gamma$", units.label(r"\Delta U/N", "energy"), r"first $\left|\gamma\right|$"],
        "y": [units.label(r"\sigma", "stress"), "share of larger drops", "share without change"],
        "log": ["", "xy", "x"],
    }
    axes = page.panels(1, 3, PAGE, HEIGHT, **labels)
    for result, colour in zip(results, colours(len(results)), strict=True):
        _draw_stress(axes[0], result, units.k, colour)
    _draw_share(axes[1], _drops(results, units.k), "drops")
    _draw_share(axes[2], _first_changes(results), "first changes")
    kinds = sorted({kind for result in results for kind in result["events/kind"].tolist()} & MARKERS.keys())
    handles = [
        entry(MARKERS[kind][0], marker=MARKERS[kind][1], ms=3, ls="none", mfc="none") for kind in kinds
    ]
    if handles:
        page.legend(axes[0], handles)
    return f"stress, drops and first changes of contacts of {count_text(results, 'run', 'runs')}"


def _draw_stress(ax, result, k, colour):
    """σ(γ) with its jumps, and markers at events."""
    strain, kinds = result["events/strain"], result["events/kind"]
    stress = result["events/shear_stress"] / k
    every = np.concatenate((result["strain"], np.repeat(strain, 2)))
    values = np.concatenate((result["shear_stress"] / k, stress.ravel()))
    order = np.argsort(np.abs(every), kind="stable")
    ax.plot(every[order], values[order], color=colour, lw=0.7, label=result.path.stem)
    for kind, (name, marker) in MARKERS.items():
        look = {"color": colour, "ms": 3, "ls": "none", "mfc": "none", "mew": 0.6}
        chosen = kinds == kind
        label = hidden(f"{result.path.stem}, {name}")
        ax.plot(strain[chosen], stress[chosen, 0], marker=marker, label=label, **look)
    ax.set_xmargin(0)


def _drops(results, k):
    """Drops of the energy per particle of all files, (E,)."""
    drops = [
        result["events/drop"][result["events/kind"] == UNSTABLE]
        / (k * float(result.attributes["particle_count"]))
        for result in results
    ]
    return np.concatenate(drops)


def _first_changes(results):
    """|γ| of the first change of contacts that bear a force, of the files that have one, (F,)."""
    firsts = [np.abs(result["events/strain"][result["events/kind"] <= UNSTABLE]) for result in results]
    return np.array([strains[0] for strains in firsts if len(strains)])


def _draw_share(ax, values, name):
    """Share of values above each of them, as steps from 1."""
    values = np.sort(values[values > 0.0])
    if len(values):
        share = 1.0 - np.arange(len(values)) / len(values)
        ax.step(values, share, where="pre", color="0.2", lw=0.8, marker=".", ms=2, label=hidden(name))
