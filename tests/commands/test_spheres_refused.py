"""What is of disks in a plane says so of packings and networks in three dimensions, in one line."""

import pytest
from spheres import few_spheres

import jampetsc
from jampetsc.errors import InputError


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(1)
def test_oscillations(session):
    with pytest.raises(InputError, match="three-dimensional"):
        jampetsc.oscillate(few_spheres(), omega=[1.0], stress=[1e-6])
