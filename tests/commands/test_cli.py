"""The command line: what goes to whom, one line for every error, and no rank left waiting."""

import argparse
import contextlib
import errno
import importlib.util
import os
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import launch
import numpy as np
import pytest
from samples import polydisperse, published, stored

import jampetsc
from jampetsc import main as cli
from jampetsc import streams
from jampetsc.commands import JOBS
from jampetsc.errors import ConvergenceError, InputError, JampetscError
from jampetsc.io.packing_file import write_packing


def probe(*words, ranks=0):
    return launch.run(ranks, "probe.py", *words)


def words_of(done):
    """Standard error without what mpirun adds."""
    return [line for line in done.stderr.splitlines() if line.startswith("jampetsc: ")]


# Words


@pytest.mark.parametrize(
    ("line", "program", "petsc"),
    [
        ("a.h5 --out b", "a.h5 --out b", ""),
        ("a.h5 -log_view", "a.h5", "-log_view"),
        ("a.h5 -ksp_type cg --out b", "a.h5 --out b", "-ksp_type cg"),
        ("a.h5 -ksp_monitor --out b", "a.h5 --out b", "-ksp_monitor"),
        ("-eps_target -0.5 a.h5", "a.h5", "-eps_target -0.5"),
        ("a.h5 --beta -0.5 -log_view :x", "a.h5 --beta -0.5", "-log_view :x"),
        ("a.h5 -ksp_view -pc_type lu b.h5", "a.h5 b.h5", "-ksp_view -pc_type lu"),
    ],
)
def test_who_gets_which_word(line, program, petsc):
    assert cli.split_petsc(line.split()) == (program.split(), petsc.split())


@pytest.mark.parametrize("value", ["-1e-4", "-.5", "-3", "3e-2"])
def test_negative_numbers_are_values(value):
    words = ["sweep", "p.h5", "--out", "s.h5", "--beta", value]
    assert cli.command_parser(words)[0].parse_args(words).beta == value


def test_one_command_is_imported_unless_all_are_asked_for():
    assert list(cli.command_parser(["sweep", "x"])[1].choices) == ["sweep"]
    assert list(cli.command_parser(["--version"])[1].choices) == []
    for words in ([], ["--help"]):
        assert list(cli.command_parser(words)[1].choices) == list(JOBS)


PREFIXES = {  # of PETSc's options that a help names
    "pack": "newton", "jam": "newton", "shear": "newton", "sweep": "shift freq", "quasistatic": "shift",
    "modes": "modes inertia", "oscillate": "osc_snes osc_ksp osc_factor shift", "relax": "osc_factor shift inertia",
    "info": "inertia",
}  # fmt: skip


@pytest.mark.parametrize("command", JOBS)
def test_manners_of_every_command(command):
    parser = cli.command_parser([command])[1].choices[command]
    options = [option for action in parser._actions for option in action.option_strings]
    assert "--help" in options and not parser.allow_abbrev
    for option in options:
        assert option in ("-h", "-q", "-v") or option.startswith("--")
        assert option == option.lower() and "_" not in option
    with pytest.raises(InputError, match=rf"^[A-Z, a-z-]*: missing\. See jampetsc {command} --help\.$"):
        cli.dispatch([command])
    for action in parser._actions:
        assert action.help and action.help is not argparse.SUPPRESS, f"{action.dest} has no help"
    text = " ".join(parser.format_help().split())
    assert all(f" -{prefix}_" in text for prefix in PREFIXES.get(command, "").split())


# Which of several processes does what needs no MPI


def test_what_needs_no_mpi_is_done_and_told_by_one_rank():
    assert version("jampetsc") == jampetsc.__version__
    no_text = os.fsdecode(b"\xff")
    for words, status, out, err in (
        (["--version"], 0, f"jampetsc {jampetsc.__version__}\n", []),
        (["probe", "--help"], 0, "usage:", []),
        (["probe", "f"], 0, "done on 0\n", []),
        (["probe", no_text, "--do", "input_error"], 2, "", ["\\udcff: radius -1: must be positive"]),
        (["prob"], 2, "", ["prob: no such command; did you mean probe? See jampetsc --help."]),
    ):
        done = probe(*words, ranks=2)
        assert done.stdout.count(out) == (1 if out else len(done.stdout) + 1) and done.returncode == status
        assert words_of(done) == [f"jampetsc: error: {line}" for line in err]


