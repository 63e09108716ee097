"""Vectors, positions and axes in a plane and in space: whatever takes them, against plain numpy."""

import numpy as np
import pytest
from dense import all_pairs
from samples import stored

import jampetsc
from jampetsc.analysis.statistics import Distribution
from jampetsc.flows.step_kernels import drift, move
from jampetsc.io.frames import packing_frame
from jampetsc.io.hdf5 import open_file
from jampetsc.laws.forms import CENTRAL_FORMS
from jampetsc.laws.loads import simple_shear
from jampetsc.laws.relative_motion import linear_forms, load_coefficients, transverse_axes
from jampetsc.minimisation.warm_start import without_drift
from jampetsc.packing.contacts import (
    assigned_volumes,
    disk_stresses,
    find_contacts,
    imbalance,
    measure,
    net_forces,
    stress_tensor,
)
from jampetsc.packing.neighbours import fractional, lengths, squared_length, vectors
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network
from jampetsc.plots.cell_drawing import wrap
from papers.claims.motion import rms_length
from papers.keep import slim
from papers.tables import layers, precision

BALL = {2: np.pi, 3: 4 * np.pi / 3}


def vectors_like(packing, seed=1):
    """Random vectors (N, D), of which the last component is as large as the first."""
    return np.random.default_rng(seed).normal(size=packing.positions.shape)


def unbalanced(packing):
    """The packing with forces that are not balanced."""
    places = packing.positions + 1e-4 * vectors_like(packing)
    return Packing.from_positions(places, packing.radii, packing.cell, packing.potential)


def summary(values):
    """(median, mean, rms) of the lengths of vectors (M, D), or of numbers (M,)."""
    size = np.linalg.norm(values, axis=1) if values.ndim == 2 else np.abs(values)
    return np.median(size), np.mean(size), np.sqrt(np.mean(size**2))


def test_lengths_and_their_distribution(jammed):
    v = vectors_like(jammed)
    size = np.linalg.norm(v, axis=1)
    np.testing.assert_allclose(lengths(v), size, rtol=1e-14)
    np.testing.assert_allclose(squared_length(v.T), size**2, rtol=1e-14)
    of = Distribution.of(v)
    np.testing.assert_allclose((of.median, of.mean, of.rms), summary(v), rtol=1e-14)
    np.testing.assert_array_equal(of.counts, np.histogram(size, of.edges)[0])
    assert rms_length(1j * v) == pytest.approx(of.rms, rel=1e-14)


def test_places_in_the_cell(jammed):
    cell, x = jammed.cell, jammed.positions + 5.0 * vectors_like(jammed)
    shares = fractional(x, cell)
    np.testing.assert_allclose(shares @ cell, x, atol=1e-12)
    turns = np.floor(shares).astype(int)
    np.testing.assert_allclose(vectors(turns, cell), turns @ cell, atol=1e-12)
    np.testing.assert_allclose(wrap(x, cell), x - turns @ cell, atol=1e-12)
    assert jammed.volume == pytest.approx(abs(np.linalg.det(cell)), rel=1e-14)
    assert jammed.phi == pytest.approx(
        BALL[jammed.dimension] * np.sum(jammed.radii**jammed.dimension) / jammed.volume, rel=1e-14
    )


def test_contacts_forces_and_stresses(jammed):
    packing = unbalanced(jammed)
    D, c = packing.dimension, find_contacts(packing)
    pairs = all_pairs(packing.positions, packing.radii, packing.cell)
    i, j, r = (np.array(part) for part in pairs)
    r = r.astype(float)
    distance = np.linalg.norm(r, axis=1)
    np.testing.assert_allclose(np.sort(c.distance), np.sort(distance), rtol=1e-12)
    sigma = packing.radii[i] + packing.radii[j]
    pull = (packing.potential.force(sigma - distance, sigma) / distance)[:, None] * r
    forces, stresses = np.zeros((packing.n, D)), np.zeros((packing.n, D, D))
    volumes = packing.volume * packing.radii**D / np.sum(packing.radii**D)
    for a, b, f, bond in zip(i, j, pull, r, strict=True):
        forces[b] += f
        forces[a] -= f
        for end in (a, b):
            stresses[end] -= np.outer(f, bond) / (2 * volumes[end])
    np.testing.assert_allclose(net_forces(packing.n, c), forces, atol=1e-13)
    np.testing.assert_allclose(assigned_volumes(packing), volumes, rtol=1e-14)
    np.testing.assert_allclose(disk_stresses(packing, c), stresses, atol=1e-13)
    stress = -np.einsum("ca,cb->ab", pull, r) / packing.volume
    np.testing.assert_allclose(stress_tensor(c, packing.volume), stress, atol=1e-14)
    state = measure(packing)
    assert state.pressure == pytest.approx(-np.trace(stress) / D, rel=1e-12)
    worst = np.linalg.norm(forces[~state.rattlers], axis=1).max()
    assert state.max_force == pytest.approx(worst, rel=1e-12)
    d = 2 * packing.radii.mean()
    assert imbalance(packing, state) == pytest.approx(worst / state.pressure / d ** (D - 1), rel=1e-12)
    found = precision.forces_of(packing, rounded=True)
    np.testing.assert_allclose(found, np.linalg.norm(forces, axis=1), atol=1e-13)


