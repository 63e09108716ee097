"""Pictures of steady shear, drawn from real runs through the command line."""

import numpy as np
import pytest

import jampetsc
from jampetsc import cli
from jampetsc.contacts.state import find_contacts
from jampetsc.plots.shearing import flow_curves, last_snapshot, local_exponents


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flow")
    paths = []
    for rate, seed in [("1e-2", 1), ("1e-2", 2), ("3e-2", 1)]:
        path = folder / f"{rate}-{seed}.h5"
        words = f"flow --n 64 --phi 0.86 --model RD0 --rate {rate} --seed {seed} --strain 0.5 --snapshots 2"
        assert cli.main([*words.split(), "--out", str(path)]) == 0
        paths.append(str(path))
    return paths


@pytest.mark.parametrize(
    "files, more, says",
    [
        (slice(0, 1), (), "stress and pressure of 1 run over the strain"),
        (slice(0, 2), (), "stress and pressure of 2 runs"),
        (slice(0, 3), (), "flow curves of 3 runs at 2 rates"),
        (slice(0, 1), ("--kind", "snapshot"), "64 disks at strain 0.5"),
        (slice(0, 1), ("--kind", "velocities"), "velocities at strain 0.5"),
    ],
)
def test_pictures(runs, tmp_path, capsys, files, more, says):
    out = tmp_path / "picture.png"
    assert cli.main(["plot", *runs[files], *more, "--out", str(out)]) == 0
    assert says in capsys.readouterr().out
    assert out.stat().st_size > 10_000


def test_lanes(runs, tmp_path, capsys):
    g, out = tmp_path / "g.h5", tmp_path / "g.svg"
    assert cli.main(["correlate", *runs[:2], "--out", str(g)]) == 0
    assert cli.main(["plot", str(g), "--out", str(out)]) == 0
    assert "g_y of 1 file" in capsys.readouterr().out and out.exists()


def test_curves_average_seeds(runs):
    results = [jampetsc.load(path) for path in runs]
    ((_, curve),) = flow_curves(results).items()
    rates, pressure, error = curve["pressure"]
    means = [float(r.attributes["pressure_mean"]) for r in results]
    assert np.allclose(rates, [1e-2, 3e-2])
    assert np.allclose(pressure, [np.mean(means[:2]), means[2]])
    assert error[0] >= abs(means[0] - means[1]) / 2 * (1 - 1e-12)
    middle, exponent = local_exponents(np.array([1e-3, 1e-2, 1e-1]), np.array([1.0, 10.0, 1000.0]))
    assert np.allclose(exponent, [1, 2]) and np.allclose(middle, 10 ** np.array([-2.5, -1.5]))


def test_the_last_snapshot_is_the_last_state(runs):
    result = jampetsc.load(runs[0])
    disks = last_snapshot(result)
    assert len(find_contacts(disks)) * 2 / disks.n == result["coordination"][-1]


def test_what_cannot_be_drawn(runs, tmp_path, capsys):
    plain = tmp_path / "plain.h5"
    words = "flow --n 64 --phi 0.86 --model RD0 --rate 1e-1 --strain 0.2 --out"
    assert cli.main([*words.split(), str(plain)]) == 0
    for files, more, message in [
        ([plain], ["--kind", "snapshot"], "holds no snapshots"),
        (runs[:2], ["--kind", "velocities"], "plot them one by one"),
        ([*runs[:1]], ["--kind", "moduli"], "is a flow file"),
    ]:
        assert cli.main(["plot", *map(str, files), *more, "--out", str(tmp_path / "x.png")]) == 2
        assert message in capsys.readouterr().err
