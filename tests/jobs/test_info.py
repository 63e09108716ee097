"""`jampetsc info`: what it says of packings, results and matrices."""

from types import SimpleNamespace

import launch
import numpy as np
import pytest
from samples import JAMBASHBULK, JAXMD, gears, honeycomb, isostatic, polydisperse, published, put

from jampetsc.cli import main as cli
from jampetsc.core.disks import Disks
from jampetsc.io.importers import import_packing
from jampetsc.io.packing_file import write_packing
from jampetsc.io.result_file import ResultWriter
from jampetsc.jobs import describe


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
    assert entry(lines, "ranks") == "3, PETSc with real scalars"
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
        ((sweep, "--matrices"), "modes.h5: is a jampetsc-modes file"),
    ):
        status, lines, (error,) = info(capsys, *words)
        assert (status, lines) == (2, [])
        assert message in error


def matrices(capsys, session, shared_path, disks, *words):
    """(exit status, lines, error lines) of `info --matrices`; the lines are the same on all ranks."""
    path = shared_path / "packing.h5"
    put(path, disks, session.comm)
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
    assert (status, lines) == (2, [])
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
        ("jam", {"particle_count": 64}, "64 disks that it made"),
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


def test_disks_forces_and_stress_are_told_in_their_units(capsys, tmp_path):
    """A row of disks of diameters 1 and 2 in a cell of area 24 that overlap by 0.1 where they touch once."""
    positions = np.array([[1.0, 1.0], [2.4, 1.0], [1.0, 3.0], [6.0, 3.0]])
    disks = Disks.from_positions(positions, np.array([0.5, 1.0, 0.5, 0.5]), [(8.0, 0.0), (0.5, 3.0)])
    record = {
        "published_stress_yx": 1.0,
        "published_stress_xy": 0.25,
        "phi": disks.phi * (1 + 2e-6),
        "rattlers": 9,
    }
    write_packing(tmp_path / "p.h5", disks.with_record(**record | {"note": "kept", "max_force": 7.0}))
    _, lines, _ = info(capsys, tmp_path / "p.h5")
    assert entry(lines, "radii") == "0.5 to 1, mean diameter d = 1.25"
    assert entry(lines, "cell") == "a1 = (8, 0), a2 = (0.5, 3), V = 24"
    assert entry(lines, "packing fraction φ") == describe.number(np.pi * 1.75 / 24)
    assert entry(lines, "stress σ_xy").split()[1:] == ["published", "0.25"]
    assert (
        not [line for line in lines if "stress_yx" in line or "max_force" in line]
        and entry(lines, "note") == "kept"
    )
    assert lines[-1].startswith("note: the file records phi = ")
    state = describe.measure(disks)
    assert entry(lines, "rattlers") == "4 (1e+02 %)" and state.rattlers.all()


def test_forces_are_told_in_units_of_the_pressure_that_is_measured(capsys, tmp_path):
    disks = published()
    noise = np.random.default_rng(0).normal(0, 1e-4, (16, 2))
    shaken = Disks.from_positions(disks.positions + noise, disks.radii, disks.cell)
    write_packing(tmp_path / "p.h5", shaken)
    state = describe.measure(shaken)
    _, lines, _ = info(capsys, tmp_path / "p.h5")
    assert entry(lines, "max |F| / p") == f"{state.max_force / state.pressure:.2e}: forces are not balanced"
    for name, row, column in (("xx", 0, 0), ("xy", 0, 1), ("yy", 1, 1)):
        assert float(entry(lines, f"stress σ_{name}")) == pytest.approx(state.stress[row, column], rel=1e-9)


def test_what_a_result_was_made_from(capsys, tmp_path):
    for name, attributes, told in (
        ("a", {"packing": "p.h5", "packing_sha256": "ab"}, "p.h5"),
        ("b", {"sources": "x.h5, y.h5"}, "x.h5, y.h5"),
        ("c", {"particle_count": 64}, "64 disks that it made"),
        ("d", {}, "an unknown packing"),
    ):
        with ResultWriter(tmp_path / f"{name}.h5", "jampetsc-modes") as writer:
            writer.dataset("eigenvalues", [1.0])
            writer.attributes(**attributes)
        _, lines, _ = info(capsys, tmp_path / f"{name}.h5")
        assert lines[0] == f"{tmp_path / name}.h5: modes of {told}"
        assert [line.split()[-1] for line in lines if "packing sha256" in line] == ["ab"] * (name == "a")
        assert entry(lines, "law") == entry(lines, "PETSc options") == "none"


def test_the_worst_bound_is_that_of_its_part_and_stands_at_its_frequency():
    G = np.array([1.0 + 10j, 10.0 + 1j, 5 + 5j])
    bounds = {
        "error_bound_storage": [1e-3, 1e-3, 0],
        "error_bound_loss": [1e-3, 2e-3, 0],
        "error_bound": [0, 0, 1e-2],
    }
    sweep = {"omega": np.array([1.0, 2.0, 4.0]), "G": G} | {name: np.array(b) for name, b in bounds.items()}
    assert describe._moduli(sweep) == [
        ("frequencies", "3, from 1 to 4"),
        ("worst bound, G'", "1.0e-03 relative, at omega = 1"),
        ("worst bound, G''", "2.0e-03 relative, at omega = 2"),
        ("worst bound, G*", "1.4e-03 relative, at omega = 4"),
    ]
    del sweep["error_bound_loss"]
    assert [name for name, _ in describe._moduli(sweep)][1:] == ["worst bound, G'", "worst bound, G*"]


def test_what_is_told_of_matrices_are_their_own_numbers():
    def inertia(*counts):
        return SimpleNamespace(
            **dict(zip(("negative", "zero", "positive", "shift"), (*counts, 1e-12), strict=True))
        )

    facts = SimpleNamespace(
        contacts=33, unknowns=48, dofs=3, nonzeros=700, pieces=2, gears=1, pins=3, translations=2,
        asymmetry_K=1e-17, asymmetry_B=2e-17,
        with_prestress=inertia(1, 2, 45), without_prestress=inertia(0, 4, 44), damping=inertia(0, 0, 47),
    )  # fmt: skip
    network = SimpleNamespace(n=15, rattlers=1)
    text = describe.matrices(published(), network, "some law", facts, 2)
    lines = text.splitlines()
    assert lines[0] == "K and B for some law, on 2 ranks"
    assert entry(lines, "unknowns") == "48, 3 for each of 15 disks; 1 rattlers left out"
    assert entry(lines, "nonzeros").startswith("700 ") and entry(lines, "contacts") == "33, Z = 4.4"
    assert entry(lines, "Maxwell's count") == "33 contacts − (2·15 − 2) = 5 in excess"
    assert entry(lines, "pieces") == "2 connected, 1 of them bipartite (gears)"
    assert entry(lines, "pinned unknowns") == "3: 2 translations and 1 gear mode"
    assert entry(lines, "asymmetry") == "|K − Kᵀ|/|K| = 1.0e-17, |B − Bᵀ|/|B| = 2.0e-17"
    assert entry(lines, "K, pre-stress").split()[:3] == ["1", "2", "45"]
    assert entry(lines, "K, no pre-stress").split()[:3] == ["0", "4", "44"]
    assert entry(lines, "B").split()[:3] == ["0", "0", "47"] and "within 1e-12 of it" in text
    assert lines[-2].startswith("not a minimum: K has 1 negative") and lines[-1].startswith(
        "floppy without pre-stress: 2"
    )
    single = describe.matrices(published(), network, "some law", facts, 1)
    assert single.startswith("K and B for some law, on 1 rank\n")
