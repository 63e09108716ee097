"""Labels name the unit of a stress, which has a length in it in three dimensions."""

import pytest
from picture_contents import held

from jampetsc.errors import InputError
from jampetsc.plots.picture import flow_units, stress_unit


def file(dimension=2, **attributes):
    more = {"dimension": 3} if dimension == 3 else {}
    return held({}, attributes | more, f"{dimension}.h5")


def test_units_of_results_of_both_dimensions():
    for files, ratio, viscosity in (
        ([file()], "/k", r"k\tau_1"),
        ([file(3), file(3)], r"\,d/k", r"k\tau_1/d"),
        ([file(), file(3)], r"\,d^{D-2}/k", r"k\tau_1\,d^{2-D}"),
    ):
        unit = stress_unit(files)
        assert (unit.over, unit.viscosity) == (ratio, viscosity)


def test_units_of_flows():
    """Vågberg's, or of the packing, of constant stiffness or k_e/σ²; not of both dimensions in one picture."""
    for attributes, plane, space in (
        ({}, "k", "k/d"),
        ({"stiffness": "inverse-square-diameter"}, r"k_{\rm e}", r"k_{\rm e}/d^3"),
        ({"units": "k_e, d_s"}, r"k_{\rm e}/d_{\rm s}^2", r"k_{\rm e}/d_{\rm s}^3"),
    ):
        for dimension, unit in ((2, plane), (3, space)):
            assert flow_units([file(dimension, **attributes)]).label("p", "stress") == rf"$p\ [{unit}]$"
        with pytest.raises(InputError, match=r"3\.h5"):
            flow_units([file(2, **attributes), file(3, **attributes)])
