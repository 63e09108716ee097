"""Flow curves: stress, pressure, friction, viscosity and coordination against the rate, or against φ at each rate.

Local exponents d ln σ/d ln γ̇ show the regime (Vågberg, thesis sec. 6.4): 1 is Newtonian, where disks stay together in
large clusters, 2 Bagnoldian, where they part after a collision.
"""

import numpy as np

from jampetsc.analysis.correlated_series import mean_of_facts
from jampetsc.analysis.power_laws import local_exponents
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
    names = [units.label(r"\sigma", "stress"), units.label("p", "stress"), r"$\sigma/p$"]
    names += [units.label(r"\sigma/\dot\gamma,\ p/\dot\gamma", "viscosity")]
    names += [r"$d\ln\sigma/d\ln\dot\gamma,\ d\ln p/d\ln\dot\gamma$", "$Z$"]
    rate = units.label(r"\dot\gamma", "rate")
    axes = page.panels(2, 3, PAGE, 2 * HEIGHT, x=rate, y=names, log=["xy"] * 4 + ["x"] * 2)
    every = np.concatenate([curve["pressure"][0] for curve in curves.values()])
    for ax in axes:
        ax.set_xlim(every.min() / 1.3, 1.3 * every.max())
    exponents = []
    for (name, curve), look in looks(zip(labels_of(list(curves)), curves.values(), strict=True)):
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
    low, high = np.array([values.min(), values.max()]) + np.array([-0.06, 0.12]) * max(np.ptp(values), 0.1)
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
    names = [units.label(r"\sigma", "stress"), units.label("p", "stress"), "$Z$"]
    axes = page.panels(1, 3, PAGE, HEIGHT * 1.2, x=r"$\phi$", y=names, log=["y", "y", ""])
    for ax, name in zip(axes, QUANTITIES, strict=True):
        for (((_, rate), curve), word), look in looks(zip(curves.items(), words, strict=True)):
            label = (f"{word}, " if word else "") + f"${number(rate * units.tau1)}$"
            points(ax, *curve[name], label=label, **look)
    page.legend(axes[2], title=units.label(r"\dot\gamma", "rate"))
    return f"stress, pressure and coordination of {count(results, 'run', 'runs')} against phi"


def regimes(results) -> dict:
    """{model: {φ: (Q (M,), exponent (M,), error (M,), cluster (M,), low, high)}} of massive flows at two rates or more.

    exponent   d ln σ/d ln γ̇ between the two lowest rates, low and high, in 1/τ₁; nan where σ is not positive
    cluster    share of the disks in the largest cluster, at the lowest rate

    Raises InputError where there is no massive flow at two rates.
    """
    found, clusters = {}, {}
    for result in results:
        a = result.attributes
        clusters.setdefault((kind_of(result), float(a["rate"])), []).append(float(a["largest_cluster_mean"]))
    quality = {kind_of(result): result.attributes.get("quality") for result in results}
    for kind, curve in flow_curves(results).items():
        rates, stress, error = curve["shear_stress"]
        if quality[kind] is None or len(rates) < 2:
            continue
        exponent, spread = np.nan, np.nan
        if (stress[:2] > 0).all():
            _, (exponent,), (spread,) = local_exponents(rates[:2], stress[:2], error[:2])
        slowest = min(rate for one, rate in clusters if one == kind)
        share = np.mean(clusters[kind, slowest]) / kind[2]
        row = (float(quality[kind]), exponent, spread, share, rates[0], rates[1])
        found.setdefault(kind[0], {}).setdefault(kind[1], []).append(row)
    if not found:
        raise InputError(f"{results[0].path}: regimes are of massive disks at several rates of one φ and Q")
    return {
        model: {phi: np.array(sorted(rows)).T for phi, rows in sorted(some.items())}
        for model, some in found.items()
    }


@picture("regimes", "flow")
def plot_regimes(results, page):
    """Exponents of σ at the lowest rates, and the share of the largest cluster, against Q; a line for each φ.

    Raises InputError as `regimes`.
    """
    maps = regimes(results)
    phis = sorted({phi for some in maps.values() for phi in some})
    styles = dict(looks(phis))
    axes = page.panels(2, len(maps), PAGE, 4.2, x="$Q$", log="x", sharex=True, sharey="row").reshape(2, -1)
    axes[0, 0].set_ylabel(r"$d\ln\sigma/d\ln\dot\gamma$")
    axes[1, 0].set_ylabel("largest cluster$/N$")
    for (slope, share), (model, some) in zip(axes.T, sorted(maps.items()), strict=True):
        for value in (1, 2):
            slope.axhline(value, color=GREY, lw=0.6, ls=":")
        for phi, (quality, exponent, error, cluster, *_) in some.items():
            look = styles[phi] | {"label": hidden(rf"${phi:g}$")}
            points(slope, quality, exponent, error, **look)
            share.plot(quality, cluster, **look)
        slope.set_title(model, loc="right", pad=3)
        share.set_ylim(0, 1.05)
    handles = [entry(rf"${phi:g}$", **look) for phi, look in styles.items()]
    page.legend(axes[1, 0], handles, r"$\phi$", "lower left")
    return f"exponents and clusters of {count(results, 'run', 'runs')} against Q"
