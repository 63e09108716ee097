"""The range of every number on the command line: its ends belong to it or not, and what lies beyond is refused."""

import functools

import numpy as np
import pytest
from jampetsc.words.flowing import OWN_UNITS, UNITS, model_from, start_of

from jampetsc import cli, commands
from jampetsc.commands import jam
from jampetsc.errors import InputError
from jampetsc.words.frequencies import parse_omega


@functools.cache
def parser(command):
    return commands.parsers_of(cli.Parser, [command])[command]


def checked(line):
    """What the command's check makes of a command line."""
    command, *words = line.split()
    args = parser(command).parse_args(words)
    return args.check(args)


PACK = "pack --n 16 --out p.h5 --pressure 1e-2"
PHI = "pack --n 16 --out p.h5"
SWEEP = "sweep p.h5 --out s.h5"
MODES = "modes p.h5 --out m.h5"
FLOW = "flow --n 16 --model RD0 --rate 1e-2 --strain 0.5 --phi 0.8"
MASSIVE = "flow --n 16 --model RD --rate 1e-2 --strain 0.5 --phi 0.8"
LAW = "flow --n 16 --law contact --mass 1 --rate 1e-2 --strain 0.5 --phi 0.8"
SHEAR = "shear --n 16 --phi 0.8 --out s.h5"
JAM = "jam --n 16 --out j.h5 --seeds 1:2"
QS = f"{JAM} --phi 0.84 --protocol shear"
COOL = f"{JAM} --phi 0.84 --protocol compress"
OSC = "oscillate p.h5 --out o.h5 --omega 1"
MOVING = f"{OSC} --contacts moving"
FIT = "collapse f.h5 --out c.h5 --observable pressure"
SIZE = f"{FIT} --finite-size"
LAST = 2**63 - 1

RANGES = [  # (line, option, values within, values beyond)
    (PACK, "tolerance", [1e-13, 1e-4], [0.99e-13, 1.01e-4, "nan"]),
    (PACK, "threads", [1, 256], [0, 257]),
    (PACK, "seed", [0, LAST], [-1, LAST + 1]),
    (f"{PACK} --out p{{seed}}.h5", "seeds", ["0:0", "3:4"], ["1:0", "1:1000001", "-1:3", "1", "a:b"]),
    (PHI, "phi", [0.8, 1.5], [0.79, 1.51, "nan"]),
    (PHI, "pressure", ["1e-8", "1"], ["0.99e-8", "1.01", "nan", "inf"]),
    ("pack --pressure 1e-2 --out p.h5", "n", [16], [15, 10_000_001]),
    (SWEEP, "accuracy", [1e-12, 0.1], [0.99e-12, 0.11, "nan"]),
    (f"{SWEEP} --stress 1e-5", "alpha", [0.05, 5.0], [0.049, 5.01, "nan"]),
    (f"{SWEEP} --alpha 0.5", "stress", [1e-30, 1.0], [0.99e-30, 1.01, "nan"]),
    (MODES, "count", [1], [0, -1]),
    (MODES, "below", [1.01e-12, 5.0], [1e-12, 0.0, -1.0, "inf", "nan"]),
    ("flow --n 16 --model RD0 --strain 0.5 --phi 0.8", "rate", [1e-9, 1.0], [0.0, 1.01, -0.1, "nan", "inf"]),
    ("flow --n 16 --model RD0 --rate 1e-2 --phi 0.8", "strain", [1e-9], [0.0, -1.0, "nan", "inf"]),
    (FLOW, "step", [1e-9], [0.0, "nan", "inf"]),
    (FLOW, "tolerance", [1e-14, 0.1], [0.99e-14, 0.11, 0.0, "nan"]),
    (FLOW, "discard", [0.0, 0.499], [0.5, -0.01, "nan"]),
    (FLOW, "snapshots", [0, 1], [-1]),
    (FLOW, "seed", [0, LAST], [-1, LAST + 1]),
    ("flow --n 16 --model RD0 --rate 1e-2 --strain 0.5", "phi", [0.1, 1.0], [0.099, 1.01, "nan"]),
    (MASSIVE, "mass", [1e-9], [0.0, -1.0, "nan", "inf"]),
    (MASSIVE, "quality", [1e-9], [0.0, -1.0, "nan", "inf"]),
    (SHEAR + " --strain 1", "step", [1e-8, 0.1], [0.0, 0.101, -0.1, "nan"]),
    (SHEAR + " --step 0.01", "strain", [0.01, 1e4], [0.0099, 1.01e4, "nan"]),
    (SHEAR + " --strain 100", "step", [1e-6], [0.99e-6]),
    (SHEAR + " --step 0.01 --strain 1", "discard", [0.0, 0.99], [1.0, -0.01, "nan"]),
    (SHEAR + " --step 0.01 --strain 1", "tolerance", [1e-13, 1e-2], [0.99e-13, 1.01e-2, "nan"]),
    (SHEAR + " --step 0.01 --strain 1", "seed", [0, LAST], [-1, LAST + 1]),
    ("jam --out j.h5 --seeds 1:2 --phi 0.8", "n", [16], [15, 10_000_001]),
    (f"{JAM} --phi 0.8", "tolerance", [1e-13, 1e-2], [0.99e-13, 1.01e-2, "nan"]),
    (JAM, "phi", ["0.1", "1.0", "0.8:0.9:1", "0.1:1:3", "0.8,0.8"],
     ["0.099", "1.01", "nan", "0.8:0.9:0", "0.8:0.9", "a"]),
    ("jam --n 16 --out j.h5 --phi 0.8", "seeds", ["0:0", f"{LAST}:{LAST}", "1:200000"],
     ["2:1", "-1:2", "1:1000001", f"0:{LAST + 1}", "3"]),
    (f"{QS} --every 0.1 --strain 0.3 --discard 0.1", "step", [1e-8, 0.1], [0.99e-8, 0.11]),
    (f"{QS} --step 0.01", "every", [0.01, 1.0], [0.0099, 1.01]),  # more than a step, and a sample before the strain
    (f"{QS} --step 0.01 --every 0.5", "strain", [1.5, 1e4], [1.49, 1.01e4]),
    (f"{QS} --strain 1e4 --step 0.01 --every 100", "discard", [0.0, 9900.0], [-0.01, 9901.0]),
    (COOL, "temperature", [1e-8, 10.0], [0.99e-8, 10.1]),
    (COOL, "cooling-rate", [1e-6, 10.0], [0.99e-6, 10.1]),
    (COOL, "sweeps", [0, 10_000_000], [-1, 10_000_001]),
    (f"{OSC} --strain 1e-6", "alpha", [1e-9, 2.0], [0.0, -0.1, 2.01, "nan"]),
    (f"{OSC} --strain 1e-6", "steps", [16, 24, 4096], [8, 20, 4104, 0, -16]),
    (f"{MOVING} --strain 1e-6", "cycles", ["auto", 3, 100_000], [2, 100_001, "few", 3.5, -3]),
    (OSC, "strain", ["1e-30", "1", "1e-3,1e-6"], ["0.99e-30", "1.01", "nan", "1e-3,2", "a"]),
    (OSC, "stress", ["1e-30", "1"], ["0.99e-30", "1.01", "nan", "0"]),
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


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("1e-16", 1), ("1e12", 1), ("1,2,1", 2), ("1e-2:1e2:2", 2), ("1e-2:1e2:100000", 100_000),
    ],
)  # fmt: skip
def test_frequencies(text, count):
    omega = parse_omega(text)
    assert len(omega) == count and (np.diff(omega) > 0).all()


