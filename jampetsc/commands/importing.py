"""`jampetsc import FILE --out FILE`: a published packing as a packing file."""


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "import",
        help="turn a published packing (jamBashbulk text, jax-md netCDF4) into a packing file",
        description="Turn a published packing into a packing file: jamBashbulk text (U = ½ δ², k = 1) or "
        "jax-md netCDF4 (U = ½ (1 − r/σ)²). Pressure and energy must agree with those stored in FILE.",
    )
    parser.add_argument("file", metavar="FILE", help="file of the other program; its kind is found out")
    parser.add_argument("--out", metavar="FILE", required=True, help="packing file to write")
    parser.add_argument(
        "--index", type=int, default=0, metavar="I", help="which packing of FILE, from 0 (default 0)"
    )
    parser.set_defaults(run=run)


def run(args, petsc_argv) -> int:
    """Import, write and print what was found beside what was published."""
    from jampetsc.contacts.state import measure
    from jampetsc.storage.importers import import_packing
    from jampetsc.storage.outputs import check_output
    from jampetsc.storage.packing_file import FORMAT, write_packing

    check_output(args.out, FORMAT, [args.file])
    disks = import_packing(args.file, args.index)
    write_packing(args.out, disks)
    state = measure(disks)
    print(f"{args.out}: {disks.n} disks, phi = {disks.phi:.9g}")
    for name in ("pressure", "energy"):
        published = disks.record.get(f"published_{name}")
        beside = "" if published is None else f"   published {published:.9g}"
        print(f"  {name:9s} {disks.record[name]:.9g}{beside}")
    rattlers = int(state.rattlers.sum())
    print(f"  contacts  {len(state.contacts)}, Z = {state.coordination:.6g}, rattlers {rattlers}")
    return 0