@pytest.mark.parametrize(
    ("setting", "command", "message"),
    [  # of other programs
        ("MPLBACKEND=nonsense", "plot s.h5 --out s.png", "not a backend of matplotlib"),
        ("NUMBA_DISABLE_JIT=1", "pack --n 16 --phi 0.9 --out p.h5", "loops over contacts have to be compiled"),
    ],
)  # fmt: skip
def test_settings_of_other_programs_are_one_line_or_nothing(tmp_path, setting, command, message):
    arrays = dict.fromkeys(("omega", "G", "error_bound"), np.array([1.0, 2.0]))
    stored(tmp_path / "s.h5", "sweep", arrays, law="contact", beta=1.0)
    name, _, value = setting.partition("=")
    settings = {"env": launch.environment() | {name: value}, "cwd": tmp_path}
    line = [sys.executable, "-m", "jampetsc", *command.split()]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60, **settings)
    assert (done.returncode, done.stderr) == (2, f"jampetsc: error: {setting}: {message}. Unset it.\n")


def processes_of(folder, fact="comm"):
    """Names, or command lines, of those that a test with this folder has started, by their environment."""
    mark = f"JAMPETSC_TEST={folder}"
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if mark.encode() in (folder / "environ").read_bytes():
                found.append((folder / fact).read_text().strip())
    return found


def until(fulfilled):
    """Waits for it, a minute at most; whether it came about."""
    deadline = time.monotonic() + 60
    while not (done := fulfilled()) and time.monotonic() < deadline:
        time.sleep(0.02)
    return done


