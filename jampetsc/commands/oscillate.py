"""`jampetsc oscillate`: steady oscillations with power-law damping, without the equivalent linear damping."""

import math

from jampetsc.contacts.laws import FAMILIES, damping_law
from jampetsc.errors import InputError
from jampetsc.words.law import add_law_options, physics_from

EPILOG = """examples
  jampetsc oscillate p1e-3.h5 --out half.h5 --alpha 0.5 --omega 1e-9:1e-5:9 --stress 1e-6,1e-5
  jampetsc oscillate p1e-3.h5 --out strain.h5 --alpha 0.6667 --omega 1e-4 --strain 1e-6
  mpirun -n 2 jampetsc oscillate p1e-3.h5 --out fine.h5 --alpha 0.5 --omega 1e-7 --stress 1e-5 --steps 256
  jampetsc oscillate p1e-3.h5 --out soft.h5 --contacts moving --omega 1e-4 --strain 1e-6,1e-4,1e-3
  jampetsc oscillate p1e-3.h5 --out open.h5 --contacts moving --alpha 0.5 --omega 1e-6 --stress 1e-5,1e-4

PETSc options: -osc_snes_… and -osc_ksp_… reach Newton's method and its linear solver, -osc_factor_… the
factorisations of its preconditioner, -shift_… the proof that the packing is a minimum.
A run that was killed goes on when the same command is given again."""
LARGEST_ALPHA = 2.0
DOUBLES = 1e-300, 1e300  # what ω and ωτ₁ may be
FEWEST, MOST = 16, 4096  # steps
LEAST, MOST_AMPLITUDE = 1e-30, 1.0
LEAST_MOVING = 1e-9  # strain, or stress, whose forces rounding leaves some digits of
FEWEST_CYCLES, MOST_CYCLES = 3, 100_000


def add_parser(subparsers):
    """Register the command."""
    parser = subparsers.add_parser(
        "oscillate",
        help="G*(ω), harmonics and work of a packing with power-law damping",
        description="Steady oscillation of a packing whose contacts are damped by a force ∝ |Δv|^ALPHA: G*(ω) of the "
        "first harmonic, third and fifth harmonic, work per cycle, with an estimate of the error. With fixed contacts "
        "the equations are solved for a whole cycle at once or, below ALPHA = 0.45, where contacts stick, by steps in "
        "time for half a cycle that repeats with its sign changed; with moving contacts, which open and close, cycles "
        "are integrated in time until they repeat.",
        epilog=EPILOG,
    )
    parser.add_argument("packing", metavar="PACKING", help="packing file")
    parser.add_argument("--out", required=True, metavar="FILE", help="result file (HDF5)")
    parser.add_argument(
        "--omega",
        required=True,
        metavar="LOW:HIGH:COUNT|LIST",
        help="frequencies: a logarithmic grid or a list",
    )
    imposed = parser.add_mutually_exclusive_group(required=True)
    imposed.add_argument(
        "--stress", metavar="LIST", help="impose a shear stress of these amplitudes, in units of k"
    )
    imposed.add_argument("--strain", metavar="LIST", help="impose a shear strain of these amplitudes")
    parser.add_argument(
        "--alpha",
        type=float,
        default=1.0,
        metavar="A",
        help=f"exponent of the damping force, above 0, which would be dry friction, and at most {LARGEST_ALPHA:g} "
        "(default 1, linear)",
    )
    parser.add_argument(
        "--contacts",
        choices=("fixed", "moving"),
        default="fixed",
        help="fixed: the contacts of the packing stay as they are (default); moving: they open and close",
    )
    parser.add_argument(
        "--cycles",
        default=None,
        metavar="auto|N",
        help="with moving contacts: how many cycles to compute, first with half as many time steps each, then "
        "with all; auto (default): until one repeats the one before",
    )
    parser.add_argument(
        "--steps", type=int, default=64, metavar="N", help="steps of a cycle, a multiple of 8 (default 64)"
    )
    add_law_options(parser)
    parser.set_defaults(run=run, check=check, takes_petsc=lambda args: True)


