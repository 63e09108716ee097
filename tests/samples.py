"""Packings that tests share: those of tests/data, and small lattices made for one property each."""

import json
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pytest
from dense import Reference

import jampetsc
from jampetsc.commands.sweep import Sweep
from jampetsc.io.packing_file import read_packing, write_packing
from jampetsc.io.reader import collected
from jampetsc.io.result_file import ResultWriter
from jampetsc.laws.damping import Law, Physics, damping_law, elastic_parameters
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import STIFFNESSES, Potential
from jampetsc.response.contact_network import build_network

DATA = Path(__file__).parent / "data"
JAMBASHBULK = DATA / "jambashbulk-N16-P1e-3-0001.txt"
JAXMD = DATA / "jaxmd-2d_polyuniform_N64_Lp-1.0.nc"
ORACLE = json.loads((DATA / "jambashbulk-N16-P1e-3-0001.json").read_text())


@dataclass
class Box:
    """A box with the attributes of other programs' boxes, such as freud.box.Box: tilts are ratios."""

    Lx: float
    Ly: float
    Lz: float = 0.0
    xy: float = 0.0
    xz: float = 0.0
    yz: float = 0.0
    periodic: tuple = (True, True, True)


@dataclass
class FlatBox(Box):
    """One that says its number of dimensions, and has a depth nevertheless, as HOOMD-blue's had."""

    Lz: float = 1.0
    dimensions: int = 2


def published(kind="harmonic", exponent=None):
    """The 16 bidisperse disks of jamBashbulk in their triclinic cell, p = 1e-3 for the harmonic potential."""
    rows = [line.split(",") for line in JAMBASHBULK.read_text().splitlines()[6:22]]
    table = np.array([[float(word) for word in row[:3]] for row in rows])
    cell = [(9.5393607291793076335, 0.0), (0.0630575654921525210, 9.5693366275464142399)]
    return Packing.from_positions(table[:, :2], table[:, 2], cell, Potential(kind, exponent=exponent))


def polydisperse(index=0):
    """One of jax-md's packings, 64 polydisperse disks in a square box at p ≈ 0.1, and its record."""
    with h5py.File(JAXMD) as file:
        record = {name: file[name][index] for name in ("pos", "rad", "box", "Energy", "Stress", "Cijkl")}
    cell = record["box"].reshape(2, 2)
    positions = record["pos"].reshape(-1, 2) @ cell
    return Packing.from_positions(
        positions, record["rad"], cell, Potential(stiffness="inverse-square-diameter")
    ), record


def isostatic():
    """24 disks at p = 1e-7, two of them rattlers; 43 contacts, one more than rigidity needs."""
    return read_packing(DATA / "isostatic-N24-p1e-7.h5")


def two_images():
    """16 disks in a cell only two disks wide and tilted: neighbours in a row touch on both sides."""
    rng = np.random.default_rng(1)
    row, column = np.divmod(np.arange(16), 2)
    positions = np.column_stack((column + 0.5 * row, 0.866 * row)) * 0.98 + rng.normal(0, 0.002, (16, 2))
    return Packing.from_positions(positions, np.full(16, 0.5), [(1.96, 0), (4.2, 8 * 0.866 * 0.98)])


def gears():
    """A slightly irregular square lattice, 6 × 4: bipartite, so that the disks turn like gears."""
    rng = np.random.default_rng(2)
    row, column = np.divmod(np.arange(24), 6)
    positions = np.column_stack((column, row)) * 0.98 + rng.normal(0, 0.003, (24, 2))
    return Packing.from_positions(
        positions, 0.5 + rng.uniform(-0.002, 0.002, 24), [(6 * 0.98, 0), (0.02, 4 * 0.98)]
    )


def strips():
    """Two strips of three columns each along a2 of a tilted cell, which do not touch, and one rattler."""
    rng = np.random.default_rng(3)
    a2 = np.array([2.0, 7.5])
    along = a2 / np.linalg.norm(a2)
    across = np.array([along[1], -along[0]])
    step = np.linalg.norm(a2) / 8
    column, place = np.divmod(np.arange(24), 8)
    strip = np.outer(column * 0.84, across) + np.outer((place + 0.5 * (column % 2)) * step, along)
    strip += rng.normal(0, 0.002, strip.shape)
    positions = np.vstack((strip, strip + np.array([4.5, 0]), [[2.9, 0.0]]))
    return Packing.from_positions(positions, np.full(49, 0.5), [(9.0, 0), a2])


