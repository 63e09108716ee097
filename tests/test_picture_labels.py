"""Every axis of every picture says what it shows, in which unit and on which scale; panels have their letters."""

import numpy as np
import pytest
from drawn import figure_of, require_inside
from matplotlib import rc_context
from matplotlib.text import Text
from samples import published
from test_correlations import correlation_file
from test_floppy_plots import modes_of, quasistatic_of, write_lowest
from test_flow_plots import facts, series
from test_jam_plots import slow_shear, write_jam
from test_picture_limits import curve, run
from test_spectrum import write_sweep

from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.plots import (
    correlation,
    fields,
    floppy,
    flowcurves,
    jamming,
    lowmodes,
    moduli,
    packing,
    shearing,
    slowly,
    trade,
    vibrations,
)
from jampetsc.plots.spectrum import plot_relaxation, spectrum_curve
from jampetsc.plots.style import COLUMN, LOSS, PAGE, STORAGE, STYLE
from jampetsc.storage.reader import load

RATE = r"$\dot\gamma\ [1/\tau_1]$"
FREQUENCY = r"$\omega_m\ [\sqrt{k/m}]$"


def lengths(folder):
    return [correlation.correlation_curve(correlation_file(folder / "c.h5"))]


def spectra(folder):
    return [spectrum_curve(load(write_sweep(folder / "s.h5")))]


def cooled(folder):
    return [write_jam(folder / "j.h5", protocol="compress", cooling_rate=0.1)]


def modes(folder):
    return [modes_of(np.arange(1.0, 9.0), np.arange(1.0, 9.0))]


PICTURES = [  # (function, what it draws, (x, y, scales) of the panels: linear or log)
    (correlation.plot_correlation, lambda folder: lengths(folder)[0],
     [(r"$\delta/L$", rf"$C(\delta)$ of {part} $u_y/\gamma$", "--") for part in ("Re", "Im")]),
    (correlation.plot_lengths, lengths,
     [(r"$\omega\tau_1$", "$l/L$", "ll"),
      (r"$\omega\tau_1\,/\,(p/k)^{1/2}$", r"$(l/d)\,[-\ln(p/k)]^{0.65}$", "ll")]),
    (moduli.plot_moduli, lambda folder: [curve()], [(r"$\omega\tau_1$", f"{STORAGE}$/k$,  {LOSS}$/k$", "ll")]),
    (moduli.plot_collapse, lambda folder: [curve()],
     [(r"$\omega\tau_1\,/\,(p/k)$", rf"{STORAGE}, {LOSS}  $[\,k\,(p/k)^{{1/2}}\,]$", "ll")]),
    (floppy.plot_medians, lambda folder: [quasistatic_of([1, 1, 1], pressure=p) for p in (1e-3, 1e-2)],
     [("$p/k$", "median per unit strain", "ll")]),
    (lowmodes.plot_lowest, lambda folder: [write_lowest(folder / f"{p}.h5", p) for p in (1e-3, 1e-2)],
     [("$p/k$", "floppiness of the lowest modes", "ll"), ("$p/k$", "share of the lowest modes", "l-"),
      ("$p/k$", "median per unit strain", "ll")]),
    (floppy.plot_viscosities, lambda folder: [quasistatic_of([1, 1, 1])],
     [(r"$\beta$", r"$\eta_0,\ \eta_\infty\ [k\tau_1]$", "ll")]),
    (flowcurves.plot_flow_curves, lambda folder: [facts(rate=rate) for rate in (0.1, 0.2)],
     [(RATE, r"$\sigma\ [k]$", "ll"), (RATE, r"$p\ [k]$", "ll"), (RATE, r"$\sigma/p$", "ll"),
      (RATE, r"$\sigma/\dot\gamma,\ p/\dot\gamma\ [k\tau_1]$", "ll"),
      (RATE, r"$d\ln\sigma/d\ln\dot\gamma,\ d\ln p/d\ln\dot\gamma$", "l-"), (RATE, "$Z$", "l-")]),
    (flowcurves.plot_against_phi, lambda folder: [facts(phi=phi) for phi in (0.8, 0.82)],
     [(r"$\phi$", r"$\sigma\ [k]$", "-l"), (r"$\phi$", r"$p\ [k]$", "-l"), (r"$\phi$", "$Z$", "--")]),
    (shearing.plot_series, lambda folder: [series("a.h5")],
     [(r"$\gamma$", r"$\sigma\ [k]$", "--"), (r"$\gamma$", r"$p\ [k]$", "--")]),
    (slowly.plot_slow_shear, lambda folder: [slow_shear(np.ones(5))],
     [("", r"$U/N\ [k]$", "-l"), ("", r"$\sigma\ [k]$", "--"), (r"$\gamma$", r"$p\ [k]$", "--"),
      (r"$\gamma$", "$Z$", "--")]),
    (jamming.plot_fraction, cooled, [(r"$\phi$", r"$f(\phi)$", "--")]),
    (jamming.plot_pressures, cooled, [(r"$p\ [k_{\rm e}/d_{\rm s}^2]$", "$P(p)$", "--")]),
    (jamming.plot_jamming_densities, cooled, [(r"$\phi_J$", r"$P(\phi_J)$", "--")]),
    (vibrations.plot_modes, modes,
     [("", FREQUENCY, "ll"), ("mode number", "cumulative share", "l-"),
      ("", r"$\langle\Delta u_\perp^2\rangle^{1/2}/\,\langle\Delta u_\parallel^2\rangle^{1/2}$", "-l")]),
    (vibrations.plot_states, modes, [(FREQUENCY, r"$D(\omega_m)$", "ll")]),
    (plot_relaxation, spectra,
     [(r"$\tau/\tau_1$", "$H/k$", "ll"), (r"$\tau/\tau_1$", r"$\sum_{\tau_m\leq\tau}\,g_m/k$", "l-"),
      (r"$t/\tau_1$", "$G(t)/k$", "ll"), (r"$t/\tau_1$", r"$J(t)\,k$", "ll")]),
]  # fmt: skip
TITLES = {correlation.plot_correlation: r"$\omega\tau_1$", flowcurves.plot_against_phi: RATE}
TITLES |= dict.fromkeys((correlation.plot_lengths, moduli.plot_moduli, moduli.plot_collapse), "$p/k$")
TITLES |= dict.fromkeys((floppy.plot_viscosities, vibrations.plot_modes, vibrations.plot_states), "$p/k$")
TITLES |= {jamming.plot_jamming_densities: "dotted: means"}


