"""G* of linear response: BT figure 3. Packings are quenched at a pressure in a cell of fixed shape.

Primary estimators. Exponents in p without pre-stress: a power law at p ≤ 1e-3 for each seed, with pN² > 1e3; with
pre-stress ln y = A + x ln p + ln(1 + b p^½) of medians. Δ: the limit a of
G″/G′ = a − b (ω/p)^−s, 10 p ≤ ω ≤ 0.02/τ₁, as Δ = (2/π) arctan a (Kramers–Kronig). Other numbers are cross-checks.
"""

import numpy as np
from scipy.optimize import OptimizeWarning, curve_fit

from jampetsc.analysis.power_laws import collapse_spread, critical_exponents, local_slope
from jampetsc.analysis.statistics import draws_of, log_median, mean_with_error
from jampetsc.plots.curves import curve_of
from papers.claims.shared import (
    LARGE,
    NEAR,
    Row,
    bearing,
    beside,
    by_decades,
    check,
    claim,
    exponent,
    medians_in_pressure,
    near_jamming,
    paired_exponent,
    power_law,
    size_of,
    widened,
    widening,
)
from papers.claims.verdicts import Estimate, between, difference, number

BOTH = (("no_prestress_", "without pre-stress"), ("", "with pre-stress"))
WINDOW = 50.0, 0.1  # critical frequencies of the cross-checks, from so many p/k to so many 1/τ₁
LIMIT = 10.0, 0.02  # the same of the limit of G″/G′
NARROWER = (30.0, 0.02), (10.0, 0.01)  # windows whose limits tell the systematic error
PRESTRESSED = {"G0": "G0-prestress"}  # claims of their own with pre-stress
SHALLOW = {"eta0": "contact damping", "eta0_drag": "Stokes, η₀ − η_F"}  # columns that decide
RESAMPLED = 60  # times the packings of a limit
SPREAD = 0.1  # rms of the logarithm within which curves count as one


def upper_border(omega, G) -> float:
    """ω at which d ln G''/d ln ω rises through ¾ for the last time: from the critical ½ to the viscous 1.

    omega (M,) increasing, G (M,) complex; nan where it does not.
    """
    slope = local_slope(omega, np.asarray(G).imag) - 0.75
    rises = np.flatnonzero((slope[:-1] < 0) & (slope[1:] >= 0))
    if not len(rises):
        return np.nan
    last = rises[-1]
    share = slope[last] / (slope[last] - slope[last + 1])
    return float(np.exp(np.interp(share, (0, 1), np.log(omega[last : last + 2]))))


def exponent_rows(rows, law, cases, shallow=()):
    """Rows about exponents of columns in p; cases: (column, name, theirs, key of the claim), theirs a number.

    shallow: columns whose power with pre-stress BT call too shallow at any size that they reach. The claim is then that
    the ratio of the column with to the column without pre-stress, packing by packing, still changes with p.
    """
    unstable = np.count_nonzero(rows["G0"] < 0)
    for prefix, where in BOTH:
        for column, name, theirs, key in cases:
            points = medians_in_pressure(rows, prefix + column)
            corrected = paired_exponent(rows, prefix + column) if prefix else exponent(*points)
            alone = near_jamming(*points)
            if alone is None:
                continue
            on = key if prefix else PRESTRESSED.get(key, key)
            note, what = by_decades(*points[:2]), f"{law}: {name} ~ p^x, {where}"
            if not prefix and unstable:
                note += f"; medians include packings with G₀ < 0: {unstable} of {rows.rows}"
            if not prefix and column in shallow:
                on = "shallow"
                yield shallow_row(rows, f"{law}: {name}", column, theirs)
            elif corrected is not None:
                yield Row(what, f"{theirs:g}", corrected, number(theirs), note, size_of(rows), bears=on)
            what = f"{what}, p ≤ {NEAR:g} alone"
            yield check(what, alone.value, alone.inflated, note, size_of(rows), f"{theirs:g}", bears=on)


def ratio_of_prestress(rows, column="eta0"):
    """(pN², median of a column with over without pre-stress, its error), each (P,), at each N and p, pN² increasing."""
    found = []
    for key, part in rows.groups(["n", "pressure"]):
        if part.rows > 2:
            middle, error = log_median(part[column] / part[f"no_prestress_{column}"])
            error *= widening(part)
            found.append((key["pressure"] * key["n"] ** 2, np.exp(middle), np.exp(middle) * error))
    return np.transpose(sorted(found))


