"""Snapshots of a flow file as packings that move."""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.packing.disks import Disks
from jampetsc.packing.potentials import Potential


@dataclass(frozen=True, eq=False)
class Snapshot(Disks):
    """Disks of a flow at one moment, for everything that takes a packing."""

    strain: float = 0.0  # γ since the start
    rate: float = 0.0  # γ̇
    velocities: np.ndarray | None = None  # (N, 2) without the affine flow (γ̇ y, 0)
    spins: np.ndarray | None = None  # (N,) angular velocities, if disks roll; that of the affine flow is −γ̇/2


def snapshot(result, row=-1) -> Snapshot:
    """A snapshot of a flow, the last one if no other is asked for, as a packing with `velocities`, `spins` and
    `unwrapped`; its record has `units`, and the number of disks of `walls`, if there are any.

    Raises InputError where the file holds none, or not so many.
    """
    if "snapshots/positions" not in result:
        raise InputError(f"{result.path}: holds no snapshots: run a flow with {named('snapshots')}")
    count = len(result.stored("snapshots/positions"))
    if not -count <= row < count:
        raise InputError(f"{result.path}: snapshot {row}: it holds {count}, from 0")
    a = result.attributes
    potential = Potential(str(a["potential"]), str(a["stiffness"]), float(a["k"]))
    names = ("positions", "cell", "velocities", "strain", "images", "spins")
    kept = {name: result.stored(f"snapshots/{name}")[row] for name in names if f"snapshots/{name}" in result}
    radii = result.get("snapshots/radii")
    radii = result["state/radii"] if radii is None else radii  # where older files have them
    record = {name: convert(a[name]) for name, convert in (("walls", int), ("units", str)) if name in a}
    disks = Snapshot.from_positions(kept.pop("positions"), radii, kept.pop("cell"), potential, record=record)
    return replace(disks, rate=float(a["rate"]), **kept)
