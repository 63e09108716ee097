"""Pictures of large oscillations: σ against γ with its elastic part, and harmonics against the amplitude."""

import numpy as np
import pytest
from picture_contents import figure_of, held, told

from jampetsc.errors import InputError
from jampetsc.plots.oscillation_plots import plot_harmonics, plot_lissajous

TIMES = 2.0 * np.pi * np.arange(128) / 128
AMPLITUDES = np.array([1e-3, 1e-2, 0.1])


def large_oscillations(control="strain", **arrays):
    """Two frequencies; σ/k = γ (1 − 20 γ²) + 0.3 γ̇/ω, k = 2, τ₁ = 4. The last point has failed."""
    strain = AMPLITUDES[:, None, None] * np.sin(TIMES) * np.ones((2, 1))
    stress = 2.0 * (strain - 20.0 * strain**3 + 0.3 * AMPLITUDES[:, None, None] * np.cos(TIMES))
    stress[2, 1] = np.nan
    harmonics = np.array([[[0.1 * a, 1e-2j * a]] * 2 for a in AMPLITUDES])
    arrays = {
        "omega": np.array([1e-3, 1e-2]), "amplitude": AMPLITUDES, "harmonics": harmonics,
        "harmonics_error": 0.1 * abs(harmonics), "strain_waveform": strain, "stress_waveform": stress,
    } | arrays  # fmt: skip
    facts = {"control": control, "k": 2.0, "tau1": 4.0, "pressure": 2e-3}
    return held(
        {name: part for name, part in arrays.items() if part is not None}, facts, format="jampetsc-oscillate"
    )


def test_a_cycle_is_closed_and_its_elastic_part_has_no_loss():
    fig = figure_of(plot_lissajous, [large_oscillations()])
    plain, normal = (ax.get_lines() for ax in fig.axes)
    assert len(plain) == 5 and len(normal) == 10  # without what has failed, and with elastic parts
    x, y = plain[0].get_data()
    area = 0.5 * np.sum((y[1:] + y[:-1]) * np.diff(x))
    assert area == pytest.approx(np.pi * 0.3 * 1e-6, rel=1e-2) and (x[0], y[0]) == (x[-1], y[-1])
    x, y = normal[9].get_data()
    scale = abs(1.0 - 15.0 * 0.01 - 0.3j)
    np.testing.assert_allclose(y, (x - 0.2 * x**3) / scale, atol=1e-12)
    assert told(fig.axes[0])[0] == r"$\gamma_0=10^{-3}$, $\omega\tau_1=4.0\times10^{-3}$".replace("4.0", "4")


def test_an_imposed_stress_has_no_elastic_part():
    fig = figure_of(plot_lissajous, [large_oscillations("stress")])
    assert len(fig.axes[1].get_lines()) == 5
    assert told(fig.axes[0])[-1].startswith(r"$\sigma_0/k=5\times10^{-2}$")


def test_harmonics_are_over_the_amplitude_with_their_errors():
    ax = figure_of(plot_harmonics, [large_oscillations()]).axes[0]
    assert len(ax.containers) == 4
    for order, factor in ((0, 0.1), (1, 1e-2)):
        np.testing.assert_allclose(
            ax.containers[order].lines[0].get_data(), [AMPLITUDES, factor * AMPLITUDES]
        )
    (bars,) = ax.containers[0].lines[2]
    np.testing.assert_allclose([np.ptp(bar[:, 1]) for bar in bars.get_segments()], 0.02 * AMPLITUDES)
    assert told(ax)[-2:] == ["third", "fifth"]


def test_files_that_do_not_go_together_are_refused():
    old = large_oscillations(strain_waveform=None)
    with pytest.raises(InputError, match=r"no waveforms\. Run oscillate again\."):
        figure_of(plot_lissajous, [old])
    with pytest.raises(
        InputError, match=r"stress imposed in some files, strain in others\. Draw files of one kind\."
    ):
        figure_of(plot_harmonics, [large_oscillations(), large_oscillations("stress")])
