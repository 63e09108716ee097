"""η₀ of packings of many sizes: BT figure 8.

Primary estimators. a of η₀ = N^a f(pN²): ln f a polynomial in ln pN², p ≤ 1e-3; systematic: half of the largest change
with its degree. Growth with ln N: √p (η₀ − η_F) = A + B ln N at one p, pN² > 30.
"""

from dataclasses import dataclass

import numpy as np

import jampetsc
from jampetsc.analysis.statistics import log_median, mean_with_error
from jampetsc.plots.quasistatic_plots import MIN_SIZES
from papers.claims.moduli import BOTH, ratio_of_prestress
from papers.claims.shared import LARGE, NEAR, Row, bearing, check, claim, line_fit, power_law, size_of
from papers.claims.verdicts import Estimate, between, number

DEGREE = 5  # of the polynomial in ln pN² that stands for ln f


@dataclass(frozen=True)
class SizeScaling:
    """η₀/N^a as a function of pN²."""

    power: float  # a
    error: float  # from the errors of the points
    chi2: float
    dof: int


def size_scaling(n, pressure, values, errors, degree=DEGREE) -> SizeScaling:
    """The power a with which values/N^a become one curve of pN², a polynomial between logarithms.

    n, pressure, values, errors     (m,), values positive, errors of one standard deviation; m ≥ degree + 3
    """
    n, values = np.asarray(n, float), np.asarray(values, float)
    x, weights = np.log(pressure * n**2), values / np.asarray(errors)
    u = 2.0 * (x - x.min()) / np.ptp(x) - 1.0
    terms = np.column_stack((np.log(n), np.polynomial.chebyshev.chebvander(u, degree)))
    terms, y = terms * weights[:, None], np.log(values) * weights
    found = np.linalg.lstsq(terms, y, rcond=None)[0]
    chi2, dof = float(np.sum((y - terms @ found) ** 2)), len(y) - terms.shape[1]
    return SizeScaling(float(found[0]), float(np.linalg.inv(terms.T @ terms)[0, 0] ** 0.5), chi2, dof)


@claim("bt-fig8")
def finite_size(table):
    slow = table.where(command="quasistatic", state="done")
    laws = (
        ("contact", "β = 1", 1.0, False),
        ("stokes", "Stokes, η_F = 1", 1.09, False),
        ("stokes", "Stokes, η_F subtracted", None, True),
    )
    for law, name, theirs, subtracted in laws:
        for prefix, where in BOTH:
            yield from size_rows(slow.where(law=law), f"{name}, {where}", prefix, theirs, subtracted)
    contact = slow.where(law="contact")
    yield from bearing("shallow", saturation([contact, *largest_of(table)]))
    x = contact["pressure"] * contact["n"] ** 2
    ranges = (("< 1", x < 1), ("1 … 1e3", (x >= 1) & (x < 1e3)), ("> 1e3", x >= 1e3))
    told = [
        f"{np.count_nonzero(contact['G0'][some] < 0)} of {np.count_nonzero(some)} at pN² {text}"
        for text, some in ranges
    ]
    note = f"they count like the others in all medians; {', '.join(told)}"
    yield check(
        "with pre-stress: share of packings with G₀ < 0",
        np.mean(contact["G0"] < 0),
        None,
        note,
        size_of(contact),
        bears="shallow",
    )
    for law, name in (("contact", "β = 1"), ("stokes", "Stokes")):
        yield from growth_with_size(slow.where(law=law), name)


def largest_of(table) -> list:
    """The rows of the largest packings, of a study of its own, in a list: empty if it has not been run."""
    study = table.path / "largest"
    return [jampetsc.load(study).where(command="quasistatic", state="done")] if study.exists() else []


def saturation(tables):
    """Slope of ln R in ln pN² at the largest pN², R = η₀ with over without pre-stress: 0 where the crossover ends."""
    x, ratio, error = (np.concatenate(part) for part in zip(*map(ratio_of_prestress, tables), strict=True))
    order = np.argsort(x, kind="stable")
    x, ratio, error = x[order], ratio[order], error[order]
    rows = tables[-1]
    last = x > 0.05 * x[-1]
    if x[-1] < 10 * LARGE or last.sum() < 2:
        return
    found = power_law(x[last], ratio[last], error[last])
    told = ", ".join(
        f"{r:.2f}({100 * e:.0f}) at {at:.1e}" for at, r, e in zip(x, ratio, error, strict=True) if at > 1
    )
    what = f"β = 1: R = η₀ with/without pre-stress ~ (pN²)^x, pN² = {x[last][0]:.0e} … {x[-1]:.0e}"
    yield check(what, found.value, found.inflated, f"R = {told}", size_of(rows))


def viscosities(rows, prefix, subtracted):
    """[(N, p, η₀ of its packings)] at p ≤ 1e-3, where there are three or more, less η_F where subtracted."""
    found = []
    for key, part in rows.groups(["n", "pressure"]):
        values = part[f"{prefix}eta0"] - (part[f"{prefix}eta0_fluid"] if subtracted else 0.0)
        if key["pressure"] <= NEAR and part.rows > 2:
            found.append((key["n"], key["pressure"], values))
    return found


