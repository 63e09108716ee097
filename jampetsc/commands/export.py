"""`jampetsc export FILE --out FILE`: packings, modes, fields and flows for OVITO, ASE, LAMMPS, ParaView and HOOMD."""

from jampetsc.errors import InputError


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "export",
        help="write packings, modes, fields and flows for OVITO, ASE, LAMMPS, ParaView, HOOMD and numpy",
        description="Write a packing for other programs, with radius, coordination, rattlers and stress of every "
        "disk and its contacts (data, vtp, npz, gsd) with force and overlap; the motion in a mode, in a sweep's field "
        "or in slow shear as vectors on its packing; or the snapshots of a flow, with velocities, as frames of one "
        "file (xyz, dump, gsd). The ending of --out chooses the format.",
        epilog="Example: jampetsc export modes.h5 --mode 3 --out mode3.xyz",
    )
    parser.add_argument(
        "file", metavar="FILE", help="packing, modes, sweep with fields, quasistatic or flow file"
    )
    parser.add_argument(
        "--out", metavar="FILE", required=True, help="file to write: .xyz, .dump, .data, .vtp, .npz or .gsd"
    )
    parser.add_argument(
        "--mode", type=int, metavar="I", help="of a modes file: which mode, from 1 (default 1)"
    )
    parser.add_argument("--field", type=float, metavar="OMEGA", help="of a sweep: frequency of the field")
    parser.add_argument("--packing", metavar="FILE", help="packing of a result, if it is not beside it")
    parser.set_defaults(run=run)


def run(args, petsc_argv) -> int:
    """Write the file and print what it holds."""
    from jampetsc.storage.exporters import check_format, write_frames
    from jampetsc.storage.outputs import check_output, exported
    from jampetsc.storage.reader import load

    if args.field is not None and not 0 < args.field < float("inf"):
        raise InputError(f"--field {args.field:g}: must be a positive frequency")
    check_format(args.out)
    check_output(args.out, exported(args.out), [args.file, *filter(None, [args.packing])])
    loaded = load(args.file)
    frames = _frames(args, loaded)
    count = write_frames(args.out, frames)
    print(f"{args.out}: {count} frame{'s' * (count != 1)} of {args.file}")
    return 0


def _frames(args, loaded):
    """The frames that are asked for. Raises InputError for a file that has none, and for options of other files."""
    from jampetsc.contacts.disks import Disks
    from jampetsc.storage import frames

    kind = "packing" if isinstance(loaded, Disks) else loaded.format.removeprefix("jampetsc-")
    for option, owners in {
        "mode": ("modes",),
        "field": ("sweep",),
        "packing": ("modes", "sweep", "quasistatic"),
    }.items():
        if getattr(args, option) is not None and kind not in owners:
            raise InputError(
                f"--{option}: is of {' or '.join(owners)} files, and {args.file} is a {kind} file"
            )
    if kind == "packing":
        return [frames.packing_frame(loaded)]
    if kind == "flow":
        return frames.flow_frames(loaded)
    if kind == "modes":
        return [frames.mode_frame(loaded, 1 if args.mode is None else args.mode, args.packing)]
    if kind == "quasistatic":
        return [frames.slow_frame(loaded, args.packing)]
    if kind == "sweep":
        if args.field is None:
            known = ", ".join(f"{omega:g}" for omega in loaded.fields.omega)
            raise InputError(f"{args.file}: give --field OMEGA: it has fields at omega = {known}")
        return [frames.field_frame(loaded, args.field, args.packing)]
    raise InputError(
        f"{args.file}: is a {kind} file: export packing, modes, sweep, quasistatic or flow files"
    )
