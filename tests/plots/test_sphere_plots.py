"""Pictures of spheres, against sums over all images: the disks of a slice, its contacts, and what a view shows."""

from itertools import product

import numpy as np
import pytest
import samples
from picture_contents import circle_radii, figure_of
from spheres import few_spheres

from jampetsc import main
from jampetsc.errors import InputError
from jampetsc.io.packing_file import write_packing
from jampetsc.packing.contacts import measure
from jampetsc.packing.packing import Packing
from jampetsc.plots.packing_plots import draw_panels, flow_panel, plot_packing
from jampetsc.plots.page import Page
from jampetsc.plots.sections import section_of
from jampetsc.plots.sphere_drawing import SphereView

HEIGHT = 0.8


def test_disks_of_slices_fill_phi():
    """The mean over heights of Σ π (ρ² − h²) / |a₁ × a₂| is φ."""
    spheres, heights = few_spheres(), (np.arange(300) + 0.5) / 300
    areas = [np.pi * np.sum(section_of(spheres, height).radii ** 2) for height in heights]
    assert np.mean(areas) / np.prod(np.diag(spheres.cell)[:2]) == pytest.approx(spheres.phi, rel=1e-4)


def test_a_slice_shows_spheres_and_contacts_that_it_cuts():
    """Every image of a sphere and of a contact, folded into the plane of the slice, is drawn, and nothing else."""
    spheres = few_spheres()
    cell = spheres.cell.copy()
    cell[2] += 9 * cell[0]  # the same spheres, farther to fold
    spheres = Packing.from_positions(spheres.positions, spheres.radii, cell)
    contacts, radii = measure(spheres).contacts, spheres.radii
    slice_ax, view_ax = figure_of(plot_packing, spheres, height=HEIGHT).axes
    assert "0.8" in slice_ax.get_title() and f"Z={measure(spheres).coordination:.3f}" in slice_ax.get_xlabel()
    (image,) = view_ax.images
    assert (image.get_array()[..., 3] > 0).any()
    disks, lines = slice_ax.collections
    inverse, middle = np.linalg.inv(spheres.cell[:2, :2]), HEIGHT * spheres.cell[2]

    def folded(points, *numbers):
        """Rows of fractional places in the plane, as points of a circle, and of numbers."""
        angles = 2 * np.pi * np.atleast_2d(points) @ inverse
        rows = np.column_stack((np.cos(angles), np.sin(angles), *numbers))
        return np.unique(np.round(rows, 6) + 0.0, axis=0)

    def is_inside(points):
        """Mask of points in the cell."""
        return ((points @ inverse >= 0) & (points @ inverse < 1)).all(axis=1)

    expected = []
    for n in range(-4, 5):
        away = spheres.positions + n * spheres.cell[2] - middle
        cut = np.abs(away[:, 2]) < radii
        expected.append(np.column_stack((away, np.sqrt(np.abs(radii**2 - away[:, 2] ** 2))))[cut])
    expected = np.concatenate(expected)
    shown = folded(disks.get_offsets(), circle_radii(disks))
    assert is_inside(disks.get_offsets()).sum() == len(shown)
    np.testing.assert_allclose(shown, folded(expected[:, :2], expected[:, 3]), atol=2e-6)
    expected = []
    for n in range(-4, 5):
        first = spheres.positions[contacts.i] + n * spheres.cell[2] - middle
        second = first + contacts.r
        cut = (np.abs(first[:, 2]) < radii[contacts.i]) & (np.abs(second[:, 2]) < radii[contacts.j])
        expected.append(np.column_stack((first[:, :2], contacts.r[:, :2], contacts.force))[cut])
    expected = np.concatenate(expected)
    (first, second), widths = np.moveaxis(lines.get_segments(), 1, 0), lines.get_linewidths()
    shown = folded(first, second - first, widths / np.max(widths))
    assert is_inside(first).sum() == len(shown)
    np.testing.assert_allclose(
        shown, folded(expected[:, :2], expected[:, 2:4], expected[:, 4] / expected[:, 4].max()), atol=2e-6
    )


