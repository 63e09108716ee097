"""`jampetsc collapse`: exponents near jamming, by collapse of flow, jam and shear files. Without PETSc or MPI."""

from jampetsc.errors import InputError

FORMAT = "jampetsc-collapse"
OBSERVABLES = "pressure, shear_stress, jammed"
DESCRIPTION = """\
Fit the scaling of an observable O near jamming (Vågberg, thesis ch. 5). Of flow files at several rates and phi
of one N:

  O = rate^(y/znu) [f0(x) + rate^(omega/z) f1(x)],   x = (phi - phi_J) / rate^(1/znu)

and with --finite-size, of jam and shear files at several N and phi, L = sqrt(N):

  O = L^(-y/nu) [f0(x) + L^(-omega) f1(x)],          x = (phi - phi_J) L^(1/nu)

f0 and |f1| are exponentials of polynomials or splines; f1 is there with --corrections. Weighted least squares;
errors from the profile of chi^2 and from fits of higher degrees; the same fit with the largest rates, or smallest N,
left out one by one."""
EPILOG = """\
The name omega stands for omega/z with rates. A small probability of chi^2 says that the form is wrong, or the
errors are.

examples:
  jampetsc collapse rd0-*.h5 --observable pressure --fit phi_J,y,znu --out p.h5
  jampetsc collapse study --observable pressure --fit phi_J,y,znu,omega --corrections --out p.h5
  jampetsc collapse study --where model=CD0 --observable pressure --fit phi_J,y,znu --out cd0.h5
  jampetsc collapse f*.h5 --finite-size --observable jammed --fit phi_J,y=0,nu --out f.h5
  jampetsc plot p.h5 --out p.png"""


def add_parser(subparsers) -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "collapse",
        help="critical exponents from rates or sizes",
        description=DESCRIPTION,
        epilog=EPILOG,
    )
    parser.add_argument(
        "files",
        nargs="+",
        metavar="FILE",
        help="flow files, or jam and shear files, or the folder of a study",
    )
    parser.add_argument("--observable", required=True, metavar="NAME", help=OBSERVABLES)
    parser.add_argument(
        "--fit",
        required=True,
        metavar="NAMES",
        help="phi_J,y,znu[,omega]; nu for znu with --finite-size; y=1 holds y",
    )
    parser.add_argument("--out", required=True, metavar="FILE", help="result file")
    parser.add_argument(
        "--finite-size", action="store_true", help="scale with L = sqrt(N) instead of the rate"
    )
    parser.add_argument("--corrections", action="store_true", help="with f1, which needs omega in --fit")
    parser.add_argument(
        "--degree", type=int, default=5, metavar="D", help="of the polynomial ln f0 (default 5)"
    )
    parser.add_argument(
        "--spline", action="store_true", help="a cubic spline over --degree intervals instead"
    )
    parser.add_argument(
        "--where",
        metavar="COLUMN=VALUE,…",
        help="of the folder of a study: the files whose rows in its table have these values",
    )
    parser.add_argument("--cut", type=float, metavar="R", help="largest rate, or smallest N, that is used")
    parser.add_argument("--range", metavar="A:B", help="packing fractions that are used (default: all)")
    parser.set_defaults(run=run, check=check)


def check(args):
    """(form, (lowest φ, highest φ)). Raises InputError."""
    from jampetsc.words import scaling

    if args.observable not in scaling.OBSERVABLES:
        raise InputError(f"--observable {args.observable}: choose one of {', '.join(scaling.OBSERVABLES)}")
    if args.cut is not None and not 0 < args.cut < float("inf"):
        raise InputError(f"--cut {args.cut:g}: must be positive")
    form = scaling.form_of(
        args.fit,
        finite_size=args.finite_size,
        corrections=args.corrections,
        degree=args.degree,
        spline=args.spline,
    )
    return form, _range(args.range)


def _range(text):
    if text is None:
        return 0.0, float("inf")
    try:
        low, high = (float(word) for word in text.split(":"))
    except ValueError:
        raise InputError(f"--range {text}: write A:B, two packing fractions") from None
    if not 0 < low < high:
        raise InputError(f"--range {text}: must be A:B with 0 < A < B")
    return low, high


