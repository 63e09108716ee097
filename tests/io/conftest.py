"""Results of several ranks for the tests of this room."""

import shutil

import launch
import pytest


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """A folder with RANKS-SEED/s.h5, results of one mpirun."""
    folder = tmp_path_factory.mktemp("made")
    done = launch.run(4, "write_results.py", "several", folder, "1-1", "2-1", "3-1", "4-1", "3-2")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture
def joint(made, tmp_path):
    """A fresh copy, with its parts, of a result of three ranks."""
    shutil.copytree(made / "3-1", tmp_path / "copy")
    return tmp_path / "copy" / "s.h5"