def shallow_row(rows, name, column, theirs):
    """The row about a power that pre-stress makes shallower also where pN² > LARGE."""
    x, ratio, error = ratio_of_prestress(rows, column)
    large = x > LARGE
    x, ratio, error = x[large], ratio[large], error[large]
    estimate = power_law(x, ratio, error)
    told = " and ".join(f"{Estimate(ratio[i], error[i])} at {x[i]:.0e}" for i in (0, -1))
    what = f"{name} with over without pre-stress ~ (pN²)^x, pN² > {LARGE:g}"
    target = between(low=0.0) if theirs < 0 else between(high=0.0)
    words = f"with pre-stress shallower than p^{theirs:g}: x {'>' if theirs < 0 else '<'} 0"
    note, part = f"the ratio is {told}", SHALLOW.get(column)
    return Row(what, words, estimate, target, note, size_of(rows), bears="shallow", part=part)


def curves_of(sweeps):
    """[(p/k, curves)] from the lowest pressure."""
    return [
        (key["pressure"], [curve_of(r) for r in part.results()]) for key, part in sweeps.groups(["pressure"])
    ]


def limit_form(x, a, b, s, c=0.0):
    """G″/G′ at x = (ω/p, ωτ₁) where p ≪ ω ≪ 1/τ₁; c: the first correction by the viscous end."""
    return a - b * x[0] ** -s + c * x[1] ** 0.5


def limit_of(series, low, high, viscous=False):
    """(a, χ², degrees of freedom) of `limit_form`; series: [(p, ω (M,), values (packings, M))].

    χ² is that of one frequency a decade: neighbouring ones are of the same packings. viscous: with c.
    """
    x, y, error = [], [], []
    for p, omega, values in series:
        inside = (omega > low * p * (1 - 1e-6)) & (omega < high * (1 + 1e-6))
        x.append((omega[inside] / p, omega[inside]))
        y.append(values[:, inside].mean(axis=0))
        error.append(values[:, inside].std(axis=0) / np.sqrt(len(values) - 1))
    x, y, error = (np.concatenate(parts, axis=-1) for parts in (x, y, error))
    found, _ = curve_fit(limit_form, x, y, (1.0, 0.8, 0.4, 0.0)[: 3 + viscous], error)
    decade = np.abs(np.log10(x[0]) - np.round(np.log10(x[0]))) < 0.01
    chi2 = float(np.sum(((y - limit_form(x, *found)) / error)[decade] ** 2))
    return found[0], chi2, int(np.count_nonzero(decade)) - len(found)


def critical_exponent(groups, fluid=0.0, viscous=False) -> Estimate | None:
    """Δ = (2/π) arctan of the limit of G″/G′, iωη_F subtracted; None where the window is empty or the fit fails.

    Statistical error: bootstrap over packings. Systematic: half of the largest difference in NARROWER windows.
    """
    series = [
        (p, curves[0].omega, np.array([(c.G.imag - c.omega * fluid) / c.G.real for c in curves]))
        for p, curves in groups
        if len(curves) > 2
    ]

    def delta(series, window):
        return 2 / np.pi * np.arctan(limit_of(series, *window, viscous)[0])

    try:
        limit, chi2, dof = limit_of(series, *LIMIT, viscous)
        value = 2 / np.pi * np.arctan(limit)
        others = [delta(series, window) for window in NARROWER]
        draws = [draws_of(len(values), RESAMPLED, seed) for seed, (*_, values) in enumerate(series)]
        resampled = [
            delta(
                [(p, omega, values[rows[i]]) for (p, omega, values), rows in zip(series, draws, strict=True)],
                LIMIT,
            )
            for i in range(RESAMPLED)
        ]
    except (ValueError, RuntimeError, TypeError, OptimizeWarning):  # too few points, or no convergence
        return None
    if dof < 1:
        return None
    systematic = 0.5 * max(abs(other - value) for other in others)
    return Estimate(value, float(np.std(resampled)), systematic, chi2, dof)


