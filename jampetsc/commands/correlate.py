"""Correlation of transverse motions along the flow: of displacement fields of sweeps, of velocities of flows."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from jampetsc.analysis.velocity_correlation import DEFAULT_BIN_WIDTH, DEFAULT_LANE_WIDTH
from jampetsc.commands import correlate_sweeps
from jampetsc.commands.correlate_sweeps import LANES
from jampetsc.commands.sources import write_derived
from jampetsc.errors import InputError, as_float, named
from jampetsc.io.disk_motion import PHASES, correlate_lanes
from jampetsc.options.job import ALL_SEEDS, Job, TaskInputs
from jampetsc.options.parameters import FILES, ValueType, format_value, optional_parameter, parameter
from jampetsc.options.values import (
    FREQUENCIES,
    PACKING,
    RESULT,
    Numbers,
    load_source,
    refuse_repeated,
    split_list,
)
from jampetsc.packing.packing import Packing

MIN_LANE_WIDTH, MAX_LANE_WIDTH = 0.01, 1e6  # in mean diameters
SWEEPS, FLOW, VELOCITIES = "jampetsc-sweep", "jampetsc-flow", "jampetsc-velocity-correlation"


def _lanes(widths):
    """Widths of lanes in the order given: the summary shows the first."""
    try:
        lanes = tuple(map(as_float, split_list(widths)))
    except (TypeError, ValueError):
        raise ValueError(f"must be widths in mean diameters, such as {_lanes_text(LANES)}") from None
    for width in lanes:
        if not MIN_LANE_WIDTH <= width <= MAX_LANE_WIDTH:
            raise ValueError(f"{width:g} must lie between {MIN_LANE_WIDTH:g} and {MAX_LANE_WIDTH:g}")
    if not lanes or len(set(lanes)) < len(lanes):
        raise ValueError("must be one or several different widths")
    return lanes


def _lanes_text(lanes):
    return ",".join(
        format_value(width) if float(format_value(width)) == width else repr(width) for width in lanes
    )


@dataclass(frozen=True, eq=False)
class Correlate(Job):
    """Correlation of displacements along the flow, and its length.

    C(δ) of the displacements u_y along x in narrow lanes (BT Fig. 7), real and imaginary part, of the fields that
    sweeps hold, and the length l at its first root: by default in the phase of the stress, as BT impose it.
    Several sweeps of one kind (law, pressure, number of disks) are averaged. Of flows with snapshots: the correlation
    g_y(x) of transverse velocities along the flow (Vågberg, eq. 4.23) of pairs of disks in one lane, and its minimum.

    The packing of a sweep is read from the path that the sweep records, or beside it. Errors come from resampling the
    packings; for fewer than five packings from strips of lanes, which gives lower bounds.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(
        ALL_SEEDS,
        commands=("sweep", "flow"),
        is_suitable=lambda job: any(
            getattr(job, name, None) is not None for name in ("fields", "snapshots", "snapshot_every")
        ),
        needs="sweeps with fields, or flows with snapshots",
    )
    scalar: ClassVar = None
    FORMAT: ClassVar = "jampetsc-correlation"
    EPILOG: ClassVar = """examples:
  jampetsc correlate sweep.h5 --out correlation.h5
  jampetsc correlate stokes-*.h5 --lane 0.5,1 --out stokes.h5    # the mean over several packings
  jampetsc correlate rd0.h5 --out g.h5                           # of a flow with snapshots
  jampetsc plot correlation.h5 --out correlation.png"""

    results: Sequence = parameter(
        help="sweeps with fields, or flows with snapshots, of one kind", value_type=RESULT, place=FILES
    )
    lane: Numbers | None = optional_parameter(
        f"widths of a lane, the first for the summary (default {_lanes_text(LANES)}); for a flow one width (default 1)",
        value_type=ValueType(_lanes, _lanes_text, metavar="w1,w2,…", python="numbers"),
        unit="mean diameters",
    )
    bin: float | None = optional_parameter(
        "flow: width of the bins of x (default 1)",
        above=0.0,
        high=MAX_LANE_WIDTH,
        unit="mean diameters",
        metavar="B",
    )
    phase: str | None = optional_parameter(
        "sweep: phase of the real parts, that of the stress (default, BT) or of the strain",
        choices=PHASES,
    )
    omega: Numbers | None = optional_parameter(
        "sweep: frequencies of the fields to correlate (default: all)", value_type=FREQUENCIES
    )
    packing: Packing | None = optional_parameter(
        "sweep: file of its packing (default: as the result records it)", value_type=PACKING
    )

    def check(self):
        """Refuse a result given twice."""
        refuse_repeated(self.results)

    def check_outputs(self, to):
        """Refuse a file that holds another kind of correlation."""
        flows = getattr(load_source(self.results[0]), "format", "") == FLOW
        to.check(VELOCITIES if flows else self.FORMAT, self.paths)

    def work(self, to):
        results = [load_source(source) for source in self.results]
        kind = getattr(results[0], "format", "")
        for source, result in zip(self.results, results, strict=True):
            if kind not in (SWEEPS, FLOW) or getattr(result, "format", "") != kind:
                raise InputError(
                    f"{source}: not supported, or not of the kind of the first file. Give sweeps with fields, or "
                    "flows with snapshots."
                )
        return (_of_flows if kind == FLOW else correlate_sweeps.run)(self, results, to)


def _of_flows(job, flows, to) -> str:
    """Correlate transverse velocities in the snapshots of flows; returns the summary. Raises InputError."""
    began = time.perf_counter()
    for name in ("omega", "packing", "phase"):
        if getattr(job, name) is not None:
            raise InputError(
                f"{named(name)}: an option of sweeps, but {flows[0].path} is a flow. Leave it out."
            )
    widths, bin_ = job.lane or (DEFAULT_LANE_WIDTH,), job.bin or DEFAULT_BIN_WIDTH
    if len(widths) > 1:
        raise InputError(
            f"{named('lane')} {job.settings()['lane']}: several widths (flows: one). Give one width."
        )
    correlation = correlate_lanes(flows, widths[0], bin_)
    place, depth = correlation.minimum
    arrays = {
        "x": correlation.centres,
        "g_y": correlation.values,
        "g_y_error": correlation.errors,
        "pairs": correlation.pairs,
    }
    write_derived(
        *(to, VELOCITIES, flows, began, arrays),
        **{name: flows[0].attributes.get(name) for name in ("model", "rate", "mass", "units")},
        lane_width=widths[0] * correlation.diameter,
        bin_width=bin_ * correlation.diameter,
        mean_diameter=correlation.diameter,
        snapshots=correlation.snapshots,
        mean_square=correlation.mean_square,
        minimum=depth,
        minimum_at=place,
        minimum_error=correlation.minimum_errors[1],
        minimum_at_error=correlation.minimum_errors[0],
    )
    return (
        f"{to}: g_y of {correlation.snapshots} snapshots, lanes of {widths[0]:g} d: least {depth:.3g} at x = "
        f"{place / correlation.diameter:.3g} d, <u_y^2>/rate^2 = {correlation.mean_square:.3g}"
    )
