"""What `--out` may be: no command destroys an input, a file of another kind, or what is no regular file."""

import errno
import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import h5py
import launch
import numpy as np
import pytest
from samples import JAMBASHBULK, published, put, stored

import jampetsc
from jampetsc import main as cli
from jampetsc.errors import ConvergenceError, InputError, JampetscError
from jampetsc.io.outlet import Outlet
from jampetsc.io.outputs import PICTURE, TABLE, check_output
from jampetsc.io.packing_file import write_packing
from jampetsc.io.result_file import merge

COMMANDS = {  # words without --out -> the ending of what it writes
    "pack --from p.h5 --pressure 1e-4": ".h5",
    "import p.txt": ".h5",
    "springs p.h5 --keep 0.5": ".h5",
    "sweep p.h5": ".h5",
    "sweep p.h5 --method direct": ".h5",
    "quasistatic p.h5": ".h5",
    "modes p.h5": ".h5",
    "oscillate p.h5 --omega 1 --strain 1e-6": ".h5",
    "relax p.h5 --strain 1e-3": ".h5",
    "shear p.h5 --step 1e-3 --strain 2e-3": ".h5",
    "flow p.h5 --model RD0 --rate 1e-2 --strain 0.1": ".h5",
    "spectrum s.h5": ".h5",
    "spectrum s.h5 --window 1": ".png",
    "correlate s.h5": ".h5",
    "correlate t.h5 --packing s.h5": ".h5",
    "collapse s.h5 --observable pressure --fit phi_J,y,znu": ".h5",
    "scaling s.h5": ".h5",
    "merge s.h5": ".h5",
    "export p.h5": ".xyz",
    "matrices p.h5": ".npz",
    "plot s.h5": ".png",
    "plot t.h5 --kind fields --packing s.h5": ".svg",
    "trade p.h5": ".csv",
    "trade t.h5 --options-files p.h5": ".csv",
}
PACKING_OR_RESULT = {"import": "packing", "pack": "packing"}  # what the command may replace
SWEEP = dict.fromkeys(("omega", "G", "error_bound"), np.ones(2))


@pytest.fixture
def inputs(tmp_path, monkeypatch):
    """A folder, which is the working directory, with a packing, two sweeps and a published packing."""
    monkeypatch.chdir(tmp_path)
    write_packing("p.h5", published())
    for name in ("s.h5", "t.h5"):
        stored(name, "sweep", SWEEP)
    Path("p.txt").write_bytes(JAMBASHBULK.read_bytes())
    return tmp_path


def content(folder):
    """Type and content of everything in the folder."""
    found = {}
    for path in folder.iterdir():
        mode = path.lstat().st_mode
        found[path.name] = stat.S_IFMT(mode), path.read_bytes() if path.is_file() else None
    return found


