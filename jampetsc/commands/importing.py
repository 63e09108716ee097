"""A packing or a network of another program as a file."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from jampetsc.commands.describe import cell_text, describe_network
from jampetsc.commands.pack import pressure_range
from jampetsc.errors import InputError, named, option_word
from jampetsc.io.exchange import READERS
from jampetsc.io.importers import import_packing
from jampetsc.io.network_importers import import_network
from jampetsc.io.packing_file import NETWORK_FORMAT
from jampetsc.io.results import noted
from jampetsc.io.size_columns import HOLDS
from jampetsc.options.job import Job
from jampetsc.options.parameters import FILE, PATH, ValueType, optional_parameter, parameter
from jampetsc.options.potential_options import EXPONENT
from jampetsc.packing.contacts import BALANCED, IMBALANCE, imbalance, measure
from jampetsc.packing.packing import MINIMISED_PHIS, PARTICLES
from jampetsc.packing.potentials import DEFAULT_POTENTIAL, EXPONENTS, SETTINGS, STIFFNESSES

# options on how a file is read, of packings and networks
READING = ("format", "radius", "column_holds", "columns", "box", "dimension")


def _box(value):
    """A cell of `Packing`; in words numbers with commas."""
    if not isinstance(value, str):
        return value
    try:
        return tuple(float(word) for word in value.split(","))
    except ValueError:
        raise ValueError("must be L, Lx,Ly or Lx,Ly,xy; with z Lx,Ly,Lz or Lx,Ly,Lz,xy,xz,yz") from None


def _box_text(box) -> str:
    return ",".join(repr(float(length)) for length in np.ravel(box))


@dataclass(frozen=True, eq=False)
class Import(Job):
    """Turn a packing or a network of another program into a file.

    Reads LAMMPS data and dump, XYZ and extended XYZ, GSD (needs the package gsd), tables of text with x, y and radius,
    csv as well, with a line 'box Lx Ly xy', and npz with positions, radii or diameters, and box. Particles whose z is
    the same to single precision are disks in a plane, others spheres, periodic along all axes. Lengths keep their unit.
    The potential is the one in FILE, as `jampetsc export` writes it, or the one of the options. Also the published
    packings of jamBashbulk (text; U = ½ δ², k = 1) and jax-md (netCDF4; U = ½ (1 − r/σ)²), whose pressure and energy
    must agree with FILE.
    With bonds FILE is a network of springs: its nodes need no radii, and bonds are read from LAMMPS data (Bonds, and
    Bond Coeffs of style harmonic), npz (bonds, and stiffness, tension, images), or lines of a text.
    """

    scalar: ClassVar = None
    FORMAT: ClassVar = "jampetsc-packing"
    EPILOG: ClassVar = """examples:
  jampetsc import dump.lammpstrj --frame -1 --out dump.h5                      # the last frame
  jampetsc import sizes.lammpstrj --radius Dn --column-holds diameters --pair-style "gran/hooke 1e5" --out hooke.h5
  jampetsc import table.txt --columns id,x,y,r --box 7.5,7,0.5 --out table.h5  # a2 = (0.5, 7)
  jampetsc import types.lammpstrj --radius 1=0.5,2=0.7 --k 2 --out types.h5    # columns id type x y; harmonic/cut K = 1
  jampetsc import disks.txt --box 7.5,7 --potential hertzian --out own.h5      # lines x y r without a box
  jampetsc import gel.data --bonds gel.data --out gel.h5                       # a network with its own bonds
  jampetsc import nodes.txt --bonds bonds.txt --box 20 --out fibres.h5         # lines x y, and lines i j k

