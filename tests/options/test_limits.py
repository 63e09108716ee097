"""The range of every number on the command line: its ends belong to it or not, and what lies beyond is refused."""

import functools

import numpy as np
import pytest

from jampetsc import main as cli
from jampetsc.errors import InputError
from jampetsc.options.parser import parse_job
from jampetsc.options.values import FREQUENCIES, format_numbers


@functools.cache
def parser(command):
    return cli.command_parser([command])[1].choices[command]


def checked(line):
    """The job that a command line asks for."""
    command, *words = line.split()
    return parse_job(parser(command).parse_args(words))


PACK = "pack --n 16 --out p.h5 --pressure 1e-2"
PHI = "pack --n 16 --out p.h5"
SWEEP = "sweep p.h5 --out s.h5"
MODES = "modes p.h5 --out m.h5"
OSC = "oscillate p.h5 --out o.h5 --omega 1"
MOVING = f"{OSC} --contacts moving"
FIT = "collapse f.h5 --out c.h5 --observable pressure"
SIZE = f"{FIT} --finite-size"
LAST = 2**63 - 1

RANGES = [  # (line, option, values within, values beyond)
    (PACK, "tolerance", [1e-13, 1e-4], [0.99e-13, 1.01e-4, "nan"]),
    (PACK, "threads", [1, 256], [0, 257]),
    (PACK, "seed", [0, LAST], [-1, LAST + 1]),
    ("jam --n 16 --phi 0.9 --out j.h5", "seeds", ["0:0", "3", "4,2"],
     ["1:0", "1:1000001", "-1:3", "1:", "3,3", "a:b"]),
    (PHI, "phi", [0.8, 1.5], [0.79, 1.51, "nan"]),
    (PHI, "pressure", ["1e-8", "1"], ["0.99e-8", "1.01", "nan", "inf"]),
    ("pack --pressure 1e-2 --out p.h5", "n", [16], [15, 10_000_001]),
    (SWEEP, "omega", ["1e-16", "1e12", "1,2,1", "1e-2:1e2:2", "1e-2:1e2:100000", "lin:1:2:3"],
     ["1:1:5", "0.99e-16", "1.01e12", "1e-17:1:5", "1:1e13:5", "2:1:5", "1:2:1", "1:2:100001", "nan", "1,inf", "0",
      "-1", "1:2", ""]),
    (SWEEP, "accuracy", [1e-12, 0.1], [0.99e-12, 0.11, "nan"]),
    (SWEEP, "beta", [0.0, 1e3], [-0.1, "nan", "-nan"]),
    (f"{SWEEP} --stress 1e-5", "alpha", [0.05, 5.0], [0.049, 5.01, "nan"]),
    (f"{SWEEP} --alpha 0.5", "stress", [1e-30, 1e300], [0.0, -1.0, "inf", "nan"]),
    (MODES, "count", [1], [0, -1]),
    (MODES, "below", [1e-12, 5.0], [0.0, -1.0, "inf", "nan"]),
    (f"{OSC} --strain 1e-6", "alpha", [0.45, 2.0], [0.449, -0.1, 2.01, "nan"]),
    (f"{MOVING} --strain 1e-6", "alpha", [1e-9, 2.0], [0.0, -0.1, 2.01, "nan"]),
    (f"{OSC} --strain 1e-6", "steps", [16, 24, 4096], [8, 20, 4104, 0, -16]),
    *((f"oscillate p.h5 --out o.h5 --contacts moving --strain 1e-3 --alpha {alpha}", "omega", within, beyond)
      for alpha, within, beyond in (
          (1, ["1e-16", "1e12"], ["0.99e-16", "1.01e12"]), (2, ["1e-16"], ["0.99e-16"]),
          (0.5, ["1e-32", "1e24"], ["0.99e-32", "1.01e24"]), (0.05, ["1e240"], ["1.01e240"]),
          (0.01, ["1e-300", "1e300"], ["1.01e300"]))),
    (f"{MOVING} --strain 1e-6", "cycles", ["auto", 3, 100_000], [2, 100_001, "few", 3.5, -3]),
    (OSC, "strain", ["1e-30", "1", "1e-3,1e-6"], ["0.99e-30", "1.01", "nan", "1e-3,2", "a"]),
    (OSC, "stress", ["1e-30", "1e300"], ["-1", "inf", "nan", "0"]),
    (MOVING, "strain", ["1e-9", "1"], ["0.99e-9", "1.01"]),
    ("spectrum s.h5 --out o.h5", "window", [0.01, 1.5], [0.0099, 1.51, "nan"]),
    ("correlate s.h5 --out o.h5", "bin", [1e-9], [0.0, -1.0, "inf", "nan"]),
    ("correlate s.h5 --out o.h5", "lane", ["0.01", "1e6", "1,2"], ["0.0099", "1.01e6", "nan", "1,2,1", "1,0.001", "x"]),
    (f"{FIT} --fit phi_J,y,znu", "cut", [1e-9], [0.0, -1.0, "inf", "nan"]),
    (f"{FIT} --fit phi_J,y,znu", "degree", [1, 12], [0, 13]),
    (f"{FIT} --fit phi_J,y,znu", "range", ["0.1:0.2"], ["0.2:0.2", "0:0.2", "0.2:0.1", "0.2", "a:b", "nan:1"]),
    (FIT, "fit", ["phi_J=0,y,znu", "phi_J=2,y,znu", "phi_J,y=-2,znu", "phi_J,y=5,znu=0.2", "phi_J,y,znu=20"],
     ["phi_J=2.01,y,znu", "phi_J=-0.1,y,znu", "phi_J,y=5.1,znu", "phi_J,y=-2.1,znu", "phi_J,y,znu=0.19",
      "phi_J,y,znu=20.1", "phi_J,y,znu=x", "phi_J,y,znu=nan", "phi_J,y", "phi_J,y,znu,omega", "phi_J,y,nu",
      "phi_J,y,znu,y", "phi_J=1,y=1,znu=1", "", "=1,y,znu"]),
    (f"{FIT} --corrections", "fit", ["phi_J,y,znu,omega=0.02", "phi_J,y,znu,omega=5"],
     ["phi_J,y,znu", "phi_J,y,znu,omega=0.019", "phi_J,y,znu,omega=5.1"]),
    (SIZE, "fit", ["phi_J,y,nu"], ["phi_J,y,znu"]),
    (f"{FIT} --fit phi_J,y,znu", "observable", ["pressure", "shear_stress", "jammed"], ["stress"]),
    ("plot c.h5 --out c.png", "mu", [0, 10], [-1, 11]),
    ("trade p.h5 --out t.csv", "ranks", [1, 100_000], [0, 100_001]),
    ("quasistatic p.h5 --out q.h5", "betas", ["1,0.1", "0"], ["x", "1,-1", ""]),
]  # fmt: skip


