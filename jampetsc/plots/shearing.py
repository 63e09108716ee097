"""Pictures of steady shear: series over strain, flow curves with their local exponents, g_y(x).

Quantities are in the units that the files tell (`units.flow_units`): Vågberg's where `jampetsc flow` made the disks.
"""

import numpy as np

from jampetsc.analysis.averages import mean_of_runs
from jampetsc.contacts.disks import Disks
from jampetsc.contacts.potentials import Potential
from jampetsc.errors import InputError
from jampetsc.flow.lanes import BIN, FORMAT, LANE, correlate_lanes
from jampetsc.plots.logaxes import set_log_axes
from jampetsc.plots.style import GREY, MARKERS, PAGE, colours, figure, letter_panels, number, save
from jampetsc.plots.units import flow_units

HEIGHT = 2.7  # inches of one row of panels
_QUANTITIES = (("shear_stress", r"\sigma"), ("pressure", "p"))
_FEWEST = 2  # rates that make a curve
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
    shown = [[part for part, differs in zip(one, varied, strict=True) if differs] for one in parts]
    return [", ".join(filter(None, some)) or one[0] for some, one in zip(shown, parts, strict=True)]


def plot_series(results, path) -> None:
    """σ and p over the strain, of one file or several, with the means of the steady part."""
    units = flow_units(results)
    with figure(PAGE, HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(1, 2)
        for result, colour in zip(results, colours(len(results)), strict=True):
            strain, discard = result["strain"], float(result.attributes["discard"])
            for ax, (name, _) in zip(axes, _QUANTITIES, strict=True):
                ax.plot(strain, result[name].sum(1) / units.k, color=colour, lw=0.6, label=result.path.stem)
                mean = result.attributes[f"{name}_mean"] / units.k
                ax.plot([discard, strain[-1]], [mean, mean], color=colour, lw=1.6, ls=(0, (4, 2)))
        for ax, (_, symbol) in zip(axes, _QUANTITIES, strict=True):
            ax.set(xlabel=r"$\gamma$", ylabel=units.label(symbol, "stress"), ylim=(0, None))
            ax.margins(x=0)
        if 1 < len(results) <= NAMED:
            axes[0].legend()
        axes[1].text(0.98, 0.04, "dashed: means", color=GREY, ha="right", transform=axes[1].transAxes)
        letter_panels(axes)
        save(fig, path)


def flow_curves(results) -> dict:
    """{kind: {quantity: (rates (R,), values (R,), errors (R,))}}, runs of one kind and rate averaged.

    Quantities are σ and p, in the units of `units.flow_units`; errors are the larger of the scatter of runs and
    their own. Raises InputError where a run is there twice, or units differ.
    """
    units, curves, seen = flow_units(results), {}, {}
    for result in results:
        a = result.attributes
        rate = float(a["rate"])
        origin = str(a.get("seed", a.get("packing_sha256")))
        key = (kind_of(result), rate, origin)
        if key in seen:
            raise InputError(
                f"{result.path}: the same model, phi, N, rate and start as {seen[key]}: an average takes each once"
            )
        seen[key] = result.path.name
        curves.setdefault(key[0], {}).setdefault(rate, []).append(a)
    found = {}
    for kind, runs in sorted(curves.items()):
        rates = np.array(sorted(runs))
        found[kind] = {}
        for name, _ in _QUANTITIES:
            pairs = [
                mean_of_runs(
                    *([float(a[f"{name}_{part}"]) for a in runs[rate]] for part in ("mean", "error"))
                )
                for rate in rates
            ]
            values, errors = np.array(pairs).T / units.k
            found[kind][name] = rates * units.tau1, values, errors
    return found


def local_exponents(rates, values):
    """(middles, d ln O/d ln γ̇) between neighbouring rates, (R − 1,) each: 1 is Newtonian, 2 Bagnoldian."""
    return np.sqrt(rates[1:] * rates[:-1]), np.diff(np.log(values)) / np.diff(np.log(rates))


def plot_flow_curves(results, path) -> None:
    """σ, p and σ/p against the rate, and the local exponents of σ (filled) and p (hollow).

    Raises InputError where no kind has two rates.
    """
    curves = flow_curves(results)
    if not any(len(curve["pressure"][0]) >= _FEWEST for curve in curves.values()):
        raise InputError(f"{results[0].path}: flow curves need several rates of one model, phi and N")
    units = flow_units(results)
    with figure(PAGE, 2 * HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(2, 2)
        lines = ([], [], [])
        looks = zip(labels_of(list(curves)), colours(len(curves)), MARKERS * len(curves), strict=False)
        for curve, (label, colour, marker) in zip(curves.values(), looks, strict=True):
            rates, stress, stress_error = curve["shear_stress"]
            _, pressure, pressure_error = curve["pressure"]
            ratio = stress / pressure
            ratio_error = ratio * np.hypot(stress_error / stress, pressure_error / pressure)
            style = {"color": colour, "marker": marker}
            for ax, kept, y, error in zip(
                axes.flat,
                lines,
                (stress, pressure, ratio),
                (stress_error, pressure_error, ratio_error),
                strict=False,
            ):
                ax.errorbar(rates, y, error, capsize=1.5, elinewidth=0.6, label=label, **style)
                kept.append((rates, y))
            for y, face in ((stress, colour), (pressure, "white")):
                axes[1, 1].plot(*local_exponents(rates, y), markerfacecolor=face, **style)
        names = [units.label(symbol, "stress") for _, symbol in _QUANTITIES]
        rate = units.label(r"\dot\gamma", "rate")
        for ax, kept, text in zip(axes.flat, lines, [*names, r"$\sigma/p$"], strict=False):
            set_log_axes(ax, kept)
            ax.set(xlabel=rate, ylabel=text)
        axes[1, 1].set(
            xscale="log", xlim=axes[0, 0].get_xlim(), xlabel=rate,
            ylabel=r"$d\ln\sigma/d\ln\dot\gamma$, $d\ln p/d\ln\dot\gamma$",
        )  # fmt: skip
        low, high = axes[1, 1].get_ylim()
        for value, regime in ((1, "Newtonian"), (2, "Bagnoldian")):
            if low < value < high:
                axes[1, 1].axhline(value, color=GREY, lw=0.6, ls=":")
                axes[1, 1].annotate(
                    regime,
                    (1, value),
                    (-2, 1),
                    ("axes fraction", "data"),
                    "offset points",
                    color=GREY,
                    ha="right",
                )
        axes[1, 1].text(
            0.03, 0.04, r"filled: $\sigma$, hollow: $p$", color=GREY, transform=axes[1, 1].transAxes
        )
        axes[0, 0].legend()
        letter_panels(axes.flat)
        save(fig, path)


def lanes_of(results) -> list:
    """[(label, x (D,), g_y (D,), error (D,))] of files of g_y, and of flow files with snapshots, kind by kind.

    Flow files are correlated as `jampetsc correlate` does unless told otherwise. Raises InputError without snapshots.
    """
    found, groups = [], {}
    for result in results:
        a = result.attributes
        if result.format == FORMAT:
            label = rf"{a['model']}, $\phi={float(a['phi']):.5g}$, $\dot\gamma={number(float(a['rate']))}$"
            found.append((label, result["x"], result["g_y"], result["g_y_error"]))
        else:
            groups.setdefault((kind_of(result), float(a["rate"])), []).append(result)
    names = labels_of([kind for kind, _ in groups]) if groups else []
    for ((_, rate), some), name in zip(groups.items(), names, strict=True):
        g = correlate_lanes(some, LANE, BIN)
        found.append((rf"{name}, $\dot\gamma={number(rate)}$", g.centres, g.values, g.errors))
    return found


def plot_lanes(results, path) -> None:
    """g_y against x of one or several files, with bands of one standard error."""
    curves = lanes_of(results)
    with figure(PAGE, HEIGHT, layout="constrained") as fig:
        ax = fig.subplots()
        ax.axhline(0.0, color=GREY, lw=0.6)
        looks = zip(colours(len(curves)), MARKERS * len(curves), strict=False)
        for (label, x, g, error), (colour, marker) in zip(curves, looks, strict=True):
            ax.fill_between(x, g - error, g + error, color=colour, alpha=0.25, lw=0)
            ax.plot(x, g, color=colour, marker=marker, label=label)
        ax.set(xlabel=flow_units(results).label("x", "length"), ylabel="$g_y(x)$")
        ax.margins(x=0.02)
        ax.legend(title="bands: one standard error")
        save(fig, path)


def last_snapshot(result) -> Disks:
    """The last snapshot of a flow file as a packing; its record has the number of disks of `walls`, if there are any.

    Raises InputError where the file holds none.
    """
    if "snapshots/positions" not in result:
        raise InputError(f"{result.path}: holds no snapshots: run `jampetsc flow` with --snapshots")
    a = result.attributes
    potential = Potential(str(a["potential"]), str(a["stiffness"]), float(a["k"]))
    positions, cell = (result.stored(f"snapshots/{name}")[-1] for name in ("positions", "cell"))
    record = {"walls": int(a["walls"])} if "walls" in a else {}
    return Disks.from_positions(positions, result["state/radii"], cell, potential, record=record)