def test_distances_from_the_origin(jammed):
    packing = unbalanced(jammed).replace(record={"pressure": measure(jammed).pressure})
    share, distance, forces = precision.residuals(packing)
    centred = precision.centred(packing)
    size = np.linalg.norm(centred.positions, axis=1)
    edge = 0.5 * np.diag(packing.cell).min() - 2 * packing.radii.max()
    np.testing.assert_allclose(distance, size[size < edge], rtol=1e-14)
    np.testing.assert_allclose(share, distance / edge, rtol=1e-14)
    unit = packing.record["pressure"] * (2 * packing.radii.mean()) ** (packing.dimension - 1)
    expected = precision.forces_of(packing, rounded=False)[size < edge] / unit
    np.testing.assert_allclose(forces[0], expected, rtol=1e-6)


def test_bonds_of_networks(jammed):
    network = Network.of_packing(unbalanced(jammed))
    bonds = network.linear_bonds
    size = np.linalg.norm(bonds.r, axis=1)
    np.testing.assert_allclose(bonds.distance, size, rtol=1e-14)
    forces = np.zeros(network.positions.shape)
    for a, b, tension, r in zip(bonds.i, bonds.j, network.tension, bonds.r / size[:, None], strict=True):
        forces[a] += tension * r
        forces[b] -= tension * r
    worst = np.linalg.norm(forces, axis=1).max() / np.abs(network.tension).mean()
    assert network.imbalance == pytest.approx(worst, rel=1e-9)
    assert network.volume == pytest.approx(np.linalg.det(network.cell), rel=1e-14)


def test_relative_motions(jammed):
    """a∥² and all of a⊥² are the square of a bond's motion, with the strain."""
    c, u, gamma = find_contacts(jammed), vectors_like(jammed), 0.3
    w = u[c.j] - u[c.i]
    w[:, 0] += gamma * c.r[:, 1]
    axes = np.stack((c.normal, *transverse_axes(c.normal)), axis=1)
    np.testing.assert_allclose(axes @ axes.transpose(0, 2, 1), np.broadcast_to(np.eye(len(w.T)), axes.shape),
                               atol=1e-14)  # fmt: skip
    forms = linear_forms(CENTRAL_FORMS, c.normal)
    sheared = load_coefficients(forms, simple_shear(c.r.shape[1]).imposed(c.r))
    motions = [
        np.sum(on_i * u[c.i] + on_j * u[c.j], axis=1) + gamma * on_gamma
        for (on_i, on_j), on_gamma in zip(forms, sheared, strict=True)
    ]
    np.testing.assert_allclose(motions[0], np.sum(c.normal * w, axis=1), atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(motions, axis=0), np.linalg.norm(w, axis=1), rtol=1e-13)


def test_steps_of_flows_and_of_slow_shear(jammed):
    like, g, dt = tuple(range(jammed.dimension)), 0.3, 0.01
    o, u = vectors_like(jammed, 2), vectors_like(jammed, 3)
    step = dt * (u - g * np.outer(u[:, 1], np.eye(len(like))[0]))
    longest, far = (np.linalg.norm(values, axis=1).max() for values in (step, o + step))
    out, velocity = np.empty_like(o), np.empty_like(o)
    assert move(o, u, g, dt, out, like) == pytest.approx((far, longest), rel=1e-13)
    np.testing.assert_allclose(out, o + step, rtol=1e-13)
    sums = np.sum(u[:, 0] * u[:, 1]), np.sum(np.linalg.norm(u, axis=1) ** 2)
    found = drift(o, 0.5 * u, 2.0, g, dt, velocity, out, like)
    assert found == pytest.approx((far, longest, *sums), rel=1e-12)
    moved = u - u.mean(axis=0)
    rms, largest = without_drift(u, like)
    assert (rms, largest) == pytest.approx((summary(moved)[2], np.abs(moved).max()), rel=1e-12)


