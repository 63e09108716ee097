"""`jampetsc jam`: which of many packings jam at a packing fraction, and how hard, by three protocols."""

from jampetsc.contacts.potentials import EXPONENTS
from jampetsc.errors import InputError
from jampetsc.packing.sizes import SIZES

FORMAT = "jampetsc-jam"
MANY = 1_000_000  # samples of one run
ROUND = {"random": 20, "shear": 1, "compress": 2}  # seeds of a rank between two checkpoints
DEFAULTS = {  # options of a protocol, and their values unless given
    "random": {},
    "shear": {"step": 1e-3, "strain": 2.0, "discard": 1.0, "every": 0.02},
    "compress": {"temperature": 1e-3, "cooling_rate": 1e-2, "sweeps": 200, "step": None, "strain": None},
}
LIMITS = {
    "step": (1e-8, 0.1), "strain": (1e-8, 1e4), "discard": (0.0, 1e4), "every": (1e-8, 1e4),
    "temperature": (1e-8, 10.0), "cooling_rate": (1e-6, 10.0), "sweeps": (0, 10_000_000),
}  # fmt: skip
EPILOG = """examples
  jampetsc jam --n 64 --phi 0.83:0.85:9 --seeds 1:500 --out f64.h5
  mpirun -n 2 jampetsc jam --n 256 --phi 0.84,0.8425 --seeds 1:100 --out f256.h5
  jampetsc jam --n 64 --phi 0.84 --seeds 1:4 --protocol shear --strain 4 --out qs64.h5
  jampetsc jam --n 64 --phi 0.84 --seeds 1:40 --protocol compress --cooling-rate 1e-3 --out slow64.h5

random: uniformly random disks, quenched. shear: minima along quasistatic shear of such disks, every --every of
strain. compress: a liquid at --temperature, cooled, quenched, sheared where --strain is given, then compressed or
decompressed to the phi_J of that sample; how far large and small disks have separated is told, too.

A run that was killed goes on when the same command is given again. Options of the Newton steps have the prefix
-newton_."""


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "jam",
        help="the fraction of packings that jam, and their pressures",
        description="Quench many samples at each packing fraction: jammed or not, energy, pressure.",
        epilog=EPILOG,
    )
    parser.add_argument("--n", type=int, required=True, metavar="N", help="number of disks")
    parser.add_argument(
        "--phi",
        required=True,
        metavar="A:B:M",
        help="packing fractions: M from A to B, or a list with commas",
    )
    parser.add_argument("--seeds", required=True, metavar="A:B", help="samples of each, A to B included")
    parser.add_argument("--out", required=True, metavar="FILE", help="result file")
    parser.add_argument(
        "--sizes", choices=SIZES, default=SIZES[0], help="bidisperse: 1:1.4, half and half (default)"
    )
    parser.add_argument("--potential", choices=EXPONENTS, default="harmonic", help="(default harmonic)")
    parser.add_argument(
        "--tolerance", type=float, default=1e-6, metavar="T", help="max|F|/(p d) of a minimum (default 1e-6)"
    )
    parser.add_argument(
        "--protocol", choices=DEFAULTS, default="random", help="how samples are made (default random)"
    )
    parser.add_argument(
        "--separated",
        action="store_true",
        help="large disks start on one side of the cell, small on the other",
    )
    sheared = parser.add_argument_group("protocols shear and compress")
    sheared.add_argument("--step", type=float, metavar="DG", help="strain of one step (default 1e-3)")
    sheared.add_argument(
        "--strain", type=float, metavar="S", help="how far each seed is sheared (default 2; compress: not)"
    )
    shear = parser.add_argument_group("protocol shear")
    shear.add_argument(
        "--discard", type=float, metavar="S", help="strain before the first sample (default 1)"
    )
    shear.add_argument("--every", type=float, metavar="S", help="strain between samples (default 0.02)")
    liquid = parser.add_argument_group("protocol compress")
    liquid.add_argument("--temperature", type=float, metavar="T", help="of the liquid, in k_e (default 1e-3)")
    liquid.add_argument(
        "--cooling-rate", type=float, metavar="R", help="decrease of ln T per sweep of N moves (default 1e-2)"
    )
    liquid.add_argument("--sweeps", type=int, metavar="M", help="at T before cooling (default 200)")
    parser.set_defaults(run=run, check=check, takes_petsc=lambda args: True)


