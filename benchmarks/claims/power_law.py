"""Power-law damping: BT 27 to 29 beside oscillations that solve the equations of a whole cycle.

Primary estimators. Exponents in X = ω^α σ^(α−1), of which all moduli are functions: planes through points of a regime at
the lowest pressure, an offset for each packing, errors by bootstrap over packings. Systematic, in the critical regime: how
far linear damping, α = 1, is from its own limit ½ there. The effective frequency Ω has no such error: with Ω ~ X, as BT
have it, G′ and G″ ~ Ω^½ are 28 and 29.
"""

import numpy as np
from nonlinear import exponents, prefactor_exponent, read

from claims.shared import Row, check, claim, size_of
from claims.verdicts import Estimate, number

POWER = "Power-law damping"


def in_x(packings, value, regime):
    """Estimate of the exponent of value(packing) in X, None where too few points are in the regime."""
    found = exponents(packings, value, regime, lambda one: np.log(one.X)[:, None])
    return None if found is None else Estimate(float(found[0][0]), float(found[1][0]))


def storage(one):
    return one.G[0].real


def loss(one):
    return one.G[0].imag


def effective(one):
    return one.Omega[0]


@claim("bt-nonlinear")
def exponents_of_power_laws(table):
    oscillations = table.where(command="oscillate", state="done")
    data = read(table.path, table.path)
    linear = data.get(1.0, {})
    for alpha, of_pressures in sorted(data.items()):
        if alpha == 1.0:
            continue
        p = min(of_pressures)
        packings, size = of_pressures[p], size_of(oscillations.where(alpha=alpha))
        yield from quasistatic(alpha, of_pressures, size)
        for name, symbol, value, theirs in (
            ("BT 28", "G′", storage, 0.5),
            ("BT 29", "G″", loss, 0.5),
            ("BT 28, 29", "effective Ω", effective, 1.0),
        ):
            found = in_x(packings, value, "critical")
            if found is None:
                continue
            told = f"4/(1 + 3α) = {4 / (1 + 3 * alpha):.2f} with the motion that contacts have"
            if value is not effective:
                own = in_x(linear[p], value, "critical") if p in linear else None
                off = abs(own.value - theirs) if own else np.nan
                found = Estimate(found.value, found.statistical, 0.5 * off)
                told = f"2/(1 + 3α) = {2 / (1 + 3 * alpha):.2f} with the motion that contacts have; "
                told += f"linear damping has {own.value:.2f} for ½ there" if own else "no linear damping to compare with"
            what = f"α = {alpha:.2g}, critical, p = {p:g}: {symbol} ~ X^x, X = ω^α σ^(α−1) ({name})"
            yield Row(what, f"{theirs:g}", found, number(theirs), POWER, told, size)
            both = exponents(packings, value, "critical")
            for axis, (letter, per_X) in enumerate((("ω", alpha), ("σ", alpha - 1.0))):
                what = f"α = {alpha:.2g}, critical, p = {p:g}: {symbol} ~ {letter}^x ({name})"
                yield check(what, both[0][axis], both[1][axis], "", size, f"{theirs * per_X:.3f}")


def quasistatic(alpha, of_pressures, size):
    """BT 27: G″ ~ X p^(−½)."""
    levels = sorted(of_pressures)
    found = [in_x(of_pressures[p], loss, "quasistatic") for p in levels]
    known = [(p, one) for p, one in zip(levels, found, strict=True) if one is not None]
    if known:
        p, first = known[0]
        told = ", ".join(f"{one.value:.3f}({1e3 * one.statistical:.0f}) at p = {level:g}" for level, one in known)
        change = 0.5 * abs(known[1][1].value - first.value) if len(known) > 1 else np.nan
        ours = Estimate(first.value, first.statistical, change)
        what = f"α = {alpha:.2g}, quasistatic, p = {p:g}: G″ ~ X^x, X = ω^α σ^(α−1) (BT 27)"
        yield Row(what, "1", ours, number(1.0), POWER, told, size)
    if len(levels) > 2:
        slope, error = prefactor_exponent(of_pressures, loss)
        of_omega, its = prefactor_exponent(of_pressures, effective)
        told = f"Ω/X ~ p^{of_omega:.2f}({100 * its:.0f}), BT p^0; with the motion that contacts have G″/X ~ "
        told += f"p^{0.25 * (1 - 3 * alpha):.2f} as p → 0"
        what = f"α = {alpha:.2g}, quasistatic: G″/X ~ p^x (BT 27)"
        yield Row(what, "-0.5", Estimate(slope, error), number(-0.5), POWER, told, size)
