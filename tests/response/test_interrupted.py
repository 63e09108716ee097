"""A sweep killed half-way: the same command continues, another one starts from the beginning."""

import numpy as np
import pytest
from launch import run
from samples import polydisperse, published

import jampetsc
from jampetsc.io.packing_file import write_packing

DIRECT = ("--method", "direct", "--omega", "1e-4:1:6")
RESONANT = ("--mass", "9", "--tangential-stiffness", "1", "--no-rotations", "--omega", "1e-1:10:6")
KELVIN_VOIGT = ("--beta", "0", "--no-prestress")  # everything is known after the first step, without vectors
KILLED = [  # packing, options, ranks, after how many steps, what is said
    (polydisperse(3)[0], (), 0, 1, "1 shifts"),
    (polydisperse(3)[0], (), 2, 1, "1 shifts"),
    (polydisperse(3)[0], ("--mass", "9", "--omega", "1e-4:1e2:20"), 0, 2, "2 shifts"),
    (polydisperse(3)[0], RESONANT, 0, 5, "5 shifts"),
    (polydisperse(3)[0], DIRECT, 2, 4, "4 frequencies"),
    (polydisperse(3)[0], DIRECT, 0, 2, "2 frequencies"),
    (published(), KELVIN_VOIGT, 0, 1, "1 shifts"),
]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """(packing, sweep) of these disks with these options, made once by one rank without a break: files."""
    made = {}

    def find(disks, options):
        key = disks.fingerprint, options
        if key not in made:
            folder = tmp_path_factory.mktemp("whole")
            write_packing(folder / "packing.h5", disks)
            made[key] = folder / "packing.h5", folder / "whole.h5"
            assert sweep(*made[key], options).returncode == 0
        return made[key]

    return find


def sweep(packing, out, options, ranks=0, steps=99):
    """A sweep that is killed after so many steps."""
    words = ("sweep", packing, "--out", out, "--accuracy", "1e-10", "--fields", "0.01", *options)
    return run(ranks, "run_with_disk_faults.py", "steps", steps, *words)


@pytest.mark.parametrize(("disks", "options", "ranks", "steps", "said"), KILLED)
def test_the_same_command_continues(tmp_path, whole, disks, options, ranks, steps, said):
    packing, unbroken = whole(disks, options)
    out = tmp_path / "sweep.h5"
    assert sweep(packing, out, options, ranks, steps).returncode != 0 and not out.exists()
    done = sweep(packing, out, options, ranks)
    assert done.returncode == 0, done.stderr
    assert f"continuing {out}.resume: {said} are finished" in done.stderr
    assert not list(tmp_path.glob("*.resume*"))
    one, other = (jampetsc.load(path) for path in (unbroken, out))
    alike = not ranks  # two ranks make two factors at a time
    np.testing.assert_allclose(other.G, one.G, rtol=1e-12 if alike else 1e-9)
    if alike:
        np.testing.assert_allclose(other["error_bound"], one["error_bound"], rtol=0.1)
        for name in ("factorisations", "vectors"):
            assert other.attributes.get(name) == one.attributes.get(name)
    exact = 1e-8 if options else 1e-4
    np.testing.assert_allclose(other["fields/displacement"], one["fields/displacement"], atol=exact)
    if options == KELVIN_VOIGT:
        assert other.attributes["vectors"] == 0
