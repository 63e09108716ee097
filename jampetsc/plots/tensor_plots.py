"""Elastic constants of sweeps of the tensor: K* beside G*, Poisson's ratio, and the constants themselves against ω."""

from dataclasses import replace

import numpy as np

from jampetsc.analysis.elasticity import dimension_of, poisson_ratio
from jampetsc.laws.loads import tensor_components
from jampetsc.plots.chosen_columns import chosen_properties
from jampetsc.plots.curves import (
    average_curves,
    bulk_curve_of,
    curve_of,
    group_curves,
    require_tensor,
)
from jampetsc.plots.moduli_plots import BY, STATISTIC
from jampetsc.plots.page import draw_band
from jampetsc.plots.picture import STRESS_UNITS, count_text, picture, stress_unit, units_of
from jampetsc.plots.style import DASHED, DOTTED, GREY, LOSS, PAGE, STORAGE, colours, entry, hidden

HEIGHT = 3.0  # inches
BULK_STORAGE, BULK_LOSS = "$K$\u2032", "$K$\u2033"
OMEGA = r"$\omega\tau_1$"


@picture("bulk", "sweep", options=(STATISTIC, BY))
def plot_bulk(results, page, statistic=None, by=()):
    """The bulk modulus K*/k (solid) beside the shear modulus G*/k (dashed), averaged over all directions.

    Storage and loss are panels of their own; values that are not positive are left out.
    """
    bulk, shear = _averages(results, statistic, by)
    over = stress_unit(results).over
    y = [f"{part}${over}$" for part in (f"{BULK_STORAGE}, {STORAGE}", f"{BULK_LOSS}, {LOSS}")]
    axes = page.panels(1, 2, PAGE, HEIGHT, x=OMEGA, y=y, log="xy")
    labels = page.file_labels(len(bulk)) if statistic is None else []
    for curves, dash, name in ((bulk, "-", "K"), (shear, DASHED, "G")):
        title, groups = _draw_parts(axes, curves, name, (dash, dash), labels)
    _legends(page, axes, title, groups, labels, [entry("$K$*"), entry("$G$*", ls=DASHED)])
    return f"K* and G* of {count_text(results)}"


@picture("poisson", "sweep", options=(STATISTIC, BY))
def plot_poisson(results, page, statistic=None, by=()):
    """Poisson's ratio of K* and G*, (D K − 2G)/(D(D − 1) K + 2G): real part (solid), imaginary part (dashed)."""
    bulk, shear = _averages(results, statistic, by)
    D = dimension_of(results[0]["C"])
    ratios = [
        replace(K, G=poisson_ratio(K.G, G.G, D), bounds=_ratio_bounds(K, G, D))
        for K, G in zip(bulk, shear, strict=True)
    ]
    ax = page.panels(x=OMEGA, y="$\\nu$\u2032, $\\nu$\u2033", log="x")
    ax.axhline(0.0, color=GREY, lw=0.5, ls=DOTTED)
    labels = page.file_labels(len(ratios)) if statistic is None else []
    title, groups = _draw_parts((ax, ax), ratios, "nu", ("-", DASHED), labels, is_log=False)
    _legends(page, [ax], title, groups, labels, [entry("$\\nu$\u2032"), entry("$\\nu$\u2033", ls=DASHED)])
    return f"Poisson's ratio of {count_text(results)}"


