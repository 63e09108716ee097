"""Correlations of transverse displacements C(δ) and their length (BT Fig. 7)."""

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.patches import Patch

from jampetsc.analysis.displacement_correlation import (
    LOG_EXPONENT,
    length_spread,
    medium_collapse,
    stokes_collapse,
)
from jampetsc.errors import InputError, named
from jampetsc.io.provenance import recorded_dimension
from jampetsc.options.values import FREQUENCIES
from jampetsc.plots.curves import Curve, entries_of, group_curves
from jampetsc.plots.page import HEIGHT, draw_band, draw_points
from jampetsc.plots.picture import MEAN_DIAMETER, count_text, option, picture, stress_unit, units_of
from jampetsc.plots.style import (
    DASHED,
    DOTTED,
    PAGE,
    colours,
    entry,
    hidden,
    number,
    power_or_number,
    sequential,
)

_DASHES = ("-", DASHED, DOTTED, (0, (4, 1.2, 1, 1.2)))  # of files, where colours are of frequencies
_PARTS = (("Re", "-", 0), ("Im", DASHED, 1))
SYMBOLS = {"stress": r"$u_y/\sigma$", "strain": r"$u_y/\gamma$"}  # phase -> complex amplitude
_MAX_ENTRIES = 7  # frequencies in a legend; more get a colour bar
_MAX_LANES = 3  # frequencies up to which the other lane widths are drawn
_FREQUENCY_TOLERANCE = 0.01  # relative, of requested frequencies
# l/L in a medium under random stresses at low frequency: Re u_y of a solid, and Im u_y under Stokes drag
# (docs/theory/linear_response.md; papers/claims/medium.py)
MEDIUM = (0.1691383468239038, 0.24575240074885307)
OMEGA = option(
    "omega",
    FREQUENCIES,
    "fields: frequencies as in the file (default: up to four); correlation: values of ωτ₁ (default: all of one "
    "file, the lowest of several)",
    "w1,w2,…",
)


@dataclass(frozen=True, eq=False)
class CorrelationCurve(Curve):
    """A correlation file; as a curve its lengths l/d, G.real from Re u_y and G.imag from Im u_y."""

    C: np.ndarray  # (lanes, F, 2, D)
    errors: np.ndarray  # (lanes, F, 2, D)
    delta: np.ndarray  # (lanes, D) δ/d
    lanes: np.ndarray  # (lanes,) widths/d
    size: float  # L/d
    modulus: np.ndarray | None = None  # (F,) G*/k without iωη_F; None for files without G*

    @property
    def phase(self) -> str:
        """What Re u_y is in phase with: "stress" or "strain"."""
        return self.attributes.get("phase", "strain")

    @property
    def diameter(self) -> str:
        """TeX of its unit of length, the mean diameter."""
        return MEAN_DIAMETER[recorded_dimension(self.attributes)]

    def at(self, rows) -> "CorrelationCurve":
        """The curve at some of its frequencies."""
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
        rows = [int(np.abs(np.log(self.omega / frequency)).argmin()) for frequency in omega]
        for row, frequency in zip(rows, omega, strict=True):
            if abs(np.log(self.omega[row] / frequency)) > _FREQUENCY_TOLERANCE:
                available = ", ".join(f"{w:g}" for w in self.omega)
                raise InputError(
                    f"{self.name}: no correlation at omega = {frequency:g}. Give one of {available}."
                )
        return rows


def correlation_curve(result) -> CorrelationCurve:
    """A correlation file in units of the mean diameter d, k and 1/τ₁; a CorrelationCurve is one."""
    if isinstance(result, CorrelationCurve):
        return result
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


