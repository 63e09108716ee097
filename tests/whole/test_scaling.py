"""The benchmark of time and memory against N, at a tiny size: benchmarks/scaling.py."""

import sys

import launch
import numpy as np
import pytest

sys.path.insert(0, str(launch.ROOT / "benchmarks"))

import scaling


def test_a_table_grows_by_what_it_lacks(tmp_path, capsys):
    """A packing and its sweep, each a process; what failed is told and tried again, nothing else."""
    scaling.measure(tmp_path, [16], [1], ["sweep"])
    assert "n16.h5: no such file" in capsys.readouterr().out and not scaling.read(tmp_path / "scaling.csv")
    scaling.measure(tmp_path, [16], [1], ["pack", "sweep"])
    rows = scaling.read(tmp_path / "scaling.csv")
    assert [row["command"] for row in rows] == ["pack", "sweep"] and list(rows[0]) == scaling.COLUMNS
    assert all(row["n"] == 16 and row["processor"] > 0 and row["memory"] > 0.01 for row in rows)
    assert 0 < rows[1]["certified"] <= float(scaling.ACCURACY)
    assert rows[1]["G0"] < rows[1]["G_inf"] and rows[1]["eta_inf"] > 0 and np.isnan(rows[0]["G0"])
    capsys.readouterr()
    scaling.measure(tmp_path, [16], [1], ["pack", "sweep"])
    assert scaling.read(tmp_path / "scaling.csv")[1] == rows[1] and not capsys.readouterr().out
    scaling.draw(rows, tmp_path / "one.png")
    assert (tmp_path / "one.png").stat().st_size > 5000


@pytest.mark.parametrize("power", [0.5, 1.2])
def test_an_exponent_is_that_of_the_last_decade(power):
    n = np.array([10.0, 100.0, 1000.0, 3000.0, 10_000.0])
    values = np.where(n < 1000, 7.0, n**power)
    assert scaling.exponent(n, values) == pytest.approx(power)
    assert np.isnan(scaling.exponent(n[:1], values[:1]))
