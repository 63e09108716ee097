"""Collapse near jamming: O = b^a f((φ − φ_J)/b^c), with the rate or the size for the scale b (Vågberg, thesis ch. 5).

    rate    O = γ̇^(y/zν) [f₀(x) + γ̇^(ω/z) f₁(x)] ,    x = (φ − φ_J)/γ̇^(1/zν)
    size    O = L^(−y/ν) [f₀(x) + L^(−ω) f₁(x)] ,      x = (φ − φ_J) L^(1/ν)

which is one form, b^(y/κ) [f₀ + b^ω f₁] of x = (φ − φ_J)/b^(1/κ), for (b, κ) = (γ̇, zν) and (1/L, ν), where `omega` is
ω/z and ω. Without corrections f₁ = 0. f₀ and ±f₁ are exponentials of a polynomial or of a cubic spline.
`collapse_fit` has the weighted least squares and the errors.
"""

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import chebyshev

from jampetsc.analysis.statistics import chi2_probability
from jampetsc.errors import InputError, named

EXPONENTS = ("y", "kappa", "omega")  # κ = zν or ν
PARAMETERS = ("phi_J", *EXPONENTS)
BOUNDS = {"y": (-2.0, 5.0), "kappa": (0.2, 20.0), "omega": (0.02, 5.0)}
MIN_SCALES, MIN_PHIS = 3, 3
SPLINE_DEGREE = 3
MAX_LOG_F = 100.0  # |ln f|


@dataclass(frozen=True, eq=False)
class Points:
    """M values of an observable: at packing fractions, and rates or sizes."""

    phi: np.ndarray
    scale: np.ndarray  # b: γ̇, or 1/L
    value: np.ndarray
    error: np.ndarray  # one standard error, positive
    size: np.ndarray | None = None  # N
    runs: np.ndarray | None = None  # how many runs or samples each is the mean of
    common: float = 0.0  # share of the squared errors that all points of one scale have in common

    def __len__(self):
        return len(self.phi)

    def __getitem__(self, rows) -> "Points":
        arrays = {name: values[rows] for name, values in vars(self).items() if isinstance(values, np.ndarray)}
        return replace(self, **arrays)

    def in_errors(self, values):
        """Values (M, …) in units of the errors, turned so that they are independent: their squares add up to χ².

        With a common share c, n points of one scale have the correlation (1 − c) δ_ij + c in units of their errors.
        """
        relative = (values.T / self.error).T
        if self.common:
            means, number, group = means_by_scale(self, relative)
            kept = np.sqrt((1.0 - self.common) / (1.0 + (number - 1.0) * self.common))
            relative = (relative - (means.T * (1.0 - kept)).T[group]) / np.sqrt(1.0 - self.common)
        return relative

    def within(self, low: float, high: float, largest: float) -> np.ndarray:
        """Mask (M,) of the points with low ≤ φ ≤ high and b ≤ largest, up to rounding."""
        return (self.phi >= low) & (self.phi <= high) & (self.scale <= largest * (1 + 1e-9))

    def check(self) -> None:
        """Raise InputError for values that are negative or nan, errors that are not positive, too few scales or φ."""
        wrong = np.flatnonzero(~(np.isfinite(self.value) & (self.value >= 0)))
        if len(wrong):
            raise InputError(
                f"value {self.value[wrong[0]]:g} at phi = {self.phi[wrong[0]]:g}: must not be negative"
            )
        wrong = np.flatnonzero(~(np.isfinite(self.error) & (self.error > 0)))
        if len(wrong):
            raise InputError(
                f"error {self.error[wrong[0]]:g} at phi = {self.phi[wrong[0]]:g}: not positive. Run longer."
            )
        for count, least, name in (
            (len(np.unique(self.scale)), MIN_SCALES, "rates or sizes"),
            (len(np.unique(self.phi)), MIN_PHIS, "packing fractions"),
        ):
            if count < least:
                raise InputError(f"{count} different {name}: too few for a collapse. Give at least {least}.")


