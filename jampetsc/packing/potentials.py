"""Pair potentials of soft disks: powers of the overlap, in both stiffness conventions.

With σ = ρ_i + ρ_j the sum of the radii, δ = σ − r the overlap and an exponent α ≥ 2, called harmonic where it is 2 and
Hertzian where it is 5/2:

    constant                  V = (k/α) δ^α           (d = 1 sets the length; BT: U = ½ k δ²)
    inverse-square-diameter   V = (k/α) (δ/σ)^α       (Vågberg, thesis eq. 4.7, k = k_e)

Energies, forces and stiffnesses, here and (compiled by numba, see `bond`) in loops over pairs, come from the functions
of `Potential.constants` below: f/δ, (d²V/dr²)/(f/δ) = α − 1 and α V = f δ. numba knows the length of a tuple when it
compiles, so that loops over pairs of named exponents have no code for others.
"""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.packing.elementary import exp, log, power

# name -> α at small overlaps; None: a number of its own
EXPONENTS = {
    "harmonic": 2.0,
    "hertzian": 2.5,
    "power": None,
}
NAMED_POWERS = ("harmonic", "hertzian")  # which `power` with their exponents is
DEFAULT_POTENTIAL = "harmonic"
MIN_EXPONENT, MAX_EXPONENT = 2.0, 10.0
MAX_STIFFNESS = 1e150  # largest k: squares of stresses then stay in the range of doubles
STIFFNESSES = ("constant", "inverse-square-diameter")
# as options, keys of files and `Potential.record` have them
SETTINGS = ("potential", "exponent", "stiffness", "k")


def secant_stiffness(overlap, sigma, constants):
    """f/δ of contacts with overlap δ ≥ 0, numbers or arrays; constants = `Potential.constants`."""
    k, hertzian, by_diameter = constants[:3]
    unit = 1.0 / sigma if by_diameter else 1.0
    secant = k * unit * unit
    if len(constants) == 4:
        return secant * power(unit * overlap, constants[3] - 2.0)
    return secant * np.sqrt(unit * overlap) if hertzian else secant


def exponent_of(constants):
    """α of the potential."""
    if len(constants) == 4:
        return constants[3]
    return 2.5 if constants[1] else 2.0


def tangent_ratio(overlap, sigma, constants):
    """d²V/dr² over f/δ of contacts, as for `secant_stiffness`."""
    return exponent_of(constants) - 1.0


def energy_term(force, overlap, sigma, constants):
    """α V of contacts, as for `secant_stiffness`: without a division in loops over pairs."""
    return force * overlap


