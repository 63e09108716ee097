"""Every axis of every picture says what it shows, in which unit and on which scale; panels have their letters."""

import re
from pathlib import Path

import numpy as np
import pytest
from picture_contents import drawn_by, figure_of, require_inside
from test_displacement_correlation import correlation_file
from test_event_plots import sheared_events
from test_floppy_plots import lowest_of, modes_of, quasistatic_of
from test_flow_plots import facts, series
from test_jam_plots import jam_of, shear_of
from test_oscillation_plots import large_oscillations
from test_picture_limits import curve, run
from test_probe_plots import slow, sounding
from test_spectrum import write_sweep
from test_step_strain_plots import relaxing
from test_yielding_plots import started

from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.io.reader import load
from jampetsc.plots import (
    correlation_plots,
    crossover_plots,
    event_plots,
    flow_plots,
    jamming_plots,
    mode_plots,
    moduli_plots,
    oscillation_plots,
    probe_plots,
    quasistatic_plots,
    step_strain_plots,
    trade_plots,
)
from jampetsc.plots.draw import pictures, plain_text, table_rows
from jampetsc.plots.spectrum_plots import plot_relaxation, spectrum_curve
from jampetsc.plots.start_plots import plot_start
from jampetsc.plots.style import COLUMN, LOSS, PAGE, STORAGE
from jampetsc.plots.yielding_plots import plot_flow_curve

RATE = r"$\dot\gamma\ [1/\tau_1]$"
FREQUENCY = r"$\omega_m\ [\sqrt{k/m}]$"


def lengths(folder):
    return [correlation_plots.correlation_curve(correlation_file(folder / "c.h5"))]


def spectra(folder):
    return [spectrum_curve(load(write_sweep(folder / "s.h5")))]


def cooled(folder):
    return [jam_of(protocol="compress", cooling_rate=0.1)]


def modes(folder):
    return [modes_of(np.arange(1.0, 9.0), np.arange(1.0, 9.0))]


