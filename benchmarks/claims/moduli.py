"""G* of linear response: BT figures 3, 4, 6 and 8. Packings are quenched at a pressure in a cell of fixed shape."""

from dataclasses import dataclass

import numpy as np

import jampetsc
from claims.shared import LARGE, NEAR, Row, by_decades, claim, line_through, near_jamming, size_of, verdict
from jampetsc.analysis.scaling import collapse_spread, critical_exponents, local_slope
from jampetsc.analysis.statistics import log_median, mean_with_error
from jampetsc.plots.curves import curve_of
from jampetsc.plots.finite_size import FEWEST

BOTH = (("no_prestress_", "without pre-stress"), ("", "with pre-stress"))
WINDOW = 50.0, 0.1  # critical frequencies, from so many p/k to so many 1/τ₁
MEDIANS = "medians over packings"
AROUND = 0.1  # of ½, where a slope counts as critical
SLOW = 1e-2  # ωτ₁ up to which κ is iωβτ₁
LOGARITHM = (
    "on its way as p falls: under drag G″ ~ ω^½ [A − ½B ln ω], whose slope comes to ½ as 1/ln ω (docs/physics.md): "
    "it would take p far below 1e-5"
)
CORRECTION = "comes to it as p falls, with corrections ~ p^½: it would take a lower p"
BORDER = (
    "comes down to it as p falls: without rotations the upper border is lower and felt in this window; it would take a "
    "window that ends lower, at p below 1e-5"
)
TINY = 1e-6  # relative difference of what is the same, in the single precision of kept results
DEGREE = 5  # of the polynomial in ln pN² that stands for ln f


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


@dataclass(frozen=True)
class SizeScaling:
    """η₀/N^a as a function of pN²."""

    power: float  # a
    error: float  # from the errors of the points, times √(χ²/dof) where that is above 1
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
    variance = np.linalg.inv(terms.T @ terms)[0, 0] * max(1.0, chi2 / dof)
    return SizeScaling(float(found[0]), float(np.sqrt(variance)), chi2, dof)


def exponents_in_pressure(rows, cases, law):
    """Rows about the exponents of columns in p; cases: (column, name, theirs)."""
    unstable = np.count_nonzero(rows["G0"] < 0)
    for prefix, where in BOTH:
        for column, name, theirs in cases:
            found = near_jamming(rows, prefix + column)
            if found is None:
                continue
            note = f"{MEDIANS}; {by_decades(rows, prefix + column)}"
            if not prefix:
                note += f"; {unstable} of {rows.rows} packings have G₀ < 0 and count like the others"
            what = f"{law}: {name} ~ p^x, {where}, p ≤ {NEAR:g}, pN² > {LARGE:g}"
            yield Row(what, theirs, *found, note, size_of(rows), verdict(theirs, *found))


def curves_of(sweeps):
    """[(p/k, curves)] from the lowest pressure."""
    return [
        (key["pressure"], [curve_of(r) for r in part.results()]) for key, part in sweeps.groups(["pressure"])
    ]


def window_means(curves, low, of):
    """(curves,) means of of(omega, G) (M,) over ln ω from `low` to 0.1/τ₁, both inclusive."""
    found = []
    for curve in curves:
        inside = (curve.omega >= low * (1 - 1e-9)) & (curve.omega <= WINDOW[1] * (1 + 1e-9))
        with np.errstate(divide="ignore", invalid="ignore"):  # beyond it digits of the difference may be lost
            found.append(np.mean(of(curve.omega, curve.G)[inside]))
    return np.array(found)


def delta(omega, G):
    """½ d ln|G*² − G₀²|/d ln ω, G₀ from the lowest frequency."""
    return critical_exponents(omega, G, G[0].real)[0]


def phase(omega, G):
    """arg(G*² − G₀²)/π."""
    return critical_exponents(omega, G, G[0].real)[1]


