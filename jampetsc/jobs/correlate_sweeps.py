"""C(δ) of the displacement fields of sweeps, one for each packing, averaged."""

import math
import time

import numpy as np

from jampetsc.analysis.correlations import Motion, correlate_motions
from jampetsc.errors import InputError, named
from jampetsc.io.fields import PHASES, chosen_frequencies, field_at, packing_of, particle_rows, phase_factor
from jampetsc.jobs.sources import write_derived

SAME_PRESSURE = 0.01  # sweeps are averaged if their pressures differ by no more than this fraction


def run(job, sweeps, to) -> str:
    """Correlate for a `correlate.Correlate` and write the result; returns the summary. Raises InputError."""
    began = time.perf_counter()
    if job.bin is not None:
        raise InputError(f"{named('bin')} {job.bin:g}: belongs to flows; leave it out")
    refuse_mixture(sweeps)
    if job.packing is not None and len(sweeps) > 1:
        raise InputError(
            f"{named('packing')}: one packing for {len(sweeps)} sweeps: correlate them one by one"
        )
    phase, lanes = job.phase or PHASES[0], job.lanes
    motions, frequencies = zip(*(_motion(job, sweep, phase) for sweep in sweeps), strict=True)
    for sweep, omega in zip(sweeps, frequencies, strict=True):
        if len(omega) != len(frequencies[0]) or not np.allclose(omega, frequencies[0], rtol=0.01, atol=0):
            raise InputError(
                f"{sweep.path}: fields at other frequencies than in {sweeps[0].path.name}: choose common ones "
                f"with {named('omega')}"
            )
    G = np.mean([sweep.modulus(omega) for sweep, omega in zip(sweeps, frequencies, strict=True)], axis=0)
    found = correlate_motions(motions, lanes)
    write_derived(
        *(to, job.FORMAT, sweeps, began, {"omega": frequencies[0], "G": G, **found.arrays}),
        **_mean_pressure(sweeps),
        phase=phase,
        packings=len(sweeps),
        L=found.length,
        mean_diameter=found.diameter,
        pairs=[result.pairs for result in found.results],
    )
    return _summary(to, len(sweeps), frequencies[0], phase, lanes, found)


def _motion(job, sweep, phase):
    """(Motion, frequencies (F,)) of the fields of a sweep."""
    stored = sweep.fields.omega
    rows = chosen_frequencies(sweep, stored[np.argsort(stored)] if job.omega is None else job.omega)
    disks = packing_of(sweep, job.packing)
    particles = particle_rows(sweep, disks)
    transverse = [phase_factor(sweep, stored[row], phase) * field_at(sweep, row)[0][:, 1] for row in rows]
    diameter = 2.0 * float(disks.radii.mean())
    motion = Motion(sweep.path, disks.positions[particles], disks.cell, np.array(transverse), diameter)
    return motion, stored[rows]


def refuse_mixture(sweeps):
    """Raise InputError unless sweeps are of different packings, all of one law, pressure and number of disks."""
    first, of_packing = sweeps[0], {}
    for sweep in sweeps:
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
        sha256 = sweep.attributes.get("packing_sha256")
        same = of_packing.setdefault(sha256, sweep)
        if sha256 is not None and same is not sweep:
            raise InputError(
                f"{sweep.path}: comes from the same packing as {same.path.name} (sha256 {sha256[:12]}…): "
                "an average takes each packing once"
            )


def _words(law):
    return ", ".join(f"{name} {value}" for name, value in law.items())


def _mean_pressure(sweeps):
    known = [float(sweep.attributes["pressure"]) for sweep in sweeps if "pressure" in sweep.attributes]
    return {"pressure": sum(known) / len(known)} if known else {}


def _summary(to, packings, omega, phase, lanes, found) -> str:
    """Lengths in diameters for the first lane width, and how much C differs at the other widths."""
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
    known = values[:, 1:][np.isfinite(values[:, 1:])]
    return np.sqrt(np.mean(known**2)) if len(known) else np.nan


def _with_error(value, error):
    if value != value:
        return "no root"
    return f"{value:.3g}" if error != error else f"{value:.3g} ± {error:.1g}"
