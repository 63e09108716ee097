"""Slices of networks and fields in three dimensions, and views of bonds, against sums over all images."""

import re
from itertools import product

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from picture_contents import circle_radii, figure_of, require_arrows, require_inside
from samples import stored
from sheared import crossed_vectors
from spheres import few_spheres

import jampetsc
from jampetsc.errors import InputError
from jampetsc.packing.lattices import build_lattice
from jampetsc.packing.spring_network import Network
from jampetsc.plots.cell_view import CellView
from jampetsc.plots.field_plots import plot_fields, plot_velocities
from jampetsc.plots.packing_plots import NETWORK_LINE_WIDTH, plot_network
from jampetsc.plots.sections import section_of

HEIGHT = 0.83


def images_cut(spheres, height):
    """(rows (M,), centres (M, 3) with x and y folded into the slice's cell, radii (M,)) of all images that are cut."""
    cell, found = spheres.cell, []
    for n, m, k in product(range(-2, 3), repeat=3):
        centres = spheres.positions + np.array([n, m, k]) @ cell
        from_slice = centres - height * cell[2]
        shares = from_slice[:, :2] @ np.linalg.inv(cell[:2, :2])
        squares = spheres.radii**2 - from_slice[:, 2] ** 2
        cut = (squares > 0) & (shares >= 0).all(axis=1) & (shares < 1).all(axis=1)
        found += [(row, centres[row], squares[row] ** 0.5) for row in np.flatnonzero(cut)]
    rows, centres, radii = zip(*found, strict=True)
    return np.array(rows), np.array(centres), np.array(radii)


def test_a_section_has_every_image_that_the_plane_cuts_where_it_is():
    spheres = few_spheres()
    section = section_of(spheres, HEIGHT)
    rows, centres, radii = images_cut(spheres, HEIGHT)
    order, other = np.lexsort(section.positions.T), np.lexsort(centres.T)
    np.testing.assert_array_equal(section.rows[order], rows[other])
    np.testing.assert_allclose(section.positions[order], centres[other], atol=1e-12)
    np.testing.assert_allclose(section.radii[order], radii[other], atol=1e-12)
    np.testing.assert_allclose(
        section.centres, (section.positions - HEIGHT * spheres.cell[2])[:, :2], atol=1e-12
    )
    particles = np.array([9, 2, 0, 13])
    shown, numbers = section.members(particles)
    np.testing.assert_array_equal(section.rows[shown], particles[numbers])
    assert len(shown) == np.isin(section.rows, particles).sum()


def test_the_parts_of_bonds_in_slabs_at_all_heights_fill_the_cell():
    """The mean over heights of their lengths, seen along z, is that of all bonds times the thickness over L_z."""
    network = Network.of_packing(few_spheres())
    bonds, heights = network.linear_bonds, (np.arange(400) + 0.5) / 400
    radii = np.full(network.n, 0.4)
    lengths = []
    for height in heights:
        section = section_of(network, height, radii)
        rows, _, vectors = section.bonds(bonds)
        lengths.append(np.hypot(*vectors.T).sum())
        np.testing.assert_allclose(
            crossed_vectors(vectors, bonds.r[rows, :2]), 0, atol=1e-12
        )  # each along its bond
    expected = np.hypot(*bonds.r[:, :2].T).sum() * section.thickness / network.cell[2, 2]
    assert np.mean(lengths) == pytest.approx(expected, rel=1e-3)


def test_the_layer_of_a_lattice_and_its_bonds():
    """A slab of a cubic lattice is a square one, with the bonds of its border on both sides; a view has all bonds."""
    cubic = build_lattice("cubic", (3, 3, 3))
    slice_ax, view_ax = figure_of(plot_network, cubic).axes
    assert re.search(r"z=0\.(333|667)\\,L_z", slice_ax.get_title())  # nodes are at 0, 1/3, 2/3
    bonds, nodes = slice_ax.collections
    vectors = np.diff(bonds.get_segments(), axis=1)[:, 0]
    along = vectors[np.hypot(*vectors.T) > 1e-9]
    assert len(along) == 2 * 4 * 3  # three bonds on four lines in each direction
    assert {tuple(np.round(vector)) for vector in along} == {(1, 0), (0, 1)}
    assert len(nodes.get_offsets()) == 16
    (view,) = (lines for lines in view_ax.collections if len(lines.get_segments()) > 12)
    lines = np.array(view.get_segments())[1::2]  # without halos
    axes = CellView(cubic.cell).axes
    expected = (
        3 * 4**2 * np.linalg.norm(3 * axes[:2], axis=0).sum() / 3
    )  # 16 lines of 3 bonds along each axis
    assert np.linalg.norm(np.diff(lines, axis=1), axis=2).sum() == pytest.approx(expected)