def run(args, petsc_argv) -> int:
    """Make the samples, each on one rank, and write them. Collective."""
    import time

    from jampetsc import session
    from jampetsc.collective import by_rank_0
    from jampetsc.flows.record import remove_checkpoint
    from jampetsc.storage.outputs import check_output

    began = time.perf_counter()
    tasks, protocol = check(args)
    running = session.start("real", petsc_argv)
    comm = running.comm
    by_rank_0(comm, lambda: check_output(args.out, FORMAT))
    from jampetsc.solvers import local

    record = _samples(args, tasks, protocol, comm, local.NewtonSolver())
    by_rank_0(comm, lambda: _write(args, record, protocol, running, time.perf_counter() - began))
    by_rank_0(comm, lambda: remove_checkpoint(args.out))
    if running.rank == 0:
        print(_summary(args, record))
    return 0


def check(args):
    """([(φ, seed)] of all samples, their Protocol). Raises InputError."""
    from jampetsc.words.flowing import PHIS
    from jampetsc.words.packtasks import FEWEST, LAST_SEED, MOST

    if not FEWEST <= args.n <= MOST:
        raise InputError(f"--n {args.n}: must lie in [{FEWEST}, {MOST}]")
    if not 1e-13 <= args.tolerance <= 1e-2:
        raise InputError(f"--tolerance {args.tolerance:g}: must lie in [1e-13, 1e-2]")
    try:
        first, last = (int(word) for word in args.seeds.split(":"))
    except ValueError:
        raise InputError(f"--seeds {args.seeds}: must be FIRST:LAST, for instance 1:20") from None
    if not 0 <= first <= last <= LAST_SEED:
        raise InputError(f"--seeds {args.seeds}: must be FIRST:LAST with 0 <= FIRST <= LAST")
    phis = _phis(args.phi)
    for phi in phis:
        if not PHIS[0] <= phi <= PHIS[1]:
            raise InputError(f"--phi {phi:g}: must lie in [{PHIS[0]:g}, {PHIS[1]:g}]; disks jam near 0.84")
    protocol = _protocol(args)
    count = (last - first + 1) * len(phis) * protocol.rows
    if count > MANY:
        raise InputError(f"{count} samples: at most {MANY} in one file")
    return [(phi, seed) for phi in phis for seed in range(first, last + 1)], protocol


def _protocol(args):
    """The protocol with its options, given or not. Raises InputError."""
    from jampetsc.flows.jamming import Protocol

    for other, options in DEFAULTS.items():
        for name in options:
            value, word = getattr(args, name), f"--{name.replace('_', '-')}"
            if value is not None and name not in DEFAULTS[args.protocol]:
                raise InputError(
                    f"{word} {value:g}: belongs to --protocol {other}, not {args.protocol}; leave it out"
                )
            low, high = LIMITS[name]
            if value is not None and not low <= value <= high:
                raise InputError(f"{word} {value:g}: must lie in [{low:g}, {high:g}]")
    given = {name: getattr(args, name) for name in DEFAULTS[args.protocol]}
    defaults = DEFAULTS[args.protocol]
    given = {name: defaults[name] if value is None else value for name, value in given.items()}
    if args.protocol == "compress" and (args.step or args.strain):
        given["step"] = given["step"] or DEFAULTS["shear"]["step"]
        if not given["strain"] or given["strain"] < given["step"]:
            raise InputError(f"--step {given['step']:g}: give a --strain of that or more, too")
    protocol = Protocol(args.protocol, **given, separated=args.separated)
    if protocol.name == "shear":
        if not protocol.step <= protocol.every * (1 + 1e-9):
            raise InputError(f"--every {protocol.every:g}: must be a --step of {protocol.step:g} or more")
        if not protocol.rows:
            raise InputError(
                f"--strain {protocol.strain:g}: no sample before it: --discard {protocol.discard:g}, "
                f"then --every {protocol.every:g}"
            )
    return protocol


def _phis(text):
    import numpy as np

    try:
        if ":" not in text:
            return sorted({float(word) for word in text.split(",")})
        low, high, count = text.split(":")
        if not 1 <= int(count) <= MANY:
            raise ValueError
        return [float(phi) for phi in np.linspace(float(low), float(high), int(count))]
    except ValueError:
        raise InputError(f"--phi {text}: write A:B:M, or numbers with commas between") from None