@pytest.mark.parametrize(("line", "option", "values"), [(a, b, c) for a, b, c, _ in RANGES])
def test_the_ends_of_a_range_belong_to_it(line, option, values):
    for value in values:
        checked(f"{line} --{option}={value}")


@pytest.mark.parametrize(("line", "option", "values"), [(a, b, d) for a, b, _, d in RANGES])
def test_what_lies_beyond_a_range_is_refused(line, option, values):
    for value in values:
        with pytest.raises(InputError) as refused:
            checked(f"{line} --{option}={value}")
        said = str(refused.value)
        assert said.startswith(("--", "argument --", f"{value}", "2000000 samples", "1000001 samples")), said
        assert "\n" not in said and not said.startswith("--out")


def test_lists_of_numbers_are_increasing_and_grids_logarithmic_unless_told_otherwise():
    for text, expected in (
        ("1e-2:1e2:5", [0.01, 0.1, 1, 10, 100]),
        ("lin:1:2:3", [1, 1.5, 2]),
        ("2,1,2", [1, 2]),
    ):
        np.testing.assert_allclose(FREQUENCIES.read(text), expected)


@pytest.mark.parametrize("kind", ["", "lin:"])
@pytest.mark.parametrize("low", [1e-9, 1.0, 3.7])
@pytest.mark.parametrize("ulps", [1, 2, 3, 5, 50])
def test_a_grid_finer_than_rounding_has_no_number_twice(kind, low, ulps):
    """Nor any beyond its ends, and both of these; what is written for it gives it again."""
    high = float(low + ulps * np.spacing(low))
    grid = FREQUENCIES.read(f"{kind}{low!r}:{high!r}:7")
    assert (np.diff(grid) > 0).all() and (grid[0], grid[-1]) == (low, high) and len(grid) <= min(7, ulps + 1)
    np.testing.assert_array_equal(FREQUENCIES.read(format_numbers(grid)), grid)
