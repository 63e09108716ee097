"""Six-fold bond-orientational order of disks in a periodic cell (Nelson & Halperin, Phys. Rev. B 19, 2457 (1979)).

    ψ₆ = (1/n) Σ_j exp(6iθ_j)

of a disk, over its n neighbours j in the Delaunay triangulation of the centres, with Voronoi cells that border on its
own; θ_j is the direction to j. |ψ₆| is 1 in a triangular lattice, about ½ in a liquid; |⟨ψ₆⟩| tells whether all are
turned alike: 1 in one crystal, about 0.6/√N in a liquid.
"""

import numpy as np

# mean spacings beyond the cell from which images count: neighbours of disks inside lie closer
IMAGE_MARGIN = 6.0


def bond_order(positions, cell) -> np.ndarray:
    """ψ₆ of each disk, (N,) complex, for positions (N, 2) anywhere and cell (2, 2) with rows a₁, a₂."""
    from scipy.spatial import Delaunay  # takes a fifth of a second to import

    n = len(positions)
    fractions = np.linalg.solve(cell.T, np.asarray(positions, float).T).T
    fractions -= np.floor(fractions)
    heights = abs(np.linalg.det(cell)) / np.linalg.norm(cell[::-1], axis=1)  # of the cell above its edges
    margin = IMAGE_MARGIN * np.sqrt(abs(np.linalg.det(cell)) / n) / heights
    image_range = [np.arange(-np.ceil(m), np.ceil(m) + 1) for m in margin]
    shifts = np.stack(np.meshgrid(*image_range, indexing="ij"), axis=-1).reshape(-1, 2)
    shifts = shifts[np.argsort(np.abs(shifts).sum(1), kind="stable")]  # the cell itself first
    images = (fractions + shifts[:, None]).reshape(-1, 2)
    near = ((images >= -margin) & (images < 1 + margin)).all(axis=1)
    points = images[near] @ cell
    corners = Delaunay(points).simplices
    edges = corners[:, [[0, 1], [1, 2], [2, 0], [1, 0], [2, 1], [0, 2]]].reshape(-1, 2)
    i, j = np.unique(edges[edges[:, 0] < n], axis=0).T
    across = points[j] - points[i]
    turned = ((across[:, 0] + 1j * across[:, 1]) / np.hypot(*across.T)) ** 6
    sums = np.bincount(i, turned.real, n) + 1j * np.bincount(i, turned.imag, n)
    return sums / np.bincount(i, minlength=n)


def mean_order(positions, cells, walls: int = 0):
    """(⟨|ψ₆|⟩, |⟨ψ₆⟩|), (S,) each, over the disks that move in snapshots: positions (S, N, 2), cells (S, 2, 2).

    walls   number of disks of the walls, which come first
    """
    psi = [bond_order(x, cell)[walls:] for x, cell in zip(positions, cells, strict=True)]
    return np.abs(psi).mean(1), np.abs(np.mean(psi, axis=1))
