"""Correlation of transverse motions along the flow: of displacement fields of sweeps, of velocities of flows."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from jampetsc.asking.inputs import refuse_one_packing, refuse_repeated
from jampetsc.asking.job import Job
from jampetsc.asking.kinds import FREQUENCIES, PACKING, RESULT, Numbers, opened
from jampetsc.asking.parameters import FILES, Kind, asked, shown
from jampetsc.core.disks import Disks
from jampetsc.errors import InputError, named
from jampetsc.io.fields import PHASES

LANES = (0.5, 0.25, 1.0)
NARROWEST, WIDEST = 0.01, 1e6  # lanes
SAME_PRESSURE = 0.01  # sweeps are averaged if their pressures differ by no more than this fraction
SWEEPS, FLOW = "jampetsc-sweep", "jampetsc-flow"


def _lanes(given):
    """Widths in the order given, since the first is that of the summary."""
    try:
        words = (
            given.split(",")
            if isinstance(given, str)
            else [given]
            if isinstance(given, int | float)
            else given
        )
        lanes = tuple(float(word) for word in words)
    except (TypeError, ValueError):
        raise ValueError(f"must be widths in mean diameters, such as {_lanes_told(LANES)}") from None
    for width in lanes:
        if not NARROWEST <= width <= WIDEST:
            raise ValueError(f"{width:g} must lie between {NARROWEST:g} and {WIDEST:g}")
    if not lanes or len(set(lanes)) < len(lanes):
        raise ValueError("must be at least one width, none of them twice")
    return lanes


def _lanes_told(lanes):
    return ",".join(shown(width) if float(shown(width)) == width else repr(width) for width in lanes)


@dataclass(frozen=True, eq=False)
class Correlate(Job):
    """Correlation of displacements along the flow, and its length.

    C(δ) of the displacements u_y along x in narrow lanes (BT Fig. 7), real and imaginary part, of the fields that
    sweeps hold, and the length l at its first root: by default in the phase of the stress, which is what BT impose.
    Several sweeps of one kind (law, pressure, number of disks) are averaged. Of flows with snapshots: the correlation
    g_y(x) of transverse velocities along the flow (Vågberg, eq. 4.23) of pairs in the lane around one of them, and
    its minimum.

    Each packing is looked for beside its sweep. Errors come from resampling the packings, or strips of lanes where
    there are fewer than five packings; those are lower bounds.
    """

    NAME: ClassVar = "correlate"
    FORMAT: ClassVar = "jampetsc-correlation"
    EPILOG: ClassVar = """examples:
  jampetsc correlate sweep.h5 --out correlation.h5
  jampetsc correlate stokes-*.h5 --lane 0.5,1 --out stokes.h5    # the mean over several packings
  jampetsc correlate rd0.h5 --out g.h5                           # of a flow with snapshots
  jampetsc plot correlation.h5 --out correlation.png"""

    results: Sequence = asked(
        help="sweeps with fields, or flows with snapshots, of one kind", kind=RESULT, place=FILES
    )
    lane: Numbers | None = asked(
        None,
        f"widths of a lane, the first for the summary (default {_lanes_told(LANES)}; flow: one, default 1)",
        kind=Kind(_lanes, _lanes_told, metavar="w1,w2,…"),
        unit="mean diameters",
    )
    bin: float | None = asked(
        None,
        "flow: width of a bin of x (default 1)",
        above=0.0,
        high=WIDEST,
        unit="mean diameters",
        metavar="B",
    )
    phase: str | None = asked(
        None,
        "sweeps: real parts are in phase with the stress (default, as BT have it) or with the strain",
        choices=PHASES,
    )
    omega: Numbers | None = asked(None, "fields at these frequencies (default: all)", kind=FREQUENCIES)
    packing: Disks | None = asked(None, "packing of a single sweep, if it is not beside it", kind=PACKING)

    @property
    def scalar(self):
        """PETSc has nothing to do."""

    def check(self):
        """Refuse what is given twice."""
        refuse_repeated(self.results)

    @property
    def paths(self):
        """The packing is one of them."""
        return [*super().paths, *([self.packing] if isinstance(self.packing, str) else [])]

    def check_outputs(self, to):
        """Refuse a file that holds another kind of correlation."""
        from jampetsc.flows import velocity_correlation as lanes
        from jampetsc.io.outputs import check_output

        if to.path is not None:
            flows = getattr(opened(self.results[0]), "format", "") == FLOW
            check_output(to.path, lanes.FORMAT if flows else self.FORMAT, self.paths)

    def work(self, to):
        """Correlate."""
        began = time.perf_counter()
        opened_ = [opened(source) for source in self.results]
        kind = getattr(opened_[0], "format", "")
        for source, result in zip(self.results, opened_, strict=True):
            if kind not in (SWEEPS, FLOW) or getattr(result, "format", "") != kind:
                raise InputError(
                    f"{source}: correlations are of sweeps with fields or of flows with snapshots: average one kind"
                )
        return (self._velocities if kind == FLOW else self._displacements)(opened_, to, began)

    def _displacements(self, sweeps, to, began):
        """C(δ) of the fields of sweeps."""
        from jampetsc.analysis.correlations import correlate_motions

        if self.bin is not None:
            raise InputError(f"{named('bin')} {self.bin:g}: belongs to flows; leave it out")
        _refuse_mixture(sweeps)
        if self.packing is not None and len(sweeps) > 1:
            raise InputError(
                f"{named('packing')}: one packing for {len(sweeps)} sweeps: correlate them one by one"
            )
        import numpy as np

        phase, lanes = self.phase or PHASES[0], self.lane or LANES
        motions, frequencies = zip(*(self._motion(sweep, phase) for sweep in sweeps), strict=True)
        for sweep, omega in zip(sweeps, frequencies, strict=True):
            if len(omega) != len(frequencies[0]) or not np.allclose(omega, frequencies[0], rtol=0.01, atol=0):
                raise InputError(
                    f"{sweep.path}: fields at other frequencies than in {sweeps[0].path.name}: choose common ones "
                    f"with {named('omega')}"
                )
        G = np.mean([sweep.modulus(omega) for sweep, omega in zip(sweeps, frequencies, strict=True)], axis=0)
        found = correlate_motions(motions, lanes)
        with to.writer(self.FORMAT) as writer:
            for name, values in {"omega": frequencies[0], "G": G, **found.arrays}.items():
                writer.dataset(name, values)
            writer.attributes(
                **_derived_from(sweeps, began) | _mean_pressure(sweeps),
                phase=phase,
                packings=len(sweeps),
                L=found.length,
                mean_diameter=found.diameter,
                pairs=[result.pairs for result in found.results],
            )
        return _summary(to, len(sweeps), frequencies[0], phase, lanes, found)

    def _motion(self, sweep, phase):
        """(Motion, frequencies (F,)) of the fields of a sweep."""
        import numpy as np

        from jampetsc.analysis.correlations import Motion
        from jampetsc.io.fields import (
            chosen_frequencies,
            field_at,
            packing_of,
            particle_rows,
            phase_factor,
        )

        stored = sweep.fields.omega
        rows = chosen_frequencies(sweep, stored[np.argsort(stored)] if self.omega is None else self.omega)
        disks = packing_of(sweep, self.packing)
        particles = particle_rows(sweep, disks)
        transverse = np.array(
            [phase_factor(sweep, stored[row], phase) * field_at(sweep, row)[0][:, 1] for row in rows]
        )
        diameter = 2.0 * float(disks.radii.mean())
        return Motion(sweep.path, disks.positions[particles], disks.cell, transverse, diameter), stored[rows]

    def _velocities(self, flows, to, began):
        """g_y of flows."""
        from jampetsc.flows import velocity_correlation as lanes

        for name in ("omega", "packing", "phase"):
            if getattr(self, name) is not None:
                raise InputError(f"{named(name)}: belongs to sweeps, not to {flows[0].path}; leave it out")
        widths = self.lane or (lanes.LANE,)
        if len(widths) > 1:
            raise InputError(f"{named('lane')} {_lanes_told(widths)}: flows are correlated at one width")
        bin_ = self.bin or lanes.BIN
        found = lanes.correlate_lanes(flows, widths[0], bin_)
        place, depth = found.minimum
        with to.writer(lanes.FORMAT) as writer:
            for name, values in (
                ("x", found.centres),
                ("g_y", found.values),
                ("g_y_error", found.errors),
                ("pairs", found.pairs),
            ):
                writer.dataset(name, values)
            shared = {name: flows[0].attributes.get(name) for name in ("model", "rate", "mass", "units")}
            writer.attributes(
                **_derived_from(flows, began) | shared,
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


def _derived_from(results, began):
    from jampetsc.io.provenance import derived_from

    return derived_from(results, time.perf_counter() - began)


def _refuse_mixture(sweeps):
    """Raise InputError unless sweeps are of different packings, all of one law, pressure and number of disks."""
    first = sweeps[0]
    for sweep in sweeps[1:]:
        for what, mine, other in (
            ("law", _words(sweep.law), _words(first.law)),
            ("number of disks", *(s.attributes.get("particle_count") for s in (sweep, first))),
        ):
            if mine != other:
                raise InputError(
                    f"{sweep.path}: {what} {mine}, but {first.path.name} has {other}: average sweeps of one kind"
                )
        pressure, other = (float(s.attributes.get("pressure", 0.0)) for s in (sweep, first))
        if abs(pressure - other) > SAME_PRESSURE * abs(other):
            raise InputError(
                f"{sweep.path}: pressure {pressure:g}, but {first.path.name} has {other:g}: average those of one"
            )
    refuse_one_packing(sweeps)


def _words(law):
    return ", ".join(f"{name} {value}" for name, value in law.items())


def _mean_pressure(sweeps):
    known = [float(sweep.attributes["pressure"]) for sweep in sweeps if "pressure" in sweep.attributes]
    return {"pressure": sum(known) / len(known)} if known else {}


def _summary(to, packings, omega, phase, lanes, found) -> str:
    """Lengths in diameters of the first lane width, and how far the others are from it."""
    results, size = found.results, found.length / found.diameter
    first = results[0]
    lines = [
        f"{to}: {packings} packing{'s' * (packings > 1)}, L = {size:.4g} d, lanes of {lanes[0]:g} d, "
        f"{first.pairs} pairs, in phase with the {phase}"
    ]
    for n, w in enumerate(omega):
        parts = [
            f"{name} {_with_error(size * first.root[2 * n + part], size * first.root_error[2 * n + part])}"
            for part, name in enumerate(("Re", "Im"))
        ]
        lines.append(f"  omega {w:.3g}: l/d {',  '.join(parts)}")
    for width, other in zip(lanes[1:], results[1:], strict=True):
        change = _rms(other.values - first.values)
        error = math.hypot(_rms(first.errors), _rms(other.errors))
        known = f"differs by {change:.2g} (rms), with errors of {error:.2g}"
        lines.append(f"  lanes of {width:g} d: C {known if change == change else 'is not known'}")
    return "\n".join(lines)


def _rms(values):
    """Root mean square of what is known of values (F, D + 1) beyond δ = 0; nan if nothing is."""
    import numpy as np

    known = values[:, 1:][np.isfinite(values[:, 1:])]
    return np.sqrt(np.mean(known**2)) if len(known) else np.nan


def _with_error(value, error):
    if value != value:
        return "no root"
    return f"{value:.3g}" if error != error else f"{value:.3g} ± {error:.1g}"
