"""Command lines that are refused: one table for each command, in the folder refusals.

A row of NAME.txt is a command line after `jampetsc NAME` and, behind |, words of its message, … between them.
{a b ; c} stands for a row with each of these, of which those behind ; are taken, as the ends of a range belong to it; a
row without words is taken as well. --out is added where it is required. Rows behind [PETSc] need a process with PETSc.
"""

import itertools
import os
import re
import shlex
import stat
from pathlib import Path

import h5py
import launch
import pytest
from samples import crystal, honeycomb, lattice, polydisperse, published, put

import jampetsc
from jampetsc import main as cli
from jampetsc.commands import JOBS, job_class
from jampetsc.errors import InputError
from jampetsc.io.packing_file import write_network, write_packing
from jampetsc.options.functions import make_function
from jampetsc.options.parameters import FILES, fields, parameters
from jampetsc.options.parser import option_words
from jampetsc.packing.lattices import build_lattice
from jampetsc.packing.potentials import Potential
from jampetsc.petsc.session import current

TABLES = {path.stem: path.read_text() for path in sorted(Path(__file__).with_name("refusals").glob("*.txt"))}
ALTERNATIVES = re.compile(r"\{([^{}]*)\}")
# OBJECT: what must be, or what is wrong. What to do.
FORM = re.compile(
    r".*?\S: (.*\bmust\b.*|.+[.?] [A-Z].*\.|.+; did you mean \S+\?( See .*)?|.+\. Run: .+ install \S+)"
)


def rows(command, petsc):
    """(words of the command line, parts of its message, None if it is taken) of the rows of a table."""
    plain, _, with_petsc = TABLES[command].partition("[PETSc]\n")
    for row in (with_petsc if petsc else plain).splitlines():
        line, bar, message = row.partition(" |")
        parts, pieces = [part.strip() for part in message.split("…")], []
        for place, text in enumerate(ALTERNATIVES.split(line)):
            kinds = text.partition(";")[::2] if place % 2 else ()
            choices = [
                (shlex.quote(word), kind == 0)
                for kind in (0, 1)
                if kinds
                for word in shlex.split(kinds[kind])
            ]
            pieces.append(choices or [(text, True)])
        for choice in itertools.product(*pieces):
            words = shlex.split("".join(text for text, _ in choice))
            is_refused = bool(bar) and all(refused for _, refused in choice)
            yield (
                completed(words if command == "jampetsc" else [command, *words]),
                parts if is_refused else None,
            )


TEXTS = {  # files by hand
    "words.txt": "one two\n", "words.csv": "1,2\n", "words.png": "one two\n", "taken.xyz": "one two\n",
    "bytes.csv": "x\0", "other.png": "x\0", "torn.h5": "\x89HDF\r\n\x1a\n", "torn/table.csv": "one two\n",
    "radii.txt": "1\n" * 16, "negative.txt": "0.5\n-0.5\n" * 10, "disks.txt": "0 0 0.5\n1 0 0.5\n0 1 0.5\n1 1 0.5\n",
    "nodes.txt": "0 0\n1 0\n1 1\n", "boxed.txt": "box 5\n0 0\n1 0\n", "bonds.txt": "0 1\n1 3\n",
    "three.txt": "0 1\n0 1 2\n", "x.txt": "0 x\n",
    "empty.toml": "", "swep.toml": "[swep]\n", "s.toml": "[pack]\nn = 16\nphi = 0.9\n",
    "odd.toml": "[pack]\nn = 16\nphi = 0.1\n",
    "study/table.csv": "command,state,file,seconds,cooling_rate\njam,done,0.h5,1,0.2\n",
}  # fmt: skip


def make_inputs(folder):
    """Files that need no PETSc: a packing of 16 disks, another one, a network and what is none of them."""
    for name, text in TEXTS.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="latin-1")
    for name in ("folder", "taken.png"):
        (folder / name).mkdir()
    os.mkfifo(folder / "pipe")
    os.mknod(folder / "socket", stat.S_IFSOCK | 0o600)
    for name, place in (("loop", "loop"), ("link.h5", "f.h5")):
        (folder / name).symlink_to(place)
    with h5py.File(folder / "foreign.h5", "w") as h5:
        h5["x"] = 1.0
    write_packing(folder / "p.h5", published())
    disks = published()
    write_packing(folder / "q.h5", disks.replace(offset=disks.offset + 0.1))
    close = disks.offset.copy()
    close[1] = close[0] + (disks.base[0] - disks.base[1]) + 0.01
    write_packing(folder / "overlap.h5", disks.replace(offset=close))
    write_network(folder / "n.h5", build_lattice("triangular", (4, 4)))


def make_flows(folder):
    """Flows of that packing. Collective."""
    how = {"rate": 0.1, "strain": 0.02, "snapshots": 2, "threads": 1}
    for name, model in (("f", "RD0"), ("copy", "RD0"), ("g", "CD0")):
        jampetsc.flow(folder / "p.h5", model, **how, out=folder / f"{name}.h5")


