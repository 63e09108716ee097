"""The picture of events: σ(γ) with its jumps, shares of drops and of first changes."""

import numpy as np
import pytest
from picture_contents import figure_of, lines, with_arrays
from test_jam_plots import shear_of

from jampetsc.errors import InputError
from jampetsc.plots.event_plots import plot_events


def sheared_events(scale=1.0, path="s.h5"):
    """What `shear --events` makes: four rows, a contact that opens, one that closes, two drops; k = 2."""
    strain = scale * np.array([0.12, 0.22, 0.22, 0.33])
    stress = np.array([[1.0, 1.0], [2.0, 1.5], [2.0, 1.0], [3.0, 2.0]])
    arrays = {"strain": strain, "kind": [0, 2, 1, 2], "shear_stress": stress, "drop": [0.0, 4.0, 0.0, 8.0]}
    return with_arrays(
        shear_of(np.ones(4), path=path), {f"events/{name}": values for name, values in arrays.items()}
    )


def test_stress_jumps_at_events_and_shares_fall_at_drops_and_first_changes():
    fig = figure_of(plot_events, [sheared_events(), sheared_events(2.0, "t.h5")])
    stress, drops, firsts = fig.axes
    x, y, *_ = lines(stress)[0]
    np.testing.assert_allclose(x, [0.1, 0.12, 0.12, 0.2, 0.22, 0.22, 0.22, 0.22, 0.3, 0.33, 0.33, 0.4])
    np.testing.assert_allclose(y[1:3], 0.5)
    np.testing.assert_allclose(y[4:8], [1.0, 0.75, 1.0, 0.5])
    opened = next(line for line in stress.get_lines() if line.get_marker() == "o")
    np.testing.assert_allclose(opened.get_data(), [[0.12], [0.5]])
    np.testing.assert_allclose(
        drops.get_lines()[0].get_data(), [[0.2, 0.2, 0.4, 0.4], [1.0, 0.75, 0.5, 0.25]]
    )
    np.testing.assert_allclose(firsts.get_lines()[0].get_data(), [[0.12, 0.24], [1.0, 0.5]])


def test_files_without_events_are_refused():
    with pytest.raises(InputError, match=r"s\.h5: no events\. Shear with events\."):
        figure_of(plot_events, [shear_of(np.ones(4))])
