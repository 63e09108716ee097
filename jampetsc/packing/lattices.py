"""Lattices of springs at rest, of nearest neighbours at a distance of one."""

from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError
from jampetsc.packing.neighbours import fractional
from jampetsc.packing.spring_network import Network

MIN_CELLS, MAX_CELLS = 2, 4096  # unit cells along a side: with one, a node would be joined to its image
HEIGHT = np.sqrt(0.75)  # of an equilateral triangle


@dataclass(frozen=True)
class Lattice:
    """A unit cell: rows of `vectors` (2, 2), places of its nodes in them, and bonds that begin in it.

    bonds   (node, node, steps along both vectors to the cell of the second one)
    """

    vectors: tuple
    nodes: tuple
    bonds: tuple


LATTICES = {
    "triangular": Lattice(
        ((1.0, 0.0), (0.5, HEIGHT)),
        ((0.0, 0.0),),
        ((0, 0, 1, 0), (0, 0, 0, 1), (0, 0, -1, 1)),
    ),
    "square": Lattice(((1.0, 0.0), (0.0, 1.0)), ((0.0, 0.0),), ((0, 0, 1, 0), (0, 0, 0, 1))),
    "kagome": Lattice(
        ((2.0, 0.0), (1.0, 2.0 * HEIGHT)),
        ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5)),
        ((0, 1, 0, 0), (0, 2, 0, 0), (1, 2, 0, 0), (1, 0, 1, 0), (2, 0, 0, 1), (1, 2, 1, -1)),
    ),
}


def build_lattice(kind: str, size) -> Network:
    """A lattice of springs k = 1 at rest, of `size` unit cells, (columns, rows), with the least tilt of its cell.

    The triangular lattice has G = (√3/4) k and the bulk modulus (√3/2) k exactly: all of its motion is affine. Raises
    InputError for an unknown kind, and for sizes out of range.
    """
    if kind not in LATTICES:
        raise InputError(f"lattice: {kind}, unknown. Choose one of {', '.join(LATTICES)}.")
    columns, rows = size
    if not all(MIN_CELLS <= side <= MAX_CELLS for side in size):
        raise InputError(
            f"size: {columns},{rows}, must lie between {MIN_CELLS} and {MAX_CELLS} unit cells along each side."
        )
    lattice = LATTICES[kind]
    vectors, nodes = np.array(lattice.vectors), np.array(lattice.nodes)
    a1, a2 = columns * vectors[0], rows * vectors[1]
    turns = round(a2[0] / a1[0])
    cell = np.array([a1, a2 - turns * a1])
    column, row = (index.ravel() for index in np.meshgrid(np.arange(columns), np.arange(rows)))
    places = np.stack((column, row), axis=-1)[:, None, :] + nodes  # in unit vectors
    positions = (places @ vectors).reshape(-1, 2)
    positions -= np.floor(fractional(positions, cell)) @ cell

    bonds, gaps = [], []
    for first, second, right, up in lattice.bonds:
        new_row, new_column = (row + up) % rows, (column + right) % columns
        start, end = row * columns + column, new_row * columns + new_column
        bonds.append(np.column_stack((start * len(nodes) + first, end * len(nodes) + second)))
        step = nodes[second] - nodes[first] + (right, up)
        gaps.append(np.broadcast_to(step @ vectors, bonds[-1].shape))
    bonds = np.concatenate(bonds)
    rest = np.concatenate(gaps) - (positions[bonds[:, 1]] - positions[bonds[:, 0]])
    images = np.rint(fractional(rest, cell))
    record = {"protocol": f"{kind} lattice of {columns} x {rows} unit cells"}
    return Network(positions, bonds, cell, images=images, record=record)