def test_vectors_on_particles_go_to_other_programs_whole(jammed):
    v = vectors_like(jammed)
    frame = packing_frame(jammed, {"velocity": v})
    np.testing.assert_array_equal(frame.columns["velocity"], v)
    stress = [frame.columns[f"stress_{axis}{axis}"] for axis in "xyz"[: jammed.dimension]]
    volumes = frame.columns["area" if jammed.dimension == 2 else "volume"]
    pressure = -np.sum(stress @ volumes) / jammed.dimension / jammed.volume
    assert pressure == pytest.approx(measure(jammed).pressure, rel=1e-12)


def test_layers_of_a_flow_fill_phi(jammed):
    rng = np.random.default_rng(5)
    places = jammed.positions + rng.normal(size=(3, *jammed.positions.shape))
    arrays = {
        "positions": places,
        "velocities": rng.normal(size=places.shape),
        "cell": np.broadcast_to(jammed.cell, (3, *jammed.cell.shape)),
        "radii": jammed.radii,
    }
    arrays = {f"snapshots/{name}": values for name, values in arrays.items()}
    *_, phi, _ = layers.profiles(stored(None, "flow", arrays, rate=0.1))
    assert np.mean(phi) == pytest.approx(jammed.phi, rel=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_flow_is_kept_with_the_order_of_disks_alone(dimension, tmp_path):
    options = {"n": 16, "phi": 0.9, "model": "RD0", "rate": 0.1, "strain": 0.02, "snapshots": 2}
    jampetsc.flow(**options, discard=0.0, dimension=dimension, out=tmp_path / "flow.h5")
    slim(tmp_path / "flow.h5", tmp_path / "kept.h5")
    with open_file(tmp_path / "kept.h5") as kept:
        assert ("snapshots/psi6_local" in kept) == (dimension == 2)
        assert "snapshots/positions" not in kept


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_recorded_lengths_of_slow_shear(session, jammed):
    """Medians, means, rms and histograms of |u_na|, |Δu∥| and |Δu⊥| are those of the vectors in the file."""
    result = jampetsc.quasistatic(jammed)
    for group, prefix in (("", ""), ("no_prestress/", "no_prestress_")):
        moved, bonds = result[f"{group}nonaffine"], result["contacts/bonds"]
        row_of = {int(particle): row for row, particle in enumerate(result["particles"])}
        i, j = ([row_of[particle] for particle in ends] for ends in result["contacts/pairs"].T.tolist())
        w = moved[j] - moved[i] + np.outer(bonds[:, 1], np.eye(jammed.dimension)[0])
        n = bonds / np.linalg.norm(bonds, axis=1)[:, None]
        along = np.sum(n * w, axis=1)
        values = {"nonaffine": moved, "normal": along, "transverse": w - along[:, None] * n}
        for name, value in values.items():
            recorded = [result.attributes[f"{prefix}{name}_{kind}"] for kind in ("median", "mean", "rms")]
            np.testing.assert_allclose(recorded, summary(value), rtol=1e-7, err_msg=f"{group}{name}")
            size = np.linalg.norm(value, axis=1) if value.ndim == 2 else np.abs(value)
            edges, counts = (result[f"{group}histogram/{name}/{part}"] for part in ("edges", "counts"))
            np.testing.assert_array_equal(np.histogram(size, edges)[0][1:], counts[1:])


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_recorded_lengths_of_modes(session, jammed):
    """Participation ratios, and medians of what the lowest ten modes move, are those of the vectors in the file."""
    result = jampetsc.modes(jammed, all=True)
    modes, values, D = result["modes"], result["eigenvalues"], jammed.dimension
    squares = np.linalg.norm(modes, axis=2) ** 2
    ratio = np.sum(squares, axis=1) ** 2 / (modes.shape[1] * np.sum(squares**2, axis=1))
    np.testing.assert_allclose(result["participation_ratio"], ratio, rtol=1e-12)
    assert len(values) == D * (modes.shape[1] - 1)
    place = np.full(jammed.n, -1)
    place[result["particles"]] = np.arange(modes.shape[1])
    c = measure(jammed).contacts
    i, j = place[c.i], place[c.j]
    each = -(result["shear_force"] / values)[:, None, None] * modes
    for moved, affine, recorded in (
        (each[:10].sum(axis=0), 0.0, lambda name: result[f"lowest/{name}_median"][0]),
        (each.sum(axis=0), 1.0, lambda name: result.attributes[f"{name}_median"]),
    ):
        w = moved[j] - moved[i] + affine * np.outer(c.r[:, 1], np.eye(D)[0])
        along = np.sum(c.normal * w, axis=1)
        across = w - along[:, None] * c.normal
        for name, value in {"nonaffine": moved, "normal": along, "transverse": across}.items():
            assert recorded(name) == pytest.approx(summary(value)[0], rel=1e-6), name
