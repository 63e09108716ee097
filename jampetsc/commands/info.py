"""`jampetsc info FILE`: what a packing or a result is, in words and numbers."""

from jampetsc.errors import InputError
from jampetsc.words.law import add_law_options, physics_from


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "info",
        help="tell what a file holds; with --matrices whether a packing is a minimum",
        description="Tell what a packing or a result file holds. --matrices also assembles K and B of a "
        "packing, in parallel under mpirun, and counts their negative, zero and positive eigenvalues.",
        epilog="PETSc options: -inertia_… reach the factorisations of --matrices.",
    )
    parser.add_argument("file", metavar="FILE", help="packing file, result file or folder of a study")
    parser.add_argument(
        "--matrices", action="store_true", help="assemble K and B and count their eigenvalues"
    )
    add_law_options(parser)
    parser.set_defaults(run=run, takes_petsc=lambda args: args.matrices)


def run(args, petsc_argv) -> int:
    """Print the description; collective with --matrices."""
    from jampetsc.contacts.disks import Disks
    from jampetsc.contacts.laws import Physics, damping_law
    from jampetsc.storage.ensemble import Ensemble
    from jampetsc.storage.reader import load
    from jampetsc.words import describe

    physics = physics_from(args)
    if not args.matrices and physics != Physics(damping_law()):
        raise InputError(f"{physics}: only the matrices depend on a damping law; add --matrices")
    loaded = load(args.file)
    if isinstance(loaded, Ensemble):
        if args.matrices:
            raise InputError(f"{args.file}: is the folder of a study: --matrices needs a packing")
        print(describe.study(args.file, loaded))
        return 0
    if not isinstance(loaded, Disks):
        if args.matrices:
            raise InputError(f"{args.file}: is a {loaded.format} file: --matrices needs a packing")
        print(describe.result(args.file, loaded))
        return 0
    if not args.matrices:
        print(describe.packing(args.file, loaded))
        return 0

    from jampetsc import session
    from jampetsc.mechanics.examine import examine
    from jampetsc.mechanics.network import build_network
    from jampetsc.storage.packing_file import read_packing

    running = session.start("real", petsc_argv)
    disks = read_packing(args.file, running.comm)  # of one rank for all: the file may have been replaced
    if running.rank == 0:
        print(describe.packing(args.file, disks), flush=True)
    network = build_network(disks, running.comm, physics.prestress)
    facts = examine(network, physics.law)
    if running.rank == 0:
        print("\n" + describe.matrices(disks, network, physics, facts, running.size))
    return 0
