"""Pictures of elastic constants: K* beside G*, Poisson's ratio and the constants, of an isotropic solid."""

import numpy as np
import pytest
from picture_contents import figure_of
from samples import stored

from jampetsc.errors import InputError
from jampetsc.plots.draw import draw
from jampetsc.plots.tensor_plots import plot_bulk, plot_poisson, plot_tensor

OMEGA = np.geomspace(1e-3, 1e3, 7)
K, G = 0.4 + 0.2j * OMEGA, 0.1 + 0.1j * OMEGA  # in 2D C_xxxx = K + G, C_xxyy = K − G


def constants(pressure=1e-3, bound=1e-4):
    """A sweep of the tensor in units k = 2 of stiffness."""
    C = np.zeros((7, 3, 3), complex)
    C[:, 0, 0] = C[:, 1, 1] = K + G
    C[:, 0, 1] = C[:, 1, 0] = K - G
    C[:, 2, 2] = G
    C[:, 0, 2] = C[:, 2, 0] = -1e-3
    arrays = {"omega": OMEGA, "G": 2 * G, "error_bound": np.full(7, bound), "C": 2 * C, "bulk_modulus": 2 * K}
    arrays |= {"C_error_bound": np.full((7, 3, 3), bound)}
    return stored(None, "sweep", arrays, law="contact", beta=1.0, pressure=pressure, k=2.0, load="tensor")


def values_of(figure):
    """{label: y} of all lines with data."""
    return {line.get_label(): line.get_ydata() for ax in figure.axes for line in ax.get_lines()}


def test_moduli_and_ratio_in_units_of_k():
    drawn = values_of(figure_of(plot_bulk, [constants(), constants(1e-2)]))
    for name, values in (("K\u2032", K.real), ("K\u2033", K.imag), ("G\u2032", G.real), ("G\u2033", G.imag)):
        shown = [y for label, y in drawn.items() if name in label]
        assert len(shown) == 2
        np.testing.assert_allclose(shown, [values] * 2)
    drawn = values_of(figure_of(plot_poisson, constants()))
    ratio = (K - G) / (K + G)  # in two dimensions
    for prime, values in (("\u2032", ratio.real), ("\u2033", ratio.imag)):
        (shown,) = (y for label, y in drawn.items() if f"nu{prime}" in label)
        np.testing.assert_allclose(shown, values)


def test_constants_with_their_sign():
    drawn = values_of(figure_of(plot_tensor, constants()))
    np.testing.assert_allclose(drawn["_:C\u2032 xxyy, +1"], (K - G).real)
    np.testing.assert_allclose(drawn["_:C\u2032 xxxy, -1"], 1e-3)  # |C|; dotted, as negative
    assert "_:C\u2032 xxxy, +1" not in drawn and "_:C\u2033 xxxy, -1" not in drawn


def test_a_single_load_has_no_constants():
    single = stored(None, "sweep", {"omega": OMEGA, "G": G, "error_bound": np.zeros(7)}, load="xy")
    for kind in ("bulk", "poisson", "tensor"):
        with pytest.raises(
            InputError, match=r"xy, so no elastic constants\. Run the sweep with load tensor\."
        ):
            draw([single], kind)
