"""`jampetsc correlate`: correlation of transverse displacements along the flow; without PETSc or MPI."""

import math

from jampetsc.errors import InputError
from jampetsc.storage.fields import PHASES

FORMAT = "jampetsc-correlation"
LANES = "0.5,0.25,1"
SAME_PRESSURE = 0.01  # sweeps are averaged if their pressures differ by no more than this fraction

DESCRIPTION = """\
Correlation C(delta) of the displacements u_y along x in narrow lanes (BT Fig. 7), real and imaginary part, of
the fields that sweeps hold (jampetsc sweep --fields), and the length l at its first root: by default in the phase
of the stress, which is what BT impose. Several sweeps of one kind (law, pressure, number of disks) are averaged.
Of flow files with snapshots: the correlation g_y(x) of transverse velocities along the flow (Vågberg, eq. 4.23)
of pairs in the lane around one of them, and its minimum."""
EPILOG = """\
Each packing is looked for beside its sweep. Errors come from resampling the packings, or strips of
lanes where there are fewer than five packings; those are lower bounds.

examples:
  jampetsc correlate sweep.h5 --out correlation.h5
  jampetsc correlate stokes-s*.h5 --lane 0.5,1 --out stokes.h5
  jampetsc correlate rd0-s1.h5 rd0-s2.h5 --out g.h5              of flow files, with --lane 1 --bin 1
  jampetsc plot stokes.h5 --out correlation.png
  jampetsc plot p1e-2.h5 p1e-3.h5 p1e-4.h5 --kind length --out length.png"""


def add_parser(subparsers) -> None:
    """Add `correlate` to the command line."""
    parser = subparsers.add_parser(
        "correlate",
        help="correlation of displacements along the flow, and its length",
        description=DESCRIPTION,
        epilog=EPILOG,
    )
    parser.add_argument(
        "files",
        nargs="+",
        metavar="FILE",
        help="sweeps with fields, or flow files with snapshots, of one kind",
    )
    parser.add_argument("--out", required=True, metavar="FILE", help="result (HDF5)")
    parser.add_argument(
        "--lane",
        metavar="w1,w2,…",
        help=f"widths of a lane in mean diameters, the first for the summary (default {LANES}; flow: one, default 1)",
    )
    parser.add_argument(
        "--bin", type=float, metavar="B", help="flow: width of a bin of x in mean diameters (default 1)"
    )
    parser.add_argument(
        "--phase",
        choices=PHASES,
        help="sweeps: real parts are in phase with the stress (default, as BT have it) or with the strain",
    )
    parser.add_argument("--omega", metavar="w1,w2,…", help="fields at these frequencies (default: all)")
    parser.add_argument("--packing", metavar="FILE", help="packing of a single sweep, if it is not beside it")
    parser.set_defaults(run=run, check=check)


def check(args):
    """(lane widths, frequencies or None for all). Raises InputError."""
    from jampetsc.words.frequencies import parse_omega

    if args.bin is not None and not 0 < args.bin < float("inf"):
        raise InputError(f"--bin {args.bin:g}: must be positive")
    return _lanes(args.lane or LANES), None if args.omega is None else parse_omega(args.omega)


