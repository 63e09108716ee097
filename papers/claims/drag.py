"""G* under Stokes drag: BT figure 6.

Primary estimators. η₀ − η_F: as the exponents of `moduli`. Δ: (G*² − G₀²)/(iω) = [A + B ln(G*/iω)] (iω)^(2Δ − 1) with
G* less iωη_F, 10 p ≤ ω ≤ 0.02/τ₁, at the lowest p. The logarithm is that of η₀ in N, cut off by ℓ² = G*/(iω) instead of
the cell: √p (η₀ − η_F) = A′ + B′ ln N has B = 2 B′ G₀/√p, since (G*² − G₀²)/(iω) → 2 G₀ (η₀ − η_F) as ω → 0.
"""

import numpy as np
from scipy.optimize import least_squares

from jampetsc.analysis.power_laws import local_slope
from jampetsc.analysis.statistics import draws_of, log_median, mean_with_error
from jampetsc.plots.curves import curve_of
from papers.claims.moduli import LIMIT, NARROWER, RESAMPLED, curves_of, delta_row, exponent_rows
from papers.claims.shared import Row, beside, check, claim, independent, size_of
from papers.claims.sizes import growths
from papers.claims.verdicts import Estimate, between, exact, number

IDENTITIES = {
    "stokes-storage": "iωη_F is added to G* of any packing",
    "stokes-linear": "G* less iωη_F is of any packing",
}


@claim("bt-fig6", exact=IDENTITIES)
def drag(table):
    """The rows of figure 6 but Δ."""
    slow = table.where(command="quasistatic", state="done")
    cases = (("eta0_drag", "η₀ − η_F", -0.5, "stokes-eta0"),)
    yield from exponent_rows(slow, "Stokes, η_F = 1", cases, shallow=("eta0_drag",))
    sweeps = table.where(command="sweep", state="done")
    for on, where in ((0, "without pre-stress"), (1, "with pre-stress")):
        rows = delta_row(sweeps.where(eta_f=1.0, prestress=on), f"Stokes, η_F = 1, {where}", 1.0)
        yield from beside(rows, "stokes-Delta")
    some = sweeps.where(prestress=1, pressure=1e-4)
    off, least, fast = [], {}, []
    for _, part in some.groups(["seed"]):
        curves = {key["eta_f"]: curve_of(one.results()[0]) for key, one in part.groups(["eta_f"])}
        off += [np.abs(c.G.real / curves[1.0].G.real - 1).max() for c in curves.values()]
        fast.append(curves[1.0].G[-1].imag / curves[1.0].omega[-1])
        for eta, c in curves.items():
            least.setdefault(eta, []).append(local_slope(c.omega, c.G.imag).min())
    what = f"Stokes, p = 1e-4: G′ of {len(least)} η_F, largest relative difference"
    ours, target = Estimate(max(off)), between(0.0, 1e-4)
    yield Row(what, "0", ours, target, "", size_of(some), bears="stokes-storage")
    what = "Stokes, p = 1e-4, η_F = 1: G″/(η_Fω) at the highest ω"
    ours, part = Estimate(*mean_with_error(fast)), "G″/(η_Fω) at the highest ω"
    yield Row(what, "1", ours, exact(1.0), "", size_of(some), bears="stokes-linear", part=part)
    told = ", ".join(
        f"{np.median(slope):.2f} at η_F = {eta:g}" for eta, slope in sorted(least.items()) if eta >= 1
    )
    what = f"Stokes, p = 1e-4, η_F = {max(least):g} ≫ p^(−½): least d ln G″/d ln ω"
    estimate = Estimate(*mean_with_error(least[max(least)]))
    words, part = "linear: 1 ± 0.02", f"least d ln G″/d ln ω at η_F = {max(least):g}"
    yield Row(
        what, words, estimate, between(0.98, 1.02), told, size_of(some), bears="stokes-linear", part=part
    )


