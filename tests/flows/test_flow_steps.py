"""Time steps of steady shear, one by one, against their equations in plain numpy: moves and tallies."""

from dataclasses import replace

import numpy as np
import pytest
import sheared
from sheared import OVERDAMPED, ROWS, crowd, forces, spheres

from jampetsc.flows import steady_shear, step_kernels
from jampetsc.flows.steady_shear import SteadyShear
from jampetsc.flows.step_kernels import TALLY
from jampetsc.laws.damping import Law
from jampetsc.laws.flow_models import Model, Scheme
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.packing import Packing, deformed
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import UNSTRAINED, simple_shear
from jampetsc.packing.threads import Team

LAWS = ROWS | {"across": (Law("across", normal=0.3, transverse=1.0), 0.0)}
SHEARED = 5e-3  # strain of a step
STRIDE = 10  # steps after which it is looked whether a list was made again


class Numpy:
    """Sheared disks at the present time; no list, no offsets, all velocities in the laboratory frame."""

    def __init__(self, disks, model, step, method, held):
        self.disks, self.model, self.method, self.wall_disks = disks, model, method, held
        self.step, self.rate = step, SHEARED / step
        self.looked_at = None
        self.u, self.a = np.zeros((2, *disks.base.shape))
        self.spin, self.turn = np.zeros((2, disks.n) if disks.dimension == 2 else (2, disks.n, 3))
        self.inertia = (0.5 if disks.dimension == 2 else 0.4) * model.mass * disks.radii**2
        self.unit = disks.potential.k * model.law.tau1
        if held and model.mass:  # at rest when walls begin to slide: v_x = u_x + γ̇(y − H/2) = 0
            self.u[held:, 0] = -self.rate * (disks.positions[held:, 1] - 0.5 * disks.cell[1, 1])
        self.tally = dict.fromkeys(TALLY, 0.0)
        if method == "verlet":
            force, torques = self.forces(self.disks, self.u, self.spin)
            self.a, self.turn = force / model.mass, (torques.T / self.inertia).T
            self.u, self.spin = self.u - 0.5 * self.step * self.a, self.spin - 0.5 * self.step * self.turn

    def contacts(self, disks):
        """Contacts of disks, found once for what follows at the same time."""
        if disks is not self.looked_at:
            self.looked_at, self.contacts_found = disks, find_contacts(disks)
        return self.contacts_found

    def free(self, *arrays):
        for array in arrays:
            array[: self.wall_disks] = 0.0
        return arrays

    def forces(self, disks, u, spin):
        """m u̇ (N, D) and torques."""
        elastic, viscous, torques, *_ = sheared.forces(
            disks, self.model.law, self.rate, u, spin, self.contacts(disks)
        )
        force = elastic + viscous - self.unit * self.model.drag * u
        force[:, 0] -= self.model.mass * self.rate * u[:, 1]
        return self.free(force, torques)

    def velocities(self, disks):
        """Velocities without inertia, or those of a step of backward Euler."""
        law, mass, (n, axes) = self.model.law, self.model.mass, disks.base.shape
        if not mass and not law.damps_contacts:
            return self.forces(disks, 0.0 * self.u, self.spin)[0] / (self.unit * law.drag)
        if not mass:
            return sheared.overdamped_velocities(disks, law, self.rate, self.wall_disks, self.contacts(disks))
        drag = self.unit * self.model.drag + mass / self.step
        matrix = sheared.resistance_matrix(disks, law, drag, self.contacts(disks))
        free = slice(axes * self.wall_disks, None)
        residual = self.forces(disks, self.u, self.spin)[0].ravel()
        change = np.zeros(axes * n)
        change[free] = np.linalg.solve(matrix[free, free], residual[free])
        u = self.u + change.reshape(n, axes)
        return u if self.wall_disks or self.model.drag else u - u.mean(axis=0)

    def moved(self, u):
        """The disks a step later, by u, with the affine flow at the middle of the way."""
        half = 0.5 * self.step * u
        return deformed(deformed(self.disks, half, simple_shear(SHEARED)), half, UNSTRAINED)

    def add_terms(self, u, spin):
        contacts, law, mass = self.contacts(self.disks), self.model.law, self.model.mass
        pull = contacts.normal * contacts.force[:, None]
        *_, viscous, spent = sheared.forces(self.disks, law, self.rate, u, spin, contacts)
        fluid = self.unit * law.eta_f * self.disks.volume * self.rate
        energy = self.disks.potential.energy(contacts.overlap, contacts.sigma).sum()
        for name, value in {
            "elastic_xy": pull[:, 0] @ contacts.r[:, 1],
            "elastic": np.sum(pull * contacts.r),
            "viscous_xy": viscous[0, 1] - fluid,
            "viscous": np.trace(viscous),
            "kinetic_xy": mass * u[:, 0] @ u[:, 1],
            "kinetic": mass * np.sum(u * u),
            "energy": energy + 0.5 * mass * np.sum(u * u) + 0.5 * np.sum(self.inertia * spin.T**2),
            "dissipation": spent + self.unit * self.model.drag * np.sum(u * u) + fluid * self.rate,
            "steps": 1.0,
        }.items():
            self.tally[name] += value

    def advance(self):
        if self.method == "verlet":
            u, spin = self.u + 0.5 * self.step * self.a, self.spin + 0.5 * self.step * self.turn
            force, torques = self.forces(self.disks, u, spin)
            self.a, self.turn = force / self.model.mass, (torques.T / self.inertia).T
            self.add_terms(u, spin)
            self.u, self.spin = self.u + self.step * self.a, self.spin + self.step * self.turn
            self.disks = self.moved(self.u)
            return
        self.u = self.velocities(self.disks)
        self.add_terms(self.u, self.spin)
        velocity = self.u
        if self.method == "heun":
            velocity = 0.5 * (self.u + self.velocities(self.moved(self.u)))
        self.disks = self.moved(velocity)