@picture("correlation", "correlation", options=(OMEGA,))
def plot_correlation(results, page, omega=None):
    """C against δ/L of one file at all its frequencies, or at `omega` (F,) in 1/τ₁: real part left, imaginary right.

    Bands are errors. For a few frequencies thin lines are the other lane widths: if these cannot be seen, the width
    does not matter. Several files, or one at one frequency, are compared: against δ/d above and δ/L below; colours
    distinguish the files or, if there are several, the frequencies, and dashes then the files.

    Raises InputError for a file without one of the frequencies, and for files in different phases.
    """
    curves = _curves_in_phase(results)
    if len(curves) > 1 or (omega is not None and np.size(omega) == 1):
        return _draw_comparison(curves, [curves[0].omega.min()] if omega is None else np.ravel(omega), page)
    curve = curves[0] if omega is None else curves[0].at(curves[0].rows(omega))
    few, shades = len(curve.omega) <= _MAX_LANES, colours(len(curve.omega))
    axes = _panels(page, 1, [r"$\delta/L$"] * 2, curve)
    for ax, (_, _, part) in zip(axes, _PARTS, strict=True):
        for n, shade in enumerate(shades):
            _draw(
                ax,
                curve,
                n,
                part,
                shade,
                1.0 / curve.size,
                _frequency_label(curve.omega[n]),
                all_lanes=few,
            )
        top = ax.secondary_xaxis("top", functions=(lambda x: x * curve.size, lambda x: x / curve.size))
        top.set_xlabel(rf"$\delta/{curve.diameter}$")
        ax.tick_params(top=False)
    _set_limits(axes, [curve])
    explained = _explaining_entries([curve], all_lanes=few)
    if len(curve.omega) <= _MAX_ENTRIES:
        handles = [
            entry(f"${power_or_number(w)}$", shade) for shade, w in zip(shades, curve.omega, strict=True)
        ]
        page.legend(axes[1], handles + explained, r"$\omega\tau_1$", "upper right", groups=len(handles))
    else:
        page.legend(axes[1], explained, first="upper right", groups=0)
        shown = ScalarMappable(LogNorm(curve.omega.min(), curve.omega.max()), sequential())
        page.figure.colorbar(shown, ax=page.axes, label=r"$\omega\tau_1$", pad=0.01)
    return f"correlation at {len(curve.omega)} frequencies, in phase with the {curve.phase}"


def _curves_in_phase(results):
    """Curves of the files. Raises InputError if some are in the phase of the stress, others of the strain."""
    curves = [correlation_curve(result) for result in results]
    for curve in curves:
        if curve.phase != curves[0].phase:
            raise InputError(
                f"{curve.name}: in phase with the {curve.phase}, {curves[0].name} with the {curves[0].phase}. "
                f"Choose one phase (of a study by {named('where')} phase=stress)."
            )
    return curves


def _draw_comparison(curves, omega, page):
    chosen, several = [curve.at(curve.rows(omega)) for curve in curves], len(omega) > 1
    title, groups = group_curves(chosen, labels=page.file_labels(len(chosen)))
    shades = colours(len(omega))
    dashes = [_DASHES[n % len(_DASHES)] if several else group.dash for n, group in enumerate(groups)]
    axes = _panels(
        page,
        2,
        [rf"$\delta/{unit}$" for unit in (*[curves[0].diameter] * 2, "L", "L")],
        curves[0],
        sharex="row",
    )
    for ax, unit, (_, _, part) in zip(axes, "ddLL", _PARTS * 2, strict=True):
        for group, dash in zip(groups, dashes, strict=True):
            for curve in group.curves:
                scale = 1.0 if unit == "d" else 1 / curve.size
                for n, w in enumerate(omega):
                    shade, label = (
                        shades[n] if several else group.colour,
                        f"{group.label}, {curve.name}, {_frequency_label(w)}",
                    )
                    _draw(ax, curve, n, part, shade, scale, label, dash=dash, spread=not several)
    _set_limits(axes, chosen)
    if several:
        handles = [entry(_frequency_label(w), shade) for shade, w in zip(shades, omega, strict=True)]
        handles += [entry(g.label, linestyle=dash) for g, dash in zip(groups, dashes, strict=True)]
    else:
        title = ",  ".join(filter(None, (_frequency_label(omega[0]), title)))
        handles = entries_of(groups, lambda group: {"ls": group.dash}) + _explaining_entries(
            chosen, all_lanes=False
        )
    page.legend(axes[1], handles, title or None, "upper right")
    shown = ", ".join(f"{w:g}" for w in omega)
    files = count_text(curves, "file", "files")
    return f"correlation in {files} at omega tau1 = {shown}, in phase with the {curves[0].phase}"


