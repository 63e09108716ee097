"""Relaxation spectra, stress relaxation G(t) and creep compliance J(t) of one or many sweeps."""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.analysis.transient import Transient, transient
from jampetsc.errors import InputError
from jampetsc.plots.curves import Curve, group_curves
from jampetsc.plots.page import limits_kept
from jampetsc.plots.picture import count_text, picture, stress_unit, units_of
from jampetsc.plots.style import DASHED, DOTTED, PAGE, colours, entry, hidden, number

HEIGHT = 5.0  # inches
_MAX_DETAILED = 2  # spectra up to which modes and the content between them are drawn
_MIN_SHARE = 1e-4  # of the largest H; below it H is the flank of the window


@dataclass(frozen=True, eq=False)
class SpectrumCurve(Curve):
    """A spectrum in units of k and 1/τ₁, with G* at its own rates as the curve."""

    spectrum: RelaxationSpectrum
    transient: Transient


def spectrum_curve(result, window=None) -> SpectrumCurve:
    """The spectrum of a SweepResult or SpectrumResult, brought to units of k and 1/τ₁; a SpectrumCurve is one.

    Raises InputError for a sweep that holds none.
    """
    if isinstance(result, SpectrumCurve):
        return result
    units = units_of(result)
    k, tau1 = units.k, units.tau1
    stored, (slowest, fastest) = result.spectrum, result.frequency_range
    spectrum = RelaxationSpectrum(
        stored.G0 / k, stored.eta_inf / (k * tau1), stored.rates * tau1, stored.weights / k
    ).sorted()
    if window is None:
        window = result.attributes.get("window_decades")
    return SpectrumCurve(
        name=result.path.name,
        omega=spectrum.rates,
        G=spectrum.modulus(spectrum.rates),
        bounds=np.zeros((2, len(spectrum.rates))),
        pressure=units.pressure,
        attributes=result.attributes,
        spectrum=spectrum,
        transient=transient(spectrum, slowest * tau1, fastest * tau1, window),
    )


@picture("spectrum", "spectrum", "sweep")
def plot_relaxation(results, page):
    """Four panels: H(τ), its cumulative weight, G(t) and J(t), in units of k and τ₁.

    Raises InputError where no spectrum holds a mode.
    """
    curves = [spectrum_curve(result) for result in results]
    if not any(len(curve.spectrum.rates) for curve in curves):
        raise InputError(
            f"{curves[0].name}: no relaxation modes, G* = G0 + i omega eta. Draw its moduli instead."
        )
    labels = page.file_labels(len(curves))
    title, groups = group_curves(curves, crossed=False, labels=labels)
    x = [r"$\tau/\tau_1$"] * 2 + [r"$t/\tau_1$"] * 2
    unit = stress_unit(curves)
    y = [rf"${symbol}{unit.over}$" for symbol in ("H", r"\sum_{\tau_m\leq\tau}\,g_m", "G(t)")]
    y.append(rf"$J(t)\,{unit.name}$")
    axes = page.panels(2, 2, PAGE, HEIGHT, x=x, y=y, log=["xy", "x", "xy", "xy"])
    few = len(curves) <= _MAX_DETAILED
    for group in groups:
        for curve in group.curves:
            look = {"color": group.colour, "label": hidden(f"{group.label}, {curve.name}")}
            t, rates, total = curve.transient, curve.spectrum.rates, np.cumsum(curve.spectrum.weights)
            _draw_spectrum(axes[0], curve, few, look)
            # steps at the modes of the reduced pencil
            axes[1].step(1.0 / rates, total, where="post", marker="." if few else None, markersize=3, **look)
            axes[2].plot(*_positive(t.time, t.G), **look)
            dash = "-" if t.retardation.growth_rate == 0 else DASHED
            axes[3].plot(*_positive(t.creep_time, t.J), linestyle=dash, **look)
    axes[1].set_ylim(0.0, 1.05 * max(curve.spectrum.weights.sum() for curve in curves))
    _notes(page, axes, curves)
    if len(groups) > 1 or title or labels:
        page.legend(axes[1], [entry(g.label, g.colour) for g in groups], title)
    return f"relaxation spectrum, G(t) and J(t) of {count_text(results, 'spectrum', 'spectra')}"


