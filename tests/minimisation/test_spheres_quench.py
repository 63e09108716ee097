"""Quenches of spheres: gradient and Hessian against differences of a plain sum over pairs, and packings at rest."""

import itertools

import numpy as np
import pytest
from samples import on_ranks

import jampetsc as jp
from jampetsc.minimisation import lbfgs
from jampetsc.minimisation.descent import Descent, Goal
from jampetsc.minimisation.hessian import Pattern, border
from jampetsc.minimisation.lbfgs_kernels import measure as measure_domain
from jampetsc.minimisation.minimise import settle
from jampetsc.minimisation.newton import Point, is_definite, solve_dense
from jampetsc.minimisation.protocols import random_start
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import imbalance, measure
from jampetsc.packing.kernel import block_room
from jampetsc.packing.packing import deformed, proved_minimum
from jampetsc.packing.potentials import STIFFNESSES, Potential
from jampetsc.packing.strain import cell_strain

LIKE = (np.zeros(1),) * 3  # a tuple of the types of the loops, for which they are compiled already

VOIGT = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]

LAWS = [(kind, stiffness, 1.0) for kind in ("harmonic", "hertzian") for stiffness in STIFFNESSES]
LAWS += [("power", "constant", 1.0, 2.25), ("power", "inverse-square-diameter", 1.0, 3.0)]
IMAGES = np.array(list(itertools.product((-1, 0, 1), repeat=3)))


def energy(disks):
    """U, a sum over all pairs and images."""
    bonds = disks.positions[None] - disks.positions[:, None] + (IMAGES @ disks.cell)[:, None, None]
    sigma = disks.radii[None] + disks.radii[:, None]
    law, overlap = disks.potential, sigma - np.linalg.norm(bonds, axis=-1)
    overlap[:, np.arange(disks.n), np.arange(disks.n)] = 0.0
    scale = sigma if law.stiffness == "inverse-square-diameter" else 1.0
    return 0.5 * np.sum(law.k / law.exponent * (np.maximum(overlap, 0.0) / scale) ** law.exponent)


def spheres(n=24, phi=0.8, law=("harmonic", "constant"), seed=1):
    start = random_start(radii_of("bidisperse", n), phi, seed, Potential(*law), dimension=3)
    return settle(start, 0.01).folded()


def change(disks, vector):
    """The spheres after moves (N, 3) and strains (4,), one after the other in `vector`."""
    moves = vector[: 3 * disks.n].reshape(disks.n, 3)
    return deformed(disks, moves, cell_strain(vector[3 * disks.n :].tolist()))


@pytest.mark.parametrize("law", LAWS)
def test_gradient_and_hessian(law):
    """Of the enthalpy, at a cell that has grown and sheared since the list, in moves and all four strains."""
    pressure, rng = 0.02, np.random.default_rng(3)
    disks = spheres(law=law)
    descent = Descent(disks, Goal(pressure, True))
    descent.move(0.01 * rng.normal(size=(disks.n, 3)), np.array([0.01, -0.02, 0.03, 0.015]))
    descent.move(0.01 * rng.normal(size=(disks.n, 3)), np.array([-0.005, 0.02, 0.01, 0.03]))
    here, point = descent.disks, Point.of(descent)

    def enthalpy(vector):
        moved = change(here, vector)
        return energy(moved) + pressure * moved.volume

    size, h = 3 * disks.n + 4, 1e-6
    units = np.eye(size)[[0, 31, 71, *range(size - 4, size)]]
    force = np.append(point.forces, point.drive)
    differences = [(enthalpy(-h * unit) - enthalpy(h * unit)) / (2 * h) for unit in units]
    np.testing.assert_allclose(units @ force, differences, rtol=0, atol=1e-8 * np.abs(force).max())
    # the compiled gradient, in strains from the list on
    own, task, room = descent.space, descent.task(1.0, 1.0, 1), block_room(3)
    measure_domain(descent.domains, 0, own, task, np.ones(2), 0, -1, room, LIKE)
    total, pull = np.zeros(own.sums.shape[1]), np.zeros(4)
    lbfgs.collect_sums(own, task, total, pull)
    offsets, box = descent.offsets, descent.box.copy()

    def listed_enthalpy(strains):
        moved = deformed(disks, offsets, cell_strain(strains.tolist()))
        return energy(moved) + pressure * moved.volume

    slopes = [(listed_enthalpy(box + h * e) - listed_enthalpy(box - h * e)) / (2 * h) for e in np.eye(4)]
    np.testing.assert_allclose(task.scale * pull, slopes, rtol=0, atol=1e-8 * np.abs(slopes).max())
    # Hessian against differences of forces
    pattern = Pattern(point.bonds.pairs, disks.n, 3)
    values = pattern.fill(point.bonds, np.ones(disks.n, bool))
    upper = np.zeros((3 * disks.n, 3 * disks.n))
    for row in range(3 * disks.n):
        columns = pattern.indices[pattern.indptr[row] : pattern.indptr[row + 1]]
        upper[row, columns] = values[pattern.indptr[row] : pattern.indptr[row + 1]]
    rows, corner = border(point.bonds, disks.n, point.volume, pressure)
    rows = rows.reshape(-1, 4)
    hessian = np.block([[upper + np.triu(upper, 1).T, rows], [rows.T, corner]])

    def push(vector):
        ahead = Point.of(Descent(change(here, vector), Goal(pressure, True)))
        return np.append(ahead.forces, ahead.drive)

    for unit in units[:3]:
        wanted = (push(-h * unit) - push(h * unit)) / (2 * h)
        np.testing.assert_allclose(unit @ hessian, wanted, rtol=0, atol=1e-7 * np.abs(hessian).max())
    mixed = [(enthalpy(h * 1e2 * (a + b)) - enthalpy(h * 1e2 * (a - b)) - enthalpy(h * 1e2 * (b - a))
              + enthalpy(-h * 1e2 * (a + b))) / (4e4 * h * h) for a in units for b in units]  # fmt: skip
    found = [a @ hessian @ b for a in units for b in units]
    np.testing.assert_allclose(found, mixed, rtol=0, atol=5e-3 * np.abs(mixed).max())


