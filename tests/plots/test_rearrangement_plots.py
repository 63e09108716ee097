"""The picture of D²min of the largest drop."""

import numpy as np
import pytest
from picture_contents import figure_of, with_arrays
from test_jam_plots import shear_of

from jampetsc.errors import InputError
from jampetsc.plots.rearrangement_plots import plot_rearrangement


def rearranged(dimension, d2min):
    """What `shear --events --d2min` makes of four particles of diameters 1, 2 and 3, far from each other."""
    places = np.array([[1.5, 1.5, 4.0], [5.0, 1.5, 4.0], [2.0, 5.0, 4.0], [5.0, 5.0, 1.5]])[:, :dimension]
    arrays = {"strain": [0.1, 0.2], "participation": [0.0, 3.0], "largest": 1, "d2min": d2min}
    arrays |= {"positions": places, "cell": 8.0 * np.eye(dimension), "displacement": 0.0 * places}
    arrays = {f"events/{name}": values for name, values in arrays.items()}
    return with_arrays(
        shear_of(np.ones(4), dimension=dimension), {**arrays, "state/radii": [0.5, 1.0, 1.5, 1.0]}
    )


@pytest.mark.parametrize("dimension", [2, 3])
def test_colours_are_d2min_over_the_square_of_the_mean_diameter(dimension):
    """Of spheres those that the slice cuts; white without neighbours, clipped below two decades."""
    fig = figure_of(plot_rearrangement, rearranged(dimension, [4.0, 1e-9, np.nan, 0.4]))
    ax, bar = fig.axes
    drawn = ax.collections[-1]
    values = {2: [1.0, 2.5e-10, np.nan, 0.1], 3: [1.0, 2.5e-10, np.nan]}[dimension]
    np.testing.assert_allclose(np.ma.filled(drawn.get_array(), np.nan), values)
    assert (drawn.norm.vmin, drawn.norm.vmax) == pytest.approx((0.01, 1.0))
    diameters = {2: [1.0, 2.0, 3.0, 2.0], 3: [1.0, 2.0, 3.0]}[dimension]
    np.testing.assert_allclose(drawn._widths * 2.0, diameters)
    fig.canvas.draw()
    assert drawn.get_facecolor()[2].tolist() == [1.0, 1.0, 1.0, 1.0]
    symbol = {2: "d", 3: r"\langle d\rangle"}[dimension]
    assert bar.get_ylabel() == rf"$D^2_{{\rm min}}/{symbol}^2$"
    assert ax.get_title().startswith(r"$\gamma=0.2$") and ax.get_xlabel() == "participation 3"


def test_files_without_d2min_are_refused():
    with pytest.raises(InputError, match=r"s\.h5: no D²min of a drop\. Shear with events and d2min, through"):
        figure_of(plot_rearrangement, shear_of(np.ones(4)))