def test_a_view_shows_what_is_nearest_to_the_eye():
    spheres = few_spheres()
    view = SphereView(spheres)
    np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(view.axes) == pytest.approx(1)
    x, y = (np.linspace(low, high, 37) for low, high in zip(view.low, view.high, strict=True))
    rows, depth = view.nearest(x, y)
    places = spheres.positions @ np.linalg.inv(spheres.cell)
    centres = (places - np.floor(places)) @ spheres.cell @ view.axes.T
    for (m, height), (n, width) in product(enumerate(y), enumerate(x)):
        squares = spheres.radii**2 - (centres[:, 0] - width) ** 2 - (centres[:, 1] - height) ** 2
        surface = np.where(squares > 0, centres[:, 2] + np.sqrt(np.maximum(squares, 0)), -np.inf)
        assert depth[m, n] == pytest.approx(surface.max(), abs=1e-12)
        assert rows[m, n] == (surface.argmax() if (squares > 0).any() else -1)
    assert 10 < len(np.unique(rows))
    # a step along the line of sight from a face that is seen is as long as its depth
    face = np.array([(1.0, 0.4, 0.5), (0.5, 1.0, 0.5), (0.3, 0.6, 1.0)]) @ spheres.cell @ view.axes.T
    np.testing.assert_allclose(view.depth_in_cell(face - [0, 0, 0.1]), 0.1)
    # the strongest channel of a pixel is that of its sphere
    pixels, (left, right, low, high) = view.image(np.eye(3)[np.arange(spheres.n) % 3])
    x, y = (
        ends[0] + (np.arange(count) + 0.5) * np.diff(ends) / count
        for ends, count in (((left, right), pixels.shape[1]), ((low, high), pixels.shape[0]))
    )
    rows, _ = view.nearest(x, y)
    assert (np.argmax(pixels[..., :3], axis=-1) == rows % 3)[rows >= 0].mean() > 0.999
    np.testing.assert_array_equal(pixels[..., 3] > 0, rows >= 0)


def test_snapshots_of_spheres_stand_in_rows_and_disks_have_no_slice(tmp_path, capsys):
    spheres, disks = few_spheres(), samples.published()
    page = Page()
    panel = flow_panel("b", spheres)
    draw_panels(page, [flow_panel("a", spheres), (*panel[:3], np.ones(spheres.n, bool), panel[4])])
    assert [ax.get_title() for ax in page.axes[::2]] == ["a, $z=0.5\\,L_z$", "b, $z=0.5\\,L_z$"]
    pixels = [np.asarray(ax.images[0].get_array()) for ax in page.axes[1::2]]
    blue = [np.median(np.divide(*image[image[..., 3] > 0][:, [2, 0]].T)) for image in pixels]
    assert blue[0] > 1.2 and blue[1] < 1.0  # hollow ones are white
    # edges behind the spheres meet in the corner from which a step to the eye leads into the cell
    view, corners = SphereView(spheres), np.array(list(product((0, 1), repeat=3)))
    steps = corners + 0.01 * view.axes[2] @ np.linalg.inv(spheres.cell)
    (corner,) = corners[((steps > 0) & (steps < 1)).all(axis=1)] @ spheres.cell @ view.axes[:2].T
    (behind,) = (lines for lines in page.axes[1].collections if lines.get_zorder() == 0)
    distances = np.linalg.norm(np.array(behind.get_segments()) - corner, axis=-1)
    np.testing.assert_allclose(distances.min(axis=1), np.zeros(3), atol=1e-12)
    with pytest.raises(InputError, match="of disks and of spheres"):
        draw_panels(Page(), [flow_panel("", spheres), flow_panel("", disks)])
    write_packing(tmp_path / "p.h5", disks)
    assert (
        main.main(["plot", str(tmp_path / "p.h5"), "--height", "0.5", "--out", str(tmp_path / "p.png")]) == 2
    )
    assert "--height 0.5: of a slice in three dimensions" in capsys.readouterr().err
