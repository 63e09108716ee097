"""Collapse near jamming: O = b^a f((φ − φ_J)/b^c), with the rate or the size for the scale b (Vågberg, thesis ch. 5).

    rate    O = γ̇^(y/zν) [f₀(x) + γ̇^(ω/z) f₁(x)] ,    x = (φ − φ_J)/γ̇^(1/zν)
    size    O = L^(−y/ν) [f₀(x) + L^(−ω) f₁(x)] ,      x = (φ − φ_J) L^(1/ν)

which is one form, b^(y/κ) [f₀ + b^ω f₁] of x = (φ − φ_J)/b^(1/κ), for (b, κ) = (γ̇, zν) and (1/L, ν), where `omega` is
ω/z and ω. Without corrections f₁ = 0. f₀ and ±f₁ are exponentials of a polynomial or of a cubic spline.
Weighted least squares; errors of parameters are the scatter of fits to data drawn anew about the best one.
"""

import functools
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import chebyshev

from jampetsc.errors import InputError

EXPONENTS = ("y", "kappa", "omega")  # κ = zν or ν
PARAMETERS = ("phi_J", *EXPONENTS)
BOUNDS = {"y": (-2.0, 5.0), "kappa": (0.2, 20.0), "omega": (0.02, 5.0)}
FEWEST_SCALES, FEWEST_PHIS = 3, 3
DRAWS = 100  # data sets drawn anew
DRAWS_OF_CUTS = 30
CUBIC = 3
EXACT, ROUGH = (
    (1e-9, 300),
    (1e-5, 40),
)  # (change of χ² that ends a search, steps), of data and of those drawn anew
LARGEST = 300.0  # |ln f|
_KAPPAS, _PHIS = np.geomspace(0.7, 8.0, 12), 15  # where the search for a minimum begins
_OMEGAS, _SHARE = (0.1, 0.25, 0.6, 1.5), 0.3  # … for corrections, and for f₁ in units of f₀
_TRIED = 2  # of the fits with these ω, from which the search goes on


@dataclass(frozen=True, eq=False)
class Points:
    """M values of an observable: at packing fractions, and rates or sizes."""

    phi: np.ndarray
    scale: np.ndarray  # b: γ̇, or 1/L
    value: np.ndarray
    error: np.ndarray  # one standard error, positive

    def __len__(self):
        return len(self.phi)

    def __getitem__(self, rows) -> "Points":
        return Points(self.phi[rows], self.scale[rows], self.value[rows], self.error[rows])

    def check(self) -> None:
        """Raise InputError for values that no observable has, and too few scales or φ."""
        wrong = np.flatnonzero(~(np.isfinite(self.value) & (self.value >= 0)))
        if len(wrong):
            raise InputError(
                f"value {self.value[wrong[0]]:g} at phi = {self.phi[wrong[0]]:g}: must not be negative"
            )
        wrong = np.flatnonzero(~(np.isfinite(self.error) & (self.error > 0)))
        if len(wrong):
            raise InputError(
                f"error {self.error[wrong[0]]:g} at phi = {self.phi[wrong[0]]:g}: must be positive: run longer"
            )
        for count, least, name in (
            (len(np.unique(self.scale)), FEWEST_SCALES, "rates or sizes"),
            (len(np.unique(self.phi)), FEWEST_PHIS, "packing fractions"),
        ):
            if count < least:
                raise InputError(f"{count} different {name}: a collapse needs at least {least}")


@dataclass(frozen=True)
class Form:
    """What is fitted: which of PARAMETERS are held at which value, and what ln f₀ and ln |f₁| are."""

    held: dict  # {name: value} of the parameters that are not free
    corrections: bool = False
    degree: int = 5  # of the polynomial, or intervals between a spline's knots
    spline: bool = False

    @property
    def free(self) -> list[str]:
        """Names of the free parameters."""
        used = PARAMETERS if self.corrections else PARAMETERS[:-1]
        return [name for name in used if name not in self.held]

    @property
    def terms(self) -> tuple[int, int]:
        """Coefficients of ln f₀ and of ln |f₁|, which is smoother: data tell less of it."""
        first = self.degree + (CUBIC if self.spline else 1)
        return first, (self.degree + 1) // 2 + 1 if self.corrections else 0

    @property
    def unknowns(self) -> int:
        """Numbers that are fitted."""
        return len(self.free) + sum(self.terms)

    @property
    def plain(self) -> "Form":
        """The same without corrections."""
        held = {name: value for name, value in self.held.items() if name != "omega"}
        return Form(held, False, self.degree, self.spline)


