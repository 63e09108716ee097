"""Bounds on errors in relation to their values, and parts of G* that are zero to rounding."""

import numpy as np

ZERO_PART_RATIO = 1e-12  # of |G*|: largest bound on a part that is zero to rounding


def relative_bound(bound, value):
    """bound/|value| element by element; 0 where both vanish, infinite where only the value does."""
    bound, size = np.broadcast_arrays(np.asarray(bound, float), np.abs(value))
    relative = np.where(bound == 0, 0.0, np.inf)
    return np.divide(bound, size, out=relative, where=size > 0)


def storage_and_loss(G):
    """G' and G'' of G (…,), (…, 2)."""
    return np.stack((np.real(G), np.imag(G)), axis=-1)


def zero_parts(G, bounds):
    """Where G' and G'' are zero to rounding, (…, 2): not above their bounds, which are small beside |G*|.

    G        (…,) complex
    bounds   (…, 2) on |ΔG'| and |ΔG''|
    """
    return (np.abs(storage_and_loss(G)) <= bounds) & (bounds <= ZERO_PART_RATIO * np.abs(G)[..., None])


def relative_part_bounds(G, bounds):
    """Bounds (…, 2) on |ΔG'| and |ΔG''| relative to them, (…, 2); 0 where `zero_parts`."""
    return np.where(zero_parts(G, bounds), 0.0, relative_bound(bounds, storage_and_loss(G)))