def run(args, petsc_argv) -> int:
    """Read, fit, write and say what was found."""
    import time

    from jampetsc.analysis.collapse_errors import drift
    from jampetsc.storage.outputs import check_output
    from jampetsc.storage.reader import load
    from jampetsc.words import scaling
    from jampetsc.words.files import refuse_repeated

    began = time.perf_counter()
    form, (low, high) = check(args)
    files = scaling.files_of(args.files, args.finite_size, args.where)
    refuse_repeated(files)
    check_output(args.out, FORMAT, files)
    results = [load(path) for path in files]
    data = scaling.read_points(results, args.observable, args.finite_size)
    limit = float("inf") if args.cut is None else args.cut**-0.5 if args.finite_size else args.cut
    points = data.points
    used = (points.phi >= low) & (points.phi <= high) & (points.scale <= limit * (1 + 1e-9))
    if not used.any():
        raise InputError(f"{files[0]}: no points are left by --cut and --range")
    points = points[used]
    cuts = drift(points, form)
    _, fit, found = cuts[0]
    notes = scaling.notes_of(points, fit, found, args.finite_size)
    _write(args, results, (points, data.size[used], data.runs[used]), cuts, notes, began)
    print(_summary(args, points, cuts, notes))
    return 0


def _write(args, results, data, cuts, notes, began):
    import time

    import numpy as np

    from jampetsc.storage.provenance import derived_from
    from jampetsc.storage.result_file import ResultWriter
    from jampetsc.words.scaling import names_of

    (points, size, runs), (_, fit, found) = data, cuts[0]
    words = {name: word for word, name in names_of(args.finite_size).items()}
    x = fit.x(points)
    leading, correction = fit.terms(points)
    along = np.linspace(x.min(), x.max(), 200)
    first, second = fit.functions(along)
    shared = ("model", "mass", "sizes", "potential", "stiffness", "protocol", "units", "tau1")
    with ResultWriter(args.out, FORMAT) as writer:
        for name, values in {
            "phi": points.phi,
            "N": size,
            "size" if args.finite_size else "rate": 1 / points.scale if args.finite_size else points.scale,
            "value": points.value,
            "error": points.error,
            "runs": runs,
            "x": x,
            "leading": leading,
            "correction": correction,
            "curve/x": along,
            "curve/f0": first,
            "curve/f1": second,
            "drift/cut": np.array([_shown(cut, args.finite_size) for cut, _, _ in cuts]),
            "drift/parameters": np.array([[one.parameters[n] for n in fit.form.free] for _, one, _ in cuts]),
            "drift/errors": np.array([[some[n].error for n in fit.form.free] for _, _, some in cuts]),
            "drift/chi2_per_dof": np.array([one.chi2 / one.dof for _, one, _ in cuts]),
        }.items():
            writer.dataset(name, values)
        writer.attributes(
            **derived_from(results, time.perf_counter() - began)
            | {name: results[0].attributes.get(name) for name in shared},
            observable=args.observable,
            scaling="size" if args.finite_size else "rate",
            fitted=",".join(words[name] for name in fit.form.free),
            functions=f"{'spline' if args.spline else 'polynomial'}, degree {args.degree}",
            corrections=args.corrections,
            chi2=fit.chi2,
            dof=fit.dof,
            probability=fit.probability,
            **{words[name]: value for name, value in fit.parameters.items()},
            **{
                f"{words[name]}_{what}": getattr(one, what)
                for name, one in found.items()
                for what in ("error", "low", "high", "shift")
            },
            notes="; ".join(notes),
        )


def _shown(scale, finite_size):
    """A cut in the words of the command line: a rate, or N."""
    return scale**-2 if finite_size else scale


def _summary(args, points, cuts, notes):
    from jampetsc.words.scaling import text_of

    (_, fit, found), *others = cuts
    lines = [
        f"{args.out}: {args.observable} at {len(points)} points, {text_of(fit.parameters, found, args.finite_size)}",
        f"  chi2/dof = {fit.chi2 / fit.dof:.3g} with {fit.dof} degrees of freedom, probability {fit.probability:.2g}",
    ]
    what = "N >=" if args.finite_size else "rates <="
    for cut, one, some in others:
        lines.append(
            f"  {what} {_shown(cut, args.finite_size):.4g}: {text_of(one.parameters, some, args.finite_size)}, "
            f"chi2/dof = {one.chi2 / one.dof:.3g}"
        )
    return "\n".join(lines + [f"  note: {note}" for note in notes])
