"""The agreement between ranks that tests on PETSc rely on, and stages of a run: a failure of one is never lost."""

import os
import re
import shlex
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
    conftest = Path(launch.ROOT, "tests/conftest.py").read_text()
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


# run/test


def function_of(script, name):
    """The text of a function of bash."""
    return re.search(rf"^{name}\(\) \{{.*?^\}}\n", script, re.MULTILINE | re.DOTALL)[0]


def ending(folder, *stages):
    """Status and last line of run/test after stages with these commands: its own functions and end, in `folder`."""
    script = (launch.ROOT / "run" / "test").read_text()
    stage = function_of(script, "stage")
    end = script[script.index("count() {") :]
    lines = [f"stage {name} sh -c {shlex.quote(command)}" for name, command in stages]
    text = "\n".join(["set -uo pipefail", f"logs={folder}", stage, *lines, end])
    done = subprocess.run(["bash", "-c", text], capture_output=True, text=True)
    return done.returncode, done.stdout.splitlines()[-2:]


@pytest.mark.parametrize(
    ("stages", "status", "said"),
    [
        ([("a", "GOOD"), ("b", "GOOD")], 0, "== 6 passed in"),
        ([("a", "BAD"), ("b", "GOOD")], 1, "not passed: a == 1 failed, 5 passed in"),
        ([("a", "GOOD"), ("b", "exit 5")], 1, "not passed: b == 0 failed, 3 passed in"),  # no test at all
    ],
)
def test_a_stage_that_fails_fails_the_run(tmp_path, stages, status, said):
    words = {"GOOD": "echo '3 passed in 0.1s'", "BAD": "echo '1 failed, 2 passed in 0.1s'; exit 1"}
    found, lines = ending(tmp_path, *((name, words.get(what, what)) for name, what in stages))
    assert found == status and said in " ".join(lines)


@pytest.mark.parametrize("chosen", ["", "-k nothing"])
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("status", [0, 1, 5])
def test_a_stage_without_a_test_among_those_asked_for_is_quiet_under_mpirun(tmp_path, chosen, ranks, status):
    """pytest ends with 5 there. Rank 0 alone prints."""
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\necho no tests ran\nexit {status}\n")
    python.chmod(0o755)
    lines = [
        "set -uo pipefail; . run/environment; cores=(0)",
        function_of((launch.ROOT / "run" / "test").read_text(), "on_ranks"),
        f"python={shlex.quote(str(python))} chosen={shlex.quote(chosen)}; on_ranks {ranks} real",
    ]
    settings = {"cwd": launch.ROOT, "env": launch.environment(), "capture_output": True, "text": True}
    done = subprocess.run(["bash", "-c", "\n".join(lines)], **settings)
    expected = 0 if chosen and status == 5 else status
    assert (done.returncode, done.stdout.count("no tests ran")) == (expected, 1), done.stdout + done.stderr
    if expected == 0 or ranks == 1:  # mpirun may say which of several ranks failed first
        assert not done.stderr
