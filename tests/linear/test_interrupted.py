"""A sweep killed half-way: the same command continues, another one starts from the beginning."""

import re
from dataclasses import replace

import numpy as np
import pytest
from launch import run
from samples import physics, polydisperse, published, run_of

import jampetsc
from jampetsc.analysis.equivalent_damping import EquivalentDamping
from jampetsc.io.packing_file import write_packing


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    path = tmp_path_factory.mktemp("packing") / "packing.h5"
    write_packing(path, polydisperse(3)[0])
    return path


@pytest.fixture(scope="module")
def whole(packing):
    """The sweep of one process that nothing has interrupted."""
    out = packing.with_name("whole.h5")
    assert sweep(0, 99, packing, out).returncode == 0
    return jampetsc.load(out)


def sweep(ranks, count, packing, out, *more):
    """The sweep, killed after `count` steps; stderr."""
    words = ("sweep", packing, "--out", out, "--accuracy", "1e-10", "--fields", "0.01", *more)
    return run(ranks, "run_interrupted.py", count, *words)


@pytest.mark.parametrize("ranks", [0, 2])
def test_the_same_command_continues(packing, whole, tmp_path, ranks):
    out = tmp_path / "sweep.h5"
    assert sweep(ranks, 1, packing, out).returncode != 0
    assert not out.exists()
    done = sweep(ranks, 99, packing, out)
    assert done.returncode == 0, done.stderr
    assert f"continuing {out}.resume: 1 shifts are finished" in done.stderr
    assert not list(tmp_path.glob("sweep.h5.resume*"))
    results = [whole, jampetsc.load(out)]
    np.testing.assert_allclose(results[1].G, results[0].G, rtol=1e-9)
    np.testing.assert_allclose(*(result["fields/displacement"] for result in results), atol=1e-4)
    # what was lost is a factor: the first of the new ones stands where the last of the old ones was
    vectors = [int(n) for n in re.findall(r"vectors (\d+)", done.stderr)]
    assert vectors[0] > 4
    factorisations = [result.attributes["factorisations"] for result in results]
    assert factorisations[1] <= factorisations[0] + max(ranks, 1)


def test_the_direct_method_continues(packing, tmp_path):
    out, whole = tmp_path / "sweep.h5", tmp_path / "whole.h5"
    direct = ("--method", "direct", "--omega", "1e-4:1:6")
    assert sweep(0, 99, packing, whole, *direct).returncode == 0
    assert sweep(2, 4, packing, out, *direct).returncode != 0
    done = sweep(2, 99, packing, out, *direct)
    assert done.returncode == 0, done.stderr
    assert f"continuing {out}.resume: 4 frequencies are finished" in done.stderr
    assert not list(tmp_path.glob("*.resume*"))
    results = [jampetsc.load(path) for path in (whole, out)]
    np.testing.assert_allclose(results[1].G, results[0].G, rtol=1e-10)
    np.testing.assert_allclose(*(result["fields/displacement"] for result in results), atol=1e-8)


def test_everything_that_decides_a_sweep_identifies_its_checkpoint():
    """So that no other is gone on with (tests/io/test_checkpoint.py)."""
    omega = np.array([0.1, 1.0])
    job = run_of(published(), physics(), omega, [1.0])
    others = [
        {"identity": (job.identity[0], "another")},
        {"physics": physics(beta=0.5)},
        {"physics": physics(prestress=False)},
        {"damping": EquivalentDamping(0.5, 1e-5)},
        {"omega": 2.0 * omega},
        {"field_omega": omega},
        {"method": "direct"},
        {"accuracy": 1e-3},
    ]
    keys = [job.key(1), job.key(2), *(replace(job, **other).key(1) for other in others)]
    assert len(set(map(str, keys))) == len(keys) and str(replace(job, started=0.0).key(1)) == str(keys[0])


def test_a_sweep_without_vectors_continues(tmp_path):
    """β = 0 without pre-stress: everything is known after the first step."""
    packing, out = tmp_path / "packing.h5", tmp_path / "sweep.h5"
    kelvin_voigt = ("--beta", "0", "--no-prestress")
    write_packing(packing, published())
    assert sweep(0, 1, packing, out, *kelvin_voigt).returncode != 0
    done = sweep(0, 99, packing, out, *kelvin_voigt)
    assert done.returncode == 0, done.stderr
    assert "continuing" in done.stderr
    assert jampetsc.load(out).attributes["vectors"] == 0
