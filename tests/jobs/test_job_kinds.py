"""What jobs take for a packing or a result: a file, or what lies in memory."""

import pytest

from jampetsc.asking.kinds import HELD, PACKING, RESULT, opened
from jampetsc.io.memory import MemoryWriter
from jampetsc.io.reader import collected


def test_a_result_in_memory_is_taken_as_it_is_and_one_in_a_file_by_its_name(tmp_path):
    found = collected(MemoryWriter("jampetsc-quasistatic"))
    assert RESULT.read(found) is HELD.read(found) is opened(found) is found
    with pytest.raises(ValueError, match="must be a packing"):
        PACKING.read(found)
    found.save(tmp_path / "a.h5")
    assert RESULT.read(found) == PACKING.read(found) == str(tmp_path / "a.h5")
    assert opened(RESULT.read(found)).attributes["run_id"] == found.attributes["run_id"]