def regimes(sweeps, law, where, fluid=0.0, why=""):
    """Rows about Δ at the lowest pressure, with iωη_F subtracted; why: why numbers on their way to theirs are open."""
    groups = [(p, curves) for p, curves in curves_of(sweeps) if WINDOW[0] * p < WINDOW[1]]
    if not groups:
        return

    def without(of):
        return lambda omega, G: of(omega, G - 1j * omega * fluid)

    cases = (
        ("½ d ln|G*² − G₀²|/d ln ω", delta, 0.5),
        ("arg(G*² − G₀²)/π", phase, 0.5),
        ("d ln G″/d ln ω", lambda omega, G: local_slope(omega, G.imag), 0.5),
        ("G″/G′, tan(πΔ/2)", lambda omega, G: G.imag / G.real, 1.0),
    )
    for name, of, theirs in cases:
        means = [
            (p, *mean_with_error(window_means(curves, WINDOW[0] * p, without(of)))) for p, curves in groups
        ]
        p, value, error = means[0]
        told = ", ".join(
            f"{mean:.3f}({0 if error != error else round(1000 * error):d})" for _, mean, error in means
        )
        note = f"at p = {', '.join(f'{p:g}' for p, *_ in means)}: {told}"
        what = f"{law}, {where}: {name} between {WINDOW[0]:g} p and {WINDOW[1]:g}, p = {p:g}"
        told = verdict(theirs, value, error)
        off = abs(value - theirs)
        if why and off > 2 * error and len(means) == 1:
            note, told = f"{note}; one pressure does not tell where it goes", "open"
        elif why and off > 2 * error and off < abs(means[-1][1] - theirs):
            note, told = f"{note}; {why}", "open"  # on its way
        yield Row(what, theirs, value, error, note, size_of(sweeps), told)


@claim("bt-fig3")
def balanced(table):
    slow = table.where(command="quasistatic", state="done")
    cases = (("G0", "G₀", 0.5), ("eta0", "η₀", -0.5), ("omega_star", "ω* = G₀/η₀", 1.0))
    yield from exponents_in_pressure(slow, cases, "β = 1")
    sweeps = table.where(command="sweep", state="done")
    for on, where in ((0, "without pre-stress"), (1, "with pre-stress")):
        mine = sweeps.where(prestress=on, rotations=1)
        yield from regimes(mine, "β = 1", where, why=CORRECTION)
        groups = curves_of(mine)
        borders = [
            (p, *mean_with_error([upper_border(c.omega, c.G) for c in curves])) for p, curves in groups
        ]
        told = ", ".join(f"{value:.2f} at {p:g}" for p, value, _ in borders)
        what = f"β = 1, {where}: upper border, where d ln G″/d ln ω passes ¾, in 1/τ₁, p = {borders[0][0]:g}"
        note = f"BT: ω ~ 1 at every p; {told}: it tends to a constant"
        yield Row(
            what, None, *borders[0][1:], note, size_of(mine), "yes" if 0.1 < borders[0][1] < 10 else "no"
        )
        curves = [median_curve(found) for _, found in groups]
        spread = collapse_spread([(omega, G, p) for (omega, G), (p, _) in zip(curves, groups, strict=True)])
        note = f"spread (rms) of ln G′ and ln G″, {MEDIANS}, over all p"
        what = f"β = 1, {where}: G*/p^½ is one curve of ω/p below ωτ₁ = 0.1"
        yield Row(what, None, spread, None, note, size_of(mine))
    yield from without_rotations(sweeps)


def without_rotations(sweeps):
    """Rows about disks that do not turn, with pre-stress, on the same packings."""
    still = sweeps.where(rotations=0, prestress=1)
    yield from regimes(still, "β = 1, no rotations", "with pre-stress", why=BORDER)
    for p, curves in curves_of(still)[:1]:
        turning = sweeps.where(rotations=1, prestress=1, pressure=p)
        ratios = []
        for curve, result in zip(curves, turning.results(), strict=True):
            inside = (curve.omega >= WINDOW[0] * p) & (curve.omega <= WINDOW[1])
            ratio = np.abs(curve.G / curve_of(result).G)
            ratios.append((np.mean(ratio[inside]), np.ptp(ratio[inside]), ratio[-1]))
        (value, change, fast), (error, *_) = mean_with_error(ratios)
        note = f"changes by {change:.2f} within; {fast:.2f} at the highest ω; BT: the form of G* stays"
        what = f"β = 1: |G*| without over with rotations, {WINDOW[0]:g} p … {WINDOW[1]:g}, p = {p:g}"
        yield Row(what, None, value, error, note, size_of(still), "yes" if change < 0.2 * value else "no")