@dataclass(frozen=True)
class Potential:
    """A repulsive contact potential.

    Raises InputError for an unknown name, an exponent that is missing, of another potential or out of range, and k out
    of range.
    """

    kind: str | None = None  # a name of EXPONENTS; None: power with an exponent, or else harmonic
    stiffness: str = "constant"  # constant | inverse-square-diameter
    k: float = 1.0  # contact stiffness k, or k_e where the stiffness is k_e/σ²
    exponent: float | None = None  # α; None: that of the name

    def __post_init__(self):
        kind = self.kind
        if kind is None:
            kind = "power" if self.exponent is not None else DEFAULT_POTENTIAL
        if kind not in tuple(EXPONENTS):  # a tuple, as a kind of a wrong type may not be hashable
            raise InputError(f"potential {kind!r}: not supported. Choose one of {', '.join(EXPONENTS)}.")
        exponent = EXPONENTS[kind]
        if exponent is None:
            exponent = _own_exponent(self.exponent)
            kind = next((name for name in NAMED_POWERS if EXPONENTS[name] == exponent), kind)
        elif self.exponent not in (None, exponent):
            raise InputError(
                f"{named('exponent')} {self.exponent}: of the potential power alone ({kind} has {exponent:g}). Leave "
                "it out, or choose power."
            )
        object.__setattr__(self, "kind", kind)
        object.__setattr__(self, "exponent", exponent)
        if self.stiffness not in STIFFNESSES:
            raise InputError(
                f"stiffness {self.stiffness!r}: not supported. Choose one of {', '.join(STIFFNESSES)}."
            )
        if not 1.0 / MAX_STIFFNESS <= self.k <= MAX_STIFFNESS:
            raise InputError(
                f"stiffness k = {self.k}: must be a positive number, from {1.0 / MAX_STIFFNESS:g} to {MAX_STIFFNESS:g}"
            )

    @classmethod
    def of_record(cls, entries) -> "Potential":
        """The potential of what `record` gives, as attributes of a file; k is 1 if missing. Raises InputError."""
        kind, exponent, stiffness, k = (entries.get(name) for name in SETTINGS)
        for name, word, words in (("potential", kind, EXPONENTS), ("stiffness", stiffness, STIFFNESSES)):
            if word is None:
                raise InputError(f"{name}: missing. Give one of {', '.join(words)}.")
        numbers = {"k": k, "exponent": exponent}
        try:
            numbers = {name: float(value) for name, value in numbers.items() if value is not None}
        except (TypeError, ValueError):
            raise InputError(f"k = {k!r}, exponent = {exponent!r}: must be numbers. Correct them.") from None
        return cls(kind, stiffness, **numbers)

    @property
    def record(self) -> dict:
        """{name of SETTINGS: value} as files have it; without the exponent where the name says it."""
        exponent = {"exponent": self.exponent} if self.kind == "power" else {}
        return {"potential": self.kind} | exponent | {"stiffness": self.stiffness, "k": float(self.k)}

    @property
    def constants(self) -> tuple:
        """The potential as compiled loops take it: (k, whether α = 5/2, whether by the diameter), and any other α."""
        common = self.k, self.kind == "hertzian", self.stiffness == "inverse-square-diameter"
        return (*common, self.exponent) if self.kind == "power" else common

    @property
    def identity(self) -> str:
        """The potential in words, to the last bit."""
        return " ".join(v if isinstance(v, str) else v.hex() for v in self.record.values())

    def __str__(self):
        return f"power {self.exponent:g}" if self.kind == "power" else self.kind

    def scale(self, sigma):
        """Length by which overlaps are measured: σ, or the unit of length (shape of sigma)."""
        return sigma if self.stiffness == "inverse-square-diameter" else np.ones_like(sigma)

    def reach(self, sigma: float) -> float:
        """(σ/s)^(α−2), s = `scale`: stiffnesses k/s² in other units of length, exactly 1 for k/σ²."""
        return float(power(sigma / float(self.scale(np.array(sigma))), self.exponent - 2.0))

    def largest_stiffness(self, sigma: float) -> float:
        """d²V/dr² at the overlap σ, which centres at one place have."""
        return self.k * (self.exponent - 1.0) / float(self.scale(np.array(sigma))) ** 2 * self.reach(sigma)

    def force_limit(self, fraction: float) -> float:
        """A small force or stress in units of k, that of the same overlap for all α > 5/2.

        A force is ∝ δ^(α−1): the same number would stand for ever larger overlaps.
        """
        return _risen(fraction, (self.exponent - 1.0) / 1.5)

    def energy_limit(self, fraction: float) -> float:
        """Likewise a small energy, which is ∝ δ^α."""
        return _risen(fraction, self.exponent / 2.5)

    def overlap_at(self, force: float, diameter: float) -> float:
        """Overlap of two disks of this diameter that repel each other with this force, f = (k/s) (δ/s)^(α−1)."""
        scale = float(self.scale(np.array(diameter)))
        ratio, power_of_overlap = force * scale / self.k, self.exponent - 1.0
        return scale * (
            exp(log(ratio) / power_of_overlap) if power_of_overlap != 1.0 and ratio > 0.0 else ratio
        )

    def energy(self, overlap, sigma):
        """V(δ) per contact; overlap δ ≥ 0 and sigma are arrays (M,)."""
        return energy_term(self.force(overlap, sigma), overlap, sigma, self.constants) / self.exponent

    def force(self, overlap, sigma):
        """Repulsive force f = −dV/dr ≥ 0 per contact, (M,)."""
        return secant_stiffness(overlap, sigma, self.constants) * overlap

    def contact_stiffness(self, overlap, sigma):
        """d²V/dr² per contact, (M,): the k of BT eq. 4."""
        secant = secant_stiffness(overlap, sigma, self.constants)
        ratio = tangent_ratio(overlap, sigma, self.constants)
        return ratio * np.broadcast_to(secant, np.shape(overlap))


def _risen(fraction: float, rise: float) -> float:
    """fraction^rise, for a rise above 1."""
    return exp(rise * log(fraction)) if rise > 1.0 else fraction


def _own_exponent(exponent) -> float:
    """The exponent of the potential power as a number. Raises InputError."""
    if exponent is None:
        raise InputError(f"{named('exponent')}: missing. Give that of the potential power, e.g. 2.25.")
    try:
        number = float(exponent)
    except (TypeError, ValueError):
        number = np.nan
    if not MIN_EXPONENT <= number <= MAX_EXPONENT:
        raise InputError(
            f"exponent {exponent}: must be a number from {MIN_EXPONENT:g} to {MAX_EXPONENT:g}. Correct it."
        )
    return number
