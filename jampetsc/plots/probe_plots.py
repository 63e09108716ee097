"""Quasistatic files of forces: moduli of waves against the wave number, and how the compliances of particles differ."""

import numpy as np

from jampetsc.analysis.jammed_samples import density
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import InputError, named
from jampetsc.io.provenance import recorded_dimension
from jampetsc.laws.damping import OPTIONS, WEIGHTS
from jampetsc.laws.loads import TENSOR
from jampetsc.laws.probes import LONGITUDINAL, TRANSVERSE, PointForces, Waves
from jampetsc.plots.page import draw_points
from jampetsc.plots.picture import count_text, group_by, picture, stress_unit, units_of
from jampetsc.plots.quasistatic_plots import has_pressure, pressures_of, probe_of, require_alike
from jampetsc.plots.style import COLUMN, GREY, OPEN, entry, hidden, looks, power_or_number

HEIGHT = 2.6  # inches
MIN_SAMPLES = 8  # particles of a distribution
MARKS = {TRANSVERSE: {}, LONGITUDINAL: {"linestyle": "--", **OPEN}}


def has_wave(result) -> bool:
    """Whether its load is a wave of forces, and its pressure positive."""
    return has_pressure(result) and isinstance(probe_of(result), Waves)


def has_points(result) -> bool:
    """Whether its load is forces on single particles."""
    return isinstance(probe_of(result), PointForces)


@picture("waves", "quasistatic", suits=has_wave)
def plot_waves(results, page):
    """G₀(k) of waves against k, a colour for each pressure; transverse filled, longitudinal open.

    Means over the files whose n have the same numbers, with errors where there are several. Where files of the load
    tensor are among them for each pressure, over the modulus of an isotropic solid for k → 0: G − p/2 of simple shear,
    longitudinal K + 2(D − 1)G/D − p(D − 1)/D; p only with pre-stress. Files of other loads are left out.
    """
    results = _chosen(results, lambda result: has_wave(result) or _is_tensor(result), "wave:…")
    levels = group_by(zip(pressures_of(results), results, strict=True), lambda pair: pair[0])
    levels = {level: [result for _, result in pairs] for level, pairs in sorted(levels.items())}
    waves = {level: own for level, files in levels.items() if (own := _by_wave(files))}
    limits = {level: _limits(levels[level]) for level in waves}
    relative, over = all(limits.values()), stress_unit(results).over
    y = "$G_0(k)/G_0(0)$" if relative else f"$G_0(k){over}$"
    ax = page.panels(1, 1, COLUMN, HEIGHT, x="$kd$", y=y, log="x")
    handles, shown = [], set()
    for (level, own), look in looks(waves.items()):
        handles.append(entry(f"$p{over}={power_or_number(level)}$", **look))
        for polarisation, mark in MARKS.items():
            unit = limits[level][polarisation] if relative else 1.0
            points = [
                (np.mean(k), *mean_with_error(np.divide(G, unit)))
                for (kind, _), (k, G) in own.items()
                if kind == polarisation
            ]
            if points:
                label = hidden(f"$p{over}={power_or_number(level)}$, {polarisation}")
                draw_points(ax, *np.transpose(sorted(points)), label=label, **look | mark)
                shown.add(polarisation)
    if relative:
        ax.axhline(1.0, color=GREY, lw=0.5, ls=":")
    ax.set_ylim(0.0, None)
    handles += [
        entry(polarisation, marker="o", mew=0.7, **mark)
        for polarisation, mark in MARKS.items()
        if polarisation in shown
    ]
    page.legend(ax, handles)
    compared = " over the moduli of strains" if relative else ""
    count = count_text(list(filter(has_wave, results)), "file", "files")
    return f"G0(k) of waves{compared}, {count}"


@picture("compliances", "quasistatic", suits=has_points)
def plot_compliances(results, page):
    """Distribution of the compliances J_i = χ₀ of single particles, over ln J, a line for each pressure and N.

    Bars are errors of counting. Files of other loads are left out. Raises InputError where no pressure has MIN_SAMPLES
    particles.
    """
    results = _chosen(results, has_points, "points:…")
    pairs = zip(pressures_of(results, zero=True), results, strict=True)
    groups = group_by(pairs, lambda pair: (pair[0], int(pair[1].attributes.get("particle_count", 0))))
    over = stress_unit(results).over
    ax = page.panels(1, 1, COLUMN, HEIGHT, x="$J_ik$", y=r"$P(\ln J_i)$", log="xy")
    several, drawn = len({size for _, size in groups}) > 1, 0
    for ((level, size), own), look in looks(sorted(groups.items())):
        J = np.concatenate([result["susceptibility"] * units_of(result).k for _, result in own])
        if len(J) < MIN_SAMPLES:
            continue
        drawn += len(J)
        edges, height, error = density(np.log(J))
        label = f"$p{over}={power_or_number(level)}$" + (f", $N={size}$" if several else "")
        draw_points(ax, np.exp(0.5 * (edges[1:] + edges[:-1])), height, error, label=label, **look)
    if not drawn:
        raise InputError(
            f"{results[0].path}: fewer than {MIN_SAMPLES} particles at every pressure. Push more by {named('load')} "
            "points:…."
        )
    page.legend(ax)
    return f"compliances of {drawn} particles in {count_text(results, 'file', 'files')}"


def _is_tensor(result):
    return result.attributes.get("load") == TENSOR


def _chosen(results, suits, load) -> list:
    """The files that suit. Raises InputError where none has forces, or where they differ in more than p, N and load."""
    chosen = [result for result in results if suits(result)]
    if not any(map(probe_of, chosen)):
        raise InputError(f"{results[0].path}: no such forces. Give files of {named('load')} {load}.")
    require_alike(chosen, ("dimension", "law", *OPTIONS, *WEIGHTS), ("load",))
    return chosen


def _by_wave(files) -> dict:
    """{(polarisation, sizes of n): (k, G₀/k of each)} of the waves among files of one pressure."""
    waves = {}
    for result in files:
        probe = probe_of(result)
        if not isinstance(probe, Waves):
            continue
        if probe.has_columns:
            vectors, moduli = result["waves/vectors"], result["waves/G0"]
        else:
            vectors, moduli = ([result.attributes[name]] for name in ("wave_vector", "G0"))
        for wave, vector, modulus in zip(probe.waves, vectors, moduli, strict=True):
            kind = wave.polarisation, tuple(sorted(map(abs, wave.numbers)))
            k, G = waves.setdefault(kind, ([], []))
            k.append(float(np.linalg.norm(vector)))
            G.append(modulus / units_of(result).k)
    return waves


def _limits(files) -> dict:
    """{polarisation: modulus for k → 0 over k}, means over files of the tensor; empty without any."""
    moduli = []
    for result in files:
        if _is_tensor(result):
            D, k = recorded_dimension(result.attributes), units_of(result).k
            shear, bulk = (result.attributes[name] / k for name in ("shear_modulus", "bulk_modulus"))
            p = units_of(result).pressure * bool(result.attributes.get("prestress", True))
            moduli.append((shear - 0.5 * p, bulk + (D - 1) / D * (2.0 * shear - p)))
    return dict(zip((TRANSVERSE, LONGITUDINAL), np.mean(moduli, axis=0), strict=True)) if moduli else {}
