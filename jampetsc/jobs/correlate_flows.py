"""The correlation g_y(x) of transverse velocities in the snapshots of flows."""

import time

from jampetsc.errors import InputError, named
from jampetsc.flows import velocity_correlation as lanes
from jampetsc.jobs.sources import write_derived


def run(job, flows, to) -> str:
    """Correlate for a `correlate.Correlate` and write the result; returns the summary. Raises InputError."""
    began = time.perf_counter()
    for name in ("omega", "packing", "phase"):
        if getattr(job, name) is not None:
            raise InputError(f"{named(name)}: belongs to sweeps, not to {flows[0].path}; leave it out")
    widths, bin_ = job.lane or (lanes.LANE,), job.bin or lanes.BIN
    if len(widths) > 1:
        raise InputError(f"{named('lane')} {job.settings()['lane']}: flows are correlated at one width")
    found = lanes.correlate_lanes(flows, widths[0], bin_)
    place, depth = found.minimum
    arrays = {"x": found.centres, "g_y": found.values, "g_y_error": found.errors, "pairs": found.pairs}
    write_derived(
        *(to, lanes.FORMAT, flows, began, arrays),
        **{name: flows[0].attributes.get(name) for name in ("model", "rate", "mass", "units")},
        lane_width=widths[0] * found.diameter,
        bin_width=bin_ * found.diameter,
        mean_diameter=found.diameter,
        snapshots=found.snapshots,
        mean_square=found.mean_square,
        minimum=depth,
        minimum_at=place,
        minimum_error=found.minimum_errors[1],
        minimum_at_error=found.minimum_errors[0],
    )
    return (
        f"{to}: g_y of {found.snapshots} snapshots, lanes of {widths[0]:g} d: least {depth:.3g} at x = "
        f"{place / found.diameter:.3g} d, <u_y^2>/rate^2 = {found.mean_square:.3g}"
    )