def median_curve(curves):
    """(ωτ₁, median of G′ + i median of G″)."""
    G = np.array([curve.G for curve in curves])
    return curves[0].omega, np.median(G.real, axis=0) + 1j * np.median(G.imag, axis=0)


@claim("bt-fig4")
def sliding(table):
    sweeps = table.where(command="sweep", state="done")
    off = [np.abs(s.G / (s.G.real[0] * (1 + 1j * s.omega)) - 1).max()
           for s in sweeps.where(beta=0.0, prestress=0).results()]  # fmt: skip
    size = size_of(sweeps.where(beta=0.0))
    what = "β = 0 without pre-stress: G*/[G₀(1 + iωτ₁)] − 1, largest"
    yield Row(what, 0.0, max(off), None, "exact", size, "yes" if max(off) < TINY else "no")
    slow = table.where(command="quasistatic", state="done")
    cases = (
        ("eta0_normal", "η₀ at β = 0", 0.5),
        ("eta0_transverse", "η₀ − η₀(β = 0), per β", -0.5),
        ("beta_star", "β* = G₀Vγ²/kΣ(Δu⊥ᶜ)²", 1.0),
    )
    columns = {name: slow[name] for name in slow}
    for prefix, _ in BOTH:
        columns[f"{prefix}beta_star"] = slow[f"{prefix}G0"] / slow[f"{prefix}eta0_transverse"]
    yield from exponents_in_pressure(type(slow)(slow.path, columns, jampetsc.load), cases, "contact damping")
    off, slopes, rises = [], [], []
    for result in slow.results():
        beta, eta0 = result["beta_scan/beta"], result["beta_scan/no_prestress_eta0"]
        a = result.attributes
        model = a["no_prestress_G0"] + beta * a["no_prestress_eta0_transverse"]
        off.append(np.abs(eta0 / model - 1).max())
        slopes.append(np.log(eta0[-3] / eta0[-1]) / np.log(beta[-1] / beta[-3]))
        middle = (beta > 0.9e-2) & (beta < 1.1e-1)  # p ≪ β ≪ 1
        rises.append(np.diff(np.log(result["beta_scan/eta_inf"][middle])).item() / np.log(10))
    note = "exact: rotations that are best for one β are for all; β = 1e-8 … 100"
    what = "without pre-stress: η₀/τ₁ = G₀ + βkΣ(Δu⊥ᶜ)²/(Vγ²), largest relative difference"
    yield Row(what, 0.0, max(off), None, note, size, "yes" if max(off) < TINY else "no")
    note = "G₀ is the same for all β, and η₀ = G₀(1 + β/β*): −1 for β ≫ β*"
    yield Row("without pre-stress: ω* = G₀/η₀ ~ β^x, β = 1 … 100", -1.0, *mean_with_error(slopes), note, size,
              "yes" if abs(np.mean(slopes) + 1) < 0.02 else "no")  # fmt: skip
    lowest = slow["pressure"] == slow["pressure"].min()
    yield Row("η_∞ ~ β^x, β = 1e-2 … 1e-1, lowest p", None, *mean_with_error(np.array(rises)[lowest]),
              "½ for p ≪ β ≪ 1 follows from F(κ) ~ √κ", size)  # fmt: skip
    yield from windows_of_beta(sweeps)


def windows_of_beta(sweeps):
    """Rows about the sweeps at several β and one pressure: the window in which G″ ~ ω^½, and F(κ)."""
    for on, where in ((0, "without pre-stress"), (1, "with pre-stress")):
        some = sweeps.where(prestress=on, pressure=1e-4)
        groups = [(key["beta"], [curve_of(r) for r in part.results()]) for key, part in some.groups(["beta"])]
        widths = [(beta, np.median([critical_decades(c) for c in curves])) for beta, curves in groups]
        told = ", ".join(f"{width:.1f} at {beta:g}" for beta, width in widths)
        widest = max(width for _, width in widths)
        none = max(width for beta, width in widths if beta < 1e-4 / 5)
        note = f"{MEDIANS}; BT: it grows gradually with β, none for β ≪ β* ~ p; {told}"
        what = f"p = 1e-4, {where}: most decades of ω with d ln G″/d ln ω = ½ ± {AROUND:g}"
        yield Row(what, None, widest, None, note, size_of(some), "yes" if none < 0.5 < widest else "no")
        if not on:
            spread = one_curve_spread([(beta, c) for beta, curves in groups if beta for c in curves[:1]])
            what = f"p = 1e-4, {where}: G*/(1 + iωτ₁) = F of βω for all β, ω < {SLOW:g}: spread (rms)"
            note = "one packing; exact as F(κ), κ = iωβτ₁/(1 + iωτ₁), which is iωβτ₁ to one per cent"
            yield Row(what, None, spread, None, note, size_of(some), "yes" if spread < SLOW else "no")