@functools.cache
def _derivatives(degree):
    """Derivatives of the Chebyshev polynomials up to a degree in those of one less, (degree, degree + 1)."""
    return chebyshev.chebder(np.eye(degree + 1))


@dataclass(frozen=True, eq=False)
class Basis:
    """Functions whose sums are ln f: Chebyshev polynomials, or cubic splines as a cubic and cubes beyond knots."""

    knots: np.ndarray  # (K + 1,) where the data are; the end that is farther from 0 is what x is measured by
    spline: bool

    @classmethod
    def of(cls, x, form) -> "Basis":
        """For a form and the x (M,) of data."""
        return cls(np.quantile(x, np.linspace(0, 1, form.degree + 1)), form.spline)

    def __call__(self, x):
        """(values, derivatives by x) at x (M,), (M, terms) each."""
        width = max(abs(self.knots[0]), abs(self.knots[-1]), 1e-300)
        u = x / width
        powers = CUBIC if self.spline else len(self.knots) - 1
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
    coefficients: tuple  # of ln f₀ and ln |f₁|, arrays of `form.terms` numbers
    sign: float  # of f₁
    chi2: float
    dof: int

    @property
    def probability(self) -> float:
        """Of a χ² at least as large, were the form and the errors right."""
        from scipy.special import gammaincc

        return float(gammaincc(0.5 * self.dof, 0.5 * self.chi2))

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
        leading = np.exp(np.clip(values @ first, -LARGEST, LARGEST))
        if not self.form.corrections:
            return leading, np.zeros_like(x), slopes @ first, np.zeros_like(x), values
        some = len(second)
        other = self.sign * np.exp(np.clip(values[:, :some] @ second, -LARGEST, LARGEST))
        return leading, other, slopes @ first, slopes[:, :some] @ second, values

    def terms(self, points):
        """(leading, correction) parts of the observable, (M,) each."""
        p = self.parameters
        leading, other = self.functions(self.x(points))
        unit = points.scale ** (p["y"] / p["kappa"])
        return unit * leading, unit * points.scale ** p.get("omega", 0.0) * other

    def model(self, points) -> np.ndarray:
        """What the fit says of the observable, (M,)."""
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


def scaled(points, phi_J, kappa):
    """x = (φ − φ_J)/b^(1/κ), (M,)."""
    return (points.phi - phi_J) / points.scale ** (1.0 / kappa)


def fit_collapse(points: Points, form: Form) -> Fit:
    """The parameters with the least χ². Raises InputError for data that cannot tell them."""
    points.check()
    if len(points) <= form.unknowns:
        raise InputError(
            f"{len(points)} points for {form.unknowns} unknowns: give more points, or a lower --degree"
        )
    positive = int(np.count_nonzero(points.value > 0))
    if positive <= form.plain.unknowns:
        raise InputError(
            f"{positive} values above zero for {form.plain.unknowns} unknowns: give denser disks"
        )
    plain = _best(points, form.plain, _start(points, form.plain))
    if not form.corrections:
        return plain
    found = []
    for omega in [form.held["omega"]] if "omega" in form.held else _OMEGAS:
        fixed = Form({**form.held, "omega": omega}, True, form.degree, form.spline)
        found += [_best(points, fixed, _corrected(plain, fixed, sign)) for sign in (1, -1)]
    nearest = sorted(found, key=lambda fit: fit.chi2)[:_TRIED]
    return min((_best(points, form, replace(fit, form=form)) for fit in nearest), key=lambda fit: fit.chi2)


