"""A packing from arrays, as simulations and other programs have them: centres, radii and a periodic box."""

import numpy as np

from jampetsc.errors import InputError
from jampetsc.packing.contacts import measure
from jampetsc.packing.disks import Disks
from jampetsc.packing.potentials import Potential

PLANE_TOLERANCE = 1e-8  # largest radii: spread of z within which centres lie in one plane


def Packing(positions, radii, box, potential="harmonic", stiffness="constant", k=1.0) -> Disks:
    """Soft disks from arrays, checked, for every function that takes a packing.

    positions   (N, 2) centres, in the box or out of it; (N, 3) where all z are the same
    radii       (N,)
    box         L, (Lx, Ly), (Lx, Ly, xy) with a₂ = (xy Ly, Ly), rows a₁ = (Lx, 0) and a₂ (2, 2), or an object with
                Lx, Ly and xy such as freud.box.Box; any tilt, periodic in x and y
    potential   harmonic or hertzian; stiffness: constant or inverse-square-diameter; k > 0, see `packing.potentials`

    Lengths are in any unit, p and moduli then in that of k. The record holds phi, pressure, energy and max_force as
    computed here. Raises InputError for wrong shapes, values not finite, radii ≤ 0, a box of no area or less wide
    than a disk, centres with different z, or two at one place.
    """
    positions, radii, k = _numbers("positions", positions), _numbers("radii", radii), _numbers("k", k)
    if positions.ndim == 2 and positions.shape[1] == 3:
        thickness = np.ptp(positions[:, 2]) if len(positions) else 0.0
        if not thickness <= PLANE_TOLERANCE * np.max(radii, initial=0.0):
            raise InputError(f"centres spread by {thickness:.6g} in z: packings are two-dimensional here")
        positions = positions[:, :2]
    if k.ndim:
        raise InputError(f"k of shape {k.shape}: must be one number")
    law = Potential(potential, stiffness, float(k))
    return measured(Disks.from_positions(positions, radii, cell_of(box), law))


def cell_of(box):
    """Rows a₁, a₂ of a periodic cell, (2, 2), of a box in one of the forms of `Packing`. Raises InputError."""
    if hasattr(box, "Lx"):
        if getattr(box, "dimensions", 2) != 2:
            raise InputError(f"box {box}: is three-dimensional: packings are two-dimensional here")
        if not all(np.atleast_1d(getattr(box, "periodic", True))[:2]):
            raise InputError(f"box {box}: must be periodic in x and y")
        box = (box.Lx, box.Ly, box.xy)
    box = _numbers("box", box)
    if box.shape == (2, 2):
        return box
    if box.ndim > 1 or not 1 <= box.size <= 3:
        raise InputError(f"box of shape {box.shape}: need L, (Lx, Ly), (Lx, Ly, xy) or rows a₁, a₂ (2, 2)")
    if not np.isfinite(box).all():
        raise InputError(f"box {box.tolist()}: must be finite")
    Lx, Ly, xy = np.append(box, (box.flat[0], 0.0) if box.size == 1 else (0.0,))[:3]
    return np.array([[Lx, 0.0], [xy * Ly, Ly]])


def measured(disks: Disks) -> Disks:
    """The same disks with phi, pressure, energy and max_force in the record. Raises InputError as `measure`."""
    state = measure(disks)
    return disks.with_record(
        pressure=state.pressure, energy=state.energy, phi=disks.phi, max_force=state.max_force
    )


def _numbers(name, values):
    """A copy of `values` as an array of floats. Raises InputError, which names them `name`."""
    try:
        if np.iscomplexobj(values) or np.ma.is_masked(values):
            raise TypeError
        return np.array(values, float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}: must be an array of real numbers, none of them masked") from None