@dataclass(frozen=True)
class Form:
    """The form that is fitted: the fixed ones of PARAMETERS, and the functions for ln f₀ and ln |f₁|."""

    fixed: dict  # {name: value} of the parameters that are not free
    corrections: bool = False
    degree: int = 5  # of the polynomial, or intervals between a spline's knots
    spline: bool = False

    @property
    def free(self) -> list[str]:
        """Names of the free parameters."""
        used = PARAMETERS if self.corrections else PARAMETERS[:-1]
        return [name for name in used if name not in self.fixed]

    @property
    def terms(self) -> tuple[int, int]:
        """Numbers of coefficients of ln f₀ and of ln |f₁|; f₁ gets fewer, since data determine it less well."""
        first = self.degree + (SPLINE_DEGREE if self.spline else 1)
        return first, (self.degree + 1) // 2 + 1 if self.corrections else 0

    @property
    def unknowns(self) -> int:
        """How many numbers are fitted."""
        return len(self.free) + sum(self.terms)

    @property
    def plain(self) -> "Form":
        """The same without corrections."""
        fixed = {name: value for name, value in self.fixed.items() if name != "omega"}
        return Form(fixed, False, self.degree, self.spline)


def words_of(finite_size: bool) -> dict:
    """{parameter: what users call it}."""
    return {"phi_J": "phi_J", "y": "y", "kappa": "nu" if finite_size else "znu", "omega": "omega"}


def form_named(fit, finite_size=False, corrections=False, degree=5, spline=False) -> Form:
    """The form for the names in `fit`, phi_J,y,znu[,omega], nu for znu with finite_size; y=1 fixes y.

    Raises InputError for an unknown, missing or repeated name, and where no parameter is free.
    """
    names, fixed, seen = {word: name for name, word in words_of(finite_size).items()}, {}, set()
    here = f"{named('fit')} {fit}"
    for word in fit.split(","):
        name, equals, value = word.strip().partition("=")
        if name not in names or name in seen:
            what = "named twice. Leave one out." if name in seen else f"must be one of {', '.join(names)}"
            if name not in names and name in words_of(not finite_size).values():
                what += f" (valid {'without' if finite_size else 'with'} {named('finite_size')})"
            raise InputError(f"{here}: {name or 'a name that is missing'} {what}")
        seen.add(name)
        if equals:
            fixed[names[name]] = _fixed_value(f"{here}: {word}", value, names[name])
    if corrections != ("omega" in seen):
        remedy = (
            "omega missing. Name it."
            if corrections
            else f"omega without {named('corrections')}. Leave one out, or give both."
        )
        raise InputError(f"{here}: {remedy}")
    missing = [name for name in names if name not in seen and name != "omega"]
    if missing:
        raise InputError(f"{here}: {missing[0]} missing. Name it, or fix it by {missing[0]}=VALUE.")
    form = Form(fixed, corrections, degree, spline)
    if not form.free:
        raise InputError(f"{here}: no free parameter. Leave a value out.")
    return form


def _fixed_value(here, value, name):
    """The value at which a parameter is fixed. Raises InputError."""
    low, high = BOUNDS.get(name, (0.0, 2.0))
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not low <= number <= high:
        raise InputError(f"{here}: must be a number between {low:g} and {high:g}")
    return number


@functools.cache
def _derivatives(degree):
    """Derivatives of the Chebyshev polynomials up to a degree, in polynomials of one less, (degree, degree + 1)."""
    return chebyshev.chebder(np.eye(degree + 1))


