"""Networks in files: written and read to the last bit, from and for other programs, and as commands say them."""

import numpy as np
import pytest
from springs import floppy_lattice, pulling_springs, random_springs

import jampetsc
from jampetsc import main
from jampetsc.errors import InputError
from jampetsc.io.exporters import write_network_export
from jampetsc.io.frames import NetworkFrame
from jampetsc.io.network_importers import import_network
from jampetsc.io.packing_file import NETWORK_ARRAYS, write_network

NETWORKS = {"springs": random_springs, "lattice": floppy_lattice, "pulling": pulling_springs}


@pytest.mark.parametrize("name", NETWORKS)
def test_a_file_holds_a_network_to_the_last_bit(tmp_path, name):
    network = NETWORKS[name]().with_record(protocol="test", keep=0.5)
    write_network(tmp_path / "n.h5", network)
    again = jampetsc.load(tmp_path / "n.h5")
    for key in (*NETWORK_ARRAYS, "radii"):
        np.testing.assert_array_equal(getattr(again, key), getattr(network, key))
    assert (again.fingerprint, again.record, again.k) == (network.fingerprint, network.record, network.k)


@pytest.mark.parametrize("ending", ["npz", "data"])
@pytest.mark.parametrize("name", ["lattice", "springs"])
def test_export_and_import(tmp_path, name, ending):
    network = NETWORKS[name]()
    out = tmp_path / f"n.{ending}"
    write_network_export(out, NetworkFrame(network))
    if ending == "data" and name == "springs":  # its images are not the nearest
        with pytest.raises(AssertionError):
            np.testing.assert_array_equal(import_network(out).images, network.images)
        return
    again = import_network(out)
    for key in ("bonds", "stiffness", "tension", "cell"):
        np.testing.assert_allclose(getattr(again, key), getattr(network, key), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(again.linear_bonds.r, network.linear_bonds.r, rtol=1e-12, atol=1e-14)
    assert (again.radii is None) == (network.radii is None)
    if ending == "npz":
        assert again.fingerprint == network.fingerprint


LAMMPS = """LAMMPS

3 atoms
2 bonds
1 atom types
2 bond types

0 4 xlo xhi
0 5 ylo yhi
-.5 .5 zlo zhi

Bond Coeffs # harmonic

1 0.5 1.0
2 1.5 0.75  # K r0

Atoms # bond

30 1 1 0 0 0
10 1 1 3.5 0 0
20 1 1 3.5 1 0

Bonds

1 1 30 10
2 2 10 20
"""


def test_lammps_bonds_lead_to_the_nearest_image(tmp_path):
    """E = K (r − r₀)²: k = 2K, and the tension 2K (r − r₀) pulls where r > r₀."""
    (tmp_path / "gel.data").write_text(LAMMPS)
    network = import_network(tmp_path / "gel.data")
    np.testing.assert_array_equal(network.bonds, [(2, 0), (0, 1)])
    np.testing.assert_allclose(network.linear_bonds.r, [(-0.5, 0.0), (0.0, 1.0)])
    np.testing.assert_allclose(network.stiffness, [1.0, 3.0])
    np.testing.assert_allclose(network.tension, [-0.5, 0.75])
    assert network.radii is None and "assumed" not in network.record


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("2 2 10 20", "2 2 10 21", "Bonds: atom 21 is not among Atoms. Correct the number."),
        ("2 2 10 20", "2 3 10 20", "Bond Coeffs: no line for bond type 3. Add K and r0 of it."),
        ("# harmonic", "# fene", "Bond Coeffs # fene: not supported, only harmonic"),
        ("2 2 10 20", "2 2 10", "Bonds: line '2 2 10', must have 4 numbers."),
        ("2 2 10 20", "2 2 10 x", "x: not numbers"),
        ("Bonds\n\n1 1 30 10\n2 2 10 20\n", "", "no section Bonds"),
        ("2 1.5 0.75", "2 -1.5 0.75", "stiffness[1]: -3, must be positive"),
        ("2 2 10 20", "2 2 10 10", "bond 1, of nodes 0 and 0: joins a node to itself"),
    ],
)
def test_damaged_lammps_files(tmp_path, capsys, old, new, says):
    assert old in LAMMPS
    (tmp_path / "gel.data").write_text(LAMMPS.replace(old, new))
    line = refused(
        capsys, "import", tmp_path / "gel.data", "--bonds", tmp_path / "gel.data", "--out", tmp_path / "n.h5"
    )
    assert "gel.data: " in line and says in line and not (tmp_path / "n.h5").exists()


def refused(capsys, *words):
    """The line on stderr of a command that ends with an error of the user's."""
    assert main.main([*map(str, words)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def test_texts_of_nodes_and_bonds(tmp_path):
    (tmp_path / "nodes.txt").write_text("# box 5 4 2\n0 0\n4.5 0.0\n4.5 1.0\n")
    for line, stiffness, tension in (("0 1\n2 1", 1.0, 0.0), ("0,1,2,-1\n2,1,2,-1", 2.0, -1.0)):
        (tmp_path / "bonds.txt").write_text(f"# nodes k T\n{line}\n")
        network = import_network(tmp_path / "nodes.txt", tmp_path / "bonds.txt", k=2.0)
        np.testing.assert_allclose(network.linear_bonds.r, [(-0.5, 0.0), (0.0, -1.0)])
        np.testing.assert_array_equal(
            (network.stiffness, network.tension), [(stiffness,) * 2, (tension,) * 2]
        )
        assert network.record.get("assumed") == ("stiffness, tension" if tension == 0.0 else None)
        np.testing.assert_allclose(network.cell, [(5.0, 0.0), (2.0, 4.0)])
        assert network.k == 2.0


def test_commands_make_and_describe_networks(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main.main("springs --lattice triangular --size 6,4 --keep 0.5 --seed 2 --out n.h5".split()) == 0
    made = capsys.readouterr().out
    assert (
        "n.h5: network of 24 nodes and 36 bonds" in made and "triangular lattice of 6 x 4 unit cells" in made
    )
    assert main.main(["info", "n.h5"]) == 0
    assert capsys.readouterr().out == made
    network = jampetsc.springs(lattice="triangular", size=(6, 4), keep=0.5, seed=2)
    assert network.fingerprint == jampetsc.load("n.h5").fingerprint
    assert main.main("springs n.h5 --keep 0.5 --out half.h5".split()) == 0
    assert len(jampetsc.load("half.h5").bonds) == 18
    for words in (
        "export n.h5 --out n.vtp",
        "plot n.h5 --out n.png",
        "plot half.h5 --kind network --out h.svg",
    ):
        assert main.main(words.split()) == 0


def test_a_network_without_an_array_is_refused(tmp_path):
    import h5py

    write_network(tmp_path / "n.h5", random_springs())
    with h5py.File(tmp_path / "n.h5") as whole, h5py.File(tmp_path / "less.h5", "w") as less:
        less.attrs.update(whole.attrs)
        for name in NETWORK_ARRAYS[:-1]:
            less[name] = whole[name][()]
    with pytest.raises(InputError, match=r"less\.h5: "):
        jampetsc.load(tmp_path / "less.h5")
