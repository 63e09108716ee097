"""The proof that a packing is a minimum holds for the disks it was made from, and for no others."""

import h5py
import numpy as np
import pytest
from samples import lattice, physics, polydisperse, published, put, sweep_of

from jampetsc.commands import describe
from jampetsc.commands.modes import Modes
from jampetsc.errors import InputError
from jampetsc.io.outlet import Outlet
from jampetsc.io.packing_file import read_packing, write_packing
from jampetsc.packing.packing import PROVED_BY, Packing, proved_minimum, with_proof
from jampetsc.packing.particles import GRID
from jampetsc.packing.potentials import Potential


@pytest.fixture
def path(tmp_path):
    write_packing(tmp_path / "p.h5", with_proof(published()))
    return tmp_path / "p.h5"


def test_a_proof_survives_a_file(path):
    disks, read = published(), read_packing(path)
    assert read.fingerprint == disks.fingerprint
    assert proved_minimum(read) and not proved_minimum(disks)
    told = describe.describe_packing(path, read)
    assert f"proved when it was made: {PROVED_BY}" in told and "note" not in told


def test_a_coordinate_is_the_same_however_base_and_offset_share_it():
    plus, minus = (
        Packing.from_positions([[x, 0.0], [1.0, 1.0]], [0.5, 0.5], 4 * np.eye(2)) for x in (0.0, -0.0)
    )
    assert plus.fingerprint == minus.fingerprint
    disks = published()
    fine = GRID * 2.0**-26
    disks = disks.replace(offset=fine * np.round(disks.offset / fine))  # leaves room for a grid step
    moved = disks.replace(base=disks.base + GRID, offset=disks.offset - GRID)
    assert not np.array_equal(moved.base, disks.base)
    assert moved.fingerprint == disks.fingerprint


def test_everything_that_forces_follow_from_is_in_the_fingerprint():
    disks = published()
    ulp = np.zeros((16, 2))
    ulp[5, 1] = 1e-23
    radii = disks.radii.copy()
    radii[3] = np.nextafter(radii[3], 0)
    others = [
        disks.replace(offset=disks.offset + ulp),
        disks.replace(radii=radii),
        disks.replace(cell_offset=disks.cell_offset + np.diag([1e-23, 0])),
        disks.replace(potential=Potential("hertzian")),
        disks.replace(potential=Potential(stiffness="inverse-square-diameter")),
        disks.replace(potential=Potential(k=1.0 + 1e-15)),
        disks.reordered(np.arange(16)[::-1]),
    ]
    assert len({disks.fingerprint, *(other.fingerprint for other in others)}) == 8


def edited(path, change):
    """The packing at `path` after `change(h5)`."""
    with h5py.File(path, "r+") as h5:
        change(h5)
    return read_packing(path)


EDITS = {
    "a position": lambda h5: h5["positions"].__setitem__((5, 0), h5["positions"][5, 0] + 1e-9),
    "a low part": lambda h5: h5["positions_low"].__setitem__((5, 0), 1e-18),
    "a radius": lambda h5: h5["radii"].__setitem__(5, 1e-300),
    "the potential": lambda h5: h5.attrs.update(potential="hertzian"),
    "the fingerprint": lambda h5: h5.attrs.update(proof_fingerprint="0" * 64),
    "no fingerprint": lambda h5: h5.attrs.__delitem__("proof_fingerprint"),
    "another method": lambda h5: h5.attrs.update(negative_modes_counted_by="LU"),
    "modes": lambda h5: h5.attrs.update(negative_modes=2),
}


@pytest.mark.parametrize("edit", EDITS)
def test_what_is_edited_has_no_proof(path, edit):
    disks = edited(path, EDITS[edit])
    assert not proved_minimum(disks)
    told = describe.describe_packing(path, disks)
    assert "for other coordinates; ignored" in told and "proved" not in told


@pytest.mark.scalar("real")
def test_a_sweep_counts_anew_what_was_forged_or_edited(session, shared_path):
    proved, forged = with_proof(published()), {"negative_modes": 0, "negative_modes_counted_by": PROVED_BY}
    stolen = forged | {"proof_fingerprint": published().fingerprint}
    moved = proved.replace(offset=proved.offset + 1e-9 * np.eye(16, 2))
    for disks, method, says in (
        (proved, "rational", "proved when the packing was made"),
        (lattice().with_record(**forged), "direct", "no: 14 negative modes"),
        (lattice().with_record(**stolen), "direct", "no: 14 negative modes"),
        (moved, "rational", "proved by Cholesky's factorisation of K"),
    ):
        to = Outlet()
        sweep_of(put(shared_path / "p.h5", disks, session.comm), physics(), [1.0]).work(to)
        attributes = to.result.attributes
        assert attributes["method"] == method and says in attributes["positive_semidefinite"]


@pytest.mark.scalar("real")
def test_modes_count_anew_what_was_forged(session):
    proof = with_proof(published()).record
    with pytest.raises(InputError, match="K has 14 negative modes"):
        Modes(lattice().with_record(**proof), count=3).work(Outlet())
    for prestress in (True, False):
        to = Outlet()
        Modes(polydisperse()[0].with_record(**proof), count=3, prestress=prestress).work(to)
        assert len(to.result["eigenvalues"]) >= 3
