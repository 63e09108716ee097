"""Flow curves: stress, pressure, friction, viscosity and coordination against the rate, or against φ at each rate.

Local exponents d ln σ/d ln γ̇ tell the regime: 1 is Newtonian, 2 Bagnoldian (Vågberg, thesis sec. 6.4).
"""

import numpy as np

from jampetsc.analysis.averages import mean_of_runs
from jampetsc.errors import InputError
from jampetsc.plots.logaxes import set_log_axes, set_ticks
from jampetsc.plots.shearing import kind_of, labels_of
from jampetsc.plots.style import GREY, MARKERS, PAGE, colours, figure, letter_panels, number, save
from jampetsc.plots.units import flow_units

HEIGHT = 2.3  # inches of one row of panels
_FEWEST = 2  # rates, or packing fractions, that make a curve
QUANTITIES = ("shear_stress", "pressure", "coordination")


def flow_curves(results, over="rate") -> dict:
    """{kind: {quantity: (rates or φ (R,), values (R,), errors (R,))}}, runs of one kind and rate averaged.

    QUANTITIES in the units of `units.flow_units`; errors are the larger of the scatter of runs and their own. over:
    "rate", with kinds as `shearing.kind_of` has them, or "phi", with kinds (kind, γ̇) whose φ is nan. Raises InputError
    where a run is there twice, or units differ.
    """
    units, curves, seen = flow_units(results), {}, {}
    for result in results:
        a, kind = result.attributes, kind_of(result)
        rate = float(a["rate"])
        origin = str(a.get("seed", a.get("packing_sha256")))
        if (kind, rate, origin) in seen:
            raise InputError(
                f"{result.path}: the same model, phi, N, rate and start as {seen[kind, rate, origin]}: "
                "an average takes each once"
            )
        seen[kind, rate, origin] = result.path.name
        group, x = (kind, rate) if over == "rate" else (((kind[0], 0.0, *kind[2:]), rate), kind[1])
        curves.setdefault(group, {}).setdefault(x, []).append(a)
    found = {}
    for kind, runs in sorted(curves.items()):
        x, found[kind] = np.array(sorted(runs)), {}
        for name in QUANTITIES:
            parts = (
                [
                    [float(a.get(f"{name}_{part}", np.inf)) for a in runs[one]]
                    for part in ("mean", "error", "samples")
                ]
                for one in x
            )
            values, errors = np.array([mean_of_runs(*three) for three in parts]).T
            unit = 1.0 if name == "coordination" else units.k
            found[kind][name] = x * (units.tau1 if over == "rate" else 1.0), values / unit, errors / unit
    return found


def local_exponents(rates, values, errors):
    """(middles, d ln O/d ln γ̇, errors) between neighbouring rates, (R − 1,) each: 1 is Newtonian, 2 Bagnoldian."""
    steps, relative = np.diff(np.log(rates)), errors / values
    exponents = np.diff(np.log(values)) / steps
    return np.sqrt(rates[1:] * rates[:-1]), exponents, np.hypot(relative[1:], relative[:-1]) / np.abs(steps)


def _ratio(one, other):
    """(value, error) of the quotient of two (value, error)."""
    value = one[0] / other[0]
    return value, np.abs(value) * np.hypot(one[1] / one[0], other[1] / other[0])