def check(args):
    """The Job. Raises InputError."""
    from pathlib import Path

    from jampetsc.oscillation.job import Job

    if not 0.0 < args.alpha <= LARGEST_ALPHA:
        raise InputError(
            f"--alpha {args.alpha:g}: must be above 0, which would be dry friction, and at most {LARGEST_ALPHA:g}"
        )
    physics = physics_from(args)
    if args.contacts == "moving":
        _check_moving(args, physics)
    elif args.cycles is not None:
        raise InputError(
            "--cycles: belongs to --contacts moving; fixed contacts are solved for a steady cycle"
        )
    if not physics.law.damps_contacts:
        owners = [name for name in FAMILIES if damping_law(name).damps_contacts]
        raise InputError(
            f"--law {physics.law.family}: no contact dissipates; oscillate takes --law {' or '.join(owners)}, and "
            "`jampetsc sweep` solves linear damping of any kind"
        )
    if args.steps % 8 or not FEWEST <= args.steps <= MOST:
        raise InputError(f"--steps {args.steps}: must be a multiple of 8 from {FEWEST} to {MOST}")
    return Job(
        packing=Path(args.packing),
        out=Path(args.out),
        physics=physics,
        omega=_frequencies(args.omega, physics.law),
        amplitude=_amplitudes(
            *(("--stress", args.stress) if args.stress is not None else ("--strain", args.strain)),
            LEAST_MOVING if args.contacts == "moving" else LEAST,
        ),
        stress_controlled=args.stress is not None,
        steps=args.steps,
        contacts=args.contacts,
        cycles=None if args.cycles in (None, "auto") else int(args.cycles),
    )


def _check_moving(args, physics):
    """Raises InputError for what moving contacts do not have."""
    moving = "--contacts moving"
    if not physics.prestress:
        raise InputError(
            f"--no-prestress: contacts that open and close have their forces; leave out it or {moving}"
        )
    number = args.cycles or "auto"
    if number != "auto" and not (number.isdecimal() and FEWEST_CYCLES <= int(number) <= MOST_CYCLES):
        raise InputError(f"--cycles {number}: must be auto or a number from {FEWEST_CYCLES} to {MOST_CYCLES}")


def _frequencies(text, law):
    """(M,) increasing. Raises InputError.

    A power law depends on ω^α, which is to have the range that ω has with linear damping.
    """
    from jampetsc.response.limits import LARGEST, SMALLEST
    from jampetsc.words.frequencies import parse_omega

    widened = 1.0 / min(law.exponent, 1.0)
    low, high = DOUBLES
    within = (
        max(low, SMALLEST**widened),
        LARGEST**widened if widened * math.log(LARGEST) < math.log(high) else high,
    )
    omega = parse_omega(text, within=within)
    for end in omega[[0, -1]]:
        if not math.log(low) <= math.log(end) + math.log(law.tau1) <= math.log(high):
            raise InputError(
                f"--omega {end:g} --tau1 {law.tau1:g}: their product must lie between {low:g} and {high:g}"
            )
    return omega


def _amplitudes(option, text, low):
    """(A,) increasing. Raises InputError."""
    import numpy as np

    try:
        values = np.unique([float(word) for word in text.split(",")])
    except ValueError:
        raise InputError(f"{option} {text}: write numbers with commas, such as 1e-6,1e-5") from None
    for value in values:
        if not low <= value <= MOST_AMPLITUDE:  # nan as well
            raise InputError(f"{option} {value:g}: must lie between {low:g} and {MOST_AMPLITUDE:g}")
    return values


def run(args, petsc_argv) -> int:
    """Solve and write. Collective."""
    from jampetsc import session
    from jampetsc.oscillation.job import FORMAT
    from jampetsc.storage.outputs import check_output

    asked = check(args)
    check_output(args.out, FORMAT, [args.packing])
    running = session.start("real", petsc_argv)
    from jampetsc.oscillation import job, newton, preconditioner
    from jampetsc.solvers import inertia, shifted
    from jampetsc.solvers.rehearsal import rehearse

    rehearse(shifted.rehearse, inertia.rehearse, newton.rehearse, preconditioner.rehearse)
    arrays = job.run(asked)
    if running.rank == 0:
        print(summary(asked, arrays))
    return 0


def summary(asked, arrays) -> str:
    """What a user wants to read."""
    G, error = arrays["G"], arrays["error"]
    lines = [
        f"{asked.out}: {asked.physics}, alpha = {asked.physics.law.exponent:g}, {G.size} oscillations, estimated to "
        f"{(error / abs(G)).max():.1e} of |G*|, energy balanced to {abs(arrays['energy_balance']).max():.0e}"
    ]
    for a, amplitude in enumerate(asked.amplitude):
        for m in sorted({0, len(asked.omega) - 1}):
            third = abs(arrays["harmonics"][a, m, 0])
            lines.append(
                f"  {asked.control} {amplitude:.3g}, omega {asked.omega[m]:.3g}: G' = {G[a, m].real:.6g}, "
                f"G'' = {G[a, m].imag:.6g}, third harmonic {100 * third:.2g} %"
            )
    return "\n".join(lines)