def _frequency_label(omega):
    return rf"$\omega\tau_1={power_or_number(omega)}$"


def _panels(page, rows, x, curve, **grid):
    """Rows of two panels for Re and Im of u_y, with the phase of `curve`, and a line at 0."""
    y = [rf"$C(\delta)$ of {name} {SYMBOLS[curve.phase]}" for name, _, _ in _PARTS] * rows
    axes = page.panels(rows, 2, PAGE, rows * HEIGHT, x=x, y=y, sharey=True, **grid)
    for ax in axes:
        ax.axhline(0.0, color="0.6", linewidth=0.5, zorder=0)
    return axes


def _draw(ax, curve, n, part, colour, scale, label, all_lanes=False, spread=True, dash="-"):
    x, C, error = scale * curve.delta[0], curve.C[0, n, part], curve.errors[0, n, part]
    finite = np.isfinite(C)
    look = {"color": colour, "linestyle": dash, "marker": ".", "markersize": 2.5, "label": hidden(label)}
    ax.plot(x[finite], C[finite], **look)
    spread = np.where(np.isfinite(error) & spread, error, 0.0)
    draw_band(ax, x[finite], (C - spread)[finite], (C + spread)[finite], label, color=colour, alpha=0.15)
    for lane in range(1, len(curve.C) if all_lanes else 1):
        finite = np.isfinite(curve.C[lane, n, part])
        look = {
            "linewidth": 0.4,
            "label": hidden(rf"{label}, lanes of ${number(curve.lanes[lane])}\,{curve.diameter}$"),
        }
        ax.plot(scale * curve.delta[lane, finite], curve.C[lane, n, part, finite], color=colour, **look)


def _explaining_entries(curves, all_lanes):
    """Legend entries for the bands, and for the thin lines of `others` where there are any."""
    entries = []
    if any(np.isfinite(curve.errors[0]).any() for curve in curves):
        entries.append(Patch(facecolor="0.2", alpha=0.15, label="standard error"))
    widths = [width for curve in curves if all_lanes for width in curve.lanes[1:]]
    if widths:
        lanes = ", ".join(f"${number(width)}\\,{curves[0].diameter}$" for width in widths)
        entries.append(entry(f"lanes of {lanes}", linewidth=0.4))
    return entries


def _set_limits(axes, curves):
    """From δ = 0 on; the same vertical range for all panels: down to −½, or as far as some C goes."""
    lowest = min(float(np.nanmin(curve.C[0])) for curve in curves)
    for ax in axes:
        ax.set(xlim=(0.0, None), ylim=(min(-0.5, lowest - 0.05), 1.05))