@dataclass(frozen=True, eq=False)
class Basis:
    """Functions whose sums are ln f: Chebyshev polynomials, or cubic splines as a cubic and cubes beyond knots."""

    knots: np.ndarray  # (K + 1,) quantiles of the data; the end farther from 0 is the unit of x
    spline: bool

    @classmethod
    def of(cls, x, form) -> "Basis":
        """For a form and the x (M,) of data."""
        return cls(np.quantile(x, np.linspace(0, 1, form.degree + 1)), form.spline)

    def __call__(self, x):
        """(values, derivatives by x) at x (M,), (M, terms) each."""
        width = max(abs(self.knots[0]), abs(self.knots[-1]), 1e-300)
        u = x / width
        powers = SPLINE_DEGREE if self.spline else len(self.knots) - 1
        values = chebyshev.chebvander(u, powers)
        slopes = values[:, :powers] @ _derivatives(powers)
        if self.spline:
            beyond = np.maximum(u[:, None] - self.knots[1:-1] / width, 0)
            values, slopes = np.hstack((values, beyond**3)), np.hstack((slopes, 3 * beyond**2))
        return values, slopes / width


@dataclass(frozen=True, eq=False)
class Fit:
    """The best parameters of a form, and how well they describe the data."""

    form: Form
    parameters: dict  # every one of PARAMETERS that the form has
    basis: Basis
    coefficients: tuple  # of ln f₀ and ln |f₁|, arrays of `Form.terms` numbers
    sign: float  # of f₁
    chi2: float
    dof: int
    common: float = 0.0  # of the points, see `Points`

    @property
    def probability(self) -> float:
        """Of a χ² at least as large, were the form and the errors right."""
        return chi2_probability(self.chi2, self.dof)

    def x(self, points) -> np.ndarray:
        """(φ − φ_J)/b^(1/κ), (M,)."""
        return scaled(points, self.parameters["phi_J"], self.parameters["kappa"])

    def functions(self, x):
        """(f₀, f₁) at x, (M,) each; f₁ is 0 without corrections."""
        return self._parts(x)[:2]

    def _parts(self, x):
        """(f₀, f₁, d ln f₀/dx, d ln f₁/dx, values of the basis)."""
        values, slopes = self.basis(x)
        first, second = self.coefficients
        leading = np.exp(np.clip(values @ first, -MAX_LOG_F, MAX_LOG_F))
        if not self.form.corrections:
            return leading, np.zeros_like(x), slopes @ first, np.zeros_like(x), values
        count = len(second)
        other = self.sign * np.exp(np.clip(values[:, :count] @ second, -MAX_LOG_F, MAX_LOG_F))
        return leading, other, slopes @ first, slopes[:, :count] @ second, values

    def terms(self, points):
        """(leading, correction) parts of the observable, (M,) each."""
        p = self.parameters
        leading, other = self.functions(self.x(points))
        unit = points.scale ** (p["y"] / p["kappa"])
        return unit * leading, unit * points.scale ** p.get("omega", 0.0) * other

    def model(self, points) -> np.ndarray:
        """The fitted observable at these points, (M,)."""
        leading, correction = self.terms(points)
        return leading + correction

    def slopes(self, points) -> np.ndarray:
        """Derivatives of the model by the free parameters and the coefficients, (M, form.unknowns)."""
        p, x, log_b = self.parameters, self.x(points), np.log(points.scale)
        leading, correction = self.terms(points)
        _, _, slope, other_slope, values = self._parts(x)
        whole, by_x = leading + correction, leading * slope + correction * other_slope
        by = {
            "phi_J": -by_x / points.scale ** (1.0 / p["kappa"]),
            "y": whole * log_b / p["kappa"],
            "kappa": (by_x * x - whole * p["y"]) * log_b / p["kappa"] ** 2,
            "omega": correction * log_b,
        }
        columns = [by[name] for name in self.form.free]
        parts = [leading[:, None] * values, correction[:, None] * values[:, : self.form.terms[1]]]
        return np.column_stack([*columns, *parts])


def means_by_scale(points, values):
    """(means of values (M, …) over the points of each scale (S, …), numbers of points (S,), scale of each (M,))."""
    _, group, number = np.unique(points.scale, return_inverse=True, return_counts=True)
    sums = np.zeros((len(number), *np.shape(values)[1:]))
    np.add.at(sums, group, values)
    return (sums.T / number).T, number, group


def scaled(points, phi_J, kappa):
    """x = (φ − φ_J)/b^(1/κ), (M,)."""
    return (points.phi - phi_J) / points.scale ** (1.0 / kappa)
