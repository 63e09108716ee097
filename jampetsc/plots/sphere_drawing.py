"""Spheres on paper: a slice through the cell, and the cell as seen from outside."""

from itertools import product

import numpy as np
from matplotlib.collections import LineCollection

from jampetsc.plots.cell_drawing import (
    CAPTION_HEIGHT,
    clip_artists,
    draw_disks,
    draw_forces,
    frame_cell,
    lay_out,
    wrap,
)
from jampetsc.plots.style import PAGE

MAX_VECTOR_DISKS = 2000  # of a slice; beyond, vector files hold pixels
SLICE_FORCE_WIDTH = 0.1  # of the line of a mean force, in mean radii
TO_EYE = (0.42, 0.36, 1.0)  # x to the right, y up, z out of the paper
TO_LAMP = np.array([-0.45, 0.6, 1.0])  # as the eye sees it
VIEW_PIXELS = 1500  # along the longer side
SPHERE_COLOUR, HOLLOW_COLOUR, WALL_COLOUR = (0.56, 0.69, 0.85), (1.0, 0.98, 0.93), (0.45, 0.45, 0.45)
AMBIENT, DIFFUSE, HIGHLIGHT, SHININESS = 0.4, 0.6, 0.25, 24
FADING_DEPTH, DEEP_LIGHT = (
    2.0,
    0.3,
)  # light falls behind the faces of the cell, in mean diameters, to this part
SLICE_COLOUR = "#b2182b"


def draw_spheres(page, panels, height) -> None:
    """A slice and a view, in a row for each of panels [(title, spheres, contacts, hollow (N,), caption), …].

    height   z of the slice over L_z

    The slice shows the disks `cut_spheres`. Contacts are lines between the centres of spheres that are both cut, seen
    along z; their width is proportional to the whole force.

    The view shows spheres whose centres are in the cell, along an oblique direction without perspective. Light falls
    with the depth behind the faces of the cell. Hollow spheres are white, and a dashed line is the edge of the slice.
    """
    views = [SphereView(spheres) for _, spheres, *_ in panels]
    ratio = max(view.aspect for view in views)
    for _, spheres, *_ in panels:
        (length, _), (tilt, side) = spheres.cell[:2, :2]
        ratio = max(ratio, side / (length + abs(tilt)))
    axes = page.panels(len(panels), 2, PAGE, len(panels) * (PAGE / 2 * ratio + CAPTION_HEIGHT), letters=False)
    pairs = np.reshape(axes, (-1, 2))
    outlines = []
    for (slice_ax, view_ax), view, (title, spheres, _, hollow, caption) in zip(
        pairs, views, panels, strict=True
    ):
        outlines.append(frame_cell(slice_ax, spheres.cell[:2, :2]))
        slice_ax.set_title(", ".join(filter(None, (title, rf"$z={height:.3g}\,L_z$"))))
        slice_ax.set_xlabel(caption, linespacing=1.4)
        notes = ["dashed: slice"] + ["white: hollow in the slice"] * bool(hollow.any())
        view_ax.set_xlabel("$x$ right, $y$ up, $z$ to the front\n" + ";  ".join(notes), linespacing=1.4)
        view.frame(view_ax)
    lay_out(page, len(panels))
    for (slice_ax, view_ax), outline, view, (_, spheres, contacts, hollow, _) in zip(
        pairs, outlines, views, panels, strict=True
    ):
        walls = np.arange(spheres.n) < spheres.record.get("walls", 0)
        _draw_slice(slice_ax, outline, spheres, contacts, hollow, walls, height)
        colours = np.where(hollow[:, None], HOLLOW_COLOUR, SPHERE_COLOUR)
        colours[walls] = WALL_COLOUR
        view.draw(view_ax, colours, height)


