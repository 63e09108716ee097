"""Networks of springs that tests share."""

import numpy as np

from jampetsc.packing.lattices import build_lattice
from jampetsc.packing.spring_network import Network

CELL = np.array([(5.0, 0.0), (1.3, 4.0)])


def random_springs(push=0.1, n=18, seed=4, radii=True):
    """A random network of unequal springs, which push by up to `push` k r and pull by as much, and two lone nodes."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(size=(n, 2)) @ CELL
    i, j = np.triu_indices(n - 2, 1)
    chosen = rng.permutation(len(i))[: 4 * n]
    bonds = np.column_stack((i, j))[chosen]
    images = rng.integers(-1, 2, size=bonds.shape)
    stiffness = rng.uniform(0.3, 3.0, len(bonds))
    length = np.hypot(*(places[bonds[:, 1]] - places[bonds[:, 0]] + images @ CELL).T)
    tension = push * rng.uniform(-1.0, 1.0, len(bonds)) * stiffness * length
    sizes = rng.uniform(0.3, 0.6, n) if radii else None
    return Network(places, bonds, CELL, stiffness, tension, images, sizes, k=2.5)


def pulling_springs():
    """A random network whose springs all pull, so that K is a sum of squares."""
    network = random_springs()
    return network.replace(tension=np.abs(network.tension))


def floppy_lattice(side=6, keep=0.45, seed=3):
    """A triangular lattice far below its rigidity threshold, 2/3."""
    return build_lattice("triangular", (side, side)).diluted(keep, seed)


def shuffled(network, seed=5):
    """The same network with its nodes, its bonds and their ends in another order, and its nodes in other images."""
    rng = np.random.default_rng(seed)
    order, rows = rng.permutation(network.n), rng.permutation(len(network.bonds))
    place = np.argsort(order)
    turned = rng.random(len(rows)) < 0.5
    shift = rng.integers(-2, 3, size=(network.n, 2))
    ends = network.bonds[rows]
    images = network.images[rows] - shift[ends[:, 1]] + shift[ends[:, 0]]
    bonds = place[ends]
    bonds[turned], images[turned] = bonds[turned][:, ::-1], -images[turned]
    return Network(
        (network.positions + shift @ network.cell)[order],
        bonds,
        network.cell,
        network.stiffness[rows],
        network.tension[rows],
        images,
        None if network.radii is None else network.radii[order],
        network.k,
    )