def critical_decades(curve):
    """Decades of ω over which d ln G″/d ln ω is ½ ± AROUND."""
    near = np.abs(local_slope(curve.omega, curve.G.imag) - 0.5) < AROUND
    return np.sum(near[1:] * np.diff(np.log10(curve.omega)))


def one_curve_spread(curves):
    """How far G*/(1 + iωτ₁) is from one curve of βω, for [(β, curve)]."""
    scaled = [(c.omega, c.G / (1 + 1j * c.omega), 1 / beta) for beta, c in curves]
    return collapse_spread(scaled, 0.0, 1.0, end=SLOW)


@claim("bt-fig6")
def drag(table):
    slow = table.where(command="quasistatic", state="done")
    yield from exponents_in_pressure(slow, (("eta0_drag", "η₀ − η_F", -0.5),), "Stokes, η_F = 1")
    sweeps = table.where(command="sweep", state="done")
    for on, where in ((0, "without pre-stress"), (1, "with pre-stress")):
        yield from regimes(sweeps.where(eta_f=1.0, prestress=on), "Stokes, G* − iωη_F", where, 1.0, LOGARITHM)
    some = sweeps.where(prestress=1, pressure=1e-4)
    off, least = [], {}
    for _, part in some.groups(["seed"]):
        curves = {key["eta_f"]: curve_of(one.results()[0]) for key, one in part.groups(["eta_f"])}
        off += [np.abs(c.G.real / curves[1.0].G.real - 1).max() for c in curves.values()]
        for eta, c in curves.items():
            least.setdefault(eta, []).append(local_slope(c.omega, c.G.imag).min())
    what = f"Stokes, p = 1e-4: G′ of {len(least)} η_F over ten decades, largest relative difference"
    note = "exact: iωη_F is added to G*"
    yield Row(what, 0.0, max(off), None, note, size_of(some), "yes" if max(off) < 1e-4 else "no")
    told = ", ".join(f"{np.median(slope):.2f} at {eta:g}" for eta, slope in sorted(least.items()))
    note = f"{MEDIANS}; BT: linear at all ω for η_F ≫ p^(−½) = 100; {told}"
    linear = np.median(least[max(least)])
    what = f"Stokes, p = 1e-4, η_F = {max(least):g}: least d ln G″/d ln ω"
    yield Row(what, None, linear, None, note, size_of(some), "yes" if linear > 0.98 else "no")


@claim("bt-fig8")
def finite_size(table):
    slow = table.where(command="quasistatic", state="done")
    laws = (
        ("contact", "contact damping β = 1", 1.0, False),
        ("stokes", "Stokes drag η_F = 1", 1.09, False),
        ("stokes", "Stokes drag, η_F subtracted", None, True),
    )
    for law, name, theirs, subtracted in laws:
        mine = slow.where(law=law)
        for prefix, where in BOTH:
            yield from size_rows(mine, f"{name}, {where}", prefix, theirs, subtracted)
    contact = slow.where(law="contact")
    x = contact["pressure"] * contact["n"] ** 2
    ranges = (("< 1", x < 1), ("1 … 1e3", (x >= 1) & (x < 1e3)), ("> 1e3", x >= 1e3))
    told = [
        f"{np.count_nonzero(contact['G0'][some] < 0)} of {np.count_nonzero(some)} at pN² {text}"
        for text, some in ranges
    ]
    note = f"they count like the others in all medians; {', '.join(told)}"
    share = np.mean(contact["G0"] < 0)
    yield Row("with pre-stress: share of packings with G₀ < 0", None, share, None, note, size_of(contact))
    for law, name in (("contact", "contact damping β = 1"), ("stokes", "Stokes drag")):
        yield from growth_with_size(slow.where(law=law), name)


