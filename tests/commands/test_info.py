"""`jampetsc info`: what it says of packings, results and matrices."""

import numpy as np
import pytest
from samples import (
    JAMBASHBULK,
    JAXMD,
    gears,
    isostatic,
    polydisperse,
    published,
    put,
    stored,
    strips,
    two_images,
)

import jampetsc
from jampetsc import main as cli
from jampetsc.commands import describe
from jampetsc.io.importers import import_packing
from jampetsc.io.packing_file import write_packing
from jampetsc.io.result_file import ResultWriter
from jampetsc.packing.lattices import build_lattice
from jampetsc.packing.packing import Packing


def info(capsys, *words):
    """(exit status, output lines, error lines) of `jampetsc info words`; output is that of rank 0."""
    status = cli.main(["info", *map(str, words)])
    captured = capsys.readouterr()
    return status, captured.out.splitlines(), captured.err.splitlines()


def entries(lines):
    """{name: what its line says} of the lines of two or more columns."""
    return {name: rest.strip() for name, _, rest in (line.strip().partition("  ") for line in lines) if rest}


def test_a_published_packing(capsys, tmp_path):
    path = tmp_path / "packing.h5"
    write_packing(path, import_packing(JAMBASHBULK))
    status, lines, _ = info(capsys, path)
    told = entries(lines)
    assert status == 0 and lines[0] == f"{path}: packing of 16 disks"
    assert {
        "made by": "jamBashbulk", "potential": "harmonic, stiffness constant, k = 1",
        "packing fraction φ": "0.8149490663", "energy U": "0.0001092835857", "rattlers": "0 (0 %)",
        "imported_from": JAMBASHBULK.name,
    }.items() <= told.items()  # fmt: skip
    assert told["pressure p"].split() == ["0.001", "published", "0.001"]
    assert told["contacts"].startswith("33 that carry more than 2.4e-09")
    assert told["coordination Z"].startswith("4.125 ") and float(told["max |F| / p"]) < 1e-11
    assert not any("note" in line for line in lines)
    write_packing(path, import_packing(JAXMD, 4))
    told = entries(info(capsys, path)[1])
    for component in ("xx", "xy", "yy"):
        ours, _, theirs = told[f"stress σ_{component}"].split()
        assert float(ours) == pytest.approx(float(theirs), rel=1e-7)
    assert float(told["published_C_xyxy"]) == pytest.approx(polydisperse(4)[1]["Cijkl"][2])


def shaken(disks, record=None):
    """The disks moved, whose forces are not balanced any more."""
    noise = np.random.default_rng(0).normal(0, 1e-4, (disks.n, 2))
    return Packing.from_positions(
        disks.positions + noise, disks.radii, disks.cell, disks.potential, record=record
    )


def test_what_is_wrong_with_a_packing_is_said():
    disks = shaken(published(), {"pressure": 1e-3})
    state, lines = describe.measure(disks), describe.describe_packing("p.h5", disks).splitlines()
    assert entries(lines)["max |F| / p"] == f"{state.max_force / state.pressure:.2e}: forces are not balanced"
    assert lines[-1] == "note: the file records pressure = 0.001: its positions have changed since"
    loose = Packing.from_positions(disks.positions, 0.5 * disks.radii, disks.cell)
    told = entries(describe.describe_packing("p.h5", loose).splitlines())
    assert told["max |F| / p"] == "no contacts: below jamming"


@pytest.mark.parametrize(("off", "noted"), [(0.9e-6, False), (1.1e-6, True)])
def test_a_record_that_is_not_of_these_positions(off, noted):
    disks = published()
    recorded = describe.measure(disks).energy * (1 + off)
    text = describe.describe_packing("p.h5", disks.with_record(energy=recorded, negative_modes=0))
    assert ("note: the file records energy = " in text) == noted
    assert "note: the file records negative_modes = 0, but for other coordinates; ignored" in text


