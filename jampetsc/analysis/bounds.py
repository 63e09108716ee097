"""Relative error bounds."""

import numpy as np


def relative_bound(bound, value):
    """bound/|value| element by element; 0 where both vanish, infinite where only the value does."""
    bound, size = np.broadcast_arrays(np.asarray(bound, float), np.abs(value))
    relative = np.where(bound == 0, 0.0, np.inf)
    return np.divide(bound, size, out=relative, where=size > 0)
