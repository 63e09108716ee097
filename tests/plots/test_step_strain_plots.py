"""The picture of step strains: what is drawn of each file, in units of k and τ₁."""

import numpy as np
import pytest
from samples import stored
from test_spectrum import write_sweep

from jampetsc.errors import InputError
from jampetsc.io.reader import load
from jampetsc.plots.step_strain_plots import plot_step_strain


def relaxing(k=1.0, tau1=1.0, path=None):
    """Two strains whose G(t) falls as t^-1/2, the second to below 0."""
    time = np.logspace(-1, 3, 41)
    G = np.array([time**-0.5, time**-0.5 - 0.1])
    arrays = {"time": tau1 * time, "strain": np.array([1e-4, 1e-2]), "G": k * G, "error": 0.1 * k * np.abs(G)}
    return stored(path, "relax", arrays, k=k, tau1=tau1, pressure=1e-2 * k, load="xy")


def test_every_strain_is_drawn_in_units_of_k_and_tau1(tmp_path):
    """Values that a log axis cannot show are left out; a sweep beside them is the linear G(t)."""
    sweep = load(write_sweep(tmp_path / "s.h5"))
    page = plot_step_strain.draw([relaxing(k=3.0, tau1=2.0), sweep])
    (ax,) = page.axes
    lines = {line.get_label().strip("_"): line.get_xydata() for line in ax.get_lines()}
    small, large = (
        next(data for label, data in lines.items() if f"strain {g}" in label) for g in ("0.0001", "0.01")
    )
    np.testing.assert_allclose(small[:, 1], small[:, 0] ** -0.5)
    assert np.isnan(large[-1, 1]) and np.isfinite(large[0, 1])
    linear = next(data for label, data in lines.items() if "linear" in label)
    np.testing.assert_allclose(linear[:, 1], sweep.spectrum.stress_relaxation(linear[:, 0]))
    assert linear[[0, -1], 0] == pytest.approx([0.1, 1e3])
    assert any("t^{-1/2}" in text.get_text() for text in ax.texts)
    assert page.text == "G(t) after 2 step strains"


def test_a_sweep_alone_has_no_step_strains(tmp_path):
    with pytest.raises(InputError, match=r"no step strains\. Give the files of relax"):
        plot_step_strain.draw([load(write_sweep(tmp_path / "s.h5"))])