@pytest.mark.parametrize("start", [crowd, spheres])
@pytest.mark.parametrize("name", ROWS)
def test_energy_is_balanced_at_every_instant(name, start):
    """dE/dt = γ̇ V σ − D with σ_dis from f_x r_y; a symmetrised stress or another σ_kin misses it by per cents."""
    law, mass = ROWS[name]
    disks, h, rng = start(24, phi=0.9), 1e-5, np.random.default_rng(4)
    plain = Numpy(disks, Model(law, mass), 0.1, "euler", 0)
    u, spin = (
        (rng.normal(0, 0.02, plain.u.shape), rng.normal(0, 0.02, plain.spin.shape))
        if mass
        else (None, plain.spin)
    )
    u = u if mass else plain.velocities(disks)
    plain.add_terms(u, spin)
    terms, (force, torques) = plain.tally, plain.forces(disks, u, spin)

    def energy(h):
        contacts = find_contacts(deformed(disks, h * u, simple_shear(h * plain.rate)))
        return disks.potential.energy(contacts.overlap, contacts.sigma).sum()

    change = (energy(h) - energy(-h)) / (2 * h) + (
        np.sum(u * force) + np.sum(spin * torques) if mass else 0.0
    )
    stress = terms["elastic_xy"] + terms["viscous_xy"] + terms["kinetic_xy"]
    assert change == pytest.approx(
        -plain.rate * stress - terms["dissipation"], abs=1e-6 * terms["dissipation"] + 1e-8 * abs(change)
    )


@pytest.mark.parametrize(
    ("name", "method", "held", "step"),
    [
        ("RD0", "euler", 0, 0.1), ("RD0", "euler", 3, 0.1), ("RD0", "heun", 3, 0.1), ("CD0", "euler", 3, 0.1),
        ("CD0", "heun", 0, 0.1), ("unequal", "heun", 3, 0.1), ("across", "euler", 0, 0.1),
        ("CD", "backward Euler", 0, 0.1), ("CD", "backward Euler", 3, 0.1), ("both", "backward Euler", 3, 0.1),
        ("both", "verlet", 3, 0.1), ("rolling", "verlet", 0, 0.02), ("rolling", "verlet", 3, 0.02),
    ],
)  # fmt: skip
def test_steps_are_those_of_their_equations(name, method, held, step):
    """Also when lists are made and near pairs are chosen anew."""
    compare_steps(crowd(10, phi=0.9, exponent=2.5 if held else 2.0), name, method, held, step)