def test_disks_forces_and_stress_are_told_in_their_units():
    """A row of disks of diameters 1 and 2 in a cell of area 24 that overlap by 0.1 where they touch once."""
    positions = np.array([[1.0, 1.0], [2.4, 1.0], [1.0, 3.0], [6.0, 3.0]])
    radii, cell = np.array([0.5, 1.0, 0.5, 0.5]), [(8.0, 0.0), (0.5, 3.0)]
    record = {
        "published_stress_yx": 1.0,
        "published_stress_xy": 0.25,
        "rattlers": 9,
        "note": "kept",
        "max_force": 7.0,
    }
    told = entries(
        describe.describe_packing(
            "p.h5", Packing.from_positions(positions, radii, cell, record=record)
        ).splitlines()
    )
    assert told["radii"] == "0.5 to 1, mean diameter d = 1.25"
    assert told["cell"] == "a1 = (8, 0), a2 = (0.5, 3), V = 24"
    assert told["packing fraction φ"] == describe.number_text(np.pi * 1.75 / 24) and told["note"] == "kept"
    assert told["stress σ_xy"].split()[1:] == ["published", "0.25"] and told["rattlers"] == "4 (100 %)"
    assert not [name for name in told if "stress_yx" in name or "max_force" in name]


RESULT = {
    "law": "contact", "beta": 0.5, "packing": "p.h5", "packing_sha256": "ab12", "ranks": 3, "scalar_type": "real",
    "wall_seconds": 12.5, "jampetsc_version": "0.1.0", "petsc_version": "3.18.5",
    "argv": "jampetsc sweep p.h5", "method": "direct",
}  # fmt: skip


def test_a_result(capsys, tmp_path):
    """The worst relative bound of each part is over that part, and told with its frequency."""
    path, G = tmp_path / "sweep.h5", np.array([1.0 + 10j, 10.0 + 1j, 5 + 5j])
    bounds = {
        "error_bound_storage": [1e-3, 1e-3, 0],
        "error_bound_loss": [1e-3, 2e-3, 0],
        "error_bound": [0, 0, 1e-2],
    }
    stored(path, "sweep", {"omega": [1.0, 2.0, 4.0], "G": G, **bounds}, **RESULT)
    status, lines, _ = info(capsys, path)
    told = entries(lines)
    assert status == 0 and lines[0] == f"{path}: sweep of p.h5" and told["made"].endswith("in 12.5 s")
    assert {
        "packing sha256": "ab12", "law": "law = contact, beta = 0.5", "command": "jampetsc sweep p.h5",
        "ranks": "3, PETSc with real scalars", "versions": "jampetsc 0.1.0, petsc 3.18.5", "method": "direct",
        "files": "one, complete", "frequencies": "3, from 1 to 4",
        "worst bound, G'": "1.0e-03 relative, at omega = 1", "worst bound, G''": "2.0e-03 relative, at omega = 2",
        "worst bound, G*": "1.4e-03 relative, at omega = 4",
    }.items() <= told.items()  # fmt: skip
    assert told["G"].split() == ["(3,)", "complex128"]
    del bounds["error_bound_loss"]
    told = entries(info(capsys, stored(path, "sweep", {"omega": [1.0, 2.0, 4.0], "G": G, **bounds}))[1])
    assert "worst bound, G'" in told and "worst bound, G''" not in told


def test_what_a_result_was_made_from(capsys, tmp_path):
    for attributes, told in (
        ({"packing": "p.h5", "packing_sha256": "ab"}, "p.h5"),
        ({"sources": "x.h5, y.h5", "particle_count": 64}, "x.h5, y.h5"),
        ({"particle_count": 64}, "64 random disks"),
        ({}, "an unknown packing"),
    ):
        path = stored(tmp_path / "a.h5", "modes", {"eigenvalues": [1.0]}, **attributes)
        _, lines, _ = info(capsys, path)
        said = entries(lines)
        assert lines[0] == f"{path}: modes of {told}" and said["law"] == said["PETSc options"] == "none"
        assert said.get("packing sha256") == attributes.get("packing_sha256")


# Matrices


