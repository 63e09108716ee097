"""A view of spheres in light and shade."""

import numpy as np

from jampetsc.plots.cell_drawing import wrap
from jampetsc.plots.cell_view import CellView

TO_LAMP = np.array([-0.45, 0.6, 1.0])  # as the eye sees it
VIEW_PIXELS = 1500  # along the longer side
SPHERE_COLOUR, HOLLOW_COLOUR, WALL_COLOUR = (0.56, 0.69, 0.85), (1.0, 0.98, 0.93), (0.45, 0.45, 0.45)
AMBIENT, DIFFUSE, HIGHLIGHT, SHININESS = 0.4, 0.6, 0.25, 24
FADING_DEPTH, DEEP_LIGHT = (
    2.0,
    0.3,
)  # light falls behind the faces of the cell, in mean diameters, to this part


class SphereView(CellView):
    """Spheres whose centres are in the cell.

    centres   (N, 3) in the axes of the view
    """

    def __init__(self, spheres):
        self.radii = spheres.radii
        places = wrap(spheres.positions, spheres.cell)
        super().__init__(spheres.cell, places, self.radii)
        self.centres = places @ self.axes.T

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

    def draw(self, ax, hollow, walls, height) -> None:
        """The spheres, masks (N,) of which are hollow or walls, in a cell with its edges and that of the slice."""
        colours = np.where(hollow[:, None], HOLLOW_COLOUR, SPHERE_COLOUR)
        colours[walls] = WALL_COLOUR
        pixels, extent = self.image(colours)
        drawn = ax.imshow(pixels, extent=extent, origin="lower", zorder=1, aspect="equal")
        drawn.set_in_layout(False)
        self.draw_edges(ax, height)
