"""Exponents near jamming, by collapse of flow, jam and shear results."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from jampetsc.analysis.scaling_collapse import form_named, words_of
from jampetsc.commands.sources import WHERE, FitJob, write_derived
from jampetsc.errors import InputError, as_float, named
from jampetsc.io.provenance import recorded_dimension
from jampetsc.io.results import note_lines
from jampetsc.options.parameters import FILES, ValueType, optional_parameter, parameter
from jampetsc.options.values import RESULT, load_source, split_list

OBSERVABLES = ("pressure", "shear_stress", "jammed")
CURVE_POINTS = 200  # points along x at which f₀ and f₁ are stored
COMMON_ATTRIBUTES = (
    "dimension",
    "model",
    "mass",
    "sizes",
    "potential",
    "exponent",
    "stiffness",
    "protocol",
    "units",
    "tau1",
)


def _range(limits):
    """Two packing fractions, or words A:B."""
    try:
        low, high = (as_float(limit) for limit in (limits.split(":") if isinstance(limits, str) else limits))
    except (TypeError, ValueError):
        raise ValueError("must be two packing fractions, A:B") from None
    if not 0 < low < high:
        raise ValueError("must be A:B with 0 < A < B")
    return low, high


@dataclass(frozen=True, eq=False)
class Collapse(FitJob):
    """Critical exponents from rates or sizes.

    Fit the scaling of an observable O near jamming (Vågberg, thesis ch. 5). Of flows at several rates and phi of one N:

      O = rate^(y/znu) [f0(x) + rate^(omega/z) f1(x)],   x = (phi - phi_J) / rate^(1/znu)

    and with finite_size, of jam and shear results at several N and phi, L = N^(1/D):

      O = L^(-y/nu) [f0(x) + L^(-omega) f1(x)],          x = (phi - phi_J) L^(1/nu)

    f0 and |f1| are exponentials of polynomials or splines; f1 is fitted with corrections. The fit is weighted least
    squares; errors come from the profile of chi^2 and from fits of higher degrees. The fit is repeated with the largest
    rates, or smallest N, left out one by one.
    """

    scalar: ClassVar = None
    EPILOG: ClassVar = """With rates the parameter omega is omega/z. A small probability of chi^2 means that the form
is wrong, or the errors are.

