"""Results in memory: what `load` gives for the file of the same result, and the same file when they are saved."""

import pickle

import numpy as np
import pytest

from jampetsc.errors import InputError
from jampetsc.io.reader import collected, load
from jampetsc.io.result_file import ResultWriter

VALUES = {
    "text": "a·b", "undecodable": "x\udcff", "true": True, "whole": np.int64(3), "real": 0.1, "one": [2.5],
    "list": (1.0, 2.0), "words": ["a", "bc"], "nothing": None, "single": np.float32(0.5), "bytes": b"ab",
}  # fmt: skip


def assert_same(found, expected):
    """Two results hold the same; distributed arrays of the first are rows of the second."""
    assert type(found) is type(expected) and list(found) == list(expected)
    assert set(found.attributes) == set(expected.attributes) > {"run_id"}
    for name, value in expected.attributes.items():
        if name != "run_id":  # every file has another one
            assert type(found.attributes[name]) is type(value)
            assert np.array_equal(found.attributes[name], value), name
    for name in expected:
        array, whole = found.stored(name), expected[name]
        part = whole if array.axis is None else whole[(slice(None),) * array.axis + (array.rows,)]
        assert np.array_equal(array[...], part) and found[name].dtype == whole.dtype, name
        assert array.shape == part.shape and array.dtype == whole.dtype


@pytest.mark.scalar("real")
def test_any_rows_and_attributes(session, shared_path):
    mine = np.random.default_rng(session.rank).random((2, 2 if session.rank or session.size == 1 else 0, 3))
    with ResultWriter(shared_path / "a.h5", "jampetsc-modes", session.comm) as writer:
        writer.attributes(**VALUES)
        writer.dataset("b/one", 1.5)
        writer.dataset("a", np.arange(3))
        writer.distributed("rows", mine, axis=1)
        writer.distributed("none", np.zeros((0, 2)))
        kept = mine[0].copy()
        for entry in range(3):
            kept += entry
            writer.append("grown", kept)
    session.comm.Barrier()
    found, expected = collected(writer), load(shared_path / "a.h5")
    assert_same(found, expected)
    assert str(found.path) == "modes in memory" and repr(found).startswith(
        "<Result modes in memory: a (3,), "
    )
    assert found.file is None and expected.file == shared_path / "a.h5"
    assert found._repr_html_().count("<tr>") == len(found) + len(found.attributes)
    if session.size > 1:
        with pytest.raises(
            InputError, match=rf"distributed over {session.size} ranks\. Copy the result of gathered\(\)"
        ):
            pickle.dumps(found)
    copied = pickle.loads(pickle.dumps(found.gathered()))
    assert_same(copied, expected)
    copied.save(shared_path / f"copy-{session.rank}.h5")
    assert_same(load(shared_path / f"copy-{session.rank}.h5"), expected)
    for path in ("b.h5", "b.h5"):  # onto itself, too
        found.save(shared_path / path)
        session.comm.Barrier()
        again = load(shared_path / path)
        assert_same(found, again)
        assert_same(again, expected)
        assert found.path == again.path and found.attributes["run_id"] == again.attributes["run_id"]
        assert len(list((shared_path / "b.parts").glob("*"))) == (session.size if session.size > 1 else 0)
    own = load(shared_path / "b.h5")
    for _ in range(2):  # onto itself, too
        own.save(shared_path / f"c{session.rank}.h5")
        assert_same(own, expected)