def pulling():
    """A network of few nodes, all far from the cell, some of whose bonds push and some pull."""
    network = Network.of_packing(few_spheres())
    tension = np.random.default_rng(2).normal(size=len(network.bonds))
    places = network.positions + 3 * network.cell[0] - 2 * network.cell[2]
    return Network(places, network.bonds, network.cell, tension=tension, images=network.images)


def test_a_slab_has_the_parts_of_all_images_of_bonds_with_their_force():
    network = pulling()
    bonds, cell = network.linear_bonds, network.cell
    drawn = figure_of(plot_network, network, height=HEIGHT).axes[0].collections[0]
    half, inverse, expected = 0.5 * bonds.distance.mean(), np.linalg.inv(cell[:2, :2]), []

    def folded(starts, *numbers):
        angles = 2 * np.pi * starts @ inverse
        return np.unique(
            np.round(np.column_stack((np.cos(angles), np.sin(angles), *numbers)), 6) + 0.0, axis=0
        )

    for n in range(-1, 5):
        starts = network.positions[bonds.i] + (n - HEIGHT) * cell[2]
        ends = np.sort(np.clip((np.array([[-half], [half]]) - starts[:, 2]) / bonds.r[:, 2], 0, 1), axis=0)
        share, force = (ends[1] - ends[0])[:, None], bonds.force / np.abs(bonds.force).max()
        parts = np.column_stack(
            (starts + ends[0][:, None] * bonds.r, share * bonds.r, np.abs(force), force > 0)
        )
        expected.append(parts[ends[1] > ends[0]])
    expected = np.concatenate(expected)[:, [0, 1, 3, 4, 6, 7]]
    (first, second), widths = np.moveaxis(drawn.get_segments(), 1, 0), drawn.get_linewidths()
    pushes = drawn.get_colors()[:, 0] > drawn.get_colors()[:, 2]  # red
    shown = folded(first, second - first, np.array(widths) / NETWORK_LINE_WIDTH, pushes)
    np.testing.assert_allclose(shown, folded(expected[:, :2], *expected[:, 2:].T), atol=2e-6)
    assert 0 < pushes.sum() < len(pushes)


