"""`jampetsc modes`: the lowest vibrational modes of a packing, their count certified."""

from jampetsc.errors import InputError

DEFAULT_COUNT = 50


def add_parser(subparsers):
    """Register the command."""
    parser = subparsers.add_parser(
        "modes",
        help="lowest modes of K, how floppy they are, and what they carry of the response to shear",
        description="Lowest modes of the Hessian K (translations left out; masses are one, so frequencies "
        "are the square roots of the "
        "eigenvalues): floppiness, participation ratio, share of the response to shear. That no mode was "
        "missed is proved by inertia.",
        epilog="PETSc options: -modes_… reach SLEPc's eigensolver, -inertia_… the proof that no mode was missed. Where "
        "most of the modes are asked for, LAPACK finds them. For hundreds: -options_file jampetsc:modes_many.",
    )
    parser.add_argument("packing", metavar="PACKING", help="packing file")
    parser.add_argument("--out", required=True, metavar="FILE", help="result file (HDF5)")
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--count",
        type=int,
        metavar="M",
        help=f"the lowest M modes (default {DEFAULT_COUNT}); a cluster is kept whole",
    )
    which.add_argument(
        "--below", type=float, metavar="LAMBDA", help="all modes with eigenvalues below LAMBDA, in units of k"
    )
    which.add_argument(
        "--all",
        action="store_true",
        help="all modes, by LAPACK on one rank: up to 4096 disks, 8 (2N)² bytes in the file",
    )
    parser.add_argument(
        "--no-prestress", action="store_true", help="drop the f/r term of K (BT: 'without pre-stress')"
    )
    parser.set_defaults(run=run, check=check, takes_petsc=lambda args: True)


def check(args):
    """Raises InputError for values that no packing can have."""
    from jampetsc.solvers.inertia import SHIFT

    if args.count is not None and args.count < 1:
        raise InputError(f"--count {args.count}: must be at least 1")
    if args.below is not None and not 0 < args.below < float("inf"):
        raise InputError(f"--below {args.below:g}: must be positive")
    if args.below is not None and args.below <= SHIFT:
        raise InputError(
            f"--below {args.below:g}: must be above {SHIFT:g}; softer modes cannot be told from translations"
        )


def run(args, petsc_argv) -> int:
    """Find the modes and write them. Collective."""
    from jampetsc import session
    from jampetsc.response import modes_file
    from jampetsc.storage.outputs import check_output

    check(args)
    check_output(args.out, modes_file.FORMAT, [args.packing])
    running = session.start("real", petsc_argv)
    from jampetsc.solvers import eigen, inertia, shifted
    from jampetsc.solvers.rehearsal import rehearse

    # shifted: for the shares that the modes have of the response to shear
    rehearse(inertia.rehearse, shifted.rehearse, *([] if args.all else [eigen.rehearse]))
    count = DEFAULT_COUNT if args.count is None and args.below is None and not args.all else args.count
    modes = modes_file.run(args.packing, args.out, not args.no_prestress, count, args.below)
    if running.rank == 0:
        print(summary(args.out, modes))
    return 0


def summary(out, modes) -> str:
    """What a user wants to read."""
    m = len(modes.eigenvalues)
    proof = (
        "all there are"
        if modes.complete
        else f"inertia counts {modes.inertia_count} below {modes.inertia_shift:.4g}"
    )
    lines = [
        f"{out}: {m} modes, {'pre-stress' if modes.network.prestress else 'no pre-stress'}; {proof}",
        f"  eigenvalues {modes.eigenvalues[0]:.6g} to {modes.eigenvalues[-1]:.6g}, residuals ≤ "
        f"{modes.residuals.max():.1e}",
        f"  floppiness (rms Δu⊥ / Δu∥) {modes.floppiness[0]:.3g} to {modes.floppiness[-1]:.3g}",
    ]
    if modes.carried is None:
        lines.append(
            "  the response to shear is affine, or not unique because of zero modes: no shares of it"
        )
    else:
        names = {"nonaffine": "|u_na|²", "transverse": "Δu⊥²", "normal": "Δu∥²", "modulus": "G_affine − G0"}
        parts = [f"{100 * modes.carried.share[key].sum():.3g} % of {name}" for key, name in names.items()]
        lines.append(f"  together {', '.join(parts)}")
    return "\n".join(lines)
