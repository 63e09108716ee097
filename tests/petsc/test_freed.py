"""What python drops of PETSc is freed, at the latest with the next factor."""

import gc
import re

import pytest
from samples import SAMPLES, physics, published

import jampetsc
from jampetsc.errors import InputError
from jampetsc.petsc import mumps
from jampetsc.petsc.session import current
from jampetsc.response.assembly import assemble
from jampetsc.response.contact_network import build_network
from jampetsc.response.minimum_check import examine

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(2)]
OMEGA, STOKES = (1e-2, 1.0), jampetsc.StokesDrag()


def refused():
    """A packing that is no minimum, whose factorisations fail."""
    with pytest.raises(InputError, match="negative modes"):
        jampetsc.modes(SAMPLES["gears"](), count=3)


RUNS = {
    "shifts": lambda: jampetsc.sweep(published(), omega=OMEGA, fields=1.0, parallel="shifts"),
    "matrix": lambda: jampetsc.sweep(published(), omega=OMEGA, fields=1.0, parallel="matrix"),
    "drag": lambda: jampetsc.sweep(published(), STOKES, omega=OMEGA, fields=1.0),
    "direct": lambda: jampetsc.sweep(published(), omega=OMEGA, fields=1.0, method="direct"),
    "quasistatic": lambda: jampetsc.quasistatic(published(), betas=[0.5]),
    "slow drag": lambda: jampetsc.quasistatic(published(), STOKES),
    "modes": lambda: jampetsc.modes(published(), count=3),
    "all modes": lambda: jampetsc.modes(published(), all=True),
    "refused": refused,
    "counts": lambda: examine(build_network(SAMPLES["gears"](), current().comm), physics().law),
    "fixed": lambda: jampetsc.oscillate(published(), omega=0.1, stress=1e-6, steps=16),
    "moving": lambda: jampetsc.oscillate(
        published(), omega=0.1, strain=1e-6, contacts="moving", cycles=3, steps=16
    ),
    "relaxing": lambda: jampetsc.relax(published(), STOKES, strain=1e-6, times=[0.1], accuracy=0.1),
}


@pytest.mark.parametrize("name", RUNS)
def test_nothing_of_petsc_waits_for_garbage_collection(session, name):
    """Its objects go with the last reference. In a circle of references they would stay, and factors with them."""
    gc.collect()
    gc.disable()
    before = living()
    try:
        RUNS[name]()
        after = living()
        gc.set_debug(gc.DEBUG_SAVEALL)
        gc.collect()
        held = [
            one
            for one in gc.garbage
            for item in gc.get_referents(one)
            if issubclass(type(item), session.PETSc.Object)  # numba leaves weak references without an object
        ]
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()
    assert after <= before and not held


def living():
    """Objects of the package that only PETSc might still refer to, out of sight of python's garbage collection."""
    return {id(one) for one in gc.get_objects() if type(one).__module__.startswith("jampetsc.oscillation")}


def kept(session, capfd, comm):
    """How many objects of `comm` PETSc keeps that all ranks have dropped."""
    capfd.readouterr()
    session.PETSc.garbage_view(comm)
    session.comm.Barrier()
    found = "".join(session.comm.allgather(capfd.readouterr().out))
    return sum(int(number) for number in re.findall(r"Total entries: (\d+)", found))


@pytest.mark.parametrize("job", ["pack", "jam"])
def test_a_job_leaves_nothing_that_petsc_keeps(session, capfd, job):
    """The factors of Newton's method are of one rank; PETSc 3.18 keeps these, too."""
    if not hasattr(session.PETSc, "garbage_view"):
        return  # older ones leak
    session.collect()
    {
        "pack": lambda: jampetsc.pack(n=32, pressure=1e-2, seed=1),
        "jam": lambda: jampetsc.jam(n=32, phi=[0.86], seeds="1:2"),
    }[job]()
    assert kept(session, capfd, session.PETSc.COMM_SELF) == kept(session, capfd, session.comm) == 0


def test_a_new_factor_takes_the_memory_of_those_before(session, capfd):
    """PETSc keeps what all ranks have dropped until they free it together."""
    if not hasattr(session.PETSc, "garbage_view"):
        return  # older ones leak
    session.collect()
    network = build_network(published(), session.comm)
    for freed in (False, True):
        assemble(network, physics().law)
        factor = mumps.make_ksp(session.comm, "shift_", {}) if freed else None
        left = kept(session, capfd, session.comm)
        if factor:
            assert left == 0
        else:
            assert left > 0 or session.size == 1  # PETSc 3.18 keeps those of one rank, too
