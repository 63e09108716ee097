"""Frames for export to other programs: disks with scalars and vectors, and contacts with their forces."""

from dataclasses import dataclass, field

import numpy as np

from jampetsc.io.disk_motion import (
    chosen_frequencies,
    disk_rows,
    field_at,
    mode_vectors,
    particle_rows,
    snapshot,
    source_of,
)
from jampetsc.laws.loads import AXES, tensor_components
from jampetsc.packing.contacts import Contacts, assigned_volumes, disk_stresses, find_contacts, measure
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network

_ASSIGNED = {2: "area", 3: "volume"}


@dataclass(frozen=True, eq=False)
class Frame:
    """N disks inside their cell, its tilt at most half a side, and M contacts."""

    disks: Packing
    columns: dict  # name -> (N,) numbers or (N, D) vectors of the disks
    contacts: Contacts  # every overlap
    bearing: np.ndarray  # (M,) mask of contacts that bear load, between disks that are not rattlers
    facts: dict = field(default_factory=dict)  # name -> number for the whole frame

    @property
    def potential(self) -> dict:
        """`Potential.record`, from which `importers` computes the forces again, and the units where they are known."""
        units = {"units": self.disks.record["units"]} if "units" in self.disks.record else {}
        return self.disks.potential.record | units


@dataclass(frozen=True, eq=False)
class NetworkFrame:
    """Nodes and bonds of a network with vectors of the nodes."""

    network: Network
    columns: dict = field(default_factory=dict)  # name -> (N,) or (N, D)
    facts: dict = field(default_factory=dict)  # name -> number for the whole frame


def packing_frame(disks: Packing, vectors=None, facts=None) -> Frame:
    """A packing: radius, area, coordination, rattler and stress of every disk, then `vectors`, name -> (N, …).

    stress_xx, … are from `disk_stresses` with `area`, of spheres `volume`: Σ area · stress = V σ. Coordination
    counts the contacts that bear load. As the disks of a flow need not be at rest, theirs comes from the forces of
    contacts alone.
    """
    state, contacts = measure(disks), find_contacts(disks)
    bearing = state.bears(contacts)
    ends = np.concatenate((contacts.i[bearing], contacts.j[bearing]))
    stress = disk_stresses(disks, contacts)
    columns = {
        "radius": disks.radii,
        _ASSIGNED[disks.dimension]: assigned_volumes(disks),
        "coordination": np.bincount(ends, minlength=disks.n),
        "rattler": state.rattlers.astype(int),
        **{
            f"stress_{a}{b}": np.ascontiguousarray(stress[:, AXES.index(a), AXES.index(b)])
            for a, b in tensor_components(disks.dimension)
        },
        **(vectors or {}),
    }
    folded = disks.folded()
    if folded.images is not None:
        columns |= {"image": folded.images, "unwrapped": folded.unwrapped}
    return Frame(folded, columns, contacts, bearing, {"pressure": state.pressure, **(facts or {})})


def flow_frames(result):
    """The snapshots of a flow file, one after another, with `velocity`, that without the affine flow (γ̇y, 0), and
    `spin` where disks roll; `image`, the cells that a disk has crossed, and its `unwrapped` position.

    Raises InputError where the file holds none.
    """
    snapshot(result)
    for row in range(len(result.stored("snapshots/strain"))):
        disks = snapshot(result, row)
        vectors = {"velocity": disks.velocities} | ({} if disks.spins is None else {"spin": disks.spins})
        if "walls" in disks.record:
            vectors["wall"] = (np.arange(disks.n) < disks.record["walls"]).astype(int)
        yield packing_frame(disks, vectors, {"strain": float(disks.strain), "rate": disks.rate})


def mode_frame(result, number: int, packing=None) -> "Frame | NetworkFrame":
    """Mode `number`, from 1, of a modes file on its packing or network: `mode`, Σ|mode|² = 1. Raises InputError."""
    vectors = {"mode": mode_vectors(result, number)}
    source = source_of(result, packing)
    return _on_source(result, source, vectors, eigenvalue=float(result["eigenvalues"][number - 1]))


def slow_frame(result, packing=None) -> "Frame | NetworkFrame":
    """The response to a slow load per unit strain: `nonaffine` and, where disks roll, `rotation`. Raises InputError."""
    vectors = {name: result[name] for name in ("nonaffine", "rotation") if name in result}
    return _on_source(result, source_of(result, packing), vectors)


def field_frame(result, omega: float, packing=None) -> "Frame | NetworkFrame":
    """The field of a sweep at ω per unit strain, `displacement` and, where disks roll, `rotation`: …_real, …_imag.

    The real part is in phase with the strain. Raises InputError without a field at ω.
    """
    (row,) = chosen_frequencies(result, [omega])
    displacement, rotation = field_at(result, row)
    fields = {"displacement": displacement} | ({} if rotation is None else {"rotation": rotation})
    vectors = {
        f"{name}_{part}": getattr(value, part) for name, value in fields.items() for part in ("real", "imag")
    }
    source = source_of(result, packing)
    particle_rows(result, source)  # raises InputError if fields and packing do not fit
    return _on_source(result, source, vectors, omega=float(result.fields.omega[row]))


def _on_source(result, source, vectors, **facts):
    """A frame of the packing or network with vectors of the disks that bear load, zero for rattlers."""
    rows, whole = disk_rows(result, source), {}
    for name, values in vectors.items():
        whole[name] = np.zeros((source.n, *values.shape[1:]))
        whole[name][rows] = values
    if isinstance(source, Network):
        return NetworkFrame(source, whole, facts)
    return packing_frame(source, whole, facts)