To minimise the energy of a packing that is not at rest: jampetsc pack --from dump.h5 --phi 0.86 --out rest.h5"""
    OUT_HELP: ClassVar = "packing or network file to write"

    file: Path = parameter(help="file of the other program", place=FILE, value_type=PATH)
    format: str | None = optional_parameter("format of FILE (default: by its content)", choices=READERS)
    index: int = parameter(
        0, "number of the packing in FILE, from 0; -1 is the last one", metavar="I", also="--frame"
    )
    dimension: int | None = optional_parameter(
        "2: disks, z is left out; 3: spheres (default: disks where z is the same for all, to single precision)",
        low=2,
        high=3,
        metavar="D",
    )
    bonds: Path | None = optional_parameter(
        "file of bonds, which makes a network: FILE itself, or lines i j, i j k or i j k T of nodes from 0, stiffness "
        "and tension (positive where it pulls)",
        value_type=PATH,
    )
    radius: str | None = optional_parameter(
        "name of the column or array of radii or diameters (default radius or diameter), or a radius for each type",
        metavar="COLUMN|TYPE=R,…",
    )
    column_holds: str | None = optional_parameter(
        "what the column of sizes holds (default: as its name says)", choices=HOLDS, metavar="KIND"
    )
    columns: str | None = optional_parameter(
        "names of the columns of a text or of plain XYZ, with x and y (default: as its title line says, or x,y,r)",
        metavar="NAME,…",
    )
    box: tuple | None = optional_parameter(
        "cell of a file without one: L, Lx,Ly or Lx,Ly,xy with the length xy of a₂ = (xy, Ly); of a file with z L, "
        "Lx,Ly,Lz or Lx,Ly,Lz,xy,xz,yz",
        value_type=ValueType(_box, _box_text, metavar="L|Lx,Ly[,xy]|Lx,Ly,Lz[,…]"),
    )
    potential: str | None = optional_parameter(
        f"energy of an overlap (default: as FILE says, or {DEFAULT_POTENTIAL})", choices=EXPONENTS
    )
    exponent: float | None = optional_parameter(**EXPONENT)
    stiffness: str | None = optional_parameter(
        "convention of the contact stiffness (default: as FILE says, or constant)", choices=STIFFNESSES
    )
    k: float | None = optional_parameter(
        "contact stiffness, in units of FILE (default: as FILE says, or 1); LAMMPS' harmonic/cut K means k = 2K"
    )
    pair_style: str | None = optional_parameter(
        "instead of potential, exponent, stiffness and k: LAMMPS' pair style and its stiffness in units of FILE, "
        "'harmonic/cut K', 'gran/hooke KN' or 'gran/hertz KN'",
        metavar="'STYLE K'",
    )

    def check(self):
        """Refuse the potential of overlaps for a network."""
        for name in ("potential", "exponent", "stiffness", "pair_style"):
            if self.bonds is not None and getattr(self, name) is not None:
                raise InputError(f"{named(name)}: an option of packings. Leave it out with {named('bonds')}.")

    @property
    def paths(self):
        """Files that it reads."""
        return [str(path) for path in (self.file, self.bonds) if path is not None]

    def check_outputs(self, to):
        """Refuse files that may not be replaced."""
        to.check(self.FORMAT if self.bonds is None else NETWORK_FORMAT, self.paths)

    def work(self, to):
        if self.bonds is not None:
            options = {name: getattr(self, name) for name in (*READING, "k")}
            network = import_network(self.file, self.bonds, self.index, **options)
            to.put_network(network)
            return describe_network(to, network)
        settings = (*READING, *SETTINGS, "pair_style")
        disks = import_packing(self.file, self.index, **{name: getattr(self, name) for name in settings})
        if notes := _notes(disks):
            disks = disks.with_record(notes=noted(notes))
        to.put_packing(disks)
        return _summary(to, self.file, disks)


def _notes(disks) -> list[str]:
    """The note, if any, that forces of an imported packing are not balanced, see `io.results`."""
    state = measure(disks)
    rest = imbalance(disks, state)
    if not len(state.contacts) or rest <= BALANCED:
        return []
    return [f"forces are not balanced: {IMBALANCE[disks.dimension]} = {rest:.1e}. Quench it (pack from it)"]


def _summary(to, file, disks) -> str:
    """The summary."""
    state, potential = measure(disks), disks.potential
    overlap, alpha = ("δ" if potential.stiffness == "constant" else "(δ/σ)"), potential.exponent
    units = disks.record.get("units", f"lengths as in {file}")
    lines = [
        f"{to}: {disks.n} {PARTICLES[disks.dimension]}, phi = {disks.phi:.9g}, read as {disks.record['protocol']}",
        f"  units     {units}; U = (k/{alpha:g}) {overlap}^{alpha:g}, k = {potential.k:g}",
        f"  box       {cell_text(disks.cell)}",
        f"  radii     {disks.radii.min():.9g} to {disks.radii.max():.9g}"
        + (f" ({disks.record['sizes_from']})" if "sizes_from" in disks.record else ""),
    ]
    if "geometry" in disks.record:
        other = 3 if disks.dimension == 2 else 2
        lines.append(
            f"  geometry  {disks.record['geometry']} (otherwise give {option_word('dimension')} {other})"
        )
    for name in ("pressure", "energy"):
        published = disks.record.get(f"published_{name}")
        beside = "" if published is None else f"   published {published:.9g}"
        lines.append(f"  {name:9s} {disks.record[name]:.9g}{beside}")
    rattlers = int(state.rattlers.sum())
    lines.append(f"  contacts  {len(state.contacts)}, Z = {state.coordination:.6g}, rattlers {rattlers}")
    assumed = disks.record.get("assumed")
    if assumed:
        options = ", ".join(map(option_word, assumed.split(", ")))
        lammps = "; LAMMPS' harmonic/cut K means k = 2K" if "lammps" in disks.record["protocol"] else ""
        lines.append(f"  assumed   {assumed}: not in {file}. If they differ, give {options}{lammps}")
    rest = imbalance(disks, state)
    if len(state.contacts) and not rest <= BALANCED:
        lines.append(
            f"  forces    not balanced, {IMBALANCE[disks.dimension]} = {rest:.1e}: other radii or another potential "
            "than assumed, friction, which is not supported, too few digits, or no minimum."
            + _way_to_minimum(to.path, disks)
        )
    return "\n".join(lines)


def _way_to_minimum(path, disks) -> str:
    """A sentence with the command that minimises the energy of a packing file; empty where its sizes are in doubt.

    At its φ, or at its p where `pack` refuses that φ.
    """
    low, high = MINIMISED_PHIS[disks.dimension]
    lowest, highest = pressure_range(disks.radii, disks.potential, disks.dimension)
    if low <= disks.phi <= high:
        goal = f"--phi {disks.phi!r}"
    elif disks.phi < low and lowest <= disks.pressure <= highest:
        goal = f"--pressure {disks.pressure:.6g}"
    else:
        return ""
    out = path.with_name(f"{path.stem}-minimum{path.suffix}")
    words = f"--from {shlex.quote(str(path))} {goal} --out {shlex.quote(str(out))}"
    return f" To minimise the energy: jampetsc pack {words}"
