"""G' and G'' against ω for one or many sweeps (BT Fig. 3a), and their critical collapse (BT Fig. 3b)."""

from dataclasses import replace

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from jampetsc.analysis.scaling import LAMBDA, MU, collapse
from jampetsc.errors import InputError
from jampetsc.plots.curves import group_curves
from jampetsc.plots.logaxes import draw_guide, place_legend, set_log_axes
from jampetsc.plots.style import COLUMN, LOSS, STORAGE, figure, power_text, save, sequential

HEIGHT = 2.9  # inches
_FEW = 16  # so many frequencies or fewer: a marker on each
_SPACED = 8  # markers along a longer curve
_LEGEND_ROWS = 7  # more pressures than this get a colour bar instead
_DASHES = (0, (4, 1.6))
BOTH = (STORAGE, LOSS)


def plot_moduli(curves, path, band="", parts=BOTH) -> None:
    """G'/k (solid, filled) and G''/k (dashed, open) against ωτ₁, with `bounds` as bands; band: what these are.

    parts   (STORAGE,) or (LOSS,) for one of the two
    """
    y = ",  ".join(f"{part}$/k$" for part in parts)
    _plot(curves, path, r"$\omega\tau_1$", y, None, r"\omega", band, parts)


def plot_collapse(curves, path, mu=MU, lam=LAMBDA, band="") -> None:
    """G'/p^μ and G''/p^μ against ω/p^λ, for ωτ₁ ≤ 1 where criticality ends; p in units of k. band as above.

    λ = 0 leaves the frequency as it is, and all of it, as where sliding costs nothing (BT Fig. 4a).

    Raises InputError if a sweep's pressure is unknown or not positive, or it has no frequency up to 1/τ₁.
    """
    x = rf"$\omega\tau_1\,/\,{power_text('(p/k)', lam)}$" if lam else r"$\omega\tau_1$"
    y = rf"{STORAGE}, {LOSS}  $[\,k\,{power_text('(p/k)', mu)}\,]$"
    critical, symbol = (mu / lam, "x") if lam else (None, r"\omega")
    _plot([_scaled(curve, mu, lam) for curve in curves], path, x, y, critical, symbol, band)


def _scaled(curve, mu, lam):
    require_pressure(curve)
    low = curve.omega <= (1.0 if lam else np.inf)
    if not low.any():
        raise InputError(
            f"{curve.name}: lowest frequency {curve.omega[0]:g}: critical scaling needs some up to 1/τ₁"
        )
    x, g = collapse(curve.omega[low], curve.G[low], curve.pressure, mu, lam)
    return replace(curve, omega=x, G=g, bounds=curve.bounds[..., low] / curve.pressure**mu)


def require_pressure(curve) -> None:
    """Raise InputError unless the curve's pressure is known and positive."""
    if curve.pressure is None:
        raise InputError(
            f"{curve.name}: attribute pressure is missing: a collapse needs it; run the sweep again"
        )
    if not curve.pressure > 0:
        raise InputError(f"{curve.name}: pressure {curve.pressure:g}: must be positive to scale with it")


def _plot(curves, path, x_label, y_label, critical, symbol, band, parts=BOTH):
    """critical: exponent of the regime between the crossovers, if it gets a guide as the viscous one does."""
    with figure(COLUMN, HEIGHT, layout="constrained") as fig:
        ax = fig.add_subplot(xlabel=x_label, ylabel=y_label)
        title, groups = group_curves(curves)
        lines = [
            line for n, g in enumerate(groups) for curve in g.curves for line in _draw(ax, g, curve, n, parts)
        ]
        if not lines:
            what = "neither G' nor G''" if parts == BOTH else "no modulus"
            raise InputError(f"{curves[0].name}: {what} is positive anywhere: nothing to show on log axes")
        set_log_axes(ax, lines)
        negative = sum(bool((curve.G.real <= 0).any()) for curve in curves)
        if negative and STORAGE in parts:  # unstable to shear, as small packings with pre-stress can be
            what = f"{STORAGE} < 0 (not shown) in {negative} of {len(curves)} sweeps"
            ax.text(0.02, 0.98, what, transform=ax.transAxes, va="top", fontsize=7.5)
        # Low pressure has the longest critical branch, high pressure the longest viscous one.
        lowest, highest = groups[0].curves[0], groups[-1].curves[0]
        if parts == BOTH and critical:
            draw_guide(ax, lowest.omega, lowest.G.imag, critical, symbol, lines, above=True)
        if parts == BOTH:
            draw_guide(ax, highest.omega, highest.G.imag, 1.0, symbol, lines, above=False)
        if len(groups) > _LEGEND_ROWS and title:
            _pressure_bar(fig, ax, groups)
            title, groups = "", []
        handles = _handles(groups, parts) + ([Patch(facecolor="0.2", alpha=0.25, label=band)] if band else [])
        place_legend(fig, ax, title, handles, lines)
        save(fig, path)


def _draw(ax, group, curve, number, shown_parts):
    """The lines of one sweep, each as (x, y) of the points that log axes can show."""
    solitary = len(group.curves) == 1
    lines = []
    parts = ((STORAGE, curve.G.real, "-", group.colour), (LOSS, curve.G.imag, _DASHES, "white"))
    for (part, values, dash, face), bound in zip(parts, curve.bounds, strict=True):
        positive = values > 0
        if part not in shown_parts or not positive.any():
            continue
        shown = np.where(positive, values, np.nan)
        ax.plot(
            curve.omega,
            shown,
            linestyle=dash,
            color=group.colour,
            marker=group.marker,
            markerfacecolor=face,
            markeredgewidth=0.7,
            markevery=_marker_rows(curve.omega, number),
            linewidth=1.1 if solitary else 0.7,
            alpha=1.0 if solitary else 0.8,
        )
        below, above = np.broadcast_to(bound, (2, len(values)))
        lower = np.maximum(values - below, 1e-12 * np.nanmin(shown))  # to the edge of the picture
        ax.fill_between(
            curve.omega, lower, values + above, where=positive, color=group.colour, alpha=0.25, linewidth=0
        )
        lines.append((curve.omega[positive], values[positive]))
    return lines


def _marker_rows(omega, number):
    """Rows that get a marker: all of a few; of many some, shifted so that markers of curves stay apart."""
    if len(omega) <= _FEW:
        return list(range(len(omega)))
    phase = (0.5 + 0.37 * number) % 1.0
    wanted = np.log(omega[0]) + (np.arange(_SPACED) + phase) / _SPACED * np.log(omega[-1] / omega[0])
    return sorted({int(np.abs(np.log(omega) - w).argmin()) for w in wanted})


def _pressure_bar(fig, ax, groups):
    """The colours of many pressures as a bar."""
    pressures = [group.curves[0].pressure for group in groups]
    bar = fig.colorbar(
        ScalarMappable(LogNorm(min(pressures), max(pressures)), sequential()), ax=ax, pad=0.02, aspect=30
    )
    bar.set_label("$p/k$")
    bar.ax.tick_params(which="both", length=2)


def _handles(groups, parts):
    """Legend entries: one for each group, then what the line styles mean."""

    def handle(label, colour, marker, face, dash):
        return Line2D(
            [], [], color=colour, marker=marker, mfc=face, mew=0.7, linestyle=dash, linewidth=1.1, label=label
        )

    entries = [handle(g.label, g.colour, g.marker, g.colour, "-") for g in groups]
    styles = {STORAGE: ("0.2", "-"), LOSS: ("white", _DASHES)}
    return entries + [handle(part, "0.2", "o", *styles[part]) for part in parts if len(parts) > 1]
