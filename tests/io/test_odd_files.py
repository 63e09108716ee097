"""Files of odd contents: every command that reads results says one line or draws, without a warning of numpy's."""

import warnings

import numpy as np
import pytest
from samples import stored

import jampetsc.packing.compiled  # noqa: F401  numba, whose import warns
from jampetsc import main as cli
from jampetsc.errors import InputError
from jampetsc.io.packing_file import read_identified, write_packing
from jampetsc.io.reader import load
from jampetsc.packing.packing import Packing
from jampetsc.plots.picture import drawing_errors

OMEGA = np.geomspace(1e-6, 1e2, 9)
LINEAR = OMEGA * (1 + 1j)
RATES = np.geomspace(1e-2, 1.0, 5)
DISKS = 16


def write_sweep(path, G=LINEAR, bound=1e-9, fields=None, spectrum=None, **attributes):
    """A sweep; fields is (omega (F,), displacement (F, n, 2)) and spectrum (G0, eta_inf, rates, weights)."""
    arrays = {"omega": OMEGA, "G": G, "error_bound": np.full(len(OMEGA), bound)}
    known = {"law": "contact", "beta": 1.0, "pressure": 1e-3, "k": 1.0, "tau1": 1.0} | attributes
    if fields is not None:
        arrays |= dict(zip(("fields/omega", "fields/displacement"), fields, strict=True))
        arrays["particles"] = np.arange(DISKS)
        points = np.random.default_rng(0).random((DISKS, 2)) * 4.0
        packing = path.with_name("packing.h5")
        write_packing(packing, Packing.from_positions(points, np.full(DISKS, 0.5), 4.0 * np.eye(2)))
        known |= dict(zip(("packing", "packing_sha256"), read_identified(packing)[1], strict=True))
    if spectrum is not None:
        names = (f"spectrum/{name}" for name in ("G0", "eta_inf", "rates", "weights"))
        arrays |= dict(zip(names, spectrum, strict=True))
    stored(path, "sweep", arrays, **known)


def field(value):
    return [1e-4], np.full((1, DISKS, 2), value, complex)


@pytest.mark.parametrize(
    ("contents", "line", "message"),
    [
        ({"G": 0 * LINEAR}, "info s.h5", None),
        ({"G": 0 * LINEAR}, "plot s.h5 --out s.svg", "Draw other files on log axes"),
        ({"G": np.nan * LINEAR}, "plot s.h5 --out s.svg", "no modulus at any frequency"),
        ({"G": 1e300 * LINEAR}, "plot s.h5 --out s.svg", "moduli beyond the range of a picture"),
        ({"bound": np.inf}, "plot s.h5 --out s.svg", None),
        ({"k": 0.0}, "plot s.h5 --out s.svg", "attribute k = 0.0: must be a positive number"),
        ({"pressure": np.nan}, "plot s.h5 --out s.svg", "attribute pressure = nan: not a number"),
        ({"tau1": "one"}, "plot s.h5 --out s.svg", "attribute tau1 = 'one': must be a real number"),
        (
            {"spectrum": (np.nan, 0.1, RATES, RATES)},
            "spectrum s.h5 --out o.h5",
            "impossible values in its spectrum",
        ),
        ({"spectrum": (0.0, 0.0, RATES, RATES)}, "spectrum s.h5 --out o.h5", None),
        ({"fields": field(0.0)}, "correlate s.h5 --lane 1,2 --out o.h5", "Choose other frequencies"),
        ({"fields": field(0.0)}, "plot s.h5 --kind fields --out s.svg", None),
        (
            {"fields": field(np.nan)},
            "correlate s.h5 --out o.h5",
            r"field at omega = 0\.0001 holds NaN, Inf or absurdly large values",
        ),
        ({"fields": field(1e200)}, "plot s.h5 --kind fields --out s.svg", "NaN, Inf or absurdly large"),
    ],
)
def test_odd_contents(contents, line, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_sweep(tmp_path / "s.h5", **contents)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if message is None:
            assert cli.dispatch(line.split()) == 0
        else:
            with pytest.raises(InputError, match=message) as raised:
                cli.dispatch(line.split())
            assert "s.h5" in str(raised.value) and "\n" not in str(raised.value)
    assert capsys.readouterr().err == ""


def test_a_picture_of_numbers_that_are_not_finite_names_them(tmp_path):
    """Where matplotlib refuses them; an error of another cause stays what it is."""
    sweep = stored(
        tmp_path / "s.h5", "sweep", {"omega": OMEGA, "G": LINEAR, "error_bound": OMEGA}, phi=np.inf
    )
    for result, error in (
        (load(sweep), InputError),
        (Packing.from_positions([[0.0, 0]], [0.5], 2 * np.eye(2)), IndexError),
    ):
        with pytest.raises(
            error, match=r"s\.h5: attribute phi: not finite" if error is InputError else "^here$"
        ):
            with drawing_errors([result]):
                raise IndexError("here")