examples:
  jampetsc collapse flows --observable pressure --fit phi_J,y,znu --out scaling.h5       # the folder of a study
  jampetsc collapse flows --where model=RD0 --observable pressure --fit phi_J,y,znu,omega --corrections --out full.h5
  jampetsc collapse jam-*.h5 --finite-size --observable jammed --fit phi_J,y=0,nu --out sizes.h5
  jampetsc plot scaling.h5 --out scaling.png"""

    results: Sequence = parameter(
        help="flows, or jam and shear results, or the folder of a study", value_type=RESULT, place=FILES
    )
    observable: str = parameter(help="observable to scale", choices=OBSERVABLES)
    fit: str = parameter(
        help="names of the parameters to fit: phi_J,y,znu[,omega] (nu for znu with finite_size); y=1 fixes y",
        value_type=ValueType(lambda names: ",".join(map(str, split_list(names))), metavar="NAMES"),
    )
    finite_size: bool = parameter(False, "scale with L = N^(1/D) instead of the rate")
    corrections: bool = parameter(False, "also fit f1, which needs omega in fit")
    degree: int = parameter(5, "degree of the polynomial ln f0", low=1, high=12, metavar="D")
    spline: bool = parameter(False, "cubic spline over degree intervals instead of a polynomial")
    where: str | None = WHERE
    cut: float | None = optional_parameter(
        "largest rate, or smallest N, in the fit (default: all)", above=0.0, high=1e300, metavar="R"
    )
    range: tuple | None = optional_parameter(
        "range of packing fractions in the fit (default: all)",
        value_type=ValueType(
            _range, lambda ends: ":".join(map(repr, ends)), metavar="A:B", python="(low, high)"
        ),
    )

    def check(self):
        """Refuse unknown, missing or repeated names in `fit`, and a fit without free parameters."""
        _ = self.form

    @property
    def form(self):
        """The `analysis.scaling_collapse.Form` to fit. Raises InputError."""
        return form_named(self.fit, self.finite_size, self.corrections, self.degree, self.spline)

    @property
    def formats(self):
        """See `FitJob`."""
        from jampetsc.commands.collapse_points import FORMATS

        return FORMATS[self.finite_size]

    def work(self, to):
        from jampetsc.analysis.collapse_fit import drift
        from jampetsc.commands import collapse_points

        start_time, form = time.perf_counter(), self.form
        results = [load_source(source) for source in self.sources]
        points = collapse_points.read_points(results, self.observable, self.finite_size)
        low, high = self.range or (0.0, math.inf)
        to_length = collapse_points.LENGTH[recorded_dimension(results[0].attributes)]
        largest = (
            math.inf if self.cut is None else 1.0 / to_length(self.cut) if self.finite_size else self.cut
        )
        points = points[points.within(low, high, largest)]
        if not len(points):
            raise InputError(
                f"{results[0].path}: no points within {named('cut')} and {named('range')}. Give wider limits."
            )
        cuts = drift(points, form)
        _, fit, estimates = cuts[0]
        notes = collapse_points.notes_of(points, fit, estimates, self.finite_size)
        arrays, facts = self._arrays(points, fit, cuts), self._attributes(results[0], fit, estimates)
        write_derived(to, self.FORMAT, results, start_time, arrays, notes, **facts)
        return _summary(to, self, points, cuts, notes)

    def _arrays(self, points, fit, cuts):
        """{name: array}: points, f₀ and f₁ along x, and parameters against the cut; cuts: of `drift`."""
        import numpy as np

        from jampetsc.analysis.collapse_fit import correlations

        x, free = fit.x(points), fit.form.free
        along = np.linspace(x.min(), x.max(), CURVE_POINTS)
        return {
            "N": points.size,
            "runs": points.runs,
            **({"size": 1 / points.scale} if self.finite_size else {"rate": points.scale}),
            "phi": points.phi,
            "value": points.value,
            "error": points.error,
            "x": x,
            **dict(zip(("leading", "correction"), fit.terms(points), strict=True)),
            "correlations": correlations(points, fit),
            "curve/x": along,
            **dict(zip(("curve/f0", "curve/f1"), fit.functions(along), strict=True)),
            "drift/cut": np.array([_in_user_units(cut, points, self.finite_size) for cut, _, _ in cuts]),
            "drift/parameters": np.array([[fit.parameters[name] for name in free] for _, fit, _ in cuts]),
            "drift/errors": np.array([[estimates[name].error for name in free] for _, _, estimates in cuts]),
            "drift/chi2_per_dof": np.array([fit.chi2 / fit.dof for _, fit, _ in cuts]),
        }

    def _attributes(self, first, fit, estimates):
        symbols = words_of(self.finite_size)
        return {
            **{name: first.attributes.get(name) for name in COMMON_ATTRIBUTES},
            "observable": self.observable,
            "scaling": "size" if self.finite_size else "rate",
            "fitted": ",".join(symbols[name] for name in fit.form.free),
            "functions": f"{'spline' if self.spline else 'polynomial'}, degree {self.degree}",
            "corrections": self.corrections,
            "chi2": fit.chi2,
            "dof": fit.dof,
            "probability": fit.probability,
            "common_share": fit.common,
            **{symbols[name]: value for name, value in fit.parameters.items()},
            **{
                f"{symbols[name]}_{what}": getattr(estimate, what)
                for name, estimate in estimates.items()
                for what in ("error", "low", "high", "shift")
            },
        }


def _in_user_units(cut, points, finite_size) -> float:
    """A cut in the user's terms: a rate, or N."""
    return float(points.size[points.scale == cut][0]) if finite_size else cut


def _summary(to, job, points, cuts, notes) -> str:
    """The summary."""
    from jampetsc.commands.collapse_points import text_of

    (_, fit, estimates), *further = cuts
    lines = [
        f"{to}: {job.observable} at {len(points)} points, {text_of(fit.parameters, estimates, job.finite_size)}",
        f"  chi2/dof = {fit.chi2 / fit.dof:.3g} with {fit.dof} degrees of freedom, probability {fit.probability:.2g}",
    ]
    what = "N >=" if job.finite_size else "rates <="
    for cut, other_fit, other_estimates in further:
        lines.append(
            f"  {what} {_in_user_units(cut, points, job.finite_size):.4g}: "
            f"{text_of(other_fit.parameters, other_estimates, job.finite_size)}, "
            f"chi2/dof = {other_fit.chi2 / other_fit.dof:.3g}"
        )
    return "\n".join(lines + note_lines(notes))