PICTURES = [  # (function, what it draws, (x, y, scales) of the panels: linear or log)
    (correlation_plots.plot_correlation, lengths,
     [(r"$\delta/L$", rf"$C(\delta)$ of {part} $u_y/\gamma$", "--") for part in ("Re", "Im")]),
    (correlation_plots.plot_lengths, lengths,
     [(r"$\omega\tau_1$", "$l/L$", "ll"),
      (r"$\omega\tau_1\,/\,(p/k)^{1/2}$", r"$(l/d)\,[-\ln(p/k)]^{0.65}$", "ll")]),
    (moduli_plots.plot_moduli, lambda folder: [curve()], [(r"$\omega\tau_1$", f"{STORAGE}$/k$,  {LOSS}$/k$", "ll")]),
    (moduli_plots.plot_collapse, lambda folder: [curve()],
     [(r"$\omega\tau_1\,/\,(p/k)$", rf"{STORAGE}, {LOSS}  $[\,k\,(p/k)^{{1/2}}\,]$", "ll")]),
    (quasistatic_plots.plot_medians, lambda folder: [quasistatic_of([1, 1, 1], pressure=p) for p in (1e-3, 1e-2)],
     [("$p/k$", "median per unit strain", "ll")]),
    (probe_plots.plot_waves, lambda folder: [slow("wave:1,0:transverse", G0=1.0, wave_vector=[0.2, 0.0])],
     [("$kd$", "$G_0(k)/k$", "l-")]),
    (probe_plots.plot_sound, lambda folder: [sounding()],
     [("$kd$", r"$\omega(k)\,\tau_1$", "ll"), ("$kd$", r"$\Gamma/\omega(k)$", "ll")]),
    (probe_plots.plot_compliances, lambda folder: [slow("points:9", J=np.arange(1.0, 10.0))],
     [("$J_ik$", r"$P(\ln J_i)$", "ll")]),
    (mode_plots.plot_lowest, lambda folder: [lowest_of(p) for p in (1e-3, 1e-2)],
     [("$p/k$", "floppiness of the lowest modes", "ll"), ("$p/k$", "share of the lowest modes", "l-"),
      ("$p/k$", "median per unit strain", "ll")]),
    (quasistatic_plots.plot_viscosities, lambda folder: [quasistatic_of([1, 1, 1])],
     [(r"$\beta$", r"$\eta_0,\ \eta_\infty\ [k\tau_1]$", "ll")]),
    (flow_plots.plot_flow, lambda folder: [facts(rate=rate) for rate in (0.1, 0.2)],
     [(RATE, r"$\sigma\ [k]$", "ll"), (RATE, r"$p\ [k]$", "ll"), (RATE, r"$\sigma/p$", "ll"),
      (RATE, r"$\sigma/\dot\gamma,\ p/\dot\gamma\ [k\tau_1]$", "ll"),
      (RATE, r"$d\ln\sigma/d\ln\dot\gamma,\ d\ln p/d\ln\dot\gamma$", "l-"), (RATE, "$2N_c/N$", "l-")]),
    (flow_plots.plot_against_phi, lambda folder: [facts(phi=phi) for phi in (0.8, 0.82)],
     [(r"$\phi$", r"$\sigma\ [k]$", "-l"), (r"$\phi$", r"$p\ [k]$", "-l"), (r"$\phi$", "$2N_c/N$", "--")]),
    (flow_plots.plot_flow, lambda folder: [series("a.h5")],
     [(r"$\gamma$", r"$\sigma\ [k]$", "--"), (r"$\gamma$", r"$p\ [k]$", "--")]),
    (jamming_plots.plot_stepwise_shear, lambda folder: [shear_of(np.ones(5))],
     [("", r"$U/N\ [k]$", "-l"), ("", r"$\sigma\ [k]$", "--"), (r"$\gamma$", r"$p\ [k]$", "--"),
      (r"$\gamma$", "$2N_c/N$", "--")]),
    (event_plots.plot_events, lambda folder: [sheared_events()],
     [(r"$\gamma$", r"$\sigma\ [k]$", "--"), (r"$\Delta U/N\ [k]$", "share of larger drops", "ll"),
      (r"first $\left|\gamma\right|$", "share without change", "l-")]),
    (oscillation_plots.plot_lissajous, lambda folder: [large_oscillations()],
     [(r"$\gamma$", r"$\sigma/k$", "--"), (r"$\gamma/\gamma_1$", r"$\sigma/\sigma_1$", "--")]),
    (oscillation_plots.plot_harmonics, lambda folder: [large_oscillations()],
     [(r"$\gamma_0$", r"$|G_3/G_1|,\ |G_5/G_1|$", "ll")]),
    (jamming_plots.plot_fraction, cooled, [(r"$\phi$", r"$f(\phi)$", "--")]),
    (jamming_plots.plot_pressures, cooled, [(r"$p\ [k_{\rm e}/d_{\rm s}^2]$", "$P(p)$", "--")]),
    (jamming_plots.plot_jamming_densities, cooled, [(r"$\phi_J$", r"$P(\phi_J)$", "--")]),
    (mode_plots.plot_modes, modes,
     [("", FREQUENCY, "ll"), ("mode number", "cumulative share", "l-"),
      ("", r"$\langle\Delta u_\perp^2\rangle^{1/2}/\,\langle\Delta u_\parallel^2\rangle^{1/2}$", "-l")]),
    (mode_plots.plot_states, modes, [(FREQUENCY, r"$D(\omega_m)$", "ll")]),
    (mode_plots.plot_participation, modes, [(FREQUENCY, "participation ratio", "ll")]),
    (crossover_plots.plot_crossover,
     lambda folder: [quasistatic_of([1, 1, 1], pressure=p, omega_star=p) for p in (1e-3, 1e-2)],
     [("$p/k$", r"$\omega^*\tau_1$", "ll")]),
    (plot_flow_curve, lambda folder: [facts(rate=rate) for rate in (0.1, 0.2)],
     [(RATE, r"$\sigma,\ p\ [k]$", "ll")]),
    (plot_start, lambda folder: [*started()[0]], [(r"$\gamma$", r"$\sigma\ [k]$", "--")]),
    (step_strain_plots.plot_step_strain, lambda folder: [relaxing()],
     [(r"$t/\tau_1$", r"$G(t,\gamma)/k$", "ll")]),
    (plot_relaxation, spectra,
     [(r"$\tau/\tau_1$", "$H/k$", "ll"), (r"$\tau/\tau_1$", r"$\sum_{\tau_m\leq\tau}\,g_m/k$", "l-"),
      (r"$t/\tau_1$", "$G(t)/k$", "ll"), (r"$t/\tau_1$", r"$J(t)\,k$", "ll")]),
]  # fmt: skip


