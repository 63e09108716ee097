"""`jampetsc sweep`: G*(ω) of a packing."""

from jampetsc.errors import InputError
from jampetsc.words.law import add_damping_options, add_law_options, damping_from, physics_from

NAME = "sweep"
DEFAULT_OMEGA = "1e-10:1e4:141"
PREFIXES = {"rational": ("shift_", "inertia_"), "direct": ("freq_",)}  # of the PETSc options of each method


def add_parser(subparsers):
    """Register the command."""
    parser = subparsers.add_parser(
        NAME,
        help="complex modulus G*(ω) of a packing",
        description="Complex modulus G*(ω) of a packing under oscillatory shear, each value with a bound on its error.",
        epilog="PETSc options: -shift_… reach the factorisations of the rational method, -freq_… the solver of "
        "--method direct; -options_file jampetsc:low_memory, jampetsc:iterative and others come with the program.",
    )
    parser.add_argument("packing", metavar="PACKING", help="packing file")
    parser.add_argument("--out", required=True, metavar="FILE", help="result file (HDF5)")
    parser.add_argument(
        "--omega",
        default=DEFAULT_OMEGA,
        metavar="LOW:HIGH:COUNT|LIST",
        help="frequencies (in units of 1/τ₁ with the default τ₁ = 1): a logarithmic grid or a list (default "
        f"{DEFAULT_OMEGA})",
    )
    parser.add_argument(
        "--method",
        choices=("rational", "direct"),
        default="rational",
        help="rational: the whole spectrum from a few real factorisations (default); direct: one complex solve per "
        "frequency",
    )
    parser.add_argument(
        "--accuracy",
        type=float,
        default=1e-6,
        metavar="A",
        help="relative error allowed in G' and in G'' each (default 1e-6)",
    )
    parser.add_argument(
        "--parallel",
        choices=("auto", "shifts", "matrix"),
        help="rational method on several ranks: each factorises a shift of its own, or all share each factorisation "
        "(default auto: by the number of ranks and unknowns)",
    )
    parser.add_argument(
        "--fields", default=None, metavar="LIST", help="also store displacement fields at these frequencies"
    )
    add_law_options(parser)
    add_damping_options(parser)
    parser.set_defaults(run=run, check=check, takes_petsc=lambda args: True)


def check(args):
    """(physics, damping, omega, fields) as `Job.read` takes them. Raises InputError."""
    import numpy as np

    from jampetsc.words.frequencies import parse_omega

    physics = physics_from(args)
    damping = damping_from(args, physics.law)
    omega = parse_omega(args.omega)
    fields = np.zeros(0) if args.fields is None else parse_omega(args.fields, "--fields")
    if args.parallel and args.method == "direct":
        raise InputError(
            f"--parallel {args.parallel}: belongs to --method rational; with direct all ranks share each solve"
        )
    if not 1e-12 <= args.accuracy <= 0.1:
        raise InputError(f"--accuracy {args.accuracy:g}: choose between 1e-12 and 0.1")
    return physics, damping, omega, fields


def run(args, petsc_argv) -> int:
    """Run the sweep. Collective."""
    from jampetsc import builds, session
    from jampetsc.response.job import FORMAT, Job
    from jampetsc.storage.outputs import check_output

    physics, damping, omega, fields = check(args)
    check_output(args.out, FORMAT, [args.packing])
    # Real scalars will do for the direct method, but take twice the memory.
    scalar = ("complex" if builds.to_choose("complex") else None) if args.method == "direct" else "real"
    running = session.start(scalar, petsc_argv)
    how = (args.method, args.accuracy, args.out, damping, args.parallel or "auto")
    job = Job.read(args.packing, physics, omega, fields, *how, comm=running.comm)

    from jampetsc.response import direct, direct_sweep, rational_sweep
    from jampetsc.response.stability import settle
    from jampetsc.solvers import inertia, shifted
    from jampetsc.solvers.rehearsal import rehearse

    solvers = {
        "rational": [shifted.rehearse, inertia.rehearse] if job.method == "rational" else [],
        # a packing that turns out to be no minimum is solved by the direct method
        "direct": [] if job.method == "rational" and job.negative_modes == 0 else [direct.rehearse],
    }
    _refuse_options_of_others(running, [method for method, its in solvers.items() if not its])
    rehearse(*solvers["rational"], *solvers["direct"])
    job = settle(job)
    sweep = direct_sweep if job.method == "direct" else rational_sweep
    omega, G, bounds = sweep.run(job)
    if running.rank == 0:
        print(summary(job, job.asked(omega), G, bounds))
    return 0


def _refuse_options_of_others(running, methods):
    """Raise InputError for PETSc options of methods that this run has no use for. Collective."""
    given = running.unused_options()
    for method in methods:
        for name in given:
            if name.startswith(PREFIXES[method]):
                raise InputError(
                    f"PETSc option -{name}: belongs to --method {method}, which this run is not: ask for that, or "
                    "leave the option out"
                )


def summary(job, omega, G, bounds) -> str:
    """What a user wants to read after a sweep."""
    from jampetsc.analysis.bounds import relative_bound

    storage, loss = (
        relative_bound(bound, part).max() for bound, part in ((bounds[:, 1], G.real), (bounds[:, 2], G.imag))
    )
    lines = [
        f"{job.out}: {job.physics}, {len(omega)} frequencies, "
        f"{'certified' if job.certified else 'estimated'} to {storage:.1e} in G' and {loss:.1e} in G''",
    ]
    lines += [
        f"  omega {omega[end]:.3g}: G' = {G[end].real:.6g}, G'' = {G[end].imag:.6g}"
        for end in ((0, -1) if len(omega) > 1 else (0,))
    ]
    return "\n".join(lines + (_damping_lines(job, G) if job.damping else []))


def _damping_lines(job, G):
    """What power-law damping made of the frequencies, and whether the strain stays small."""
    damping = job.damping
    strain = damping.stress * job.disks.potential.k / abs(G).min()
    lines = [
        f"  alpha {damping.alpha:g}, stress {damping.stress:g} k: equivalent linear frequencies "
        f"{job.omega[0]:.3g} to {job.omega[-1]:.3g}; the stored spectrum is that of the linear law"
    ]
    pressure = job.disks.record.get("pressure", float("inf")) / job.disks.potential.k
    if strain > pressure:
        lines.append(
            f"  strain amplitude up to {strain:.1e}, more than p/k = {pressure:.1e}: contacts would change, "
            "which is left out"
        )
    return lines
