"""A run of `oscillate`: every point in its place, whoever solved it, and what becomes of those that fail."""

import numpy as np
import pytest
from oscillations import stepped_oscillation
from samples import SAMPLES, lattice, physics, polydisperse, published, put
from sweeps import Sweep

from jampetsc.commands.oscillate import Oscillate
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.io.outlet import Outlet
from jampetsc.io.reader import load
from jampetsc.oscillation import run
from jampetsc.oscillation.halfcycles import SteppedOscillation
from jampetsc.oscillation.response import Drive
from jampetsc.oscillation.steady import Steady, SteadyOscillation
from jampetsc.petsc.session import current

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(2)]
OMEGA = {1.0: (0.1, 1.0), 0.4: (1e-8, 1e-7)}


@pytest.fixture
def packing(session, shared_path):
    return put(shared_path / "p.h5", published(), session.comm)


def ask(
    packing,
    alpha=1.0,
    contacts="fixed",
    amplitude=(1e-5, 1e-4),
    omega=None,
    out="o.h5",
    stress=True,
    **options,
):
    """The job, and where its result goes."""
    how = {"stress" if stress else "strain": amplitude, "omega": OMEGA[alpha] if omega is None else omega}
    how |= {"contacts": contacts, "cycles": 3 if contacts == "moving" else None, "steps": 16, "alpha": alpha}
    out = packing.parent / out
    return Oscillate(packing, physics(rotations=False).law, **how, **options), Outlet(out, out)


def left_behind(packing):
    others = (path for path in packing.parent.iterdir() if path != packing and path.suffix != ".parts")
    return sorted(path.name for path in others)


@pytest.mark.parametrize("contacts", ["fixed", "moving"])
def test_every_point_is_in_its_place(packing, contacts):
    """G* grows with ω, and work says which strain there was; of moving contacts three points, for two ranks."""
    asked, to = ask(packing, 1.0, contacts, *(((1e-4,), (0.03, 0.3, 1.0)) if contacts == "moving" else ()))
    arrays = run.solve(asked, to)
    current().comm.barrier()
    file = load(to.path)
    facts = {"control": "stress", "contacts": contacts, "steps": 16, "alpha": 1.0, "regularisation": 0.0}
    facts |= {"solver": {"fixed": "cycle", "moving": "steps"}[contacts]}
    assert {name: file.attributes[name] for name in facts} == facts
    shape = len(asked.amplitude), len(asked.omega)
    for name, values in arrays.items():
        np.testing.assert_array_equal(file[name], values)
        assert values.shape[:2] == shape and np.all(np.isfinite(values))
        assert (values.dtype.kind == "i") == (name in run.COUNTS)
    G, strain = arrays["G"], asked.amplitude[:, None] / abs(arrays["G"])
    np.testing.assert_allclose(arrays["work"], np.pi * G.imag * strain**2, rtol=1e-3)
    assert np.all(np.diff(abs(G), axis=1) > 0.0)
    np.testing.assert_array_equal(file["omega"], asked.omega)
    np.testing.assert_array_equal(file["amplitude"], asked.amplitude)
    assert left_behind(packing) == ["o.h5"]


def failing(monkeypatch, points, solver):
    """From now on these (ω, amplitude) fail; the list of what is solved, by this rank."""
    real, seen = solver.solve, []

    def solve(self, point):
        seen.append((point.omega, point.amplitude))
        if seen[-1] in points:
            raise ConvergenceError("something went wrong")
        return real(self, point)

    monkeypatch.setattr(solver, "solve", solve)
    return seen


@pytest.mark.usefixtures("reporting")
@pytest.mark.parametrize(("alpha", "solver"), [(1.0, SteadyOscillation), (0.4, SteppedOscillation)])
def test_what_fails_is_left_out_and_tried_again(monkeypatch, session, packing, capfd, alpha, solver):
    """On whichever rank: the others are kept and in the file, and only what is missing is done next time."""
    (asked, to), omega = ask(packing, alpha), OMEGA[alpha]
    bad = [(omega[1], 1e-5), (omega[0], 1e-4)]  # one on each rank
    with monkeypatch.context() as patch:
        failing(patch, bad, solver)
        with pytest.raises(ConvergenceError) as told:
            run.solve(asked, to)
    named = f"omega {omega[1]:.3e}  stress 1.0e-05: something went wrong"
    assert str(told.value) == f"2 of 4 points failed, the others are in {to}; the first: {named}"
    session.comm.barrier()
    shown = session.comm.bcast(capfd.readouterr().err)
    assert shown.count("failed: ") == 2 and f"failed: {named}" in shown
    first = {name: load(to.path)[name] for name in ("G", "error", "newton_steps")}
    missing = [[False, True], [True, False]]
    assert np.isnan(first["G"]).tolist() == np.isnan(first["error"]).tolist() == missing
    assert (first["newton_steps"] == 0).tolist() == missing
    with monkeypatch.context() as patch:
        seen = failing(patch, [], solver)
        arrays = run.solve(asked, to)
    everyone = session.comm.allgather(seen)
    solved = {tuple(point) for points in everyone for point in points}
    assert solved == set(bad)
    shown = session.comm.bcast(capfd.readouterr().err)
    assert "2 points are finished" in shown and "[4/4]" in shown
    kept = ~np.isnan(first["G"])
    np.testing.assert_array_equal(arrays["G"][kept], first["G"][kept])
    strain = asked.amplitude[:, None] / abs(arrays["G"])
    np.testing.assert_allclose(arrays["work"], np.pi * arrays["G"].imag * strain**2, rtol=1e-3)
    told = load(to.path).attributes
    expected = ("cycle", 0.0) if alpha == 1.0 else ("steps", 1e-5**alpha)
    assert (told["solver"], told["regularisation"]) == pytest.approx(expected)
    assert left_behind(packing) == ["o.h5"]


