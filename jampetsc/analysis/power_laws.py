"""Power laws near jamming: limit of low frequencies, critical branch and collapse of G*(ω); exponents of parts of data.

With ω in 1/τ₁ and G*, p in k, the moduli at pressure p follow  G* = p^μ g(ω/p^λ), μ = ½ and λ = 1, as long as
ω ≪ 1 (BT eqs. 16, 17 and Fig. 3b): g' is constant and g'' ∝ x for x ≪ 1, and both grow as x^Δ with
Δ = μ/λ = ½ for x ≫ 1.
"""

import math
from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.statistics import log_median
from jampetsc.errors import InputError

MU, LAMBDA = 0.5, 1.0  # critical exponents of BT
CRITICAL_END = 0.1  # ωτ₁ above which the affine branch near ωτ₁ = 1 is felt
CROSSOVER_SLOPE = 0.75  # slope of G'' half-way between the critical and the viscous one
# relative change of a limit by extrapolation; on the critical branch it is 0.1 and more
EXTRAPOLATION_TOLERANCE = 0.03
_MIN_POINTS = 3  # fewest points of a fit from which its error can be estimated
SLOPE_TOLERANCE = 0.12  # between the slope of the data and the exponent of a window
MIN_DECADES, MAX_DECADES = 0.6, 2.5  # of x in a window
CRITICAL_START = 10.0  # ωτ₁ over p/k: well above the lower crossover, which is near 2 to 4 (BT eq. 16)
MIN_FREQUENCIES = 5  # in the critical window for a slope


@dataclass(frozen=True)
class Limit:
    """Spring and dashpot, G* ≈ G₀ + iωη₀, at ω → 0."""

    modulus: float  # G₀
    viscosity: float  # η₀

    @property
    def crossover(self) -> float:
        """Frequency at which the two are equal: ω* = G₀/η₀ ∝ p^λ, where BT's critical branch begins; nan for η₀ = 0."""
        return self.modulus / self.viscosity if self.viscosity else math.nan


@dataclass(frozen=True)
class PowerLawFit:
    """y = prefactor · x^exponent; standard errors from the scatter about the straight line."""

    exponent: float
    exponent_error: float
    prefactor: float
    prefactor_error: float
    points: int


def low_frequency_limit(omega, G) -> Limit:
    """G₀ and η₀ from the lowest frequencies of G*(ω); omega (M,), G (M,) complex.

    All relaxation times are finite, so G' = G₀ + O(ω²) and G''/ω = η₀ + O(ω²); the first correction is taken
    out with a second frequency. Raises InputError where the sweep does not reach that regime.
    """
    omega, G = _finite(omega, G)
    t, y = omega**2, np.array([G.real, G.imag / omega])
    higher = np.flatnonzero(t >= 4.0 * t[0])[:1]  # the next frequency that is at least twice as high, if any
    first = y[:, :1]
    change = (y[:, higher] - first) * t[0] / (t[higher] - t[0])
    if not len(higher) or not np.all(np.abs(change) <= EXTRAPOLATION_TOLERANCE * np.abs(first)):
        raise InputError(
            f"G' and G''/omega still change at the lowest frequency, {omega[0]:g}. Begin the sweep lower."
        )
    return Limit(*map(float, (first - change).ravel()))


def collapse(omega, G, pressure, mu=MU, lam=LAMBDA):
    """(x, g) = (ω/p^λ, G*/p^μ), ω in 1/τ₁ and G*, p in k. Raises InputError for p ≤ 0."""
    if not (np.isfinite(pressure) and pressure > 0):
        raise InputError(f"pressure {pressure:g}: must be positive")
    return np.asarray(omega) / pressure**lam, np.asarray(G) / pressure**mu


def collapse_spread(sweeps, mu=MU, lam=LAMBDA, end=CRITICAL_END) -> float:
    """How far from one curve: rms over x of the standard deviation of ln g' and ln g'' between sweeps.

    `sweeps` is a sequence of (omega, G, pressure). Frequencies above `end` (in 1/τ₁) are left out, and so is
    all x that fewer than two sweeps reach, and values that are not positive. 0.1 means 10 %.
    Raises InputError if nothing overlaps.
    """
    scaled = []
    for omega, G, pressure in sweeps:
        omega, G = _finite(omega, G)
        x, g = collapse(omega[omega <= end], G[omega <= end], pressure, mu, lam)
        scaled += [(part, x[y > 0], y[y > 0]) for part, y in (("storage", g.real), ("loss", g.imag))]
    squares = []
    for part in ("storage", "loss"):
        curves = [(np.log(x), np.log(y)) for name, x, y in scaled if name == part and len(x) > 1]
        if len(curves) < 2:
            continue
        grid = np.linspace(min(x[0] for x, _ in curves), max(x[-1] for x, _ in curves), 400)
        values = np.array([np.interp(grid, x, y, left=np.nan, right=np.nan) for x, y in curves])
        shared = np.count_nonzero(np.isfinite(values), axis=0) >= 2
        squares.append(np.nanvar(values[:, shared], axis=0, ddof=1))
    if not sum(len(s) for s in squares):
        raise InputError(
            f"no two sweeps overlap in omega/p^{lam:g} below omega = {end:g}. Sweep a wider range."
        )
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def local_slope(omega, values):
    """d ln y/d ln ω by centred differences, (M,), of positive values on increasing frequencies."""
    return np.gradient(np.log(values), np.log(omega))


def local_exponents(x, values, errors):
    """(middles, d ln y/d ln x, errors) between neighbouring x (m,), (m − 1,) each, of positive values with errors."""
    steps, relative = np.diff(np.log(x)), errors / values
    exponents = np.diff(np.log(values)) / steps
    return np.sqrt(x[1:] * x[:-1]), exponents, np.hypot(relative[1:], relative[:-1]) / np.abs(steps)


