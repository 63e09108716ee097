"""Laws of sizes: their moments, one form for all ways to write them, and what is refused."""

import numpy as np
import pytest

from jampetsc.commands.flow import Flow
from jampetsc.commands.jam import Jam
from jampetsc.commands.pack import Pack
from jampetsc.commands.shear import Shear
from jampetsc.errors import InputError
from jampetsc.minimisation.size_laws import is_law, radii_of, read_sizes
from jampetsc.studies.plan import plan


def power_moment(exponent, ratio, order):
    """⟨ρ^order⟩ of n(ρ) ~ ρ^(−exponent) from 1 to `ratio`, by Simpson's rule in ln ρ."""
    x = np.linspace(0.0, np.log(ratio), 20_001)
    weight = np.r_[1.0, np.tile([4.0, 2.0], 9999), 4.0, 1.0]
    density = weight * np.exp((1.0 - exponent) * x)
    return np.sum(density * np.exp(order * x)) / np.sum(density)


def moments(sizes):
    """⟨ρ²⟩/⟨ρ⟩² and ⟨ρ³⟩/⟨ρ⟩³ from the definition of a law."""
    name, *numbers = sizes.split(":")
    a, b = (*map(float, numbers), 0.0, 0.0)[:2]
    if name == "bidisperse":
        raw = [1.0 - b + b * a**order for order in (1, 2, 3)]
    elif name == "lognormal":
        raw = [np.exp(0.5 * (order * a) ** 2) for order in (1, 2, 3)]
    elif name == "uniform":
        raw = [(b ** (order + 1) - a ** (order + 1)) / ((order + 1) * (b - a)) for order in (1, 2, 3)]
    else:
        raw = [power_moment(a, b, order) for order in (1, 2, 3)]
    return raw[1] / raw[0] ** 2, raw[2] / raw[0] ** 3


@pytest.mark.parametrize(
    "sizes",
    [
        "bidisperse:1.4:0.5",
        "bidisperse:3:0.2",
        "lognormal:0.2",
        "lognormal:0.7",
        "uniform:1:3",
        "uniform:0.02:1.9",
        "powerlaw:3:10",
        "powerlaw:1:100",
        "powerlaw:-2:4",
        "powerlaw:2.5:100",
    ],
)
def test_moments_are_those_of_the_law(sizes):
    """Closer with more particles; the mean diameter is 1 for any number of them."""
    errors = []
    for n in (1000, 30_000):
        radii = radii_of(sizes, n)
        assert 2.0 * radii.mean() == pytest.approx(1.0, rel=1e-12) and radii.min() > 0.0
        found = np.mean(radii**2) / np.mean(radii) ** 2, np.mean(radii**3) / np.mean(radii) ** 3
        errors.append(np.abs(np.array(found) / moments(sizes) - 1.0).max())
    assert errors[1] < 0.02 and errors[1] <= errors[0] + 1e-12


def test_two_sizes_and_one_are_as_always():
    """Half 0.5/1.2 and half 0.7/1.2 in turn, to the last bit."""
    for n in (16, 33):
        in_turn = np.where(np.arange(n) % 2 == 0, 1.0 / 2.4, 1.4 * (1.0 / 2.4))
        for sizes in ("bidisperse", "bidisperse:1.4", "bidisperse:1.4:0.5"):
            assert np.array_equal(radii_of(sizes, n), in_turn)
        assert np.array_equal(radii_of("monodisperse", n), np.full(n, 0.5))


@pytest.mark.parametrize(("share", "large"), [(0.29, 29), (0.3, 30), (0.01, 1), (0.99, 99)])
def test_the_share_is_that_of_the_large_ones(share, large):
    radii = radii_of(f"bidisperse:5:{share}", 100)
    assert np.count_nonzero(radii > radii.min()) == large
    assert radii.max() == pytest.approx(5.0 * radii.min())