def window_means(curves, low, of):
    """(curves,) means of of(omega, G) (M,) over ln ω from `low` to 0.1/τ₁, both inclusive."""
    found = []
    for curve in curves:
        inside = (curve.omega >= low * (1 - 1e-9)) & (curve.omega <= WINDOW[1] * (1 + 1e-9))
        with np.errstate(divide="ignore", invalid="ignore"):  # beyond it digits of the difference may be lost
            found.append(np.mean(of(curve.omega, curve.G)[inside]))
    return np.array(found)


def digits(value, error):
    """value(error), the error in units of the third decimal."""
    return f"{value:.3f}({1000 * error:.0f})" if np.isfinite(error) else f"{value:.3f}"


def regime_checks(groups, sweeps, law, fluid=0.0):
    """Means of four local exponents over the critical window at the lowest pressure."""
    groups = [(p, curves) for p, curves in groups if WINDOW[0] * p < WINDOW[1]]
    if not groups:
        return

    def without(of):
        return lambda omega, G: of(omega, G - 1j * omega * fluid)

    cases = (
        ("½ d ln|G*² − G₀²|/d ln ω", lambda omega, G: critical_exponents(omega, G, G[0].real)[0], "0.5"),
        ("arg(G*² − G₀²)/π", lambda omega, G: critical_exponents(omega, G, G[0].real)[1], "0.5"),
        ("d ln G″/d ln ω", lambda omega, G: local_slope(omega, G.imag), "0.5"),
        ("G″/G′", lambda omega, G: G.imag / G.real, "1"),
    )
    for name, of, theirs in cases:
        means = [
            (p, *mean_with_error(window_means(curves, WINDOW[0] * p, without(of)))) for p, curves in groups
        ]
        note = "; ".join(f"{digits(value, error)} at p = {p:g}" for p, value, error in means)
        what = f"{law}: {name}, mean over {WINDOW[0]:g} p … {WINDOW[1]:g}, p = {means[0][0]:g}"
        yield check(what, *means[0][1:], note, size_of(sweeps), theirs)


def at_equal_ratio(groups, fluid=0.0):
    """G″/G′ at one ω/p, in words: whether it depends on this ratio alone."""
    means = []
    for p, curves in groups:
        at = np.argmin(np.abs(np.log(curves[0].omega / (LIMIT[0] * p))))
        if LIMIT[0] * p <= LIMIT[1]:
            means.append(np.mean([(c.G[at].imag - fluid * c.omega[at]) / c.G[at].real for c in curves]))
    told = ", ".join(f"{mean:.3f}" for mean in means)
    return f"G″/G′ at ω/p = {LIMIT[0]:g} is {told}, p from {groups[0][0]:g} up"


def delta_row(sweeps, law, fluid=0.0):
    """The row of Δ, with its cross-checks."""
    groups = curves_of(sweeps)
    found = widened(critical_exponent(groups, fluid), sweeps)
    if found is not None:
        yield Row(f"{law}: Δ", "≈ 0.5", found, number(0.5), at_equal_ratio(groups, fluid), size_of(sweeps))
    yield from regime_checks(groups, sweeps, law, fluid)


@claim("bt-fig3")
def balanced(table):
    slow = table.where(command="quasistatic", state="done")
    cases = (
        ("G0", "G₀", 0.5, "G0"),
        ("eta0", "η₀", -0.5, "eta0"),
        ("omega_star", "ω* = G₀/η₀", 1.0, "omega*"),
    )
    yield from exponent_rows(slow, "β = 1", cases, shallow=("eta0", "omega_star"))
    sweeps = table.where(command="sweep", state="done")
    spreads = {}
    for on, where in ((0, "without pre-stress"), (1, "with pre-stress")):
        turning = sweeps.where(prestress=on, rotations=1)
        if not turning.rows:
            continue
        rows = bearing("Delta", delta_row(turning, f"β = 1, {where}"))
        yield from rows if on else beside(rows)
        groups = curves_of(turning)
        yield from bearing("border", border_rows(groups, where, size_of(turning), primary=bool(on)))
        spreads[where] = widened(spread_of_collapse(groups), turning), size_of(turning)
    yield from bearing("collapse", collapse_rows(spreads))
    still = sweeps.where(rotations=0, prestress=1)
    if still.rows:
        yield from beside(delta_row(still, "β = 1, no rotations, with pre-stress"), "rotations")
        yield from bearing("rotations", rotation_rows(sweeps, still))