@picture("tensor", "sweep", single=True)
def plot_tensor(results, page):
    """|C′|/k and |C″|/k of all elastic constants, negative ones dotted.

    Grey: constants that vanish in an isotropic solid.
    """
    (result,) = results
    require_tensor(result)
    units, C = units_of(result), result["C"]
    omega, names = result.omega * units.tau1, tensor_components(dimension_of(C))
    rows = [(a, b) for a in range(len(names)) for b in range(a, len(names))]
    D = dimension_of(C)
    isotropic = [(a, b) for a, b in rows if a == b or b < D]
    y = [f"$|C${prime}$|{STRESS_UNITS[D].over}$" for prime in "\u2032\u2033"]
    axes = page.panels(1, 2, PAGE, HEIGHT + 0.4, x=OMEGA, y=y, log="xy")
    shades, entries = dict(zip(isotropic, colours(len(isotropic)), strict=True)), []
    for a, b in sorted(rows, key=lambda pair: pair in shades):
        colour, label = shades.get((a, b), "0.7"), f"$C_{{{names[a]}{names[b]}}}$"
        parts = zip(axes, (C[:, a, b].real, C[:, a, b].imag), ("\u2032", "\u2033"), strict=True)
        for ax, part, prime in parts:
            look = {"color": colour, "lw": 1.1 if (a, b) in shades else 0.7}
            for sign, dash in ((1.0, "-"), (-1.0, DOTTED)):
                shown = np.where(sign * part > 0.0, sign * part / units.k, np.nan)
                if np.isfinite(shown).any():
                    ax.plot(
                        omega,
                        shown,
                        ls=dash,
                        label=hidden(f"C{prime} {names[a]}{names[b]}, {sign:+g}"),
                        **look,
                    )
        if (a, b) in shades:
            entries.append(entry(label, colour))
    page.legend(axes[0], entries, ncol=2 if len(entries) > 4 else 1, fontsize=7.5)
    page.legend(axes[1], [entry("0 in an isotropic solid", "0.7"), entry("negative", ls=DOTTED)])
    return f"elastic constants of {result.path.name}"


def _averages(results, statistic, by):
    """Curves of K* and of G*, of each sweep or averaged over packings."""
    curves = tuple(
        chosen_properties([of(result) for result in results], by) for of in (bulk_curve_of, curve_of)
    )
    return curves if statistic is None else tuple(average_curves(group, statistic) for group in curves)


def _ratio_bounds(bulk, shear, D):
    """Errors of the real and the imaginary part of Poisson's ratio, to first order."""
    scale = 2.0 * D**2 / np.abs(D * (D - 1) * bulk.G + 2.0 * shear.G) ** 2
    K, G = (np.max(np.reshape(curve.bounds, (-1, len(curve.G))), axis=0) for curve in (bulk, shear))
    error = scale * (np.abs(shear.G) * K + np.abs(bulk.G) * G)
    return np.array([error, error])


def _draw_parts(axes, curves, name, dashes, labels, is_log=True):
    """Draw the real and the imaginary part of curves, each on its axes; (title, groups) of `group_curves`."""
    title, groups = group_curves(curves, crossed=False, labels=labels)
    for group in groups:
        for curve in group.curves:
            parts = zip(
                axes, (curve.G.real, curve.G.imag), curve.bounds, ("\u2032", "\u2033"), dashes, strict=True
            )
            for ax, values, bound, prime, dash in parts:
                label = f"{name}{prime}, {group.label}, {curve.name}"
                _line(ax, curve, values, bound, group.colour, label, dash, is_log)
    return title, groups


def _line(ax, curve, values, bound, colour, name, dash, is_log):
    """A line with the band of its error."""
    shown = np.where(values > 0.0, values, np.nan) if is_log else values
    if not np.isfinite(shown).any():
        return
    ax.plot(curve.omega, shown, color=colour, ls=dash, label=hidden(name))
    below, above = np.broadcast_to(bound, (2, len(values)))
    low = np.maximum(values - below, 1e-12 * np.nanmin(shown)) if is_log else values - below
    draw_band(ax, curve.omega, low, values + above, name, where=np.isfinite(shown), color=colour)


def _legends(page, axes, title, groups, labels, parts):
    """Legends of dashes and of groups, a single one if it has a label of the user."""
    is_named = len(groups) > 1 or labels
    entries = [entry(group.label, group.colour) for group in groups] if is_named else []
    if len(axes) > 1 and entries:
        page.legend(axes[0], entries, title)
        entries = []
    page.legend(axes[-1], [*entries, *parts], title if entries else None, groups=len(entries))