def test_small_systems():
    rng = np.random.default_rng(2)
    root = rng.normal(size=(4, 4))
    matrix, right = root @ root.T, rng.normal(size=4)
    np.testing.assert_allclose(solve_dense(matrix, right), np.linalg.solve(matrix, right), rtol=1e-9)
    assert is_definite(matrix) and not is_definite(matrix - 1.01 * np.linalg.eigvalsh(matrix)[0] * np.eye(4))


@pytest.mark.scalar("real")
@pytest.mark.parametrize(("law", "options"), zip(LAWS, (
    {"pressure": 1e-3}, {"phi": 0.68, "stabilise": "shear"}, {"pressure": 1e-2, "stabilise": "shear"}, {"phi": 0.7},
    {"pressure": 1e-3}, {"phi": 0.7, "stabilise": "shear"},
), strict=True))  # fmt: skip
def test_a_packing_of_spheres_is_a_proved_minimum(session, law, options):
    settings = dict(zip(("potential", "stiffness", "k", "exponent"), law, strict=False)) | options
    del settings["k"]
    disks = jp.pack(n=64, dimension=3, seed=2, **settings)
    state = measure(disks)
    assert disks.dimension == 3 and proved_minimum(disks) and imbalance(disks, state) < 1e-10
    assert state.energy == pytest.approx(energy(disks), rel=1e-10)
    if "pressure" in options:
        assert state.pressure == pytest.approx(options["pressure"], rel=1e-10)
    else:
        assert disks.phi == pytest.approx(options["phi"], rel=1e-12)
    tilts = np.abs(state.stress[np.triu_indices(3, 1)])
    assert (tilts.max() < 1e-9 * state.pressure) == ("stabilise" in options)
    assert state.coordination > 6.0 - 6.0 / 64 and disks.record["shear_modulus"] > 0
    again = jp.pack(from_=disks, phi=disks.phi)
    assert again.record["evaluations"] < 50 and np.allclose(again.positions, disks.positions, atol=1e-8)


def slopes(disks, moves, strain):
    """∂U/∂o (N, 3) and ∂U/∂S (3, 3) at the places (1 + S)(x + o), from all pairs and images."""
    F = np.eye(3) + strain
    bonds = disks.positions + moves
    bonds = bonds[None] - bonds[:, None] + (IMAGES @ disks.cell)[:, None, None]
    stretched = bonds @ F.T
    sigma, law = disks.radii[None] + disks.radii[:, None], disks.potential
    distance = np.linalg.norm(stretched, axis=-1)
    overlap = np.maximum(sigma - distance, 0.0)
    overlap[:, np.arange(disks.n), np.arange(disks.n)] = 0.0
    pull = -law.k * overlap ** (law.exponent - 1.0) / np.maximum(distance, 1e-9)
    pulls = pull[..., None] * stretched
    on_strain = 0.5 * np.einsum("mija,mijb->ab", pulls, bonds)
    return -pulls.sum(axis=(0, 2)) @ F, 0.5 * (on_strain + on_strain.T)