@pytest.mark.parametrize(("picture", "made", "panels"), PICTURES, ids=lambda part: getattr(part, "kind", ""))
def test_axes_are_named_and_numbers_told(tmp_path, picture, made, panels):
    """Nothing leaves the page, no legend lies on data, and the numbers are those of the panels with their names."""
    shown = picture.draw(made(tmp_path))
    axes, fig = shown.axes, shown.figure
    assert shown.text  # what a command says
    require_inside(fig)
    words = {"linear": "-", "log": "l"}
    found = [
        (ax.get_xlabel(), ax.get_ylabel(), words[ax.get_xscale()] + words[ax.get_yscale()]) for ax in fig.axes
    ]
    assert found == panels and fig.get_figwidth() in (COLUMN, PAGE) == (3.4, 7.0)
    letters = [ax.get_title(loc="left") for ax in axes]
    assert letters == ([f"({letter})" for letter in "abcdef"[: len(axes)]] if len(axes) > 1 else [""])
    assert any(ax.get_legend() is not None for ax in axes)
    for ax in axes:
        if ax.get_legend() is not None and picture is not mode_plots.plot_modes:
            box = ax.get_legend().get_window_extent()
            for line in ax.get_lines():
                pixels = line.get_transform().transform(np.column_stack([*map(np.ravel, line.get_data())]))
                assert not box.count_contains(pixels[np.isfinite(pixels).all(axis=1)])
    rows = table_rows(axes)
    assert {row["panel"] for row in rows} == set(
        "abcdef"[: 1 if picture is mode_plots.plot_modes else len(axes)]
    )
    for row in rows:
        ax = axes["abcdef".index(row["panel"])]
        assert (row["x"], row["y"]) == (plain_text(ax.get_xlabel()), plain_text(ax.get_ylabel())) and row[
            "series"
        ]


def test_names_of_a_trade_stand_beside_their_points():
    """To the right of all there is room for them: they stay in the axes, off each other and off the points."""
    rows = [run(f"--accuracy 1e-{n}", 10.0**-n, 2.0**n) for n in range(2, 8)] + [
        run("direct, MUMPS", 1e-9, 200.0, "method")
    ]
    ax = drawn_by(trade_plots.draw_trade, rows, 1e-12).axes[0]
    boxes = [text.get_window_extent() for text in ax.texts]
    assert len(boxes) == 7
    for n, box in enumerate(boxes):
        assert ax.bbox.x0 <= box.x0 and box.x1 <= ax.bbox.x1 and ax.bbox.y0 <= box.y0 and box.y1 <= ax.bbox.y1
        assert not any(box.overlaps(other) for other in boxes[:n])
    left, right = np.log10(ax.get_xlim())
    assert left < np.log10(4.0) and right > np.log10(200.0) + 0.1 * (np.log10(200.0) - np.log10(4.0))


def test_flanks_of_the_window_are_not_drawn(tmp_path):
    """H below 10⁻⁴ of its largest value is of the window, not of the spectrum."""
    held = RelaxationSpectrum(0.02, 0.4, np.array([1e-4, 1.0]), np.array([1.0, 1e-5]))
    one = spectrum_curve(load(write_sweep(tmp_path / "s.h5", held)), 0.3)
    ax, cumulative, *_ = figure_of(plot_relaxation, [one]).axes
    assert cumulative.get_ylim() == pytest.approx((0.0, 1.05 * 1.00001))  # the sum of the weights is in sight
    H = ax.get_lines()[0].get_ydata()
    assert one.transient.H.min() < 1e-4 * one.transient.H.max() and H.min() >= 1e-4 * H.max() > 0


def test_stresses_in_space_are_in_k_over_a_length(tmp_path):
    """Labels and legends of files of spheres have d/k and k/d where those of disks have 1/k and k."""
    for picture, made, panels in PICTURES:
        if picture.kind not in ("collapse", "viscosities", "spectrum"):
            continue
        results = made(tmp_path)
        for result in results:
            result.attributes["dimension"] = 3
        found = [(ax.get_xlabel(), ax.get_ylabel()) for ax in picture.draw(results).axes]
        for labels, flat in zip(found, panels, strict=True):
            for label, other in zip(labels, flat, strict=False):
                other = other.replace("/k", r"\,d/k").replace(r"k\tau_1]", r"k\tau_1/d]")
                other = other.replace(r"[\,k\,", r"[\,k/d\,").replace(r"J(t)\,k", r"J(t)\,k/d")
                assert label == other


def test_the_page_of_pictures_has_every_kind():
    page = (Path(__file__).parents[2] / "docs/howto/pictures.md").read_text(encoding="utf-8")
    columns = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    assert set(re.findall(r"`([\w-]+)`", " ".join(columns))) == {
        kind for kind, picture in pictures().items() if picture.function.__module__.startswith("jampetsc")
    }