def honeycomb():
    """A honeycomb of 8 disks, three contacts each: 12 contacts where 14 are needed."""
    a = 0.98
    unit = np.array([(0, 0), (0, a), (np.sqrt(0.75) * a, 1.5 * a), (np.sqrt(0.75) * a, 2.5 * a)])
    width, height = np.sqrt(3) * a, 3 * a
    return Packing.from_positions(
        np.vstack((unit, unit + np.array([width, 0]))), np.full(8, 0.5), [(2 * width, 0), (0, height)]
    )


def lattice(side=8, spacing=0.97):
    """A square lattice of equal disks under pressure, balanced but no minimum: 14 negative modes as it is."""
    row, column = np.divmod(np.arange(side**2), side)
    places = spacing * np.column_stack((column, row))
    return Packing.from_positions(places, np.full(side**2, 0.5), side * spacing * np.eye(2))


def crystal():
    """A perfect triangular lattice, 6 × 6: modes in clusters, and a shear moves every disk with the cell."""
    row, column = np.divmod(np.arange(36), 6)
    height = np.sqrt(0.75)
    places = 0.99 * np.column_stack((column + 0.5 * row, height * row))
    return Packing.from_positions(places, np.full(36, 0.5), 0.99 * np.array([(6, 0), (3, 6 * height)]))


def bridge(dimension=2):
    """A compressed crystal, in which a smaller particle only touches two others along x, opposite to each other."""
    shape = (6, 6) if dimension == 2 else (3, 3, 2)
    axes = 0.96 * (
        np.array([(1, 0), (0.5, np.sqrt(0.75))]) if dimension == 2 else np.diag((1, 1, np.sqrt(2)))
    )
    axes = axes * np.array((0.95, 1.05, 1.05)[:dimension])
    steps = np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), axis=1)
    places = steps @ axes
    if dimension == 3:
        places = np.concatenate((places, places + 0.5 * axes.sum(axis=0)))
    radii = np.full(len(places), 0.5)
    radii[0] = 0.44
    return Packing.from_positions(places, radii, axes * np.array(shape)[:, None])


def wide():
    """Radii 1 : 30 of a proved minimum, stiffnesses 1 : 900."""
    radii = np.r_[[15.0] * 4, [0.5] * 12]
    disks = jampetsc.pack(radii=radii, pressure=1e-3)
    return disks.replace(potential=Potential(k=3.0, stiffness="inverse-square-diameter"))


POTENTIALS = [
    Potential(None, stiffness, 1.7, exponent)
    for exponent in (2.0, 2.25, 2.5, 4.0)
    for stiffness in STIFFNESSES
]  # of which forces are compared with differences of energies and with compiled loops
SAMPLES = {
    "published": published,
    "k = 2.5": lambda: published().replace(potential=Potential(k=2.5)),
    "hertzian": lambda: published("hertzian"),
    "power": lambda: published("power", 2.25),
    "polydisperse": lambda: polydisperse(3)[0],
    "isostatic": isostatic,
    "two images": two_images,
    "gears": gears,
    "strips": strips,
}


def physics(*name, prestress=True, tangential_stiffness=0.0, **options):
    """Physics with the law of these options."""
    return Physics(damping_law(*name, **options), prestress, tangential_stiffness)


def put(path, disks, comm):
    """The path, where all ranks find a file of these disks. Collective."""
    if comm.rank == 0:
        write_packing(path, disks)
    comm.barrier()
    return path


def stored(path, kind, arrays, **attributes):
    """The path of a result file of this kind with these arrays and attributes; for None the result, in memory."""
    with ResultWriter(path, f"jampetsc-{kind}") as writer:
        for name, values in arrays.items():
            writer.dataset(name, values)
        writer.attributes(**attributes)
    return path or collected(writer)


def sweep_of(packing, physics, omega, fields=None, method="rational", accuracy=1e-6, **more):
    """The `Sweep` of a packing in memory or a file."""
    settings = {"omega": omega, "fields": fields or None, "method": method, "accuracy": accuracy, **more}
    elastic = elastic_parameters(physics.prestress, physics.tangential_stiffness)
    return Sweep(packing, physics.law, **elastic, **settings)


def network_of(disks, physics, comm):
    """The contact network of `disks`, linearised as `physics` has it. Collective."""
    return build_network(disks, comm, physics.prestress, physics.tangential_stiffness)


def pairs_of(network):
    """Contacts (i, j), i < j, of all ranks in their order. Collective."""
    c = network.contacts
    parts = network.comm.allgather(np.column_stack((c.i, c.j))[c.i < c.j].tolist())
    return sorted(tuple(pair) for part in parts for pair in part)


