"""What `jampetsc export` writes, opened in the programs it is for; and what these write, imported.

ase and gsd come with run/test, ovito and vtk (ParaView's readers) with CI: the tests are of those that are installed.
"""

import importlib
import importlib.util
import inspect

import numpy as np
import pytest
import samples

import jampetsc
from jampetsc.io.exporters import write_frames
from jampetsc.io.frames import flow_frames, packing_frame
from jampetsc.packing.contacts import find_contacts, measure

SINGLE = 1e-4  # of a pressure of 1e-3 that single precision, or eight digits, leaves


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """(folder, packing, flow): p.* and flow.* in every format that is written without a package."""
    folder = tmp_path_factory.mktemp("exported")
    disks = samples.published()
    flow = jampetsc.flow(
        n=16, phi=0.9, model=jampetsc.models.CD(mass=1), rate=1e-2, strain=0.6, discard=0.3, snapshots=3
    )
    for ending in ("xyz", "dump", "data", "vtp", "npz"):
        write_frames(folder / f"p.{ending}", [packing_frame(disks)])
    for ending in ("xyz", "dump"):
        write_frames(folder / f"flow.{ending}", flow_frames(flow))
    if importlib.util.find_spec("gsd"):
        write_frames(folder / "p.gsd", [packing_frame(disks)])
        write_frames(folder / "flow.gsd", flow_frames(flow))
    return folder, disks, flow


def imported_alike(path, disks, index=0, within=1e-9, **law):
    """The packing in a file of another program has the pressure and the contacts of this one.

    law   of a file that does not have it
    """
    found, state = measure(jampetsc.import_packing(path, index, **law)), measure(disks)
    assert found.pressure == pytest.approx(state.pressure, rel=within), path.name
    assert len(found.contacts) == len(state.contacts), path.name


def same_lattice(places, disks, cell):
    """Whether places (N, 2 or 3) are those of the disks but for vectors of the cell."""
    shifts = (np.asarray(places)[:, :2] - disks.positions) @ np.linalg.inv(np.asarray(cell)[:2, :2])
    return np.allclose(shifts, shifts.round(), atol=1e-5)


def by_ase(folder, disks, flow):
    read = importlib.import_module("ase.io").read
    atoms = read(folder / "p.xyz")
    assert atoms.pbc.tolist() == [True, True, False] and same_lattice(atoms.positions, disks, atoms.cell)
    np.testing.assert_array_equal(atoms.arrays["radius"], disks.radii)
    np.testing.assert_array_equal(atoms.arrays["rattler"], measure(disks).rattlers)
    assert atoms.info["pressure"] == measure(disks).pressure
    for row, frame in enumerate(read(folder / "flow.xyz", index=":")):
        moment = flow.snapshot(row)
        assert frame.info["units"] == flow.attributes["units"]
        frame.write(folder / "moment.xyz", format="extxyz")
        imported_alike(folder / "moment.xyz", moment, within=SINGLE)  # of its own potential
        assert frame.info["strain"] == moment.strain
        np.testing.assert_array_equal(frame.arrays["velo"][:, :2], moment.velocities)
        np.testing.assert_array_equal(frame.arrays["unwrapped"][:, :2], moment.unwrapped)
    frames = read(folder / "flow.dump", index=":", format="lammps-dump-text")
    assert len(frames) == 3 and same_lattice(frames[2].positions, flow.snapshot(2), frames[2].cell)
    atoms.write(folder / "ase.xyz", format="extxyz")  # eight digits, as ase has them
    imported_alike(folder / "ase.xyz", disks, within=SINGLE)


def by_gsd(folder, disks, flow):
    opened = importlib.import_module("gsd.hoomd").open
    with opened(folder / "p.gsd") as file:
        frame, contacts = file[0], find_contacts(disks)
    assert frame.configuration.dimensions == 2 and frame.configuration.box[2] == 0.0
    np.testing.assert_allclose(frame.particles.diameter, 2 * disks.radii, rtol=1e-6)
    np.testing.assert_array_equal(frame.bonds.group, np.column_stack((contacts.i, contacts.j)))
    np.testing.assert_array_equal(frame.log["bonds/force"], contacts.force)
    with opened(folder / "flow.gsd") as file:
        assert len(file) == 3
        for row, frame in enumerate(file):
            moment = flow.snapshot(row)
            np.testing.assert_allclose(frame.particles.velocity[:, :2], moment.velocities, rtol=1e-6)
            np.testing.assert_array_equal(frame.log["particles/unwrapped"], moment.unwrapped)
            imported_alike(folder / "flow.gsd", moment, row, within=SINGLE)
        last = frame
    with opened(folder / "again.gsd", "w") as file:
        file.append(last)
    imported_alike(folder / "again.gsd", flow.snapshot(2), within=SINGLE)
    double = "precision" in inspect.signature(opened).parameters  # from gsd 5 on
    imported_alike(folder / "p.gsd", disks, within=1e-9 if double else SINGLE)
    assert_edited_box_is_read(opened, folder / "p.gsd", folder / "wide.gsd")


