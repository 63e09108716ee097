"""Distributions of disk sizes, all of mean diameter 1."""

import numpy as np

SIZES = ("bidisperse", "monodisperse")
RATIO = 1.4  # of the two radii


def radii_of(sizes: str, n: int):
    """N radii of mean diameter 1 (N,): `bidisperse` is half 0.5/1.2 and half 0.7/1.2, in turn."""
    if sizes == "monodisperse":
        return np.full(n, 0.5)
    small = 1.0 / (1.0 + RATIO)
    return np.where(np.arange(n) % 2 == 0, small, RATIO * small)


def in_small_diameters(radii):
    """The radii (N,) in units of the smallest diameter, as Vågberg has them."""
    return radii * (0.5 / radii.min())