@pytest.mark.parametrize("ranks", [0, 2])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_nothing_is_left_of_a_killed_command(tmp_path, number, ranks):
    """Neither processes, a daemon of MPI among them, nor half a file; what was finished is there to go on from."""
    write_packing(tmp_path / "p.h5", published())
    words = ("sweep", "p.h5", "--out", "s.h5", "--method", "direct", "--omega", "1e-6:1:100000")
    line = [*launch.mpirun(ranks), sys.executable, "-m", "jampetsc", *words]
    environment = launch.environment() | {"JAMPETSC_TEST": str(tmp_path)}
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(line, cwd=tmp_path, env=environment, **pipes) as running:
        try:
            assert until(lambda: (tmp_path / "s.h5.resume").exists() or running.poll() is not None)
            assert running.poll() is None and len(processes_of(tmp_path)) == ranks + 1
        finally:
            running.send_signal(number)
        errors = running.communicate(timeout=60)[1]
    assert until(lambda: not processes_of(tmp_path)), processes_of(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.h5", "s.h5.resume"]
    assert "Traceback" not in errors
    if ranks == 0:  # mpirun has a status of its own
        assert running.returncode == -number


def test_what_waits_for_a_process_of_its_own_takes_it_along(tmp_path):
    write_packing(tmp_path / "p.h5", published())
    line = [sys.executable, "-m", "jampetsc", "trade", "p.h5", "--out", "t.csv", "--omega", "1e-6:1:100000"]
    environment = launch.environment() | {"JAMPETSC_TEST": str(tmp_path)}
    with subprocess.Popen(line, cwd=tmp_path, env=environment, stderr=subprocess.DEVNULL) as running:
        assert until(lambda: any("\0sweep\0" in words for words in processes_of(tmp_path, "cmdline")))
        running.send_signal(signal.SIGTERM)
    assert running.returncode == 128 + signal.SIGTERM
    assert until(lambda: not processes_of(tmp_path))  # the kernel ends it a moment after its parent


def test_one_of_two_ranks_takes_the_other_along(tmp_path):
    """Though neither can listen: both are minutes inside one instruction of python."""
    words = ("probe", tmp_path / "pid", "--do", "be_deaf", "--scalar", "real")
    with launch.start(2, "probe.py", *words) as process:
        heard = ""
        try:
            while heard.count("waiting") < 2:  # mpirun may run the lines of two ranks together
                line = process.stdout.readline()
                assert line, heard
                heard += line
            os.kill(int((tmp_path / "pid1").read_text()), signal.SIGTERM)
            errors = process.communicate(timeout=60)[1]
        finally:
            process.kill()  # mpirun, if it is still there, which would be waited for
    assert process.returncode == 128 + signal.SIGTERM and "Traceback" not in errors


@pytest.mark.parametrize(
    ("shell", "words", "made", "told"),
    [
        ('exec "$@" $OMPI_COMM_WORLD_RANK', "probe --do make", ["0", "1"], []),
        ('mkdir $OMPI_COMM_WORLD_RANK && cd $OMPI_COMM_WORLD_RANK && exec "$@"', "probe --do make x",
         ["0", "0/x", "1", "1/x"], []),
        # all of them, though mpirun ends the job when the first has left
        ('exec "$@" none$OMPI_COMM_WORLD_RANK', "probe --do input_error", [],
         [f"jampetsc: error: none{rank}: radius -1: must be positive" for rank in (0, 1)]),
    ],
    ids=["requests of their own", "folders of their own", "failures of their own"],
)  # fmt: skip
def test_ranks_that_are_asked_for_different_things_do_each(tmp_path, shell, words, made, told):
    line = [*launch.mpirun(2), "sh", "-c", shell, "farm", *launch.command(0, "probe.py", *words.split())]
    settings = {"env": launch.environment(), "cwd": tmp_path, "capture_output": True, "text": True}
    done = subprocess.run(line, timeout=60, **settings)
    assert done.returncode == (2 if told else 0), done.stderr
    assert sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*")) == made
    lines = done.stderr.replace("\0", "").splitlines()
    assert sorted(text for text in lines if text.startswith("jampetsc: ")) == told


# Errors while a command runs


def failing(error):
    """What takes a command line and ends by an error."""

    def dispatch(words):
        raise error

    return dispatch


@pytest.mark.parametrize(
    ("error", "status", "lines"),
    [
        (InputError("one\ntwo\x1b"), 2, [r"one\ntwo\x1b"]),
        (ConvergenceError("no minimum"), 3, ["no minimum"]),
        (JampetscError("disk full"), 1, ["disk full"]),
        (MemoryError(), 1, ["out of memory. Use more nodes, or a smaller packing."]),
        (MemoryError("Unable to\n allocate 3 GB"), 1,
         ["out of memory (Unable to allocate 3 GB). Use more nodes, or a smaller packing."]),
        (PermissionError(errno.EACCES, "x", "a.h5"), 1, ["a.h5: Permission denied. Check its permissions."]),
        (OSError(errno.ENOSPC, "x", "a.h5"), 1,
         ["a.h5: No space left on device. Free some space, or write elsewhere."]),
        (OSError(errno.EIO, "x"), 1, ["Input/output error"]),
        (OSError("odd\n  words"), 1, ["odd words"]),
        (KeyboardInterrupt(), 130, ["interrupted: nothing is kept."]),
        (KeyboardInterrupt("interrupted: a"), 130, ["interrupted: a"]),
        (DeprecationWarning("path is old."), 1,
         ["PYTHONWARNINGS makes this warning an error: path is old. Unset it."]),
    ],
)  # fmt: skip
def test_every_error_has_its_line_and_status(monkeypatch, capsys, error, status, lines):
    monkeypatch.setattr(cli, "dispatch", failing(error))
    assert cli.main(["probe"]) == status
    assert capsys.readouterr() == ("", "".join(f"jampetsc: error: {line}\n" for line in lines))


def test_numba_starts_whatever_its_own_threads(tmp_path):
    words = "-m jampetsc pack --n 16 --pressure 1e-2 --out".split()
    line = [sys.executable, *words, tmp_path / "p.h5"]
    subprocess.run(line, env=launch.environment() | {"NUMBA_NUM_THREADS": "0"}, check=True, timeout=300)


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_an_error_of_petsc_is_one_line_of_one_rank(session, monkeypatch, capsys):
    monkeypatch.setattr(cli, "dispatch", failing(session.PETSc.Error(62)))
    assert cli.main(["probe"]) == 1
    told = capsys.readouterr().err.splitlines()
    assert [line[:24] for line in told] == ["jampetsc: error: PETSc: "] * (session.rank == 0)


def test_streams_are_prepared_without_leaving_a_file_open(monkeypatch):
    before = len(os.listdir("/proc/self/fd"))
    streams.prepare()
    assert len(os.listdir("/proc/self/fd")) == before
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "stderr", None)
    streams.prepare()
    for stream in (sys.stdout, sys.stderr):
        assert stream.name == os.devnull and stream.errors == "backslashreplace"
        stream.close()


def test_a_bug_keeps_its_traceback():
    done = probe("probe", "f", "--do", "bug")
    assert done.returncode == 1
    assert done.stderr.startswith("Traceback") and done.stderr.endswith("ZeroDivisionError: a bug\n")


@pytest.mark.parametrize("extra", [[], ["--scalar", "real"]], ids=["bare", "petsc"])
def test_a_reader_that_leaves_is_no_error(extra):
    with launch.start(0, "probe.py", "probe", "f", "--do", "talk", *extra) as process:
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 141


# launch.run gives up after a minute: that is the guard against a hang


@pytest.mark.parametrize("rank", ["", "0", "1"])
def test_an_error_on_one_rank_ends_the_job_and_one_on_all_is_told_once(rank):
    words = ["--on-rank", rank] if rank else []
    done = probe("probe", "f", "--do", "input_error", *words, "--scalar", "complex", ranks=2)
    here = f"rank {rank}: " if rank else ""
    assert words_of(done) == [f"jampetsc: error: {here}f: radius -1: must be positive"]
    assert done.returncode == 2 and "done" not in done.stdout
    assert rank or "MPI_ABORT" not in done.stderr


