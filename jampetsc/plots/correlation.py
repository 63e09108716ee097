"""Correlations of transverse displacements C(δ) and their length (BT Fig. 7)."""

from dataclasses import dataclass

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from jampetsc.analysis.correlations import LOG_EXPONENT, stokes_collapse
from jampetsc.errors import InputError
from jampetsc.plots.curves import Curve, group_curves
from jampetsc.plots.logaxes import place_legend, set_log_axes
from jampetsc.plots.style import (
    PAGE,
    colours,
    figure,
    letter_panels,
    number,
    power_or_number,
    save,
    sequential,
)
from jampetsc.plots.units import units_of

HEIGHT = 2.9  # inches, of a row of panels
_PARTS = (("Re", "-", 0), ("Im", (0, (4, 1.6)), 1))
_LEGEND_ROWS = 5  # more frequencies than this get a colour bar instead
_FEW = 3  # so many or fewer: bands and the other lane widths are drawn too
_SAME = 0.01  # frequencies closer than this, relatively, are one


@dataclass(frozen=True, eq=False)
class CorrelationCurve(Curve):
    """A correlation file; as a curve its lengths l/d, G.real from Re u_y and G.imag from Im u_y."""

    C: np.ndarray  # (lanes, F, 2, D)
    errors: np.ndarray  # (lanes, F, 2, D)
    delta: np.ndarray  # (lanes, D) δ/d
    lanes: np.ndarray  # (lanes,) widths/d
    size: float  # L/d


def correlation_curve(result) -> CorrelationCurve:
    """A correlation file in units of the mean diameter d, k and 1/τ₁."""
    units, d = units_of(result), float(result.attributes["mean_diameter"])
    length, error = result["length"][0] / d, result["length_error"][0] / d
    return CorrelationCurve(
        name=result.path.name,
        omega=result["omega"] * units.tau1,
        G=length[:, 0] + 1j * length[:, 1],
        bounds=error.T,
        pressure=units.pressure,
        attributes=result.attributes,
        C=result["C"],
        errors=result["C_error"],
        delta=result["delta"] / d,
        lanes=result["lane_width"] / d,
        size=float(result.attributes["L"]) / d,
    )


