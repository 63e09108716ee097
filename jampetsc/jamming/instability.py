"""From a minimum that is lost to the next one: a small push along the mode without stiffness, then the way down."""

import numpy as np

from jampetsc.minimisation.overdamped import OverdampedDescent
from jampetsc.packing.contacts import measure, typical_force
from jampetsc.packing.neighbours import fractional, vectors

DESCENT_TOLERANCE = 1e-8  # max |F| / (p d^(D−1)) of a descent, before Newton's method
PUSH_RATIO, MAX_PUSH_RATIO = 1e-4, 4.0  # of a usual overlap: first and last push along the mode
MIN_PULL_RATIO = 10.0  # of the force at which a descent ends: the pull from which it begins


def usual_overlap(disks, pressure: float) -> float:
    """Overlap of a contact with the force 2 p d^(D−1), d the mean diameter."""
    return disks.potential.overlap_at(2.0 * typical_force(disks, pressure), 2.0 * float(np.mean(disks.radii)))


def pushed_offsets(branch, disks, offsets, shear, pressure, least_force, mode):
    """Offsets (N, D) after a move along a mode (N, D), so far that contacts pull disks on; loose ones make way.

    branch        `ShearBranch` with the contacts after the event
    disks         as they are listed
    pressure      at the event
    least_force   max |F| at which the descent would end

    None where no move is pulled on.
    """
    overlap = usual_overlap(disks, pressure)
    unit = branch.with_loose(mode, 0.0) / np.sqrt(np.max(np.sum(mode * mode, axis=1)))
    backbone = np.where(branch.loose[:, None], 0.0, unit)
    least = MIN_PULL_RATIO * least_force * np.sqrt(np.sum(backbone * backbone))
    size = PUSH_RATIO * overlap
    while size < MAX_PUSH_RATIO * overlap:
        trial = offsets.copy()
        branch.displace(trial, np.zeros_like(trial), size * unit, shear)
        branch.evaluate(trial, shear)
        if np.sum(branch.point[4] * backbone) > least:
            return trial
        size *= 2.0
    return None


def descend_steepest(disks, solver, stiffness, separated_pressure, effort):
    """Disks at the minimum that steepest descent leads to; effort counts its evaluations. Raises ConvergenceError."""
    overlap = usual_overlap(disks, measure(disks).pressure)
    descent = OverdampedDescent(disks, solver, stiffness, overlap)
    result = descent.relax(DESCENT_TOLERANCE, separated_pressure)
    effort.evaluations += descent.evaluations
    return result.folded()


def displacement_between(disks, later):
    """Displacements (N, D) between two states of disks in one cell, to the nearest image."""
    displacement = (later.base - disks.base) + (later.offset - disks.offset)
    return displacement - vectors(np.round(fractional(displacement, disks.cell)), disks.cell)