def viscosities(rows, prefix, subtracted):
    """[(N, p, η₀ of its packings)] at p ≤ 1e-3, where there are three or more, less η_F where subtracted."""
    found = []
    for key, part in rows.groups(["n", "pressure"]):
        values = part[f"{prefix}eta0"] - (part[f"{prefix}eta0_fluid"] if subtracted else 0.0)
        if key["pressure"] <= NEAR and part.rows > 2:
            found.append((key["n"], key["pressure"], values))
    return found


def size_rows(rows, name, prefix, theirs, subtracted):
    """Rows about η₀/N^a against pN²."""
    points = viscosities(rows, prefix, subtracted)
    n, p = np.array([(one, level) for one, level, _ in points]).reshape(-1, 2).T
    if len(n) < 9 or len(set(n)) < FEWEST:
        return
    y, error = np.transpose([log_median(values) for *_, values in points])
    size, x = size_of(rows), p * n**2
    fit = size_scaling(n, p, np.exp(y), error * np.exp(y))
    note = f"{MEDIANS}, p ≤ {NEAR:g}, pN² = {x.min():.0e} … {x.max():.0e}; χ²/dof {fit.chi2 / fit.dof:.1f}"
    if rows["law"][0] == "stokes":
        note += "; ln N in place of a power, see B below"
    told = verdict(theirs, fit.power, fit.error) if theirs else ""
    yield Row(f"{name}: a of η₀ = N^a f(pN²)", theirs, fit.power, fit.error, note, size, told)
    steep = x > LARGE
    if steep.sum() > 2 and theirs:
        slope, spread = line_through(np.log(x[steep]), (y - theirs * np.log(n))[steep], error[steep])
        what, guide = f"{name}: η₀/N^{theirs:g} ~ (pN²)^x, pN² > {LARGE:g}", -theirs / 2
        if prefix and rows["law"][0] == "contact":
            yield Row(what, guide, slope, spread, "−a/2", size, verdict(guide, slope, spread))
        else:
            told = "yes" if slope - 2 * spread > guide else "open"
            yield Row(what, None, slope, spread, f"BT: shallower than −a/2 = {guide:g}", size, told)
    low, high = x < 0.1, x > 30
    if low.any() and high.any() and prefix:
        level, flank = (
            np.average(values[some], weights=error[some] ** -2)
            for values, some in ((y - np.log(n), low), (y + 0.5 * np.log(p), high))
        )
        crossing = np.exp(2 * (flank - level))
        scatter = 2 * crossing * np.hypot(*(np.sum(error[some] ** -2.0) ** -0.5 for some in (low, high)))
        what = f"{name}: pN² at which η₀ ~ N and η₀ ~ p^(−½) meet"
        yield Row(what, None, crossing, scatter, "BT: ~ 1", size, "yes" if 0.1 < crossing < 10 else "no")


def growth_with_size(rows, name):
    """Rows about √p (η₀ − η_F) = A + B ln N without pre-stress, at each pressure that has enough sizes."""
    subtracted = rows["law"][0] == "stokes"
    points = viscosities(rows, "no_prestress_", subtracted)
    for level in sorted({p for _, p, _ in points}):
        scaled = [
            (n, *mean_with_error(np.sqrt(p) * values))
            for n, p, values in points
            if p == level and p * n**2 > 30
        ]
        if len(scaled) < FEWEST:
            continue
        n = max(size for size, *_ in scaled)
        sizes, means, errors = np.transpose(scaled)
        (slope, constant), covariance = np.polyfit(np.log(sizes), means, 1, w=1.0 / errors, cov="unscaled")
        told = ", ".join(f"{value:.3f}({1000 * error:.0f}) at {size:g}" for size, value, error in scaled)
        expected = (
            "> 0: random forces in an elastic medium" if subtracted else "0: no length but the size of disks"
        )
        power = 1.0 + slope / (constant + slope * np.log(n))  # 1 + d ln(A + B ln N)/d ln N
        note = f"{expected}; means {told}; a = {power:.2f} at N = {n:g}"
        what = f"{name}, without pre-stress, p = {level:g}: B of √p {'(η₀ − η_F)' if subtracted else 'η₀'} = A + B ln N"
        yield Row(what, None, slope, np.sqrt(covariance[0, 0]), note, size_of(rows))
