"""The best fit of a scaling form: weighted least squares, begun at every minimum of a grid of φ_J and κ."""

from dataclasses import replace

import numpy as np

from jampetsc import interrupts
from jampetsc.analysis.scaling_collapse import BOUNDS, Basis, Fit, Form, Points, scaled
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
    plain = _sorted(fit_from(points, form.plain, start) for start in _starts(points, form.plain))
    if not form.corrections:
        return plain
    omegas = [form.fixed["omega"]] if "omega" in form.fixed else _OMEGA_STARTS
    forms = [replace(form, fixed={**form.fixed, "omega": omega}) for omega in omegas]
    begun = (
        fit_from(points, form, _corrected(plain[0], form, sign), ROUGH_SEARCH)
        for form in forms
        for sign in (1, -1)
    )
    return _sorted(fit_from(points, form, fit) for fit in begun)


def _sorted(fits) -> list[Fit]:
    return sorted(fits, key=lambda fit: fit.chi2)


def _starts(points, form) -> list[Fit]:
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


def _corrected(plain: Fit, form, sign) -> Fit:
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