def among(network, pairs):
    """Which contacts of this rank belong to `pairs` of disks (i, j), seen from either end."""
    c, ends = network.contacts, {frozenset(pair) for pair in pairs}
    return np.array([frozenset(pair) in ends for pair in zip(c.i, c.j, strict=True)], bool)


def cut(network, pairs):
    """The network without the contacts of `pairs`."""
    return replace(network, contacts=network.contacts[~among(network, pairs)])


# dimension -> the packing of jax-md in tensor.json with its elastic constants and C*(ω), and the name of its file
TENSOR_TABLE = {
    row["D"]: row | {"file": name} for name, (row,) in json.loads((DATA / "tensor.json").read_text()).items()
}
TABLE_LAWS = {
    name: Physics(Law(name, **weights), prestress)
    for name, weights, prestress in (
        ("contact beta=1", dict(normal=1, sliding=1), True),
        ("contact beta=0.1", dict(normal=1, sliding=0.1), True),
        ("contact beta=1 no rotations", dict(normal=1, transverse=1), True),
        ("contact beta=1 no pre-stress", dict(normal=1, sliding=1), False),
        ("contact beta=0", dict(normal=1), True),
        ("stokes eta_f=1", dict(drag=1, eta_f=1), True),
    )
}


def table_tensor(dimension, law):
    """C* (M, C, C) of the table."""
    count = dimension * (dimension + 1) // 2
    return (np.array(TENSOR_TABLE[dimension]["laws"][law]["tensor"]) @ [1, 1j]).reshape(-1, count, count)


LAWS = {
    str(one): one
    for one in (
        physics(),
        physics(rotations=False),
        physics(prestress=False),
        physics(beta=0.0),
        physics(beta=1e-7),
        physics(beta=1e2, tau1=2.5),
        physics(normal=0.25, beta=3.0),
        physics(normal=0.0, rotations=False),  # Vågberg's CDt
        physics("stokes"),
        physics("stokes", prestress=False, eta_f=1e-5),
        physics("stokes", eta_f=0.0, tau1=0.3),
        physics("stokes", eta_f=0.7, tau1=0.3),
        physics("custom", normal=0.5, transverse=0.3, sliding=0.7, drag=0.2, eta_f=0.4),
        physics("custom", normal=0.5, sliding=0.7, spin_drag=0.3, tau1=2.5),
        physics("custom", normal=0.5, sliding=0.7, drag=0.2, spin_drag=1e-3, tangential_stiffness=0.4),
        physics("stokes", eta_f=0.0, tau1=0.3, tangential_stiffness=0.7),
        physics(beta=0.3, tau1=2.5, tangential_stiffness=0.4),
        physics(rotations=False, prestress=False, tangential_stiffness=2.0),
        physics("custom", spin_drag=0.3, tau1=0.3, tangential_stiffness=0.7),
    )
}


def laws_of(sample, ranks=1):
    """Names of the laws to try: all of them on the published packing, some on the others, and every fifth on ranks."""
    some = [physics(), physics("stokes")]
    if sample == "k = 2.5":  # where every unit shows
        return [str(one) for one in LAWS.values() if one.law.tau1 != 1.0]
    some += {
        "gears": [physics(prestress=False)],
        "two images": [physics(rotations=False)],
        "isostatic": [physics(normal=0.0, rotations=False)],
    }.get(sample, [])
    names = list(LAWS) if sample == "published" else [str(one) for one in some]
    return names if ranks == 1 else names[::5]


def on_ranks(values, several):
    """Values of a parameter, of which those not among `several` are tested on one rank: more would show the same."""
    one = pytest.mark.most_ranks(1)
    return [pytest.param(value, marks=() if value in several else one) for value in values]


@cache
def reference(sample, name):
    """The dense Reference of SAMPLES[sample] for LAWS[name], made once per process."""
    return Reference(SAMPLES[sample](), LAWS[name])


@cache
def modulus(sample, name, omega):
    """G*(ω) of that reference, complex."""
    return reference(sample, name).modulus(omega)


def errors_of(errors):
    """|ΔC|, |ΔC'| and |ΔC''|, (..., 3)."""
    return np.abs(np.stack((np.abs(errors), errors.real, errors.imag), axis=-1))


def sizes_of(C):
    """The largest |C|, |C'| and |C''| among the constants at each frequency, (M, 1, 1, 3)."""
    return errors_of(C).max(axis=(1, 2), keepdims=True)
