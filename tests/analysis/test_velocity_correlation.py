"""g_y(x) of snapshots against every pair and every image, and through the command."""

import numpy as np
import pytest
from samples import stored

import jampetsc
from jampetsc import main as cli
from jampetsc.analysis.velocity_correlation import lane_products
from jampetsc.io.disk_motion import correlate_lanes


def every_pair(positions, cell, v, lane, bins):
    """The same sums by trying all pairs and images."""
    products, pairs = np.zeros(len(bins) - 1), np.zeros(len(bins) - 1)
    for i in range(len(v)):
        for j in range(i):
            for up in range(-3, 4):
                r = positions[j] - positions[i] + up * cell[1]
                if abs(r[1]) < lane:
                    x = abs(r[0] - cell[0, 0] * np.round(r[0] / cell[0, 0]))
                    row = np.searchsorted(bins, x, side="right") - 1
                    if 0 <= row < len(pairs):
                        products[row] += v[i] * v[j]
                        pairs[row] += 1
    return products, pairs


@pytest.mark.parametrize("tilt", [0.0, 0.4, -0.45])
@pytest.mark.parametrize("lane", [0.3, 1.7])
def test_sums_are_those_of_every_pair(tilt, lane):
    rng = np.random.default_rng(3)
    cell = np.array([[11.0, 0.0], [tilt * 8.0, 8.0]])
    positions = rng.uniform(-1, 2, (70, 2)) @ cell
    v, bins = rng.normal(size=70), np.arange(6.0)
    for found, wanted in zip(
        lane_products(positions, cell, v, lane, bins), every_pair(positions, cell, v, lane, bins), strict=True
    ):
        assert np.allclose(found, wanted, atol=1e-12)


def test_every_number_of_the_file_is_of_the_words(tmp_path, capsys):
    """A file of three snapshots, correlated as told: width, bin, means over the rate squared."""
    rng = np.random.default_rng(4)
    cell = np.array([[12.0, 0.0], [1.0, 10.0]])
    snapshots = {"positions": rng.random((3, 60, 2)) @ cell, "velocities": rng.normal(size=(3, 60, 2))}
    arrays = {f"snapshots/{name}": values for name, values in snapshots.items()}
    arrays |= {"snapshots/cell": np.tile(cell, (3, 1, 1)), "state/radii": np.full(60, 0.25)}
    arrays["snapshots/radii"] = arrays["state/radii"]
    facts = {"model": "CD", "rate": 0.5, "mass": 2.0, "units": "those of the packing"}
    result = jampetsc.load(
        stored(tmp_path / "f.h5", "flow", arrays, **facts, phi=0.8, particle_count=60, seed=1)
    )
    for words, lane, width in (
        ([], 1.0, 1.0),
        (["--lane", "1.5", "--bin", "0.75", "--overwrite"], 1.5, 0.75),
    ):
        assert cli.main(["correlate", str(tmp_path / "f.h5"), *words, "--out", str(tmp_path / "g.h5")]) == 0
        exact = correlate_lanes([result], lane, width)
        found = jampetsc.load(tmp_path / "g.h5")
        arrays = {"x": exact.centres, "g_y": exact.values, "g_y_error": exact.errors, "pairs": exact.pairs}
        for name, values in arrays.items():
            np.testing.assert_array_equal(found[name], values)
        place, depth = exact.minimum
        expected = {"lane_width": 0.5 * lane, "bin_width": 0.5 * width, "mean_diameter": 0.5, "snapshots": 3}
        expected |= {"mean_square": exact.mean_square, "minimum": depth, "minimum_at": place, **facts}
        assert {name: found.attributes[name] for name in expected} == expected
        v, places = result["snapshots/velocities"][..., 1], result["snapshots/positions"]
        sums = [lane_products(x, cell, u, 0.25 * lane, exact.edges) for x, u in zip(places, v, strict=True)]
        products, pairs = np.sum(sums, axis=0)
        np.testing.assert_allclose(exact.values, products / pairs / np.mean(v**2), rtol=1e-12)
        assert exact.mean_square == pytest.approx(np.mean(result["snapshots/velocities"][..., 1] ** 2) / 0.25)
        assert capsys.readouterr().out == (
            f"{tmp_path}/g.h5: g_y of 3 snapshots, lanes of {lane:g} d: least {depth:.3g} at x = {place / 0.5:.3g} d, "
            f"<u_y^2>/rate^2 = {exact.mean_square:.3g}\n"
        )
    bare = stored(tmp_path / "bare.h5", "flow", {}, **facts)
    for words, message in (
        ([bare], "no snapshots. Run the flow"),
        ([bare, "--out", bare], "the input, which would be lost"),
    ):
        assert cli.main(["correlate", "--out", str(tmp_path / "bad.h5"), *map(str, words)]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "bad.h5").exists()


def test_a_lane_ends_where_it_is_as_wide():
    """Pairs closer than the lane alone; one exactly as far is left out."""
    positions, bins = np.array([[0.0, 0.0], [0.25, 0.5], [0.5, 1.25]]), np.array([0.0, 0.5, 1.0])
    for lane, pairs in ((0.5, 0), (0.75, 1), (0.76, 2), (1.3, 3)):
        assert lane_products(positions, np.diag([4.0, 4.0]), np.ones(3), lane, bins)[1].sum() == pairs


def test_lanes_of_spheres_are_narrow_along_z_too():
    """Against all pairs and images in a sheared cell."""
    rng, n, half, edges = np.random.default_rng(3), 30, 0.8, np.array([0.0, 1.0, 2.0, 3.0])
    cell = np.array([[6.0, 0.0, 0.0], [1.3, 5.0, 0.0], [0.0, 0.0, 4.0]])
    x, v = rng.uniform(-2.0, 3.0, (n, 3)) @ cell, rng.normal(size=n)
    turns = np.stack(np.meshgrid(*[np.arange(-7, 8)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) @ cell
    products, pairs = np.zeros(3), np.zeros(3)
    for i in range(n):
        for j in range(i + 1, n):
            across = x[j] - x[i] + turns
            near = across[(np.abs(across[:, 1:]) < half).all(axis=1) & (np.abs(across[:, 0]) <= 3.0)]
            counts = np.histogram(np.abs(near[:, 0]), edges)[0]
            pairs += counts
            products += counts * v[i] * v[j]
    found = lane_products(x, cell, v, half, edges)
    assert np.array_equal(found[1], pairs) and pairs.sum() > 50
    np.testing.assert_allclose(found[0], products, atol=1e-12)
