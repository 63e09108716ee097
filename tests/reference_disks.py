"""Soft disks by other means than the program's own: forces over all pairs by numpy, minima by scipy.

Nothing of jampetsc is used, so that what both find is not one mistake made once. Lengths, energies and the potential
V = (k/α)(1 − r/σ)^α are those of Vågberg's thesis (eq. 4.7, k = 1); the cell is a square of side L under Lees–Edwards
conditions at strain γ: its vectors are (L, 0) and (γL, L).
"""

import numpy as np
from scipy.optimize import minimize

STILL = 1e-13  # largest component of a force at a minimum


def energy_and_forces(positions, radii, side, strain, alpha=2.0):
    """(U, forces (N, 2), Σ f r over contacts) of positions (N, 2)."""
    strain -= np.round(strain)  # the same lattice
    r = positions[None] - positions[:, None]
    turns = np.round(r[..., 1] / side)
    r = r - np.stack((strain * side * turns, side * turns), axis=-1)
    r[..., 0] -= side * np.round(r[..., 0] / side)
    sigma = radii[None] + radii[:, None]
    length = np.hypot(r[..., 0], r[..., 1])
    np.fill_diagonal(length, np.inf)
    overlap = np.maximum(1.0 - length / sigma, 0.0)
    size = overlap ** (alpha - 1.0) / sigma
    forces = -np.sum((size / length)[..., None] * r, axis=1)
    touching = overlap > 0
    return 0.5 * np.sum(overlap**alpha) / alpha, forces, 0.5 * np.sum(size[touching] * length[touching])


def quenched(positions, radii, side, strain, alpha=2.0):
    """(positions of the minimum downhill, U/N, p)."""

    def objective(flat):
        energy, forces, _ = energy_and_forces(flat.reshape(-1, 2), radii, side, strain, alpha)
        return energy, -forces.ravel()

    flat = np.ravel(positions)
    options = {"maxiter": 20000, "maxfun": 40000, "ftol": 0.0, "gtol": STILL, "maxcor": 20}
    found = minimize(objective, flat, jac=True, method="L-BFGS-B", options=options).x.reshape(-1, 2)
    energy, _, virial = energy_and_forces(found, radii, side, strain, alpha)
    return found, energy / len(radii), virial / (2.0 * side**2)


def sheared(positions, radii, side, step, steps, alpha=2.0):
    """(positions, U/N (steps,), p (steps,)) along quasistatic shear: affine steps of γ, each followed by a quench."""
    rows = []
    for number in range(1, steps + 1):
        affine = positions + np.outer(step * positions[:, 1], [1.0, 0.0])
        positions, *row = quenched(affine, radii, side, number * step, alpha)
        rows.append(row)
    return positions, *np.transpose(rows)


def jamming_density(positions, radii, side, alpha=2.0, width=1e-5):
    """φ_J of a jammed minimum: loosened in steps of 0.002 until it no longer jams, then bracketed to `width`."""
    area = np.pi * np.sum(radii**2)
    dense, loose, step = area / side**2, None, 2e-3
    while loose is None or dense - loose > width:
        phi = dense - step if loose is None else 0.5 * (dense + loose)
        scale = np.sqrt(area / phi) / side
        found, energy, _ = quenched(positions * scale, radii, side * scale, 0.0, alpha)
        if energy > 1e-16:
            positions, side, dense = found, side * scale, phi
        else:
            loose = phi
    return 0.5 * (dense + loose)