def assert_edited_box_is_read(opened, path, copy):
    """The box of a frame counts, not the one that its log still has, once another program has changed it."""
    with opened(path) as file:
        frame = file[0]
    frame.configuration.box = frame.configuration.box * [2, 2, 1, 1, 1, 1]
    with opened(copy, "w") as file:
        file.append(frame)
    np.testing.assert_allclose(
        jampetsc.import_packing(copy).cell, 2 * jampetsc.import_packing(path).cell, rtol=1e-6
    )


def by_ovito(folder, disks, flow):
    io = importlib.import_module("ovito.io")
    contacts = find_contacts(disks)
    for path in sorted(folder.glob("p.*")):
        if path.suffix in (".npz", ".vtp"):
            continue
        data = io.import_file(str(path)).compute()
        assert data.particles.count == disks.n and data.cell.pbc[:2] == (True, True)
        np.testing.assert_allclose(data.particles["Radius"], disks.radii, rtol=1e-6)
        places = data.particles.positions[...] - data.cell[:, 3]
        if path.suffix == ".gsd":  # its origin is the middle of the cell
            places = places[:, :2]
        assert same_lattice(places[:, :2], disks, data.cell[:2, :2].T), path.name
        if path.suffix in (".data", ".gsd"):
            assert data.particles.bonds.count == len(contacts)
    pipeline = io.import_file(str(folder / "flow.dump"))
    assert pipeline.source.num_frames == 3
    data = pipeline.compute(2)
    np.testing.assert_allclose(data.particles["Velocity"][:, :2], flow.snapshot(2).velocities, rtol=1e-12)
    np.testing.assert_array_equal(data.particles["Periodic Image"][:, :2], flow.snapshot(2).images)
    pipeline = io.import_file(str(folder / "p.xyz"))
    columns = ["Particle Identifier", "Particle Type", "Position.X", "Position.Y", "Position.Z", "Radius"]
    io.export_file(pipeline, str(folder / "ovito.dump"), "lammps/dump", columns=columns, precision=17)
    io.export_file(pipeline, str(folder / "ovito.data"), "lammps/data", atom_style="sphere", precision=17)
    io.export_file(pipeline, str(folder / "ovito.xyz"), "xyz", columns=columns, precision=17)
    for ending in ("dump", "data", "xyz"):
        imported_alike(folder / f"ovito.{ending}", disks, within=SINGLE, stiffness="constant", k=1.0)


def by_vtk(folder, disks, flow):
    reader = importlib.import_module("vtkmodules.vtkIOXML").vtkXMLPolyDataReader()
    numbers = importlib.import_module("vtkmodules.util.numpy_support").vtk_to_numpy
    reader.SetFileName(str(folder / "p.vtp"))
    reader.Update()
    read, contacts = reader.GetOutput(), find_contacts(disks)
    points, cell = numbers(read.GetPoints().GetData()), numbers(read.GetFieldData().GetArray("cell"))
    law = disks.potential
    assert read.GetFieldData().GetAbstractArray("stiffness").GetValue(0) == law.stiffness
    assert numbers(read.GetFieldData().GetArray("k"))[0] == law.k
    assert read.GetNumberOfLines() == len(contacts) and same_lattice(points[: disks.n], disks, cell)
    np.testing.assert_array_equal(numbers(read.GetCellData().GetArray("force")), contacts.force)
    radii = numbers(read.GetPointData().GetArray("radius"))
    ends = numbers(read.GetLines().GetConnectivityArray()).reshape(-1, 2)
    length = np.linalg.norm(np.diff(points[ends], axis=1)[:, 0], axis=1)
    np.testing.assert_allclose(radii[ends].sum(axis=1) - length, contacts.overlap, atol=1e-13)


PROGRAMS = {"ase": by_ase, "gsd": by_gsd, "ovito": by_ovito, "vtk": by_vtk}


@pytest.mark.parametrize("program", [name for name in PROGRAMS if importlib.util.find_spec(name)])
def test_exports_are_read_by(program, made):
    PROGRAMS[program](*made)
