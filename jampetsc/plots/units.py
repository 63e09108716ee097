"""The units of pictures, k and 1/τ₁, out of the attributes of a result."""

import math
from dataclasses import dataclass

from jampetsc.errors import InputError


@dataclass(frozen=True)
class Units:
    """What a result's numbers are divided by, and its pressure in these units."""

    k: float  # stiffness of a contact
    tau1: float  # damping time
    pressure: float | None  # p/k; None where the file does not tell


def units_of(result) -> Units:
    """Units of a `storage.reader.Result`; k and τ₁ are one where it has none.

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
