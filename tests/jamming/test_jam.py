"""`jampetsc jam`: samples against an independent program, the same on any number of ranks and after a kill."""

import shutil

import numpy as np
import pytest
import reference_disks
from sheared import stop_after

import jampetsc
from jampetsc.analysis.jammed_samples import assortativity
from jampetsc.errors import ConvergenceError
from jampetsc.jamming import samples
from jampetsc.jamming.sample_protocol import SampleProtocol
from jampetsc.jamming.samples import find_jamming_density, sample_seed
from jampetsc.jamming.stepwise_shear import ENERGY_CUT, MinimumState, StepwiseShear, quench
from jampetsc.minimisation.minimise import settle
from jampetsc.minimisation.protocols import random_start
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import find_contacts, net_forces
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential

POTENTIAL = Potential("harmonic", "inverse-square-diameter")


def one_rank(test):
    """A test on PETSc to which more ranks add nothing."""
    return pytest.mark.scalar("real")(pytest.mark.most_ranks(1)(test))


@pytest.fixture
def solver(session):
    """The solver that proves minima."""
    from jampetsc.petsc.hessian_solver import NewtonSolver

    return NewtonSolver()


def random_disks(n, phi, seed=1, potential=POTENTIAL, unit=1.0, **more):
    """Bidisperse disks at random places."""
    return random_start(unit * radii_of("bidisperse", n), phi, seed, potential, **more)


GIVEN = {"n": 32, "phi": [0.82, 0.86], "seeds": "3:8"}


def run(out, **more):
    """Samples in a file."""
    return jampetsc.jam(**GIVEN | more, out=out)


@pytest.mark.scalar("real")
def test_the_file(session, shared_path):
    result = run(shared_path / "jam.h5")
    assert np.array_equal(result["phi"], np.repeat([0.82, 0.86], 6))
    assert np.array_equal(result["seed"], np.tile(np.arange(3, 9), 2))
    jammed, energy, pressure = (result[name] for name in ("jammed", "energy", "pressure"))
    assert np.array_equal(jammed == 1, energy > ENERGY_CUT)
    dense = result["phi"] > 0.85
    assert jammed[dense].mean() > 0.5 > jammed[~dense].mean()
    assert (pressure[jammed == 1] > 0).all()
    assert (result["contact_number"][dense & (jammed == 1)] > 3.2).all()
    with session.alone():  # samples are shared between ranks
        one = jampetsc.jam(**GIVEN)
    assert np.array_equal(one["seed"], result["seed"])
    assert np.allclose(one["energy"], energy, rtol=1e-6, atol=1e-20)


@one_rank
def test_samples_at_neighbouring_packing_fractions_are_independent(session):
    """From the same places they would have the same energies; rounding of φ makes no others."""
    found = jampetsc.jam(n=16, phi=[0.88, 0.88 + 1e-9], seeds="1:3")["energy"].reshape(2, 3)
    assert (np.abs(found[0] / found[1] - 1.0) > 1e-3).all()
    assert np.allclose(jampetsc.jam(n=16, phi=[0.88 + 1e-16], seeds="1:3")["energy"], found[0], rtol=1e-6)


