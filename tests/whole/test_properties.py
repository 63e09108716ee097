"""What holds for every input, tried on inputs that Hypothesis looks for; what breaks it is made small and printed."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from jampetsc.commands import JOBS, job_class
from jampetsc.errors import InputError
from jampetsc.io.exporters import write_frames
from jampetsc.io.frames import packing_frame
from jampetsc.io.importers import import_packing
from jampetsc.io.packing_file import read_packing, write_packing
from jampetsc.options.parameters import build_job, parameters
from jampetsc.options.values import FREQUENCIES, SEEDS, format_numbers, number_list
from jampetsc.packing.contacts import measure
from jampetsc.packing.neighbours import neighbour_pairs, spatial_order
from jampetsc.packing.packing import Packing
from jampetsc.packing.particles import GRID, join, split
from jampetsc.packing.potentials import EXPONENTS, STIFFNESSES, Potential

settings.register_profile("the same inputs in every run", derandomize=True, deadline=None, database=None)
settings.load_profile("the same inputs in every run")

REAL = st.floats(-1e8, 1e8)


@st.composite
def packings(draw, most=20):
    """Disks anywhere, of sizes within a factor of three, in a cell of any tilt and shape that they fit into."""
    n = draw(st.integers(1, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    width, height = (draw(st.floats(2.0, 9.0)) for _ in "xy")
    tilt = draw(st.one_of(st.just(0.0), st.floats(-3.0, 3.0)))
    cell = np.array([[width, 0.0], [tilt * height, height]])
    kind, stiffness = draw(st.sampled_from(list(EXPONENTS))), draw(st.sampled_from(STIFFNESSES))
    exponent = draw(st.floats(2.0, 4.0)) if kind == "power" else None
    potential = Potential(kind, stiffness, draw(st.floats(1e-3, 1e3)), exponent)
    positions = rng.uniform(-1.0, 2.0, (n, 2)) @ cell
    try:
        return Packing.from_positions(positions, rng.uniform(0.3, 0.9, n), cell, potential)
    except InputError as error:
        assume("would touch its own image" not in str(error))
        raise


def every_pair(disks, skin):
    """{(i, j, image)} of disks closer than their radii and the skin, by trying all pairs and images."""
    reach = 2 * disks.radii.max() + skin + np.abs(np.ptp(disks.positions, axis=0)).max()
    b = math.ceil(reach / disks.cell[1, 1])
    a = math.ceil((reach + b * abs(disks.cell[1, 0])) / disks.cell[0, 0])
    image = np.array([(k, m) for k in range(-a, a + 1) for m in range(-b, b + 1)])
    r = disks.positions[None] - disks.positions[:, None]
    i, j = np.triu_indices(disks.n, 1)
    distance = np.linalg.norm(r[i, j][:, None] + image @ disks.cell, axis=-1)
    pair, which = np.nonzero(distance < (disks.radii[i] + disks.radii[j] + skin)[:, None])
    return {(int(i[p]), int(j[p]), *map(int, image[w])) for p, w in zip(pair, which, strict=True)}


@given(packings(), st.sampled_from([0.0, 0.3, 1.5]))
def test_the_pair_list_holds_every_pair_of_every_image_once(disks, skin):
    i, j, image = neighbour_pairs(disks.positions, disks.radii, disks.cell, skin)
    found = list(zip(i.tolist(), j.tolist(), *image.T.tolist(), strict=True))
    assert len(set(found)) == len(found) and set(found) == every_pair(disks, skin)


@given(st.floats(-(2.0**28), 2.0**28), st.floats(-GRID, GRID))
def test_a_coordinate_is_split_exactly_and_joined_to_the_nearest_double(high, low):
    base, offset = split(high, low)
    assert base / GRID == round(base / GRID) and abs(offset) <= GRID / 2
    exact = Fraction(high) + Fraction(low)
    assert abs(Fraction(float(base)) + Fraction(float(offset)) - exact) <= Fraction(2.0**-53 * GRID)
    nearest, rest = join(base, offset)
    assert nearest == float(Fraction(float(base)) + Fraction(float(offset)))
    assert Fraction(float(nearest)) + Fraction(float(rest)) == Fraction(float(base)) + Fraction(float(offset))


def same(a, b, tolerance=1e-9):
    """Whether p, σ, U, Z and who rattles agree, to rounding of forces of order k."""
    scale = a.potential.k
    assert a.pressure == pytest.approx(b.pressure, rel=tolerance, abs=tolerance * scale)
    assert np.abs(a.stress - b.stress).max() <= tolerance * max(scale, np.abs(a.stress).max())
    assert measure(a).energy == pytest.approx(measure(b).energy, rel=tolerance, abs=tolerance * scale)
    assert len(a.contacts()) == len(b.contacts())


def in_doubt(disks):
    """Whether rounding may open or close a contact: a pair just touching."""
    contacts = disks.contacts()
    return len(contacts) and contacts.overlap.min() < 1e-9


@given(packings(), st.tuples(REAL, REAL), st.integers(0, 2**32))
def test_a_packing_is_the_same_in_another_order_and_place_and_cell(disks, shift, seed):
    """Permutation of disks, translation, whole cell vectors, and the cell of least tilt."""
    assume(not in_doubt(disks))
    rng = np.random.default_rng(seed)
    order = rng.permutation(disks.n)
    same(disks, disks.reordered(order), 1e-12)
    assert (disks.reordered(order).rattlers == disks.rattlers[order]).all()
    same(disks, disks.folded())
    place = disks.positions + np.remainder(shift, 1e3) + rng.integers(-3, 4, (disks.n, 2)) @ disks.cell
    same(disks, Packing.from_positions(place, disks.radii, disks.cell, disks.potential))
    assert sorted(spatial_order(place, disks.cell)) == list(range(disks.n))


@given(packings(), st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_units_of_length_and_force_change_no_number_without_units(disks, length, force):
    """p has k δ^(α−1)/length, with δ in units of length or of σ (Vågberg, eq. 4.7)."""
    assume(not in_doubt(disks))
    stiffness, k, exponent = disks.potential.stiffness, disks.potential.k, disks.potential.exponent
    power = exponent - 2.0 if stiffness == "constant" else -2.0
    other = Potential(stiffness=stiffness, k=k * force / length**power, exponent=exponent)
    scaled = Packing.from_positions(
        length * disks.positions, length * disks.radii, length * disks.cell, other
    )
    assert scaled.coordination == disks.coordination and (scaled.rattlers == disks.rattlers).all()
    assert scaled.phi == pytest.approx(disks.phi, rel=1e-12)
    assert scaled.pressure == pytest.approx(force * disks.pressure, rel=1e-6, abs=1e-9 * k * force)
    energy = force * length**2 * measure(disks).energy
    assert measure(scaled).energy == pytest.approx(energy, rel=1e-6, abs=1e-9)


@settings(max_examples=25)
@given(packings())
def test_a_packing_comes_back_from_its_file_to_the_last_bit(tmp_path_factory, disks):
    path = tmp_path_factory.mktemp("file") / "packing.h5"
    write_packing(path, disks)
    back = read_packing(path)
    assert back.fingerprint == disks.fingerprint and back.potential == disks.potential


LISTS = st.text(alphabet="0123456789.,:-+einlaf x", max_size=20)


@given(LISTS)
@example("lin:1:2:3")
@example("1:nan:3")
@example("1e-400:1:5")
def test_what_is_written_for_a_list_is_read_or_refused(text):
    for read in (FREQUENCIES.read, SEEDS.read, number_list(-10, 10, even=True).read):
        try:
            assert len(read(text))
        except ValueError as error:
            assert "\n" not in str(error)


@given(st.lists(st.floats(1e-12, 1e12), min_size=1, max_size=6, unique=True), st.booleans())
def test_a_list_that_is_told_is_read_as_the_same_numbers(values, as_grid):
    values = np.sort(values)
    if as_grid and len(values) > 1:
        values = np.geomspace(values[0], values[-1], 7)
    read = number_list(0, 1e13).read
    assert np.array_equal(read(format_numbers(values)), np.unique(values))
    assert np.array_equal(
        number_list(0, 1e13, even=True).read(format_numbers(values, even=True)), np.unique(values)
    )


VALUES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
VALUES |= st.lists(st.floats(), max_size=3) | st.sampled_from([10**400, -(10**400), [10**400], f"0:{10**30}"])


@pytest.mark.parametrize("name", JOBS)
@settings(max_examples=30)
@given(data=st.data())
def test_whatever_is_asked_of_a_job_is_taken_or_refused_by_name(name, data):
    job = job_class(name)
    known = sorted(parameters(job))
    asked = data.draw(st.dictionaries(st.sampled_from(known), VALUES, max_size=3))
    try:
        build_job(job, asked)
    except InputError as error:
        assert "\n" not in str(error)


@settings(max_examples=40)
@given(st.sampled_from(["xyz", "dump", "data", "npz"]), packings(most=6), st.data())
def test_a_damaged_file_of_another_program_is_read_or_refused(tmp_path_factory, kind, disks, data):
    """Bytes of what `export` writes are changed, left out or repeated."""
    path = tmp_path_factory.mktemp("file") / f"packing.{kind}"
    write_frames(path, [packing_frame(disks)])
    content = path.read_bytes()
    first = data.draw(st.integers(0, len(content)))
    last = data.draw(st.integers(first, min(len(content), first + 40)))
    path.write_bytes(content[:first] + data.draw(st.binary(max_size=6)) + content[last:])
    try:
        assert import_packing(path).n >= 1
    except InputError as error:
        assert str(path) in str(error) and "\n" not in str(error)