@pytest.mark.parametrize(
    ("name", "method", "step"),
    [
        ("RD0", "heun", 0.1), ("CD0", "euler", 0.1), ("across", "heun", 0.1), ("CD", "backward Euler", 0.1),
        ("both", "verlet", 0.05), ("rolling", "verlet", 0.02),
    ],
)  # fmt: skip
def test_steps_of_spheres_are_those_of_their_equations(name, method, step):
    """In three dimensions, with three spins."""
    compare_steps(spheres(20, phi=0.75, exponent=2.5), name, method, 0, step)


def compare_steps(disks, name, method, held, step):
    """Steps against `Numpy`, until a list is made again."""
    law, mass = LAWS[name]
    if held:
        disks = disks.replace(potential=replace(disks.potential, k=2.5))
    model = Model(law, mass, background_drag=0.1 if method == "verlet" else 0.0)
    run = SteadyShear(disks, model, SHEARED / step, Scheme(step, method, 1e-13), wall_disks=held)
    plain = Numpy(run.reference, model, step, method, held)
    while not run.rebuilds:
        run.advance(STRIDE)
    run.advance(STRIDE)
    for _ in range(run.steps):
        plain.advance()
    found, wanted = run.disks, plain.disks.folded()
    apart = (found.positions - wanted.positions) @ np.linalg.inv(wanted.cell)
    assert np.abs((apart - np.round(apart)) @ wanted.cell).max() < 1e-10
    assert run.disks.cell == pytest.approx(wanted.cell, rel=1e-12, abs=1e-12)
    for found, wanted in (
        (run.velocities, plain.u),
        (run.accelerations, plain.a),
        (run.spins, plain.spin),
        (run.spin_rates, plain.turn),
    ):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10)
    terms = dict(zip(TALLY, run.tally, strict=True))
    solved = method == "backward Euler" or name in ("CD0", "unequal", "across")
    assert (terms.pop("iterations") > 0) == solved
    for name, value in terms.items():
        assert value == pytest.approx(plain.tally[name], rel=1e-9, abs=1e-11), name


EXPLICIT = [(name, method) for name in ("RD0", "CD0") for method in ("euler", "heun")] + [
    ("rolling", "verlet")
]


@pytest.mark.parametrize(("name", "method"), [*EXPLICIT, ("CD", "backward Euler"), ("RD", "verlet")])
def test_a_list_is_stale_by_the_shear_after_a_step(name, method):
    """For disks without offsets a shear of 0.2 is within this skin, 0.3 is not. Heun's method tests its predictor."""
    law, mass = ROWS[name]
    places = np.array([[2.0, 2.0], [6.0, 2.5], [2.5, 6.0], [6.5, 6.5]])
    disks = Packing.from_positions(places, np.full(4, 0.5), 9.0 * np.eye(2))
    run = SteadyShear(disks, Model(law, mass), 1.0, Scheme(0.1, method, 1e-12))
    run.skin = 0.12  # the larger singular value of the deformation is 1.105 at 0.2, 1.161 at 0.3
    run.list(run.reference)
    assert run.run_steps(9) == (2 if method == "heun" else 3, step_kernels.STALE)
    assert not run.offsets.any() and run.tally[TALLY.index("steps")] == (2 if method == "heun" else 3)


SCHEMES = [
    *((name, method, 0.0) for name in OVERDAMPED for method in ("euler", "heun")),
    *((name, "verlet", mass) for name, (_, mass) in ROWS.items() if mass),
    *((name, "backward Euler", 0.02) for name in ("RD", "CD", "both")),
]


@pytest.mark.parametrize(("name", "method", "mass"), SCHEMES)
def test_a_snapshot_is_of_one_instant(name, method, mass):
    """Its positions and velocities dissipate what the next step adds to the tally, also at the start of the flow."""
    law = ROWS[name][0]
    run = SteadyShear(crowd(24, phi=0.9), Model(law, mass), 0.1, Scheme(0.05, method, 1e-12))
    for steps in (1, 5, 20):
        run.advance(steps)
        disks, u, spins = run.disks, run.nonaffine_velocities(), run.spins + 0.025 * run.spin_rates
        *_, virial, spent = forces(disks, law, run.rate, u, spins)
        background = law.eta_f * law.tau1 * disks.volume * run.rate
        run.tally[:] = 0.0
        run.advance(1)
        terms = dict(zip(TALLY, run.tally, strict=True))
        drag = law.drag * law.tau1 * np.sum(u**2)
        assert terms["dissipation"] == pytest.approx(spent + drag + background * run.rate, rel=1e-9)
        assert terms["viscous_xy"] == pytest.approx(virial[0, 1] - background, rel=1e-9, abs=1e-12)
        assert terms["kinetic"] == pytest.approx(mass * np.sum(u**2), rel=1e-9)