@pytest.mark.parametrize(("plot", "made", "panels"), PICTURES, ids=lambda part: getattr(part, "__name__", ""))
def test_axes_are_named(tmp_path, plot, made, panels):
    fig = figure_of(plot, made(tmp_path))
    require_inside(fig)
    words = {"linear": "-", "log": "l"}
    found = [
        (ax.get_xlabel(), ax.get_ylabel(), words[ax.get_xscale()] + words[ax.get_yscale()]) for ax in fig.axes
    ]
    assert found == panels
    several = len(panels) > 1
    rows = len({round(ax.get_position(original=True).y0, 3) for ax in fig.axes[: len(panels)]})
    width, height = fig.get_size_inches()
    assert width == (COLUMN if rows == len(panels) or plot is vibrations.plot_modes else PAGE)
    assert (COLUMN, PAGE) == (3.4, 7.0)  # inches of one and of two columns of a journal
    assert 1.9 < height / min(rows, 2) < 4.0
    letters = [
        ax.get_title(loc="left") for ax in fig.axes if plot is not vibrations.plot_modes or ax in fig.axes[:2]
    ]
    assert letters == [f"({letter})" for letter in "abcdef"[: len(letters)]] if several else letters == [""]
    legends = [ax.get_legend() for ax in fig.axes if ax.get_legend()]
    assert len(legends) == {shearing.plot_series: 0, vibrations.plot_modes: 2, plot_relaxation: 2}.get(
        plot, 1
    )
    if legends:
        assert legends[0].get_title().get_text() == TITLES.get(plot, "")


def test_a_trade_names_its_axes():
    fig = figure_of(trade.plot_trade, [run("direct", 1e-3, 1.0, "method")], 1e-9)
    (ax,) = fig.axes
    require_inside(fig)
    assert fig.get_figwidth() == PAGE and 3 < fig.get_figheight() < 6
    assert (ax.get_xlabel(), ax.get_xscale(), ax.get_yscale()) == ("time of the run [s]", "log", "log")
    assert ax.get_ylabel() == f"largest relative error of {STORAGE}, {LOSS}"
    assert [text.get_text() for text in ax.texts] == ["direct"]


