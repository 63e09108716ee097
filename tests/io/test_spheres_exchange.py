"""Packings and networks in three dimensions in the formats of other programs."""

import numpy as np
import pytest
from spheres import JAXMD, bidisperse, few_spheres
from test_export import vtp

import jampetsc
from jampetsc.io.exchange import READERS
from jampetsc.io.network_importers import import_network
from jampetsc.packing.contacts import find_contacts, measure
from jampetsc.packing.spring_network import Network


@pytest.mark.parametrize("ending", ["xyz", "dump", "data", "npz", "gsd"])
def test_a_packing_comes_back_as_it_was(tmp_path, ending):
    """Cell, radii, forces: to the last digits of a double."""
    if ending == "gsd":
        pytest.importorskip("gsd", reason="the package gsd is optional")
    disks, path = few_spheres(kind="hertzian"), tmp_path / f"p.{ending}"
    jampetsc.export(disks, out=path)
    again, folded = jampetsc.import_packing(path), disks.folded()
    assert (again.dimension, again.potential) == (3, disks.potential) and "assumed" not in again.record
    np.testing.assert_allclose(again.cell, folded.cell, rtol=1e-15, atol=1e-15)
    np.testing.assert_allclose(again.radii, disks.radii, rtol=1e-15)
    near = 1e-6 if ending == "gsd" else 1e-12  # older gsd holds single precision
    np.testing.assert_allclose(again.stress, disks.stress, rtol=near, atol=near * disks.pressure)
    np.testing.assert_array_equal(again.rattlers, disks.rattlers)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_motion_and_contacts_have_three_components(session, tmp_path):
    disks = few_spheres()
    modes = jampetsc.modes(disks, count=5)
    jampetsc.export(modes, mode=2, packing=disks, out=tmp_path / "m.dump")
    columns = READERS["lammps-dump"]((tmp_path / "m.dump").read_bytes(), 0).columns
    found = np.array([columns[f"mode_{axis}"] for axis in "xyz"], float).T
    np.testing.assert_array_equal(found[modes["particles"]], modes["modes"][1])
    volume, normal = (np.array(columns[name], float) for name in ("volume", "stress_zz"))
    assert normal @ volume / disks.volume == pytest.approx(disks.stress[2, 2], rel=1e-12)
    jampetsc.export(disks, out=tmp_path / "p.vtp")
    arrays, contacts = vtp(tmp_path / "p.vtp"), find_contacts(disks)
    i, j = arrays["connectivity"].reshape(-1, 2).T
    ends = arrays["points"][j] - arrays["points"][i]
    np.testing.assert_allclose(np.linalg.norm(ends, axis=1), contacts.distance, rtol=1e-12)
    np.testing.assert_allclose(arrays["cell"], disks.folded().cell)


@pytest.mark.parametrize("ending", ["data", "npz"])
def test_a_network_comes_back_as_it_was(tmp_path, ending):
    network, path = Network.of_packing(few_spheres()), tmp_path / f"n.{ending}"
    jampetsc.export(network, out=path)
    again = import_network(path)
    assert again.dimension == 3
    for name in ("pressure", "stress", "stiffness", "radii"):
        np.testing.assert_allclose(getattr(again, name), getattr(network, name), rtol=1e-9, atol=1e-14)


def test_the_published_packings_of_jaxmd():
    packing = jampetsc.import_packing(JAXMD, 3)
    expected, record = bidisperse(3)
    np.testing.assert_array_equal(packing.positions, expected.positions)
    assert packing.record["published_stress_yz"] == record["Stress"][5]
    assert packing.record["published_C_xyxz"] == record["Cijkl"][20]
    assert packing.record["published_pressure"] == pytest.approx(measure(packing).pressure, rel=1e-7)
