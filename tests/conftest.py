"""Two kinds of tests: those that load PETSc into their own process, and plain ones.

Plain tests run once; they may start `jampetsc` or mpirun as a program. Tests marked `scalar("real")`,
`scalar("complex")` or `scalar("real", "complex")` use PETSc in their process, which can load one of the two
builds: JAMPETSC_TEST_SCALAR says which. run/test runs them on 1 and 3 ranks, with complex scalars on 1 and 2, with
pytest on every rank; those marked `most_ranks(2)` on 1 and 2, `most_ranks(1)` on 1, `least_ranks(2)` on 3, both on 2.
After each step of a test the ranks agree on its outcome: what fails on one fails on all, and a rank that failed and
that the others do not follow ends the run instead of leaving them waiting.
"""

import faulthandler
import gc
import os
import signal
import sys
import time
from array import array
from functools import cache
from pathlib import Path

import pytest

sys.path.append(
    str(Path(__file__).resolve().parents[1] / "benchmarks")
)  # last: one of them is named coverage
SCALAR = os.environ.get("JAMPETSC_TEST_SCALAR")
PATIENCE = 20.0  # seconds a rank that failed waits for the others to end the same test
LONG = "figures help trade interrupted options oscillate_command pack documents".split()  # begin first
HANG = 300.0  # seconds after which a test without `allowed_seconds` hangs: every rank says where, and the run ends

running = None  # the Session of this process
DOTS = ("figure.dpi", "savefig.dpi")
dots = {}  # per inch of a picture, those of its style
gc.set_threshold(10_000)  # objects until garbage is looked for: at 700 pictures take a tenth longer
signal.signal(
    signal.SIGINT, signal.default_int_handler
)  # a shell ignores it in what it starts in the background


def pytest_report_header(config):
    if SCALAR is None:
        return "plain tests; those marked scalar need JAMPETSC_TEST_SCALAR=real or complex, see run/test"
    return f"tests with {SCALAR} scalars on {running.size} rank{'s' * (running.size > 1)}"


def pytest_configure(config):
    global running
    if SCALAR is not None:
        from jampetsc.petsc import session

        running = session.start(SCALAR)


def pytest_ignore_collect(collection_path):
    """Ranks, each of which reads the tests, leave out files without any for them, with all that those import."""
    if SCALAR is None or not collection_path.match("test_*.py") or is_for_ranks(collection_path, SCALAR):
        return None
    return True


@cache
def is_for_ranks(path, *scalars):
    """Whether the text of a file has the mark, and these types of scalars."""
    text = path.read_text()
    return "mark.scalar" in text and all(f'"{scalar}"' in text for scalar in scalars)


def pytest_collection_modifyitems(config, items):
    def wanted(item):
        scalar = item.get_closest_marker("scalar")
        if scalar is None or SCALAR is None:
            if scalar is not None and not is_for_ranks(item.path, *scalar.args):
                raise pytest.UsageError(f"{item.nodeid}: ranks look for mark and types in its text")
            return scalar is None and SCALAR is None
        least, most = (item.get_closest_marker(f"{name}_ranks") for name in ("least", "most"))
        enough = least is None or running.size >= least.args[0]
        return SCALAR in scalar.args and enough and (most is None or running.size <= most.args[0])

    config.hook.pytest_deselected(items=[item for item in items if not wanted(item)])
    items[:] = [item for item in items if wanted(item)]
    if SCALAR is None:
        # processes share the files: a long one at the end would keep one of them busy and the others idle
        items.sort(key=lambda item: item.path.stem.removeprefix("test_") not in LONG)


def pytest_collection_finish(session):
    if "jampetsc.plots.style" in sys.modules:  # dots cost time, and tests look at them with `own_dots`
        style = sys.modules["jampetsc.plots.style"].STYLE
        dots.update({name: style[name] for name in DOTS})
        style.update(dict.fromkeys(DOTS, 100))
    if "jampetsc.plots.sphere_drawing" in sys.modules:
        sys.modules["jampetsc.plots.sphere_drawing"].VIEW_PIXELS = 400
    gc.freeze()  # what is imported by now stays


@pytest.fixture
def session():
    """The running jampetsc Session, with the scalar type of this process."""
    return running


@pytest.fixture(params=[2, 3], ids=["2D", "3D"])
def jammed(request):
    """A jammed packing in a tilted cell, of 16 disks and of 14 spheres.

    Whatever takes vectors, positions or axes is tested with both.
    """
    from samples import published
    from spheres import few_spheres

    return published() if request.param == 2 else few_spheres()


@pytest.fixture
def reporting():
    """Runs tell on standard error how far they have come, as on a command line."""
    from jampetsc import progress

    with progress.reporting(True):
        yield


@pytest.fixture
def own_dots(monkeypatch):
    """Pictures have as many dots per inch as their style says."""
    from jampetsc.plots import style

    for name in DOTS:
        monkeypatch.setitem(style.STYLE, name, dots[name])


@pytest.fixture
def shared_path(session, tmp_path):
    """One empty folder for all ranks; tmp_path is another one on every rank."""
    return session.comm.bcast(tmp_path)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item):
    capture = item.config.pluginmanager.getplugin("capturemanager")
    with capture.global_and_fixture_disabled():
        stderr = os.dup(2)
    allowed = item.get_closest_marker("allowed_seconds")
    faulthandler.dump_traceback_later(allowed.args[0] if allowed else HANG, exit=True, file=stderr)
    yield
    faulthandler.cancel_dump_traceback_later()
    os.close(stderr)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    outcome = yield
    report = outcome.get_result()
    if running is None or running.size == 1:
        return
    if some_failed(item, report):
        mine = f"on rank {running.rank}:\n{report.longreprtext}" if report.failed else None
        report.outcome = "failed"
        report.longrepr = "\n".join(text for text in running.comm.allgather(mine) if text)
    elif report.when == "teardown":
        running.collect()
        gc.freeze()  # what is left stays: the next collection looks at what its test has made


def some_failed(item, report):
    """Whether this step failed on some rank, once all have ended it; a failed rank does not wait for long."""
    from mpi4py import MPI

    mine, worst = array("i", [report.failed]), array("i", [0])
    request = running.comm.Iallreduce(mine, worst, op=MPI.MAX)
    deadline = time.monotonic() + PATIENCE
    while not request.Test():
        if report.failed and time.monotonic() > deadline:
            capture = item.config.pluginmanager.getplugin("capturemanager")
            with capture.global_and_fixture_disabled():
                print(f"{item.nodeid}: rank {running.rank} failed alone", file=sys.stderr)
                print(report.longreprtext, file=sys.stderr, flush=True)
            running.comm.Abort(1)
        time.sleep(0.001)
    return worst[0] > 0