@pytest.mark.parametrize(
    "text",
    [
        "1:1:5",
        "0.99e-16",
        "1.01e12",
        "1e-17:1:5",
        "1:1e13:5",
        "2:1:5",
        "1:2:1",
        "1:2:100001",
        "1:2:0",
        "nan",
        "1,inf",
        "0",
        "-1",
        "1:2",
        "",
    ],
)
def test_what_is_no_frequency(text):
    with pytest.raises(InputError, match=rf"^--fields {text}: "):
        parse_omega(text, "--fields")


def test_a_grid_of_frequencies_is_logarithmic():
    np.testing.assert_allclose(parse_omega("1e-2:1e2:5"), [0.01, 0.1, 1, 10, 100])


def test_samples_of_one_file_are_counted_with_their_rows(monkeypatch):
    monkeypatch.setattr(jam, "MANY", 6)
    checked("jam --n 16 --out j.h5 --phi 0.8,0.9 --seeds 1:3")
    checked("jam --n 16 --out j.h5 --phi 0.8 --seeds 1:2 --protocol shear --strain 1.06")
    for words in (
        "--phi 0.8 --seeds 1:7",
        "--phi 0.8:0.9:4 --seeds 1:2",
        "--phi 0.8 --seeds 1:2 --protocol shear",
    ):
        with pytest.raises(InputError, match="samples: at most 6 in one file"):
            checked(f"jam --n 16 --out j.h5 {words}")


# Words that do not go together