def test_slow_shear_has_its_means_and_labels_below():
    """Panels share the strain, which stands below; nothing beyond it is shown."""
    one = slow_shear(np.ones(5))
    fig = figure_of(slowly.plot_slow_shear, [one])
    for ax in fig.axes:
        assert ax.get_xlim() == pytest.approx((0.1, 0.5))


def test_series_begin_at_zero_stress():
    for ax in figure_of(shearing.plot_series, [series("a.h5")]).axes:
        assert ax.get_ylim()[0] == 0.0 and ax.get_xlim() == pytest.approx((0.1, 0.3))


def test_shares_are_seen_from_none_to_all(tmp_path):
    (ax,) = figure_of(jamming.plot_fraction, cooled(tmp_path)).axes
    assert ax.get_ylim() == pytest.approx((-0.04, 1.04))
    half = [line for line in ax.get_lines() if line.get_linestyle() == ":"]
    assert [line.get_ydata()[0] for line in half] == [0.5]
    for plot in (jamming.plot_pressures, jamming.plot_jamming_densities):
        assert figure_of(plot, cooled(tmp_path)).axes[0].get_ylim()[0] == 0.0
    below = figure_of(vibrations.plot_modes, modes(tmp_path)).axes[1]
    assert below.get_ylim() == (0.0, 1.3) and below.get_yticks().tolist() == [0, 0.5, 1]


def test_words_are_as_large_as_print_needs_them():
    """Notes 7.5 points, names of axes 10; nothing is smaller than 6 or larger than 10."""
    disks, panels = published(), [("title", np.ones((16, 2)))]
    spin = np.ones((2, 16)) + 0j
    figures = [
        figure_of(fields.plot_panels, disks, panels, np.arange(16), symbol="u"),
        figure_of(fields.plot_fields, disks, np.ones(2), np.ones((2, 16, 2)) + 0j, spin, np.arange(16)),
        figure_of(packing.plot_packing, disks),
    ]
    for fig in figures:
        with rc_context(STYLE):
            texts = fig.findobj(Text)
        sizes = {text.get_fontsize() for text in texts if text.get_text()}
        assert 6 <= min(sizes) and max(sizes) <= 10


def test_names_of_a_trade_stand_beside_their_points():
    """To the right of all there is room for them: they stay in the axes, off each other and off the points."""
    rows = [run(f"--accuracy 1e-{n}", 10.0**-n, 2.0**n) for n in range(2, 8)] + [
        run("direct, MUMPS", 1e-9, 200.0, "method")
    ]
    ax = figure_of(trade.plot_trade, rows, 1e-12).axes[0]
    boxes = [text.get_window_extent() for text in ax.texts]
    assert len(boxes) == 7
    for n, box in enumerate(boxes):
        assert ax.bbox.x0 <= box.x0 and box.x1 <= ax.bbox.x1 and ax.bbox.y0 <= box.y0 and box.y1 <= ax.bbox.y1
        assert not any(box.overlaps(other) for other in boxes[:n])
    left, right = np.log10(ax.get_xlim())
    assert left < np.log10(4.0) and right > np.log10(200.0) + 0.1 * (np.log10(200.0) - np.log10(4.0))


def test_one_spectrum_without_a_pressure_needs_no_legend(tmp_path):
    one = spectrum_curve(load(write_sweep(tmp_path / "s.h5", pressure=None)))
    assert figure_of(plot_relaxation, [one]).axes[1].get_legend() is None


def test_flanks_of_the_window_are_not_drawn(tmp_path):
    """H below 10⁻⁴ of its largest value is of the window, not of the spectrum."""
    held = RelaxationSpectrum(0.02, 0.4, np.array([1e-4, 1.0]), np.array([1.0, 1e-5]))
    one = spectrum_curve(load(write_sweep(tmp_path / "s.h5", held)), 0.3)
    ax = figure_of(plot_relaxation, [one]).axes[0]
    H = ax.get_lines()[0].get_ydata()
    assert one.transient.H.min() < 1e-4 * one.transient.H.max() and H.min() >= 1e-4 * H.max() > 0
