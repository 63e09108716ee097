"""BT's figure 7: correlations of u_y of two sizes, and collapses of their length."""

import numpy as np

from jampetsc.analysis.displacement_correlation import (
    MAX_LENGTH,
    MIN_LENGTH,
    length_spread,
    medium_collapse,
    stokes_collapse,
)
from jampetsc.errors import InputError
from jampetsc.plots.correlation_plots import MEDIUM, correlation_curve
from jampetsc.plots.page import draw_points
from jampetsc.plots.style import GREY, PAGE, entry, hidden, looks, power_or_number
from papers.claims.medium import correlation, solid
from papers.pictures.shared import drawn, results

OMEGA = (1e-9, 1e-3, 1e3)
MIN_SPACING = 0.012  # of points of C in units of L; closer points hide each other
EXPONENTS = ((0.65, "as printed"), (0.0, "no logarithm"), (-0.65, "inverse"))  # of −ln p, BT's and others


@drawn("bt-fig7a")
def contact_damping(page, folder):
    """C of Re u_y against δ/L under contact damping at three frequencies and two N, and of random stresses."""
    files = results(folder, command="correlate", law="contact", phase="stress", pressure=1e-4)
    curves = sorted(map(correlation_curve, files), key=lambda curve: curve.size)
    ax = page.panels(1, 1, 5.2, 3.6, x=r"$\delta/L$", y=r"$C(\delta)$ of Re $u_y/\sigma$")
    ax.axhline(0.0, color=GREY, lw=0.6)
    handles = [entry(rf"$\omega\tau_1={power_or_number(w)}$", **look, ls="none") for w, look in looks(OMEGA)]
    for curve, face in zip(curves, ({"markerfacecolor": "white", "ls": "--"}, {"ls": "-"}), strict=False):
        size = int(curve.attributes["particle_count"])
        for row, (omega, look) in zip(curve.rows(OMEGA), looks(OMEGA), strict=True):
            delta, C = curve.delta[0] / curve.size, curve.C[0, row, 0]
            chosen, name = _spaced_rows(delta, C), hidden(f"N = {size}, omega = {omega:g}")
            error = curve.errors[0, row, 0, chosen]
            draw_points(ax, delta[chosen], C[chosen], error, lw=0.8, ms=3, label=name, **look | face)
        delta = np.geomspace(1.0 / curve.size, 0.5, 100)
        shape = correlation(solid, np.r_[0.0, delta], round(curve.size))
        look = {"color": "0.1", "lw": 1.0, "ls": face["ls"], "zorder": 4}
        ax.plot(delta, shape[1:] / shape[0], label=hidden(f"random stresses, N = {size}"), **look)
        handles.append(entry(f"$N={size}$", marker="o", **face))
    handles.append(entry("random stresses in a medium", "0.1", lw=1.0))
    page.legend(ax, handles, "$p/k=10^{-4}$", "upper right")
    ax.set(xlim=(0.0, 0.51), ylim=(-0.35, 1.02))


def _spaced_rows(x, y):
    """Rows with a value, x at least MIN_SPACING apart."""
    rows = []
    for row in np.flatnonzero(np.isfinite(y)):
        if not rows or x[row] - x[rows[-1]] >= MIN_SPACING:
            rows.append(row)
    return rows


@drawn("bt-fig7cd")
def lengths(page, folder):
    """l/L against ω, and four collapses of l without its plateau, in phase with the stress, of Re u_y."""
    _lengths(page, folder, "stress")


@drawn("bt-fig7cd-in-phase-with-the-strain")
def lengths_in_phase_with_the_strain(page, folder):
    """The lengths of bt-fig7cd in phase with the strain."""
    _lengths(page, folder, "strain")


def _lengths(page, folder, phase):
    files = results(folder, command="correlate", law="stokes", eta_f=0.0, phase=phase)
    largest = max(file.attributes["particle_count"] for file in files)
    curves = [correlation_curve(file) for file in files if file.attributes["particle_count"] == largest]
    curves = sorted(curves, key=lambda curve: curve.pressure)
    collapses = [
        (_rescaled(exponent), _scaled_length_label(exponent), words) for exponent, words in EXPONENTS
    ]
    collapses.append((_in_a_medium, "$l/d$", "medium"))
    x = [r"$\omega\tau_1$"] + [r"$\omega\tau_1\,/\,(p/k)^{1/2}$"] * 3 + [r"$(|G^*|/k\omega\tau_1)^{1/2}$"]
    y = ["$l/L$"] + [name for _, name, _ in collapses]
    axes = page.panels(2, 3, PAGE, 5.2, x=x, y=y, log="xy", count=5)
    for curve, look in looks(curves):
        label, length = f"${power_or_number(curve.pressure)}$", curve.G.real
        look |= {"lw": 0.8}
        draw_points(
            axes[0], curve.omega, length / curve.size, curve.bounds[0] / curve.size, label=label, **look
        )
        part = curve.at((length > MIN_LENGTH) & (length < MAX_LENGTH * curve.size))
        for ax, (collapse, *_) in zip(axes[1:], collapses, strict=True):
            at, value = collapse(part.omega, part.G.real, part)
            draw_points(ax, at, value, part.bounds[0] * value / part.G.real, label=hidden(label), **look)
    axes[0].axhline(0.25, color="0.4", lw=0.6, ls=":", zorder=0)
    axes[0].axhline(MEDIUM[0], color="0.4", lw=0.6, ls="--", zorder=0)
    for ax, (collapse, _, words) in zip(axes[1:], collapses, strict=True):
        try:
            spread = length_spread(
                [(curve.omega, curve.G.real + 0j, curve.size, curve) for curve in curves], collapse
            )
            ax.set_title(f"{words}: spread {100 * spread:.2g} %", loc="right", pad=3)
        except InputError:  # no two pressures overlap
            pass
    handles = axes[0].get_legend_handles_labels()[0]
    handles += [
        entry("$L/4$", "0.4", lw=0.6, ls=":"),
        entry(f"${MEDIUM[0]:.3f}\\,L$, medium", "0.4", lw=0.6, ls="--"),
    ]
    page.legend(axes[0], handles, rf"$p/k$;  $N={largest}$", "lower left")


def _scaled_length_label(exponent):
    return rf"$(l/d)\,[-\ln(p/k)]^{{{exponent:+g}}}$" if exponent else "$l/d$"


def _rescaled(exponent):
    """The collapse of BT with this exponent of −ln p."""
    return lambda omega, length, curve: stokes_collapse(omega, length, curve.pressure, exponent)


def _in_a_medium(omega, length, curve):
    return medium_collapse(omega, length, curve.at(curve.rows(omega)).modulus)