TOGETHER = [
    (f"{SWEEP} --stress 1e-3", "--stress 0.001: belongs to power-law damping: give --alpha too"),
    (f"{SWEEP} --alpha 0.5", "--alpha 0.5: power-law damping depends on the amplitude: give --stress"),
    (f"{SWEEP} --alpha 0.5 --stress 1e-3 --law stokes", "--alpha 0.5: belongs to --law contact"),
    (f"{SWEEP} --parallel matrix --method direct", "--parallel matrix: belongs to --method rational"),
    ("quasistatic p.h5 --out q.h5 --law stokes --betas 1", "--betas 1: belongs to --law contact"),
    (f"{OSC} --strain 1e-6 --cycles 5", "--cycles: belongs to --contacts moving"),
    (
        f"{MOVING} --strain 1e-6 --no-prestress",
        "--no-prestress: contacts that open and close have their forces",
    ),
    (
        f"{OSC} --strain 1e-6 --law stokes",
        "--law stokes: no contact dissipates; oscillate takes --law contact",
    ),
    (f"{OSC} --strain 1 --alpha 0", "--alpha 0: must be above 0, which would be dry friction"),
    ("flow --n 16 --model RD0 --strain 1 --phi 0.8", "--rate is missing: how fast to shear?"),
    ("flow --n 16 --model RD0 --strain 1 --rate 1e-2", "--phi is missing: give --n and --phi"),
    ("flow --phi 0.8 --model RD0 --strain 1 --rate 1e-2", "--n is missing: give --n and --phi"),
    ("flow --n 16 --phi 0.8 --strain 1 --rate 1e-2", "--model is missing: "),
    (f"{FLOW} --law contact", "--model RD0 and --law: give one of them"),
    (f"{FLOW} --beta 0.5", "--model RD0 and --beta: give one of them"),
    (f"{FLOW} --eta-f 0.5", "--model RD0 and --eta-f: give one of them"),
    (f"{FLOW} --mass 1", "--model RD0: is overdamped; leave --mass out, or take RD"),
    (f"{FLOW} --quality 1", "--model RD0: is overdamped; leave --mass out, or take RD"),
    (MASSIVE, "--model RD: give its --mass, or --quality"),
    (f"{MASSIVE} --mass 1 --quality 1", "--quality 1: --mass says the same; leave one out"),
    (f"{MASSIVE} --mass 0", "--mass 0: must be positive; the overdamped limit is --model RD0"),
    (f"{LAW.replace('--mass 1', '--mass 0')}", "--mass 0: must be positive"),
    ("flow p.h5 --model RD0 --rate 1e-2 --strain 1 --n 16", "--n: belongs to p.h5; leave it out"),
    ("flow p.h5 --model RD0 --rate 1e-2 --strain 1 --walls", "--walls: belongs to p.h5; leave it out"),
    ("shear p.h5 --step 1e-2 --strain 1 --out s.h5 --seed 1", "--seed: belongs to p.h5; leave it out"),
    (f"{JAM} --phi 0.84 --step 1e-2", "--step 0.01: belongs to --protocol shear, not random; leave it out"),
    (f"{QS} --temperature 1", "--temperature 1: belongs to --protocol compress, not shear; leave it out"),
    (f"{QS} --step 0.05", "--every 0.02: must be a --step of 0.05 or more"),
    (f"{QS} --strain 1.01", "--strain 1.01: no sample before it: --discard 1, then --every 0.02"),
]


@pytest.mark.parametrize(("line", "message"), TOGETHER)
def test_words_that_do_not_go_together(line, message):
    with pytest.raises(InputError) as refused:
        checked(line)
    assert str(refused.value).startswith(message)


@pytest.mark.parametrize("name", ["mass", "quality", "friction", "tau1"])
def test_numbers_of_a_flow_that_no_computer_can_follow(name):
    line = MASSIVE if name in ("mass", "quality") else LAW
    checked(f"{line} --{name} 1e12")
    for value in ("1.01e12", "1e300"):
        with pytest.raises(InputError, match=f"^--{name} .*: must be at most 1e.12$"):
            checked(f"{line} --{name} {value}")


def test_a_quality_is_a_mass_in_units_of_k_and_tau1():
    line = "flow --n 16 --phi 0.8 --model RD --rate 1e-2 --strain 1 --quality 3 --tau1 0.5"
    args = parser("flow").parse_args(line.split()[1:])
    assert model_from(args, k=7.0).mass == pytest.approx(3.0**2 * 7.0 * 0.5**2)


def test_a_start_that_is_no_file_has_disks_of_its_own(tmp_path):
    """The smallest diameter is 1, unless radii are given; a seed that is not told is 1."""
    words = "flow --phi 0.7 --model RD0 --rate 1e-2 --strain 1".split()

    def start(*more):
        return start_of(parser("flow").parse_args([*words[1:], *more]))

    disks, origin = start("--n", "16")
    assert (origin["seed"], origin["sizes"], origin["units"]) == (1, "bidisperse", UNITS)
    assert disks.radii.min() == 0.5 and disks.potential.kind == "harmonic" and disks.phi == pytest.approx(0.7)
    assert np.array_equal(start("--n", "16", "--seed", "1")[0].positions, disks.positions)
    other, origin = start("--n", "16", "--seed", "2", "--potential", "hertzian")
    assert origin["seed"] == 2 and other.potential.kind == "hertzian"
    assert not np.allclose(other.positions, disks.positions)
    (tmp_path / "r.txt").write_text("3\n" * 16)
    own, origin = start("--radii", str(tmp_path / "r.txt"))
    assert own.radii.tolist() == [3.0] * 16
    assert (origin["sizes"], origin["units"]) == ("radii of r.txt", OWN_UNITS)
