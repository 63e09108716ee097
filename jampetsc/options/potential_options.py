"""The exponent of a potential as an option, which pack, jam, import, flow and shear share."""

from jampetsc.packing.potentials import MAX_EXPONENT, MIN_EXPONENT, Potential

EXPONENT = {  # arguments of `parameter`
    "help": "exponent α of the potential power, whose force is ∝ overlap^(α−1); 2 is harmonic, 5/2 hertzian",
    "low": MIN_EXPONENT,
    "high": MAX_EXPONENT,
    "metavar": "A",
}


def potential_identity(potential: Potential) -> dict:
    """{parameter: value} that identify a potential, whichever of its names was given: power with 2 is harmonic."""
    return {"potential": potential.kind, "exponent": potential.exponent}