def elastic_constants(disks, step=1e-6):
    """C (6, 6) of the spheres at rest by differences of `slopes`, at unit shears ½(x̂ŷ + ŷx̂)."""

    def gradient(vector):
        strain = np.zeros((3, 3))
        for amplitude, (a, b) in zip(vector[3 * disks.n :], VOIGT, strict=True):
            strain[a, b] += 0.5 * amplitude
            strain[b, a] += 0.5 * amplitude
        moves, strains = slopes(disks, vector[: 3 * disks.n].reshape(-1, 3), strain)
        return np.append(moves.ravel(), [strains[pair] for pair in VOIGT])

    units = step * np.eye(3 * disks.n + 6)
    K = np.array([gradient(unit) - gradient(-unit) for unit in units]) / (2.0 * step)
    moves, border = slice(3 * disks.n), slice(3 * disks.n, None)
    response = np.linalg.pinv(0.5 * (K + K.T)[moves, moves], rcond=1e-7) @ K[moves, border]
    return (K[border, border] - K[border, moves] @ response) / disks.volume


@pytest.mark.scalar("real")
@pytest.mark.parametrize(
    "options",
    on_ranks(
        [
            {"pressure": 1e-2},
            {"pressure": 3e-4, "potential": "hertzian", "seed": 2},
            {"phi": 0.72, "seed": 3},
        ],
        [{"pressure": 1e-2}],
    ),
)
def test_stable_to_all_strains(session, options):
    """The stress is isotropic; elastic constants by differences are positive definite, with and without its part.

    Of the enthalpy, along any path through no strain, they are C_ijkl + p (δ_ij δ_kl − ½ δ_ik δ_jl − ½ δ_il δ_jk).
    """
    disks = jp.pack(n=16, dimension=3, stabilise="all", **options)
    state, cell = measure(disks), disks.cell
    pressure = state.pressure
    np.testing.assert_allclose(state.stress, -pressure * np.eye(3), rtol=0, atol=3e-10 * pressure)
    if "pressure" in options:
        assert pressure == pytest.approx(options["pressure"], rel=1e-10)
    else:
        assert disks.phi == pytest.approx(0.72, rel=1e-12)
    assert proved_minimum(disks) and disks.record["protocol"].endswith(", then isotropic stress")
    tilts = np.abs(cell[[1, 2, 2], [0, 0, 1]]) / np.diag(cell)[[0, 0, 1]]
    assert np.all(tilts > 0.0) and np.all(tilts <= 0.5) and np.ptp(np.diag(cell)) > 1e-4
    C = elastic_constants(disks)
    np.testing.assert_allclose(
        jp.quasistatic(disks, load="tensor")["C0"], C, rtol=0, atol=1e-5 * np.abs(C).max()
    )
    norms = np.sqrt([1.0] * 3 + [2.0] * 3)
    C *= np.outer(norms, norms)
    volume = np.array([1.0] * 3 + [0.0] * 3) / np.sqrt(3.0)
    enthalpy = C + pressure * (3.0 * np.outer(volume, volume) - np.eye(6))
    if "phi" in options:  # at its volume
        enthalpy += 1e3 * np.outer(volume, volume)
    assert np.linalg.eigvalsh(C)[0] > 0.0 and np.linalg.eigvalsh(enthalpy)[0] > 0.0


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_only_all_strains_make_the_stress_isotropic(session, tmp_path):
    """Not the tilts alone; a cell of which all six numbers are relaxed comes back from other programs' files."""
    sheared = jp.pack(n=16, dimension=3, pressure=1e-2, stabilise="shear").stress
    assert np.ptp(np.diag(sheared)) > 1e-4 * 1e-2
    disks = jp.pack(n=16, dimension=3, pressure=1e-2, stabilise="all", out=tmp_path / "all.h5")
    assert jp.load(tmp_path / "all.h5").fingerprint == disks.fingerprint
    jp.export(disks, out=tmp_path / "all.data")
    again = jp.import_packing(tmp_path / "all.data")
    np.testing.assert_allclose(again.stress, -1e-2 * np.eye(3), rtol=0, atol=1e-12)
