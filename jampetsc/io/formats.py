"""The format of every file that jampetsc writes, by its name, and the check of a file against it.

`run/generate.py` writes these tables into docs/reference/files.md.
"""

from jampetsc.errors import InputError
from jampetsc.io.declaration import Format, contents
from jampetsc.io.hdf5 import attributes, check_format
from jampetsc.io.jamming_formats import JAM, SHEAR
from jampetsc.io.response_formats import MODES, QUASISTATIC, SPECTRUM, SWEEP
from jampetsc.io.result_formats import (
    COLLAPSE,
    CORRELATION,
    FLOW,
    OSCILLATE,
    POTENTIAL_ROWS,
    RELAX,
    SCALING,
    VELOCITY_CORRELATION,
)
from jampetsc.laws.loads import LoadChoice

PACKING = Format(
    datasets=r"""
positions | (N, D) | float | length | centres
radii | (N,) | float | length | of the disks or spheres
cell | (D, D) | float | length | lower triangular rows a₁ = (L, 0), a₂ … of the periodic cell
positions_low | (N, D) | float? | length | what double precision cannot hold of `positions`: add it in higher precision
cell_low | (D, D) | float? | length | likewise of `cell`
""",
    attributes=r"""
format, format_version | text | | `jampetsc-packing`, and the version of its layout; readers refuse another major
  version
"""
    + POTENTIAL_ROWS
    + r"""
k | float > 0 | | contact stiffness
protocol | text | | how it was made
pressure, phi, energy, max_force | float | | p = Σ f r/(D V), φ, U, largest net force on a disk
coordination, rattlers | float, int? | | Z without rattlers, number of rattlers
shear_stress, shear_modulus | float? | | σ_xy; G₀ with pre-stress
negative_modes, negative_modes_counted_by, proof_fingerprint | int, text, text? | | modes of K that lower the energy,
  how they were counted, and the hash of the disks for which that holds
notes | text? | | warnings about the numbers, `KIND: details. Remedy`, separated by `; `
seed, sizes, stabilise, tolerance | int, text, text, float? | | as asked for; `sizes` is a law, or with `--radii` the
  name of their file or the hash of the array
requested_n, requested_potential, requested_exponent, requested_stiffness | int, text, float, text? | | as asked for
requested_pressure, requested_phi | float? | | as asked for; one of the two
source, source_sha256 | text? | | with `--from`, and with `ladder` in a study: the packing it began with, name (of a
  file) and hash as `packing`, `packing_sha256`
limited_by | text? | | what ended the quench: `tolerance`, or `rounding` where that leaves more
evaluations, newton_steps | int? | | work: force evaluations and factorisations
imported_from, imported_index | text, int? | | of imports: the file and the number of the packing in it
published_* | float? | | of imports: the pressure, energy, … given there
request, instruction_set, notes | text? | | as in every result
assumed, units | text? | | of imports: which of potential, stiffness and k neither the file nor an option gave; the
  units that the file says
sizes_from, geometry | text? | | of imports: the column of the radii, and whether its values were halved; whether z was
  left out and the cell turned
walls | int? | | of snapshots of a flow with `--walls`: number of disks of the walls
""",
)

NETWORK = Format(
    datasets=r"""
positions | (N, D) | float | length | of the nodes
bonds | (M, 2) | int | | numbers of the two nodes of each bond, from 0
images | (M, D) | int | | cell vectors in r = x_j − x_i + image · cell
cell | (D, D) | float | length | lower triangular rows a₁ = (L, 0), a₂ … of the periodic cell
stiffness | (M,) | float | force/length | k = d²V/dr² of each bond
tension | (M,) | float | force | T = dV/dr of each bond: positive where it pulls (stretched), negative where it pushes;
  the `force` of a contact is −T
radii | (N,) | float? | length | of the nodes, for laws under which they roll
""",
    attributes=r"""
format, format_version | text | | `jampetsc-network`, and the version of its layout; readers refuse another major
  version
k | float > 0 | force/length | unit of stiffness: weights of a damping law count in k τ₁
protocol | text | | how it was made
keep, seed | float, int? | | share of the bonds that were kept, and the seed of the choice
source, source_sha256 | text? | | of a diluted packing or network: name of its file and hash
imported_from, imported_bonds, imported_index, assumed | text, text, int, text? | | of imports: the file, the file of
  the bonds, the number of the frame, and which of stiffness and tension it did not give
geometry | text? | | as of an imported packing
request | text? | | as in every result
""",
)

PART_GROUP = "part_files"
PARTS = Format(  # of a joint file, beside what its format has
    datasets="""
part_files/names | (P,) | text | | paths of the parts from the folder of the joint file
part_files/sizes | (P,) | int | bytes | of each
part_files/seals | (P,) | text | | the hash in its line of checksums
""",
    attributes="",
)
FORMATS = {
    "jampetsc-packing": PACKING,
    "jampetsc-network": NETWORK,
    "jampetsc-sweep": SWEEP,
    "jampetsc-quasistatic": QUASISTATIC,
    "jampetsc-modes": MODES,
    "jampetsc-spectrum": SPECTRUM,
    "jampetsc-correlation": CORRELATION,
    "jampetsc-oscillate": OSCILLATE,
    "jampetsc-relax": RELAX,
    "jampetsc-flow": FLOW,
    "jampetsc-shear": SHEAR,
    "jampetsc-jam": JAM,
    "jampetsc-velocity-correlation": VELOCITY_CORRELATION,
    "jampetsc-collapse": COLLAPSE,
    "jampetsc-scaling": SCALING,
}


def check_file(h5, path, expected: str | None = None) -> tuple[str, dict, dict]:
    """(format, attributes, {name: dataset or group}) of an open file that is as its format says.

    Nothing is read but attributes and shapes. The list of parts is left out. Raises InputError as
    `hdf5.check_format` and `Format.check`.
    """
    attrs = attributes(h5)
    name = check_format(path, attrs, expected)
    items = contents(h5, path)
    for format in (FORMATS.get(name), PARTS):
        if format is not None:
            format.check(path, items, attrs)
    _check_load(path, attrs)
    return name, attrs, {key: item for key, item in items.items() if key.partition("/")[0] != PART_GROUP}


def _check_load(path, attrs) -> None:
    """Raise InputError for a load that does not exist in the dimension of the file."""
    if "load" not in attrs:
        return
    dimension = attrs.get("dimension", 2)
    try:
        LoadChoice(attrs["load"]).of(dimension)
    except InputError:
        raise InputError(
            f"{path}: attribute load = {attrs['load']!r}: not a load in {dimension} dimensions. Make the file again."
        ) from None
