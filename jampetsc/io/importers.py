"""Packings of other programs, recognised by their content: the formats of `exchange`, and published ones."""

from pathlib import Path

from jampetsc.errors import InputError, about, named, option_word
from jampetsc.io.atomic import open_regular
from jampetsc.io.checksums import SIGNATURE
from jampetsc.io.exchange import check_uncompressed, format_of, read_table, refuse_unknown
from jampetsc.io.pair_styles import potential_of_pair_style
from jampetsc.io.published_packings import PROGRAMS, is_published, read_published
from jampetsc.io.size_columns import radii_in
from jampetsc.packing.packing import MINIMISED_PHIS, Packing
from jampetsc.packing.potentials import SETTINGS
from jampetsc.progress import warn

MAX_TEXT_BYTES = 1 << 29  # bytes of text, about ten million disks


def import_packing(
    path,
    index=0,
    *,
    format=None,
    radius=None,
    column_holds=None,
    columns=None,
    box=None,
    dimension=None,
    potential=None,
    exponent=None,
    stiffness=None,
    k=None,
    pair_style=None,
) -> Packing:
    """Read packing number `index` of a file of another program.

    path           of the file
    index          number of the packing, or frame, in the file, from 0; −1 is the last one
    format         one of `exchange.READERS`; None: recognised by the content
    radius         column or array of radii or diameters; radii by type, {1: 0.5, 2: 0.7} or "1=0.5,2=0.7"; None: radius
                   or diameter
    column_holds   radii or diameters, which are halved; None: as the name of the column says
    columns        names of the columns of a text, "id,x,y,r"; None: as its title line says, or x y r
    box            as the cell of `Packing`, for a file that has none
    dimension      2: disks, z is left out; 3: spheres; None: disks where z is the same for all, to single precision
    potential, exponent, stiffness, k   as for `Packing`; None: what the file says, or else the defaults of `Packing`
    pair_style     instead of these LAMMPS' pair style with its stiffness, "harmonic/cut 1", "gran/hooke 1e5",
                   "gran/hertz 1e5" (`pair_styles`)

    Returns a Packing, in the unit of length of the file. Its record has pressure, phi, energy and max_force as computed
    here, the numbers of a published file as published_pressure, published_energy, …, as `assumed` which of potential,
    stiffness and k neither the file nor the caller says, and as `geometry` and `sizes_from` what was decided.

    Raises InputError for an unknown format, a compressed or damaged file, a wrong index, a packing that is not
    periodic, or whose pressure or energy is not the one in the file.
    """
    content = read_content(path, whole=format is not None)
    settings = {"potential": potential, "exponent": exponent, "stiffness": stiffness, "k": k}
    settings = {name: value for name, value in settings.items() if value is not None}
    if pair_style is not None and settings:
        raise InputError(
            f"{named('pair_style')}, {', '.join(map(named, settings))}: both given. Give one of them."
        )
    options = {"radius": radius, "column_holds": column_holds, "columns": columns, "dimension": dimension}
    with about(path):
        check_uncompressed(content, path)
        if format is None and is_published(content):
            every = {**options, "box": box, "pair_style": pair_style, **settings}
            fixed = [name for name, value in every.items() if value is not None]
            if fixed:
                raise InputError(
                    f"{', '.join(map(named, fixed))}: fixed in files of {' and '.join(PROGRAMS)}. Leave them out, or "
                    f"give the {named('format')} if it is another file."
                )
        else:
            format = format or format_of(content) or refuse_unknown(content, PROGRAMS)
            disks = _read_exchanged(content, index, format, box, settings, pair_style, **options)
    if format is None:
        disks = read_published(path, content, index)
    disks = disks.with_record(imported_from=Path(path).name)
    note = size_doubt(disks)
    if note:
        warn(f"{path}: {note}")
    return disks.with_record(notes=note) if note else disks


def size_doubt(disks) -> str:
    """Why the sizes of imported particles are hardly right, and what to do; empty where they may be."""
    _, high = MINIMISED_PHIS[disks.dimension]
    option = option_word("column_holds")
    if disks.phi > high:
        return (
            f"implausible sizes: phi = {disks.phi:.3g}, Z = {disks.coordination:.3g}. Were these diameters, not radii? "
            f"Import with {option} diameters"
        )
    if not disks.pressure > 0.0 and "halved" in disks.record.get("sizes_from", ""):
        return (
            f"no contacts: phi = {disks.phi:.3g}. Were radii halved as diameters? Import with {option} radii"
        )
    return ""


def read_content(path, whole=True) -> bytes:
    """The bytes of a file of another program; of HDF5 only its signature unless `whole`. Raises InputError."""
    try:
        with open_regular(path) as file:
            content = file.read(len(SIGNATURE))
            if whole or content != SIGNATURE:
                content += file.read(MAX_TEXT_BYTES)
    except OSError as error:
        raise InputError(
            f"{path}: not readable ({error.strerror}). Check its name and permissions."
        ) from None
    if len(content) > MAX_TEXT_BYTES:
        raise InputError(f"{path}: too large (at most {MAX_TEXT_BYTES >> 20} MB). Cut the packing out of it.")
    return content


def _read_exchanged(
    content, index, format, box, settings, pair_style, *, radius, column_holds, columns, dimension
):
    table = read_table(content, index, format, columns)
    cell = box_of(table, box)
    radii, source = radii_in(table.columns, radius, column_holds)
    geometry = table.geometry(cell, dimension)
    settings = settings if pair_style is None else potential_of_pair_style(pair_style, radii)
    replaced = ("potential", "exponent") if "potential" in settings else ()  # they go together
    potential = {name: value for name, value in table.potential.items() if name not in replaced} | settings
    units = {"units": potential.pop("units")} if "units" in potential else {}
    assumed = ", ".join(name for name in SETTINGS if name not in {*potential, "exponent"})
    disks = Packing(geometry.positions, radii, geometry.cell, **potential, dimension=len(geometry.cell))
    record = {"protocol": format, "imported_index": table.index, "sizes_from": source} | units
    record |= {"geometry": geometry.decision} if geometry.decision else {}
    return disks.with_record(**record, **({"assumed": assumed} if assumed else {}))


def box_of(table, box):
    """The box of a file, or the one given for a file without. Raises InputError for both or none."""
    if (table.box is None) == (box is None):
        raise InputError(
            f"no box. Give {named('box')}, as L, Lx,Ly or Lx,Ly,xy, of spheres Lx,Ly,Lz."
            if box is None
            else f"a box in the file. Leave out {named('box')}."
        )
    return table.box if box is None else box