def _start(points, form) -> Fit:
    """The best on a grid of φ_J and κ without corrections: ln O is linear in what else there is."""
    known = points[points.value > 0]
    weight = known.value / known.error
    phis = np.quantile(points.phi, np.linspace(0.1, 0.9, _PHIS))
    best = None
    for phi_J in [form.held["phi_J"]] if "phi_J" in form.held else phis:
        for kappa in [form.held["kappa"]] if "kappa" in form.held else _KAPPAS:
            x = scaled(known, phi_J, kappa)
            basis = Basis.of(x, form)
            columns, rest = basis(x)[0], np.log(known.value)
            if "y" in form.held:
                rest = rest - form.held["y"] / kappa * np.log(known.scale)
            else:
                columns = np.column_stack((columns, np.log(known.scale)))
            solved = np.linalg.lstsq(columns * weight[:, None], rest * weight, rcond=None)[0]
            chi2 = float(np.sum((weight * (columns @ solved - rest)) ** 2))
            if best is None or chi2 < best.chi2:
                y = form.held["y"] if "y" in form.held else float(np.clip(solved[-1] * kappa, *BOUNDS["y"]))
                parameters = {"phi_J": float(phi_J), "y": y, "kappa": float(kappa)}
                coefficients = solved[: form.terms[0]], np.zeros(0)
                best = Fit(form, parameters, basis, coefficients, 1.0, chi2, 0)
    return best


def _corrected(plain: Fit, form, sign) -> Fit:
    """Where the search with corrections begins: a part of the plain fit's f₀ scales otherwise."""
    second = plain.coefficients[0][: form.terms[1]].copy()
    second[0] += np.log(_SHARE)
    parameters = {**plain.parameters, "omega": form.held["omega"]}
    return Fit(form, parameters, plain.basis, (plain.coefficients[0], second), float(sign), np.inf, 0)


def _best(points, form, start: Fit, search=EXACT) -> Fit:
    """Least squares from a fit that is near, in the basis of that fit."""
    from scipy.optimize import least_squares

    names, (first, _) = form.free, form.terms
    spread = np.ptp(points.phi)
    limits = {**BOUNDS, "phi_J": (points.phi.min() - spread, points.phi.max() + spread)}
    unlimited = np.full(sum(form.terms), np.inf)
    low, high = (
        np.r_[[limits[name][side] for name in names], sign * unlimited] for side, sign in ((0, -1), (1, 1))
    )

    def fit_at(vector, chi2=np.inf):
        values = {**start.parameters, **dict(zip(names, map(float, vector[: len(names)]), strict=True))}
        rest = vector[len(names) :]
        dof = len(points) - form.unknowns
        return Fit(form, values, start.basis, (rest[:first], rest[first:]), start.sign, chi2, dof)

    def residuals(vector):
        return (fit_at(vector).model(points) - points.value) / points.error

    def jacobian(vector):
        return fit_at(vector).slopes(points) / points.error[:, None]

    begin = np.r_[[start.parameters[name] for name in names], *start.coefficients]
    inner = np.clip(begin, low + 1e-9, high - 1e-9)
    change, steps = search
    with np.errstate(over="ignore", invalid="ignore"):  # of steps that are too long, which are taken back
        solved = least_squares(
            residuals, inner, jacobian, (low, high), x_scale="jac", max_nfev=steps, ftol=change, xtol=change
        )
    return fit_at(solved.x, float(2.0 * solved.cost))


def bootstrap_fits(points: Points, fit: Fit, draws: int = DRAWS) -> np.ndarray:
    """(draws, P) free parameters of fits to values drawn anew: what `fit` says plus normal errors of the data.

    The same data give the same draws.
    """
    rng = np.random.default_rng(0)
    expected = fit.model(points)
    found = []
    for _ in range(draws):
        drawn = Points(
            points.phi, points.scale, expected + points.error * rng.standard_normal(len(points)), points.error
        )
        one = _best(drawn, fit.form, fit, ROUGH)
        found.append([one.parameters[name] for name in fit.form.free])
    return np.array(found)


def drift(points: Points, form: Form, draws: int = DRAWS_OF_CUTS) -> list:
    """[(cut, fit, errors (P,)), …] of fits to the points with scale ≤ cut, from all of them to as few as can be fitted.

    Where corrections to scaling are left out, parameters can be trusted that no longer change with the cut.
    """
    found = []
    for cut in np.unique(points.scale)[::-1]:
        some = points[points.scale <= cut]
        try:
            fit = fit_collapse(some, form)
        except InputError:  # too few are left
            break
        found.append((float(cut), fit, bootstrap_fits(some, fit, draws).std(axis=0, ddof=1)))
    return found
