"""Mode spectra with their floppiness, what they carry of the response to shear, and the density of states."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D

from jampetsc.errors import InputError
from jampetsc.plots.floppy import pressures_of
from jampetsc.plots.logaxes import place_legend, set_log_axes, set_ticks
from jampetsc.plots.style import (
    COLUMN,
    GREY,
    MARKERS,
    colours,
    figure,
    letter_panels,
    power_or_number,
    save,
    sequential,
)
from jampetsc.plots.units import units_of

BINS = 8  # per decade of frequency, of the density of states
_DASHES = (0, (4, 1.6))


def eigenvalues(result):
    """λ/k of the modes, increasing, (m,)."""
    return result["eigenvalues"] / units_of(result).k


def frequencies(result):
    """√(λ/k) of the modes, in units of √(k/m); modes of no energy are left out."""
    values = eigenvalues(result)
    return np.sqrt(values[values > 0])


def _labels(results):
    p = pressures_of(results)
    return p, [f"${power_or_number(float(f'{one:.3g}'))}$" for one in p]


def plot_modes(results, path) -> None:
    """Above: frequency of each mode against its number, floppiness (rms Δu⊥/Δu∥) in colour. Below: the
    cumulative shares of Σ|u_na|² (solid) and of G_affine − G₀ (dashed) that the modes carry. A marker for
    each file.
    """
    _, labels = _labels(results)
    finite = [result["floppiness"][np.isfinite(result["floppiness"])] for result in results]
    norm = LogNorm(min(f.min() for f in finite), max(f.max() for f in finite))
    with figure(COLUMN, 4.4, layout="constrained") as fig:
        above, below = fig.subplots(2, 1, sharex=True, height_ratios=(1.4, 1))
        lines = []
        for result, marker in zip(results, _markers(results), strict=True):
            values = eigenvalues(result)
            shown = values > 0
            number = 1 + np.flatnonzero(shown)
            colour = sequential()(norm(np.minimum(result["floppiness"][shown], norm.vmax)))
            above.scatter(
                number, np.sqrt(values[shown]), c=colour, marker=marker, s=8, linewidths=0, zorder=3
            )
            lines.append((number, np.sqrt(values[shown])))
            if "cumulative/modulus" in result:
                every = _spaced(len(values))
                below.plot(1 + np.arange(len(values)), result["cumulative/nonaffine"], "k-", lw=0.8)
                below.plot(1 + np.arange(len(values)), result["cumulative/modulus"], "k", ls=_DASHES, lw=0.8)
                for name, face in (("nonaffine", "k"), ("modulus", "white")):
                    share = result[f"cumulative/{name}"]
                    below.plot(1 + every, share[every], marker, mec="k", mfc=face, mew=0.6, ls="none")
        set_log_axes(above, lines)
        above.set(ylabel=r"$\omega_m\ [\sqrt{k/m}]$")
        above.tick_params(labelbottom=False)
        below.set(xlabel="mode number", ylabel="cumulative share", ylim=(0, 1.3), yticks=(0, 0.5, 1))
        below.axhline(1.0, color=GREY, linewidth=0.5, zorder=0)
        letter_panels((above, below))
        bar = fig.colorbar(ScalarMappable(norm, sequential()), ax=above, pad=0.02, aspect=25)
        bar.set_label(r"$\langle\Delta u_\perp^2\rangle^{1/2}/\,\langle\Delta u_\parallel^2\rangle^{1/2}$")
        set_ticks(bar.ax.yaxis, *np.log10((norm.vmin, norm.vmax)))
        bar.ax.tick_params(which="both", length=2)
        handles = [
            Line2D([], [], ls="none", marker=marker, color="0.3", label=label)
            for marker, label in zip(_markers(results), labels, strict=True)
        ]
        above.legend(handles=handles, title="$p/k$", loc="lower right", title_fontsize=8.5)
        below.legend(
            handles=[
                Line2D([], [], color="k", lw=0.8, label=r"$\Sigma|u_{\rm na}|^2$"),
                Line2D([], [], color="k", lw=0.8, ls=_DASHES, label=r"$G_{\rm aff}-G_0$"),
            ],
            loc="upper left",
            ncol=2,
        )
        save(fig, path)


def chosen_modes(result, text):
    """[(title, field (n, 2)), …] of modes numbered from 1, "3" or "1,2,5". Raises InputError."""
    m = result.stored("modes").shape[0]
    try:
        numbers = [int(word) for word in text.split(",")]
    except ValueError:
        raise InputError(f"--mode {text}: write numbers with commas, such as 1,2,5") from None
    beyond = [n for n in numbers if not 1 <= n <= m]
    if beyond:
        raise InputError(f"--mode {beyond[0]}: {result.path.name} holds modes 1 to {m}")
    values = eigenvalues(result)
    stored = result.stored("modes")
    return [
        (rf"mode {n}, $\lambda/k={power_or_number(max(values[n - 1], 0.0))}$", stored[n - 1]) for n in numbers
    ]


def _markers(results):
    return [MARKERS[n % len(MARKERS)] for n in range(len(results))]


def _spaced(count):
    """A few rows evenly spaced on a log axis."""
    return np.unique(np.geomspace(1, count, 8).astype(int)) - 1


def density_of_states(results):
    """(ω, D): states per unit frequency and degree of freedom, of complete spectra pooled, in log bins; empty
    bins out.
    """
    pooled = np.concatenate([frequencies(result) for result in results])
    states = sum(2 * len(result["particles"]) for result in results)
    low, high = np.floor(np.log10(pooled.min()) * BINS), np.ceil(np.log10(pooled.max()) * BINS)
    edges = 10.0 ** (np.arange(low, high + 1) / BINS)
    counts, _ = np.histogram(pooled, edges)
    filled = counts > 0
    return np.sqrt(edges[1:] * edges[:-1])[filled], (counts / np.diff(edges) / states)[filled]


def plot_states(results, path) -> None:
    """Density of states D(ω) of complete spectra, those of one pressure pooled.

    Without pre-stress a plateau begins at ω* ∝ Δz ∝ p^½ (Silbert, Liu & Nagel 2005; Wyart 2005). Raises
    InputError for files that do not hold all modes.
    """
    for result in results:
        if not result.attributes.get("complete", False):
            raise InputError(
                f"{result.path}: holds {len(result['eigenvalues'])} modes only: run modes with --all"
            )
    p, _ = _labels(results)
    levels = np.unique(p)
    with figure(COLUMN, 2.9, layout="constrained") as fig:
        ax = fig.add_subplot(xlabel=r"$\omega_m\ [\sqrt{k/m}]$", ylabel=r"$D(\omega_m)$")
        lines, handles = [], []
        for n, (level, shade) in enumerate(zip(levels, colours(len(levels)), strict=True)):
            x, y = density_of_states([result for result, q in zip(results, p, strict=True) if q == level])
            marker = MARKERS[n % len(MARKERS)]
            ax.plot(x, y, color=shade, marker=marker, markersize=2.8)
            handles.append(
                Line2D(
                    [], [], color=shade, marker=marker, label=f"${power_or_number(float(f'{level:.3g}'))}$"
                )
            )
            lines.append((x, y))
        set_log_axes(ax, lines)
        place_legend(fig, ax, "$p/k$", handles, lines)
        save(fig, path)