def refused(capsys, words, out):
    """The one line of error that the command ends with, nothing in the folder changed."""
    before = content(Path.cwd())
    assert cli.main([*words.split(), "--out", str(out)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert content(Path.cwd()) == before
    return line


def used(words):
    """The input that --out must not be."""
    return words.split()[-1] if words.split()[-1].endswith(".h5") else words.split()[1 + ("--from" in words)]


@pytest.mark.parametrize("words", COMMANDS)
def test_no_command_replaces_an_input_another_kind_of_file_or_what_is_no_file(inputs, capsys, words):
    source, ending = used(words), COMMANDS[words]
    os.link(source, "input" + ending)
    if PACKING_OR_RESULT.get(words.split()[0]) == "packing":
        stored("other" + ending, "sweep", SWEEP)
    else:
        write_packing("other" + ending, published())
    os.mkfifo("pipe" + ending)
    for name, message, remedy in (
        ("input", ": the input ", f"{source}, which would be lost. Choose another --out."),
        ("other", ": exists and is a jampetsc-", "Choose another --out, or remove it first."),
        ("pipe", ": not a regular file. ", "Give another file with --out."),
    ):
        line = refused(capsys, words, name + ending)
        assert f"{name}{ending}{message}" in line and line.endswith(remedy)


TOGETHER = ("sweep p.h5 --omega 1", "jam", "study")  # what ranks share, each in a way of its own


def ranks_of(words):
    """On how many ranks a command shows something."""
    several = words.startswith(TOGETHER) and "direct" not in words
    return pytest.param(words, marks=pytest.mark.most_ranks(2 if several else 1))


OTHERS = {  # words that make a result, and the word of which there is another
    "pack --n 16 --pressure 1e-2": ("--tolerance 1e-9", "tolerance = 1e-10, not 1e-09"),
    "import p.txt": ("--index 1", "index = 0, not 1"),
    "sweep p.h5 --omega 1": ("--beta 0.5", "beta = its default, not 0.5"),
    "sweep p.h5 --omega 1 --method direct": ("--no-prestress", "prestress = true, not false"),
    "flow p.h5 --model RD0 --rate 1e-2 --strain 0.02": ("--step 0.05", "step = its default, not 0.05"),
    "shear p.h5 --step 1e-3 --strain 2e-3": ("--discard 5e-4", "discard = 0.001, not 0.0005"),
    "spectrum s.h5": ("--window 0.5", "window = "),
    "quasistatic p.h5": ("--beta 0.5", "beta = "),
    "modes p.h5 --count 2": ("--no-prestress", "prestress = true, not false"),
    "oscillate p.h5 --omega 1 --strain 1e-6 --steps 16": ("--alpha 0.9", "alpha = 1.0, not 0.9"),
    "relax p.h5 --strain 1e-6 --times 0.1 --accuracy 0.1": ("--load xx", "load = "),
    "jam --n 16 --phi 0.9 --seeds 1:2": ("--tolerance 1e-7", "tolerance = 1e-06, not 1e-07"),
}


@pytest.mark.scalar("real")
@pytest.mark.parametrize("words", map(ranks_of, OTHERS))
def test_a_finished_result_stays_unless_it_is_to_be_replaced(
    session, shared_path, monkeypatch, capsys, words
):
    """The same settings, in other words too, are those of the result that is there: nothing is computed."""
    monkeypatch.chdir(shared_path)
    put("p.h5", published(), session.comm)
    if session.rank == 0:
        Path("p.txt").write_bytes(JAMBASHBULK.read_bytes())
    session.comm.Barrier()
    if "s.h5" in words:
        cli.dispatch("sweep p.h5 --omega 1e-3:1e3:7 --out s.h5".split())
    line, (other, told) = [*words.split(), "--out", "r.h5"], OTHERS[words]
    cli.dispatch(line)
    session.comm.Barrier()
    before, when = Path("r.h5").read_bytes(), Path("r.h5").stat().st_mtime_ns
    out = capsys.readouterr().out
    if Path("r.parts").exists() and session.rank == 0:
        assert "\n  rows of the 2 ranks in r.parts: keep both together, or `jampetsc merge r.h5`\n" in out
    session.comm.Barrier()
    assert cli.dispatch([*line[:1], *line[-2:], *line[1:-2]]) == 0
    said = "r.h5: finished earlier with the same settings and inputs"
    assert said in capsys.readouterr().out or session.rank > 0
    made = jampetsc.load("r.h5")
    assert Path("r.h5").stat().st_mtime_ns == when
    session.comm.Barrier()
    with pytest.raises(InputError, match=f"r.h5: exists .*{re.escape(told)}.*--overwrite"):
        cli.dispatch([*line, *other.split()])
    assert Path("r.h5").read_bytes() == before
    session.comm.Barrier()
    if words.startswith("import"):  # of one packing
        return
    cli.dispatch([*line, *other.split(), "--overwrite"])
    session.comm.Barrier()
    assert Path("r.h5").read_bytes() != before and type(jampetsc.load("r.h5")) is type(made)


def test_what_is_there_already_is_the_result_of_these_inputs_undamaged(inputs, capsys):
    """Of a new packing under the old name it is another result; one that was damaged or edited is none."""
    words = "flow p.h5 --model RD0 --rate 1e-2 --strain 0.02 --out f.h5".split()

    def again(*more):
        before = content(Path.cwd())
        status, (out, err) = cli.main([*words, *more]), capsys.readouterr()
        return status, out + err, content(Path.cwd()) == before

    assert again()[0] == 0
    Path("f.h5.resume").mkdir()  # of a run that was killed after it had written its result
    assert again() == (
        0,
        "f.h5: finished earlier with the same settings and inputs. --overwrite computes it again.\n",
        False,
    )
    assert not Path("f.h5.resume").exists()
    assert again("--overwrite")[::2] == (0, False)
    whole, refused = Path("f.h5").read_bytes(), "give --overwrite to replace it.\n"
    write_packing("p.h5", published("hertzian"))
    status, told, unchanged = again()
    assert status == 2 and unchanged and "f.h5: exists and has other inputs. " in told
    write_packing("p.h5", published())
    for place in (100, len(whole) // 2, len(whole) - 200):
        Path("f.h5").write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        status, told, unchanged = again()
        assert status == 2 and unchanged and "f.h5: exists and is a damaged HDF5 file" in told
    for settings in ("no json", "[1, 2]", "null", '"text"'):
        Path("f.h5").write_bytes(whole)
        with h5py.File("f.h5", "r+") as h5:
            h5.attrs["request"] = settings
        status, told, unchanged = again()
        assert status == 2 and unchanged and "f.h5: exists and has settings that are not readable. " in told
    Path("f.h5").write_bytes(whole)
    with h5py.File("f.h5", "r+") as h5:
        h5["strain"][0] = 7.0
    status, told, unchanged = again()
    assert status == 2 and unchanged and told.endswith(refused)
    assert "was edited, as its checksums are gone" in told
    Path("f.h5").write_bytes(whole)
    longer = ["flow", "f.h5", "--strain", "0.02"]
    for strain in (0.04, 0.06):  # a flow that is continued is never finished
        assert cli.main(longer) == 0 and jampetsc.load("f.h5")["strain"][-1] == pytest.approx(strain)
    assert again()[0] == 2  # 0.06 is not 0.02


def test_options_of_petsc_are_no_settings(inputs):
    """In a process of its own, as PETSc is not started for what is there already."""
    words = [sys.executable, "-m", "jampetsc", *"sweep p.h5 --omega 1 --out o.h5".split()]
    for options in ([], ["-shift_pc_type", "cholesky"]):
        done = subprocess.run([*words, *options], env=launch.environment(), capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert (
        done.stdout
        == "o.h5: finished earlier with the same settings and inputs. --overwrite computes it again.\n"
    )


def test_the_last_state_of_a_finished_run_can_still_be_asked_for(inputs, capsys):
    for words in ("flow p.h5 --model RD0 --rate 1e-2 --strain 0.02", "shear p.h5 --step 1e-3 --strain 2e-3"):
        kind = words.split()[0]
        line = [*words.split(), "--out", f"{kind}.h5", "--last"]
        assert cli.main([*line, f"{kind}-last.h5"]) == 0
        assert cli.main([*line, f"{kind}-more.h5"]) == 0 and "finished earlier" in capsys.readouterr().out
        first, second = (jampetsc.load(f"{kind}-{name}.h5") for name in ("last", "more"))
        assert np.allclose(first.positions, second.positions, rtol=0, atol=1e-14)
        assert np.allclose(first.cell, second.cell, rtol=0, atol=1e-14)
        assert first.record["protocol"] == second.record["protocol"]


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_python_returns_the_result_that_is_there(session, shared_path, monkeypatch):
    """With its packing, as the first time."""
    monkeypatch.chdir(shared_path)
    found = [jampetsc.quasistatic(published(), out="q.h5") for _ in range(2)]
    assert found[0].attributes["run_id"] == found[1].attributes["run_id"]
    assert found[0].packing.fingerprint == found[1].packing.fingerprint
    session.comm.Barrier()
    other = jampetsc.quasistatic(published(), out="q.h5", overwrite=True)
    assert other.attributes["run_id"] != found[0].attributes["run_id"]
    session.comm.Barrier()
    with pytest.raises(InputError, match=r"q\.h5: exists and has other inputs\. .* or give overwrite to"):
        jampetsc.quasistatic(published("hertzian"), out="q.h5")
    if session.size == 2:
        session.comm.Barrier()
        (part, _), whole = sorted(Path("q.parts").iterdir()), None
        if session.rank == 0:
            whole = part.read_bytes()
            part.write_bytes(whole[:200] + bytes([whole[200] ^ 1]) + whole[201:])
        session.comm.Barrier()
        with pytest.raises(InputError, match=r"q\.h5: exists and is damaged .*q\.parts.*give overwrite"):
            jampetsc.quasistatic(published(), out="q.h5")


def test_what_has_no_input_or_writes_two_files_replaces_no_other(inputs, capsys):
    words = "flow --n 16 --phi 0.8 --model RD0 --rate 1e-2 --strain 0.02 --out f.h5"
    assert cli.main(words.split()) == 0
    capsys.readouterr()
    for words in ("flow f.h5 --strain 0.01", "jam --n 16 --phi 0.9 --seeds 1:2"):
        assert "p.h5: exists and is a jampetsc-packing file" in refused(capsys, words, "p.h5")
    for words in ("flow f.h5 --strain 0.01 --last", "shear p.h5 --step 1e-3 --strain 2e-3 --out q.h5 --last"):
        before = content(Path.cwd())
        assert cli.main([*words.split(), "s.h5"]) == 2
        assert "s.h5: exists and is a jampetsc-sweep file" in capsys.readouterr().err
        assert content(Path.cwd()) == before
    for words in ("flow p.h5 --model RD0 --rate 1e-2", "shear p.h5 --step 1e-3"):
        assert cli.main([*words.split(), "--strain", "0.1", "--out", "q.h5", "--last", "q.h5"]) == 2
        assert "q.h5: another file that this run writes" in capsys.readouterr().err


LAST = {  # words of a command that keeps what it has computed -> what it writes last
    "jam --n 16 --phi 0.9 --seeds 1:2 --out new.h5": "new.h5",
    "flow p.h5 --model RD0 --rate 1e-2 --strain 0.02 --out new.h5": "new.h5",
    "flow f.h5 --strain 0.01 --last new.h5": "new.h5",
    "shear p.h5 --step 1e-3 --strain 2e-3 --out new.h5": "new.h5",
    "shear p.h5 --step 1e-3 --strain 2e-3 --out q.h5 --last new.h5": "new.h5",
    "sweep p.h5 --omega 1e-2,1 --fields 1 --out new.h5": "new.h5",
    "sweep p.h5 --omega 1e-2,1 --fields 1 --method direct --out new.h5": "new.h5",
    "oscillate p.h5 --omega 1 --strain 1e-6 --steps 16 --out new.h5": "new.h5",
    "relax p.h5 --strain 1e-6 --times 0.1 --accuracy 0.1 --out new.h5": "new.h5",
    "study study.toml --out study": "study/table.csv",
}


@pytest.mark.scalar("real")
@pytest.mark.parametrize("words", map(ranks_of, LAST))
def test_what_is_computed_outlives_a_last_write_that_fails(session, shared_path, capsys, monkeypatch, words):
    """Only what could not be written is done by the same command later; a flow goes on once, not twice."""
    last = LAST[words]
    monkeypatch.chdir(shared_path)
    put("p.h5", published(), session.comm)
    if session.rank == 0:
        Path("study.toml").write_text("[pack]\nn = 16\npressure = 1e-2\n[quasistatic]\n")
    if "f.h5" in words:
        cli.dispatch("flow p.h5 --model RD0 --rate 1e-2 --strain 0.02 --out f.h5".split())
    session.comm.Barrier()
    replace = os.replace

    def replace_or_not(source, target):
        if os.fspath(target) == last:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        replace(source, target)

    monkeypatch.setattr(os, "replace", replace_or_not)
    with pytest.raises(JampetscError, match="not writable"):
        cli.dispatch(words.split())
    monkeypatch.setattr(os, "replace", replace)
    session.comm.Barrier()
    kept = {path: path.stat().st_mtime_ns for path in Path().glob("**/*.h5")}
    capsys.readouterr()
    session.comm.Barrier()
    assert cli.dispatch(words.split()) == 0
    assert not re.search(r"^\[\d+/\d+\]", capsys.readouterr().err, re.MULTILINE), (
        "steps that were done before"
    )
    session.comm.Barrier()
    assert Path(last).is_file() and not list(Path().glob("**/*.resume*"))
    if "f.h5" in words:
        assert jampetsc.load("f.h5")["strain"][-1] == pytest.approx(0.03, rel=0.05)
    else:
        assert kept.items() <= {path: path.stat().st_mtime_ns for path in Path().glob("**/*.h5")}.items()


def test_what_writes_asks_again(inputs):
    """For scripts, which do not go through the commands."""
    os.mkfifo("pipe")
    for path, message in (("s.h5", "is a jampetsc-sweep file, not"), ("pipe", "pipe: not a regular file")):
        with pytest.raises(InputError, match=message):
            write_packing(path, published())
    for path, message in (("p.h5", "is a jampetsc-packing file, not"), ("pipe", "pipe: not a regular file")):
        with pytest.raises(InputError, match=message):
            stored(path, "sweep", SWEEP)
        with pytest.raises(InputError, match=message):
            merge("s.h5", path)
    assert stat.S_ISFIFO(Path("pipe").stat().st_mode)


def test_a_name_without_a_character_is_none(inputs):
    """As of a variable of the shell that is not set: the answer would stay in memory, and go."""
    for name in ("out", "checkpoint"):
        with pytest.raises(InputError, match=rf"^{name}: empty\. Give the name of a file\.$"):
            jampetsc.shear("p.h5", step=1e-3, strain=0.01, **{name: ""})
    failures = {2: ConvergenceError("late"), 1: ConvergenceError("early")}
    with pytest.raises(
        ConvergenceError, match=r"^2 of 3 points failed, give out to keep the others; the first: early$"
    ):
        Outlet().raise_failures(failures, 3, "points")


# Of whatever command

KINDS = {  # content -> the kinds of files that may replace it, and what it is called where one may not
    ("a.csv", b"1,2\n"): (TABLE, "a table"),
    ("a.CSV", b"# measured\n1,2\n"): (TABLE, "a table"),
    ("a.csv", b"x\0"): (None, "a file of another kind"),
    ("a.txt", b"1,2\n"): (None, "a file of another kind"),
    ("a.svg", b"\xef\xbb\xbf<?xml version"): (PICTURE, "a picture"),
    ("a.png", b"<svg"): (PICTURE, "a picture"),
    ("a.png", b"\x89PNG\r\n\x1a\n"): (PICTURE, "a picture"),
    ("a.pdf", b"%PDF-1.4"): (PICTURE, "a picture"),
    ("a.h5", b"\x89HDF\r\n\x1a\n"): (None, "a damaged HDF5 file"),
    ("a.xyz", b"3\nLattice="): ("an exported .xyz file", "an exported .xyz file"),
    ("a.any", b""): ("any kind", None),
}


@pytest.mark.parametrize(("name", "content"), KINDS)
def test_what_is_there_already(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    allowed, held = KINDS[name, content]
    for kind in (TABLE, PICTURE, "an exported .xyz file"):
        if allowed in (kind, "any kind"):
            check_output(tmp_path / name, kind)
        else:
            with pytest.raises(InputError, match=f"exists and is {held}, not a.* {kind.split()[-1]}. Choose"):
                check_output(tmp_path / name, kind)


@pytest.mark.parametrize("attrs", [{}, {"format": "NXdata"}, {"format": 3}])
def test_hdf5_of_another_program_is_not_replaced(tmp_path, attrs):
    with h5py.File(tmp_path / "a.h5", "w") as h5:
        h5.attrs.update(attrs)
    with pytest.raises(InputError, match="is an HDF5 file of another program, not a jampetsc-sweep file"):
        check_output(tmp_path / "a.h5", "jampetsc-sweep")


def test_endings_that_promise_something_else(tmp_path):
    for ending in (".png", ".PDF", ".svg", ".csv", ".Txt", ".opts", ".xyz"):
        with pytest.raises(
            InputError, match=r"an HDF5 file with the ending of another format\. Give it the ending \.h5"
        ):
            check_output(tmp_path / f"a{ending}", "jampetsc-sweep")
        check_output(tmp_path / f"a{ending}", PICTURE)


def test_neither_an_input_nor_another_output_may_be_the_output(inputs):
    """By whatever name; an input is named where it has another one."""
    os.link("s.h5", "hard.h5")
    Path("symbolic.h5").symlink_to("s.h5")
    Path("link").symlink_to(inputs)
    for out, other in (("s.h5", "hard.h5"), ("new.h5", "link/new.h5"), ("new.h5", "./new.h5")):
        with pytest.raises(InputError, match=r"another file that this run writes\. Choose another name for"):
            check_output(out, "jampetsc-sweep", beside=[other])
    for out in ("hard.h5", "symbolic.h5", "./s.h5", f"link/../{inputs.name}/s.h5", inputs / "s.h5"):
        with pytest.raises(InputError, match=rf"{out}: the input s\.h5, which would be lost"):
            check_output(out, "jampetsc-sweep", ["none.h5", "s.h5"])
    with pytest.raises(InputError, match=r"s\.h5: the input, which would be lost"):
        check_output("s.h5", "jampetsc-sweep", ["s.h5"])
    for out, kind in (("s.h5", "sweep"), ("p.h5", "packing"), ("new.h5", "sweep")):
        check_output(out, f"jampetsc-{kind}", ["none.h5"], ["t.h5", "none/c.h5"])
