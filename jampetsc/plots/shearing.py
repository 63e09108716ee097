"""Pictures of steady shear: series over strain, flow curves with their local exponents, g_y(x).

Quantities are in the units of the files: k_e, k_d and the small diameter 1 where `jampetsc flow` made the disks.
"""

import numpy as np

from jampetsc.contacts.disks import Disks
from jampetsc.contacts.potentials import Potential
from jampetsc.errors import InputError
from jampetsc.plots.logaxes import set_log_axes
from jampetsc.plots.style import GREY, MARKERS, PAGE, colours, figure, letter_panels, number, save

HEIGHT = 2.7  # inches of one row of panels
_QUANTITIES = (("shear_stress", r"$\sigma$"), ("pressure", "$p$"))
_FEWEST = 2  # rates that make a curve


def kind_of(result) -> tuple:
    """What flow curves have in common: model, φ, N."""
    a = result.attributes
    return str(a["model"]), round(float(a["phi"]), 6), int(a["particle_count"])


def label_of(kind, varied) -> str:
    """A legend's words for `kind`: the parts that differ between the curves."""
    model, phi, n = kind
    parts = (model, rf"$\phi={phi:.6g}$", f"$N={n}$")
    return ", ".join(part for part, differs in zip(parts, varied, strict=True) if differs) or model


def plot_series(results, path) -> None:
    """σ and p over the strain, of one file or several, with the means of the steady part."""
    with figure(PAGE, HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(1, 2)
        for result, colour in zip(results, colours(len(results)), strict=True):
            strain, discard = result["strain"], float(result.attributes["discard"])
            for ax, (name, _) in zip(axes, _QUANTITIES, strict=True):
                ax.plot(strain, result[name].sum(1), color=colour, lw=0.6, label=result.path.stem)
                mean = result.attributes[f"{name}_mean"]
                ax.plot([discard, strain[-1]], [mean, mean], color=colour, lw=1.6, ls=(0, (4, 2)))
        for ax, (_, symbol) in zip(axes, _QUANTITIES, strict=True):
            ax.set(xlabel=r"$\gamma$", ylabel=symbol, ylim=(0, None))
            ax.margins(x=0)
        if len(results) > 1:
            axes[0].legend()
        axes[1].text(0.98, 0.04, "dashed: means", color=GREY, ha="right", transform=axes[1].transAxes)
        letter_panels(axes)
        save(fig, path)


def flow_curves(results) -> dict:
    """{kind: {quantity: (rates (R,), values (R,), errors (R,))}}, runs of one kind and rate averaged.

    Quantities are σ, p and the coordination; errors are the larger of the scatter of runs and their own.
    """
    curves = {}
    for result in results:
        rate = float(result.attributes["rate"])
        curves.setdefault(kind_of(result), {}).setdefault(rate, []).append(result.attributes)
    found = {}
    for kind, runs in sorted(curves.items()):
        rates = np.array(sorted(runs))
        found[kind] = {}
        for name, _ in _QUANTITIES:
            values, errors = [], []
            for rate in rates:
                means = np.array([float(a[f"{name}_mean"]) for a in runs[rate]])
                own = np.sqrt(np.mean([float(a[f"{name}_error"]) ** 2 for a in runs[rate]]) / len(means))
                scatter = np.std(means, ddof=1) / np.sqrt(len(means)) if len(means) > 1 else 0.0
                values.append(means.mean())
                errors.append(max(own, scatter))
            found[kind][name] = rates, np.array(values), np.array(errors)
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
    varied = [len({kind[part] for kind in curves}) > 1 for part in range(3)]
    with figure(PAGE, 2 * HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(2, 2)
        lines = ([], [], [])
        for (kind, curve), colour, marker in zip(
            curves.items(), colours(len(curves)), MARKERS * len(curves), strict=False
        ):
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
                ax.errorbar(
                    rates, y, error, capsize=1.5, elinewidth=0.6, label=label_of(kind, varied), **style
                )
                kept.append((rates, y))
            for y, face in ((stress, colour), (pressure, "white")):
                axes[1, 1].plot(*local_exponents(rates, y), markerfacecolor=face, **style)
        for ax, kept, symbol in zip(axes.flat, lines, (r"$\sigma$", "$p$", r"$\sigma/p$"), strict=False):
            set_log_axes(ax, kept)
            ax.set(xlabel=r"$\dot\gamma$", ylabel=symbol)
        axes[1, 1].set(
            xscale="log", xlim=axes[0, 0].get_xlim(), xlabel=r"$\dot\gamma$",
            ylabel=r"$d\ln\sigma/d\ln\dot\gamma$, $d\ln p/d\ln\dot\gamma$",
        )  # fmt: skip
        axes[1, 1].text(
            0.03, 0.04, r"filled: $\sigma$, hollow: $p$", color=GREY, transform=axes[1, 1].transAxes
        )
        axes[0, 0].legend()
        letter_panels(axes.flat)
        save(fig, path)


def plot_lanes(results, path) -> None:
    """g_y against x of one or several files, with bands of one standard error."""
    with figure(PAGE, HEIGHT, layout="constrained") as fig:
        ax = fig.subplots()
        ax.axhline(0.0, color=GREY, lw=0.6)
        for result, colour, marker in zip(
            results, colours(len(results)), MARKERS * len(results), strict=False
        ):
            a, x, g, error = result.attributes, result["x"], result["g_y"], result["g_y_error"]
            text = rf"{a['model']}, $\phi={float(a['phi']):.5g}$, $\dot\gamma={number(float(a['rate']))}$"
            ax.fill_between(x, g - error, g + error, color=colour, alpha=0.25, lw=0)
            ax.plot(x, g, color=colour, marker=marker, label=text)
        ax.set(xlabel="$x$", ylabel="$g_y(x)$")
        ax.margins(x=0.02)
        ax.legend(title="bands: one standard error")
        save(fig, path)


def last_snapshot(result) -> Disks:
    """The last snapshot of a flow file as a packing. Raises InputError where it holds none."""
    if "snapshots/positions" not in result:
        raise InputError(f"{result.path}: holds no snapshots: run `jampetsc flow` with --snapshots")
    a = result.attributes
    potential = Potential(str(a["potential"]), str(a["stiffness"]), float(a["k"]))
    positions, cell = (result.stored(f"snapshots/{name}")[-1] for name in ("positions", "cell"))
    return Disks.from_positions(positions, result["state/radii"], cell, potential)
