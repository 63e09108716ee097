"""Displacement fields u(ω), slow response, modes and velocities as arrows on the packing (BT Fig. 1)."""

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize

from jampetsc.errors import InputError
from jampetsc.io.disk_motion import (
    PHASES,
    chosen_frequencies,
    disk_rows,
    field_at,
    particle_rows,
    phase_factor,
    radii_of,
    snapshot,
    source_of,
)
from jampetsc.laws.loads import DEFAULT, TENSOR
from jampetsc.options.parameters import SWITCH, WORD
from jampetsc.options.values import INTEGERS
from jampetsc.plots.cell_drawing import (
    clip_artists,
    disk_images,
    draw_circles,
    frame_cells,
    lay_out,
    points_per_length,
    segment_images,
)
from jampetsc.plots.correlation_plots import OMEGA
from jampetsc.plots.mode_plots import mode_fields
from jampetsc.plots.picture import MEAN_DIAMETER, PACKING, option, picture
from jampetsc.plots.sections import HEIGHT, section_of
from jampetsc.plots.style import COLUMN, PAGE, hidden, number, power_or_number

ARROWS = 1600  # in a panel at most, evenly spread
MAX_COLUMNS = 5  # of panels
INSTANTS = {  # phase -> (what of a complex field, its name), in two rows
    "strain": ((np.real, "Re ${}$"), (np.imag, "Im ${}$")),
    "stress": ((np.real, "${}$ at peak stress"), (lambda u: -np.imag(u), "${}$ at zero stress")),
}
_REACH = 1.6  # length of a long arrow (90th percentile), in distances between arrows
_STEPS = (1, 1.5, 2, 3, 5, 7)  # factors between arrows and displacements, times powers of ten
_RANGE = 2.0  # of the colours of rotations, times their rms
_SMALL = 7.5  # points
FIELDS = (
    OMEGA,
    PACKING,
    option(
        "phase", WORD, "fields: instants of the cycle, peak and zero stress (default), or in phase with the strain and "
        "with its rate", choices=PHASES,
    ),
    option("total", SWITCH, "fields: displacements with the affine part, from the middle of the cell"),
    HEIGHT,
)  # fmt: skip


@picture("fields", "sweep", options=FIELDS, single=True)
def plot_fields(results, page, omega=None, packing=None, phase=PHASES[0], total=False, height=None):
    """Displacement fields of a sweep at two instants of their cycle, side by side for one ω, in two rows for more.

    omega     (F,) as the file has them; None: up to four
    packing   the file of the packing where it is not beside the sweep
    phase     "strain": Re and Im, in phase with the strain and with its rate; "stress": Re and −Im, when the stress is
              at its peak and a quarter of a period later, when it is zero (BT)
    total     with the affine part E x of the load, x from the middle of the cell
    height    of the slice of three dimensions, z over L_z

    Colours are rotations. Below each panel stands how many times the field its arrows are.

    In three dimensions panels are slices z = height·L_z: disks in which the plane cuts spheres, arrows of the x and y
    components, and colours of the z component. Its rms in the slice stands below, in mean diameters ⟨d⟩ (of a network
    mean lengths of bonds). Rotations are not drawn.

    Raises InputError for more frequencies than fit, for frequencies that the file does not have, and for a height in
    two dimensions.
    """
    (sweep,) = results
    fields = sweep.fields
    rows = chosen_frequencies(sweep, omega)
    disks = source_of(sweep, packing)
    section = section_of(disks, height)
    shown, numbers = section.members(particle_rows(sweep, disks))
    (load,) = sweep.load.of(disks.dimension)
    affine = np.zeros((len(shown), disks.dimension))
    if total:
        affine = load.imposed(section.positions[shown] - 0.5 * disks.cell.sum(axis=0))
    turns = [phase_factor(sweep, fields.omega[row], phase) for row in rows]
    stored = [field_at(sweep, row) for row in rows]
    motion = [turn * (affine + field[numbers]) for turn, (field, _) in zip(turns, stored, strict=True)]
    spin = None
    if fields.rotation is not None and disks.dimension == 2:
        spin = [turn * rotation[numbers] for turn, (_, rotation) in zip(turns, stored, strict=True)]
    omega = fields.omega[rows] * float(sweep.attributes.get("tau1", 1.0))
    if len(omega) > MAX_COLUMNS:
        raise InputError(
            f"{len(omega)} frequencies: one picture holds {MAX_COLUMNS}. Choose some with omega."
        )
    strain = _strain_symbol(load.name)
    symbol, single, panels = "u" if total else r"\tilde u", len(omega) == 1, []
    gap = ",  " if disks.dimension == 2 else "\n"  # a colour bar leaves slices little width
    for part, (take, name) in enumerate(INSTANTS[phase]):
        for f, w in enumerate(omega):
            frequency, instant = rf"$\omega\tau_1={power_or_number(w)}$", name.format(symbol)
            title = gap.join((instant, frequency)) if single else "" if part else frequency
            rolls = None if spin is None else take(spin[f])
            panels.append((title, take(motion[f]), rolls, "" if single or f else instant))
    _draw(page, section, shown, panels, symbol, strain, 1 if single else 2)
    if spin is not None:
        _draw_bar(page, r"\theta")
    frequencies = ", ".join(f"{w:g}" for w in omega)
    kind = "total" if total else "non-affine"
    return f"{kind} displacement fields at omega tau1 = {frequencies}, in phase with the {phase}"


