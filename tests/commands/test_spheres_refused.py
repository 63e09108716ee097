"""What is of disks in a plane says so of packings and networks in three dimensions, in one line."""

import pytest
from spheres import few_spheres

import jampetsc
from jampetsc import main
from jampetsc.errors import InputError
from jampetsc.io.packing_file import write_network
from jampetsc.packing.spring_network import Network


def test_a_network_is_not_drawn(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_network("n.h5", Network.of_packing(few_spheres()))
    before = set(tmp_path.iterdir())
    assert main.main(["plot", "n.h5", "--out", "n.png"]) == 2
    line = capsys.readouterr().err.strip()
    says = "the network: three-dimensional. Draw it in OVITO or ParaView: jampetsc export"
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