def border_rows(groups, where, size, primary):
    """Where d ln G″/d ln ω leaves the critical ½ for the viscous 1."""
    borders = [(p, *mean_with_error([upper_border(c.omega, c.G) for c in curves])) for p, curves in groups]
    told = ", ".join(f"{value:.2f} at {p:g}" for p, value, _ in borders)
    what = f"β = 1, {where}: upper border, where d ln G″/d ln ω passes ¾, in 1/τ₁, p = {borders[0][0]:g}"
    note = f"tends to a constant as p falls: {told}"
    if primary:
        yield Row(what, "~ 1", Estimate(*borders[0][1:]), between(0.1, 10.0), note, size)
    else:
        yield check(what, *borders[0][1:], note, size, "~ 1")


def spread_of_collapse(groups) -> Estimate:
    """Spread of G*/p^½ at equal ω/p; bootstrap over packings."""

    def spread(chosen):
        return collapse_spread([(*median_curve(curves), p) for p, curves in chosen])

    value = spread(groups)
    draws = [draws_of(len(curves), RESAMPLED, seed) for seed, (_, curves) in enumerate(groups)]
    resampled = [
        spread([(p, [curves[j] for j in rows[i]]) for (p, curves), rows in zip(groups, draws, strict=True)])
        for i in range(RESAMPLED)
    ]
    return Estimate(value, float(np.std(resampled)))


def collapse_rows(spreads):
    """Whether G*/p^½ is one curve of ω/p; spreads: {with or without pre-stress: (estimate, size)}."""
    for where, (ours, size) in spreads.items():
        what = f"β = 1, {where}: G*/p^½ is one curve of ω/p below ωτ₁ = 0.1: spread of ln G′, ln G″ (rms)"
        if where == "with pre-stress":
            note = "with pre-stress η₀ grows more slowly than p^(−½)"
            if "without pre-stress" in spreads:
                note += f"; without pre-stress the spread is {spreads['without pre-stress'][0]}"
            yield Row(what, f"< {SPREAD:g}", ours, between(0.0, SPREAD), note, size)
        else:
            yield check(what, ours.value, ours.statistical, "", size)


def rotation_rows(sweeps, still):
    """Δ and |G*| of the same packings without and with rotations: one form: one Δ and a flat ratio."""
    turning = sweeps.where(rotations=1, prestress=1)
    without, with_them = (
        widened(critical_exponent(curves_of(some), viscous=True), some) for some in (still, turning)
    )
    if without and with_them:
        ours = difference(without, with_them)
        note = f"Δ = {without} and {with_them}"
        what = "β = 1: Δ without less Δ with rotations"
        yield Row(what, "the same form: 0 ± 0.05", ours, number(0.0, absolute=0.05), note, size_of(still))
    (p, curves), *_ = curves_of(still)
    pairs = [
        (slow, fast)
        for level, some in curves_of(turning)
        if level == p
        for slow, fast in zip(curves, some, strict=True)
    ]
    ratios, slopes = [], []
    for curve, other in pairs:
        inside = (curve.omega >= WINDOW[0] * p) & (curve.omega <= WINDOW[1])
        if inside.sum() < 4:
            return
        ratio = np.abs(curve.G / other.G)
        ratios.append((np.mean(ratio[inside]), np.ptp(ratio[inside]), ratio[-1]))
        slopes.append(np.polyfit(np.log(curve.omega[inside]), np.log(ratio[inside]), 1)[0])
    what = f"β = 1: |G*| without over with rotations ~ ω^x, {WINDOW[0]:g} p … {WINDOW[1]:g}, p = {p:g}"
    yield check(what, *mean_with_error(slopes), "", size_of(still), "the same form: 0")
    (value, change, fast), (error, *_) = mean_with_error(ratios)
    note = f"changes by {change:.2f} within; {fast:.2f} at the highest ω"
    what = f"β = 1: |G*| without over with rotations, {WINDOW[0]:g} p … {WINDOW[1]:g}, p = {p:g}"
    yield check(what, value, error, note, size_of(still))


def median_curve(curves):
    """(ωτ₁, median of G′ + i median of G″)."""
    G = np.array([curve.G for curve in curves])
    return curves[0].omega, np.median(G.real, axis=0) + 1j * np.median(G.imag, axis=0)