def test_a_bug_on_one_rank_ends_the_job():
    done = probe("probe", "f", "--do", "bug", "--on-rank", 1, "--scalar", "real", ranks=2)
    assert words_of(done) == ["jampetsc: rank 1 of 2 failed:"]
    assert "ZeroDivisionError: a bug" in done.stderr
    assert done.returncode == 1 and "done" not in done.stdout


def test_one_thread_per_rank_unless_told_otherwise():
    code = """
import os
from jampetsc import main as cli
cli.main(["x"])
import numpy as np
np.ones((600, 600)) @ np.ones((600, 600))
print(os.environ["OMP_NUM_THREADS"], len(os.listdir("/proc/self/task")))
"""
    environment = {name: value for name, value in launch.environment().items() if "THREADS" not in name}
    for given, threads in ({}, 1), ({"OMP_NUM_THREADS": "2"}, min(2, len(os.sched_getaffinity(0)))):
        settings = {"env": environment | given, "capture_output": True, "text": True, "timeout": 60}
        done = subprocess.run([sys.executable, "-c", code], **settings)
        assert done.stdout == f"{given.get('OMP_NUM_THREADS', '1')} {threads}\n"


# Streams and locales


RADIUS = "f: radius -1: must be positive"
FULL = "No space left on device. Free some space, or write elsewhere."


@pytest.mark.parametrize(
    ("where", "deed", "status", "message"),
    [
        (">&-", "nothing", 0, ""),
        (">&-", "input_error", 2, RADIUS),
        ("2>&-", "input_error", 2, ""),
        (">&- 2>&- <&-", "input_error", 2, ""),
        (">&- <&-", "open_file", 0, ""),
        ("2>/dev/full", "progress", 0, ""),
        ("2>/dev/full", "input_error", 2, ""),
        (">/dev/full", "nothing", 1, FULL),
    ],
)
def test_standard_streams_that_lead_nowhere(where, deed, status, message):
    program = launch.command(0, "probe.py", "probe", "f", "--do", deed)
    line = ["sh", "-c", f'exec "$@" {where}', "sh", *program]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60, env=launch.environment())
    assert (done.returncode, done.stderr) == (status, f"jampetsc: error: {message}\n" if message else "")


ASCII = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}


def test_a_locale_without_the_letters_of_physics(tmp_path):
    options = tmp_path / "a.opts"
    options.write_text("# K + iωB\n-modes_eps_tol 1e-12\n")
    write_packing(tmp_path / "p.h5", polydisperse(3)[0])
    for words in (
        ["sweep", "--help"],
        ["modes", tmp_path / "p.h5", "--out", tmp_path / "m.h5", "--count", "3", "-options_file", options],
    ):
        line = launch.command(0, "../jampetsc/__main__.py", *words)
        environment = launch.environment() | ASCII
        done = subprocess.run(line, capture_output=True, timeout=60, env=environment)
        assert done.returncode == 0 and done.stdout.isascii() and b"\\u" in done.stdout, done.stderr


def test_file_names_that_are_no_text(tmp_path):
    packing, sweep = (tmp_path / os.fsdecode(name) for name in (b"\xff.h5", b"\xfe.h5"))
    write_packing(packing, polydisperse(3)[0])
    done = launch.run(0, "../jampetsc/__main__.py", "sweep", packing, "--out", sweep, "--omega", "1")
    assert done.returncode == 0, done.stderr
    told = launch.run(0, "../jampetsc/__main__.py", "info", sweep)
    assert told.returncode == 0 and "sweep of \\udcff.h5" in told.stdout
    done = probe("probe", "f", "--scalar", "real", "-options_file", packing)
    assert done.returncode == 2 and words_of(done) == [
        f"jampetsc: error: {tmp_path}/\\udcff.h5: PETSc takes printable text only. Use another name."
    ]


def test_the_shell_is_told_what_may_follow():
    """By argcomplete where it is installed; without it the command is as ever."""
    line = "jampetsc sweep --meth"
    asked = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "|", "COMP_LINE": line, "COMP_POINT": str(len(line))}
    shell = ["sh", "-c", 'exec "$0" -m jampetsc sweep --meth 8>&1 9>/dev/null', sys.executable]
    done = subprocess.run(shell, env=launch.environment() | asked, capture_output=True, text=True)
    told = "--method" if importlib.util.find_spec("argcomplete") else "--meth: no such option"
    assert told in done.stdout + done.stderr
