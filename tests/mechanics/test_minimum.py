"""The proof that a packing is a minimum holds for the disks it was made from, and for no others."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from samples import lattice, polydisperse, published, put, run_of

from jampetsc.core.disks import GRID, Disks
from jampetsc.core.laws import Physics, damping_law
from jampetsc.core.minimum import PROVED_BY, proved_minimum, with_proof
from jampetsc.core.potentials import Potential
from jampetsc.errors import InputError
from jampetsc.io.packing_file import read_packing, write_packing
from jampetsc.jobs import describe


@pytest.fixture
def path(tmp_path):
    write_packing(tmp_path / "p.h5", with_proof(published()))
    return tmp_path / "p.h5"


def test_a_proof_survives_a_file(path):
    disks = published()
    assert read_packing(path).fingerprint == disks.fingerprint
    assert proved_minimum(read_packing(path))
    assert not proved_minimum(disks)


def test_a_coordinate_is_the_same_however_base_and_offset_share_it():
    disks = published()
    fine = GRID * 2.0**-26
    disks = replace(disks, offset=fine * np.round(disks.offset / fine))  # leaves room for a grid step
    moved = replace(disks, base=disks.base + GRID, offset=disks.offset - GRID)
    assert not np.array_equal(moved.base, disks.base)
    assert moved.fingerprint == disks.fingerprint


def test_everything_that_forces_follow_from_is_in_the_fingerprint():
    disks = published()
    ulp = np.zeros((16, 2))
    ulp[5, 1] = 1e-23
    radii = disks.radii.copy()
    radii[3] = np.nextafter(radii[3], 0)
    others = [
        replace(disks, offset=disks.offset + ulp),
        replace(disks, radii=radii),
        replace(disks, cell_offset=disks.cell_offset + np.diag([1e-23, 0])),
        replace(disks, potential=Potential("hertzian")),
        replace(disks, potential=Potential(stiffness="inverse-square-diameter")),
        replace(disks, potential=Potential(k=1.0 + 1e-15)),
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
    "a list": lambda h5: h5.attrs.update(negative_modes=[0, 0], proof_fingerprint=[1.0, 2.0]),
}


@pytest.mark.parametrize("edit", EDITS)
def test_what_is_edited_has_no_proof(path, edit):
    disks = edited(path, EDITS[edit])
    assert not proved_minimum(disks)
    told = describe.packing(path, disks)
    assert "it counts for nothing" in told
    assert "proved" not in told


def test_info_tells_of_a_proof(path):
    told = describe.packing(path, read_packing(path))
    assert f"proved when it was made: {PROVED_BY}" in told
    assert "note" not in told


@pytest.mark.scalar("real")
def test_a_sweep_counts_anew_what_was_forged_or_edited(session, shared_path):
    from jampetsc.linear.stability import settle

    def settled(disks, edit=None):
        path = shared_path / "p.h5"
        if session.rank == 0:
            write_packing(path, disks)
            if edit:
                edited(path, edit)
        session.comm.Barrier()
        job = run_of(path, Physics(damping_law()), [1.0])
        session.comm.Barrier()
        return job.negative_modes, settle(job)

    known, job = settled(with_proof(published()))
    assert known == 0
    assert job.method == "rational"
    assert job.positive_semidefinite == "proved when the packing was made"

    forged = lattice().with_record(negative_modes=0, negative_modes_counted_by=PROVED_BY)
    known, job = settled(forged)
    assert known is None
    assert (job.negative_modes, job.method) == (14, "direct")
    _, job = settled(forged.with_record(proof_fingerprint=published().fingerprint))
    assert job.negative_modes == 14

    known, job = settled(with_proof(published()), EDITS["a position"])
    assert known is None
    assert job.negative_modes == 0
    assert job.positive_semidefinite == "proved by Cholesky's factorisation of K"


@pytest.mark.scalar("real")
def test_modes_count_anew_what_was_forged(session, shared_path):
    from jampetsc.io.outlet import Outlet
    from jampetsc.linear import modes_file

    path, other = (shared_path / name for name in ("p.h5", "q.h5"))
    proof = with_proof(published()).record
    put(path, lattice().with_record(**proof), session.comm)
    put(other, polydisperse()[0].with_record(**proof), session.comm)
    with pytest.raises(InputError, match="K has 14 negative modes"):
        modes_file.run(path, Outlet(), True, 3)
    for prestress in (True, False):
        assert len(modes_file.run(other, Outlet(), prestress, 3).eigenvalues) >= 3


def test_disks_of_one_piece_of_code_and_of_another_are_the_same():
    a = Disks.from_positions([[0.0, -0.0], [1.0, 1.0]], [0.5, 0.5], 4 * np.eye(2))
    b = Disks.from_positions([[-0.0, 0.0], [1.0, 1.0]], [0.5, 0.5], 4 * np.eye(2))
    assert a.fingerprint == b.fingerprint  # minus zero is zero