@picture("transient", "spectrum")
def plot_transient(results, page):
    """Stress relaxation G(t) and creep J(t) in units of k and τ₁; dotted where they are negative, as masses may make
    them. A colour for each file, with its mass where masses differ.
    """
    labels, unit = page.file_labels(len(results)), stress_unit(results)
    masses = [result.attributes.get("mass", 0.0) for result in results]
    title = None
    if not labels and len(set(masses)) > 1:
        labels, title = [f"${number(mass)}$" for mass in masses], "mass"
    y = rf"$G(t){unit.over}$", rf"$J(t)\,{unit.name}$"
    axes = page.panels(1, 2, PAGE, 3.0, x=r"$t/\tau_1$", y=y, log="xy")
    shades = colours(len(results))
    for result, shade in zip(results, shades, strict=True):
        units = units_of(result)
        parts = ("stress/time", "stress/G", 1.0 / units.k), ("creep/time", "creep/J", units.k)
        for ax, (time, value, scale) in zip(axes, parts, strict=True):
            for sign, dash in ((1.0, "-"), (-1.0, DOTTED)):
                values = sign * scale * result[value]
                values[values <= 0.0] = np.nan
                look = {"color": shade, "linestyle": dash, "label": hidden(f"{value}, {result.path.name}")}
                ax.plot(result[time] / units.tau1, values, **look)
    if labels:
        page.legend(axes[0], [entry(*drawn) for drawn in zip(labels, shades, strict=True)], title)
    return f"G(t) and J(t) of {count_text(results, 'spectrum', 'spectra')}"


def _positive(x, y):
    shown = (y > 0) & np.isfinite(y)
    return x[shown], y[shown]


def _draw_spectrum(ax, curve, few, look):
    """H averaged over its window; for few spectra also the mean of H between modes, as steps."""
    t, spectrum = curve.transient, curve.spectrum
    tau, H = _positive(t.tau, np.where(t.H >= _MIN_SHARE * t.H.max(initial=0.0), t.H, 0.0))
    ax.plot(tau, H, **look)
    if few and len(spectrum.rates) > 1:
        times, between = spectrum.between()
        with limits_kept(ax):
            ax.stairs(np.maximum(between, 1e-300), times, baseline=None, color=look["color"], linewidth=0.5)
        middle, between = _positive(np.sqrt(times[1:] * times[:-1]), between)
        seen = between >= _MIN_SHARE * between.max()
        ax.update_datalim(np.column_stack((middle[seen], between[seen])))


def _notes(page, axes, curves):
    """Notes on limits of the curves."""
    small = {"fontsize": 7.5, "va": "top"}
    windows = sorted({round(curve.transient.window, 2) for curve in curves})
    text = f"averaged over {windows[0]:g}" + (f" to {windows[-1]:g}" if len(windows) > 1 else "") + " decades"
    handles = [entry(text)]
    if len(curves) <= _MAX_DETAILED and any(len(curve.spectrum.rates) > 1 for curve in curves):
        handles.append(entry("mean between nodes", linewidth=0.5))
    axes[0].legend(handles=handles, loc="lower left")
    viscous = [curve.spectrum.eta_inf for curve in curves if curve.spectrum.eta_inf > 0]
    if viscous:
        text = r"without $\eta_\infty\,\delta(t)$"
        if max(viscous) < 1.005 * min(viscous):
            text += rf", $\eta_\infty={number(viscous[0])}\,{stress_unit(curves).viscosity}$"
        axes[2].text(0.97, 0.97, text, ha="right", transform=axes[2].transAxes, **small)
    unstable = sum(curve.transient.retardation.growth_rate > 0 for curve in curves)
    if unstable:
        text = rf"$G_0<0$ in {unstable} of {len(curves)}: creep diverges (dashed)"
        axes[3].text(0.03, 0.97, text, transform=axes[3].transAxes, **small)
