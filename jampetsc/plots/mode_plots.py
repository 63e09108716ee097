"""Mode spectra: floppiness, shares in the response to shear, density of states, participation ratios."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.patches import Patch

from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import InputError, named
from jampetsc.io.disk_motion import mode_vectors
from jampetsc.io.provenance import recorded_dimension
from jampetsc.plots.page import draw_band, draw_points, draw_power_law
from jampetsc.plots.picture import count_text, group_by, picture, stress_unit, units_of
from jampetsc.plots.quasistatic_plots import QUANTITIES, groups_of, pressures_of, require_alike, values_of
from jampetsc.plots.style import (
    COLUMN,
    DASHED,
    DOTTED,
    GREY,
    MARKERS,
    OPEN,
    PAGE,
    colours,
    entry,
    hidden,
    looks,
    power_or_number,
    power_text,
    sequential,
)

BINS_PER_DECADE = 8  # of frequency
DEBYE_RANGE = 10.0  # highest over lowest frequency that Debye's law is drawn through
MIN_BINNED = 5  # modes of a bin with a median
MAX_POINTS = 2000  # that a picture for print holds one by one
SAME_EDGE = 1e-9  # edges of files that differ by less, relatively, are the same
MIN_EIGENVALUE = 1e-14  # λ/k: what is smaller is the rounding of modes of no energy
SPECTRUM_SETTINGS = ("dimension", "prestress", "mass_by")  # alike in files of one spectrum
OMEGA = r"\omega_m"
FREQUENCY = rf"${OMEGA}\ [\sqrt{{k/m}}]$"


def logarithmic_edges(frequencies):
    """Edges (B + 1,) of bins of frequency that hold all of these, (m,) positive."""
    low = np.floor(np.log10(frequencies.min()) * BINS_PER_DECADE)
    high = np.ceil(np.log10(frequencies.max()) * BINS_PER_DECADE)
    return 10.0 ** (np.arange(low, high + 1) / BINS_PER_DECADE)


def eigenvalues(result):
    """λ/k of the modes, increasing, (m,). Raises InputError for numbers of states."""
    if "eigenvalues" not in result:
        raise InputError(f"{result.path}: numbers of states, not modes. Run modes without {named('states')}.")
    return result["eigenvalues"] / units_of(result).k


def has_energy(result):
    """Mask (m,) of the modes with a frequency."""
    return eigenvalues(result) > MIN_EIGENVALUE


def frequencies(result):
    """√(λ/k) of the modes, in units of √(k/m); modes of no energy are left out."""
    return np.sqrt(eigenvalues(result)[has_energy(result)])


def _pressure(level):
    return f"${power_or_number(float(f'{level:.3g}'))}$"


def group_by_pressure(results) -> dict:
    """{p/k: files}, low pressure first; 0 of networks at rest."""
    levels = group_by(zip(pressures_of(results, zero=True), results, strict=True), lambda pair: pair[0])
    return {level: [result for _, result in files] for level, files in sorted(levels.items())}


@picture("modes", "modes", suits=lambda result: "eigenvalues" in result)
def plot_modes(results, page):
    """Above: frequency of each mode against its number, floppiness (rms Δu⊥/Δu∥) in colour. Below: the cumulative
    shares of Σ|u_na|² (solid) and of G_affine − G₀ (dashed) that the modes carry, means over the files of one
    pressure with errors as bands. A marker for each pressure. Raises InputError for several dimensions, loads or
    masses.
    """
    require_alike(results, ("dimension", "load", "mass_by"))
    stiff = [np.abs(eigenvalues(result)) > MIN_EIGENVALUE for result in results]
    floppiness = np.concatenate(
        [result["floppiness"][mask] for result, mask in zip(results, stiff, strict=True)]
    )
    floppiness = floppiness[np.isfinite(floppiness) & (floppiness > 0)]
    if not len(floppiness):
        raise InputError(f"{results[0].path}: dataset floppiness: no positive number. Make the file again.")
    norm = LogNorm(floppiness.min(), floppiness.max())
    axes = {"x": "mode number", "y": [FREQUENCY, "cumulative share"], "log": ["xy", "x"]}
    above, below = page.panels(2, 1, COLUMN, 4.4, **axes, sharex=True, height_ratios=(1.4, 1))
    pressures = looks(group_by_pressure(results).items())
    for (level, files), look in pressures:
        name, marker = _pressure(level), look["marker"]
        for result in files:
            values = eigenvalues(result)
            shown = has_energy(result)
            floppiness = np.minimum(result["floppiness"][shown], norm.vmax)
            drawn = {"marker": marker, "s": 8, "linewidths": 0, "zorder": 3, "label": hidden(name)}
            number = 1 + np.flatnonzero(shown)
            above.scatter(number, np.sqrt(values[shown]), c=floppiness, cmap=sequential(), norm=norm, **drawn)
        for share, face, dash in (("nonaffine", "k", "-"), ("modulus", "white", DASHED)):
            shares = [result[path] for result in files if (path := f"cumulative/{share}") in result]
            if not shares:
                continue
            shared = min(map(len, shares))  # modes that all files have
            mean, error = mean_with_error(np.array([share_of_file[:shared] for share_of_file in shares]))
            number = 1 + np.arange(shared)
            spaced = list(np.unique(np.geomspace(1, shared, 8).astype(int)) - 1)  # even on a log axis
            dots = {"marker": marker, "mec": "k", "mfc": face, "mew": 0.6, "markevery": spaced}
            below.plot(number, mean, "k", ls=dash, lw=0.8, label=hidden(f"{share}, {name}"), **dots)
            draw_band(below, number, mean - error, mean + error, f"{share}, {name}", color="k")
    below.set(ylim=(0, 1.3), yticks=(0, 0.5, 1))
    below.axhline(1.0, color=GREY, linewidth=0.5, zorder=0)
    bar = above.figure.colorbar(ScalarMappable(norm, sequential()), ax=above, pad=0.02, aspect=25)
    bar.set_label(r"$\langle\Delta u_\perp^2\rangle^{1/2}/\,\langle\Delta u_\parallel^2\rangle^{1/2}$")
    bar.ax.tick_params(which="both", length=2)
    handles = [entry(_pressure(p), "0.3", ls="none", marker=look["marker"]) for (p, _), look in pressures]
    if any(len(files) > 1 for (_, files), _ in pressures):
        handles.append(Patch(facecolor="0.2", alpha=0.25, label="68 % interval"))
    page.legend(above, handles, f"$p{stress_unit(results).over}$")
    nonaffine = entry(r"$\Sigma|u_{\rm na}|^2$", "k", lw=0.8)
    modulus = entry(r"$G_{\rm aff}-G_0$", "k", lw=0.8, ls=DASHED)
    below.legend(handles=[nonaffine, modulus], loc="upper left", ncol=2)
    return f"modes of {count_text(results, 'packing', 'packings')}"


def mode_fields(result, numbers):
    """[(title, field (n, D)), …] of modes numbered from 1. Raises InputError."""
    values = eigenvalues(result)
    fields = [(number, mode_vectors(result, number)) for number in np.ravel(numbers).tolist()]
    return [
        (rf"mode {number}, $\lambda/k={power_or_number(max(values[number - 1], 0.0))}$", field)
        for number, field in fields
    ]


def _counted_edges(results):
    """Edges (E,) of numbers of states, in units of √(k/m); None without such files. Raises InputError for several."""
    counted = [result for result in results if "states/edges" in result]
    edges = [result["states/edges"] / np.sqrt(units_of(result).k) for result in counted]
    for result, own in zip(counted, edges, strict=True):
        if len(own) != len(edges[0]) or not np.allclose(own, edges[0], rtol=SAME_EDGE, atol=0.0):
            raise InputError(
                f"{result.path}: other edges than {counted[0].path.name}. Draw files of equal {named('states')}."
            )
    return edges[0] if edges else None


def pooled_density(results):
    """(ω, D) in bins that hold a mode, at their middles: modes per unit frequency, divided by the degrees of freedom.

    Complete spectra and numbers of states together, in the bins of the latter, else logarithmic. Raises InputError for
    several edges and for no mode.
    """
    degrees = sum(recorded_dimension(result.attributes) * len(result["particles"]) for result in results)
    spectra = [frequencies(result) for result in results if "states/edges" not in result]
    edges = _counted_edges(results)
    edges = logarithmic_edges(np.concatenate(spectra)) if edges is None else edges
    counts = sum(np.histogram(spectrum, edges)[0] for spectrum in spectra)
    counts = counts + sum(result["states/counts"] for result in results if "states/counts" in result)
    filled = counts > 0
    if not filled.any():
        raise InputError(f"{results[0].path}: no mode between its edges. Count between others.")
    return np.sqrt(edges[1:] * edges[:-1])[filled], (counts / np.diff(edges) / degrees)[filled]


def excess_contacts(results) -> float:
    """Δz, contacts of each particle beyond 2D, mean over files; nan where one does not record its contacts."""
    return float(
        np.mean(
            [
                2.0 * result.attributes.get("contacts", np.nan) / len(result["particles"])
                - 2.0 * recorded_dimension(result.attributes)
                for result in results
            ]
        )
    )


@picture("states", "modes")
def plot_states(results, page):
    """Density of states D(ω) of complete spectra and of exact numbers of states, pooled over files of one pressure.

    Without pre-stress a plateau begins at ω* ∝ Δz ∝ p^½ (Silbert, Liu & Nagel 2005; Wyart 2005): a star marks
    ω = Δz √(k/m), which is of its order where contacts are harmonic. Debye's ω^(D − 1) goes through the lowest decade
    of the highest pressure. Raises InputError for other files, and for several dimensions, masses, or K with and
    without pre-stress.
    """
    require_alike(results, SPECTRUM_SETTINGS)
    for result in results:
        if "states/edges" not in result and not result.attributes.get("complete", False):
            raise InputError(
                f"{result.path}: {len(result['eigenvalues'])} modes, not all. Run modes with {named('states')} or "
                f"{named('all')}."
            )
    ax, marks = page.panels(x=FREQUENCY, y=r"$D(\omega_m)$", log="xy"), []
    for (level, files), look in looks(group_by_pressure(results).items()):
        omega, density = pooled_density(files)
        ax.plot(omega, density, markersize=2.8, label=_pressure(level), **look)
        plateau = excess_contacts(files)
        if omega[0] < plateau < omega[-1]:
            height = np.exp(np.interp(np.log(plateau), np.log(omega), np.log(density)))
            marks.append((plateau, height, look["color"], _pressure(level)))
    slowest, exponent = omega <= DEBYE_RANGE * omega[0], recorded_dimension(results[0].attributes) - 1
    draw_power_law(ax, omega[slowest], density[slowest], exponent)
    handles = [
        *ax.get_legend_handles_labels()[0],
        entry(f"${power_text(OMEGA, exponent)}$", GREY, ls=":", lw=0.8),
    ]
    for plateau, height, color, name in marks:
        ax.plot(
            plateau, height, "*", markersize=7, markeredgecolor="k", color=color, label=hidden(f"Δz, {name}")
        )
    if marks:
        handles.append(entry(rf"${OMEGA}=\Delta z$", "0.3", ls="none", marker="*"))
    page.legend(ax, handles, f"$p{stress_unit(results).over}$")
    return f"density of states of {count_text(results, 'packing', 'packings')}"


@picture("participation", "modes")
def plot_participation(results, page):
    """Participation ratio (Σ|φ_i|²)²/(n Σ|φ_i|⁴) of each mode against its frequency: 1 if all particles move alike, 1/n
    if one moves alone. Small points are modes, lines run through the medians of bins of frequency with enough modes of
    the files of one pressure. Raises InputError as `plot_states`.
    """
    require_alike(results, SPECTRUM_SETTINGS)
    ax = page.panels(x=FREQUENCY, y="participation ratio", log="xy")
    for (level, files), look in looks(group_by_pressure(results).items()):
        omega = np.concatenate([frequencies(result) for result in files])
        ratio = np.concatenate([result["participation_ratio"][has_energy(result)] for result in files])
        name = _pressure(level)
        dots = {"markersize": 1.5, "markeredgewidth": 0, "alpha": 0.35, "rasterized": len(omega) > MAX_POINTS}
        ax.plot(omega, ratio, ".", color=look["color"], label=hidden(f"{name}, single modes"), **dots)
        x, middle = binned_medians(omega, ratio)
        ax.plot(x, middle, markersize=2.8, label=name, **look)
    ax.set_ylim(top=1.0)
    page.legend(ax, title=f"$p{stress_unit(results).over}$", first="lower left")
    return f"participation ratios of the modes of {count_text(results, 'packing', 'packings')}"


def binned_medians(omega, values):
    """(middles, medians) of values (m,) in logarithmic bins of frequencies (m,) that hold at least MIN_BINNED."""
    number = np.floor(np.log10(omega) * BINS_PER_DECADE).astype(int)
    bins = [bin for bin in np.unique(number) if np.count_nonzero(number == bin) >= MIN_BINNED]
    middles = 10.0 ** ((np.array(bins) + 0.5) / BINS_PER_DECADE)
    return middles, np.array([np.median(values[number == bin]) for bin in bins])


@picture("lowest-modes", "modes")
def plot_lowest(results, page):
    """Means over the files of one pressure, with errors, against p/k:

    (a) floppiness, rms Δu⊥ over rms Δu∥, of the lowest 10, 50 and 200 modes together, with slope −½;
    (b) their shares of Σ|u_na|², Σ(Δu⊥)² and Σ(Δu∥)², affine parts left out;
    (c) medians of the whole response (filled, BT Fig. 5) and of the sum of the largest number of these modes (open).

    Raises InputError for files of several N, and for files that do not hold the numbers of modes that others do.
    """
    levels, *other_sizes = groups_of(results).values()
    if other_sizes:
        raise InputError(
            f"{results[0].path}: files of several N. Choose one N (of a study by {named('where')} n=…)."
        )
    for result in results:
        if "lowest/count" not in result or not len(result["lowest/count"]):
            raise InputError(
                f"{result.path}: dataset lowest/count: missing or empty. Run modes again for at least 10 modes."
            )
    counts = results[0]["lowest/count"]
    if any(list(result["lowest/count"]) != list(counts) for result in results):
        raise InputError(
            f"{results[0].path}: files have different numbers of modes. Run modes for equal numbers."
        )
    p = np.array(list(levels))

    def averages(value, log=True):
        """(mean, error) at each pressure of a number per file; of its logarithm, brought back, if `log`."""
        samples = [np.log(sample) if log else sample for sample in values_of(levels, value)]
        means, errors = np.transpose([mean_with_error(sample) for sample in samples])
        errors = np.nan_to_num(errors)
        return (np.exp(means), np.exp(means) * errors) if log else (means, errors)

    names = "floppiness of the lowest modes", "share of the lowest modes", "median per unit strain"
    axes = page.panels(1, 3, PAGE, 3.1, x=f"$p{stress_unit(results).over}$", y=names, log=("xy", "x", "xy"))
    axes[1].set_ylim(-0.03, 1.03)
    of_modes = [  # modes together -> how they are drawn
        (m, {"linestyle": dash, "marker": marker, "label": hidden(f"lowest {m}")})
        for m, dash, marker in zip(counts, ("-", DASHED, DOTTED), MARKERS, strict=False)
    ]
    shades = colours(len(QUANTITIES))
    for m, look in of_modes:
        draw_points(axes[0], p, *averages(lambda result, m=m: _floppiness(result, m)), color="0.2", **look)
    draw_power_law(axes[0], p, averages(lambda result: _floppiness(result, counts[0]))[0], -0.5)
    for (name, (symbol, slope)), shade in zip(QUANTITIES.items(), shades, strict=True):
        for m, look in of_modes:
            share = averages(lambda result, m=m, name=name: result[f"cumulative/{name}"][m - 1], log=False)
            draw_points(
                axes[1], p, *share, color=shade, **look | {"label": hidden(f"${symbol}$, lowest {m}")}
            )
        whole = averages(lambda result, name=name: result.attributes[f"{name}_median"])
        alone = averages(lambda result, name=name: result[f"lowest/{name}_median"][-1])
        look = {"color": shade, "marker": "o"}
        draw_points(axes[2], p, *whole, label=hidden(f"${symbol}$, whole"), **look)
        draw_points(axes[2], p, *alone, **look | OPEN, label=hidden(f"${symbol}$, lowest {counts[-1]}"))
        draw_power_law(axes[2], p, whole[0], slope)
    handles = [entry(**look | {"label": f"lowest {m}"}) for m, look in of_modes]
    drawn = zip(QUANTITIES.values(), shades, strict=True)
    handles += [entry(f"${symbol}$", shade) for (symbol, _), shade in drawn]
    handles += [entry("whole response", marker="o")]
    handles += [entry(f"sum of {counts[-1]} modes", marker="o", **OPEN)]
    handles += [entry("expected slope", GREY, ls=":", lw=0.8)]
    page.legend(axes[0], handles)
    return f"what the lowest modes carry of slow shear, of {count_text(results, 'packing', 'packings')}"


def _floppiness(result, modes):
    """rms Δu⊥ over rms Δu∥ of the lowest modes together, each of unit length."""
    return np.sqrt(result["transverse"][:modes].sum() / result["normal"][:modes].sum())
