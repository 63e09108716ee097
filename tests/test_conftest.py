"""The agreement between ranks that tests on PETSc rely on: a failure on one rank is never lost."""

import os
import subprocess
import sys
from pathlib import Path

import launch
import pytest

TESTS = """
import pytest

@pytest.mark.scalar("real")
def test_fine(session, shared_path):
    (shared_path / str(session.rank)).touch()
    session.comm.Barrier()
    assert len(list(shared_path.iterdir())) == session.size

@pytest.mark.scalar("real")
def test_last_rank_fails(session):
    assert session.rank != session.size - 1, "for a reason"

@pytest.mark.scalar("complex")
def test_other_build(session):
    assert False

def test_plain():
    pass
"""
WAITING = """
@pytest.mark.scalar("real")
def test_others_wait_for_the_one_that_failed(session):
    assert session.rank != session.size - 1, "while the others wait"
    session.comm.Barrier()
"""


def pytest_on(ranks, folder, code):
    """The finished pytest process on tests with this `code` and the conftest.py of the project."""
    conftest = Path(__file__).with_name("conftest.py").read_text()
    (folder / "conftest.py").write_text(conftest.replace("PATIENCE = 20.0", "PATIENCE = 1.0"))
    (folder / "pytest.ini").write_text("[pytest]\nmarkers = scalar\n")
    (folder / "test_sample.py").write_text(code)
    python = [sys.executable, "-m", "pytest", "-q", "--color=no", "-p", "no:cacheprovider", str(folder)]
    line = [*launch.mpirun(ranks), *python]
    environment = launch.environment() | ({"JAMPETSC_TEST_SCALAR": "real"} if ranks else {})
    environment.pop("PYTEST_CURRENT_TEST", None)
    return subprocess.run(line, capture_output=True, text=True, timeout=60, env=environment, cwd=os.sep)


def test_plain_tests_alone(tmp_path):
    done = pytest_on(0, tmp_path, TESTS)
    assert "1 passed, 3 deselected" in done.stdout and done.returncode == 0


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_failure_on_one_rank_is_everybodys(tmp_path, ranks):
    done = pytest_on(ranks, tmp_path, TESTS)
    assert done.stdout.count("1 failed, 1 passed, 2 deselected") == ranks
    assert done.stdout.count("AssertionError: for a reason") >= ranks
    assert done.returncode == 1


def test_a_failure_while_the_others_wait_ends_the_run(tmp_path):
    done = pytest_on(2, tmp_path, TESTS + WAITING)
    assert "test_others_wait_for_the_one_that_failed: rank 1 failed alone" in done.stderr
    assert "AssertionError: while the others wait" in done.stderr
    assert done.returncode == 1