def make_results(folder, comm):
    """Results of that packing, and packings that no response takes. Collective."""
    others = {
        "h": honeycomb(),
        "l": lattice(),
        "u": polydisperse(6)[0],
        "many": polydisperse(3)[0],
        "x": crystal(),
    }
    stiff = published().replace(potential=Potential(k=2.5))
    for name, disks in (others | {"stiff": stiff, "moved": published()}).items():
        put(folder / f"{name}.h5", disks, comm)
    p, fields = folder / "p.h5", {"omega": [0.01, 1.0], "fields": [0.01, 1.0]}
    jampetsc.sweep(p, **fields, out=folder / "s.h5")
    jampetsc.sweep(p, omega=1.0, method="direct", out=folder / "d.h5")
    jampetsc.modes(p, count=3, out=folder / "m.h5")
    if comm.size > 1:  # the others are read by commands that one rank runs
        return
    for name, packing, more in (
        ("again", "p", {"accuracy": 1e-7}), ("twin", "q", {}), ("other", "q", {"fields": [0.01]}),
        ("stokes", "q", {"law": jampetsc.StokesDrag()}), ("s64", "many", {}), ("dense", "stiff", {}),
        ("crystal", "x", {}),
        ("lost", "moved", {}), ("t", "p", {"load": "tensor", "fields": None}),
        ("im", "p", {"mass": 1.0}), ("id", "p", {"mass": 1.0, "method": "direct"}),
        ("iw", "p", {"mass": 1.0, "load": "wave:1,0:transverse", "fields": None}),
    ):  # fmt: skip
        jampetsc.sweep(folder / f"{packing}.h5", **fields | more, out=folder / f"{name}.h5")
    (folder / "moved.h5").unlink()
    jampetsc.oscillate(p, omega=1.0, strain=1e-6, steps=16, out=folder / "o.h5")
    jampetsc.jam(n=16, phi=0.9, seeds=[1], out=folder / "j.h5")
    jampetsc.spectrum(folder / "s.h5", out=folder / "sp.h5")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("refusals")
    make_inputs(folder)
    make_flows(folder)
    return folder


def contents():
    """What lies in the working folder: names, sizes and times."""
    return sorted((str(path), *path.lstat()[6:9:2]) for path in Path().rglob("*"))


def python_message(words):
    """What the python function of a command line says to the same values, where it takes them as they are."""
    words, petsc = cli.split_petsc(words)
    try:
        args, unknown = cli.command_parser(words)[0].parse_known_args(words)
    except InputError:
        return None
    job = args.job
    if job.NAME in ("import", "plot"):  # whose functions are of another form
        return None
    given = {name: value for name in parameters(job) if (value := getattr(args, name)) is not None}
    out = getattr(args, "out", None)
    if unknown or petsc or not given.keys() <= fields(job).keys() or (job.OUT and out is None):
        return None
    files = [given.pop(name, ()) for name, one in parameters(job).items() if one.place == FILES]
    with pytest.raises(InputError) as refused:
        make_function(job)(*(files[0] if files else ()), **given, out=out)
    return refused.value.message(option_words(job)).replace(f"{Path.cwd()}/", "")


def refused(words, capsys, comm):
    """What is wrong with the way in which a command line is refused, and its message, which one rank prints."""
    status, said = cli.main(words), capsys.readouterr()
    out, err = map("".join, zip(*(comm.allgather(said) if comm else [said]), strict=True))
    message = err.removeprefix("jampetsc: error: ").removesuffix("\n").replace(f"{Path.cwd()}/", "")
    faults = [
        *([f"status {status}"] if status != 2 else []),
        *(["not one line on stderr"] if out or not err.endswith("\n") or "\n" in message else []),
        *(["not OBJECT: what is wrong. What to do."] if not FORM.fullmatch(message) else []),
    ]
    return faults, message


def completed(words):
    """A command line with --out where it is required."""
    command, *others = words
    has_out = any(word.partition("=")[0] == "--out" for word in others)
    needs_out = command in JOBS and job_class(command).OUT == "required" and not has_out
    return [command, "--out", "out.h5", *others] if needs_out else words


def check(command, capsys, comm=None):
    """That every row of a table is refused, or taken, as it says, and none leaves a file; names those that are not.

    comm   of a process with PETSc: of its rows; without it also that the python function says the same
    """
    before, wrong = contents(), []
    for words, parts in rows(command, comm):
        if parts is None:
            launch.asked(words)
            continue
        faults, message = refused(words, capsys, comm)
        if not re.search(".*".join(map(re.escape, parts)), message):
            faults.append(f"not {parts}")
        if not comm and not faults and python_message(words) not in (None, message):
            faults.append("another message of the python function")
        wrong += [f"{shlex.join(words)}: {message}: {', '.join(faults)}"] * bool(faults)
    assert not wrong, "\n".join(wrong)
    assert contents() == before


QUIET = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib


@QUIET
@pytest.mark.parametrize("command", TABLES)
def test_refusals(inputs, monkeypatch, capsys, command):
    monkeypatch.chdir(inputs)
    check(command, capsys)


def test_every_command_has_a_table():
    assert TABLES.keys() == {"jampetsc", *JOBS}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    comm = current().comm
    folder = comm.bcast(tmp_path_factory.mktemp("refusals"))
    if comm.rank == 0:
        make_inputs(folder)
    comm.barrier()
    make_flows(folder)
    make_results(folder, comm)
    return folder


@QUIET
@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
@pytest.mark.parametrize("command", [name for name in TABLES if "[PETSc]" in TABLES[name]])
def test_refusals_beside_petsc(session, results, monkeypatch, capsys, command):
    """On two ranks of the commands that use PETSc."""
    monkeypatch.chdir(results)
    if session.size == 1 or job_class(command).SOLVERS:
        check(command, capsys, session.comm)
