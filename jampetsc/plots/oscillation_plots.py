"""Pictures of large oscillations: σ against γ over a cycle, and the harmonics that a sine does not have."""

import numpy as np

from jampetsc.errors import InputError
from jampetsc.plots.page import draw_points
from jampetsc.plots.picture import count_text, group_by, picture, stress_unit, units_of
from jampetsc.plots.style import DASHED, OPEN, PAGE, colours, entry, hidden, looks, number

MAX_NAMED = 7  # curves that a legend names one by one; of more the first and the last
PANEL_HEIGHT = 2.7  # inches


def _has_waveforms(result) -> bool:
    return "strain_waveform" in result


@picture("lissajous", "oscillate", suits=_has_waveforms)
def plot_lissajous(results, page):
    """σ against γ over a cycle, (a) as they are and (b) over their amplitudes: a curve for each oscillation.

    Dashed, where the strain is imposed, the elastic stress (σ(γ, γ̇) + σ(γ, −γ̇))/2 (Cho et al., J. Rheol. 49, 747
    (2005)). The area within a curve of (a) is the work of a cycle per volume. Raises InputError without waveforms.
    """
    cycles = [cycle for result in results for cycle in _cycles(result)]
    unit = stress_unit(results)
    axes = page.panels(
        1, 2, PAGE, PANEL_HEIGHT,
        x=[r"$\gamma$", r"$\gamma/\gamma_1$"], y=[rf"$\sigma{unit.over}$", r"$\sigma/\sigma_1$"],
    )  # fmt: skip
    shown, has_elastic = {0, len(cycles) - 1} if len(cycles) > MAX_NAMED else set(range(len(cycles))), False
    for n, ((words, strain, stress, is_imposed), colour) in enumerate(
        zip(cycles, colours(len(cycles)), strict=True)
    ):
        for ax, (x, y) in zip(
            axes, ((strain, stress), (strain / _first(strain), stress / _first(stress))), strict=True
        ):
            label = words if n in shown else hidden(words)
            ax.plot(np.append(x, x[0]), np.append(y, y[0]), color=colour, lw=0.9, label=label)
            if is_imposed and ax is axes[1]:
                order, has_elastic = np.argsort(x), True
                elastic = 0.5 * (y + np.roll(y[::-1], 1 + len(y) // 2))
                ax.plot(
                    x[order],
                    elastic[order],
                    color=colour,
                    lw=0.7,
                    ls=DASHED,
                    label=hidden(f"{words}, elastic"),
                )
    page.legend(axes[0])
    if has_elastic:
        page.legend(axes[1], [entry("elastic part", ls=DASHED)], groups=0)
    return f"stress against strain over a cycle of {count_text(cycles, 'oscillation', 'oscillations')}"


def _cycles(result):
    """[(words, strain (T,), stress over k (T,), whether the strain is imposed)] of the oscillations of a file."""
    if not _has_waveforms(result):
        raise InputError(f"{result.path}: no waveforms. Run oscillate again.")
    units, control = units_of(result), result.attributes["control"]
    cycles = []
    for a, amplitude in enumerate(result["amplitude"]):
        symbol, size = (
            (r"\gamma_0", amplitude) if control == "strain" else (r"\sigma_0/k", amplitude / units.k)
        )
        for m, omega in enumerate(result["omega"] * units.tau1):
            strain, stress = result["strain_waveform"][a, m], result["stress_waveform"][a, m] / units.k
            words = f"${symbol}={number(size)}$"
            if len(result["omega"]) > 1:
                words += rf", $\omega\tau_1={number(omega)}$"
            if np.isfinite(stress).all():
                cycles.append((words, strain, stress, control == "strain"))
    return cycles


def _first(wave) -> float:
    """Amplitude of the first harmonic of a wave (T,)."""
    return 2.0 * abs(np.fft.rfft(wave)[1]) / len(wave)


@picture("harmonics", "oscillate")
def plot_harmonics(results, page):
    """Third (filled) and fifth (open) harmonic over the first against the amplitude, with errors where they are known.

    They are of the stress where the strain is imposed, and of the strain where the stress is.
    """
    controls = group_by(results, lambda result: result.attributes["control"])
    if len(controls) > 1:
        raise InputError(
            f"{results[0].path}: stress imposed in some files, strain in others. Draw files of one kind."
        )
    (control,) = controls
    symbol = r"\gamma_0" if control == "strain" else rf"\sigma_0{stress_unit(results).over}"
    ax = page.panels(x=f"${symbol}$", y=r"$|G_3/G_1|,\ |G_5/G_1|$", log="xy")
    curves = []
    for result in results:
        units = units_of(result)
        amplitude = result["amplitude"] / (1.0 if control == "strain" else units.k)
        errors = result["harmonics_error"] if "harmonics_error" in result else None
        for m, omega in enumerate(result["omega"] * units.tau1):
            words = rf"$\omega\tau_1={number(omega)}$" + (f", {result.path.stem}" if len(results) > 1 else "")
            curves.append(
                (words, amplitude, abs(result["harmonics"][:, m]), None if errors is None else errors[:, m])
            )
    for (words, amplitude, sizes, errors), look in looks(curves):
        for order in range(sizes.shape[1]):
            label = words if order == 0 else hidden(f"{words}, fifth")
            style = look | (OPEN | {"markerfacecolor": "white"} if order else {})
            error = None if errors is None else errors[:, order]
            draw_points(ax, amplitude, sizes[:, order], error, label=label, **style)
    both = [
        entry("third", marker="o"), entry("fifth", marker="o", mew=0.7, **OPEN)
    ]  # fmt: skip
    page.legend(ax, [*ax.get_legend_handles_labels()[0], *both], groups=len(curves))
    return f"harmonics of {count_text(curves, 'frequency', 'frequencies')}"
