"""Correlations of transverse displacements C(δ) and their length (BT Fig. 7)."""

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from jampetsc.analysis.correlations import LOG_EXPONENT, medium_collapse, stokes_collapse
from jampetsc.analysis.medium import dragged, first_root, solid
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
_DASHES = (
    "-",
    (0, (4, 1.6)),
    (0, (1, 1.2)),
    (0, (4, 1.2, 1, 1.2)),
)  # of files, where colours tell frequencies
_PARTS = (("Re", "-", 0), ("Im", (0, (4, 1.6)), 1))
SYMBOLS = {
    "stress": r"$u_y/\sigma$",
    "strain": r"$u_y/\gamma$",
}  # phase -> complex amplitudes of which parts are taken
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
    modulus: np.ndarray | None = None  # (F,) G*/k without iωη_F; None in files that do not tell it

    @property
    def phase(self) -> str:
        """What Re u_y is in phase with: "stress" or "strain"."""
        return self.attributes.get("phase", "strain")

    def at(self, rows) -> "CorrelationCurve":
        """The same at some of its frequencies."""
        return replace(
            self,
            omega=self.omega[rows],
            G=self.G[rows],
            bounds=self.bounds[:, rows],
            C=self.C[:, rows],
            errors=self.errors[:, rows],
            modulus=None if self.modulus is None else self.modulus[rows],
        )

    def rows(self, omega) -> list[int]:
        """Rows of frequencies in 1/τ₁. Raises InputError for one that the file does not have."""
        found = [int(np.abs(np.log(self.omega / one)).argmin()) for one in omega]
        for row, one in zip(found, omega, strict=True):
            if abs(np.log(self.omega[row] / one)) > _SAME:
                held = ", ".join(f"{w:g}" for w in self.omega)
                raise InputError(f"{self.name}: no correlation at omega = {one:g}: it has {held}")
        return found


