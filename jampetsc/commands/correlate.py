"""Correlation of transverse motions along the flow: of displacement fields of sweeps, of velocities of flows."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jampetsc import interrupts
from jampetsc.analysis.displacement_correlation import (
    ROUNDING_LIMIT,
    across,
    add_lanes,
    correlate_displacements,
    grid_cells,
    lane_sums,
)
from jampetsc.analysis.velocity_correlation import DEFAULT_BIN_WIDTH, DEFAULT_LANE_WIDTH
from jampetsc.commands.sources import write_derived
from jampetsc.errors import InputError, about, as_float, named
from jampetsc.io.disk_motion import (
    PHASES,
    chosen_frequencies,
    correlate_lanes,
    field_at,
    particle_rows,
    phase_factor,
    radii_of,
    source_of,
)
from jampetsc.io.results import note_lines, notes_of_sources
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
LANES = (0.5, 0.25, 1.0)  # widths, in mean diameters, by default
DEFAULT_AXIS = "x"
AXES = {"x": (0,), "y": (1,), "both": (0, 1)}  # numbers of the axes along which lanes lie
AXES_TEXT = {"x": "", "y": " along y", "both": " along x and along y"}
PRESSURE_TOLERANCE = 0.01  # largest relative difference of pressures of sweeps to average


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
    sweeps hold, and the length l at its first root: by default in the phase of the stress, as BT impose it. In a square
    cell u_x along y has the same C on average, and the mean of both a smaller error.
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
    along: str | None = optional_parameter(
        "sweep: axis of the lanes, x (default) for u_y along x, y for u_x along y, or both, their mean",
        choices=AXES,
    )
    omega: Numbers | None = optional_parameter(
        "sweep: frequencies of the fields to correlate (default: all)", value_type=FREQUENCIES
    )
    packing: Packing | str | None = optional_parameter(
        "sweep: file of its packing (default: as the result records it)", value_type=PACKING
    )

    @property
    def implied(self):
        """See `Job`; the width of a lane depends on what the files hold."""
        return {"bin": DEFAULT_BIN_WIDTH, "phase": PHASES[0], "along": DEFAULT_AXIS}

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
        return (_of_flows if kind == FLOW else _of_sweeps)(self, results, to)


def _of_flows(job, flows, to) -> str:
    """Correlate transverse velocities in the snapshots of flows; returns the summary. Raises InputError."""
    start_time = time.perf_counter()
    for name in ("omega", "packing", "phase", "along"):
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
        *(to, VELOCITIES, flows, start_time, arrays, notes := notes_of_sources(flows)),
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
    return "\n".join(
        [
            f"{to}: g_y of {correlation.snapshots} snapshots, lanes of {widths[0]:g} d: least {depth:.3g} at x = "
            f"{place / correlation.diameter:.3g} d, <u_y^2>/rate^2 = {correlation.mean_square:.3g}",
            *note_lines(notes),
        ]
    )


def _of_sweeps(job, sweeps, to) -> str:
    """Correlate displacement fields of sweeps, one per packing, averaged; returns the summary. Raises InputError."""
    start_time = time.perf_counter()
    if job.bin is not None:
        raise InputError(
            f"{named('bin')} {job.bin:g}: an option of flows, but {sweeps[0].path} is a sweep. Leave it out."
        )
    refuse_mixture(sweeps)
    if job.packing is not None and len(sweeps) > 1:
        raise InputError(
            f"{named('packing')}: one packing for {len(sweeps)} sweeps. Correlate each sweep alone."
        )
    phase, lanes, along = job.phase or PHASES[0], job.lane or LANES, job.along or DEFAULT_AXIS
    motions, frequencies = zip(*(_motion(job, sweep, phase, AXES[along]) for sweep in sweeps), strict=True)
    for sweep, omega in zip(sweeps, frequencies, strict=True):
        if len(omega) != len(frequencies[0]) or not np.allclose(omega, frequencies[0], rtol=0.01, atol=0):
            raise InputError(
                f"{sweep.path}: frequencies of its fields differ from those in {sweeps[0].path.name}. Choose common "
                f"ones with {named('omega')}."
            )
    G = np.mean([sweep.modulus(omega) for sweep, omega in zip(sweeps, frequencies, strict=True)], axis=0)
    results, widths = _correlated(sweeps, motions, lanes)
    length, diameter = np.mean([(disks.cell[0, 0], _diameter(disks)) for disks, *_ in motions], axis=0)
    arrays = {"omega": frequencies[0], "G": G, "lane_width": widths}
    arrays |= {"delta": length * np.array([correlation.separation for correlation in results])}
    for name, what, unit in (
        ("C", "values", 1.0), ("C_error", "errors", 1.0), ("length", "root", length),
        ("length_error", "root_error", length), ("minimum", "minimum", length),
        ("minimum_error", "minimum_error", length),
    ):  # fmt: skip
        values = np.array([getattr(correlation, what) for correlation in results])
        arrays[name] = unit * values.reshape(
            len(results), -1, 2, *values.shape[2:]
        )  # Re and Im of each field
    write_derived(
        *(to, job.FORMAT, sweeps, start_time, arrays, notes := notes_of_sources(sweeps)),
        **_mean_pressure(sweeps),
        phase=phase,
        along=along,
        packings=len(sweeps),
        L=length,
        mean_diameter=diameter,
        pairs=[correlation.pairs for correlation in results],
    )
    summary = _sweep_summary(to, len(sweeps), frequencies[0], phase, along, lanes, results, length / diameter)
    return "\n".join([summary, *note_lines(notes)])


def _diameter(disks):
    """Mean diameter of the disks, or mean length of a bond of nodes without radii."""
    return 2.0 * float(radii_of(disks).mean())


def _correlated(sweeps, motions, lanes):
    """(a Correlation for each width of a lane, these widths such that lanes fill the cell) of what `_motion` gives.

    Raises InputError for lanes that do not fit, naming the sweep.
    """
    first, sums = motions[0][0], [[] for _ in lanes]
    cells = grid_cells(first.cell[0, 0], _diameter(first))
    for sweep, (disks, particles, fields_of) in zip(sweeps, motions, strict=True):
        for width, rows in zip(lanes, sums, strict=True):
            interrupts.check()
            with about(sweep.path):
                axes = []
                for axis, fields in fields_of.items():
                    frame = disks.positions[particles], disks.cell
                    frame = across(*frame) if axis else frame
                    axes.append(lane_sums(*frame, fields, width * _diameter(disks), cells))
                rows.append(add_lanes(axes))
    return [correlate_displacements(rows) for rows in sums], np.array([rows[0].width for rows in sums])


def _motion(job, sweep, phase, axes):
    """((disks, their rows in the fields (n,), {axis: motions}), frequencies (F,)) of a sweep.

    Motions (2F, n) are Re and Im of each field across lanes along an axis: u_y along x, u_x along y.
    """
    stored = sweep.fields.omega
    rows = chosen_frequencies(sweep, stored[np.argsort(stored)] if job.omega is None else job.omega)
    disks = source_of(sweep, job.packing)
    particles = particle_rows(sweep, disks)
    fields = [phase_factor(sweep, stored[row], phase) * field_at(sweep, row)[0][:, :2] for row in rows]
    motions = {}
    for axis in axes:
        transverse = [field[:, 1 - axis] for field in fields]
        parts = [part for u in transverse for part in (u.real, u.imag)]
        is_motion = np.array([_rms(part) > ROUNDING_LIMIT * _diameter(disks) for part in parts]).reshape(
            -1, 2
        )
        if not is_motion.any(axis=1).all():
            at = stored[rows][np.argmin(is_motion.any(axis=1))]
            raise InputError(
                f"{sweep.path}: |u_{'yx'[axis]}| at omega = {at:g} is rounding, as in a perfect crystal (at most "
                f"{ROUNDING_LIMIT:g} mean diameters per strain). Choose other frequencies with {named('omega')}."
            )
        motions[axis] = [
            part if moves else np.zeros_like(part) for part, moves in zip(parts, is_motion.flat, strict=True)
        ]
    return (disks, particles, motions), stored[rows]


def refuse_mixture(sweeps):
    """Raise InputError unless sweeps are of different packings, all of one law, load, pressure and number of disks."""
    first, of_packing = sweeps[0], {}
    for sweep in sweeps:
        for what, value, other in (
            ("damping", _words(sweep.law), _words(first.law)),
            ("load", sweep.load, first.load),
            ("number of particles", *(s.attributes.get("particle_count") for s in (sweep, first))),
        ):
            if value != other:
                raise InputError(
                    f"{sweep.path}: {what} {value}, but {first.path.name} has {other}. Average sweeps of one kind."
                )
        pressure, other = (float(s.attributes.get("pressure", 0.0)) for s in (sweep, first))
        if abs(pressure - other) > PRESSURE_TOLERANCE * abs(other):
            raise InputError(
                f"{sweep.path}: pressure {pressure:g}, but {first.path.name} has {other:g}. Average sweeps of one "
                "pressure."
            )
        sha256 = sweep.attributes.get("packing_sha256")
        same = of_packing.setdefault(sha256, sweep)
        if sha256 is not None and same is not sweep:
            raise InputError(
                f"{sweep.path}: the packing of {same.path.name} (sha256 {sha256[:12]}…). Give each packing once."
            )


def _words(law):
    return ", ".join(f"{name} {value}" for name, value in law.items())


def _mean_pressure(sweeps):
    pressures = [float(sweep.attributes["pressure"]) for sweep in sweeps if "pressure" in sweep.attributes]
    return {"pressure": sum(pressures) / len(pressures)} if pressures else {}


def _sweep_summary(to, packings, omega, phase, along, lanes, results, size) -> str:
    """Lengths in diameters for the first lane width, and how much C differs at the other widths; size: L in these."""
    first = results[0]
    lines = [
        f"{to}: {packings} packing{'s' * (packings > 1)}, L = {size:.4g} d, lanes of {lanes[0]:g} d"
        f"{AXES_TEXT[along]}, {first.pairs} pairs, in phase with the {phase}"
    ]
    for n, w in enumerate(omega):
        parts = [
            f"{name} {_with_error(size * first.root[2 * n + part], size * first.root_error[2 * n + part])}"
            for part, name in enumerate(("Re", "Im"))
        ]
        lines.append(f"  omega {w:.3g}: l/d {',  '.join(parts)}")
    for width, other in zip(lanes[1:], results[1:], strict=True):
        change = _rms((other.values - first.values)[:, 1:])  # beyond δ = 0, where C is 1
        error = math.hypot(_rms(first.errors[:, 1:]), _rms(other.errors[:, 1:]))
        difference = f"differs by {change:.2g} (rms), with errors of {error:.2g}"
        lines.append(f"  lanes of {width:g} d: C {difference if change == change else 'cannot be compared'}")
    return "\n".join(lines)


def _rms(values):
    """Root mean square of the finite values; nan without any."""
    finite = values[np.isfinite(values)]
    return np.sqrt(np.mean(finite**2)) if len(finite) else np.nan


def _with_error(value, error):
    if value != value:
        return "no root"
    return f"{value:.3g}" if error != error else f"{value:.3g} ± {error:.1g}"
