"""The start of flows: σ(γ) averaged over seeds, with the peak of its overshoot."""

from typing import NamedTuple

import numpy as np

from jampetsc.analysis.overshoot import MIN_WINDOW_ROWS, StressPeak, find_peak
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import InputError, named
from jampetsc.plots.flow_kinds import kind_of, labels_of
from jampetsc.plots.page import draw_band
from jampetsc.plots.picture import count_text, flow_units, group_by, picture
from jampetsc.plots.style import COLUMN, DASHED, GREY, entry, hidden, looks, number

HEIGHT = 3.0  # inches


class MeanStart(NamedTuple):
    """σ(γ) of flows of one kind and rate until the steady part; stresses in k."""

    strain: np.ndarray  # (T,) middles of rows, with 0 where the state there is kept
    stress: np.ndarray  # (T,) mean over seeds
    error: np.ndarray  # (T,) nan for one seed
    steady: float
    peak: StressPeak


def mean_starts(results) -> dict:
    """{(kind, rate): MeanStart} of flows; raises InputError for rows of other lengths, and for too few of them."""
    units = flow_units(results)
    groups = group_by(results, lambda result: (kind_of(result), float(result.attributes["rate"])))
    return {key: _mean_start(runs, units.k) for key, runs in groups.items()}


def _mean_start(runs, k) -> MeanStart:
    rows = [float(run["strain"][0]) for run in runs]
    for run, row in zip(runs, rows, strict=True):
        if not (row > 0.0 and np.isfinite(run["shear_stress"]).all()):
            raise InputError(f"{run.path}: strain or stress out of range. Make the file again.")
        if not np.isclose(row, rows[0], rtol=1e-9):
            raise InputError(
                f"{run.path}: rows of {row:g} in strain, {runs[0].path.name} has {rows[0]:g}. For a mean give flows "
                f"with one {named('series')}."
            )
    # the middle of a row, over which the stress is averaged
    middles = rows[0] * (np.arange(min(len(run["strain"]) for run in runs)) + 0.5)
    discard = min(float(run.attributes["discard"]) for run in runs)
    shown = middles <= (discard if discard > 0.0 else middles[-1])
    if shown.sum() < MIN_WINDOW_ROWS:
        raise InputError(
            f"{runs[0].path}: {shown.sum()} rows before {named('discard')}: too few for a start (at least "
            f"{MIN_WINDOW_ROWS}). Run the flow with {named('series')}."
        )
    strain = middles[shown]
    stress = np.array([run["shear_stress"][: len(strain)].sum(axis=1) for run in runs]) / k
    steady = np.array([float(run.attributes["shear_stress_mean"]) for run in runs]) / k
    peak = find_peak(strain, stress, steady)
    if all("start/shear_stress" in run for run in runs):
        at_rest = np.array([run["start/shear_stress"].sum() for run in runs]) / k
        strain, stress = np.r_[0.0, strain], np.column_stack((at_rest, stress))
    return MeanStart(strain, *mean_with_error(stress), float(steady.mean()), peak)


@picture("start-up", "flow")
def plot_start(results, page):
    """σ against γ until the steady part, averaged over seeds, a line for each kind and rate, with its peak.

    Bands and bars: errors of the mean, of the height and of the strain of the peak; dashed: the steady stress. Raises
    InputError as `mean_starts`.
    """
    starts, units = mean_starts(results), flow_units(results)
    words = labels_of([kind for kind, _ in starts])
    rates = {rate for _, rate in starts}
    ax = page.panels(1, 1, COLUMN, HEIGHT, x=r"$\gamma$", y=units.label(r"\sigma", "stress"))
    texts = []
    for ((key, start), name), look in looks(zip(starts.items(), words, strict=True)):
        rate_words = rf"$\dot\gamma={number(key[1] * units.tau1)}$"
        several = len({kind for kind, _ in starts}) > 1
        label = ", ".join([name] * (several or len(rates) == 1) + [rate_words] * (len(rates) > 1))
        _draw_start(ax, start, look, label)
        texts.append(_peak_text(start))
    ax.set(xmargin=0.01)
    handles = ax.get_legend_handles_labels()[0]
    page.legend(ax, [*handles, entry("steady", GREY, lw=0.9, ls=DASHED)], groups=len(handles))
    return f"start of {count_text(results, 'run', 'runs')}: {'; '.join(texts)}"


def _draw_start(ax, start, look, label):
    """Mean, band, steady stress and peak of a start."""
    colour, peak = look["color"], start.peak
    ax.plot(start.strain, start.stress, color=colour, lw=0.9)
    ax.get_lines()[-1].set_label(hidden(f"{label}, mean"))
    if np.isfinite(start.error).any():
        draw_band(
            ax,
            start.strain,
            start.stress - start.error,
            start.stress + start.error,
            f"{label}, error",
            color=colour,
        )
    ends = [start.strain[0], start.strain[-1]]
    ax.plot(ends, [start.steady] * 2, color=colour, lw=0.9, ls=DASHED, label=hidden(f"{label}, steady"))
    bars = {}
    if np.isfinite(peak.stress_error):
        bars = {
            "xerr": np.full(1, peak.strain_error),
            "yerr": np.full(1, peak.stress_error),
            "elinewidth": 0.8,
        }
    place = np.array([[peak.strain], [peak.stress]])
    ax.errorbar(*place, ms=4.5, ls="none", label=label, **bars, **look)


def _peak_text(start) -> str:
    """The peak in words."""
    peak, steady = start.peak, start.steady
    if not np.isfinite(peak.stress_error):
        return f"peak {peak.stress:.4g} at strain {peak.strain:.3g}, without errors (one seed)"
    text = f"peak {peak.stress:.4g} ± {peak.stress_error:.2g} at strain {peak.strain:.3g} ± {peak.strain_error:.2g}"
    if not peak.is_resolved:
        return f"{text}, no overshoot beyond noise"
    return f"{text}, overshoot {peak.overshoot / steady:.1%} ± {peak.overshoot_error / steady:.1%}"
