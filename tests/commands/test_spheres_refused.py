"""What is of disks in a plane says so of packings and networks in three dimensions, in one line."""

import pytest
from spheres import few_spheres

import jampetsc
from jampetsc import main
from jampetsc.errors import InputError
from jampetsc.io.packing_file import write_network, write_packing
from jampetsc.packing.spring_network import Network


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            "plot p.h5 --out p.png",
            "the packing: three-dimensional. Draw it in OVITO or ParaView: jampetsc export",
        ),
        ("plot n.h5 --out n.png", "the network: three-dimensional. Draw it in OVITO"),
    ],
)
def test_commands_of_a_plane(tmp_path, monkeypatch, capsys, words, says):
    monkeypatch.chdir(tmp_path)
    write_packing("p.h5", few_spheres())
    write_network("n.h5", Network.of_packing(few_spheres()))
    before = set(tmp_path.iterdir())
    assert main.main(words.split()) == 2
    line = capsys.readouterr().err.strip()
    assert line.startswith(f"jampetsc: error: {says}") and "\n" not in line
    assert set(tmp_path.iterdir()) == before


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_fields_and_oscillations(session):
    disks = few_spheres()
    sweep = jampetsc.sweep(disks, omega=[1.0], fields=[1.0])
    for draw in (
        lambda: jampetsc.plot(sweep, "fields", packing=disks),
        lambda: jampetsc.plot(jampetsc.quasistatic(disks), "response"),
        lambda: jampetsc.oscillate(disks, omega=[1.0], stress=[1e-6]),
    ):
        with pytest.raises(InputError, match="three-dimensional"):
            draw()