def run(args, petsc_argv) -> int:
    """Correlate, write the file and print the lengths. Raises InputError."""
    import time

    import numpy as np

    from jampetsc.analysis.correlations import correlate, grid_cells, lane_sums
    from jampetsc.storage.fields import chosen_frequencies, field_at, packing_of, particle_rows, phase_factor
    from jampetsc.storage.outputs import check_output
    from jampetsc.words.files import refuse_repeated

    began = time.perf_counter()
    lanes, wanted = check(args)
    phase = args.phase or PHASES[0]
    refuse_repeated(args.files)
    if _is_flow(args.files[0]):
        return _velocities(args, began)
    if args.bin is not None:
        raise InputError(f"--bin {args.bin:g}: belongs to flow files, not to {args.files[0]}; leave it out")
    check_output(args.out, FORMAT, [*args.files, *filter(None, [args.packing])])
    sweeps = _open(args.files)
    if args.packing and len(sweeps) > 1:
        raise InputError(
            f"--packing {args.packing}: one packing for {len(sweeps)} sweeps: correlate them one by one"
        )
    frequencies, sums, cells, scales, moduli = [], [[] for _ in lanes], None, [], []
    for sweep in sweeps:
        fields = sweep.fields
        rows = chosen_frequencies(sweep, fields.omega[np.argsort(fields.omega)] if wanted is None else wanted)
        frequencies.append(fields.omega[rows])
        disks = packing_of(sweep, args.packing)
        particles = particle_rows(sweep, disks)
        diameter = 2.0 * float(disks.radii.mean())
        scales.append((disks.cell[0, 0], diameter))
        cells = cells or grid_cells(disks.cell[0, 0], diameter)
        turns = [phase_factor(sweep, omega, phase) for omega in frequencies[-1]]
        transverse = np.array(
            [turn * field_at(sweep, row)[0][:, 1] for turn, row in zip(turns, rows, strict=True)]
        )
        moduli.append(sweep.modulus(frequencies[-1]))
        parts = np.stack((transverse.real, transverse.imag), axis=1).reshape(2 * len(rows), -1)
        for width, found in zip(lanes, sums, strict=True):
            try:
                found.append(
                    lane_sums(disks.positions[particles], disks.cell, parts, width * diameter, cells)
                )
            except InputError as error:
                raise InputError(f"{sweep.path}: {error}") from None
    _require_same_frequencies(sweeps, frequencies)
    results = [correlate(found) for found in sums]
    omega, (length, diameter) = frequencies[0], np.mean(scales, axis=0)
    widths, G = [found[0].width for found in sums], np.mean(moduli, axis=0)
    _write(args.out, sweeps, omega, phase, G, widths, results, length, diameter, began)
    print(_summary(args.out, sweeps, omega, phase, lanes, results, length / diameter))
    return 0


def _is_flow(path):
    from jampetsc.storage.reader import load

    return getattr(load(path), "format", "") == "jampetsc-flow"


def _velocities(args, began):
    """g_y of flow files: write it, print its minimum."""
    import time

    from jampetsc.flows import lanes
    from jampetsc.storage.outputs import check_output
    from jampetsc.storage.provenance import derived_from
    from jampetsc.storage.reader import load
    from jampetsc.storage.result_file import ResultWriter

    for name in ("omega", "packing", "phase"):
        if getattr(args, name) is not None:
            raise InputError(f"--{name}: belongs to sweeps, not to {args.files[0]}; leave it out")
    check_output(args.out, lanes.FORMAT, args.files)
    widths = _lanes(args.lane) if args.lane else [lanes.LANE]
    if len(widths) > 1:
        raise InputError(f"--lane {args.lane}: flow files are correlated at one width")
    results = [load(path) for path in args.files]
    for path, result in zip(args.files, results, strict=True):
        if getattr(result, "format", "") != "jampetsc-flow":
            raise InputError(f"{path}: is not a flow file as {args.files[0]} is: average one kind")
    bin_ = args.bin or lanes.BIN
    found = lanes.correlate_lanes(results, widths[0], bin_)
    place, depth = found.minimum
    with ResultWriter(args.out, lanes.FORMAT) as writer:
        for name, values in (
            ("x", found.centres),
            ("g_y", found.values),
            ("g_y_error", found.errors),
            ("pairs", found.pairs),
        ):
            writer.dataset(name, values)
        shared = {name: results[0].attributes.get(name) for name in ("model", "rate", "mass", "units")}
        writer.attributes(
            **derived_from(results, time.perf_counter() - began) | shared,
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
    print(
        f"{args.out}: g_y of {found.snapshots} snapshots, lanes of {widths[0]:g} d: least {depth:.3g} at x = "
        f"{place / found.diameter:.3g} d, "
        f"<u_y^2>/rate^2 = {found.mean_square:.3g}"
    )
    return 0


def _lanes(text):
    try:
        lanes = [float(word) for word in text.split(",")]
    except ValueError:
        raise InputError(f"--lane {text}: write widths in mean diameters, such as {LANES}") from None
    wrong = next((width for width in lanes if not 0.01 <= width <= 1e6), None)
    if wrong is not None:
        raise InputError(f"--lane {wrong:g}: a width in mean diameters must be at least 0.01")
    if len(set(lanes)) < len(lanes):
        raise InputError(f"--lane {text}: gives a width twice: leave one out")
    return lanes


def _open(paths):
    """The sweeps, of different packings, all of one law, pressure and number of disks. Raises InputError."""
    from jampetsc.storage.reader import SweepResult, load
    from jampetsc.words.files import refuse_one_packing

    sweeps = [load(path) for path in paths]
    for path, sweep in zip(paths, sweeps, strict=True):
        if not isinstance(sweep, SweepResult):
            raise InputError(f"{path}: is not a sweep: correlations come from `jampetsc sweep --fields`")
        for what, mine, first in (
            ("law", sweep.law, sweeps[0].law),
            ("number of disks", *(s.attributes.get("particle_count") for s in (sweep, sweeps[0]))),
        ):
            if mine != first:
                raise InputError(
                    f"{path}: {what} {_words(mine)}, but {paths[0]} has {_words(first)}: "
                    "average sweeps of one kind"
                )
        pressure, first = (float(s.attributes.get("pressure", 0.0)) for s in (sweep, sweeps[0]))
        if abs(pressure - first) > SAME_PRESSURE * abs(first):
            raise InputError(
                f"{path}: pressure {pressure:g}, but {paths[0]} has {first:g}: average sweeps of one pressure"
            )
    refuse_one_packing(sweeps)
    return sweeps


def _words(value):
    return ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, dict) else str(value)


