"""Flow curves with their fitted laws: σ and p against the rate, the yield stress, and quasistatic shear."""

from typing import NamedTuple

import numpy as np

from jampetsc.analysis.correlated_series import mean_of_facts
from jampetsc.analysis.flow_laws import FORMS, FlowLaw
from jampetsc.errors import InputError
from jampetsc.plots.flow_kinds import labels_of
from jampetsc.plots.flow_plots import QUANTITIES, flow_curves
from jampetsc.plots.page import draw_band, draw_points
from jampetsc.plots.picture import count_text, flow_units, group_by, picture, units_of
from jampetsc.plots.style import COLUMN, DASHED, DOTTED, GREY, entry, hidden, looks

HEIGHT = 3.4  # inches
LINE_POINTS = 100  # of the line of a law
MIN_STRESS_RATIO = (
    0.02  # of a quasistatic stress that is drawn to the smallest stress of the flows: not what is unjammed
)
QUASISTATIC_STYLES = (("shear_stress", DOTTED), ("pressure", (0, (1, 3))))


class DrawnCurve(NamedTuple):
    """σ and p of one group of flows; in units of `picture.flow_units`."""

    label: str
    rate: np.ndarray  # (M,)
    stress: tuple  # values and errors, (M,) each
    pressure: tuple
    law: np.ndarray | None = None  # (LINE_POINTS,) fitted σ over the rates
    yield_stress: tuple | None = None  # (σ_y, low, high), 95 % interval
    quasistatic: tuple = ()  # ((σ, error), (p, error)), nan where unknown


def fitted_curves(results, units) -> list[DrawnCurve]:
    """The groups of results of `scaling`."""
    curves = []
    for result in results:
        words = str(result.attributes["groups"]).split("; ")
        has_yield_stress = FORMS[result.attributes["form"]].has_yield_stress
        for place, label in enumerate(words):
            own = result["group"] == place
            if not own.any():
                raise InputError(
                    f"{result.path}: attribute groups: not a name for each group. Make the file again."
                )
            names = [label] * bool(label) + [result.path.stem] * (len(results) > 1)

            def group(name, place=place, result=result):
                return float(result[f"groups/{name}"][place])

            rate = result["rate"][own]
            law = FlowLaw(*(group(name) for name in ("yield_stress", "consistency", "flow_index")))
            ends = [group(f"yield_stress{end}") / units.k for end in ("", "_low", "_high")]
            sheared = tuple(
                (group(f"quasistatic_{name}") / units.k, group(f"quasistatic_{name}_error") / units.k)
                for name in QUANTITIES[:2]
            )
            points = [
                tuple(result[f"{name}{part}"][own] / units.k for part in ("", "_error"))
                for name in QUANTITIES[:2]
            ]
            line = law.stress(np.geomspace(rate.min(), rate.max(), LINE_POINTS)) / units.k
            curves.append(
                DrawnCurve(
                    ", ".join(names) or str(result.attributes.get("model", result.path.stem)),
                    rate * units.tau1,
                    *points,
                    line,
                    tuple(ends) if has_yield_stress else None,
                    sheared,
                )
            )
    return curves


def measured_curves(flows, sheared, units) -> list[DrawnCurve]:
    """Flows without a fit, each kind with quasistatic shear of its φ and N. Raises InputError for shear of others."""
    curves = flow_curves(flows)
    quasistatic = {
        key: tuple(
            tuple(np.array(mean_of_facts([own.attributes for own in runs], name)) / units.k)
            for name in QUANTITIES[:2]
        )
        for key, runs in group_by(sheared, _particles).items()
    }
    words = str(flows[0].attributes.get("units"))
    keys = {kind: (*kind[1:3], units.k, words) for kind in curves}
    for result in sheared:
        phi, n, k, _ = key = _particles(result)
        if key not in keys.values():
            raise InputError(
                f"{result.path}: phi = {phi:g}, N = {n}, k = {k:g}: of no flow. Give quasistatic shear of the "
                "particles of a flow."
            )
    return [
        DrawnCurve(
            label,
            curve["shear_stress"][0],
            curve["shear_stress"][1:],
            curve["pressure"][1:],
            quasistatic=quasistatic.get(keys[kind], ()),
        )
        for (kind, curve), label in zip(curves.items(), labels_of(list(curves)), strict=True)
    ]


def _particles(result):
    """φ and N of a shear file as `kind_of` has them, its stiffness and units."""
    attributes = result.attributes
    phi, n = round(float(attributes["phi"]), 6), int(attributes["particle_count"])
    return phi, n, units_of(result).k, str(attributes.get("units"))


