"""The units of pictures, k and 1/τ₁, out of the attributes of a result."""

import math
from dataclasses import dataclass

from jampetsc.errors import InputError


@dataclass(frozen=True)
class Units:
    """Units by which the numbers of a result are divided, and its pressure in them."""

    k: float  # stiffness of a contact
    tau1: float  # damping time
    pressure: float | None  # p/k; None if the file does not have it


def units_of(result) -> Units:
    """Units of a `io.results.Result`; k and τ₁ are one where it has none.

    Raises InputError, naming the file, for units that are not positive and for a pressure that is no number.
    """
    found = {}
    for name in ("k", "tau1", "pressure"):
        value = result.attributes.get(name, None if name == "pressure" else 1.0)
        number = isinstance(value, (int, float)) and math.isfinite(value)
        if value is not None and not (number and (name == "pressure" or value > 0)):
            wanted = "a number" if name == "pressure" else "a positive number"
            raise InputError(
                f"{result.path}: attribute {name} = {value}: must be {wanted}; make the file again"
            )
        found[name] = None if value is None else float(value)
    pressure = found["pressure"]
    return Units(found["k"], found["tau1"], None if pressure is None else pressure / found["k"])


UNITS = ("energy", "stress", "rate", "viscosity", "length")
_VAGBERG = (
    r"k_{\rm e}", r"k_{\rm e}/d_{\rm s}^2", r"k_{\rm e}/k_{\rm d}d_{\rm s}^2", r"k_{\rm d}", r"d_{\rm s}"
)  # fmt: skip


@dataclass(frozen=True)
class FlowUnits:
    """Units by which numbers of flow, shear and jam files are divided: energies and stresses by k, rates by 1/τ₁."""

    k: float
    tau1: float
    names: tuple  # of UNITS in TeX without dollars; "" for the length of a packing, which has none

    def label(self, symbol, unit) -> str:
        """Words for an axis: the symbol in TeX, and the name of one of UNITS, where there is one."""
        text = self.names[UNITS.index(unit)]
        return rf"${symbol}\ [{text}]$" if text else f"${symbol}$"


def flow_units(results) -> FlowUnits:
    """The units that all these files have: Vågberg's (thesis sec. 4.1), or those of a packing.

    Raises InputError, naming the file, where they differ.
    """
    first = None
    for result in results:
        a, own = result.attributes, units_of(result)
        if str(a.get("units", "")).startswith("k_e"):
            texts = _VAGBERG
        elif a.get("stiffness") == "inverse-square-diameter":
            texts = (r"k_{\rm e}", r"k_{\rm e}", r"1/\tau_1", r"k_{\rm e}\tau_1", "")  # over the unit of area
        else:
            texts = ("k", "k", r"1/\tau_1", r"k\tau_1", "")  # times the packing's unit of area
        found = FlowUnits(own.k, own.tau1, texts)
        first = first or found
        if found != first:
            raise InputError(
                f"{result.path}: is in other units ({a.get('units', 'not told')}) than {results[0].path.name}: "
                "one picture has one unit"
            )
    return first