def _require_same_frequencies(sweeps, frequencies):
    import numpy as np

    for sweep, omega in zip(sweeps, frequencies, strict=True):
        if len(omega) != len(frequencies[0]) or not np.allclose(omega, frequencies[0], rtol=0.01, atol=0):
            raise InputError(
                f"{sweep.path}: fields at other frequencies than in {sweeps[0].path.name}: "
                "choose common ones with --omega"
            )


def _write(out, sweeps, omega, phase, G, widths, results, length, diameter, began):
    import time

    import numpy as np

    from jampetsc.storage.provenance import derived_from
    from jampetsc.storage.result_file import ResultWriter

    def parts(name):
        """An entry of all results, (lanes, F, 2, …), the third axis for real and imaginary part."""
        stacked = np.array([getattr(result, name) for result in results])
        return stacked.reshape(len(results), len(omega), 2, *stacked.shape[2:])

    with ResultWriter(out, FORMAT) as writer:
        for name, values in {
            "omega": omega,
            "G": G,
            "lane_width": np.array(widths),
            "delta": length * np.array([result.separation for result in results]),
            "C": parts("values"),
            "C_error": parts("errors"),
            "length": length * parts("root"),
            "length_error": length * parts("root_error"),
            "minimum": length * parts("minimum"),
            "minimum_error": length * parts("minimum_error"),
        }.items():
            writer.dataset(name, values)
        writer.attributes(
            **derived_from(sweeps, time.perf_counter() - began) | _mean_pressure(sweeps),
            phase=phase,
            packings=len(sweeps),
            L=length,
            mean_diameter=diameter,
            pairs=[result.pairs for result in results],
        )


def _mean_pressure(sweeps):
    known = [float(sweep.attributes["pressure"]) for sweep in sweeps if "pressure" in sweep.attributes]
    return {"pressure": sum(known) / len(known)} if known else {}


def _summary(out, sweeps, omega, phase, lanes, results, size):
    """Lengths in diameters of the first lane width, and how far the others are from it."""
    first = results[0]
    packings = f"{len(sweeps)} packing{'' if len(sweeps) == 1 else 's'}"
    cells = f"L = {size:.4g} d, lanes of {lanes[0]:g} d, {first.pairs} pairs"
    lines = [f"{out}: {packings}, {cells}, in phase with the {phase}"]
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