@picture(
    "flow-curve",
    "scaling",
    "flow",
    "shear",
    mixed=True,
    suits=lambda result: result.format != "jampetsc-shear",
)
def plot_flow_curve(results, page):
    """σ (filled) and p (hollow) against the rate, with fitted laws, yield stresses and quasistatic shear.

    Of results of `scaling` the points, the law (line), σ_y (dashed) and its 95 % interval (band); of flows the points;
    dotted: quasistatic σ and p. Raises InputError for flows beside a fit, which has their points.
    """
    fits, flows, sheared = (
        [result for result in results if result.format == f"jampetsc-{name}"]
        for name in ("scaling", "flow", "shear")
    )
    if fits and (flows or sheared):
        raise InputError(
            f"{fits[0].path}: a fit, which has the points of its flows. Draw it without other files."
        )
    if not fits and not flows:
        raise InputError(f"{results[0].path}: quasistatic shear alone. Give flows at several rates as well.")
    units = flow_units(fits or flows)  # quasistatic shear has no time
    curves = fitted_curves(fits, units) if fits else measured_curves(flows, sheared, units)
    label = units.label(r"\sigma,\ p", "stress")
    ax = page.panels(1, 1, COLUMN, HEIGHT, x=units.label(r"\dot\gamma", "rate"), y=label, log="xy")
    rates = np.concatenate([curve.rate for curve in curves])
    ends = np.array([rates.min() / 1.3, 1.3 * rates.max()])
    ax.set_xlim(*ends)
    for curve, look in looks(curves):
        _draw_curve(ax, curve, look, ends)
    kinds = [
        entry(r"$\sigma$", marker="o", ls="none"),
        entry("$p$", marker="o", mew=0.7, ls="none", markerfacecolor="white"),
    ]
    if fits:
        kinds.append(entry("fit", GREY, lw=1.0))
    if any(curve.yield_stress and curve.yield_stress[1] > 0 for curve in curves):
        kinds.append(entry(r"$\sigma_y$", GREY, lw=1.0, ls=DASHED))
    if any(curve.yield_stress for curve in curves):
        kinds.append(entry(r"95 % of $\sigma_y$", GREY, lw=6.0, alpha=0.25))
    if any(np.isfinite(curve.quasistatic).any() for curve in curves if curve.quasistatic):
        kinds.append(entry("quasistatic", GREY, lw=1.0, ls=DOTTED))
    handles = ax.get_legend_handles_labels()[0]
    page.legend(ax, handles + kinds, groups=len(handles), fontsize=7.5)
    shown = (
        f"{len(curves)} fitted flow curve{'s' * (len(curves) > 1)}"
        if fits
        else count_text(flows, "run", "runs")
    )
    return f"stress and pressure of {shown} against the rate"


def _draw_curve(ax, curve, look, ends):
    """Points, law, yield stress and quasistatic shear of a curve between the `ends` of the axis."""
    line = {"color": look["color"], "lw": 0.9, "zorder": 1.9}
    draw_points(ax, curve.rate, *curve.stress, ls="none", ms=3.5, label=curve.label, **look)
    draw_points(
        ax,
        curve.rate,
        *curve.pressure,
        ls="none",
        ms=3.5,
        label=hidden(f"{curve.label}, p"),
        **look,
        markerfacecolor="white",
    )
    if curve.law is not None:
        rates = np.geomspace(curve.rate.min(), curve.rate.max(), len(curve.law))
        shown = curve.law > 0
        ax.plot(rates[shown], curve.law[shown], label=hidden(f"{curve.label}, fit"), **line)
    if curve.yield_stress is not None:
        value, low, high = curve.yield_stress
        if low > 0:
            ax.plot(ends, [value] * 2, ls=DASHED, label=hidden(f"{curve.label}, sigma_y"), **line)
        if np.isfinite(high) and high > 0:
            bottom = max(low, 1e-3 * high)  # a log axis has no 0
            _draw_level(ax, ends, (bottom, high), f"{curve.label}, 95 % of sigma_y", look["color"])
    for (value, error), (name, style) in zip(curve.quasistatic, QUASISTATIC_STYLES, strict=False):
        if value > MIN_STRESS_RATIO * curve.stress[0].min():
            words = f"{curve.label}, quasistatic {name.replace('_', ' ')}"
            ax.plot(ends, [value] * 2, ls=style, label=hidden(words), **line)
            if error > 0:
                _draw_level(
                    ax, ends, (max(value - error, 1e-3 * value), value + error), f"{words}, error", GREY
                )


def _draw_level(ax, ends, limits, name, colour):
    """A band between two stresses along the whole axis."""
    low, high = ([limit] * 2 for limit in limits)
    draw_band(ax, ends, low, high, name, color=colour, alpha=0.18)