@one_rank
def test_a_killed_run_continues(session, tmp_path, monkeypatch):
    whole = run(tmp_path / "whole.h5")
    monkeypatch.setitem(samples.BATCH_SIZE, "random", 5)
    stop_after(monkeypatch, 1)
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "out.h5")
    shutil.copytree(tmp_path / "out.h5.resume", tmp_path / "other.h5.resume")
    parts = run(tmp_path / "out.h5")
    other = run(tmp_path / "other.h5", protocol="compress", cooling_rate=1, seeds="3:3")
    assert len(other["phi_J"]) == 2  # from the beginning: the checkpoint is that of another protocol
    (tmp_path / "other.h5").unlink()
    assert np.array_equal(whole["energy"], parts["energy"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.h5", "whole.h5"]


def rows(solver, protocol, phi, seed=1):
    """Samples of one seed, made as the command makes them."""
    return sample_seed(protocol, 1.2 * radii_of("bidisperse", 24), phi, seed, POTENTIAL, solver, 1e-6)


@one_rank
def test_a_sample_is_brought_to_its_jamming_density(solver):
    protocol = SampleProtocol("compress", temperature=1e-2, cooling_rate=0.1, sweeps=10)
    loose, dense = (rows(solver, protocol, phi)[0] for phi in (0.8, 0.88))
    assert loose["jammed"] == 0 and dense["jammed"] == 1
    for row in (loose, dense):
        assert 0.8 < row["phi_J"] < 0.88 and -1 < row["segregation"] < 1
    again, other = (rows(solver, protocol, 0.88, seed)[0] for seed in (1, 2))
    assert again == dense != other


@one_rank
def test_sizes_that_are_separated_are_mixed_by_shear(solver):
    """The start is as dense on both sides; the search for φ_J begins with the state at the end of the shear."""
    start = random_disks(24, 0.84, separated=True)
    large = start.radii > start.radii.mean()
    x = start.positions[:, 0] / start.cell[0, 0]
    edge = np.sum(start.radii[large] ** 2) / np.sum(start.radii**2)
    assert x[large].max() <= edge <= x[~large].min() and start.phi == pytest.approx(0.84)
    mixed = random_disks(24, 0.84)
    assert np.array_equal(np.sort(start.positions[:, 1]), np.sort(mixed.positions[:, 1]))
    cold = {"temperature": 1e-6, "cooling_rate": 2.0, "sweeps": 0, "separated": True}
    protocols = (SampleProtocol("compress", **cold, **more) for more in ({}, {"step": 0.02, "strain": 2.0}))
    before, after = (rows(solver, protocol, 0.84)[0] for protocol in protocols)
    assert before["segregation"] > 0.3 > 0.15 > after["segregation"]
    assert after["phi_J"] == pytest.approx(before["phi_J"], abs=0.03) and after["phi_J"] != before["phi_J"]


@one_rank
@pytest.mark.parametrize("exponent", [2.0, 2.25, 2.5])
def test_an_independent_program_finds_the_same_states(solver, exponent):
    """Quench, shear and search for φ_J, from the same minimum, by forces over all pairs and scipy."""
    law = Potential(exponent=exponent, stiffness="inverse-square-diameter")
    start = settle(random_disks(16, 0.88, potential=law, unit=1.2), 1e-4)
    disks, minimum = quench(start, solver, 1e-8)
    assert minimum.jammed
    alpha, side = law.exponent, disks.cell[0, 0]
    _, *row = reference_disks.quenched(disks.positions, disks.radii, side, 0.0, alpha)
    assert row == [pytest.approx(minimum.energy / 16, rel=1e-7), pytest.approx(minimum.pressure, rel=1e-7)]
    slow, found = StepwiseShear(disks, 2e-3, solver, 1e-8), []
    for _ in range(4):  # before disks rearrange: which state they fall into then is a matter of rounding
        slow.advance()
        found.append((slow.minimum.energy / 16, slow.minimum.pressure))
    _, *rows = reference_disks.sheared(disks.positions, disks.radii, side, 2e-3, 4, alpha)
    assert np.allclose(np.transpose(rows), found, rtol=1e-5) and np.ptp(rows[1]) > 0.01 * rows[1][0]
    phi_J, _ = find_jamming_density(disks, True, solver, 1e-8)
    width = 3e-4  # of the bracket there
    assert (
        abs(reference_disks.jamming_density(disks.positions, disks.radii, side, alpha, width) - phi_J) < width
    )


@pytest.mark.scalar("real")
@pytest.mark.most_ranks(2)
def test_results_of_other_protocols(session):
    result = jampetsc.jam(**GIVEN | {"seeds": "3:4"}, protocol="compress", cooling_rate=0.5)
    assert result.attributes["protocol"] == "compress" and result.attributes["cooling_rate"] == 0.5
    assert result.attributes["temperature"] == 1e-3 and "step" not in result.attributes
    assert result["phi_J"].shape == result["segregation"].shape == (4,)
    if session.size > 1:
        return
    assert "separated" not in result.attributes
    sheared = {"separated": True, "protocol": "shear", "strain": 0.3, "discard": 0.1, "step": 0.02}
    result = jampetsc.jam(**GIVEN | {"seeds": "3:4"}, **sheared)
    assert len(result["strain"]) == 4 * 10 and set(result["seed"]) == {3, 4}
    assert result.attributes["separated"]
    assert np.array_equal(result["phi"], np.repeat([0.82, 0.86], 20))


@one_rank
@pytest.mark.parametrize(
    ("every", "discard", "strain", "strains"),
    [
        (0.1, 0.1, 0.7, [0.2, 0.3, 0.4, 0.5, 0.6, 0.7]),  # (0.7 − 0.1)/0.1 is a little less than 6
        (0.2, 0.1, 0.3, [0.3]),
        (0.3, 0.3, 0.91, [0.6, 0.9]),  # the nearest number of steps: 0.3/0.1 is a little less than 3
        (0.26, 0.26, 0.79, [0.6, 0.9]),
        (0.24, 0.34, 0.83, [0.5, 0.7]),
        (0.04, 0.2, 0.4, [0.3, 0.4, 0.5, 0.6, 0.7]),  # one step at least
    ],
)
def test_samples_are_a_whole_number_of_steps_apart(solver, every, discard, strain, strains):
    protocol = SampleProtocol("shear", step=0.1, strain=strain, discard=discard, every=every)
    assert [row["strain"] for row in rows(solver, protocol, 0.7)] == pytest.approx(strains)


def test_a_liquid_starts_without_deep_overlaps(monkeypatch):
    """Thermal moves begin with the relaxed start, at T in units of k."""
    asked = []

    def record(disks, *given):
        asked.append((net_forces(disks.n, find_contacts(disks)), given))
        return disks

    monkeypatch.setattr(samples, "annealed", record)
    monkeypatch.setattr(samples, "quench", Densities(0.8, lost=1))
    protocol = SampleProtocol("compress", temperature=0.1, cooling_rate=0.7, sweeps=3)
    law = Potential("harmonic", "inverse-square-diameter", 8.0)
    start = random_disks(16, 0.9, potential=law)
    (row,) = sample_seed(protocol, radii_of("bidisperse", 16), 0.9, 1, law, None, 1e-6)
    assert np.isnan(row["energy"])
    forces, (heat, *given, _) = asked[0]
    assert np.abs(net_forces(16, find_contacts(start))).max() > 0.1 and np.abs(forces).max() < 1e-4
    assert heat == pytest.approx(0.8) and given == [0.7, 3]


class Densities:
    """In place of `quench`: disks jam from φ_J on; the minimum number `lost` is not found."""

    def __init__(self, phi_J, lost=None):
        self.phi_J, self.lost, self.asked = phi_J, lost, []

    def __call__(self, disks, *_):
        self.asked.append(disks.phi)
        if len(self.asked) == self.lost:
            raise ConvergenceError("lost")
        return disks, MinimumState(0.0, 0.0, 0.0, disks.phi >= self.phi_J, 0.0)


@pytest.mark.parametrize("phi_J", [0.8, 0.84321, 0.9])
def test_a_jamming_density_is_bracketed(monkeypatch, phi_J):
    """From either side, from jammed states to looser ones; not if one minimum is not found."""
    disks = random_disks(16, 0.85)

    def search(**more):
        quench = Densities(phi_J, **more)
        monkeypatch.setattr(samples, "quench", quench)
        return *find_jamming_density(disks, phi_J <= 0.85, None, 1e-6), quench.asked

    found, loosest, asked = search()
    assert abs(found - phi_J) <= 1e-5 and phi_J <= loosest.phi <= phi_J + 1.01e-5
    assert loosest.phi - found == pytest.approx(2e-3 / 2**9, rel=1e-3)  # the middle of the last bracket
    steps = abs(phi_J - 0.85) / 2e-3
    assert steps + np.log2(2e-3 / 1e-5) < len(asked) < steps + 12  # halved from 0.002 to 1e-5
    for lost in range(1, len(asked) + 1):
        with pytest.raises(ConvergenceError, match="lost"):
            search(lost=lost)


def test_the_search_for_a_jamming_density_ends(monkeypatch):
    quench = Densities(2.0)
    monkeypatch.setattr(samples, "quench", quench)
    disks = random_disks(16, 0.95)
    with pytest.raises(ConvergenceError, match="no jammed state"):
        find_jamming_density(disks, False, None, 1e-6)
    assert samples.MAX_SEARCH_PHI - samples.PHI_STEP < quench.asked[-1] <= samples.MAX_SEARCH_PHI + 1e-12


def test_a_sample_whose_minimum_is_not_found_is_nan(monkeypatch):
    """Under shear also all samples after it."""

    def lost(*_, **__):
        raise ConvergenceError("no minimum")

    for name in ("quench", "StepwiseShear"):
        monkeypatch.setattr(samples, name, lost)
    hot = SampleProtocol("compress", temperature=1e-3, cooling_rate=2.0, sweeps=1)
    slow = SampleProtocol("shear", step=0.01, strain=0.05, discard=0.01, every=0.01)
    for protocol, count in ((SampleProtocol(), 1), (hot, 1), (slow, 4)):
        rows = sample_seed(protocol, radii_of("bidisperse", 16), 0.7, 5, POTENTIAL, None, 1e-6)
        assert len(rows) == count
        for row in rows:
            assert (row.pop("phi"), row.pop("seed")) == (0.7, 5)
            assert row.keys() == set(protocol.columns) - {"phi", "seed"}
            assert np.isnan(list(row.values())).all()


@pytest.mark.parametrize("gap, found", [(0.199, 1.0), (0.201, np.nan)])
def test_neighbours_are_a_fifth_of_a_diameter_apart_at_most(gap, found):
    """Mean diameter 0.9: of two pairs, each of one size, only closer ones are counted."""
    apart = np.array([1.0, 0.8]) + gap * 0.9
    places = [[0.0, 0.0], [apart[0], 0.0], [5.0, 0.0], [5.0 + apart[1], 0.0]]
    disks = Packing.from_positions(places, [0.5, 0.5, 0.4, 0.4], 12 * np.eye(2))
    assert samples.segregation(disks) == pytest.approx(found, nan_ok=True)


def test_assortativity_of_a_star():
    """The centre, of one kind, touches three of the other. Half of the ends are of each kind, all pairs unlike: −1."""
    assert assortativity([True, False, False, False], np.zeros(3, int), np.arange(1, 4)) == -1.0
    some = assortativity([True, True, False, False], np.array([0, 0, 0]), np.array([1, 2, 3]))
    assert some == pytest.approx((1 / 3 - (16 + 4) / 36) / (1 - (16 + 4) / 36))
    none = np.zeros(0, int)
    assert np.isnan(assortativity([True, False], none, none))
    kind, i = np.repeat([True, False], 50), np.arange(100)
    assert assortativity(kind, i, np.roll(i, 2)) > 0.9  # a row of one kind beside a row of the other
    assert np.isnan(assortativity(np.ones(100), i, np.roll(i, 1)))