def logarithmic_fit(omega, G, static, slope=None):
    """(A, B, Δ, rms) of (G² − static²)/(iω) = [A + B ln(G/iω)] (iω)^(2Δ − 1), least squares of relative differences.

    omega, G    (M,), G complex and without iωη_F
    slope       B, where Δ is fitted; None: B is fitted, with Δ = ½
    """
    y, log = (G**2 - static**2) / (1j * omega), np.log(G / (1j * omega))

    def parameters(x):
        return (x[0], x[1], 0.5) if slope is None else (x[0], slope, x[1])

    def differences(x):
        constant, b, delta = parameters(x)
        off = (constant + b * log) * (1j * omega) ** (2 * delta - 1) / y - 1
        return np.concatenate((off.real, off.imag))

    found = least_squares(differences, (0.05, 0.08 if slope is None else 0.5))
    return *parameters(found.x), float(np.sqrt(np.mean(found.fun**2) * 2))


def mean_fit(curves, p, window, slope=None, chosen=slice(None)):
    """`logarithmic_fit` of the mean of some curves at η_F = 1, window[0] p ≤ ω ≤ window[1]."""
    omega = curves[0].omega
    G = np.array([curve.G - 1j * omega for curve in curves])[chosen]
    inside = (omega > window[0] * p * (1 - 1e-6)) & (omega < window[1] * (1 + 1e-6))
    return logarithmic_fit(omega[inside], G.mean(axis=0)[inside], G[:, 0].real.mean(), slope)


def slope_of_logarithm(slow, sizes) -> Estimate | None:
    """B = 2 B′ G₀/√p from the growth of η₀ with ln N, B′ at its pressures, and G₀ at the lowest; without pre-stress."""
    found = growths(sizes.where(command="quasistatic", state="done", law="stokes"))
    if not found:
        return None
    values, errors = np.transpose([growth[-2:] for growth in found])
    mean, own = np.average(values, weights=errors**-2.0), np.sum(errors**-2.0) ** -0.5
    p = slow["pressure"].min()
    static = np.exp(log_median(independent(slow.where(pressure=p), "no_prestress_G0"))[0]) / np.sqrt(p)
    return Estimate(2 * static * float(mean), 2 * static * float(own))


@claim("bt-fig6", "bt-fig8", on="stokes-Delta")
def logarithm(table, sizes):
    """Δ with the logarithm of η₀, and B of G* beside that of η₀."""
    slope = slope_of_logarithm(table.where(command="quasistatic", state="done"), sizes)
    if slope is None:
        return
    sweeps = table.where(command="sweep", state="done", eta_f=1.0)
    for on, where in ((0, "without pre-stress"), (1, "with pre-stress")):
        some = sweeps.where(prestress=on)
        groups = [
            (p, curves) for p, curves in curves_of(some) if LIMIT[0] * p * 9 < LIMIT[1] and len(curves) > 2
        ]
        for p, curves in groups:
            draws = draws_of(len(curves), RESAMPLED, 0)
            if not on:
                _, b, _, rms = mean_fit(curves, p, LIMIT)
                error = np.std([mean_fit(curves, p, LIMIT, chosen=row)[1] for row in draws])
                what = f"Stokes, {where}, p = {p:g}: B of (G*² − G₀²)/(iω) = A + B ln(G*/iω)"
                note = f"the form fits to {100 * rms:.0f} % (rms); predicted from B of η₀ = A + B ln N"
                yield check(what, b, error, note, size_of(some), str(slope), predicted=True)
            value = mean_fit(curves, p, LIMIT, slope.value)[2]
            own = np.std([mean_fit(curves, p, LIMIT, slope.value, row)[2] for row in draws])
            ends = [slope.value + sign * slope.statistical for sign in (-1, 1)]
            by_slope = 0.5 * abs(np.diff([mean_fit(curves, p, LIMIT, end)[2] for end in ends])[0])
            by_window = 0.5 * max(
                abs(mean_fit(curves, p, window, slope.value)[2] - value) for window in NARROWER
            )
            ours = Estimate(value, float(own), float(np.hypot(by_slope, by_window)))
            note = f"B = {slope} from η₀ = A + B ln N"
            what = f"Stokes, η_F = 1, {where}, p = {p:g}: Δ, with the logarithm"
            row = Row(what, "≈ 0.5", ours, number(0.5), note, size_of(some))
            yield from [row] if on and p == groups[0][0] else beside([row])
