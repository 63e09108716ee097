"""From the susceptibility χ of waves of forces to the modulus G(k, ω) = (n/V)/(k²χ), with bounds."""

import numpy as np

from jampetsc.analysis.error_bounds import storage_and_loss

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
