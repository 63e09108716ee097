"""From the susceptibility χ of waves of forces to the modulus G(k, ω) = (n/V)/(k²χ), with bounds, and to sound."""

import numpy as np

from jampetsc.analysis.error_bounds import storage_and_loss

MIN_INSIDE = 3  # frequencies between the halves of a maximum
HALF = 0.5  # of the highest power, between whose frequencies the width is
FACTOR_ROUNDING = 32.0 * float(np.finfo(float).eps)  # of k², of the volume and of the quotient, relative


def modulus_of_wave(susceptibility, bounds, factor):
    """(G (…), complex, bounds on |ΔG|, |ΔG'| and |ΔG''|, (…, 3)) of χ (…) with its bounds (…, 3).

    factor   (n/V)/k², of a shape that fits χ

    With |χ| known to δ the true one is at least a − δ, a = |χ|, so that

        |ΔG| ≤ |G| δ/(a − δ) ,    |ΔG'| ≤ factor (|Δχ'| + |χ'| δ(2a − δ)/a²)/(a − δ)² ,

    and likewise G''; infinite where δ ≥ a.
    """
    parts, size = storage_and_loss(susceptibility), np.abs(susceptibility)
    G = factor * np.conj(susceptibility) / size**2
    delta = bounds[..., 0]
    least = np.maximum(size - delta, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        of_size = np.abs(G) * delta / least
        change = (delta * (2.0 * size - delta) / size**2)[..., None]
        of_parts = (
            np.expand_dims(factor, -1) * (bounds[..., 1:] + np.abs(parts) * change) / (least**2)[..., None]
        )
    bounds = np.concatenate((of_size[..., None], of_parts), axis=-1)
    rounding = FACTOR_ROUNDING * np.abs(np.concatenate((np.abs(G)[..., None], storage_and_loss(G)), axis=-1))
    return G, np.where((least > 0.0)[..., None], bounds + rounding, np.inf)


def resonance(omega, susceptibility) -> tuple[float, float]:
    """(ω_k, Γ) of the power −ω χ'' that forces of unit amplitude lose, from χ (M,) at increasing frequencies (M,).

    ω_k is where it is highest, Γ the width between its halves, exactly as of χ ∝ 1/(ω_k² − ω² + iωΓ), a damped
    oscillator. The top is of a parabola in ln ω, the halves are interpolated. nan where a half is not among the
    frequencies, or MIN_INSIDE of these are not between the halves.
    """
    x, power = np.log(omega), -omega * np.imag(susceptibility)
    top = int(np.argmax(power))
    below, above = (
        np.flatnonzero(power[part] < HALF * power[top]) for part in (slice(0, top), slice(top, None))
    )
    if not (len(below) and len(above) and top + above[0] - 1 - below[-1] >= MIN_INSIDE):
        return np.nan, np.nan
    curve = np.polynomial.Polynomial.fit(x[top - 1 : top + 2], np.log(power[top - 1 : top + 2]), 2)
    peak = float(curve.deriv().roots()[0])
    half = HALF * np.exp(curve(peak))
    ends = []
    for inner, outer in ((below[-1] + 1, below[-1]), (top + above[0] - 1, top + above[0])):
        rise = np.log(power[inner] / power[outer])
        ends.append(np.exp(x[outer] + (x[inner] - x[outer]) * np.log(half / power[outer]) / rise))
    return float(np.exp(peak)), float(ends[1] - ends[0])
