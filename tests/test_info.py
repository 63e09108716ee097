"""`jampetsc info`: what it says of packings, results and matrices."""

import launch
import numpy as np
import pytest
from samples import JAMBASHBULK, JAXMD, gears, honeycomb, isostatic, polydisperse, published

from jampetsc import cli
from jampetsc.contacts.disks import Disks
from jampetsc.storage.importers import import_packing
from jampetsc.storage.packing_file import write_packing
from jampetsc.storage.result_file import ResultWriter


def info(capsys, *words):
    """(exit status, output lines, error lines) of `jampetsc info words`; output is that of rank 0."""
    status = cli.main(["info", *map(str, words)])
    captured = capsys.readouterr()
    return status, captured.out.splitlines(), captured.err.splitlines()


def entry(lines, name):
    """What the one line that begins with `name` says."""
    (line,) = [line for line in lines if line.startswith(f"  {name}  ")]
    return line.removeprefix(f"  {name}").strip()


def test_a_published_packing(capsys, tmp_path):
    path = tmp_path / "packing.h5"
    write_packing(path, import_packing(JAMBASHBULK))
    status, lines, _ = info(capsys, path)
    assert status == 0
    assert lines[0] == f"{path}: packing of 16 disks"
    assert entry(lines, "made by") == "jamBashbulk"
    assert entry(lines, "potential") == "harmonic, stiffness constant, k = 1"
    assert entry(lines, "pressure p").split() == ["0.001", "published", "0.001"]
    assert entry(lines, "packing fraction φ") == "0.8149490663"
    assert entry(lines, "energy U") == "0.0001092835857"
    assert entry(lines, "contacts").startswith("33 that carry more than 2.4e-09")
    assert entry(lines, "rattlers") == "0 (0 %)"
    assert entry(lines, "coordination Z").startswith("4.125 ")
    assert float(entry(lines, "max |F| / p")) < 1e-11
    assert entry(lines, "imported_from") == JAMBASHBULK.name
    assert not any("note" in line for line in lines)


def test_published_stress_stands_beside_ours(capsys, tmp_path):
    path = tmp_path / "packing.h5"
    write_packing(path, import_packing(JAXMD, 4))
    _, lines, _ = info(capsys, path)
    for component in ("xx", "xy", "yy"):
        ours, _, theirs = entry(lines, f"stress σ_{component}").split()
        assert float(ours) == pytest.approx(float(theirs), rel=1e-7)
    assert float(entry(lines, "published_C_xyxy")) == pytest.approx(polydisperse(4)[1]["Cijkl"][2])


def test_what_is_wrong_with_a_packing_is_said(capsys, tmp_path):
    shaken, loose = tmp_path / "shaken.h5", tmp_path / "loose.h5"
    disks = published()
    noise = np.random.default_rng(0).normal(0, 1e-4, (16, 2))
    moved = Disks.from_positions(disks.positions + noise, disks.radii, disks.cell, record={"pressure": 1e-3})
    write_packing(shaken, moved)
    _, lines, _ = info(capsys, shaken)
    assert entry(lines, "max |F| / p").endswith(": forces are not balanced")
    assert lines[-1] == "note: the file records pressure = 0.001: its positions were changed"

    write_packing(loose, Disks.from_positions(disks.positions, 0.5 * disks.radii, disks.cell))
    _, lines, _ = info(capsys, loose)
    assert entry(lines, "max |F| / p") == "no contacts: below jamming"


def test_a_result(capsys, tmp_path):
    path = tmp_path / "sweep.h5"
    with ResultWriter(path, "jampetsc-sweep") as writer:
        writer.dataset("omega", [1e-2, 1.0])
        writer.dataset("G", np.array([0.1 + 0.01j, 0.2 + 1j]))
        writer.dataset("error_bound", [1e-9, 4e-9])
        writer.dataset("error_bound_storage", [1e-9, 1e-9])
        writer.dataset("error_bound_loss", [1e-9, 4e-9])
        writer.attributes(
            law="contact", beta=0.5, packing="p.h5", packing_sha256="ab12", ranks=3, scalar_type="real",
            wall_seconds=12.5, jampetsc_version="0.1.0", petsc_version="3.18.5",
            argv="jampetsc sweep p.h5", method="direct",
        )  # fmt: skip
    status, lines, _ = info(capsys, path)
    assert status == 0
    assert lines[0] == f"{path}: sweep of p.h5"
    assert entry(lines, "law") == "law = contact, beta = 0.5"
    assert entry(lines, "command") == "jampetsc sweep p.h5"
    assert entry(lines, "made").endswith("in 12.5 s")
    assert entry(lines, "ranks") == "3, real scalars"
    assert entry(lines, "versions") == "jampetsc 0.1.0, petsc 3.18.5"
    assert entry(lines, "files") == "one, complete"
    assert entry(lines, "frequencies") == "2, from 0.01 to 1"
    assert entry(lines, "worst bound, G'") == "1.0e-08 relative, at omega = 0.01"
    assert entry(lines, "worst bound, G''") == "1.0e-07 relative, at omega = 0.01"
    assert entry(lines, "method") == "direct"
    assert entry(lines, "G").split() == ["(2,)", "complex128"]


