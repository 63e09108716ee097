"""Slopes of G'(ω) and G''(ω) on the critical branch, between both crossovers of a packing near jamming."""

from jampetsc.analysis.power_laws import CRITICAL_END, fit_power_law

CRITICAL_START = 10.0  # ωτ₁ over p/k: well above the lower crossover, which is near 2 to 4 (BT eq. 16)
MIN_FREQUENCIES = 5  # in the critical window for a slope


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
