"""Velocity profiles of flow between walls, as means over windows of strain.

A flow file has v_x/(γ̇H) in layers of equal height between the walls, row by row of its series (`flows.walls`); −½
and ½ are the walls, and y/H − ½ is the linear profile.
"""

import numpy as np

from jampetsc.analysis.correlated_series import Average
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import InputError, named


def heights(layers: int) -> np.ndarray:
    """y/H − ½ of the middles of so many layers, (layers,)."""
    return (np.arange(layers) + 0.5) / layers - 0.5


def mean_profile(results, low: float, high: float):
    """(mean v_x/(γ̇H) (B,), its error (B,)) of loaded flow files over rows with low < strain ≤ high.

    Errors are from the scatter of files, of a single file from its own autocorrelation. Raises InputError for files
    without profiles, and where one has no row there.
    """
    means, errors = [], []
    for result in results:
        if "velocity_profile" not in result:
            raise InputError(f"{result.path}: holds no velocity profiles: run the flow with {named('walls')}")
        strain = result["strain"]
        rows = result["velocity_profile"][(strain > low * (1 + 1e-9)) & (strain <= high * (1 + 1e-9))]
        if not len(rows):
            raise InputError(f"{result.path}: has no row between strain {low:g} and {high:g}")
        columns = [column[np.isfinite(column)] for column in rows.T]  # a layer may be empty at times
        found = [Average.of(column) if len(column) else None for column in columns]
        means.append([one.mean if one else np.nan for one in found])
        errors.append([one.error if one else np.nan for one in found])
    if len(means) == 1:
        return np.array(means[0]), np.array(errors[0])
    return mean_with_error(means)
