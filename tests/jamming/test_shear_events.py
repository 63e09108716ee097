"""`jampetsc shear --events`: changes of contacts and instabilities at their strains, against dense matrices."""

from itertools import product

import numpy as np
import pytest
from dense import all_pairs
from sheared import stop_after

import jampetsc
from jampetsc import loads
from jampetsc.commands.shear import DESCENTS
from jampetsc.errors import InputError
from jampetsc.jamming.event_table import CLOSES, OPENS, UNSTABLE
from jampetsc.laws.loads import LoadChoice

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]  # one run is one process

STEP, STRAIN = 2e-3, 0.06
STARTS = {  # name -> (how the packing is made, what happens)
    "disks": ({"n": 16, "pressure": 1e-2, "seed": 8}, "CU"),
    "soft disks": ({"n": 16, "pressure": 2e-3, "seed": 5, "potential": "hertzian"}, "COUCC"),
    "spheres": ({"n": 16, "pressure": 1e-2, "seed": 4, "dimension": 3}, "OOUCOOOOCCCOC"),
}
LETTERS = "OCUTLH"
UNEVEN = {  # sizes 1:10, with rattlers that are touched and left
    "uneven disks": {"n": 32, "pressure": 1e-2, "seed": 1, "sizes": "uniform:1:10"},
    "uneven soft spheres": {
        "n": 24, "pressure": 1e-2, "seed": 1, "sizes": "uniform:1:10", "dimension": 3, "potential": "hertzian",
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def runs():
    """{name: (packing, its events)}."""
    results = {}
    for name, (start, _) in STARTS.items():
        packing = jampetsc.pack(**start)
        results[name] = packing, jampetsc.shear(packing, step=STEP, strain=STRAIN, discard=0.0, events=True)
    return results


class DensePath:
    """Minima of a packing under a load E, by Newton's method on the contacts there, dense."""

    def __init__(self, packing, load=None):
        self.packing, self.cell = packing, packing.cell
        self.load = load or loads.simple_shear(packing.dimension)
        self.positions, self.strain = packing.positions.copy(), 0.0
        self.alpha, self.k = packing.potential.exponent, packing.potential.k

    def contacts(self):
        """(i, j, r, δ) of overlapping pairs; stiffness `constant`."""
        cell = self.cell @ self._strained.T
        i, j, r = all_pairs(self.positions, self.packing.radii, cell, images=1)
        i, j, r = np.array(i), np.array(j), r.astype(float)
        return i, j, r, self.packing.radii[i] + self.packing.radii[j] - np.sqrt((r**2).sum(axis=1))

    @property
    def _strained(self):
        return np.eye(self.load.dimension) + self.strain * self.load.gradient

    @property
    def _flow(self):
        return self.load.gradient @ np.linalg.inv(self._strained)

    def derivatives(self):
        """(U, dU/dγ, forces (N, D), K (DN, DN), change of the forces by affine motion (N, D))."""
        i, j, r, overlap = self.contacts()
        n, d = self.positions.shape
        f = self.k * overlap ** (self.alpha - 1)
        k = self.k * (self.alpha - 1) * overlap ** (self.alpha - 2)
        distance = np.sqrt((r**2).sum(axis=1))
        normal = r / distance[:, None]
        along = normal[:, :, None] * normal[:, None]
        blocks = k[:, None, None] * along - (f / distance)[:, None, None] * (np.eye(d) - along)
        forces, affine, K = np.zeros((n, d)), np.zeros((n, d)), np.zeros((n, n, d, d))
        for ends, sign in ((j, 1.0), (i, -1.0)):
            np.add.at(forces, ends, sign * f[:, None] * normal)
            np.add.at(affine, ends, -sign * np.einsum("mab,mb->ma", blocks, r @ self._flow.T))
        for row, column, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            np.add.at(K, (row, column), sign * blocks)
        energy, work = (
            float(np.sum(f * overlap) / self.alpha),
            -float(np.sum(f @ (normal * (r @ self._flow.T)))),
        )
        return energy, work, forces, K.transpose(0, 2, 1, 3).reshape(n * d, -1), affine

    @property
    def pressure(self):
        """Σ f r/(D V)."""
        _, _, r, overlap = self.contacts()
        volume = self.packing.volume * np.linalg.det(self._strained)
        distance = np.sqrt((r**2).sum(axis=1))
        return float(self.k * np.sum(overlap ** (self.alpha - 1) * distance) / (self.load.dimension * volume))

    def move_to(self, strain, steps=40):
        """The minimum at another strain, in small steps of strain; whether it was reached."""
        for part in np.linspace(self.strain, strain, 2 + int(abs(strain - self.strain) / 1e-3))[1:]:
            if not self._step_to(part, steps):
                return False
        return True

    def _step_to(self, strain, steps):
        *_, K, affine = self.derivatives()
        motion = (np.linalg.pinv(K, rcond=1e-9) @ affine.ravel()).reshape(affine.shape)
        motion += self.positions @ self._flow.T
        self.positions = self.positions + (strain - self.strain) * motion
        self.strain = strain
        for _ in range(steps):
            energy, _, forces, K, _ = self.derivatives()
            start, move = self.positions, np.linalg.pinv(K, rcond=1e-9) @ forces.ravel()
            for _ in range(8):
                self.positions = start + move.reshape(start.shape)
                if self.derivatives()[0] <= energy * (1 + 1e-13):
                    break
                move *= 0.5
            if np.abs(move).max() < 1e-14:
                break
        return np.abs(move).max() < 1e-9

    def copy(self):
        """Another path from here."""
        other = DensePath(self.packing, self.load)
        other.positions, other.strain = self.positions.copy(), self.strain
        return other

    def touching(self):
        """Overlapping pairs (i, j), with as many entries as images of a pair touch."""
        i, j, *_ = self.contacts()
        return sorted(zip(i.tolist(), j.tolist(), strict=True))


def changed_at(path, end):
    """Strain between that of the path and another at which the contacts change, by bisection; the path stays before."""
    before = path.touching()
    while abs(end - path.strain) > 2e-13:
        middle, trial = 0.5 * (path.strain + end), path.copy()
        assert trial.move_to(middle)
        if trial.touching() == before:
            path.positions, path.strain = trial.positions, trial.strain
        else:
            end = middle
    return 0.5 * (path.strain + end)


@pytest.mark.parametrize("name", STARTS)
def test_contacts_change_at_the_strains_of_a_dense_bisection(runs, name):
    """To 1e-12, up to the first instability; also the pair that changes, and σ and U."""
    packing, result = runs[name]
    assert "".join(LETTERS[kind] for kind in result["events/kind"]) == STARTS[name][1]
    path, last = DensePath(packing), 0.0
    first = int(np.argmax(result["events/kind"] == UNSTABLE))
    for event in range(min(first, 2)):
        strain, kind = result["events/strain"][event], result["events/kind"][event]
        following = result["events/strain"][event + 1]
        low, high = strain - min(1e-7, 0.1 * (strain - last)), strain + min(1e-7, 0.1 * (following - strain))
        assert path.move_to(low)
        before = path.touching()
        exact = changed_at(path, high)
        assert exact == pytest.approx(strain, abs=1e-12)
        energy, stress, _, K, _ = path.derivatives()
        eigenvalues = np.linalg.eigvalsh(K)
        lowest = eigenvalues[eigenvalues > 1e-9][0]
        assert result["events/lowest_eigenvalue"][event] == pytest.approx(lowest, rel=1e-3)
        assert result["events/energy"][event, 0] == pytest.approx(energy, rel=1e-9)
        assert result["events/shear_stress"][event] == pytest.approx(stress / packing.volume, rel=1e-9)
        assert path.move_to(high)
        pair = [tuple(result["events/particles"][event])]
        opened = [a for a in before if before.count(a) > path.touching().count(a)]
        closed = [a for a in path.touching() if path.touching().count(a) > before.count(a)]
        assert (opened, closed) == ((pair, []) if kind == OPENS else ([], pair))
        last = strain


@pytest.mark.parametrize("name", STARTS)
def test_no_minimum_is_near_after_an_instability(runs, name):
    """Up to its strain dense Newton steps follow the minimum; beyond it none continues the path."""
    packing, result = runs[name]
    event = int(np.argmax(result["events/kind"] == UNSTABLE))
    strain, path = result["events/strain"][event], DensePath(packing)
    for nearer in np.geomspace(1e-3, 1e-8, 16):
        assert path.move_to(strain - nearer)
        assert np.linalg.eigvalsh(path.derivatives()[3])[0] > -1e-12
    assert path.derivatives()[0] == pytest.approx(result["events/energy"][event, 0], rel=1e-6)
    beyond = path.copy()
    is_followed = beyond.move_to(strain + 1e-9, steps=100)
    lowest = np.linalg.eigvalsh(beyond.derivatives()[3])[0]
    fallen = np.abs(beyond.positions - path.positions).max() > 1e-4
    assert not is_followed or lowest < -1e-9 or fallen
    assert result["events/drop"][event] > 0.0
    assert 1.0 <= result["events/participation"][event] <= packing.n


def assert_energy_balance(packing, result):
    """∫ V σ dγ by the trapezium rule between rows and events = ΔU + Σ drops; returns its unit."""
    strain = np.concatenate((result["strain"], np.repeat(result["events/strain"], 2)))
    stress = np.concatenate((result["shear_stress"], result["events/shear_stress"].ravel()))
    order = np.argsort(np.abs(strain), kind="stable")
    load = LoadChoice(result.attributes["load"]).of(packing.dimension)[0]
    stress = np.r_[np.sum(packing.stress * load.gradient), stress[order]]
    work = packing.volume * float(np.diff(strain[order], prepend=0.0) @ (0.5 * (stress[1:] + stress[:-1])))
    change = result["energy"][-1] - packing.record["energy"]
    scale = packing.volume * np.abs(stress).max() * np.abs(strain).max()
    assert work == pytest.approx(change + result["events/drop"].sum(), abs=1e-3 * scale)
    return scale


@pytest.mark.parametrize("name", STARTS)
def test_work_is_stored_or_dissipated_in_drops(runs, name):
    packing, result = runs[name]
    scale, drops = assert_energy_balance(packing, result), result["events/drop"].sum()
    assert drops == pytest.approx(result["dissipated"].sum(), rel=1e-9)
    assert drops > 1e-2 * scale
    assert np.array_equal(result["plastic"] == 1, np.diff(np.searchsorted(
        result["events/strain"][result["events/kind"] == UNSTABLE], np.r_[0.0, result["strain"]]
    )) > 0)  # fmt: skip


@pytest.mark.parametrize("name", STARTS)
def test_rows_are_those_of_stepwise_shear_before_the_first_instability(runs, name):
    packing, result = runs[name]
    first = result["events/strain"][result["events/kind"] == UNSTABLE][0]
    rows = int(first / STEP)
    stepwise = jampetsc.shear(packing, step=STEP, strain=rows * STEP, tolerance=1e-11, discard=0.0)
    for column in ("shear_stress", "pressure", "energy", "contact_number"):
        np.testing.assert_allclose(result[column][:rows], stepwise[column], rtol=1e-8)


@pytest.mark.parametrize("name", STARTS)
def test_forward_and_back_below_the_first_instability_is_the_identity(runs, name):
    packing, result = runs[name]
    rows = int(result["events/strain"][result["events/kind"] == UNSTABLE][0] / STEP)
    forth = jampetsc.shear(packing, step=STEP, strain=rows * STEP, events=True, discard=0.0)
    back = jampetsc.shear(forth.last, step=STEP, strain=-rows * STEP, events=True, discard=0.0)
    assert back["strain"][-1] == pytest.approx(-rows * STEP)
    assert back["energy"][-1] == pytest.approx(packing.record["energy"], rel=1e-11)
    moved = back.last.positions - packing.positions
    moved -= np.round(moved @ np.linalg.inv(packing.cell)) @ packing.cell
    moved = moved[~packing.rattlers]
    assert np.abs(moved - moved.mean(axis=0)).max() < 1e-11
    strains = forth["events/strain"]
    np.testing.assert_allclose(rows * STEP + back["events/strain"][::-1], strains, atol=1e-12)
    opposite = {OPENS: CLOSES, CLOSES: OPENS}
    assert [opposite[kind] for kind in back["events/kind"][::-1]] == forth["events/kind"].tolist()


def changed_pairs(result, numbers):
    """[(strain rank, kind, particles)] sorted, events of one strain as one, of particles with these numbers."""
    ends = np.sort(numbers[result["events/particles"]], axis=1).tolist()
    strain = np.abs(result["events/strain"])
    rank = np.cumsum(np.diff(strain, prepend=0.0) > 1e-9)
    return sorted(zip(rank.tolist(), result["events/kind"].tolist(), ends, strict=True))


@pytest.mark.parametrize("name", [*STARTS, *UNEVEN])
def test_events_are_those_of_the_mirrored_packing_moved_relabelled_and_in_other_units(runs, name):
    """Sheared the other way. Units of length and of k, a shift of the origin, and the numbers of the particles."""
    if name in STARTS:
        packing, result = runs[name]
    else:
        packing = jampetsc.pack(**UNEVEN[name])
        result = jampetsc.shear(packing, step=STEP, strain=0.02, events=True, discard=0.0)
    generator, length, k = np.random.default_rng(3), 10.0, 7.0
    order, mirror = generator.permutation(packing.n), np.array([-1.0, 1.0, 1.0])[: packing.dimension]
    cell = length * packing.cell * mirror
    cell[0] *= -1.0
    places = length * (mirror * packing.positions[order] + generator.random(packing.dimension))
    potential = packing.potential.kind, packing.potential.stiffness, k
    other = jampetsc.Packing(places, length * packing.radii[order], cell, *potential)
    strain = -result["strain"][-1]
    mirrored = jampetsc.shear(other, step=STEP, strain=strain, events=True, discard=0.0)
    assert changed_pairs(mirrored, order) == changed_pairs(result, np.arange(packing.n))
    np.testing.assert_allclose(-mirrored["events/strain"], result["events/strain"], rtol=0, atol=1e-10)
    alpha = packing.potential.exponent
    energy, stress = k * length**alpha, k * length ** (alpha - packing.dimension)
    for column, unit, tolerance in (
        ("energy", energy, 1e-7),
        ("drop", energy, 1e-6),
        ("pressure", stress, 1e-7),
        ("shear_stress", -stress, 1e-7),
        ("participation", 1.0, 1e-6),
        ("contacts", 1, 0),
        ("lowest_eigenvalue", k * length ** (alpha - 2), 1e-4),
    ):
        values = unit * result[f"events/{column}"]
        atol = tolerance * np.abs(values).max()
        np.testing.assert_allclose(mirrored[f"events/{column}"], values, rtol=0, atol=atol)


LOADS = {  # load, packing of `runs`, strain
    "pure-xy": ("disks", -0.028),
    "compression": ("spheres", -0.03),
    "0.3,-0.5,0.0,-1.0": ("soft disks", -0.02),
}


@pytest.fixture(scope="module")
def loaded_runs(runs):
    """{load: (packing, its events, `DensePath`)}."""
    results = {}
    for load, (name, strain) in LOADS.items():
        packing, _ = runs[name]
        result = jampetsc.shear(packing, step=STEP, strain=strain, load=load, events=True, discard=0.0)
        results[load] = packing, result, DensePath(packing, LoadChoice(load).of(packing.dimension)[0])
    return results


@pytest.mark.parametrize("load", LOADS)
def test_events_of_any_load_are_at_the_strains_of_a_dense_bisection(loaded_runs, load):
    """Up to the first instability; stress V⁻¹ dU/dγ and p of all rows there, and work = ΔU + Σ drops."""
    packing, result, path = loaded_runs[load]
    assert result.attributes["load"] == load
    sign = np.sign(result["strain"][-1])
    strains, kinds = result["events/strain"], result["events/kind"]
    unstable = np.append(np.flatnonzero(kinds == UNSTABLE), len(kinds))[0]
    assert unstable >= 2
    start = path.copy()
    near = sign * min(1e-7, 0.1 * np.abs(np.diff(strains[:3], prepend=0.0)).min())
    for event in range(2):
        assert path.move_to(strains[event] - near)
        assert changed_at(path, strains[event] + near) == pytest.approx(strains[event], abs=1e-12)
        energy, work, *_ = path.derivatives()
        assert result["events/energy"][event, 0] == pytest.approx(energy, rel=1e-9)
        assert result["events/shear_stress"][event, 1] == pytest.approx(work / packing.volume, rel=1e-9)
        assert path.move_to(strains[event] + near)
    last = np.append(strains, np.inf * sign)[unstable]
    for row in np.flatnonzero(sign * result["strain"] < sign * last)[::3]:
        assert start.move_to(result["strain"][row])
        energy, work, *_ = start.derivatives()
        assert result["shear_stress"][row] == pytest.approx(work / packing.volume, rel=1e-8)
        assert result["pressure"][row] == pytest.approx(start.pressure, rel=1e-8)
    assert_energy_balance(packing, result)


def test_a_load_and_its_reversal_below_the_first_instability_is_the_identity(loaded_runs):
    for packing, result, path in loaded_runs.values():
        unstable = result["events/strain"][result["events/kind"] == UNSTABLE]
        rows = np.count_nonzero(np.abs(result["strain"]) < np.abs(np.append(unstable, np.inf)).min())
        steps = {"step": STEP, "events": True, "discard": 0.0}
        strain = result["strain"][rows - 1]
        forward = jampetsc.shear(packing, strain=strain, load=path.load, **steps)
        E = path.load.gradient @ np.linalg.inv(np.eye(packing.dimension) + strain * path.load.gradient)
        back = jampetsc.shear(forward.last, strain=-strain, load=E, **steps)
        assert back["energy"][-1] == pytest.approx(packing.record["energy"], rel=1e-10)
        forth, return_ = (run["events/strain"][run["events/kind"] <= CLOSES] for run in (forward, back))
        np.testing.assert_allclose(strain + return_[::-1], forth, rtol=0, atol=1e-12)


def test_shear_of_another_plane_is_that_of_the_turned_packing(runs):
    """u_y = γ z of spheres whose axes x, y and z are the former z, x and y."""
    packing, result = runs["spheres"]
    turned = jampetsc.Packing(
        np.roll(packing.positions, 1, axis=1), packing.radii, np.roll(np.diag(packing.cell), 1)
    )
    other = jampetsc.shear(turned, step=STEP, strain=STRAIN, load="yz", events=True, discard=0.0)
    assert changed_pairs(other, np.arange(turned.n)) == changed_pairs(result, np.arange(turned.n))
    np.testing.assert_allclose(other["events/strain"], result["events/strain"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(other["shear_stress"], result["shear_stress"], rtol=1e-9)


def test_every_row_is_a_minimum(runs):
    for packing, _ in runs.values():
        start, step = packing, 0.015
        for _ in range(4):
            start = jampetsc.shear(start, step=step, strain=step, events=True, discard=0.0).last
            dense = DensePath(start)
            assert np.linalg.eigvalsh(dense.derivatives()[3])[0] > -1e-12
            assert np.abs(dense.derivatives()[2]).max() < 1e-13


@pytest.mark.parametrize("descent", DESCENTS)
def test_both_descents_end_in_minima_of_less_energy(runs, descent):
    packing, result = runs["disks"]
    other = jampetsc.shear(packing, step=STEP, strain=0.044, events=True, descent=descent, discard=0.0)
    assert other.attributes["descent"] == descent
    assert other["events/strain"][:2] == pytest.approx(result["events/strain"][:2], abs=1e-13)
    assert other["events/drop"][1] > 0.0 and other["proved"].all()


@pytest.mark.parametrize("descent", DESCENTS)
def test_disks_are_pushed_until_their_descent_begins(descent):
    """However loose the forces are at which a quench ends."""
    packing = jampetsc.pack(n=24, pressure=1e-3, seed=5)
    job = {"step": 1e-3, "strain": 0.01, "events": True, "discard": 0.0, "tolerance": 1e-5}
    result = jampetsc.shear(packing, descent=descent, **job)
    falls = result["events/kind"] == UNSTABLE
    assert falls.any() and (result["events/drop"][falls] > 0.0).all()


def test_a_killed_run_continues_to_the_last_bit(runs, tmp_path, monkeypatch):
    packing, _ = runs["disks"]
    job = {"start": packing, "step": 1e-3, "strain": -0.055, "load": "pure-xy", "events": True, "d2min": True}
    job["discard"] = 0.0
    whole = jampetsc.shear(**job, out=tmp_path / "whole.h5")
    left = stop_after(monkeypatch, 52)
    with pytest.raises(KeyboardInterrupt):
        jampetsc.shear(**job, out=tmp_path / "out.h5")
    parts = jampetsc.shear(**job, out=tmp_path / "out.h5")
    assert left[0] < 0
    for name in (
        "energy",
        "shear_stress",
        "evaluations",
        "events/strain",
        "events/lowest_eigenvalue",
        "events/d2min",
    ):
        assert np.array_equal(whole[name], parts[name])
    assert whole["events/kind"][whole["events/largest"]] == UNSTABLE and (whole["events/d2min"] > 0.0).all()


@pytest.mark.parametrize("name", ["disks", "spheres"])
def test_d2min_is_the_rest_of_a_dense_fit(runs, name):
    """Of the largest drop, by least squares over neighbours with a gap below half a mean diameter."""
    packing, _ = runs[name]
    result = jampetsc.shear(packing, step=STEP, strain=STRAIN, events=True, d2min=True, discard=0.0)
    row = result["events/largest"]
    assert row == np.argmax(result["events/drop"]) and result["events/kind"][row] == UNSTABLE
    places, moved, cell = (result[f"events/{part}"] for part in ("positions", "displacement", "cell"))
    assert cell[1, 0] / cell[1, 1] == pytest.approx(result["events/strain"][row], abs=1e-12)
    before, after = (
        jampetsc.Packing(x, packing.radii, cell, packing.potential.kind) for x in (places, places + moved)
    )
    drop = result["events/energy"][row, 0] - before.record["energy"]
    assert drop == pytest.approx(0.0, abs=1e-9 * before.record["energy"])
    assert after.record["energy"] == pytest.approx(result["events/energy"][row, 1], rel=1e-9)
    reach = packing.radii + packing.radii[:, None] + 0.5 * np.mean(2 * packing.radii)
    for particle in range(packing.n):
        bonds, changes = [], []
        for image in np.array(list(product((-1, 0, 1), repeat=packing.dimension))) @ cell:
            r = places + image - places[particle]
            near = (np.linalg.norm(r, axis=1) < reach[particle]) & (r**2).any(axis=1)
            bonds.append(r[near])
            changes.append((moved - moved[particle])[near])
        bonds, changes = np.concatenate(bonds), np.concatenate(changes)
        fit = np.linalg.lstsq(bonds, changes, rcond=None)[0]
        expected = np.sum((changes - bonds @ fit) ** 2) / len(bonds)
        assert result["events/d2min"][particle] == pytest.approx(expected, rel=1e-9)


def test_a_path_without_events_has_an_empty_table(runs, tmp_path):
    packing, _ = runs["disks"]
    jampetsc.shear(
        packing, step=STEP, strain=STEP, events=True, discard=0.0, d2min=True, out=tmp_path / "out.h5"
    )
    result = jampetsc.load(tmp_path / "out.h5")
    assert result["events/strain"].shape == (0,) and result["events/energy"].shape == (0, 2)
    assert "events/d2min" not in result


@pytest.mark.parametrize(
    ("seed", "potential", "steps"),
    [(1, {"potential": "hertzian"}, 6), (8, {"potential": "power", "exponent": 3.0}, 2)],
)
def test_contacts_that_lose_their_force_are_no_obstacle(session, seed, potential, steps):
    """Eight Hertzian disks that hardly press, at 0.0054; a disk that two contacts without stiffness hold, at 0.0015."""
    packing = jampetsc.pack(n=256, pressure=1e-3, seed=seed, **potential)
    found = jampetsc.shear(packing, step=1e-3, strain=steps * 1e-3, discard=0.0, events=True)
    assert len(found["pressure"]) == steps and np.all(found["jammed"] == 1)


def test_particles_that_come_apart_are_named(session):
    with pytest.raises(Exception, match="particles come apart"):
        jampetsc.shear(n=16, phi=0.7, step=1e-2, strain=0.02, events=True)


@pytest.mark.parametrize(("dimension", "seed"), [(2, 3), (3, 4)])
def test_a_path_ends_where_no_contact_is_left(session, dimension, seed):
    """With all events before; single steps past that strain find no jammed minimum, steps short of it do."""
    packing = jampetsc.pack(n=16, pressure=1e-4, seed=seed, dimension=dimension)
    path = jampetsc.shear(packing, step=5e-3, strain=2e-2, events=True, discard=0.0)
    end = path.attributes["came_apart"]
    np.testing.assert_allclose(path["strain"], [5e-3, 1e-2, end])
    assert 0.01 < end < 0.015 and path["jammed"].tolist() == [1, 1, 0] and abs(path["pressure"][-1]) < 1e-12
    assert f"ended early: particles come apart at strain {end:.6g}." in path.attributes["notes"]
    shorter = jampetsc.shear(packing, step=5e-3, strain=1e-2, events=True, discard=0.0)
    count = len(shorter["events/strain"])
    np.testing.assert_array_equal(path["events/strain"][:count], shorter["events/strain"])
    assert count and (path["events/strain"] < end).all() and "came_apart" not in shorter.attributes
    steps = jampetsc.shear(packing, step=end / 20, strain=1.1 * end, discard=0.0)
    assert steps["jammed"][[18, 21]].tolist() == [1, 0]


def test_what_only_events_take(runs):
    packing, _ = runs["disks"]
    with pytest.raises(InputError, match="must be positive without events"):
        jampetsc.shear(packing, step=STEP, strain=-STRAIN)
    with pytest.raises(InputError, match="descent: of events alone"):
        jampetsc.shear(packing, step=STEP, strain=STRAIN, descent="lbfgs")