@pytest.mark.scalar("real")
@pytest.mark.parametrize(
    ("disks", "words", "begin", "last"),
    [  # of the lines: negative, zero and positive eigenvalues of K and B
        (isostatic, [],
         {"unknowns": "66, 3 for each of 22 disks; 2 rattlers left out", "nonzeros": "972 in each",
          "Maxwell's count": "43 contacts − (2·22 − 2) = 1 in excess", "pinned unknowns": "2: 2 transl",
          "contacts": "43, Z = 3.909",
          "components": "1 connected, 0 of them bipartite", "K, pre-stress": "0 2 42", "K, no pre-stress": "0 2 42",
          "B": "0 0 64"},
         "a minimum: K has no negative eigenvalue, and only the translations cost no energy"),
        # a compressed square lattice would rather buckle: eight ways down, counted
        (gears, ["--law", "stokes"], {"K, pre-stress": "8 2 38", "B": "0 0 48", "pinned unknowns": "0: every move"},
         "not a minimum: K has 8 negative eigenvalues; error bounds of a sweep do not hold"),
        (gears, [], {"B": "0 0 69", "components": "1 connected, 1 of them", "pinned unknowns": "3: 2 translations and"},
         "not a minimum: K has 8 negative eigenvalues; error bounds of a sweep do not hold"),
        (two_images, [], {"K, pre-stress": "1 2 29"}, "not a minimum: K has 1 negative eigenvalue;"),
        (strips, [], {"pinned unknowns": "4: 4 translations", "components": "2 connected, 0 of them"},
         "not a minimum: K has no negative eigenvalue, but the forces are not balanced"),
        (lambda: shaken(published()), [], {"K, pre-stress": "0 2 28"},
         "not a minimum: K has no negative eigenvalue, but the forces are not balanced"),
    ],
    ids=["minimum", "gears in a fluid", "gears", "two images", "strips", "shaken"],
)  # fmt: skip
def test_matrices_are_examined(capsys, session, shared_path, disks, words, begin, last):
    put(shared_path / "p.h5", disks(), session.comm)
    status, lines, _ = info(capsys, shared_path / "p.h5", "--matrices", *words)
    assert status == 0 and (session.rank == 0 or not lines)
    lines = session.comm.bcast(lines)
    told = {name: " ".join(words.split()) for name, words in entries(lines).items()}
    assert {name: told[name][: len(one)] for name, one in begin.items()} == begin
    assert told["asymmetry"].count(" = ") == 2 and lines[-1].startswith(last)
    assert any(line.endswith(f", on {session.size} rank{'s' * (session.size > 1)}") for line in lines)


@pytest.mark.scalar("real")
@pytest.mark.least_ranks(2)
def test_parts_of_a_result_are_counted(capsys, session, shared_path):
    with ResultWriter(shared_path / "m.h5", "jampetsc-modes", session.comm) as writer:
        writer.dataset("eigenvalues", np.ones(2))
        writer.distributed("particles", np.arange(2))
    _, lines, _ = info(capsys, shared_path / "m.h5")
    assert session.rank or entries(lines)["files"] == f"joint file and {session.size} parts, complete"


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_moves_without_energy_or_dissipation_are_counted(session):
    """Rows and columns of a square lattice of springs slide: 8 zero modes, of which 2 are translations."""
    ends = {
        "marginal": jampetsc.info(build_lattice("square", (4, 4)), matrices=True, law=jampetsc.StokesDrag()),
        "a minimum": jampetsc.info(published(), matrices=True, law=jampetsc.ContactDamping(normal=0.0)),
    }
    assert [text.splitlines()[-2:] for text in ends.values()] == [
        [
            "marginal: 6 moves besides the translations cost no energy",
            "floppy without pre-stress: 6 moves besides the translations stretch no contact",
        ],
        [
            "a minimum: K has no negative eigenvalue, and only the translations cost no energy",
            "B lets 13 moves pass besides those pinned",
        ],
    ]


def test_numbers_as_one_reads_them():
    told = {1 / 3: "0.3333333333", 3: "3", "x": "x"}
    assert [describe.number_text(value) for value in told] == list(told.values())
    assert describe.number_text(np.array([0.5, 1.0])) == "0.5, 1"
    rows = [("head",), ("a", "1"), ("longer", "2", "x")]
    assert describe.aligned_text(rows) == "head\n  a       1\n  longer  2  x"


def test_what_a_file_says_cannot_steer_the_terminal(tmp_path, capsys):
    """Nor forge rows of the table: control characters are shown as escapes, also in the line of an error."""
    said = {"argv": "a\x1b[31mred\nranks  99", "packing": "x\x1b]0;title\x07\u202e.h5"}
    path = stored(tmp_path / "s.h5", "modes", {"eigenvalues": [1.0], "modes": np.ones((1, 2, 2))}, **said)
    assert cli.main(["info", str(path)]) == 0
    text = capsys.readouterr().out
    assert r"a\x1b[31mred\nranks  99" in text and r"x\x1b]0;title\x07\u202e.h5" in text
    assert cli.main(["export", str(path), "--out", str(tmp_path / "o.xyz")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and r"x\x1b]0;title\x07\u202e.h5" in error
    assert not set(text + error) & set("\x1b\x07\u202e")