def critical_exponents(omega, G, G0):
    """(½ d ln|G*² − G₀²|/d ln ω, arg(G*² − G₀²)/π), (M,) each: both are Δ where G* ~ (iω)^Δ.

    omega (M,) increasing, G (M,) complex, G0 the limit of G* at ω → 0, each in any unit. Between the two crossovers G'
    still contains G₀, but the difference of the squares does not: it is a power law on either side of ω* if
    G*² = G₀² + iAω, which data follow within some per cent. Below ω* it does not test Δ: there the difference is
    2iG₀η₀ω, and both are ½ for any Δ (docs/theory/linear_response.md). Take frequencies above ω* = G₀/η₀; nan or
    infinite where G and G0 agree to their last digits.
    """
    omega, G = np.asarray(omega, float), np.asarray(G, complex)
    difference = (G - G0) * (G + G0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return 0.5 * local_slope(omega, np.abs(difference)), np.angle(difference) / np.pi


def fit_power_law(x, y, window=(0.0, np.inf)) -> PowerLawFit:
    """Straight line through (ln x, ln y) for window[0] ≤ x ≤ window[1], all points weighted alike.

    Points of one smooth curve are not independent: the standard errors then measure how far it is from a
    power law, not what another packing would give. Raises InputError for fewer than three points or y ≤ 0.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    inside = (x >= window[0]) & (x <= window[1]) & np.isfinite(y)
    x, y = x[inside], y[inside]
    between = f"between {window[0]:g} and {window[1]:g}"
    if len(np.unique(x)) < _MIN_POINTS:
        raise InputError(
            f"{len(x)} points {between}: too few for a slope (at least {_MIN_POINTS}). Widen the window."
        )
    if (y <= 0).any():
        raise InputError(f"value {y[y <= 0][0]:g} {between}: not positive. Narrow the window.")
    (slope, intercept), covariance = np.polyfit(np.log(x), np.log(y), 1, cov=True)
    prefactor = np.exp(intercept)
    slope_error, intercept_error = np.sqrt(np.diag(covariance))
    parameters = (slope, slope_error, prefactor, prefactor * intercept_error)
    return PowerLawFit(*map(float, parameters), len(x))


def _finite(omega, G):
    """Frequencies in increasing order with the moduli that were found, at least two."""
    omega, G = np.asarray(omega, float), np.asarray(G, complex)
    finite = np.isfinite(G)
    omega, G = omega[finite], G[finite]
    if len(omega) < 2:
        raise InputError(
            f"{len(omega)} frequencies with a modulus: too few (at least 2). Sweep more frequencies."
        )
    order = np.argsort(omega)
    return omega[order], G[order]


def power_law_window(x, y, exponent, max_decades=MAX_DECADES) -> tuple[float, float] | None:
    """(first, last) log₁₀ x of the longest stretch where d ln y/d ln x is near `exponent`; x increasing, (M,) each.

    A stretch of more than `max_decades` is cut to its middle; None for one of less than MIN_DECADES. Values y ≤ 0 are
    left out.
    """
    x, y = x[y > 0], y[y > 0]
    if len(x) < 3:
        return None
    u = np.log10(x)
    near = np.abs(local_slope(x, y) - exponent) <= SLOPE_TOLERANCE
    edges = np.flatnonzero(np.diff(np.r_[0, near.astype(int), 0]))
    stretches = [(u[a], u[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    first, last = max(stretches, key=lambda ends: ends[1] - ends[0], default=(0.0, 0.0))
    if last - first < MIN_DECADES:
        return None
    excess = max(0.0, (last - first) - max_decades) / 2
    return first + excess, last - excess


def median_exponents(x, samples):
    """(middles, d ln X/d ln x, errors), (m − 1,) each, between neighbouring x (m,); X: medians of m samples.

    Errors are of the medians, nan for fewer than three values; nan where a median is not positive.
    """
    pairs = [
        log_median(sample) if len(sample) > 2 else (np.log(max(np.median(sample), 0.0) or np.nan), np.nan)
        for sample in samples
    ]
    logs, errors = np.transpose(pairs)
    return local_exponents(x, np.exp(logs), np.exp(logs) * errors)


def quotient(numerator, denominator):
    """(value, error) of the quotient of two independent (value, error)."""
    value = numerator[0] / denominator[0]
    return value, np.abs(value) * np.hypot(numerator[1] / numerator[0], denominator[1] / denominator[0])


def fit_logarithm(x, y, errors):
    """(a, b) of y = a + b ln x, weighted by errors (m,) > 0."""
    slope, constant = np.polyfit(np.log(x), y, 1, w=1.0 / errors)
    return constant, slope


def is_critical(omega, tau1, pressure, stiffness):
    """Mask (M,) of the frequencies omega (M,) between both crossovers: 10 p/k < ωτ₁ < 0.1."""
    scaled = omega * tau1
    return (scaled >= CRITICAL_START * pressure / stiffness) & (scaled <= CRITICAL_END)


def moduli(G) -> dict:
    """{"storage": G', "loss": G''} of G* (M,), the names of columns and datasets."""
    return {"storage": G.real, "loss": G.imag}


def critical_slopes(omega, G) -> dict:
    """Slopes d ln G/d ln ω of G' and of G'' with standard errors, by the names of columns of a table.

    omega (m,), G (m,)   frequencies and G* in the critical window

    A modulus that is not positive everywhere has no slope.
    """
    slopes = {}
    for name, modulus in moduli(G).items():
        if (modulus > 0).all():
            fit = fit_power_law(omega, modulus)
            slopes |= {f"exponent_{name}": fit.exponent, f"exponent_{name}_error": fit.exponent_error}
    return slopes
