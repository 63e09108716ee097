"""How disks rearrange: how many move, and D²min, what is left of their displacements besides a local strain."""

import numpy as np

NEIGHBOUR_GAP = 0.5  # mean diameters: pairs with a smaller gap are neighbours


def participation(displacement) -> float:
    """(Σ u²)²/Σ u⁴ of displacements u (N, D): how many particles move."""
    squares = np.sum(displacement**2, axis=1)
    return float(squares.sum() ** 2 / np.sum(squares**2))


def least_square_deviation(i, j, r, displacement):
    """D²min (N,) of particles with displacements (N, D), in their unit squared.

        D²min_i = min over J of the mean over neighbours j of |u_j − u_i − J r_ij|²

    i, j (M,) and r (M, D) = x_j − x_i before: all pairs of neighbours, each once (Falk & Langer, PRE 57, 7192 (1998),
    eq. 2.11, who take the sum). Where neighbours do not determine J, it is the smallest one; nan without neighbours.
    """
    n, dimension = displacement.shape
    change = displacement[j] - displacement[i]
    products, lengths, squares = (np.zeros((n, dimension, dimension)) for _ in range(3))
    number = np.zeros(n)
    for ends in (i, j):  # both signs of r and of the change are the same products
        np.add.at(products, ends, change[:, :, None] * r[:, None, :])
        np.add.at(lengths, ends, r[:, :, None] * r[:, None, :])
        np.add.at(squares, ends, change[:, :, None] * change[:, None, :])
        np.add.at(number, ends, 1.0)
    strain = products @ np.linalg.pinv(lengths, rcond=1e-12, hermitian=True)
    explained = np.einsum("nab,nab->n", strain, products)
    rest = np.maximum(np.einsum("naa->n", squares) - explained, 0.0)
    with np.errstate(invalid="ignore"):
        return np.where(number > 0, rest / number, np.nan)
