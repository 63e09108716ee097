"""Lattices of springs at rest, of nearest neighbours at a distance of one."""

import itertools
from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.packing.neighbours import fractional, upright
from jampetsc.packing.spring_network import Network

MIN_CELLS, MAX_CELLS = 2, 4096  # unit cells along a side: with one, a node would be joined to its image
HEIGHT = np.sqrt(0.75)  # of an equilateral triangle


@dataclass(frozen=True)
class Lattice:
    """A unit cell: rows of `vectors` (D, D), places of its nodes in them, and bonds that begin in it.

    bonds   (node, node, steps along all vectors to the cell of the second one)
    """

    vectors: tuple
    nodes: tuple
    bonds: tuple


FACES = ((0.0, 0.0, 0.0), (0.5, 0.5, 0.0), (0.5, 0.0, 0.5), (0.0, 0.5, 0.5))  # nodes of a face-centred cube


def _bonds_of_faces():
    """Bonds of the face-centred cubic lattice: to the 12 nearest nodes, each of them once."""
    bonds = []
    for first, second in itertools.combinations(range(len(FACES)), 2):
        gap = np.subtract(FACES[second], FACES[first])
        # along an axis without a gap nodes lie in one plane, along the others half a cell before or behind
        steps = [(0,) if side == 0.0 else (0, -int(np.sign(side))) for side in gap]
        bonds += [(first, second, *step) for step in itertools.product(*steps)]
    return tuple(bonds)


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
    "cubic": Lattice(
        tuple(map(tuple, np.eye(3))), ((0.0, 0.0, 0.0),), ((0, 0, 1, 0, 0), (0, 0, 0, 1, 0), (0, 0, 0, 0, 1))
    ),
    "fcc": Lattice(tuple(map(tuple, np.sqrt(2.0) * np.eye(3))), FACES, _bonds_of_faces()),
}


def build_lattice(kind: str, size) -> Network:
    """A lattice of springs k = 1 at rest, of `size` unit cells, D numbers, with the least tilt of its cell.

    The triangular lattice has G = (√3/4) k and the bulk modulus (√3/2) k exactly, the face-centred cubic one the
    constants C_xxxx = √2 k and C_xxyy = C_xyxy = k/√2 for bonds of length one: all of their motion is affine. Raises
    InputError for an unknown kind, and for sizes out of range.
    """
    if kind not in LATTICES:
        raise InputError(f"{named('lattice')} {kind}: unknown. Choose one of {', '.join(LATTICES)}.")
    lattice = LATTICES[kind]
    vectors, nodes = np.array(lattice.vectors), np.array(lattice.nodes)
    if len(size) != len(vectors):
        raise InputError(
            f"{named('size')} {_listed(size)}: must be {len(vectors)} numbers of unit cells of this lattice."
        )
    if not all(MIN_CELLS <= side <= MAX_CELLS for side in size):
        raise InputError(
            f"{named('size')} {_listed(size)}: must lie between {MIN_CELLS} and {MAX_CELLS} unit cells along each side."
        )
    cell = upright(np.array(size)[:, None] * vectors)[0]
    unit_cells = np.indices(size[::-1]).reshape(len(size), -1)[::-1].T  # the first axis runs fastest
    strides = np.cumprod([1, *size[:-1]])
    places = unit_cells[:, None, :] + nodes  # in unit vectors
    positions = (places @ vectors).reshape(-1, len(vectors))
    positions -= np.floor(fractional(positions, cell)) @ cell

    bonds, gaps = [], []
    for first, second, *steps in lattice.bonds:
        ends = unit_cells @ strides, ((unit_cells + steps) % size) @ strides
        bonds.append(
            np.column_stack(
                [end * len(nodes) + node for end, node in zip(ends, (first, second), strict=True)]
            )
        )
        step = nodes[second] - nodes[first] + steps
        gaps.append(np.broadcast_to(step @ vectors, (len(unit_cells), len(vectors))))
    bonds = np.concatenate(bonds)
    rest = np.concatenate(gaps) - (positions[bonds[:, 1]] - positions[bonds[:, 0]])
    images = np.rint(fractional(rest, cell))
    record = {"protocol": f"{kind} lattice of {' x '.join(map(str, size))} unit cells"}
    return Network(positions, bonds, cell, images=images, record=record, dimension=len(cell))


def _listed(size):
    return ",".join(map(str, size))
