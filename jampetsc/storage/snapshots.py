"""Snapshots of a flow file as packings."""

from jampetsc.contacts.disks import Disks
from jampetsc.contacts.potentials import Potential
from jampetsc.errors import InputError


def snapshot(result, row=-1) -> Disks:
    """A snapshot of a flow file as a packing; its record has the number of disks of `walls`, if there are any.

    Raises InputError where the file holds none.
    """
    if "snapshots/positions" not in result:
        raise InputError(f"{result.path}: holds no snapshots: run `jampetsc flow` with --snapshots")
    a = result.attributes
    potential = Potential(str(a["potential"]), str(a["stiffness"]), float(a["k"]))
    positions, cell = (result.stored(f"snapshots/{name}")[row] for name in ("positions", "cell"))
    record = {"walls": int(a["walls"])} if "walls" in a else {}
    return Disks.from_positions(positions, result["state/radii"], cell, potential, record=record)
