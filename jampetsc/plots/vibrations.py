"""Mode spectra with their floppiness, what they carry of the response to shear, and the density of states."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm

from jampetsc.errors import InputError
from jampetsc.plots.floppy import pressures_of
from jampetsc.plots.picture import count, picture
from jampetsc.plots.style import COLUMN, DASHED, GREY, entry, hidden, looks, power_or_number, sequential
from jampetsc.plots.units import units_of

BINS = 8  # per decade of frequency, of the density of states


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


@picture("modes", "modes")
def plot_modes(results, page):
    """Above: frequency of each mode against its number, floppiness (rms Δu⊥/Δu∥) in colour. Below: the
    cumulative shares of Σ|u_na|² (solid) and of G_affine − G₀ (dashed) that the modes carry. A marker for
    each file.
    """
    _, labels = _labels(results)
    finite = [result["floppiness"][np.isfinite(result["floppiness"])] for result in results]
    norm = LogNorm(min(f.min() for f in finite), max(f.max() for f in finite))
    above, below = page.panels(2, 1, COLUMN, 4.4, sharex=True, height_ratios=(1.4, 1))
    above.set(xscale="log", yscale="log", ylabel=r"$\omega_m\ [\sqrt{k/m}]$")
    for result, look, name in zip(results, looks(len(results)), labels, strict=True):
        values, marker = eigenvalues(result), look["marker"]
        shown = values > 0
        floppiness = np.minimum(result["floppiness"][shown], norm.vmax)
        drawn = {"marker": marker, "s": 8, "linewidths": 0, "zorder": 3, "label": hidden(name)}
        number = 1 + np.flatnonzero(shown)
        above.scatter(number, np.sqrt(values[shown]), c=floppiness, cmap=sequential(), norm=norm, **drawn)
        if "cumulative/modulus" in result:
            number = 1 + np.arange(len(values))
            spaced = list(np.unique(np.geomspace(1, len(values), 8).astype(int)) - 1)  # even on a log axis
            for share, face, dash in (("nonaffine", "k", "-"), ("modulus", "white", DASHED)):
                dots = {"marker": marker, "mec": "k", "mfc": face, "mew": 0.6, "markevery": spaced}
                name_of = hidden(f"{share}, {name}")
                below.plot(number, result[f"cumulative/{share}"], "k", ls=dash, lw=0.8, label=name_of, **dots)
    below.set(xlabel="mode number", ylabel="cumulative share", ylim=(0, 1.3), yticks=(0, 0.5, 1))
    below.axhline(1.0, color=GREY, linewidth=0.5, zorder=0)
    bar = page.figure.colorbar(ScalarMappable(norm, sequential()), ax=above, pad=0.02, aspect=25)
    bar.set_label(r"$\langle\Delta u_\perp^2\rangle^{1/2}/\,\langle\Delta u_\parallel^2\rangle^{1/2}$")
    bar.ax.tick_params(which="both", length=2)
    files = zip(looks(len(results)), labels, strict=True)
    page.legend(
        above, [entry(label, "0.3", ls="none", marker=look["marker"]) for look, label in files], "$p/k$"
    )
    shares = [
        entry(r"$\Sigma|u_{\rm na}|^2$", "k", lw=0.8),
        entry(r"$G_{\rm aff}-G_0$", "k", lw=0.8, ls=DASHED),
    ]
    below.legend(handles=shares, loc="upper left", ncol=2)
    return f"modes of {count(results, 'packing', 'packings')}"


def chosen_modes(result, numbers):
    """[(title, field (n, 2)), …] of modes numbered from 1. Raises InputError."""
    stored, values = result.stored("modes"), eigenvalues(result)
    numbers = np.ravel(numbers).tolist()
    beyond = [n for n in numbers if not 1 <= n <= stored.shape[0]]
    if beyond:
        raise InputError(f"mode {beyond[0]}: {result.path.name} holds modes 1 to {stored.shape[0]}")
    return [
        (rf"mode {n}, $\lambda/k={power_or_number(max(values[n - 1], 0.0))}$", stored[n - 1]) for n in numbers
    ]


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


@picture("states", "modes")
def plot_states(results, page):
    """Density of states D(ω) of complete spectra, those of one pressure pooled.

    Without pre-stress a plateau begins at ω* ∝ Δz ∝ p^½ (Silbert, Liu & Nagel 2005; Wyart 2005). Raises
    InputError for files that do not hold all modes.
    """
    for result in results:
        if not result.attributes.get("complete", False):
            raise InputError(
                f"{result.path}: holds {len(result['eigenvalues'])} modes only: run modes with --all"
            )
    p, names = _labels(results)
    levels, first = np.unique(p, return_index=True)
    ax = page.panels()
    ax.set(xscale="log", yscale="log", xlabel=r"$\omega_m\ [\sqrt{k/m}]$", ylabel=r"$D(\omega_m)$")
    for level, row, look in zip(levels, first, looks(len(levels)), strict=True):
        pooled = [result for result, q in zip(results, p, strict=True) if q == level]
        ax.plot(*density_of_states(pooled), markersize=2.8, label=names[row], **look)
    page.legend(ax, title="$p/k$")
    return f"density of states of {count(results, 'packing', 'packings')}"
