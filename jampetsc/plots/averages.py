"""Sweeps of an ensemble as one curve: the mean or median of G* over packings at each frequency, with its error."""

from dataclasses import replace

import numpy as np

from jampetsc.analysis.statistics import mean_with_error, median_interval, median_with_error
from jampetsc.errors import InputError
from jampetsc.plots.curves import Curve
from jampetsc.plots.picture import grouped

STATISTICS = {"mean": mean_with_error, "median": median_with_error}
BANDS = {name: f"{name}, 68 % interval" for name in STATISTICS}  # what `bounds` are
_SAME = 1e-9  # frequencies closer than this, relatively, are one


def average_curves(curves, statistic="mean") -> list[Curve]:
    """One curve for those that differ in the packing alone; `bounds`: its error, nan for one packing.

    statistic   "mean", the arithmetic one, or "median", of G' and of G''

    G' < 0 of a packing unstable to shear counts like any other value. One that is nearly unstable has a G'' at low ω
    that makes up all of a mean: the median knows it only as one of many.
    Raises InputError for sweeps of one packing, and for frequencies that differ, among those of one curve.
    """
    groups = grouped(curves, lambda curve: str(curve.description))
    return [_average(group, statistic) for group in groups.values()]


def require_same_frequencies(curves) -> None:
    """Raise InputError where curves that are averaged have other frequencies than the first."""
    first = curves[0]
    for curve in curves:
        same = len(curve.omega) == len(first.omega)
        if not (same and np.allclose(curve.omega, first.omega, rtol=_SAME, atol=0)):
            raise InputError(
                f"{curve.name}: other frequencies than {first.name}: a mean needs the same; draw them as files"
            )


def _average(curves, statistic):
    first, seen = curves[0], {}
    require_same_frequencies(curves)
    for curve in curves:
        packing = curve.attributes.get("packing_sha256")
        if packing in seen:
            raise InputError(
                f"{curve.name}: is of the same packing as {seen[packing]}: a mean takes each once"
            )
        if packing is not None:
            seen[packing] = curve.name
    G = np.array([curve.G for curve in curves])
    samples = np.stack((G.real, G.imag), axis=1)
    middle, error = STATISTICS[statistic](samples)
    if statistic == "median" and len(curves) > 2:  # whose errors are not alike on both sides
        error = np.abs(np.array(median_interval(samples)) - middle).swapaxes(0, 1)
    name = first.name if len(curves) == 1 else f"{len(curves)} sweeps"
    return replace(first, name=name, G=middle[0] + 1j * middle[1], bounds=error)