def cut_spheres(spheres, height):
    """Disks in which the plane z = height·L_z cuts spheres and their images along z.

    Returns rows (M,), centres (M, 2) and radii (M,) √(ρ² − h²), with h the distance of a centre from the plane.
    """
    centres = _images_at(spheres, height)
    squares = spheres.radii**2 - centres[..., 2] ** 2
    image, rows = np.nonzero(squares > 0)
    return rows, centres[image, rows, :2], np.sqrt(squares[image, rows])


def _images_at(spheres, height):
    """Centres (3, N, 3) of three images of every sphere along a₃, from the point height·a₃ of the plane."""
    centres = wrap(spheres.positions, spheres.cell)
    return np.stack([centres + (shift - height) * spheres.cell[2] for shift in (-1, 0, 1)])


def _draw_slice(ax, outline, spheres, contacts, hollow, walls, height):
    plane = spheres.cell[:2, :2]
    rows, centres, radii = cut_spheres(spheres, height)
    look = (hollow[rows], walls[rows], plane, 0.3 if len(rows) <= MAX_VECTOR_DISKS else 0.1)
    drawn = [draw_disks(ax, wrap(centres, plane), radii, *look)]
    if len(contacts):
        first = _images_at(spheres, height)[:, contacts.i]
        second = first + contacts.r
        cut = [
            np.abs(first[..., 2]) < spheres.radii[contacts.i],
            np.abs(second[..., 2]) < spheres.radii[contacts.j],
        ]
        image, row = np.nonzero(cut[0] & cut[1])
        starts, vectors = wrap(first[image, row, :2], plane), contacts.r[row, :2]
        forces, width = (
            contacts.force[row] / np.mean(contacts.force),
            SLICE_FORCE_WIDTH * np.mean(spheres.radii),
        )
        drawn.append(draw_forces(ax, starts, vectors, forces, width, plane))
    clip_artists(outline, drawn, rasterized=len(rows) > MAX_VECTOR_DISKS)