def size_rows(rows, name, prefix, theirs, subtracted):
    """Rows about η₀/N^a against pN²; the claims are about what BT draw filled, without pre-stress."""
    points = viscosities(rows, prefix, subtracted)
    n, p = np.array([(one, level) for one, level, _ in points]).reshape(-1, 2).T
    if len(n) < 9 or len(set(n)) < MIN_SIZES:
        return
    y, error = np.transpose([log_median(values) for *_, values in points])
    size, x = size_of(rows), p * n**2
    fits = [
        size_scaling(n, p, np.exp(y), error * np.exp(y), degree)
        for degree in (DEGREE, DEGREE - 1, DEGREE + 1)
    ]
    systematic = 0.5 * max(abs(other.power - fits[0].power) for other in fits[1:])
    found = Estimate(fits[0].power, fits[0].error, systematic, fits[0].chi2, fits[0].dof)
    note = f"p ≤ {NEAR:g}, pN² = {x.min():.0e} … {x.max():.0e}; χ²/dof {found.chi2 / found.dof:.1f}"
    what = f"{name}: a of η₀ = N^a f(pN²)"
    contact = rows["law"][0] == "contact"
    on = "size-a" if contact else "stokes-a"
    if theirs and prefix:
        yield Row(what, f"{theirs:g}", found, number(theirs), note, size, bears=on)
    else:
        yield check(what, found.value, found.inflated, note, size, f"{theirs:g}" if theirs else "", bears=on)
    steep = x > LARGE
    if steep.sum() > 2 and theirs:
        slope, own, chi2, dof = line_fit(
            (np.ones(steep.sum()), np.log(x[steep])), (y - theirs * np.log(n))[steep], error[steep]
        )
        what, guide = f"{name}: η₀/N^{theirs:g} ~ (pN²)^x, pN² > {LARGE:g}", -theirs / 2
        estimate = Estimate(slope, own, 0.0, chi2, dof)
        if contact and prefix:
            words, target = f"−a/2 = {guide:g}", number(guide)
            yield Row(what, words, estimate, target, "", size, bears="size-a", part=None)
        elif prefix:
            words, target = f"shallower: > {guide:g}", between(guide, 0.0)
            yield Row(what, words, estimate, target, "", size, bears="stokes-slope")
        else:
            on = "shallow" if contact else "stokes-slope"
            yield check(what, slope, estimate.inflated, "", size, f"shallower: > {guide:g}", bears=on)
    low, high = x < 0.1, x > 30
    if low.any() and high.any() and prefix:
        level, flank = (
            np.average(values[some], weights=error[some] ** -2)
            for values, some in ((y - np.log(n), low), (y + 0.5 * np.log(p), high))
        )
        crossing = np.exp(2 * (flank - level))
        scatter = 2 * crossing * np.hypot(*(np.sum(error[some] ** -2.0) ** -0.5 for some in (low, high)))
        what = f"{name}: pN² at which η₀ ~ N and η₀ ~ p^(−½) meet"
        if contact:
            ours = Estimate(crossing, scatter)
            yield Row(what, "~ 1", ours, between(0.1, 10.0), "", size, bears="size-crossing")
        else:
            yield check(what, crossing, scatter, "", size, "~ 1", bears="size-crossing")


def growths(rows):
    """[(p, N (M,), √p (η₀ − η_F) (M,), errors (M,), A, B, error of B)] without pre-stress, p with enough sizes.

    √p (η₀ − η_F) = A + B ln N.
    """
    points, found = viscosities(rows, "no_prestress_", rows["law"][0] == "stokes"), []
    for level in sorted({p for _, p, _ in points}):
        scaled = [
            (n, *mean_with_error(np.sqrt(p) * values))
            for n, p, values in points
            if p == level and p * n**2 > 30
        ]
        if len(scaled) < MIN_SIZES:
            continue
        sizes, means, errors = np.transpose(scaled)
        slope, own, *_ = line_fit((np.ones_like(sizes), np.log(sizes)), means, errors)
        constant = np.average(means - slope * np.log(sizes), weights=errors**-2.0)
        found.append((level, sizes, means, errors, constant, slope, own))
    return found


def growth_with_size(rows, name):
    """The rows of B of √p (η₀ − η_F) = A + B ln N."""
    subtracted = rows["law"][0] == "stokes"
    for level, sizes, means, errors, constant, slope, own in growths(rows):
        n, scaled = sizes.max(), zip(sizes, means, errors, strict=True)
        told = ", ".join(f"{value:.3f}({1000 * error:.0f}) at {size:g}" for size, value, error in scaled)
        power = 1.0 + slope / (constant + slope * np.log(n))  # 1 + d ln(A + B ln N)/d ln N
        note = f"means {told}; a = {power:.2f} at N = {n:g}"
        what = f"{name}, without pre-stress, p = {level:g}: B of √p {'(η₀ − η_F)' if subtracted else 'η₀'} = A + B ln N"
        yield check(what, slope, own, note, size_of(rows), "> 0" if subtracted else "0", predicted=True)
