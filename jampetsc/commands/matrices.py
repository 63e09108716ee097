"""`jampetsc matrices PACKING --out FILE`: K, B and what goes with them as scipy, Matrix Market or PETSc read them."""

from jampetsc.words.law import add_law_options, physics_from


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "matrices",
        help="write K, B and the border of a packing for scipy, Matrix Market or PETSc",
        description="Write K and B of a packing, nothing held and nothing scaled, with k_gamma, b_gamma, k_gg, b_gg, "
        "the area, which unknown is which disk and component, and the unknowns to leave out where K + i omega B is "
        "to be regular (pins). docs/python.md computes G* of them in five lines.",
        epilog="Example: jampetsc matrices p.h5 --beta 0.1 --out K.npz",
    )
    parser.add_argument("packing", metavar="PACKING", help="packing file")
    parser.add_argument(
        "--out",
        metavar="FILE",
        required=True,
        help="file to write: .npz (numpy), .petsc (PETSc binary) or .mtx (Matrix Market, NAME-K.mtx and so on)",
    )
    add_law_options(parser)
    parser.set_defaults(run=run, check=physics_from, takes_petsc=lambda args: True)


def run(args, petsc_argv) -> int:
    """Assemble, write and print what was written. Collective."""
    from jampetsc import session
    from jampetsc.errors import InputError
    from jampetsc.mechanics.matrices import files_of, matrices_of, write_matrices
    from jampetsc.storage.outputs import check_output, exported
    from jampetsc.storage.packing_file import read_packing

    physics = physics_from(args)
    files = files_of(args.out)
    for path in files.values():
        check_output(path, exported(path), [args.packing])
    running = session.start("real", petsc_argv)
    disks = read_packing(args.packing, running.comm)
    try:
        matrices = matrices_of(disks, physics, running.comm)
    except InputError as error:
        raise InputError(f"{args.packing}: {error}") from None
    write_matrices(args.out, matrices)
    if running.rank == 0:
        told = ", ".join(map(str, files.values()))
        print(
            f"{told}: {physics}, {len(matrices.dofs)} unknowns of {len(matrices.particles)} disks, "
            f"{len(matrices.pins)} pins"
        )
    matrices.destroy()
    return 0