class SphereView:
    """A cell of spheres along TO_EYE, without perspective.

    axes      (3, 3) orthonormal rows: to the right, up, to the eye
    centres   (N, 3) of the spheres in the cell, in these axes
    low, high (2,) corners of the picture
    """

    def __init__(self, spheres):
        eye = np.array(TO_EYE) / np.linalg.norm(TO_EYE)
        right = np.cross((0.0, 1.0, 0.0), eye)
        right /= np.linalg.norm(right)
        self.axes = np.array([right, np.cross(eye, right), eye])
        self.cell, self.radii = spheres.cell, spheres.radii
        self.centres = wrap(spheres.positions, spheres.cell) @ self.axes.T
        corners = self._place(list(product((0, 1), repeat=3)))
        margin = 0.01 * np.ptp(corners, axis=0)
        reach = self.radii[:, None]
        self.low = np.minimum(corners.min(axis=0), (self.centres[:, :2] - reach).min(axis=0)) - margin
        self.high = np.maximum(corners.max(axis=0), (self.centres[:, :2] + reach).max(axis=0)) + margin

    @property
    def aspect(self) -> float:
        """Height over width."""
        width, height = self.high - self.low
        return height / width

    def _place(self, fractional):
        """Places on paper (…, 2) of fractional coordinates (…, 3)."""
        return np.asarray(fractional, float) @ self.cell @ self.axes[:2].T

    def frame(self, ax) -> None:
        """Limits of the picture on `ax`, without ticks."""
        (x0, y0), (x1, y1) = self.low, self.high
        ax.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal", xticks=(), yticks=())
        ax.spines[:].set_visible(False)

    def nearest(self, x, y):
        """The sphere that is nearest to the eye at each point of a grid x (m,), y (n,), ascending.

        Returns its row (n, m), −1 where there is none, and the depth (n, m) of its surface along the third axis.
        """
        rows, depth = np.full((len(y), len(x)), -1), np.full((len(y), len(x)), -np.inf)
        for row in np.argsort(-self.centres[:, 2]):  # from the front: most patches behind are skipped
            (x0, y0, z0), radius = self.centres[row], self.radii[row]
            left, right = np.searchsorted(x, (x0 - radius, x0 + radius))
            below, above = np.searchsorted(y, (y0 - radius, y0 + radius))
            patch = np.s_[below:above, left:right]
            squares = radius**2 - (x[left:right] - x0) ** 2 - (y[below:above, None] - y0) ** 2
            if not squares.size or depth[patch].min() >= z0 + radius:
                continue
            surface = z0 + np.sqrt(np.maximum(squares, 0))
            nearer = (squares > 0) & (surface > depth[patch])
            depth[patch][nearer], rows[patch][nearer] = surface[nearer], row
        return rows, depth

    def image(self, colours):
        """Spheres of colours (N, 3) in the light of TO_LAMP: pixels (n, m, 4), lowest first, and their extent."""
        step = (self.high - self.low).max() / VIEW_PIXELS
        x, y = (np.arange(low + step / 2, high, step) for low, high in zip(self.low, self.high, strict=True))
        rows, depth = self.nearest(x, y)
        seen = rows >= 0
        row, points = rows[seen], np.stack((*np.meshgrid(x, y), depth), axis=-1)[seen]
        normals = (points - self.centres[row]) / self.radii[row, None]
        lamp = TO_LAMP / np.linalg.norm(TO_LAMP)
        half = lamp + np.array([0.0, 0.0, 1.0])  # normal of a mirror from lamp to eye
        light = AMBIENT + DIFFUSE * np.maximum(normals @ lamp, 0.0)
        fading = np.exp(-self.depth_in_cell(points) / (FADING_DEPTH * 2 * np.mean(self.radii)))
        light *= DEEP_LIGHT + (1 - DEEP_LIGHT) * fading
        gloss = HIGHLIGHT * np.maximum(normals @ half / np.linalg.norm(half), 0.0) ** SHININESS
        pixels = np.zeros((*rows.shape, 4))
        shades = light[:, None] * (colours[row] + gloss[:, None])
        pixels[seen] = np.column_stack((np.clip(shades, 0, 1), np.ones(len(row))))
        extent = (x[0] - step / 2, x[-1] + step / 2, y[0] - step / 2, y[-1] + step / 2)
        return pixels, extent

    def depth_in_cell(self, points):
        """How far points (M, 3) in the axes of the view are behind the faces of the cell along the line of sight."""
        inverse = np.linalg.inv(self.cell)
        fractional, slopes = points @ self.axes @ inverse, self.axes[2] @ inverse
        crossed = slopes != 0
        ways = ((slopes > 0) - fractional)[:, crossed] / slopes[crossed]
        return np.maximum(ways.min(axis=1), 0.0)

    def draw(self, ax, colours, height) -> None:
        """The spheres, the edges of the cell, and the edge of the slice on the faces that are seen."""
        pixels, extent = self.image(colours)
        drawn = ax.imshow(pixels, extent=extent, origin="lower", zorder=1, aspect="equal")
        drawn.set_in_layout(False)
        seen = (self.axes[2] @ np.linalg.inv(self.cell)) > 0  # faces at 1 along a vector, else those at 0
        corners = np.array(list(product((0, 1), repeat=3)))
        edges = [(a, b) for a in corners for b in corners if (b - a).sum() == 1 and (b != a).sum() == 1]
        hidden = np.array([(a != seen).sum() == 3 or (b != seen).sum() == 3 for a, b in edges])
        places = self._place(edges)
        for mask, layer in ((hidden, 0), (~hidden, 3)):
            look = {"colors": "0.2", "linewidths": 0.6, "capstyle": "round", "zorder": layer}
            ax.add_collection(LineCollection(places[mask], **look), autolim=False)
        near, far = seen.astype(float), 1.0 - seen
        line = self._place([(far[0], near[1], height), (near[0], near[1], height), (near[0], far[1], height)])
        look = {"colors": SLICE_COLOUR, "linewidths": 0.9, "linestyles": "dashed", "zorder": 3}
        ax.add_collection(LineCollection([line], **look), autolim=False)