@picture("length", "correlation")
def plot_lengths(results, page):
    """(a) l/L against ωτ₁; for Stokes drag two collapses: (b) l (−ln p)^0.65 against ω/p^½ (BT), p in units of k,
    and (c) l against √(|G*|/ω), the length of an elastic medium (docs/theory/linear_response.md), if the files have G*.

    Filled symbols: Re u_y; open ones: Im u_y. Dotted: L/4, and the lengths for random stresses at low frequency, .169 L
    and .246 L. Raises InputError if no C has a root, a pressure is unknown, or files have different phases.
    """
    curves = _curves_in_phase(results)
    if not any(np.isfinite(part).any() for curve in curves for part in (curve.G.real, curve.G.imag)):
        raise InputError(
            f"{curves[0].name}: no correlation falls to zero, so no length is known. Correlate lower frequencies."
        )
    for curve in curves:
        if curve.pressure is None:
            raise InputError(f"{curve.name}: attribute pressure: missing. Correlate sweeps that have it.")
    medium, over = all(curve.modulus is not None for curve in curves), stress_unit(curves).over
    d = curves[0].diameter
    panels = [  # names of the axes, and where lengths y of a curve lie in them
        (r"$\omega\tau_1$", "$l/L$", lambda curve, y: (curve.omega, y / curve.size)),
        (rf"$\omega\tau_1\,/\,(p{over})^{{1/2}}$", rf"$(l/{d})\,[-\ln(p{over})]^{{{LOG_EXPONENT:g}}}$",
         lambda curve, y: stokes_collapse(curve.omega, y, curve.pressure, LOG_EXPONENT)),
        (rf"$(|G^*|{over}\omega\tau_1)^{{1/2}}$", f"$l/{d}$",
         lambda curve, y: medium_collapse(curve.omega, y, curve.modulus)),
    ][: 3 if medium else 2]  # fmt: skip
    x_names, y_names, places = zip(*panels, strict=True)
    axes = page.panels(1, len(panels), PAGE, HEIGHT + 0.2, x=x_names, y=y_names, log="xy")
    title, groups = group_curves(curves, labels=page.file_labels(len(curves)))
    for ax, place in zip(axes, places, strict=True):
        for group, curve in ((owner, curve) for owner in groups for curve in owner.curves):
            for name, dash, part in _PARTS:
                length = curve.G.imag if part else curve.G.real
                positive = np.isfinite(length) & (length > 0)
                if not positive.any():
                    continue
                x, y = place(curve.at(positive), length[positive])
                error = curve.bounds[part][positive] * y / length[positive]
                look = {"color": group.colour, "marker": group.marker, "linestyle": dash, "linewidth": 0.8}
                look |= {"markerfacecolor": "white"} if part else {}
                draw_points(ax, x, y, error, label=hidden(f"{name}, {group.label}"), **look)
    axes[0].axhline(0.25, color="0.4", linewidth=0.6, linestyle=":", zorder=0)
    for length, shade in zip(MEDIUM, ("0.2", "0.6"), strict=True):
        axes[0].axhline(length, color=shade, linewidth=0.6, linestyle="--", zorder=0)
    handles = entries_of(groups, lambda group: {"marker": group.marker})
    of_groups = len(handles)
    for name, dash, part in _PARTS:
        face, label = "white" if part else "0.2", f"{name} {SYMBOLS[curves[0].phase]}"
        handles.append(entry(label, marker="o", mfc=face, linestyle=dash))
    handles.append(entry("$L/4$", "0.4", linewidth=0.6, linestyle=":"))
    handles.append(entry("medium", "0.4", linewidth=0.6, linestyle="--"))
    page.legend(axes[0], handles, title, groups=of_groups)
    return _lengths_in_words(curves, medium)


def _lengths_in_words(curves, medium):
    text = (
        f"correlation lengths of {count_text(curves, 'file', 'files')}, in phase with the {curves[0].phase}"
    )
    try:
        printed = [(c.omega, c.G, c.size, c.pressure, LOG_EXPONENT) for c in curves]
        spread = 100 * length_spread(printed, stokes_collapse)
        text += f"; l (-ln p)^{LOG_EXPONENT:g} differs by {spread:.2g} % (rms) at equal omega/p^(1/2)"
        if medium:
            spread = 100 * length_spread([(c.omega, c.G, c.size, c.modulus) for c in curves], medium_collapse)
            text += f", l by {spread:.2g} % at equal |G*|/omega"
    except InputError:  # one file, or files that share no scaled frequency
        pass
    return text
