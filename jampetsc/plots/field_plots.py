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
from jampetsc.laws.loads import DEFAULT, loads_of
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
    wrap,
)
from jampetsc.plots.correlation_plots import OMEGA
from jampetsc.plots.mode_plots import mode_fields
from jampetsc.plots.packing_plots import refuse_spheres
from jampetsc.plots.picture import PACKING, option, picture
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
)  # fmt: skip


@picture("fields", "sweep", options=FIELDS, single=True)
def plot_fields(results, page, omega=None, packing=None, phase=PHASES[0], total=False):
    """Displacement fields of a sweep at two instants of their cycle, side by side for one ω, in two rows for more.

    omega     (F,) as the file has them; None: up to four
    packing   the file of the packing where it is not beside the sweep
    phase     "strain": Re and Im, in phase with the strain and with its rate; "stress": Re and −Im, when the stress is
              at its peak and a quarter of a period later, when it is zero (BT)
    total     with the affine part E x of the load, x from the middle of the cell

    Colours are rotations. Below each panel stands how many times the field its arrows are. Raises InputError for more
    frequencies than fit, and for frequencies that the file does not have.
    """
    (sweep,) = results
    fields = sweep.fields
    rows = chosen_frequencies(sweep, omega)
    disks = source_of(sweep, packing)
    refuse_spheres(disks)
    particles = particle_rows(sweep, disks)
    (load,) = loads_of(sweep.load, disks.dimension)
    affine = np.zeros((len(particles), disks.dimension))
    if total:
        affine = load.imposed(wrap(disks.positions, disks.cell)[particles] - 0.5 * disks.cell.sum(axis=0))
    turns = [phase_factor(sweep, fields.omega[row], phase) for row in rows]
    stored = [field_at(sweep, row) for row in rows]
    motion = [turn * (affine + field) for turn, (field, _) in zip(turns, stored, strict=True)]
    spin = None
    if fields.rotation is not None:
        spin = [turn * rotation for turn, (_, rotation) in zip(turns, stored, strict=True)]
    omega = fields.omega[rows] * float(sweep.attributes.get("tau1", 1.0))
    if len(omega) > MAX_COLUMNS:
        raise InputError(
            f"{len(omega)} frequencies: one picture holds {MAX_COLUMNS}. Choose some with omega."
        )
    strain = r"\gamma" if load.name == DEFAULT else r"\epsilon"
    symbol, single, panels = "u" if total else r"\tilde u", len(omega) == 1, []
    for part, (take, name) in enumerate(INSTANTS[phase]):
        for f, w in enumerate(omega):
            frequency, instant = rf"$\omega\tau_1={power_or_number(w)}$", name.format(symbol)
            title = f"{instant},  {frequency}" if single else "" if part else frequency
            rolls = None if spin is None else take(spin[f])
            panels.append((title, take(motion[f]), rolls, "" if single or f else instant))
    _draw(page, disks, panels, particles, rf"{symbol}/{strain}", 1 if single else 2, strain)
    if spin is not None:
        shown = ScalarMappable(Normalize(-_RANGE, _RANGE), _colours())
        settings = {"shrink": 0.5, "aspect": 18, "pad": 0.01, "ticks": (-_RANGE, 0, _RANGE)}
        bar = page.figure.colorbar(shown, ax=page.axes, label=r"$\theta/\theta_{\rm rms}$", **settings)
        bar.ax.tick_params(length=2, labelsize=_SMALL)
    shown = ", ".join(f"{w:g}" for w in omega)
    kind = "total" if total else "non-affine"
    return f"{kind} displacement fields at omega tau1 = {shown}, in phase with the {phase}"


@picture("response", "quasistatic", options=(PACKING,), single=True)
def plot_response(results, page, packing=None):
    """Displacements u_na per unit strain under slow shear, without pre-stress and with it."""
    (result,) = results
    fields = {"no pre-stress": "no_prestress/nonaffine", "pre-stress": "nonaffine"}
    if not result.attributes["prestress"]:
        fields = {"no pre-stress": "nonaffine"}
    panels = [(title, result[name]) for title, name in fields.items()]
    disks = source_of(result, packing)
    refuse_spheres(disks)
    _draw_real(page, disks, panels, disk_rows(result, disks), r"u_{\rm na}/\gamma")
    return f"quasistatic response, {' and '.join(fields)}"


MODE = option("mode", INTEGERS, "mode: numbers of modes from 1, drawn on the packing (default 1)", "i,j,…")


