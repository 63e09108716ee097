"""The best fit of a scaling form and the errors of its parameters.

The fit is by weighted least squares, begun at every minimum of a grid of φ_J and κ. The ends of 2σ of a parameter are
where the least χ² at fixed values of it is 4 above the least of all (profile of χ²; James, Statistical Methods in
Experimental Physics, ch. 9). They assume no distribution of the errors and follow a curved valley of χ²; where χ² does
not rise that far, the data do not determine the parameter. An error because f₀ and f₁ have too low a degree need not
show in χ². It is estimated from the change of a parameter in fits of higher degrees, less the noise of the terms that
these add.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammainc

from jampetsc import interrupts
from jampetsc.analysis.scaling_collapse import BOUNDS, Basis, Fit, Form, Points, means_by_scale, scaled
from jampetsc.errors import InputError, named

EXACT_SEARCH, ROUGH_SEARCH = (
    (1e-9, 300),
    (1e-5, 100),
)  # (relative change of χ² that ends a search, most steps)
_KAPPA_GRID, _PHI_COUNT = np.geomspace(0.7, 8.0, 12), 15  # grid on which the search begins: κ, number of φ_J
_MAX_STARTS = 4  # deepest minima of that grid, from which the search continues
_OMEGA_STARTS, _CORRECTION_RATIO = (
    (0.1, 0.25, 0.6, 1.5),
    0.3,
)  # starts with corrections: ω, and f₁ in units of f₀
SIGMAS = 2.0  # of the ends, where χ² is SIGMAS² above the least
DEGREE_STEPS = (2, 4)  # added to the degree: as many even as odd terms
MAX_SIDE_RATIO = 1.5  # ratio of the longer to the shorter side of an error from which both are reported
# probability of a scatter as small, below which errors are taken as common to a scale
MIN_SCATTER_PROBABILITY = 0.02
MAX_COMMON_SHARE = 0.98  # largest share of errors that is taken as common
_END_TOLERANCE = 0.02  # of an end, in its distance from the best
_MIN_GAIN = 0.01  # a fit whose χ² is lower by this replaces the best so far
_MAX_STEP_GROWTH, _MIN_STEPS = (
    3.0,
    20,
)  # most growth from step to step outwards; fewest steps that cover the range


def parameter_ranges(points: Points) -> dict:
    """{parameter: (lowest, highest)} that is searched: φ_J as far beyond the data as they span."""
    spread = np.ptp(points.phi)
    return {**BOUNDS, "phi_J": (points.phi.min() - spread, points.phi.max() + spread)}


def find_minima(points: Points, form: Form) -> list[Fit]:
    """Local minima of χ², the least first; with corrections for both signs of f₁. Raises InputError."""
    points.check()
    if len(points) <= form.unknowns:
        raise InputError(
            f"{len(points)} points for {form.unknowns} unknowns. Give more points, or a lower {named('degree')}."
        )
    positive = int(np.count_nonzero(points.value > 0))
    if positive <= form.plain.unknowns:
        raise InputError(
            f"{positive} values above zero for {form.plain.unknowns} unknowns. Give denser packings."
        )
    plain = _sorted(fit_from(points, form.plain, start) for start in find_starts(points, form.plain))
    if not form.corrections:
        return plain
    omegas = [form.fixed["omega"]] if "omega" in form.fixed else _OMEGA_STARTS
    forms = [replace(form, fixed={**form.fixed, "omega": omega}) for omega in omegas]
    begun = (
        fit_from(points, form, start_corrections(plain[0], form, sign), ROUGH_SEARCH)
        for form in forms
        for sign in (1, -1)
    )
    return _sorted(fit_from(points, form, fit) for fit in begun)


def _sorted(fits) -> list[Fit]:
    return sorted(fits, key=lambda fit: fit.chi2)


def find_starts(points, form) -> list[Fit]:
    """The deepest minima on a grid of φ_J and κ without corrections, where ln O is linear in all other unknowns."""
    spread = np.quantile(points.phi, np.linspace(0.1, 0.9, _PHI_COUNT))
    phis = [form.fixed["phi_J"]] if "phi_J" in form.fixed else spread
    kappas = [form.fixed["kappa"]] if "kappa" in form.fixed else _KAPPA_GRID
    positive = points[points.value > 0]
    grid = [[_linear(positive, form, float(phi_J), float(kappa)) for kappa in kappas] for phi_J in phis]
    chi2 = np.pad([[fit.chi2 for fit in row] for row in grid], 1, constant_values=np.inf)
    around = np.lib.stride_tricks.sliding_window_view(chi2, (3, 3)).min(axis=(2, 3))
    minima = [grid[row][column] for row, column in np.argwhere(chi2[1:-1, 1:-1] <= around)]
    return sorted(minima, key=lambda fit: fit.chi2)[:_MAX_STARTS]


def _linear(positive, form, phi_J, kappa) -> Fit:
    """Least squares of ln O at one φ_J and κ: the other unknowns enter linearly."""
    weight, log_b = positive.value / positive.error, np.log(positive.scale)
    x = scaled(positive, phi_J, kappa)
    basis = Basis.of(x, form)
    columns, rest = basis(x)[0], np.log(positive.value)
    if "y" in form.fixed:
        rest = rest - form.fixed["y"] / kappa * log_b
    else:
        columns = np.column_stack((columns, log_b))
    solved = _least_squares(columns, rest, weight)
    chi2 = float(np.sum((weight * (columns @ solved - rest)) ** 2))
    y = form.fixed["y"] if "y" in form.fixed else float(np.clip(solved[-1] * kappa, *BOUNDS["y"]))
    parameters = {"phi_J": phi_J, "y": y, "kappa": kappa}
    return Fit(form, parameters, basis, (solved[: form.terms[0]], np.zeros(0)), 1.0, chi2, 0)


def _least_squares(columns, values, weight):
    """Coefficients (terms,) with which columns (M, terms) come nearest to values (M,) of these weights."""
    return np.linalg.lstsq(columns * weight[:, None], values * weight, rcond=None)[0]


def start_corrections(plain: Fit, form, sign) -> Fit:
    """Start of the search with corrections: f₁ is _CORRECTION_RATIO times the f₀ of the plain fit."""
    second = plain.coefficients[0][: form.terms[1]].copy()
    second[0] += np.log(_CORRECTION_RATIO)
    parameters = {**plain.parameters, "omega": form.fixed["omega"]}
    return Fit(form, parameters, plain.basis, (plain.coefficients[0], second), float(sign), np.inf, 0)


def carry_over(points: Points, fit: Fit, form: Form, parameters: dict) -> Fit:
    """Start of a search with another form or other parameters, its functions fitted to the functions of `fit`."""
    x, log_b = scaled(points, parameters["phi_J"], parameters["kappa"]), np.log(points.scale)
    basis, y = Basis.of(x, form), parameters["y"] / parameters["kappa"]
    values, weight = basis(x)[0], fit.model(points) / points.error
    parts = zip(form.terms, fit.terms(points), (y, y + parameters.get("omega", 0.0)), strict=True)
    coefficients = [
        _least_squares(values[:, :terms], np.log(np.abs(part)) - power * log_b, weight)
        if terms
        else np.zeros(0)
        for terms, part, power in parts
    ]
    start = Fit(form, parameters, basis, tuple(coefficients), fit.sign, np.inf, 0)
    with np.errstate(over="ignore", invalid="ignore"):
        misfit = np.sum(points.in_errors(start.model(points) - points.value) ** 2)
    return replace(start, chi2=float(np.nan_to_num(misfit, nan=np.inf)))


def fit_from(points: Points, form: Form, start: Fit, search=EXACT_SEARCH) -> Fit:
    """Least squares from the fit `start`, in its basis."""
    from scipy.optimize import least_squares

    interrupts.check()
    names, (first, _) = form.free, form.terms
    limits, unlimited = parameter_ranges(points), np.full(sum(form.terms), np.inf)
    low, high = (
        np.r_[[limits[name][side] for name in names], sign * unlimited] for side, sign in ((0, -1), (1, 1))
    )

    def fit_at(vector, chi2=np.inf):
        values = {**start.parameters, **dict(zip(names, map(float, vector[: len(names)]), strict=True))}
        rest = vector[len(names) :]
        dof = len(points) - form.unknowns
        parts = rest[:first], rest[first:]
        return Fit(form, values, start.basis, parts, start.sign, chi2, dof, points.common)

    def residuals(vector):
        return points.in_errors(fit_at(vector).model(points) - points.value)

    def jacobian(vector):
        return points.in_errors(fit_at(vector).slopes(points))

    change, steps = search
    begin = np.r_[[start.parameters[name] for name in names], *start.coefficients]
    inner = np.clip(begin, low + 1e-9, high - 1e-9)
    with np.errstate(over="ignore", invalid="ignore"):  # in steps that are too long, which the search rejects
        solved = least_squares(
            residuals, inner, jacobian, (low, high), x_scale="jac", max_nfev=steps, ftol=change, xtol=change
        )
    return fit_at(solved.x, float(2.0 * solved.cost))


@dataclass(frozen=True)
class Estimate:
    """A parameter, the ends of 2σ (infinite where the data set none), and the part of 1σ that is due to the degree."""

    value: float
    low: float
    high: float
    shift: float

    @property
    def decided(self) -> bool:
        """Whether the data limit the parameter on both sides."""
        return math.isfinite(self.high - self.low)

    @property
    def error(self) -> float:
        """One standard error, nan where an end is missing."""
        return (self.high - self.low) / (2 * SIGMAS) if self.decided else math.nan

    @property
    def uneven(self) -> bool:
        """Whether one side is MAX_SIDE_RATIO times as long as the other."""
        sides = sorted((self.value - self.low, self.high - self.value))
        return sides[1] > MAX_SIDE_RATIO * sides[0]

    @property
    def left_to_degree(self) -> bool:
        """Whether more of the error is due to the degree than to the data."""
        return 2 * self.shift**2 > self.error**2


class _BetterFit(Exception):
    """A search came below the least χ² known so far."""


def estimate(points: Points, form: Form) -> tuple[Fit, dict]:
    """(the best fit, {name: Estimate} of the free parameters). Raises InputError as `find_minima` does.

    Where errors seem common to the points of a scale, they are fitted as such: see `common_share`.
    """
    fits, ends = find_minima(points, form), None
    common = common_share(points, fits[0])
    if common:
        points = replace(points, common=common)
        fits = find_minima(points, form)
    while ends is None:
        try:
            ends = find_ends(points, fits)
        except _BetterFit as found:
            fits.insert(0, fit_from(points, form, found.args[0]))
    return fits[0], {
        name: _widened(fits[0].parameters[name], ends[name], shift, parameter_ranges(points)[name])
        for name, shift in _shifts(points, fits[0]).items()
    }


def common_share(points: Points, fit: Fit) -> float:
    """Share of the squared errors that points of one scale seem to have in common; 0 if that may be chance.

    About their mean at each scale, points then scatter by less than their errors. The fit, of independent errors,
    takes part of the degrees of freedom: ν = M − S − tr H + tr PH, H the projector onto its slopes, P onto these means.
    """
    residuals, slopes = (
        points.in_errors(fit.model(points) - points.value),
        points.in_errors(fit.slopes(points)),
    )
    means, number, group = means_by_scale(points, residuals)
    basis = np.linalg.svd(slopes / np.maximum(np.linalg.norm(slopes, axis=0), 1e-300), full_matrices=False)[0]
    inside = basis - means_by_scale(points, basis)[0][group]
    freedom = len(points) - len(number) - float(np.sum(inside**2))
    scatter = float(np.sum((residuals - means[group]) ** 2))
    if freedom < 1.0 or gammainc(0.5 * freedom, 0.5 * scatter) >= MIN_SCATTER_PROBABILITY:
        return 0.0
    return min(1.0 - scatter / freedom, MAX_COMMON_SHARE)


def _widened(best, ends, shift, limits):
    """The Estimate with the error due to the degree added; an end outside the range that was searched is infinite."""
    down, up = (math.hypot(end - best, SIGMAS * shift) for end in ends)
    low = best - down if best - down > limits[0] else -math.inf
    return Estimate(best, low, best + up if best + up < limits[1] else math.inf, shift)


def find_ends(points, fits):
    """{name: (low, high)} around the first fit, and around others whose χ² is less than SIGMAS² above its."""
    least, ends = fits[0].chi2, {}
    for fit in fits:
        inside = ends and all(low <= fit.parameters[name] <= high for name, (low, high) in ends.items())
        if fit.chi2 >= least + SIGMAS**2 or (inside and fit.sign == fits[0].sign):
            continue
        for name in fit.form.free:
            low, high = (_end(points, fit, least, name, side) for side in (0, 1))
            ends_so_far = ends.get(name, (low, high))
            ends[name] = min(low, ends_so_far[0]), max(high, ends_so_far[1])
    return ends


def drift(points: Points, form: Form) -> list:
    """[(cut, fit, estimates), …] of `estimate` for the points with scale ≤ cut, from all to as few as can be fitted.

    Without corrections to scaling, parameters can be trusted once they no longer change with the cut. Raises
    InputError if even all points are too few.
    """
    rows = []
    for cut in np.unique(points.scale)[::-1]:
        try:
            rows.append((float(cut), *estimate(points[points.scale <= cut], form)))
        except InputError:  # too few are left
            if not rows:
                raise
            break
    return rows


def degrees_above(points: Points, form: Form) -> list[int]:
    """The higher degrees for which there are enough points."""
    higher = (replace(form, degree=form.degree + more) for more in DEGREE_STEPS)
    return [form.degree for form in higher if form.unknowns < len(points)]


def _shifts(points, fit):
    """{name: the largest change at a higher degree, less the noise that its terms add}."""
    names = fit.form.free
    own, largest = _linear_errors(points, fit), np.zeros(len(names))
    for degree in degrees_above(points, fit.form):
        form = replace(fit.form, degree=degree)
        higher = fit_from(points, form, carry_over(points, fit, form, fit.parameters), ROUGH_SEARCH)
        change = np.array([higher.parameters[name] - fit.parameters[name] for name in names])
        noise = np.maximum(_linear_errors(points, higher) ** 2 - own**2, 0.0)
        largest = np.maximum(largest, np.sqrt(np.maximum(change**2 - noise, 0.0)))
    return dict(zip(names, map(float, largest), strict=True))


def correlations(points: Points, fit: Fit) -> np.ndarray:
    """(P, P) correlations of the errors of the free parameters, from the linearised model.

    The variance of a difference zν − y is e_y² + e_z² − 2 ρ e_y e_z, e the errors and ρ their correlation.
    """
    covariance = _linear_covariance(replace(points, common=fit.common), fit)
    errors = np.sqrt(np.diag(covariance))
    return covariance / np.maximum(np.multiply.outer(errors, errors), 1e-300)


def _linear_covariance(points, fit):
    """(P, P) covariance of the free parameters from the linearised model."""
    slopes = points.in_errors(fit.slopes(points))
    units = np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    inverse = (np.linalg.pinv(slopes / units) / units[:, None])[: len(fit.form.free)]
    return inverse @ inverse.T


def _linear_errors(points, fit):
    """(P,) standard errors of the free parameters from the linearised model."""
    return np.sqrt(np.diag(_linear_covariance(points, fit)))


def _end(points, fit, least, name, side):
    """Where the profile of χ² is SIGMAS² above the least, below or above the best (side 0, 1); ∓∞ if nowhere."""
    best, sign, limit = fit.parameters[name], (-1.0, 1.0)[side], parameter_ranges(points)[name][side]
    profile = {best: fit}

    def rise(value):
        """√(χ² − least) − SIGMAS with the parameter held."""
        if value not in profile:
            inner = max(
                (other for other in profile if abs(other - best) < abs(value - best)),
                key=lambda v: abs(v - best),
            )
            near, form = profile[inner], replace(fit.form, fixed={**fit.form.fixed, name: value})
            begun = {**near.parameters, name: value}, _along_profile(points, near, name, value)
            start = min(
                (carry_over(points, near, form, parameters) for parameters in begun), key=lambda fit: fit.chi2
            )
            refit = replace(fit_from(points, form, start, ROUGH_SEARCH), form=fit.form)
            if refit.chi2 < least - _MIN_GAIN:
                raise _BetterFit(refit)
            profile[value] = refit
        return math.sqrt(max(0.0, profile[value].chi2 - least)) - SIGMAS

    longest = abs(np.subtract(*parameter_ranges(points)[name])) / _MIN_STEPS
    step = min(longest, SIGMAS * _linear_errors(points, fit)[fit.form.free.index(name)])
    inner, outer, above = best, best, rise(best)
    while above < 0:
        if outer == limit:
            return sign * math.inf
        inner, outer = outer, sign * min(sign * limit, sign * outer + step)
        above = rise(outer)
        step = min(
            longest, step * min(_MAX_STEP_GROWTH, SIGMAS / max(SIGMAS + above, SIGMAS / _MAX_STEP_GROWTH))
        )
    return float(brentq(rise, inner, outer, xtol=_END_TOLERANCE * abs(outer - best)))


def _along_profile(points, fit, name, value):
    """The parameters where one of them is moved and the others follow, to first order."""
    slopes, at = points.in_errors(fit.slopes(points)), fit.form.free.index(name)
    own_change, other_slopes = slopes[:, at] * (fit.parameters[name] - value), np.delete(slopes, at, axis=1)
    moved = {**fit.parameters, name: value}
    names = [other for other in fit.form.free if other != name]
    for other, change in zip(names, np.linalg.lstsq(other_slopes, own_change, rcond=None)[0], strict=False):
        moved[other] = float(np.clip(moved[other] + change, *parameter_ranges(points)[other]))
    return moved
