"""Flow curves: stress, pressure, friction, viscosity and coordination against the rate, or against φ at each rate.

Local exponents d ln σ/d ln γ̇ tell the regime: 1 is Newtonian, 2 Bagnoldian (Vågberg, thesis sec. 6.4).
"""

import numpy as np

from jampetsc.analysis.averages import mean_of_facts
from jampetsc.analysis.scaling import local_exponents
from jampetsc.errors import InputError
from jampetsc.plots.page import points
from jampetsc.plots.picture import count, picture
from jampetsc.plots.shearing import draw_series, kind_of, labels_of
from jampetsc.plots.style import GREY, OPEN, PAGE, entry, hidden, looks, number
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
            values, errors = np.array([mean_of_facts(runs[one], name) for one in x]).T
            unit = 1.0 if name == "coordination" else units.k
            found[kind][name] = x * (units.tau1 if over == "rate" else 1.0), values / unit, errors / unit
    return found


def _ratio(one, other):
    """(value, error) of the quotient of two (value, error)."""
    value = one[0] / other[0]
    return value, np.abs(value) * np.hypot(one[1] / one[0], other[1] / other[0])


@picture("flow", "flow")
def plot_flow(results, page):
    """Flow curves of runs at several rates, as `draw_flow_curves`; σ and p over the strain of runs at one rate."""
    rates = {float(result.attributes["rate"]) for result in results}
    return draw_flow_curves(results, page) if len(rates) > 1 else draw_series(results, page)


def draw_flow_curves(results, page) -> str:
    """σ, p, σ/p, σ/γ̇ (filled) and p/γ̇ (hollow), local exponents of both, and Z against the rate.

    Rates at which the mean stress or pressure is not positive are left out of all but Z. Raises InputError where no
    kind has two rates.
    """
    curves, units = flow_curves(results), flow_units(results)
    if not any(len(curve["pressure"][0]) >= _FEWEST for curve in curves.values()):
        raise InputError(f"{results[0].path}: flow curves need several rates of one model, phi and N")
    labels = [units.label(r"\sigma", "stress"), units.label("p", "stress"), r"$\sigma/p$"]
    labels += [units.label(r"\sigma/\dot\gamma,\ p/\dot\gamma", "viscosity")]
    labels += [r"$d\ln\sigma/d\ln\dot\gamma,\ d\ln p/d\ln\dot\gamma$", "$Z$"]
    axes = page.panels(2, 3, PAGE, 2 * HEIGHT)
    every = np.concatenate([curve["pressure"][0] for curve in curves.values()])
    for ax, text in zip(axes, labels, strict=True):
        ax.set(xlabel=units.label(r"\dot\gamma", "rate"), ylabel=text, xscale="log")
        ax.set_xlim(every.min() / 1.3, 1.3 * every.max())
    for ax in axes[:4]:
        ax.set_yscale("log")
    exponents = []
    for name, look, curve in zip(labels_of(list(curves)), looks(len(curves)), curves.values(), strict=True):
        points(axes[5], *curve["coordination"], label=hidden(name), **look)
        rates = curve["pressure"][0]
        shown = (curve["shear_stress"][1] > 0) & (curve["pressure"][1] > 0)
        stress, pressure = ([part[shown] for part in curve[quantity][1:]] for quantity in QUANTITIES[:2])
        rates = rates[shown]
        for ax, both in zip(axes, (stress, pressure, _ratio(stress, pressure)), strict=False):
            points(ax, rates, *both, label=name, **look)
        for symbol, both, face in ((r"$\sigma$", stress, {}), ("$p$", pressure, OPEN)):
            named = look | {"label": hidden(f"{name}, {symbol}")}
            points(axes[3], rates, *(part / rates for part in both), **named | face)
            hollow = {"markerfacecolor": "white"} if face else {}
            exponents.append((named | hollow, *local_exponents(rates, *both)))
    _draw_exponents(axes[4], exponents)
    page.legend(axes[0], fontsize=7, handlelength=1.2, labelspacing=0.2)
    both = [entry(r"$\sigma$", marker="o"), entry("$p$", marker="o", mew=0.7, **OPEN)]
    page.legend(axes[3], both, fontsize=7, named=False)
    return f"flow curves of {count(results, 'run', 'runs')} at {len(set(every))} rates"


def _draw_exponents(ax, curves):
    """Local exponents with errors, in limits of the values, and lines at those that have a name and are in sight."""
    values = np.concatenate([y for _, _, y, _ in curves])
    low, high = np.array([values.min(), values.max()]) + np.array([-0.06, 0.06]) * max(np.ptp(values), 0.1)
    for look, x, y, error in curves:
        points(ax, x, y, error, **look)
    ax.set_ylim(low, high)
    for value, regime in ((1, "Newtonian"), (2, "Bagnoldian")):
        if low < value < high:
            ax.axhline(value, color=GREY, lw=0.6, ls=":")
            place = {"textcoords": "offset points", "ha": "right", "color": GREY}
            ax.annotate(regime, (1, value), (-2, 1), ("axes fraction", "data"), **place)


@picture("phi", "flow")
def plot_against_phi(results, page):
    """σ, p and Z against φ, a line for every rate of a kind. Raises InputError where none has two φ."""
    curves = flow_curves(results, "phi")
    if not any(len(curve["pressure"][0]) >= _FEWEST for curve in curves.values()):
        raise InputError(f"{results[0].path}: curves against phi need several phi of one model, rate and N")
    units = flow_units(results)
    kinds = [kind for kind, _ in curves]
    words = labels_of(kinds) if len(set(kinds)) > 1 else [""] * len(kinds)
    texts = [units.label(r"\sigma", "stress"), units.label("p", "stress"), "$Z$"]
    axes = page.panels(1, 3, PAGE, HEIGHT * 1.2)
    for ax, name, text in zip(axes, QUANTITIES, texts, strict=True):
        ax.set(xlabel=r"$\phi$", ylabel=text, yscale="linear" if name == "coordination" else "log")
        for ((_, rate), curve), word, look in zip(curves.items(), words, looks(len(curves)), strict=True):
            label = (f"{word}, " if word else "") + f"${number(rate * units.tau1)}$"
            points(ax, *curve[name], label=label, **look)
    page.legend(axes[2], title=units.label(r"\dot\gamma", "rate"))
    return f"stress, pressure and coordination of {count(results, 'run', 'runs')} against phi"