def _samples(args, tasks, protocol, comm, solver):
    """The record of all tasks, in their order. Collective."""
    from jampetsc.collective import by_rank_0
    from jampetsc.contacts.potentials import Potential
    from jampetsc.flows.jamming import samples
    from jampetsc.flows.record import Record, resumed, write_checkpoint
    from jampetsc.packing.sizes import radii_of
    from jampetsc.progress import Progress

    radii = radii_of(args.sizes, args.n)
    radii = radii * (0.5 / radii.min())
    potential = Potential(args.potential, "inverse-square-diameter")
    settings = {
        name: getattr(args, name) for name in ("n", "phi", "seeds", "sizes", "potential", "tolerance")
    }
    settings |= vars(protocol)
    columns = dict.fromkeys(protocol.columns, 0)
    kept = by_rank_0(comm, lambda: resumed(args.out, settings, columns))
    record = kept[0] if kept else Record(columns)
    size = ROUND[protocol.name] * comm.size
    rounds, done = -(-len(tasks) // size), len(record) // protocol.rows
    with Progress(rounds, "jam", comm.rank, done // size) as progress:
        while done < len(tasks):
            batch = tasks[done : done + size]
            mine = [
                samples(protocol, radii, *task, potential, solver, args.tolerance)
                for task in batch[comm.rank :: comm.size]
            ]
            found = [None] * len(batch)
            for rank, some in enumerate(comm.allgather(mine)):
                found[rank :: comm.size] = some
            for one in found:
                for row in one:
                    record.add(**row)
            done += len(batch)
            by_rank_0(comm, lambda: write_checkpoint(args.out, record, {"samples": len(record)}, settings))
            progress.step(f"{len(record)} of {len(tasks) * protocol.rows} samples, phi = {batch[-1][0]:.6g}")
    return record


def _write(args, record, protocol, running, seconds):
    from jampetsc import session
    from jampetsc.flows.slowly import ENERGY_CUT
    from jampetsc.storage.provenance import provenance
    from jampetsc.storage.result_file import ResultWriter
    from jampetsc.words.flowing import UNITS

    with ResultWriter(args.out, FORMAT) as writer:
        for name in protocol.columns:
            writer.dataset(name, record.series(name))
        writer.attributes(
            **provenance(
                versions=session.versions(),
                scalar_type=running.scalar_type,
                petsc_options=running.options_told(),
                ranks=running.size,
                packing=(None, None),
                law={},
                wall_seconds=seconds,
            ),
            particle_count=args.n,
            protocol=protocol.name,
            **protocol.facts,
            sizes=args.sizes,
            potential=args.potential,
            stiffness="inverse-square-diameter",
            units=UNITS,
            tolerance=args.tolerance,
            energy_cut=ENERGY_CUT,
        )


def _summary(args, record):
    """A line for every φ."""
    import numpy as np

    from jampetsc.analysis.jamming import share_of

    names = ("phi", "seed", "jammed", "pressure")
    phi, seed, jammed, pressure = (record.series(name) for name in names)
    lines = [f"{args.out}: {len(record)} samples of {args.n} disks"]
    for value in np.unique(phi):
        here = (phi == value) & np.isfinite(jammed)
        if not here.any():
            lines.append(f"  phi = {value:.6g}: no minimum found")
            continue
        share = share_of([jammed[here & (seed == one)] for one in np.unique(seed[here])])
        hard = here & (jammed == 1)
        mean = f", p of the jammed {pressure[hard].mean():.4g}" if hard.any() else ""
        error = 0.5 * (share.high - share.low)
        lines.append(
            f"  phi = {value:.6g}: jammed {share.value:.3f} ± {error:.2g} (as of {share.independent:.0f} independent "
            f"samples){mean}{_told(record, phi == value)}"
        )
    lost = int(np.count_nonzero(~np.isfinite(jammed)))
    return "\n".join(lines + ([f"  {lost} samples reached no minimum: nan in the file"] if lost else []))


def _told(record, rows):
    """φ_J and segregation of these rows, where samples have them."""
    import numpy as np

    from jampetsc.analysis.statistics import mean_with_error

    parts = []
    for name in ("phi_J", "segregation"):
        values = record.series(name)[rows] if name in record.columns else np.zeros(0)
        values = values[np.isfinite(values)]
        if len(values) > 1:
            mean, error = mean_with_error(values)
            parts.append(f", {name} {mean:.5g} ± {error:.2g}")
    return "".join(parts)