@pytest.mark.parametrize(("alpha", "solver"), [(1.0, SteadyOscillation), (0.4, SteppedOscillation)])
def test_where_all_fail_there_is_no_file(monkeypatch, packing, alpha, solver):
    asked, to = ask(packing, alpha)
    failing(monkeypatch, [(o, a) for o in OMEGA[alpha] for a in asked.amplitude], solver)
    with pytest.raises(ConvergenceError, match=r"omega 1.*e-0.  stress 1.0e-05: something went wrong$"):
        run.solve(asked, to)
    assert not to.path.exists()


@pytest.mark.most_ranks(1)
def test_which_solver(monkeypatch, packing):
    """A cycle at once down to α = 0.45; below, steps in time, also for the start of moving contacts."""
    omega, strain = (1e-6,), (1e-3,)
    solvers = []
    for alpha in (0.45, 0.449):
        run.solve(*ask(packing, alpha, "fixed", strain, omega, f"{alpha}.h5"))
        current().comm.barrier()
        solvers.append(load(packing.parent / f"{alpha}.h5").attributes["solver"])
    assert solvers == ["cycle", "steps"]
    seen = [failing(monkeypatch, [], solver) for solver in (SteadyOscillation, SteppedOscillation)]
    for alpha in (0.5, 0.4):
        run.solve(*ask(packing, alpha, "moving", (1e-7,), (1e-12,), f"m{alpha}.h5", False))
        counts = [sum(current().comm.allgather(len(one))) for one in seen]
        assert counts == ([1, 0] if alpha == 0.5 else [1, 1])


@pytest.mark.parametrize("alpha", [1.0, 0.4])
def test_prestress_and_stiffness_are_those_asked_for(session, packing, alpha):
    """On all ranks together and on each alone."""
    disks = SAMPLES["k = 2.5"]()
    put(packing, disks, session.comm)
    omega, strain = OMEGA[alpha][:1], 1e-4
    asked = ask(packing, alpha, "fixed", (strain,), omega, stress=False, prestress=False)
    found = run.solve(*asked)["G"][0, 0]
    law = physics(exponent=alpha, rotations=False, prestress=False)
    if alpha == 1.0:
        sweep = Sweep(disks, law, np.array(omega), 1e-8, session.comm).solved()
        exact = sweep.G[0]
    else:
        with session.alone():
            exact = stepped_oscillation(disks, law, 16).solve(Drive(omega[0], strain, False)).G
    assert found == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("alpha", [1.0, 0.4])
def test_a_packing_that_is_no_minimum_is_named(session, packing, alpha):
    put(packing, lattice(), session.comm)
    with pytest.raises(InputError, match=f"^{packing}: K has 14 negative modes"):
        run.solve(*ask(packing, alpha))
    assert left_behind(packing) == []


@pytest.mark.most_ranks(1)
@pytest.mark.parametrize(("alpha", "contacts"), [(1.0, "fixed"), (0.4, "fixed"), (1.0, "moving")])
def test_no_stress_is_imposed_on_what_shears_by_itself(session, packing, alpha, contacts):
    """K is positive and G₀ negative: held by a strain, such a packing answers, but no stress holds it."""
    put(packing, polydisperse(6)[0], session.comm)
    with pytest.raises(InputError, match=f"^{packing}: its shear modulus is -0.072: no stress"):
        run.solve(*ask(packing, alpha, contacts))
    assert left_behind(packing) == []
    if alpha == 1.0 and contacts == "fixed":
        G = run.solve(*ask(packing, alpha, stress=False, omega=(1e-6,)))["G"]
        np.testing.assert_allclose(G.real, -0.0724275937399935, rtol=1e-6)


def test_what_a_file_has_of_a_response():
    """Numbers that there are, and nothing else that a solver hands on."""
    common = {"G": 1.0 + 2.0j, "error": 3.0, "work": 6.0, "energy_balance": -7.0, "newton_steps": 8}
    common |= {"linear_iterations": 0, "drift": 0.0}
    steady = Steady(**common, harmonics=np.array([4.0, 5.0j]), speed=9.0, velocity=None)
    assert steady.record() == common | {"harmonics": [4.0, 5.0j]}
