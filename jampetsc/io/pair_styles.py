"""Potentials of LAMMPS' pair styles in the conventions of `packing.potentials`.

With the overlap δ and the radii Rᵢ, Rⱼ (LAMMPS' manual, pages of the pair styles):

    harmonic/cut K    U = K δ²                                     k = 2K
    gran/hooke kn     f = kn δ, kn a force over a length           k = kn
    gran/hertz kn     f = kn √(RᵢRⱼ/(Rᵢ + Rⱼ)) δ^(3/2), kn a pressure   hertzian, f = k δ^(3/2): k = kn √(R/2)

Damping, friction and mass of granular styles are no part of the potential.
"""

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.io.disk_table import is_number

SIZE_TOLERANCE = 1e-6  # relative difference of radii within which they are alike


def _harmonic(stiffness, radii):
    return {"potential": "harmonic", "stiffness": "constant", "k": 2.0 * stiffness}


def _hooke(stiffness, radii):
    return {"potential": "harmonic", "stiffness": "constant", "k": stiffness}


def _hertz(stiffness, radii):
    low, high = (stiffness * float(np.sqrt(radius / 2.0)) for radius in (radii.min(), radii.max()))
    if np.ptp(radii) > SIZE_TOLERANCE * radii.max():
        raise InputError(
            f"{named('pair_style')} gran/hertz: supported for radii that are all alike, as its force is ∝ "
            f"√(RᵢRⱼ/(Rᵢ + Rⱼ)) (radii {radii.min():g} to {radii.max():g}). For a similar one give "
            f"{named('potential')} hertzian and a {named('k')} from {low:.6g} to {high:.6g}, and minimise the energy."
        )
    return {"potential": "hertzian", "stiffness": "constant", "k": low}


PAIR_STYLES = {  # name -> the potential of its stiffness and radii (N,)
    "harmonic/cut": _harmonic,
    "gran/hooke": _hooke,
    "gran/hertz": _hertz,
}


def potential_of_pair_style(text, radii) -> dict:
    """{potential, stiffness, k} of a pair style and its first coefficient, "gran/hertz 2e5". Raises InputError.

    radii   (N,) in the units of length in which the coefficient is given
    """
    style, *numbers = str(text).split()[:2] or [""]
    name = style.removesuffix("/history")
    if name not in PAIR_STYLES:
        raise InputError(
            f"{named('pair_style')} {style}: not supported. Choose one of {', '.join(PAIR_STYLES)}, or give "
            f"{named('potential')}, {named('stiffness')} and {named('k')}."
        )
    if not numbers or not is_number(numbers[0]) or not float(numbers[0]) > 0.0:
        raise InputError(
            f"{named('pair_style')} {text}: needs its stiffness, a positive number. Give e.g. '{style} 100'."
        )
    return PAIR_STYLES[name](float(numbers[0]), radii)