def correlation_curve(result) -> CorrelationCurve:
    """A correlation file in units of the mean diameter d, k and 1/τ₁."""
    units, d = units_of(result), float(result.attributes["mean_diameter"])
    length, error = result["length"][0] / d, result["length_error"][0] / d
    omega, modulus = result["omega"] * units.tau1, None
    if "G" in result:
        modulus = result["G"] / units.k - 1j * omega * float(result.attributes.get("eta_f", 0.0))
    return CorrelationCurve(
        name=result.path.name,
        omega=omega,
        G=length[:, 0] + 1j * length[:, 1],
        bounds=error.T,
        pressure=units.pressure,
        attributes=result.attributes,
        C=result["C"],
        errors=result["C_error"],
        delta=result["delta"] / d,
        lanes=result["lane_width"] / d,
        size=float(result.attributes["L"]) / d,
        modulus=modulus,
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
            _label(ax, name, r"$\delta/L$", curve.phase)
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
    """C of several files at frequencies omega (F,) in 1/τ₁: against δ/d above and δ/L below, real part left.

    Colours tell the files apart; of several frequencies they tell these, dashes the files. Raises InputError for a file
    without one of the frequencies.
    """
    chosen = [curve.at(curve.rows(omega)) for curve in curves]
    several = len(omega) > 1
    with figure(PAGE, 2 * HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(2, 2, sharey=True, sharex="row")
        title, groups = group_curves(chosen)
        shades = colours(len(omega))
        looks = [(g, _DASHES[n % len(_DASHES)] if several else "-") for n, g in enumerate(groups)]
        for line, unit in enumerate(("d", "L")):
            for ax, (name, _, part) in zip(axes[line], _PARTS, strict=True):
                for group, dash in looks:
                    for curve in group.curves:
                        scale = 1.0 if unit == "d" else 1.0 / curve.size
                        for n in range(len(omega)):
                            shade = shades[n] if several else group.colour
                            _draw(ax, curve, n, part, shade, scale, dash=dash, band=not several)
                _label(ax, name, rf"$\delta/{unit}$", curves[0].phase)
        _fit(axes.flat, chosen)
        letter_panels(axes.flat)
        words = [title] if title else []
        if several:
            handles = [
                Line2D([], [], color=shade, label=rf"$\omega\tau_1={power_or_number(w)}$")
                for shade, w in zip(shades, omega, strict=True)
            ]
            handles += [Line2D([], [], color="0.2", linestyle=dash, label=g.label) for g, dash in looks]
        else:
            words.insert(0, rf"$\omega\tau_1={power_or_number(omega[0])}$")
            handles = [Line2D([], [], color=g.colour, label=g.label) for g in groups]
            handles += _explained(chosen, others=False)
        axes[0, 1].legend(
            handles=handles, title=",  ".join(words) or None, title_fontsize=8.5, loc="upper right"
        )
        save(fig, path)


def _draw(ax, curve, n, part, colour, scale, others=False, band=True, dash="-"):
    x, C, error = scale * curve.delta[0], curve.C[0, n, part], curve.errors[0, n, part]
    known = np.isfinite(C)
    ax.plot(x[known], C[known], color=colour, linestyle=dash, marker=".", markersize=2.5)
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


def _label(ax, name, x, phase):
    ax.axhline(0.0, color="0.6", linewidth=0.5, zorder=0)
    ax.set(xlabel=x, ylabel=rf"$C(\delta)$ of {name} {SYMBOLS[phase]}")
    ax.set_xlim(left=0.0)


def _fit(axes, curves):
    """The same vertical range for all panels: down to −½, or as far as some C goes."""
    lowest = min(float(np.nanmin(curve.C[0])) for curve in curves)
    for ax in axes:
        ax.set_ylim(min(-0.5, lowest - 0.05), 1.05)


def plot_lengths(curves, path, exponent=LOG_EXPONENT) -> None:
    """(a) l/L against ωτ₁; for Stokes drag two collapses: (b) l (−ln p)^exponent against ω/p^½ (BT), p in units of k,
    and (c) l against √(|G*|/ω), the length of an elastic medium (`analysis.medium`), where the files tell G*.

    Filled symbols: Re u_y; open ones: Im u_y. Dotted: L/4, and what random stresses give at low frequency, .169 L and
    .246 L. Raises InputError where no C has a root, a pressure is unknown, or files are in different phases.
    """
    if not any(np.isfinite(part).any() for curve in curves for part in (curve.G.real, curve.G.imag)):
        raise InputError(f"{curves[0].name}: no correlation falls to zero, so there is no length to show")
    for curve in curves:
        if curve.pressure is None:
            raise InputError(f"{curve.name}: attribute pressure is missing: correlate sweeps that have it")
    panels = [
        lambda curve, found, y: (curve.omega[found], y / curve.size),
        lambda curve, found, y: stokes_collapse(curve.omega[found], y, curve.pressure, exponent),
    ]
    if all(curve.modulus is not None for curve in curves):
        panels.append(lambda curve, found, y: medium_collapse(curve.omega[found], y, curve.modulus[found]))
    with figure(PAGE, HEIGHT + 0.2, layout="constrained") as fig:
        axes = fig.subplots(1, len(panels))
        title, groups = group_curves(curves)
        lines = [[] for _ in panels]
        for group, curve in ((one, curve) for one in groups for curve in one.curves):
            for _, dash, part in _PARTS:
                length = curve.G.imag if part else curve.G.real
                found = np.isfinite(length) & (length > 0)
                length, error = length[found], np.nan_to_num(curve.bounds[part][found])
                face = "white" if part else group.colour
                style = {"color": group.colour, "marker": group.marker, "markerfacecolor": face}
                style |= {"linestyle": dash, "linewidth": 0.8, "elinewidth": 0.6}
                if not len(length):
                    continue
                for ax, place, drawn in zip(axes, panels, lines, strict=True):
                    x, y = place(curve, found, length)
                    ax.errorbar(x, y, error * y / length, **style)
                    drawn.append((x, y))
        for ax, drawn in zip(axes, lines, strict=True):
            set_log_axes(ax, drawn)
        axes[0].axhline(0.25, color="0.4", linewidth=0.6, linestyle=":", zorder=0)
        for factor, shade in ((solid, "0.2"), (dragged, "0.6")):
            axes[0].axhline(first_root(factor), color=shade, linewidth=0.6, linestyle="--", zorder=0)
        letter_panels(axes)
        axes[0].set(xlabel=r"$\omega\tau_1$", ylabel=r"$l/L$")
        axes[1].set(
            xlabel=r"$\omega\tau_1\,/\,(p/k)^{1/2}$",
            ylabel=rf"$(l/d)\,[-\ln(p/k)]^{{{exponent:g}}}$",
        )
        if len(panels) > 2:
            axes[2].set(xlabel=r"$(|G^*|/k\omega\tau_1)^{1/2}$", ylabel=r"$l/d$")
        handles = [Line2D([], [], color=g.colour, marker=g.marker, label=g.label) for g in groups]
        for name, dash, part in _PARTS:
            face, label = "white" if part else "0.2", f"{name} {SYMBOLS[curves[0].phase]}"
            handles.append(Line2D([], [], color="0.2", marker="o", mfc=face, linestyle=dash, label=label))
        handles += [
            Line2D([], [], color="0.4", linewidth=0.6, linestyle=":", label="$L/4$"),
            Line2D([], [], color="0.4", linewidth=0.6, linestyle="--", label="medium"),
        ]
        place_legend(fig, axes[0], title, handles, lines[0])
        save(fig, path)
