"""`jampetsc spectrum`: relaxation spectrum, stress relaxation and creep of a sweep; without PETSc or MPI."""

from jampetsc.errors import InputError

FORMAT = "jampetsc-spectrum"
HDF5 = (".h5", ".hdf5")  # endings of a file; those of a picture are `plots.style.FORMATS`

DESCRIPTION = """\
What a sweep with --method rational says about the response in time: relaxation times and weights, the
spectrum H(tau), stress relaxation G(t), creep compliance J(t) and its retardation spectrum. One sweep gives
an HDF5 file, where FILE ends in .h5; any number of sweeps give a picture, where it ends in .png, .pdf or
.svg."""
EPILOG = """\
A packing has thousands of modes, the spectrum of a sweep a few tens: nodes of a quadrature that gives G* to
the accuracy of the sweep. H(tau) is therefore given as its mean between neighbouring nodes, and averaged
over a window (--window, in decades) that is twice as wide as the widest gap between nodes unless you choose.

examples:
  jampetsc spectrum sweep.h5 --out spectrum.h5
  jampetsc spectrum p1e-2.h5 p1e-3.h5 p1e-4.h5 --out spectra.png"""


def add_parser(subparsers) -> None:
    """Add `spectrum` to the command line."""
    parser = subparsers.add_parser(
        "spectrum",
        help="relaxation spectrum, G(t) and J(t) of a sweep",
        description=DESCRIPTION,
        epilog=EPILOG,
    )
    parser.add_argument("files", nargs="+", metavar="SWEEP", help="sweeps by the rational method")
    parser.add_argument("--out", required=True, metavar="FILE", help="result (HDF5), or picture")
    parser.add_argument(
        "--window",
        type=float,
        metavar="DECADES",
        help="H(tau) is averaged over so many decades (0.01 to 1.5)",
    )
    parser.set_defaults(run=run, check=check)


def check(args):
    """Raises InputError for values that no sweep can have."""
    from jampetsc.analysis.relaxation import WIDEST

    if args.window is not None and not 0.01 <= args.window <= WIDEST:
        raise InputError(f"--window {args.window:g}: choose between 0.01 and {WIDEST:g} decades")


def run(args, petsc_argv) -> int:
    """Write the spectrum or draw the spectra; prints a summary. Raises InputError."""
    from pathlib import Path

    from jampetsc.plots.style import FORMATS
    from jampetsc.storage.outputs import PICTURE, check_output
    from jampetsc.storage.reader import SweepResult, load
    from jampetsc.words.files import refuse_repeated

    check(args)
    suffix = Path(args.out).suffix.lower()
    picture = suffix in FORMATS
    if not picture and suffix not in HDF5:
        raise InputError(
            f"--out {args.out}: give it the ending {HDF5[0]} for a file, {', '.join(FORMATS)} for a picture"
        )
    if not picture and len(args.files) > 1:
        raise InputError(
            f"--out {args.out}: a file holds one spectrum, not {len(args.files)}: run once for each, or draw them"
        )
    refuse_repeated(args.files)
    check_output(args.out, PICTURE if picture else FORMAT, args.files)
    sweeps = [load(path) for path in args.files]
    for path, sweep in zip(args.files, sweeps, strict=True):
        if not isinstance(sweep, SweepResult):
            raise InputError(f"{path}: is not a sweep: spectra come from `jampetsc sweep`")
    if picture:
        from jampetsc.plots.spectrum import plot_relaxation, spectrum_curve
        from jampetsc.plots.style import save

        drawn = plot_relaxation.draw([spectrum_curve(sweep, args.window) for sweep in sweeps])
        save(drawn.figure, args.out)
        print(f"{args.out}: {drawn.text}")
        return 0
    print(_write(sweeps[0], args.out, args.window))
    return 0


def _write(sweep, out, window):
    """Write the file and return the summary."""
    import time

    from jampetsc.analysis.transient import transient
    from jampetsc.storage.provenance import derived_from
    from jampetsc.storage.result_file import ResultWriter

    began = time.perf_counter()
    slowest, fastest = sweep.frequency_range
    spectrum = sweep.spectrum.sorted()
    found = transient(spectrum, slowest, fastest, window)
    times, between = spectrum.between()
    late = found.retardation
    with ResultWriter(out, FORMAT) as writer:
        for name, values in {
            "relaxation/times": times,
            "relaxation/rates": spectrum.rates,
            "relaxation/weights": spectrum.weights,
            "H/between": between,
            "H/tau": found.tau,
            "H/smoothed": found.H,
            "stress/time": found.time,
            "stress/G": found.G,
            "creep/time": found.creep_time,
            "creep/J": found.J,
            "retardation/rates": late.rates,
            "retardation/compliances": late.compliances,
        }.items():
            writer.dataset(name, values)
        writer.attributes(
            **derived_from([sweep], time.perf_counter() - began),
            G0=spectrum.G0,
            G_inf=spectrum.G_inf,
            eta0=spectrum.eta0,
            eta_inf=spectrum.eta_inf,
            J_inf=late.J_inf,
            fluidity=late.fluidity,
            growth_rate=late.growth_rate,
            window_decades=found.window,
            resolution_decades=spectrum.resolution,
            slowest_omega=slowest,
            fastest_omega=fastest,
        )
    return _summary(out, sweep, spectrum, found)


def _summary(out, sweep, spectrum, found):
    late = found.retardation
    lines = [f"{out}: {len(spectrum.rates)} relaxation times"]
    if len(spectrum.rates):
        times = 1.0 / spectrum.rates
        lines[0] += f" from {times[0]:.3g} to {times[-1]:.3g}, H averaged over {found.window:.2g} decades"
    lines.append(
        f"  G(0+) = {spectrum.G_inf:.6g} and {spectrum.eta_inf:.6g} delta(t), "
        f"G(t -> inf) = {spectrum.G0:.6g}, eta0 = {spectrum.eta0:.6g}"
    )
    if late.growth_rate:
        lines.append(
            f"  G0 < 0: the packing is unstable to shear, creep diverges as exp({late.growth_rate:.3g} t)"
        )
    elif late.fluidity:
        lines.append(f"  G0 = 0: it flows in the end, J(t) -> {late.fluidity:.6g} t")
    else:
        lines.append(
            f"  J(t -> inf) = 1/G0 = {1.0 / spectrum.G0:.6g}, slowest retardation {1 / late.rates[0]:.3g}"
        )
    slowest, fastest = sweep.frequency_range
    if len(spectrum.rates) and not (
        slowest < 0.1 * spectrum.rates[-1] and fastest > 10.0 * spectrum.rates[0]
    ):
        lines.append(
            f"  the sweep covers times {1 / fastest:.3g} to {1 / slowest:.3g}: "
            "what is faster or slower is not certified"
        )
    if sweep.damping is not None:
        lines.append(
            "  this is the spectrum of linear damping: --alpha is not in it, and J(t), G(t) need linearity"
        )
    return "\n".join(lines)
