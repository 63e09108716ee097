"""The exponent of a potential as an option, which pack, jam, import, flow and shear share."""

from jampetsc.packing.potentials import MAX_EXPONENT, MIN_EXPONENT

EXPONENT = {  # arguments of `parameter`
    "help": "exponent α of the potential power, whose force is ∝ overlap^(α−1); 2 is harmonic, 5/2 hertzian",
    "low": MIN_EXPONENT,
    "high": MAX_EXPONENT,
    "metavar": "A",
}
