"""Sliding rough walls: rows of fixed disks at y = 0 and y = H, moving at ∓γ̇H/2 (Vågberg, thesis sec. 4.2.2).

The cell stays that of Lees and Edwards, periodic in x, of height H. The disks of the lower row go with the affine
flow, u = 0, and so do their images, which are the upper row: each row is rigid, and one slides past the other by
γ̇H. Disks of the walls come first in all arrays (`wall_disks` of them). Disks between the rows never touch across a
row. Disks with a mass are at rest, v = 0 in the frame of the middle, when the rows begin to slide. With y from the
middle between the rows and F the force of the contacts on a disk, the stress on the walls is

    σ_w = ½ (F_lower − F_upper)/L_x = σ + (1/V) Σ y F_x    over the disks that move,

at every instant, from the virial of the bonds between the rows. Without mass and drag F = 0 and σ_w = σ; with mass
their means are equal, if σ includes its kinetic part. With drag the fluid takes the difference, k_d Σ y u_x/V.
"""

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.flows.steady_shear import SteadyShear
from jampetsc.laws.flow_models import MODELS, Model, Scheme
from jampetsc.packing.kernel import bond_forces
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.neighbours import spatial_order
from jampetsc.packing.packing import Packing
from jampetsc.packing.particles import UNIT_BALL
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import simple_shear

LAYERS = 20  # of equal height between walls
GAP = 0.05  # between the disks of a row, in units of their diameters: they never touch
# relaxation of a random start at zero rate: number of time steps, and their length in k_d d²/k_e of the smallest disk
SETTLING = 2000, 0.05


def phi_between(disks: Packing, wall_disks: int) -> float:
    """Packing fraction of the disks that move, in the area V = L_x H less that of the walls' disks."""
    areas = UNIT_BALL[disks.dimension] * disks.radii**disks.dimension
    return float(np.sum(areas[wall_disks:]) / (disks.volume - np.sum(areas[:wall_disks])))


def between_walls(
    radii, phi: float, seed: int, potential: Potential, keeps_order: bool = False
) -> tuple[Packing, int]:
    """Disks of these radii (N,), relaxed from random places between rows of the same sizes: (disks, wall disks).

    keeps_order: the disks between the rows are in the order of the radii, else along a curve.
    L_x and H are as equal as whole disks allow. Raises InputError where the rows leave no room between them.
    """
    radii = np.asarray(radii, float)
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))
    area = np.pi * np.sum(radii**2) / phi
    share = np.pi * np.mean(radii**2) / (2.0 * (1.0 + GAP) * radii.mean())  # area of a row's disks per length
    side = 0.5 * share + np.sqrt(0.25 * share**2 + area)
    row = generator.permutation(radii)
    number = 1 + int(np.argmin(np.abs(np.cumsum(2.0 * (1.0 + GAP) * row) - side)))
    row = row[:number]
    pitches = 2.0 * (1.0 + GAP) * row
    width = pitches.sum()
    height = (area + np.pi * np.sum(row**2)) / width
    if height < 2.0 * (row.max() + radii.max()):
        raise InputError(
            f"{named('walls')}: rows of disks {height:.3g} apart, centre to centre, leave no room for a disk of "
            f"diameter {2 * radii.max():.3g} between them: more disks are needed"
        )
    places = generator.random((len(radii), 2)) * np.column_stack(
        (np.full(len(radii), width), height - 2 * radii)
    )
    places[:, 1] += radii
    cell = np.diag([width, height])
    order = spatial_order(places, cell)
    wall = np.column_stack((np.cumsum(pitches) - 0.5 * pitches, np.zeros(number)))
    start = Packing.from_positions(
        np.concatenate((wall, places[order])), np.concatenate((row, radii[order])), cell, potential
    )
    step = SETTLING[1] * float(2.0 * radii.min()) ** 2  # k_d = k_e τ₁, and τ₁ = 1
    rest = SteadyShear(start, Model(MODELS["RD0"][0]), 0.0, Scheme(step, "euler", 1e-4), wall_disks=number)
    rest.advance(SETTLING[0])
    if keeps_order:
        return rest.disks.reordered(np.append(np.arange(number), number + np.argsort(order))), number
    return rest.disks, number


def wall_columns(shear: SteadyShear) -> dict:
    """Columns of a row of a run between walls: stress and pressure on them, and the velocity profile, at present."""
    u = shear.sorted_velocities()
    stress, pressure = stress_on_walls(shear, u)
    return {
        "wall_shear_stress": stress,
        "wall_pressure": pressure,
        "velocity_profile": velocity_profile(shear, u),
    }


def velocity_profile(shear: SteadyShear, u) -> np.ndarray:
    """Mean v_x in LAYERS of equal height between the rows, in units of γ̇H.

    −½ at the lower row and ½ at the upper one; nan in a layer without disks.

    u   (N, 2) non-affine velocities of `SteadyShear.sorted_disks`
    """
    height = shear.reference.cell[1, 1]
    y = np.mod(shear.sorted_disks.positions[shear.wall_disks :, 1], height) / height
    v = u[shear.wall_disks :, 0] / (shear.rate * height) + y - 0.5
    layer = np.minimum((LAYERS * y).astype(int), LAYERS - 1)
    with np.errstate(invalid="ignore"):
        return np.bincount(layer, v, LAYERS) / np.bincount(layer, minlength=LAYERS)


def stress_on_walls(shear: SteadyShear, u) -> tuple[float, float]:
    """(σ_xy, pressure) that disks of non-affine velocities u (N, 2) exert on the walls, mean of both."""
    *_, i, j, r0, sigma = shear.pairs
    lower = (i < shear.wall_disks) & (j >= shear.wall_disks)
    upper = (i >= shear.wall_disks) & (j < shear.wall_disks)
    # pairs whose moving disk is above the row, which it never crosses
    above = (lower & (r0[1] > 0)) | (upper & (r0[1] < 0))
    task = shear.step_constants()
    motion = u, task.rate, task.weights
    rolling = None
    if shear.model.law.couples_rotations:
        rolling = shear.spins, shear.reference.radii, np.empty(len(shear.spins))
    total = np.zeros(2)
    for side, sign in ((above, 1.0), ((lower | upper) & ~above, -1.0)):
        pairs = NeighbourList.of_pairs(
            len(u), i[side], j[side], [component[side] for component in r0], sigma[side]
        )
        forces = np.empty_like(shear.offsets)
        bond_forces(pairs, shear.offsets, simple_shear(shear.shear), task.potential, forces, motion, rolling)
        total += sign * forces[: shear.wall_disks].sum(0)
    width = 2.0 * shear.reference.cell[0, 0]
    return float(total[0] / width), float(-total[1] / width)