def plot_correlation(curve, path) -> None:
    """C against δ/L of one file at all its frequencies: real part left, imaginary part right.

    Of a few frequencies, bands are errors and thin lines the other lane widths: where these cannot be seen,
    the width does not matter.
    """
    few = len(curve.omega) <= _FEW
    with figure(PAGE, HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(1, 2, sharey=True)
        shades = colours(len(curve.omega))
        for ax, (name, _, part) in zip(axes, _PARTS, strict=True):
            for n, shade in enumerate(shades):
                _draw(ax, curve, n, part, shade, 1.0 / curve.size, others=few, band=few)
            _label(ax, name, r"$\delta/L$")
            top = ax.secondary_xaxis("top", functions=(lambda x: x * curve.size, lambda x: x / curve.size))
            top.set_xlabel(r"$\delta/d$")
            ax.tick_params(top=False)
        _fit(axes, [curve])
        letter_panels(axes)
        if len(curve.omega) <= _LEGEND_ROWS:
            handles = [
                Line2D([], [], color=shade, label=f"${power_or_number(w)}$")
                for shade, w in zip(shades, curve.omega, strict=True)
            ]
            handles += _explained([curve], others=True) if few else []
            axes[1].legend(handles=handles, title=r"$\omega\tau_1$", title_fontsize=8.5, loc="upper right")
        else:
            norm = LogNorm(curve.omega.min(), curve.omega.max())
            fig.colorbar(ScalarMappable(norm, sequential()), ax=axes, label=r"$\omega\tau_1$", pad=0.01)
        save(fig, path)


def plot_comparison(curves, omega, path) -> None:
    """C of several files at one frequency (in 1/τ₁), against δ/d above and against δ/L below.

    Raises InputError for a file without that frequency.
    """
    rows = {}
    for curve in curves:
        near = np.abs(np.log(curve.omega / omega))
        if near.min() > _SAME:
            held = ", ".join(f"{w:g}" for w in curve.omega)
            raise InputError(f"{curve.name}: no correlation at omega = {omega:g}: it has {held}")
        rows[curve] = int(near.argmin())
    with figure(PAGE, 2 * HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(2, 2, sharey=True, sharex="row")
        title, groups = group_curves(curves)
        for line, unit in enumerate(("d", "L")):
            for ax, (name, _, part) in zip(axes[line], _PARTS, strict=True):
                for group in groups:
                    for curve in group.curves:
                        scale = 1.0 if unit == "d" else 1.0 / curve.size
                        _draw(ax, curve, rows[curve], part, group.colour, scale)
                _label(ax, name, rf"$\delta/{unit}$")
        _fit(axes.flat, curves)
        letter_panels(axes.flat)
        handles = [Line2D([], [], color=g.colour, label=g.label) for g in groups]
        handles += _explained(curves, others=False)
        axes[0, 1].legend(
            handles=handles,
            title=rf"$\omega\tau_1={power_or_number(omega)}$" + (f",  {title}" if title else ""),
            title_fontsize=8.5,
            loc="upper right",
        )
        save(fig, path)


def _draw(ax, curve, n, part, colour, scale, others=False, band=True):
    x, C, error = scale * curve.delta[0], curve.C[0, n, part], curve.errors[0, n, part]
    known = np.isfinite(C)
    ax.plot(x[known], C[known], color=colour, marker=".", markersize=2.5)
    spread = np.where(np.isfinite(error) & band, error, 0.0)
    ax.fill_between(x[known], (C - spread)[known], (C + spread)[known], color=colour, alpha=0.15, linewidth=0)
    for lane in range(1, len(curve.C) if others else 1):
        known = np.isfinite(curve.C[lane, n, part])
        ax.plot(scale * curve.delta[lane, known], curve.C[lane, n, part, known], color=colour, linewidth=0.4)


def _explained(curves, others):
    """Legend entries for the bands, and for the thin lines of `others` where there are any."""
    entries = []
    if any(np.isfinite(curve.errors[0]).any() for curve in curves):
        entries.append(Patch(facecolor="0.2", alpha=0.15, label="standard error"))
    widths = [width for curve in curves if others for width in curve.lanes[1:]]
    if widths:
        lanes = ", ".join(f"${number(width)}\\,d$" for width in widths)
        entries.append(Line2D([], [], color="0.2", linewidth=0.4, label=f"lanes of {lanes}"))
    return entries


def _label(ax, name, x):
    ax.axhline(0.0, color="0.6", linewidth=0.5, zorder=0)
    ax.set(xlabel=x, ylabel=rf"$C(\delta)$ of {name} $u_y$")
    ax.set_xlim(left=0.0)


def _fit(axes, curves):
    """The same vertical range for all panels: down to −½, or as far as some C goes."""
    lowest = min(float(np.nanmin(curve.C[0])) for curve in curves)
    for ax in axes:
        ax.set_ylim(min(-0.5, lowest - 0.05), 1.05)


def plot_lengths(curves, path, exponent=LOG_EXPONENT) -> None:
    """l/L against ωτ₁, and the collapse for Stokes drag: l (−ln p)^exponent against ω/p^½, p in units of k.

    Filled symbols: Re u_y; open ones: Im u_y. The dotted line is L/4.
    Raises InputError where no C has a root or a pressure is unknown.
    """
    if not any(np.isfinite(part).any() for curve in curves for part in (curve.G.real, curve.G.imag)):
        raise InputError(f"{curves[0].name}: no correlation falls to zero, so there is no length to show")
    for curve in curves:
        if curve.pressure is None:
            raise InputError(f"{curve.name}: attribute pressure is missing: correlate sweeps that have it")
    with figure(PAGE, HEIGHT + 0.2, layout="constrained") as fig:
        axes = fig.subplots(1, 2)
        title, groups = group_curves(curves)
        lines = [[], []]
        for group in groups:
            for curve in group.curves:
                for _, dash, part in _PARTS:
                    length = curve.G.imag if part else curve.G.real
                    found = np.isfinite(length) & (length > 0)
                    omega, length = curve.omega[found], length[found]
                    error = np.nan_to_num(curve.bounds[part][found])
                    x, y = stokes_collapse(omega, length, curve.pressure, exponent)
                    style = {
                        "color": group.colour,
                        "marker": group.marker,
                        "markerfacecolor": "white" if part else group.colour,
                        "linestyle": dash,
                        "linewidth": 0.8,
                        "elinewidth": 0.6,
                    }
                    if len(omega):
                        axes[0].errorbar(omega, length / curve.size, error / curve.size, **style)
                        axes[1].errorbar(x, y, error * y / length, **style)
                        lines[0].append((omega, length / curve.size))
                        lines[1].append((x, y))
        for ax, drawn in zip(axes, lines, strict=True):
            set_log_axes(ax, drawn)
        axes[0].axhline(0.25, color="0.4", linewidth=0.6, linestyle=":", zorder=0)
        letter_panels(axes)
        axes[0].set(xlabel=r"$\omega\tau_1$", ylabel=r"$l/L$")
        axes[1].set(
            xlabel=r"$\omega\tau_1\,/\,(p/k)^{1/2}$",
            ylabel=rf"$(l/d)\,[-\ln(p/k)]^{{{exponent:g}}}$",
        )
        handles = [Line2D([], [], color=g.colour, marker=g.marker, label=g.label) for g in groups]
        for name, dash, part in _PARTS:
            face = "white" if part else "0.2"
            handles.append(
                Line2D([], [], color="0.2", marker="o", mfc=face, linestyle=dash, label=rf"{name} $u_y$")
            )
        handles.append(Line2D([], [], color="0.4", linewidth=0.6, linestyle=":", label="$L/4$"))
        place_legend(fig, axes[0], title, handles, lines[0])
        save(fig, path)
