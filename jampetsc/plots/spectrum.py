"""Relaxation spectra, stress relaxation G(t) and creep compliance J(t) of one or many sweeps."""

from dataclasses import dataclass

import numpy as np
from matplotlib.lines import Line2D

from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.analysis.transient import Transient, transient
from jampetsc.errors import InputError
from jampetsc.plots.curves import Curve, group_curves
from jampetsc.plots.logaxes import set_log_axes
from jampetsc.plots.style import PAGE, figure, letter_panels, number, save
from jampetsc.plots.units import units_of

HEIGHT = 5.0  # inches
_FEW = 2  # so many spectra or fewer: the modes and the content between them are drawn too
_SHARE = 1e-4  # H below this fraction of its largest value is the window's flank, not the spectrum


@dataclass(frozen=True, eq=False)
class SpectrumCurve(Curve):
    """A spectrum in units of k and 1/τ₁, with G* at its own rates as the curve."""

    spectrum: RelaxationSpectrum
    transient: Transient


def spectrum_curve(result, window=None) -> SpectrumCurve:
    """The spectrum of a SweepResult or SpectrumResult, brought to units of k and 1/τ₁.

    Raises InputError for a sweep that holds none.
    """
    units = units_of(result)
    k, tau1 = units.k, units.tau1
    found, (slowest, fastest) = result.spectrum, result.frequency_range
    spectrum = RelaxationSpectrum(
        found.G0 / k, found.eta_inf / (k * tau1), found.rates * tau1, found.weights / k
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


def plot_relaxation(curves, path) -> None:
    """Four panels: H(τ), its cumulative weight, G(t) and J(t), in units of k and τ₁.

    Raises InputError where no spectrum holds a mode.
    """
    if not any(len(curve.spectrum.rates) for curve in curves):
        raise InputError(f"{curves[0].name}: no relaxation modes: G* = G0 + i omega eta, nothing to draw")
    with figure(PAGE, HEIGHT, layout="constrained") as fig:
        title, groups = group_curves(curves)
        axes = fig.subplots(2, 2)
        for ax, draw, x, y in zip(
            axes.flat,
            (_spectrum, _cumulative, _relaxation, _creep),
            (r"$\tau/\tau_1$", r"$\tau/\tau_1$", r"$t/\tau_1$", r"$t/\tau_1$"),
            (r"$H/k$", r"$\sum_{\tau_m\leq\tau}\,g_m/k$", r"$G(t)/k$", r"$J(t)\,k$"),
            strict=True,
        ):
            ax.set(xlabel=x, ylabel=y)
            lines = [
                line for g in groups for curve in g.curves for line in draw(ax, g.colour, curve, len(curves))
            ]
            set_log_axes(ax, [line for line in lines if len(line[0])])
        axes[0, 1].set_yscale("linear")
        axes[0, 1].set_ylim(0.0, 1.05 * max(curve.spectrum.weights.sum() for curve in curves))
        letter_panels(axes.flat)
        _notes(axes, curves)
        handles = [Line2D([], [], color=g.colour, label=g.label) for g in groups]
        if len(groups) > 1 or title:
            axes[0, 1].legend(handles=handles, title=title, title_fontsize=8.5, loc="lower right")
        save(fig, path)


def _positive(x, y):
    shown = (y > 0) & np.isfinite(y)
    return x[shown], y[shown]


def _spectrum(ax, colour, curve, count):
    """H averaged over its window; for few spectra also the mean of H between modes, as steps."""
    t, spectrum = curve.transient, curve.spectrum
    tau, H = _positive(t.tau, np.where(t.H >= _SHARE * t.H.max(initial=0.0), t.H, 0.0))
    ax.plot(tau, H, color=colour)
    if count <= _FEW and len(spectrum.rates) > 1:
        times, between = spectrum.between()
        ax.stairs(np.maximum(between, 1e-300), times, baseline=None, color=colour, linewidth=0.5)
        middle, between = _positive(np.sqrt(times[1:] * times[:-1]), between)
        kept = between >= _SHARE * between.max()
        return [(tau, H), (middle[kept], between[kept])]
    return [(tau, H)]


def _cumulative(ax, colour, curve, count):
    """Weight of all modes up to τ: steps at the modes, whose number is that of the reduced pencil."""
    times, weights = 1.0 / curve.spectrum.rates, curve.spectrum.weights
    total = np.cumsum(weights)
    ax.step(times, total, where="post", color=colour, marker="." if count <= _FEW else None, markersize=3)
    return [(times, total)]


def _relaxation(ax, colour, curve, count):
    time, G = _positive(curve.transient.time, curve.transient.G)
    ax.plot(time, G, color=colour)
    return [(time, G)]


def _creep(ax, colour, curve, count):
    time, J = _positive(curve.transient.creep_time, curve.transient.J)
    stable = curve.transient.retardation.growth_rate == 0
    ax.plot(time, J, color=colour, linestyle="-" if stable else (0, (3, 1.5)))
    return [(time, J)]


def _notes(axes, curves):
    """What the curves do not show by themselves."""
    small = {"fontsize": 7.5, "va": "top", "ha": "right"}
    windows = sorted({round(curve.transient.window, 2) for curve in curves})
    text = f"averaged over {windows[0]:g}" + (f" to {windows[-1]:g}" if len(windows) > 1 else "") + " decades"
    handles = [Line2D([], [], color="0.2", label=text)]
    if len(curves) <= _FEW and any(len(curve.spectrum.rates) > 1 for curve in curves):
        handles.append(Line2D([], [], color="0.2", linewidth=0.5, label="mean between nodes"))
    axes[0, 0].legend(handles=handles, loc="lower left")
    viscous = [curve.spectrum.eta_inf for curve in curves if curve.spectrum.eta_inf > 0]
    if viscous:
        text = r"without $\eta_\infty\,\delta(t)$"
        if max(viscous) < 1.005 * min(viscous):
            text += rf", $\eta_\infty={number(viscous[0])}\,k\tau_1$"
        axes[1, 0].text(0.97, 0.97, text, transform=axes[1, 0].transAxes, **small)
    unstable = sum(curve.transient.retardation.growth_rate > 0 for curve in curves)
    if unstable:
        text = rf"$G_0<0$ in {unstable} of {len(curves)}: creep diverges (dashed)"
        axes[1, 1].text(0.03, 0.97, text, transform=axes[1, 1].transAxes, **{**small, "ha": "left"})
