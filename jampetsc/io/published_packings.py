"""Published packings with their numbers: text of jamBashbulk and netCDF4 of jax-md.

jamBashbulk writes `N = …, L1 = {…}, L2 = {…}, P = …` and a line `x, y, r` per disk; U = ½ δ² (k = 1).
jax-md's data files hold many packings; positions are fractions of the box, U = ½ (1 − r/σ)².
"""

import itertools
import re

import numpy as np

from jampetsc.errors import InputError, about
from jampetsc.io.checksums import SIGNATURE
from jampetsc.io.disk_table import check_index, to_numbers
from jampetsc.io.hdf5 import open_file, values
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential

PROGRAMS = ("jamBashbulk", "jax-md")
_NUMBER = r"([-+.\deE]+|[-+]?nan|[-+]?inf)"
_PUBLISHED_TOLERANCE = 1e-6  # relative difference from a stored value that still counts as the same packing
# of jax-md by dimension, for a symmetric linear strain
_MODULUS_COMPONENTS = {
    2: "xxxx yyyy xyxy xxyy xxxy yyxy".split(),
    3: "xxxx yyyy zzzz yzyz xzxz xyxy yyzz xxzz xxyy xxyz xxxz xxxy yyyz yyxz yyxy zzyz xzzz xyzz yzxz xyyz "
    "xyxz".split(),
}


def is_published(content) -> bool:
    """Whether a content looks like one of PROGRAMS; of HDF5 its signature is enough."""
    if content.startswith(SIGNATURE):
        return True
    return re.search(r"(?m)^[ \t]*N\s*=.*\bL1\b", content[: 1 << 16].decode(errors="replace")) is not None


def read_published(path, content, index) -> Packing:
    """Packing `index` of such a file, with the numbers that it states. Raises InputError, naming the file."""
    if not content.startswith(SIGNATURE):
        with about(path):
            return _checked(_read_jambashbulk(content.decode(errors="replace"), index))
    with open_file(path) as h5, about(path):  # what `open_file` raises names the file
        return _checked(_read_jaxmd(h5, index))


def _checked(disks):
    """The disks with measurements. Raises InputError if pressure or energy are not the published ones."""
    disks = disks.with_measurements()
    for name in ("pressure", "energy"):
        value, published = disks.record[name], disks.record.get(f"published_{name}")
        if published is not None and not abs(value - published) <= _PUBLISHED_TOLERANCE * abs(published):
            raise InputError(
                f"{name} is {value:.9g} with these positions but stored as {published:.9g}: "
                "another potential or unit than assumed, or a damaged file. Get it again."
            )
    return disks


def _read_jambashbulk(text, index):
    packings = re.split(r"(?m)^(?=[ \t]*N\s*=)", re.sub(r"(?m)^\s*#.*$", "", text))[1:]
    index = check_index(index, len(packings))
    packing = packings[index]

    def header_numbers(name, pattern=_NUMBER):
        match = re.search(rf"\b{name}\s*=\s*{pattern}", packing)
        if match is None:
            raise InputError(f"no {name} = … in the header: truncated or edited. Get it again.")
        return to_numbers(match.groups())

    cell = [header_numbers(name, rf"\{{\s*{_NUMBER}\s*,\s*{_NUMBER}\s*\}}") for name in ("L1", "L2")]
    (n,), (pressure,) = header_numbers("N", r"(\d+)"), header_numbers("P")
    body = re.search(r"\{([^{}]*)(\}?)\s*\Z", packing)
    rows = re.findall(rf"{_NUMBER}\s*,\s*{_NUMBER}\s*,\s*{_NUMBER}", body[1]) if body else []
    if len(rows) != n or not body[2]:
        raise InputError(
            f"{len(rows)} lines x, y, r for N = {n:g} particles: truncated or edited. Get it again."
        )
    table = np.array([to_numbers(row) for row in rows])
    return Packing.from_positions(
        table[:, :2],
        table[:, 2],
        cell,
        Potential("harmonic", "constant", 1.0),
        record={"protocol": "jamBashbulk", "imported_index": index, "published_pressure": float(pressure)},
    )


def _read_jaxmd(h5, index):
    if str(h5.attrs.get("format", "")).startswith("jampetsc"):
        raise InputError(f"already a {h5.attrs['format']} file. Use it without import.")
    missing = [name for name in ("pos", "rad", "box") if name not in h5]
    if missing:
        raise InputError(
            f"no variable {', '.join(missing)}, hence not a packing of jax-md. Give another file."
        )
    if any(not hasattr(h5[name], "shape") or not h5[name].shape for name in ("pos", "rad", "box")):
        raise InputError("pos, rad or box: not arrays, hence not a packing of jax-md. Give another file.")
    index = check_index(index, len(h5["pos"]))
    names = ("pos", "rad", "box", "Energy", "Stress", "Cijkl")
    data = {name: np.asarray(values(h5[name], index), float) for name in names if name in h5}
    dimension = {(4,): 2, (9,): 3}.get(data["box"].shape, 0)
    if not dimension or data["pos"].shape != (dimension * len(data["rad"]),):
        raise InputError(
            f"{data['pos'].size} coordinates for {data['rad'].size} particles in a box of {data['box'].size} numbers: "
            "neither two- nor three-dimensional. Get it again."
        )
    # jax-md maps a fraction s to box · s: cell vectors are its columns
    cell = data["box"].reshape(dimension, dimension).T
    published = {"published_energy": float(data["Energy"])} if "Energy" in data else {}
    if "Stress" in data:
        names = ("".join(pair) for pair in itertools.product("xyz"[:dimension], repeat=2))
        stress = dict(zip(names, data["Stress"].tolist(), strict=True))
        published |= {f"published_stress_{name}": value for name, value in stress.items()}
        published["published_pressure"] = -sum(stress[2 * axis] for axis in "xyz"[:dimension]) / dimension
    if "Cijkl" in data:
        published |= {
            f"published_C_{name}": c
            for name, c in zip(_MODULUS_COMPONENTS[dimension], data["Cijkl"].tolist(), strict=True)
        }
    return Packing.from_positions(
        data["pos"].reshape(-1, dimension) @ cell,
        data["rad"],
        cell,
        Potential("harmonic", "inverse-square-diameter", 1.0),
        record={"protocol": "jax-md", "imported_index": index, **published},
    )
