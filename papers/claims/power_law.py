"""Power-law damping: BT 27 to 29 beside oscillations that solve the equations of a whole cycle.

Primary estimators. Exponents in X = ω^α σ^(α−1), of which all moduli are functions: lines through points of a regime
at the lowest pressure, an offset for each packing, errors by bootstrap over packings. Systematic: half of the distance
of the linear packing's G*(Ω) from the limit of its exponent at the same points. The effective frequency Ω has no such
error: with Ω ~ X, as BT have it, G′ and G″ ~ Ω^½ are 28 and 29.
"""

import numpy as np

from jampetsc.analysis.statistics import mean_with_error
from papers.claims.shared import Row, check, claim, size_of
from papers.claims.verdicts import Estimate, between, number
from papers.tables.nonlinear import exponents, prefactor_exponent, read

FEWEST = 3  # packings of a pressure whose prefactors are compared


def exponent_in(variable, packings, value, regime):
    """Estimate of the exponent of value(packing) in variable(packing), None where too few points are in the regime."""
    found = exponents(packings, value, regime, lambda one: np.log(variable(one))[:, None])
    return None if found is None else Estimate(float(found[0][0]), float(found[1][0]))


def x_of(one):
    return one.X


def linear_storage(one):
    return one.storage


def storage(one):
    return one.G[0].real


def loss(one):
    return one.G[0].imag


def effective(one):
    return one.Omega[0]


@claim("bt-nonlinear", on="BT27")
def exponents_of_power_laws(table):
    oscillations = table.where(command="oscillate", state="done")
    data = read(table.path, table.path)
    for alpha, of_pressures in sorted(data.items()):
        if alpha == 1.0:
            continue
        p = min(of_pressures)
        packings, size = of_pressures[p], size_of(oscillations.where(alpha=alpha))
        yield from quasistatic(alpha, of_pressures, size)
        for on, name, symbol, value, theirs in (
            ("BT28", "BT 28", "G′", storage, 0.5),
            ("BT29", "BT 29", "G″", loss, 0.5),
            ("BT28", "BT 28, 29", "effective Ω", effective, 1.0),
        ):
            found = exponent_in(x_of, packings, value, "critical")
            if found is None:
                continue
            told = f"contacts move by γ₀|Δu|, not BT's σ/k: 4/(1 + 3α) = {4 / (1 + 3 * alpha):.2f}"
            if value is not effective:
                of_linear = linear_storage if value is storage else loss
                linear = exponent_in(effective, packings, of_linear, "critical").value
                found = Estimate(found.value, found.statistical, 0.5 * abs(linear - theirs))
                told = f"contacts move by γ₀|Δu|, not BT's σ/k: 2/(1 + 3α) = {2 / (1 + 3 * alpha):.2f}; linear damping "
                told += f"has {linear:.2f} for ½ here"
            what = f"α = {alpha:.2g}, critical, p = {p:g}: {symbol} ~ X^x, X = ω^α σ^(α−1) ({name})"
            yield Row(what, f"{theirs:g}", found, number(theirs), told, size, bears=on, part=None)
            both = exponents(packings, value, "critical")
            for axis, (letter, per_X) in enumerate((("ω", alpha), ("σ", alpha - 1.0))):
                what = f"α = {alpha:.2g}, critical, p = {p:g}: {symbol} ~ {letter}^x ({name})"
                yield check(what, both[0][axis], both[1][axis], "", size, f"{theirs * per_X:.3f}", bears=on)
    if (table.path / "large").exists():
        yield from at_large(table.path / "large")


def quasistatic(alpha, of_pressures, size):
    """BT 27: G″ ~ X p^(−½)."""
    p = min(of_pressures)
    found = exponent_in(x_of, of_pressures[p], loss, "quasistatic")
    if found is not None:
        linear = exponent_in(effective, of_pressures[p], loss, "quasistatic").value
        what = f"α = {alpha:.2g}, quasistatic, p = {p:g}: G″ ~ X^x, X = ω^α σ^(α−1) (BT 27)"
        ours = Estimate(found.value, found.statistical, 0.5 * abs(linear - 1.0))
        told = f"linear damping has {linear:.3f} for 1 here"
        part = f"exponent of X at α = {alpha:.2g}"
        yield Row(what, "1 ± 0.02", ours, between(0.98, 1.02), told, size, part=part)
        ratios = [np.mean(one.G[0].real[one.inside("quasistatic")] / one.G0) for one in of_pressures[p]]
        what, part = f"α = {alpha:.2g}, quasistatic, p = {p:g}: G′/G₀", f"α = {alpha:.2g}"
        ours = Estimate(*mean_with_error(ratios))
        yield Row(what, "1 ± 0.02", ours, between(0.98, 1.02), "", size, bears="slow-storage", part=part)
    several = {p: some for p, some in of_pressures.items() if len(some) >= FEWEST}
    if len(several) > 1:
        slope, error = prefactor_exponent(several, loss)
        of_omega, its = prefactor_exponent(several, effective)
        told = f"contacts move by γ₀|Δu|, not BT's σ/k: p^{0.25 * (1 - 3 * alpha):.2f} as p → 0; Ω/X ~ "
        told += f"p^{Estimate(of_omega, its)}, BT p^0"
        what = f"α = {alpha:.2g}, quasistatic: G″/X ~ p^x (BT 27)"
        part = f"exponent of p at α = {alpha:.2g}"
        yield Row(what, "-0.5", Estimate(slope, error), number(-0.5), told, size, part=part)


def at_large(folder):
    """Ω ~ X^x of packings with pN² ≥ 1000, a few points of the critical regime: of G′ and G″, functions of Ω alone."""
    for alpha, of_pressures in sorted(read(folder, folder).items()):
        for p, packings in of_pressures.items():
            found = exponent_in(x_of, packings, effective, "critical")
            if found is not None:
                n = packings[0].file.attributes["particle_count"]
                told = f"contacts move by γ₀|Δu|, not BT's σ/k: 4/(1 + 3α) = {4 / (1 + 3 * alpha):.2f}"
                size = f"N = {n}; {len(packings)} packings"
                for on, symbol, name in (("BT28", "G′", "BT 28"), ("BT29", "G″", "BT 29")):
                    what = f"α = {alpha:.2g}, critical, p = {p:g}, N = {n}: effective Ω of {symbol} ~ X^x ({name})"
                    yield Row(
                        what, "Ω ~ X: 1", found, number(1.0), told, size, bears=on, part=f"α = {alpha:.2g}"
                    )
