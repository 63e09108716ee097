"""The dense reference itself, in two and three dimensions, against elastic constants published with jax-md and moduli
of an independent program for the same packings (tests/data/README.md)."""

import h5py
import numpy as np
import pytest
from dense import Reference, symmetric_loads
from samples import DATA, TABLE_LAWS, TENSOR_TABLE, table_tensor

from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential


def published(row):
    """The packing, whose positions are fractions of the box."""
    D, i = row["D"], row["index"]
    with h5py.File(DATA / row["file"]) as h5:
        cell, radii = h5["box"][i].reshape(D, D), h5["rad"][i]
        positions = h5["pos"][i].reshape(-1, D) @ cell
    return Packing.from_positions(positions, radii, cell, Potential(stiffness="inverse-square-diameter"))


# in 3D a solve costs a second: one law with spins, one with drag, at one frequency
CASES = [(2, law) for law in TABLE_LAWS] + [(3, "contact beta=0.1"), (3, "stokes eta_f=1")]


@pytest.mark.parametrize("dimension, law", CASES)
def test_moduli_of_published_packings(dimension, law):
    row, table = TENSOR_TABLE[dimension], table_tensor(dimension, law)
    loads = symmetric_loads(row["D"])
    simple = np.zeros((1, row["D"], row["D"]))
    simple[0, 0, 1] = 1
    reference = Reference(published(row), TABLE_LAWS[law], np.concatenate((loads, simple)))
    assert float(reference.energy) == pytest.approx(row["energy"], rel=1e-13)
    assert reference.stress.astype(float) == pytest.approx(np.array(row["stress"]), abs=1e-14)
    for number, w in enumerate(row["omega"]):
        if dimension == 3 and w != 0.01:
            continue
        expected, found = table[number], reference.tensor(w).astype(complex)
        assert found[:-1, :-1] == pytest.approx(expected, abs=1e-13 * np.abs(expected).max())
        shear = complex(*row["laws"][law]["shear"][number])
        assert found[-1, -1] == pytest.approx(shear, rel=1e-12)
        assert reference.modulus(w, load=len(loads)) == pytest.approx(shear, rel=1e-12)