@pytest.mark.parametrize(("name", "method"), [("RD0", "heun"), ("CD0", "euler"), ("rolling", "verlet")])
def test_reading_the_state_of_a_run_does_not_change_it(name, method):
    """It stays the same to the last bit, though `nonaffine_velocities` solves for velocities once more."""
    law, mass = ROWS[name]
    read, unread = (
        SteadyShear(crowd(10, phi=0.9), Model(law, mass), 0.25, Scheme(0.02, method, 1e-3)) for _ in range(2)
    )
    assert not mass or not read.nonaffine_velocities().any()  # massive disks start at rest
    for run in (read, unread):
        for _ in range(5):
            run.advance(3)
            if run is read:
                run.nonaffine_velocities(), run.survey(), run.disks, run.state()
    for array in ("offsets", "velocities", "accelerations", "spins", "tally"):
        assert np.array_equal(getattr(read, array), getattr(unread, array)), array


def test_the_cell_of_a_start_is_reduced_to_the_smallest_tilt():
    disks = crowd(10, phi=0.9)
    turned = np.array([[1.0, 0.0], [3.0, 1.0]])
    far = disks.replace(cell_base=turned @ disks.cell_base, cell_offset=turned @ disks.cell_offset)
    state = SteadyShear(far, Model(ROWS["RD0"][0]), 0.1, Scheme(0.1, "euler", 1e-6)).state()
    np.testing.assert_allclose(state["cell_base"] + state["cell_offset"], disks.cell, atol=1e-12)


def many(n=6200):
    """Disks at the sites of a jittered square lattice, in no order, with many contacts."""
    rng, side = np.random.default_rng(7), int(np.ceil(np.sqrt(n)))
    sites = rng.permutation(side * side)[:n]
    places = np.column_stack((sites % side, sites // side)) * 1.05 + rng.uniform(-0.15, 0.15, (n, 2))
    potential = Potential("harmonic", "inverse-square-diameter")
    return Packing.from_positions(places, rng.choice([0.55, 0.65], n), 1.05 * side * np.eye(2), potential)


@pytest.mark.parametrize(("name", "method"), EXPLICIT)
def test_threads_and_domains_do_not_change_a_run(name, method, monkeypatch):
    """The same to the last bit on one to three threads; but for rounding also as one domain, in the order given."""
    law, mass = ROWS[name]
    disks, scheme = many(), Scheme(0.02, method, 1e-5)
    runs = [SteadyShear(disks, Model(law, mass), 0.5, scheme, Team(threads)) for threads in (1, 2, 3)]
    monkeypatch.setattr(steady_shear, "borders", lambda n: np.array([0, n]))
    plain = SteadyShear(disks, Model(law, mass), 0.5, scheme)
    monkeypatch.undo()
    assert len(runs[0].lists[0].across) == 3 and len(plain.lists[0].across) == 1
    monkeypatch.setattr(steady_shear, "SORT_STRAIN", 0.05)  # strain: five steps
    for run in (*runs, plain):
        before = run.order
        run.advance(7)
        run.fold()
        assert run is plain or not np.array_equal(run.order, before)
        run.advance(2)
    one, again = runs[0], SteadyShear(disks, plain.model, plain.rate, scheme)
    again.restore(one.state())
    for run in (*runs, plain, again):
        run.advance(2)
    runs.append(again)
    for run in runs[1:]:
        found, wanted = run.state(), one.state()
        assert all(np.array_equal(found[key], wanted[key]) for key in wanted)
        assert np.array_equal(run.nonaffine_velocities(), one.nonaffine_velocities())
    assert one.nonaffine_velocities() == pytest.approx(plain.nonaffine_velocities(), abs=1e-7)
    apart = (one.disks.positions - plain.disks.positions) @ np.linalg.inv(plain.disks.cell)
    assert np.abs(apart - np.round(apart)).max() < 1e-9
    np.testing.assert_allclose(
        one.tally[: step_kernels.SUMMED], plain.tally[: step_kernels.SUMMED], rtol=1e-6, atol=1e-6
    )
    for name in ("clusters", "largest_cluster"):
        assert one.survey()[name] == plain.survey()[name]
