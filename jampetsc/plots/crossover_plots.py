"""Where slow response ends: the crossover frequency ω* = G₀/η₀ against pressure, with its exponent (BT eq. 16)."""

import numpy as np

from jampetsc.analysis.power_laws import fit_power_law, low_frequency_limit
from jampetsc.analysis.statistics import median_interval
from jampetsc.errors import InputError
from jampetsc.io.reader import SweepResult
from jampetsc.plots.curves import curve_of
from jampetsc.plots.page import draw_points, draw_power_law
from jampetsc.plots.picture import count_text, picture, stress_unit, units_of
from jampetsc.plots.quasistatic_plots import (
    PRESTRESS,
    groups_of,
    handles_of,
    has_pressure,
    prestress_samples,
    value_of,
)
from jampetsc.plots.style import GREY, entry, hidden, looks

EXPONENT = 1.0  # of p, that BT expect
MIN_PRESSURES = 3  # of an exponent with its error
MIN_SAMPLES = 3  # of an interval for a median


def crossover_of(result, prefix="") -> float:
    """ω*τ₁ of a quasistatic file or a sweep with pre-stress (""), or without it (as `value_of`); nan of the other one.

    Raises InputError for a sweep that does not reach the quasistatic limit.
    """
    if not isinstance(result, SweepResult):
        return value_of(result, "omega_star", prefix) * units_of(result).tau1
    if bool(result.attributes.get("prestress", True)) == bool(prefix):
        return np.nan
    curve = curve_of(result)
    try:
        return low_frequency_limit(curve.omega, curve.G).crossover
    except InputError as error:
        raise InputError(f"{result.path}: {error}") from None


@picture("omega-star", "quasistatic", "sweep", suits=has_pressure)
def plot_crossover(results, page):
    """ω*τ₁ = G₀τ₁/η₀ against p/k: medians over the files of one pressure and N, with 68 % intervals where there are
    three files, and the power law through the medians of three pressures, all weighted alike. Its error is from the
    scatter about it. The dotted line has slope 1.

    Filled: without pre-stress; open: with. Raises InputError for several dimensions, loads or laws, and where no median
    is positive.
    """
    groups = groups_of(results)
    unit = stress_unit(results)
    ax = page.panels(x=f"$p{unit.over}$", y=r"$\omega^*\tau_1$", log="xy")
    styles, fits, guide, drawn, negative = dict(looks(groups)), [], None, set(), 0
    for size, levels in groups.items():
        p = np.array(list(levels))
        for samples, words, face, _ in prestress_samples(levels, crossover_of):
            look, name = styles[size] | face, f"$N={size}$, {words}"
            samples = [sample[np.isfinite(sample)] for sample in samples]
            negative += sum(np.count_nonzero(sample < 0) for sample in samples)
            medians = np.array([np.median(sample) if len(sample) else np.nan for sample in samples])
            shown = medians > 0
            if not shown.any():
                continue
            guide, drawn = guide or (p[shown], medians[shown]), drawn | {words}
            is_fitted = shown.sum() >= MIN_PRESSURES
            points = look | ({"linestyle": "none"} if is_fitted else {})
            draw_points(ax, p, medians, _half_widths(samples, medians), label=hidden(name), **points)
            if is_fitted:
                fit = fit_power_law(p[shown], medians[shown])
                line = {key: value for key, value in look.items() if key not in ("marker", "markerfacecolor")}
                ends = np.array([p[shown].min(), p[shown].max()])
                power = fit.prefactor * ends**fit.exponent
                ax.plot(ends, power, lw=0.8, label=hidden(f"power law, {name}"), **line)
                fits.append((fit, size, words, line))
    if guide is None:
        raise InputError(f"{results[0].path}: omega* is not positive at any pressure. Give other files.")
    absent = {words for _, words, _ in PRESTRESS} - drawn
    handles = [handle for handle in handles_of(styles) if handle.get_label() not in absent]
    handles += [
        entry(rf"$p^{{{fit.exponent:.3f}\pm{fit.exponent_error:.3f}}}$", **line | {"lw": 0.8})
        for fit, _, _, line in fits
    ]
    if len(guide[0]) > 1:
        draw_power_law(ax, *guide, EXPONENT)
        handles.append(entry("slope 1", GREY, linestyle=":", lw=0.8))
    page.legend(ax, handles)
    exponents = "; ".join(
        f"p^{fit.exponent:.3f} ± {fit.exponent_error:.3f} (N = {size}, {words})"
        for fit, size, words, _ in fits
    )
    note = f"; omega* < 0 in {negative} of them, which count like the others" if negative else ""
    of = count_text(
        results, *(("sweep", "sweeps") if isinstance(results[0], SweepResult) else ("file", "files"))
    )
    return f"omega* = G0/eta0 against p of {of}{': ' if exponents else ''}{exponents}{note}"


def _half_widths(samples, medians):
    """How far the 68 % interval of each median reaches below and above it, (2, M); nan for fewer than three values."""
    intervals = [
        median_interval(sample) if len(sample) >= MIN_SAMPLES else (np.nan, np.nan) for sample in samples
    ]
    low, high = np.transpose(intervals)
    return np.array([medians - low, high - medians])
