"""What python drops of PETSc is freed, at the latest with the next factor."""

import gc
import re

import numpy as np
import pytest
from samples import SAMPLES, physics, run_of
from sweeps import Sweep

from jampetsc.io.outlet import Outlet
from jampetsc.jobs.oscillate import Oscillate
from jampetsc.linear import quasistatic as quasistatic_response
from jampetsc.linear.modes import lowest_modes
from jampetsc.linear.quasistatic import solve
from jampetsc.linear.sweep import solve as solve_sweep
from jampetsc.linear.viscosity import Viscosity
from jampetsc.mechanics.assembly import assemble
from jampetsc.mechanics.examine import examine
from jampetsc.mechanics.minimum import negative_modes
from jampetsc.mechanics.network import build_network
from jampetsc.oscillation import run as oscillation
from jampetsc.oscillation.preconditioner import HarmonicPreconditioner
from jampetsc.petsc import mumps
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.inertia import count_below
from jampetsc.petsc.shifted import ShiftedFactor

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(2)]


def network_of(session, sample="published"):
    return build_network(SAMPLES[sample](), session.comm)


def sweep(parallel, law):
    def run(session):
        omega = np.geomspace(1e-4, 1e2, 3)
        found = Sweep(SAMPLES["published"](), law, omega, 1e-6, session.comm, parallel).solved()
        found.galerkin.field_bound(omega[0], found.sweep.error_at(omega[0]))

    return run


def quasistatic(session):
    network = network_of(session)
    for law in (physics().law, physics("stokes").law, physics(rotations=False).law):
        viscosity = Viscosity(network, law)
        solve(network, law, viscosity)
        viscosity.infinite()


def modes(session):
    network = network_of(session)
    lowest_modes(network, 3)
    lowest_modes(network)


def counts(session):
    network = network_of(session, "gears")
    examine(network, physics().law)
    negative_modes(network)
    negative_modes(network_of(session))
    wrong = assemble(network, physics().law)
    wrong.K.scale(-1.0)  # refused for its diagonal alone
    with pytest.raises(NotPositiveDefinite):
        ShiftedFactor(wrong.K.copy(), "K")
    pencil = assemble(network, physics("stokes").law, pinned=False)
    count_below(pencil.K, 0.1, "K")


def jobs(session):
    for method in ("rational", "direct"):
        solve_sweep(run_of(SAMPLES["published"](), physics(), [1e-2, 1.0], [1.0], method))
    quasistatic_response.run(SAMPLES["published"](), Outlet(), physics(), [0.5])


def oscillate(session):
    """A cycle at once, on all ranks and as the start of moving contacts, and steps in time, each on one."""
    packing, law = SAMPLES["published"](), physics(rotations=False).law
    for contacts in ("fixed", "moving"):
        how = {"stress": 1e-6} if contacts == "fixed" else {"strain": 1e-6, "cycles": 3}
        job = Oscillate(packing, law, omega=0.1, steps=16, contacts=contacts, **how)
        oscillation.solve(job, Outlet())
    assert not [one for one in gc.get_objects() if isinstance(one, HarmonicPreconditioner)]  # which SNES held


RUNS = {
    "oscillate": oscillate,
    "jobs": jobs,
    "rational, shifts": sweep("shifts", physics()),
    "rational, matrix": sweep("matrix", physics()),
    "rational, drag": sweep("shifts", physics("stokes")),
    "quasistatic": quasistatic,
    "modes": modes,
    "counts": counts,
}


@pytest.mark.parametrize("name", RUNS)
def test_nothing_of_petsc_waits_for_garbage_collection(session, name):
    """Its objects go with the last reference. In a circle of references they would stay, and factors with them."""
    gc.collect()
    gc.disable()
    try:
        RUNS[name](session)
        gc.set_debug(gc.DEBUG_SAVEALL)
        gc.collect()
        held = [one for one in gc.garbage for item in gc.get_referents(one) if is_petscs(session, item)]
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()
    assert not held


def is_petscs(session, item):
    return isinstance(item, session.PETSc.Object)


def test_a_new_factor_takes_the_memory_of_those_before(session, capfd):
    """PETSc keeps what all ranks have dropped until they free it together."""
    if not hasattr(session.PETSc, "garbage_view"):
        return  # older ones leak
    session.collect()
    network = network_of(session)
    for freed in (False, True):
        assemble(network, physics().law)
        factor = mumps.make_ksp(session.comm, "shift_", {}) if freed else None
        capfd.readouterr()
        session.PETSc.garbage_view(session.comm)
        session.comm.Barrier()
        found = "".join(session.comm.allgather(capfd.readouterr().out))
        left = sum(int(number) for number in re.findall(r"Total entries: (\d+)", found))
        if factor:
            assert left == 0
        else:
            assert left > 0 or session.size == 1  # PETSc 3.18 keeps those of one rank, too
