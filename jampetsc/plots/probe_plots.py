"""Files of forces: moduli of waves against the wave number, sound, and how the compliances of particles differ."""

import numpy as np

from jampetsc.analysis.jammed_samples import density
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.analysis.susceptibility import resonance
from jampetsc.errors import InputError, named
from jampetsc.io.provenance import recorded_dimension
from jampetsc.laws.damping import OPTIONS, WEIGHTS
from jampetsc.laws.loads import TENSOR
from jampetsc.laws.masses import BY_NUMBER
from jampetsc.laws.probes import LONGITUDINAL, TRANSVERSE, PointForces, Waves
from jampetsc.plots.page import draw_points
from jampetsc.plots.picture import count_text, group_by, picture, stress_unit, units_of
from jampetsc.plots.quasistatic_plots import has_pressure, pressures_of, probe_of, require_alike
from jampetsc.plots.style import COLUMN, GREY, OPEN, PAGE, entry, hidden, looks, number, power_or_number

HEIGHT = 2.6  # inches
MIN_SAMPLES = 8  # particles of a distribution
MARKS = {TRANSVERSE: {}, LONGITUDINAL: {"linestyle": "--", **OPEN}}


def has_wave(result) -> bool:
    """Whether its load is a wave of forces, and its pressure positive."""
    return has_pressure(result) and isinstance(probe_of(result), Waves)


def is_massive_wave(result) -> bool:
    """Whether it is a sweep with masses, and its load waves of forces."""
    return "mass" in result.attributes and isinstance(probe_of(result), Waves)


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


@picture("sound", "sweep", suits=is_massive_wave)
def plot_sound(results, page):
    """ω(k) of sound and its attenuation Γ/ω, from the power that waves of forces lose, see `susceptibility.resonance`.

    A colour for each pressure and mass; transverse filled, longitudinal open. Dotted lines are ω = k√(G₀/ρ) with G′(k)
    at the lowest frequency and ρ = n m/V of equal masses. Waves whose maximum is not resolved are left out.

    Raises InputError where no wave is left, and for files without mass.
    """
    for result in results:
        if not is_massive_wave(result):
            raise InputError(
                f"{result.path}: no sound. Give sweeps with {named('mass')} of {named('load')} wave:…."
            )
    require_alike(results, ("dimension", "law", *OPTIONS, *WEIGHTS), ("load", "mass", "mass_by"))
    masses = [float(result.attributes["mass"]) for result in results]
    keys = list(zip(pressures_of(results, zero=True), masses, strict=True))
    groups = group_by(zip(keys, results, strict=True), lambda pair: pair[0])
    y = [r"$\omega(k)\,\tau_1$", r"$\Gamma/\omega(k)$"]
    axes = page.panels(1, 2, PAGE, HEIGHT, x="$kd$", y=y, log="xy")
    over, several = stress_unit(results).over, len(set(masses)) > 1
    handles, shown = [], set()
    for ((level, mass), own), look in looks(sorted(groups.items(), key=lambda item: item[0])):
        label = f"$p{over}={power_or_number(level)}$" + (f", $m={number(mass)}$" if several else "")
        handles.append(entry(label, **look))
        rows = [row for _, result in own for row in _sound_of(result)]
        for polarisation, mark in MARKS.items():
            points = sorted(row[1:] for row in rows if row[0] == polarisation and np.isfinite(row[2]))
            if points:
                k, omega, width, elastic = np.transpose(points)
                name = f"{label}, {polarisation}"
                for ax, values in zip(axes, (omega, width / omega), strict=True):
                    ax.plot(k, values, label=hidden(name), **look | mark)
                axes[0].plot(k, elastic, ":", color=GREY, lw=0.8, label=hidden(f"elastic, {name}"), zorder=1)
                shown.add(polarisation)
    if not shown:
        raise InputError(
            f"{results[0].path}: no wave whose maximum the frequencies resolve. Give more frequencies."
        )
    handles += [entry(word, marker="o", mew=0.7, **MARKS[word]) for word in MARKS if word in shown]
    page.legend(axes[0], [*handles, entry(r"$k\,(G_0/\rho)^{1/2}$", GREY, ls=":")])
    return f"sound of {count_text(results)}"


def _sound_of(result):
    """(polarisation, k, ωτ₁, Γτ₁, k√(G₀/ρ)τ₁) of each wave of a sweep with masses."""
    probe, tau1 = probe_of(result), units_of(result).tau1
    chi, G = (result[name].reshape(len(result.omega), -1) for name in ("susceptibility", "G"))
    vectors = result["waves/vectors"] if probe.has_columns else [result.attributes["wave_vector"]]
    for wave, vector, own, modulus in zip(probe.waves, vectors, chi.T, G.T, strict=True):
        omega, width = resonance(result.omega, own)
        k = float(np.linalg.norm(vector))
        density = (modulus * own)[0].real * k**2 * result.attributes["mass"]  # n/V is k² G χ
        if result.attributes["mass_by"] != BY_NUMBER:
            density = np.nan
        elastic = k * np.sqrt(max(modulus[0].real, 0.0) / density)
        yield wave.polarisation, k, omega * tau1, width * tau1, elastic * tau1


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
