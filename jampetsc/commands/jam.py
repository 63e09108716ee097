"""`jampetsc jam`: which of many random packings jam at a packing fraction, and how hard."""

from jampetsc.contacts.potentials import EXPONENTS
from jampetsc.errors import InputError
from jampetsc.packing.sizes import SIZES

FORMAT = "jampetsc-jam"
MANY = 1_000_000  # samples of one run
ROUND = 20  # samples of a rank between two checkpoints
COLUMNS = {name: 0 for name in ("phi", "seed", "energy", "pressure", "jammed", "coordination")}
EPILOG = """examples
  jampetsc jam --n 64 --phi 0.83:0.85:9 --seeds 1:500 --out f64.h5
  mpirun -n 2 jampetsc jam --n 256 --phi 0.84,0.8425 --seeds 1:100 --out f256.h5

A run that was killed goes on when the same command is given again. Options of the Newton steps have the prefix
-newton_."""


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "jam",
        help="the fraction of random packings that jam, and their pressures",
        description="Quench many random starts at each packing fraction: jammed or not, energy, pressure.",
        epilog=EPILOG,
        allow_abbrev=False,
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
    parser.set_defaults(run=run, check=check, takes_petsc=lambda args: True)


def run(args, petsc_argv) -> int:
    """Make the samples, each on one rank, and write them. Collective."""
    import time

    from jampetsc import session
    from jampetsc.collective import by_rank_0
    from jampetsc.storage.outputs import check_output

    began = time.perf_counter()
    tasks = check(args)
    running = session.start("real", petsc_argv)
    comm = running.comm
    by_rank_0(comm, lambda: check_output(args.out, FORMAT))
    from jampetsc.solvers import local
    from jampetsc.solvers.rehearsal import rehearse

    rehearse(local.rehearse)
    record = _samples(args, tasks, comm, local.NewtonSolver())
    by_rank_0(comm, lambda: _write(args, record, running, time.perf_counter() - began))
    if running.rank == 0:
        print(_summary(args, record))
    return 0


def check(args):
    """[(φ, seed)] of all samples. Raises InputError."""
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
    if (last - first + 1) * len(phis) > MANY:
        raise InputError(f"{(last - first + 1) * len(phis)} samples: at most {MANY} in one file")
    return [(phi, seed) for phi in phis for seed in range(first, last + 1)]


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


def _samples(args, tasks, comm, solver):
    """The record of all tasks, in their order. Collective."""
    from jampetsc.collective import by_rank_0
    from jampetsc.contacts.potentials import Potential
    from jampetsc.flow.jamming import sample
    from jampetsc.flow.record import Record, remove_checkpoint, resumed, write_checkpoint
    from jampetsc.packing.sizes import radii_of
    from jampetsc.progress import Progress

    radii = radii_of(args.sizes, args.n)
    radii = radii * (0.5 / radii.min())
    potential = Potential(args.potential, "inverse-square-diameter")
    settings = {
        name: getattr(args, name) for name in ("n", "phi", "seeds", "sizes", "potential", "tolerance")
    }
    kept = by_rank_0(comm, lambda: resumed(args.out, settings, COLUMNS))
    record = kept[0] if kept else Record(COLUMNS)
    size = ROUND * comm.size
    rounds = -(-len(tasks) // size)
    with Progress(rounds, "jam", comm.rank, len(record) // size) as progress:
        while len(record) < len(tasks):
            batch = tasks[len(record) : len(record) + size]
            mine = [
                sample(radii, *task, potential, solver, args.tolerance)
                for task in batch[comm.rank :: comm.size]
            ]
            found = [None] * len(batch)
            for rank, some in enumerate(comm.allgather(mine)):
                found[rank :: comm.size] = some
            for one in found:
                record.add(**vars(one))
            by_rank_0(comm, lambda: write_checkpoint(args.out, record, {"samples": len(record)}, settings))
            progress.step(f"{len(record)} of {len(tasks)} samples, phi = {batch[-1][0]:.6g}")
    by_rank_0(comm, lambda: remove_checkpoint(args.out))
    return record


def _write(args, record, running, seconds):
    from jampetsc import session
    from jampetsc.flow.slowly import ENERGY_CUT
    from jampetsc.storage.provenance import provenance
    from jampetsc.storage.result_file import ResultWriter
    from jampetsc.words.flowing import UNITS

    with ResultWriter(args.out, FORMAT) as writer:
        for name in COLUMNS:
            writer.dataset(name, record.series(name))
        writer.attributes(
            **provenance(
                versions=session.versions(),
                scalar_type=running.scalar_type,
                petsc_options=" ".join(running.petsc_argv),
                ranks=running.size,
                packing=(None, None),
                law={},
                wall_seconds=seconds,
            ),
            particle_count=args.n,
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

    phi, jammed, pressure = (record.series(name) for name in ("phi", "jammed", "pressure"))
    lines = [f"{args.out}: {len(record)} samples of {args.n} disks"]
    for value in np.unique(phi):
        here = (phi == value) & np.isfinite(jammed)
        count = int(here.sum())
        if not count:
            lines.append(f"  phi = {value:.6g}: no minimum found")
            continue
        share = float(jammed[here].mean())
        hard = here & (jammed == 1)
        mean = f", p of the jammed {pressure[hard].mean():.4g}" if hard.any() else ""
        lines.append(
            f"  phi = {value:.6g}: jammed {share:.3f} ± {np.sqrt(share * (1 - share) / count):.2g}{mean}"
        )
    lost = int(np.count_nonzero(~np.isfinite(jammed)))
    return "\n".join(lines + ([f"  {lost} samples reached no minimum: nan in the file"] if lost else []))