@picture("response", "quasistatic", options=(PACKING, HEIGHT), single=True)
def plot_response(results, page, packing=None, height=None):
    """Displacements u_na per unit strain under slow shear, without pre-stress and with it.

    In three dimensions a slice, as in `plot_fields`.
    """
    (result,) = results
    fields = {"no pre-stress": "no_prestress/nonaffine", "pre-stress": "nonaffine"}
    if not result.attributes["prestress"]:
        fields = {"no pre-stress": "nonaffine"}
    panels = [(title, result[name]) for title, name in fields.items()]
    strain = _strain_symbol(result.attributes.get("load", DEFAULT))
    _draw_real(page, result, packing, height, panels, r"u_{\rm na}", strain)
    return f"quasistatic response, {' and '.join(fields)}"


MODE = option("mode", INTEGERS, "mode: numbers of modes from 1, drawn on the packing (default 1)", "i,j,…")


@picture("mode", "modes", options=(PACKING, MODE, HEIGHT), single=True)
def plot_mode(results, page, packing=None, mode=(1,), height=None):
    """Modes on the packing, numbered from 1; in three dimensions a slice, as in `plot_fields`.

    Raises InputError for a mode that the file does not hold.
    """
    (result,) = results
    _draw_real(page, result, packing, height, mode_fields(result, mode), "e_m")
    return f"mode {','.join(map(str, np.ravel(mode)))}"


@picture("velocities", "flow", options=(HEIGHT,), single=True)
def plot_velocities(results, page, height=None):
    """Non-affine velocities u/γ̇ of the last snapshot; in three dimensions a slice, as in `plot_fields`."""
    (result,) = results
    disks = snapshot(result)
    section = section_of(disks, height)
    field = result["snapshots/velocities"][-1] / float(result.attributes["rate"])
    strain = result["snapshots/strain"][-1]
    panels = [(rf"$\gamma={strain:.4g}$", field[section.rows], None, "")]
    _draw(page, section, np.arange(len(section.rows)), panels, "u", r"\dot\gamma")
    return f"non-affine velocities at strain {strain:.4g}"


def _strain_symbol(load):
    """TeX of the amplitude of a load; fields of the tensor are of simple shear."""
    return r"\gamma" if load in (DEFAULT, TENSOR) else r"\epsilon"


def _draw_real(page, result, packing, height, panels, symbol, strain=""):
    """Fields [(title, (n, D)), …] of a result side by side. Raises InputError for more than fit."""
    if len(panels) > MAX_COLUMNS:
        raise InputError(f"{len(panels)} fields: one picture holds {MAX_COLUMNS}. Choose fewer.")
    disks = source_of(result, packing)
    section = section_of(disks, height)
    shown, numbers = section.members(disk_rows(result, disks))
    _draw(
        page, section, shown, [(title, field[numbers], None, "") for title, field in panels], symbol, strain
    )


def _draw(page, section, shown, panels, symbol, strain="", rows=1):
    """Panels [(title, field (m, D), rotations (m,) or None, name of the row), …] on the disks of a section.

    shown            (m,) rows of its disks that have a field
    symbol, strain   TeX of the field, and of what it is divided by

    Below each panel stands how many times the field its arrows are, and the rms of the quantity in colour: rotations,
    or the third component.
    """
    colour, unit, gap = r"\theta", strain, ",  "
    if section.height is not None:
        d = 2.0 * float(np.mean(radii_of(section.source))) if strain else 1.0
        colour, unit, gap = (
            _subscripted(symbol, "z"),
            rf"{strain}\,{MEAN_DIAMETER[3]}" if strain else "",
            "\n",
        )
        panels = [(title, field, field[:, 2] / d, row) for title, field, _, row in panels]
    width = COLUMN if len(panels) // rows <= 2 else PAGE
    axes = frame_cells(page, [section.cell] * len(panels), rows, width, linewidth=0.4)
    chosen = spaced_rows(section.centres[shown], section.cell)
    spacing = np.sqrt(section.cell[0, 0] * section.cell[1, 1] / max(len(chosen), 1))
    name = rf"{symbol}/{strain}" if strain else symbol
    for (ax, _), (title, u, tone, row) in zip(axes, panels, strict=True):
        factor = _arrow_factor(u[:, :2], spacing)
        scales = rf"arrows ${number(factor)}\,{name}$" if factor else f"${name}=0$"
        if tone is not None:
            scales += rf"{gap}${_rms_name(colour)}={number(_rms(tone))}\,{unit}$"
        ax.set_title(title, pad=3)
        ax.set_ylabel(row, fontsize=9)
        ax.set_xlabel(scales, fontsize=_SMALL, labelpad=3)
    notes = [section.title and rf"slice {section.title}:  arrows show $x$ and $y$, colours $z$"]
    if len(chosen) < len(shown):
        notes.append(f"arrows on {len(chosen)} of {len(shown)} disks")
    note = ";  ".join(filter(None, notes))
    if note and page.is_new:
        page.figure.supxlabel(note, fontsize=_SMALL)
    elif section.height is not None:
        ax.set_xlabel(f"{ax.get_xlabel()}\n{note}")
    if section.height is not None:
        _draw_bar(page, colour)
    lay_out(page, rows, 0.15 if note and page.is_new else 0.0)
    images, places = disk_images(section.centres, section.radii, section.cell)
    for (ax, outline), (_, u, tone, _) in zip(axes, panels, strict=True):
        scale = points_per_length(ax)
        look = {"facecolors": "white", "edgecolors": "0.72", "linewidths": min(0.3, 0.03 * scale)}
        if tone is not None:
            values = np.full(len(section.rows), np.nan)
            values[shown] = tone / (_rms(tone) or 1.0)
            look |= _scale() | {"array": np.ma.masked_invalid(values[images])}
        drawn = draw_circles(ax, places, 2 * section.radii[images], **look)
        clip_artists(outline, [drawn], rasterized=len(section.rows) > ARROWS)
        if factor := _arrow_factor(u[:, :2], spacing):
            starts, vectors = section.centres[shown][chosen], factor * u[chosen, :2]
            clip_artists(outline, [_arrows(ax, starts, vectors, section.cell, scale * spacing)])


