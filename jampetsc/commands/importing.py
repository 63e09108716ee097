"""`jampetsc import FILE --out FILE`: a packing of another program as a packing file."""

from jampetsc.contacts.potentials import EXPONENTS, STIFFNESSES
from jampetsc.storage.exchange import READERS


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "import",
        help="turn a packing of another program into a packing file",
        description="Turn a packing of another program into a packing file: LAMMPS data (atom style sphere) and dump, "
        "extended XYZ, GSD (needs the package gsd), lines x y r with a line 'box Lx Ly xy', npz with positions, radii "
        "or diameters, and box; periodic in x and y, in one plane. Lengths are taken as they are. Of published "
        "files, jamBashbulk text (U = ½ δ², k = 1) and jax-md netCDF4 (U = ½ (1 − r/σ)²), pressure and energy must "
        "agree with those stored in FILE.",
    )
    parser.add_argument("file", metavar="FILE", help="file of the other program")
    parser.add_argument("--out", metavar="FILE", required=True, help="packing file to write")
    parser.add_argument("--format", choices=READERS, help="(default: found out)")
    parser.add_argument(
        "--index",
        "--frame",
        type=int,
        default=0,
        metavar="I",
        help="which packing of FILE, from 0 (default 0)",
    )
    parser.add_argument(
        "--radius",
        metavar="COLUMN",
        help="column or array of radii, or of diameters if it is called so (default radius or diameter)",
    )
    parser.add_argument(
        "--box", metavar="L|Lx,Ly[,xy]", help="of a file that has none; a₂ = (xy Ly, Ly): xy is a number"
    )
    parser.add_argument("--potential", choices=EXPONENTS, help="(default harmonic)")
    parser.add_argument(
        "--stiffness", choices=STIFFNESSES, help="convention of the contact stiffness (default constant)"
    )
    parser.add_argument(
        "--k", type=float, metavar="K", help="contact stiffness, in units of FILE (default 1)"
    )
    parser.set_defaults(run=run)


def run(args, petsc_argv) -> int:
    """Import, write and print what was found beside what was published."""
    from jampetsc.contacts.state import BALANCED, imbalance, measure
    from jampetsc.storage.importers import import_packing
    from jampetsc.storage.outputs import check_output
    from jampetsc.storage.packing_file import FORMAT, write_packing

    check_output(args.out, FORMAT, [args.file])
    names = ("format", "radius", "potential", "stiffness", "k")
    disks = import_packing(
        args.file,
        args.index,
        box=args.box and args.box.split(","),
        **{name: getattr(args, name) for name in names},
    )
    write_packing(args.out, disks)
    state, potential = measure(disks), disks.potential
    print(f"{args.out}: {disks.n} disks, phi = {disks.phi:.9g}, read as {disks.record['protocol']}")
    overlap, alpha = ("(δ/σ)" if potential.constants[2] else "δ"), potential.alpha
    print(
        f"  units     lengths as in {args.file}; U = (k/{alpha:g}) {overlap}^{alpha:g}, k = {potential.k:g}"
    )
    (Lx, _), (tilt, Ly) = disks.cell
    print(f"  box       a1 = ({Lx:.9g}, 0), a2 = ({tilt:.9g}, {Ly:.9g})")
    print(f"  radii     {disks.radii.min():.9g} to {disks.radii.max():.9g}")
    for name in ("pressure", "energy"):
        published = disks.record.get(f"published_{name}")
        beside = "" if published is None else f"   published {published:.9g}"
        print(f"  {name:9s} {disks.record[name]:.9g}{beside}")
    rattlers = int(state.rattlers.sum())
    print(f"  contacts  {len(state.contacts)}, Z = {state.coordination:.6g}, rattlers {rattlers}")
    rest = imbalance(disks, state)
    if len(state.contacts) and not rest <= BALANCED:
        print(
            f"  forces    are not balanced, max|F|/(p d) = {rest:.1e}: other radii or another potential than assumed, "
            "too few digits, or no minimum (`jampetsc pack --from` makes it one)"
        )
    return 0