def plot_flow_curves(results, path) -> None:
    """σ, p, σ/p, σ/γ̇ (filled) and p/γ̇ (hollow), local exponents of both, and Z against the rate.

    Rates at which the mean stress or pressure is not positive are left out of all but Z. Raises InputError where no
    kind has two rates.
    """
    curves = flow_curves(results)
    if not any(len(curve["pressure"][0]) >= _FEWEST for curve in curves.values()):
        raise InputError(f"{results[0].path}: flow curves need several rates of one model, phi and N")
    units = flow_units(results)
    with figure(PAGE, 2 * HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(2, 3)
        lines, exponents = ([], [], [], []), []
        looks = zip(labels_of(list(curves)), colours(len(curves)), MARKERS * len(curves), strict=False)
        for curve, (label, colour, marker) in zip(curves.values(), looks, strict=True):
            style = {"color": colour, "marker": marker}
            bars = {"capsize": 1.5, "elinewidth": 0.6, **style}
            axes[1, 2].errorbar(*curve["coordination"], **bars)
            rates = curve["pressure"][0]
            shown = (curve["shear_stress"][1] > 0) & (curve["pressure"][1] > 0)
            stress, pressure = ([part[shown] for part in curve[name][1:]] for name in QUANTITIES[:2])
            rates = rates[shown]
            viscosities = [(value / rates, error / rates) for value, error in (stress, pressure)]
            panels = (stress, pressure, _ratio(stress, pressure), viscosities[0])
            for ax, kept, (y, error) in zip(axes.flat, lines, panels, strict=False):
                ax.errorbar(rates, y, error, label=label, **bars)
                kept.append((rates, y))
            axes[1, 0].errorbar(rates, *viscosities[1], markerfacecolor="white", ls=(0, (4, 1.6)), **bars)
            lines[3].append((rates, viscosities[1][0]))
            for both, face in ((stress, colour), (pressure, "white")):
                exponents.append((style | {"markerfacecolor": face}, *local_exponents(rates, *both)))
        texts = [units.label(r"\sigma", "stress"), units.label("p", "stress"), r"$\sigma/p$"]
        texts += [units.label(r"\sigma/\dot\gamma,\ p/\dot\gamma", "viscosity")]
        for ax, kept, text in zip(axes.flat, lines, texts, strict=False):
            if any(len(x) for x, _ in kept):
                set_log_axes(ax, [(x, y) for x, y in kept if len(x)])
            ax.set_ylabel(text)
        every = np.concatenate([curve["pressure"][0] for curve in curves.values()])
        for ax in axes.flat:
            ax.set(
                xlabel=units.label(r"\dot\gamma", "rate"),
                xscale="log",
                xlim=(every.min() / 1.3, 1.3 * every.max()),
            )
            set_ticks(ax.xaxis, *np.log10(ax.get_xlim()))
        axes[1, 1].set_ylabel(r"$d\ln\sigma/d\ln\dot\gamma,\ d\ln p/d\ln\dot\gamma$")
        axes[1, 2].set_ylabel("$Z$")
        _draw_exponents(axes[1, 1], exponents)
        note = {"color": GREY, "va": "bottom", "transform": axes[1, 0].transAxes}
        axes[1, 0].text(0.03, 0.02, r"filled: $\sigma$, hollow: $p$", **note)
        axes[0, 0].legend(fontsize=7, handlelength=1.2, labelspacing=0.2)
        letter_panels(axes.flat)
        save(fig, path)


def _draw_exponents(ax, curves):
    """Local exponents with errors, in limits of the values, and lines at those that have a name and are in sight."""
    for style, x, y, _ in curves:
        ax.plot(x, y, **style)
    low, high = ax.get_ylim()
    for style, *curve in curves:
        ax.errorbar(*curve, fmt="none", ecolor=style["color"], elinewidth=0.6)
    ax.set_ylim(low, high)
    for value, regime in ((1, "Newtonian"), (2, "Bagnoldian")):
        if low < value < high:
            ax.axhline(value, color=GREY, lw=0.6, ls=":")
            place = {"textcoords": "offset points", "ha": "right", "color": GREY}
            ax.annotate(regime, (1, value), (-2, 1), ("axes fraction", "data"), **place)


def plot_against_phi(results, path) -> None:
    """σ, p and Z against φ, a line for every rate of a kind. Raises InputError where none has two φ."""
    curves = flow_curves(results, "phi")
    if not any(len(curve["pressure"][0]) >= _FEWEST for curve in curves.values()):
        raise InputError(f"{results[0].path}: curves against phi need several phi of one model, rate and N")
    units = flow_units(results)
    kinds = [kind for kind, _ in curves]
    words = labels_of(kinds) if len(set(kinds)) > 1 else [""] * len(kinds)
    with figure(PAGE, HEIGHT * 1.2, layout="constrained") as fig:
        axes = fig.subplots(1, 3)
        looks = zip(words, colours(len(curves)), MARKERS * len(curves), strict=False)
        for ((_, rate), curve), (word, colour, marker) in zip(curves.items(), looks, strict=True):
            label = (f"{word}, " if word else "") + f"${number(rate * units.tau1)}$"
            bars = {"color": colour, "marker": marker, "capsize": 1.5, "elinewidth": 0.6, "label": label}
            for ax, name in zip(axes, QUANTITIES, strict=True):
                phi, y, error = curve[name]
                shown = (y > 0) | (name == "coordination")
                ax.errorbar(phi[shown], y[shown], error[shown], **bars)
        texts = [units.label(r"\sigma", "stress"), units.label("p", "stress"), "$Z$"]
        for ax, text in zip(axes, texts, strict=True):
            ax.set(xlabel=r"$\phi$", ylabel=text)
        for ax in axes[:2]:
            ax.set_yscale("log")
        axes[2].legend(title=units.label(r"\dot\gamma", "rate"))
        letter_panels(axes)
        save(fig, path)