def _draw_bar(page, symbol):
    """The colour bar of a quantity over its rms."""
    settings = {"shrink": 0.5, "aspect": 18, "pad": 0.01, "ticks": (-_RANGE, 0, _RANGE)}
    label = f"${symbol}/{_rms_name(symbol)}$"
    bar = page.figure.colorbar(ScalarMappable(**_scale()), ax=page.axes, label=label, **settings)
    bar.ax.tick_params(length=2, labelsize=_SMALL)


def _scale():
    """Norm and colour map of a quantity over its rms."""
    return {"norm": Normalize(-_RANGE, _RANGE), "cmap": _colours()}


def _rms_name(symbol):
    return _subscripted(symbol, r"\rm rms")


def _subscripted(symbol, subscript):
    """TeX of a symbol with one subscript more."""
    base, _, first = symbol.partition("_")
    return f"{base}_{{{f'{first},' if first else ''}{subscript}}}"


def _arrows(ax, starts, vectors, cell, spacing):
    """Arrows (M, 2), `spacing` points apart; an arrow that leaves the cell continues on the other side."""
    rows, starts = segment_images(starts, vectors, cell)
    width = min(0.7, max(0.3, 0.07 * spacing)) * ax.figure.dpi / 72
    heads = {"headwidth": 4, "headlength": 4.5, "headaxislength": 4, "minlength": 0.3}
    units = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "units": "dots", "width": width}
    return ax.quiver(*starts.T, *vectors[rows].T, **units, **heads, zorder=3, label=hidden("arrows"))


def _colours():
    """A diverging colour map for any colour vision, nowhere so dark that a black arrow cannot be seen."""
    shades = 0.3 + 0.7 * matplotlib.colormaps["PuOr"](np.linspace(0.12, 0.88, 256))[:, :3]
    return LinearSegmentedColormap.from_list("PuOr-light", shades).with_extremes(bad="white")


def _rms(values):
    return float(np.sqrt(np.mean(np.abs(values) ** 2))) if len(values) else 0.0


def _arrow_factor(u, spacing):
    """How many times the field arrows are: round, long ones reach past the next; 0 if nothing moves."""
    long = float(np.quantile(np.hypot(u[:, 0], u[:, 1]), 0.9)) if len(u) else 0.0
    if long == 0:
        return 0.0
    exact = _REACH * spacing / long
    decade = 10.0 ** np.floor(np.log10(exact))
    return decade * max(step for step in _STEPS if step <= exact / decade * (1 + 1e-9))


def spaced_rows(points, cell) -> np.ndarray:
    """Rows of at most ARROWS points (n, 2), one from each square of a grid over a cell (2, 2); all if they are few."""
    if len(points) <= ARROWS:
        return np.arange(len(points))
    sides = np.hypot(cell[:, 0], cell[:, 1])
    shape = np.maximum(1, (sides / np.sqrt(np.prod(sides) / ARROWS)).astype(int))
    place = (points @ np.linalg.inv(cell)) % 1.0 * shape
    square = np.minimum(place.astype(int), shape - 1)
    off_centre = np.sum((place - square - 0.5) ** 2, axis=1)
    number_of = square[:, 0] * shape[1] + square[:, 1]
    order = np.lexsort((off_centre, number_of))
    _, first = np.unique(number_of[order], return_index=True)
    return np.sort(order[first])
