"""`jampetsc quasistatic`: response to a slow shear, G₀, bulk modulus, and the viscosities η₀ and η_∞."""

from jampetsc.contacts.laws import having
from jampetsc.errors import InputError
from jampetsc.words.law import add_law_options, physics_from


def add_parser(subparsers):
    """Register the command."""
    parser = subparsers.add_parser(
        "quasistatic",
        help="fields, moduli and viscosities of the limit of slow shear",
        description="Response to a slow shear: Δu∥ and Δu⊥ of every contact and the non-affine "
        "displacement of every disk per unit "
        "strain, their medians, means, rms and histograms; G₀, bulk modulus, η₀ = lim G''/ω and η_∞. Under "
        "a law with pre-stress, "
        "also what K without pre-stress gives (names with no_prestress).",
        epilog="PETSc options: -shift_… reach the factorisations.",
    )
    parser.add_argument("packing", metavar="PACKING", help="packing file")
    parser.add_argument("--out", required=True, metavar="FILE", help="result file (HDF5)")
    parser.add_argument(
        "--betas", metavar="b1,b2,…", help="also η₀ and η_∞ at these β, from the same fields (contact law)"
    )
    add_law_options(parser)
    parser.set_defaults(run=run, check=check, takes_petsc=lambda args: True)


def check(args):
    """(physics, betas). Raises InputError."""
    physics = physics_from(args)
    return physics, _betas(args, physics.law)


def run(args, petsc_argv) -> int:
    """Solve and write. Collective."""
    from jampetsc import session
    from jampetsc.response import quasistatic
    from jampetsc.storage.outputs import check_output

    physics, betas = check(args)
    check_output(args.out, quasistatic.FORMAT, [args.packing])
    running = session.start("real", petsc_argv)
    outcome = quasistatic.run(args.packing, args.out, physics, betas)
    if running.rank == 0:
        print(summary(args.out, physics, outcome))
    return 0


def _betas(args, law):
    """The β of --betas, increasing. Raises InputError."""
    if args.betas is None:
        return []
    owners = having("beta")
    if law.family not in owners:
        raise InputError(
            f"--betas {args.betas}: belongs to --law {' or '.join(owners)}, not to --law {law.family}; leave it out"
        )
    try:
        betas = sorted({float(word) for word in args.betas.split(",")})
    except ValueError:
        raise InputError(f"--betas {args.betas}: write numbers with commas, such as 1e-4,1e-2,1") from None
    for beta in betas:
        law.altered(beta=beta)  # refuses what is out of range
    return betas


def summary(out, physics, outcome) -> str:
    """What a user wants to read."""
    lines = [f"{out}: {physics}, eta_inf = {outcome.eta_inf:.6g}"]
    for name, response in outcome.responses.items():
        found = outcome.distributions[name]
        stress = "pre-stress" if response.network.prestress else "no pre-stress"
        parts = ", ".join(f"{part} {value:.4g}" for part, value in response.flow.parts.items())
        lines += [
            f"  {stress}: G0 = {response.G0:.6g}, bulk modulus {response.bulk_modulus:.6g}, eta0 = "
            f"{response.flow.eta0:.6g} "
            f"({parts}), omega* = {response.crossover:.4g}",
            "    medians per unit strain: "
            + ", ".join(
                f"{symbol} {found[key].median:.4g}"
                for symbol, key in (("|Δu∥|", "normal"), ("|Δu⊥|", "transverse"), ("|u_na|", "nonaffine"))
            )
            + f"; identity kept to {response.identity:.0e}",
        ]
    return "\n".join(lines)