def test_a_law_has_one_text():
    for written, text in (
        ("bidisperse:1.4:0.5", "bidisperse"),
        ("bidisperse:2.0:0.50", "bidisperse:2"),
        ("lognormal:2e-1", "lognormal:0.2"),
        ("bidisperse:1.4:0.3", "bidisperse:1.4:0.3"),
        ("uniform:1:3.0", "uniform:1:3"),
        ("powerlaw:3:10", "powerlaw:3:10"),
    ):
        assert read_sizes(written) == read_sizes(text) == text and is_law(text)
        assert np.array_equal(radii_of(written, 40), radii_of(text, 40))
    assert not is_law("radii of r.txt") and not is_law(None)


JOBS = (
    (Pack, {"pressure": 1e-2}),
    (Jam, {"phi": 0.84, "seeds": "1:2"}),
    (Shear, {"phi": 0.84, "step": 0.01, "strain": 0.1}),
    (Flow, {"phi": 0.84, "model": "RD0", "rate": 0.01, "strain": 0.1}),
)


@pytest.mark.parametrize(
    ("sizes", "said"),
    [
        ("lognormal", "SIGMA is missing. Write lognormal:SIGMA."),
        ("lognormal:2", "SIGMA must lie in [0, 1]"),
        ("lognormal:x", "SIGMA must be a number, not 'x'. Write lognormal:SIGMA."),
        ("lognormal:nan", "SIGMA must lie in"),
        ("lognormal:1:2", "too many numbers (2, at most 1). Write lognormal:SIGMA."),
        ("uniform:0:1", "LOW must lie in"),
        ("uniform:3:1", "HIGH must lie in [LOW, 100 LOW]"),
        ("uniform:1:101", "HIGH"),
        ("powerlaw:3", "RATIO is missing. Write powerlaw:EXPONENT:RATIO."),
        ("powerlaw:3:101", "RATIO must lie in [1, 100]"),
        ("bidisperse:0.5", "RATIO must lie in [1, 100]"),
        ("bidisperse:", "RATIO must be a number, not ''."),
        ("bidisperse:2:1.5", "SHARE must lie in [0, 1]"),
        ("monodisperse:1", "too many numbers (1, at most 0)."),
        (
            "bidisperse:2:0.01",
            "all 16 particles would be small. Give a SHARE nearer to 0.5, or more particles.",
        ),
        ("bidisperse:2:1", "all 16 particles would be large."),
        ("", "not supported. Choose one of bidisperse[:RATIO[:SHARE]]"),
        (
            "gamma:2",
            "not supported. Choose one of bidisperse[:RATIO[:SHARE]], monodisperse, lognormal:SIGMA, ",
        ),
    ],
)
def test_what_is_no_law_is_refused_everywhere(sizes, said):
    for job, given in JOBS:
        with pytest.raises(InputError) as raised:
            job(n=16, sizes=sizes, **given)
        assert str(raised.value).startswith(f"sizes {sizes or repr(sizes)}: {said}") and "\n" not in str(
            raised.value
        )


def test_a_study_varies_sizes():
    text = (
        '[pack]\nn = 16\npressure = 1e-2\nsizes = ["lognormal:0.2", "powerlaw:3:10", "bidisperse:2:0.25"]\n'
    )
    tasks = plan("s.toml", text.encode())
    assert {task.columns["sizes"] for task in tasks} == {
        "lognormal:0.2",
        "powerlaw:3:10",
        "bidisperse:2:0.25",
    }


@pytest.mark.parametrize("rise", [1e-3, 1e-9, 1e-13, 1e-17])
def test_a_power_law_near_the_exponent_one_has_all_its_digits(rise):
    """n(ρ) ~ 1/ρ has ln ρ uniform; exponents next to 1 tend to it without loss of digits."""
    near, one = (radii_of(f"powerlaw:{exponent!r}:3", 64) for exponent in (1.0 - rise, 1.0))
    np.testing.assert_allclose(near, one, rtol=rise + 1e-14)