@picture("mode", "modes", options=(PACKING, MODE), single=True)
def plot_mode(results, page, packing=None, mode=(1,)):
    """Modes on the packing, numbered from 1. Raises InputError for one that the file does not hold."""
    (result,) = results
    panels = mode_fields(result, mode)
    disks = source_of(result, packing)
    refuse_spheres(disks)
    _draw_real(page, disks, panels, disk_rows(result, disks), r"\varphi")
    return f"mode {','.join(map(str, np.ravel(mode)))}"


@picture("velocities", "flow", single=True)
def plot_velocities(results, page):
    """Non-affine velocities u/γ̇ of the last snapshot."""
    (result,) = results
    disks = snapshot(result)
    refuse_spheres(disks)
    field = result["snapshots/velocities"][-1] / float(result.attributes["rate"])
    strain = result["snapshots/strain"][-1]
    _draw_real(page, disks, [(rf"$\gamma={strain:.4g}$", field)], np.arange(disks.n), r"u/\dot\gamma")
    return f"non-affine velocities at strain {strain:.4g}"


def _draw_real(page, disks, panels, particles, symbol):
    """Panels [(title, field), …] side by side, without rotations. Raises InputError for more panels than fit."""
    if len(panels) > MAX_COLUMNS:
        raise InputError(f"{len(panels)} fields: one picture holds {MAX_COLUMNS}. Choose fewer.")
    _draw(page, disks, [(title, field, None, "") for title, field in panels], particles, symbol, 1)


def _draw(page, disks, panels, particles, symbol, rows, strain=r"\gamma"):
    """Panels [(title, field (n, 2), rotations (n,) or None, name of the row), …] on the packing; particles (n,) rows of
    `disks`, `symbol` the name of the fields in TeX. Below each stands how many times the field its arrows are.
    """
    width = COLUMN if len(panels) // rows <= 2 else PAGE
    axes = frame_cells(page, [disks.cell] * len(panels), rows, width, linewidth=0.4)
    centres = wrap(disks.positions, disks.cell)
    chosen = _spaced_rows(centres[particles], disks.cell)
    spacing = np.sqrt(disks.volume / max(len(chosen), 1))
    for (ax, _), (title, u, spin, row) in zip(axes, panels, strict=True):
        factor = _arrow_factor(u, spacing)
        scales = rf"arrows ${number(factor)}\,{symbol}$" if factor else f"${symbol}=0$"
        if spin is not None:
            scales += rf",  $\theta_{{\rm rms}}={number(_rms(spin))}\,{strain}$"
        ax.set_title(title, pad=3)
        ax.set_ylabel(row, fontsize=9)
        ax.set_xlabel(scales, fontsize=_SMALL, labelpad=3)
    few = len(chosen) < len(particles)
    if few and page.is_new:
        page.figure.supxlabel(f"arrows on {len(chosen)} of {len(particles)} disks", fontsize=_SMALL)
    lay_out(page, rows, 0.15 if few else 0.0)
    radii = radii_of(disks)
    images, places = disk_images(centres, radii, disks.cell)
    for (ax, outline), (_, u, spin, _) in zip(axes, panels, strict=True):
        scale, faces = points_per_length(ax), np.ones((disks.n, 4))
        if spin is not None:
            faces[particles] = _colours()(0.5 + spin / (2 * _RANGE * (_rms(spin) or 1.0)))
        look = {"facecolors": faces[images], "edgecolors": "0.72", "linewidths": min(0.3, 0.03 * scale)}
        drawn = draw_circles(ax, places, 2 * radii[images], **look)
        clip_artists(outline, [drawn], rasterized=disks.n > ARROWS)
        if factor := _arrow_factor(u, spacing):
            vectors = factor * u[chosen]
            clip_artists(
                outline, [_arrows(ax, centres[particles][chosen], vectors, disks.cell, scale * spacing)]
            )


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
    return LinearSegmentedColormap.from_list("PuOr-light", shades)


def _rms(values):
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def _arrow_factor(u, spacing):
    """How many times the field arrows are: round, long ones reach past the next; 0 if nothing moves."""
    long = float(np.quantile(np.hypot(u[:, 0], u[:, 1]), 0.9))
    if long == 0:
        return 0.0
    exact = _REACH * spacing / long
    decade = 10.0 ** np.floor(np.log10(exact))
    return decade * max(step for step in _STEPS if step <= exact / decade * (1 + 1e-9))


def _spaced_rows(points, cell):
    """Rows of at most ARROWS points, one from each square of a grid over the cell; all if they are few."""
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
