"""Explicit steps of steepest descent with many stages."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jampetsc
from jampetsc.minimisation.chebyshev import (
    STABLE,
    chebyshev_step,
    coefficients,
    eigenvalue_bound,
    stages_for,
)
from jampetsc.packing.kernel import bond_forces
from jampetsc.packing.neighbour_list import NeighbourList
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import UNSTRAINED

CASES = [(2, "harmonic"), (3, "harmonic"), (2, "hertzian")]


def _disturbed(dimension, potential):
    disks = jampetsc.pack(n=20, pressure=0.03, dimension=dimension, potential=potential, seed=4)
    disks = disks.replace(potential=Potential(potential, k=3.0))
    rng = np.random.default_rng(dimension)
    return disks, NeighbourList.build(disks, 0.3), 0.02 * rng.standard_normal(disks.base.shape)


def _forces(disks, pairs, offsets):
    forces = np.zeros_like(offsets)
    bond_forces(pairs, offsets, UNSTRAINED, disks.potential.constants, forces, None, None)
    return forces


def _step(disks, pairs, offsets, h, stages):
    room = np.zeros((4, *offsets.shape))
    _, error, move = chebyshev_step(
        pairs, offsets, _forces(disks, pairs, offsets), UNSTRAINED, disks.potential.constants, h,
        coefficients(stages), *room,
    )  # fmt: skip
    return move, error


@pytest.mark.parametrize(("dimension", "potential"), CASES)
def test_steps_are_of_second_order(dimension, potential):
    """Halved steps have an eighth of the error, which is estimated."""
    disks, pairs, offsets = _disturbed(dimension, potential)
    offsets *= 1e-3  # too small for contacts to open or close
    errors = []
    for h in (0.02, 0.01):
        exact = solve_ivp(
            lambda _, x: _forces(disks, pairs, x.reshape(offsets.shape)).ravel(),
            (0.0, h), offsets.ravel(), rtol=1e-12, atol=1e-18,
        )  # fmt: skip
        move, estimate = _step(disks, pairs, offsets, h, 3)
        errors.append(np.abs(offsets + move - exact.y[:, -1].reshape(offsets.shape)).max())
        assert 0.2 < estimate / errors[-1] < 5.0
    assert errors[0] / errors[1] == pytest.approx(8.0, rel=0.1)


@pytest.mark.parametrize(("dimension", "potential"), CASES)
@pytest.mark.parametrize("stages", [2, 7, 80])
def test_long_steps_stay_stable(dimension, potential, stages):
    """The energy falls in steps as long as the stages allow."""
    disks, pairs, offsets = _disturbed(dimension, potential)
    offsets *= 0.1
    constants = disks.potential.constants
    for _ in range(5):
        before = bond_forces(pairs, offsets, UNSTRAINED, constants, np.zeros_like(offsets), None, None)
        h = STABLE * (stages**2 - 1) / eigenvalue_bound(pairs, offsets, UNSTRAINED, constants)
        assert stages_for(0.999999 * h * eigenvalue_bound(pairs, offsets, UNSTRAINED, constants)) == stages
        move, _ = _step(disks, pairs, offsets, h, stages)
        offsets = offsets + move
        after = bond_forces(pairs, offsets, UNSTRAINED, constants, np.zeros_like(offsets), None, None)
        assert after.energy <= before.energy


@pytest.mark.parametrize(("dimension", "potential"), CASES)
def test_the_bound_is_above_all_eigenvalues_and_near_them(dimension, potential):
    """It is compared with differences of forces."""
    disks, pairs, offsets = _disturbed(dimension, potential)
    size, hessian = 1e-6, []
    for unit in size * np.eye(offsets.size):
        ends = (_forces(disks, pairs, offsets + sign * unit.reshape(offsets.shape)) for sign in (-1.0, 1.0))
        hessian.append(np.subtract(*ends).ravel() / (2.0 * size))
    largest = np.linalg.eigvalsh(np.array(hessian))[-1]
    bound = eigenvalue_bound(pairs, offsets, UNSTRAINED, disks.potential.constants)
    assert largest <= bound <= 2.5 * largest


def test_what_is_no_number_has_an_infinite_error():
    """Whatever comes after it."""
    disks, pairs, offsets = _disturbed(2, "harmonic")
    offsets[3] = np.nan
    assert _step(disks, pairs, offsets, 0.1, 4)[1] == np.inf