def test_refusals_are_one_line(capsys, tmp_path):
    packing, sweep = tmp_path / "packing.h5", tmp_path / "modes.h5"
    write_packing(packing, published())
    with ResultWriter(sweep, "jampetsc-modes") as writer:
        writer.dataset("eigenvalues", [1.0])
    for words, message in (
        ((tmp_path / "none.h5",), "none.h5: no such file"),
        ((JAXMD,), "not a jampetsc file"),
        (
            (packing, "--beta", 2),
            "contact damping, beta = 2: only the matrices depend on a damping law; add --matrices",
        ),
        ((packing, "--law", "stokes", "--beta", 2), "--beta: belongs to --law contact"),
        ((packing, "-inertia_ksp_type", "preonly"), "info -inertia_ksp_type: "),
        ((sweep, "--matrices"), "modes.h5: is a jampetsc-modes file: --matrices needs a packing"),
    ):
        status, lines, (error,) = info(capsys, *words)
        assert (status, lines) == (2, [])
        assert message in error


def matrices(capsys, session, shared_path, disks, *words):
    """(exit status, lines, error lines) of `info --matrices`; the lines are the same on all ranks."""
    path = shared_path / "packing.h5"
    if session.rank == 0:
        write_packing(path, disks)
    session.comm.Barrier()
    status, lines, errors = info(capsys, path, "--matrices", *words)
    assert session.rank == 0 or not lines
    return status, *session.comm.bcast((lines, errors))


@pytest.mark.scalar("real")
def test_matrices_of_a_minimum(capsys, session, shared_path):
    status, lines, _ = matrices(capsys, session, shared_path, isostatic())
    assert status == 0
    ranks = f"{session.size} rank{'s' * (session.size > 1)}"
    assert f"K and B for contact damping, beta = 1, on {ranks}" in lines
    assert entry(lines, "unknowns") == "66, 3 for each of 22 disks; 2 rattlers left out"
    assert entry(lines, "Maxwell's count") == "43 contacts − (2·22 − 2) = 1 in excess"
    assert entry(lines, "pinned unknowns") == "2: 2 translations"
    assert entry(lines, "K, pre-stress").split()[:3] == ["0", "2", "42"]
    assert entry(lines, "K, no pre-stress").split()[:3] == ["0", "2", "42"]
    assert entry(lines, "B").split()[:3] == ["0", "0", "64"]
    assert lines[-1] == "a minimum: K has no negative eigenvalue, and only the translations cost no energy"


@pytest.mark.scalar("real")
def test_matrices_of_what_is_no_minimum(capsys, session, shared_path):
    """A compressed square lattice would rather buckle: eight ways down, counted."""
    status, lines, _ = matrices(capsys, session, shared_path, gears())
    assert status == 0
    assert entry(lines, "pieces") == "1 connected, 1 of them bipartite (gears)"
    assert entry(lines, "pinned unknowns") == "3: 2 translations and 1 gear mode"
    assert entry(lines, "K, pre-stress").split()[:3] == ["8", "2", "38"]
    assert lines[-1].startswith(
        "not a minimum: K has 8 negative eigenvalues; error bounds of a sweep do not hold"
    )

    _, lines, _ = matrices(capsys, session, shared_path, gears(), "--law", "stokes")
    assert entry(lines, "pinned unknowns") == "0: every move meets drag"
    assert entry(lines, "B").split()[:3] == ["0", "0", "48"]


@pytest.mark.scalar("real")
def test_a_packing_off_balance_is_no_minimum(capsys, session, shared_path):
    disks, _ = polydisperse(0)
    noise = np.random.default_rng(0).normal(0, 1e-4, (64, 2))
    shaken = Disks.from_positions(disks.positions + noise, disks.radii, disks.cell, disks.potential)
    _, lines, _ = matrices(capsys, session, shared_path, shaken)
    assert lines[-1].startswith(
        "not a minimum: K has no negative eigenvalue, but the forces are not balanced"
    )


@pytest.mark.scalar("real")
def test_matrices_below_jamming_are_refused(capsys, session, shared_path):
    status, lines, (error,) = matrices(capsys, session, shared_path, honeycomb())
    assert status == 2
    assert entry(lines, "contacts").startswith("12 ")
    assert "12 contacts between 8 disks leave at least 2 floppy modes: below jamming" in error


def test_work_without_mpi_is_done_once_on_any_number_of_ranks(tmp_path):
    write_packing(tmp_path / "p.h5", import_packing(JAMBASHBULK))
    alone, on_two = (
        launch.run(ranks, "../jampetsc/__main__.py", "info", tmp_path / "p.h5") for ranks in (0, 2)
    )
    assert alone.returncode == on_two.returncode == 0
    assert "16 disks" in alone.stdout and on_two.stdout == alone.stdout


def test_results_of_no_packing_say_what_they_are_of(capsys, tmp_path):
    for name, facts, origin in [
        ("jam", {"particle_count": 64}, "64 disks of its own"),
        ("collapse", {"sources": "a.h5 b.h5", "particle_count": 64}, "a.h5 b.h5"),
        ("flow", {"packing": "p.h5", "packing_sha256": "abc"}, "p.h5"),
    ]:
        path = tmp_path / f"{name}.h5"
        with ResultWriter(path, f"jampetsc-{name}") as writer:
            writer.dataset("phi", np.ones(2))
            writer.attributes(**facts)
        status, lines, _ = info(capsys, path)
        assert status == 0 and lines[0] == f"{path}: {name} of {origin}"
        assert any("packing sha256" in line for line in lines) == ("packing" in facts)