def test_a_view_has_the_parts_of_bonds_in_the_cell_the_nearest_last_and_darkest():
    network = pulling()
    figure = figure_of(plot_network, network, height=HEIGHT)
    require_inside(figure)
    view_ax, bonds, view = figure.axes[1], network.linear_bonds, CellView(network.cell)
    drawn = max(view_ax.collections, key=lambda lines: len(lines.get_segments()))
    lines, colours = np.array(drawn.get_segments())[1::2], drawn.get_colors()[1::2, :3]
    lengths = np.linalg.norm(np.diff(lines, axis=1)[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(np.linalg.norm(bonds.r @ view.axes[:2].T, axis=1).sum())
    corners = np.array(list(product((0, 1), repeat=3))) @ network.cell @ view.axes[:2].T
    assert (lines >= corners.min(axis=0) - 1e-9).all() and (lines <= corners.max(axis=0) + 1e-9).all()
    light = colours.mean(axis=1)
    assert light[: len(light) // 3].mean() > light[-len(light) // 3 :].mean() + 0.1
    assert isinstance(drawn, LineCollection) and drawn.get_label().startswith("_child")  # not in the table


@pytest.mark.parametrize("load", ["xz", "0,0,0.5,0,0,0,1,0,0"])
def test_fields_of_a_slice_are_those_at_its_places(load):
    """Arrows are x and y of E x + ũ/γ, x the shown image from the middle of the cell; colours its z over the rms."""
    spheres, rng = few_spheres(), np.random.default_rng(3)
    particles = np.r_[5:14, 0:3]
    u = rng.normal(size=(1, 12, 3)) + 2j * rng.normal(size=(1, 12, 3))
    arrays = {
        "omega": np.ones(1),
        "G": np.full(1, 2.0 + 0j),
        "error_bound": np.zeros(1),
        "particles": particles,
    }
    arrays |= {"fields/omega": np.ones(1), "fields/displacement": u, "fields/rotation": 1j * u}
    sweep = stored(None, "sweep", arrays, law="contact", load=load, dimension=3, pressure=1e-3)
    sweep.packing = spheres
    E = np.array([(0, 0, 1), (0, 0, 0), (0, 0, 0)] if load == "xz" else [(0, 0, 0.5), (0, 0, 0), (1, 0, 0)])
    rows, places, radii = images_cut(spheres, HEIGHT)
    moving = np.isin(rows, particles)
    numbers = np.array([np.flatnonzero(particles == row)[0] for row in rows[moving]])
    total = u[0, numbers] + (places[moving] - spheres.cell.sum(axis=0) / 2) @ E.T
    page = plot_fields.draw([sweep], total=True, phase="strain", height=HEIGHT)
    require_inside(page.figure)
    *axes, bar = page.figure.axes
    assert bar.get_ylabel() == r"$u_{z}/u_{{z},\rm rms}$"
    assert "z=0.83\\,L_z" in page.figure.texts[-1].get_text()
    d = 2 * spheres.radii.mean()
    for ax, field in zip(axes, (total.real, total.imag), strict=True):
        require_arrows(ax, field[:, :2])
        rms = float(re.search(r"rms}=([\d.]+)", ax.get_xlabel())[1])
        assert rms == pytest.approx(np.sqrt(np.mean(field[:, 2] ** 2)) / d, rel=0.06)
        disks, colours = ax.collections[0], np.full(len(rows), np.nan)
        assert (disks.norm.vmin, disks.norm.vmax) == (-2, 2)
        colours[moving] = field[:, 2] / np.sqrt(np.mean(field[:, 2] ** 2))
        shown = np.column_stack((circle_radii(disks), np.ma.filled(disks.get_array(), np.nan)))
        expected = np.column_stack((radii, colours))  # images on both sides of the border are drawn twice
        for drawn in shown:
            assert np.isclose(expected, drawn, equal_nan=True).all(axis=1).any()
        assert len(np.unique(np.round(shown, 9), axis=0)) == len(expected)


def test_other_vectors_are_drawn_in_slices_and_planes_have_none(tmp_path):
    spheres, rng = few_spheres(), np.random.default_rng(4)
    field = rng.normal(size=(2, 14, 3))
    rows = images_cut(spheres, 0.5)[0]
    arrays = {"eigenvalues": np.ones(2), "modes": field, "particles": np.arange(14)}
    modes = stored(None, "modes", arrays, k=1.0, dimension=3)
    still = {"nonaffine": field[0], "no_prestress/nonaffine": field[1], "particles": np.arange(14)}
    response = stored(None, "quasistatic", still, prestress=True, dimension=3, pressure=0.0, load="zz")
    flow = {f"snapshots/{name}": getattr(spheres, name)[None] for name in ("positions", "cell")}
    flow |= {
        "snapshots/velocities": 0.1 * field[:1],
        "snapshots/strain": np.ones(1),
        "snapshots/radii": spheres.radii,
    }
    flow = stored(None, "flow", flow, potential="harmonic", stiffness="constant", k=1.0, rate=0.1)
    modes.packing = response.packing = spheres
    for result, fields, options in (
        (modes, field, {"mode": [1, 2]}),
        (response, field[::-1], {}),
        (flow, field[:1], {"kind": "velocities"}),
    ):
        axes = np.ravel(jampetsc.plot([result], **options))
        for ax, drawn in zip(axes, fields, strict=True):
            require_arrows(ax, drawn[rows, :2])
            assert (r"\epsilon" in ax.get_xlabel()) == (result is response)
    still = stored(None, "flow", {**flow, "snapshots/velocities": np.zeros((1, 14, 3))}, **flow.attributes)
    assert jampetsc.plot(still, "velocities").get_xlabel().startswith(r"$u/\dot\gamma=0$")
    page = plot_velocities.draw([flow], height=HEIGHT, ax=axes[0].figure.subplots())
    assert "z=0.83" in page.axes[0].get_xlabel()  # there is no caption below axes of the caller
    with pytest.raises(InputError, match=r"height 0\.3: the slice cuts nothing\. Give another height"):
        section_of(spheres, 0.3, np.full(14, 1e-9))
    for kind in ("square", "triangular"):
        with pytest.raises(
            InputError, match=r"height 0\.5: of a slice in three dimensions, but the file has two"
        ):
            plot_network([build_lattice(kind, (2, 2))], height=0.5)
