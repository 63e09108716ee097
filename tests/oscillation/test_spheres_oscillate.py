"""Oscillations of spheres: against dense references in three dimensions, and themselves turned and copied."""

from functools import cache

import numpy as np
import pytest
from dense import Reference
from oscillations import steady_oscillation
from powerlaw import Motion, Opening
from samples import network_of, on_ranks, physics, put
from sheared import forces
from spheres import few_spheres
from whole_arrays import unknowns

import jampetsc
from jampetsc import main
from jampetsc.commands.oscillate import Oscillate
from jampetsc.errors import ConvergenceError, InputError
from jampetsc.io.outlet import Outlet
from jampetsc.io.request import Request
from jampetsc.laws.loads import named_loads
from jampetsc.oscillation.amplitude_sweep import PointSolver, sweep_amplitudes
from jampetsc.oscillation.drive import Drive, Imposed
from jampetsc.oscillation.moving_contacts import MovingContacts
from jampetsc.oscillation.repeated_cycles import START_STEPS, repeat_cycles
from jampetsc.oscillation.time_step import STAGE
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.packing import Packing
from jampetsc.response import factor_memory

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]
ROLLING, SMOOTH = {"beta": 0.3, "normal": 0.8}, {"rotations": False, "tau1": 2.0}
BOTH = {"normal": 0.5, "transverse": 0.3, "sliding": 0.7}  # five motions of a contact
OMEGA = np.array([1e-2, 0.4, 6.0])


def law_of(options, **more):
    return physics("custom" if "sliding" in options else "contact", **options, **more)


@cache
def balanced_spheres(n=16):
    """A minimum in a cell without shear stress, where small amplitudes need few time steps."""
    return jampetsc.pack(n=n, dimension=3, pressure=1e-2, seed=1, stabilise="shear")


@pytest.mark.most_ranks(3)
@pytest.mark.parametrize(
    "options", on_ranks([ROLLING, SMOOTH, BOTH], [BOTH]), ids=["rolling", "smooth", "both"]
)
def test_linear_damping_of_fixed_contacts_is_the_dense_modulus(session, options):
    """Of a strain and of a stress, along any load."""
    loads = named_loads(3)
    for name, how in (("xy", "strain"), ("yz", "stress")):
        exact = Reference(few_spheres(), law_of(options), [loads[name].gradient])
        found = jampetsc.oscillate(
            few_spheres(), law_of(options).law, omega=OMEGA, steps=16, load=name, **{how: [1e-6]}
        )
        wanted = np.array([exact.modulus(omega) for omega in OMEGA])
        np.testing.assert_allclose(found["G"][0], wanted, rtol=1e-9)
        assert np.all(found["error"][0] < 1e-6 * abs(wanted)) and found.attributes["dimension"] == 3
        assert np.all(abs(found["harmonics"]) < 1e-6) and np.all(abs(found["energy_balance"]) < 1e-8)


@pytest.mark.parametrize(
    ("alpha", "omega", "options", "imposed"),
    [(0.5, 2e-5, ROLLING, {"strain": 1e-3}), (1.5, 5.0, BOTH, {"stress": 1e-3})],
)
def test_a_power_law_against_integration_in_time(alpha, omega, options, imposed):
    """A cycle integrated from the steady state that was found comes back to it, with the same modulus."""
    law, disks = law_of(options, exponent=alpha), few_spheres()
    oscillation, (how, size) = steady_oscillation(disks, law, 32), *imposed.items()
    found = oscillation.solve(Drive(omega, size, how == "stress"))
    motion = Motion(disks, law, omega, **imposed)
    rows = unknowns(oscillation.network, motion.exact.dofs, motion.exact.disks)
    orders = np.arange(1, 2 * len(found.velocity), 2)
    frequencies = omega * np.tan(orders * np.pi / 32) / np.tan(np.pi / 32)
    field = (found.velocity / (1j * frequencies[:, None])).sum(axis=0).real
    Q = np.zeros(len(motion.K))
    Q[rows], Q[-1] = field[:-1], field[-1] / oscillation.contacts.length
    end, strain, stress = motion.half_cycle(Q, rtol=1e-4)
    assert (Q + end) @ motion.K @ (Q + end) < 1e-5 * (Q @ motion.K @ Q)
    assert abs(found.G - stress / strain) < 2.0 * found.error < 0.03 * abs(found.G)
    assert abs(found.energy_balance) < 1e-6 and abs(found.harmonics[0]) > 1e-3


def turned(packing):
    """The packing with its axes exchanged, x → y → z → x; its cell is a box."""
    places, sides = (np.roll(part, 1, axis=-1) for part in (packing.positions, np.diag(packing.cell)))
    return Packing.from_positions(places, packing.radii, np.diag(sides), packing.potential)


def doubled(packing):
    """Two copies of the packing, one behind the other along y."""
    places = np.vstack((packing.positions, packing.positions + packing.cell[1]))
    cell = packing.cell * np.array([[1.0], [2.0], [1.0]])
    return Packing.from_positions(places, np.tile(packing.radii, 2), cell, packing.potential)


def test_axes_and_copies_do_not_matter():
    """Under a power law too: its force follows the vector of the velocity, whatever axes lie across a contact."""
    options = {"alpha": 0.5, "omega": [1e-5], "strain": [1e-3], "steps": 16}
    law, packing = law_of(ROLLING).law, jampetsc.pack(n=16, dimension=3, pressure=0.1, seed=1)
    first, *others = (
        jampetsc.oscillate(spheres, law, load=load, **options)
        for spheres, load in ((packing, "xy"), (turned(packing), "yz"), (doubled(packing), "xy"))
    )
    for other in others:
        for name in ("G", "harmonics", "work"):
            np.testing.assert_allclose(other[name], first[name], rtol=1e-6)
    differs = jampetsc.oscillate(packing, law, load="yz", **options)["G"] / first["G"]
    assert abs(differs[0, 0] - 1.0) > 1e-2


def shaken(drive, law):
    """Three cycles of the balanced spheres, with moving contacts."""
    start = steady_oscillation(balanced_spheres(), law, START_STEPS).start(drive)
    return repeat_cycles(balanced_spheres(), law.law, start, 16, 3)[0]


@pytest.mark.parametrize(
    ("options", "alpha", "drive"),
    [
        (ROLLING, 1.0, Drive(0.3, 1e-6, False)),
        (SMOOTH, 1.0, Drive(1e-2, 1e-7, True)),
        (BOTH, 1.5, Drive(3.0, 1e-6, False)),
    ],
)
def test_moving_contacts_of_small_amplitude_are_fixed(options, alpha, drive):
    """With the modulus of the dense reference where damping is linear; work is dissipated."""
    law = law_of(options, exponent=alpha)
    found, fixed = shaken(drive, law), steady_oscillation(balanced_spheres(), law, 16).solve(drive)
    if alpha == 1.0:
        exact = Reference(balanced_spheres(), law).modulus(drive.omega)
        assert abs(found.G - exact) <= found.error + 1e-9 * abs(exact)
    assert abs(found.G - fixed.G) <= found.error + fixed.error < 3e-2 * abs(fixed.G)
    strain = drive.amplitude / abs(found.G) if drive.stress_controlled else drive.amplitude
    assert found.work == pytest.approx(np.pi * found.G.imag * strain**2, rel=1e-5)
    assert abs(found.energy_balance) < 1e-2 and found.steps_taken == 72


def strained(motion, gamma, rate):
    return motion.advance([Imposed(*pair) for pair in zip(gamma, rate, strict=True)])


def test_moving_contacts_against_integration_in_time():
    """From rest, contacts opening on the way: strain, stress and places are those that an ODE solver finds."""
    omega, strain, steps = 0.1, 5e-2, 32
    law, disks, end = law_of(SMOOTH), few_spheres(), 1.2 / omega
    exact = Opening(disks, law, omega, strain=strain)
    Q, stress = exact.until(end)
    assert len(exact.counts) >= 3
    motion = MovingContacts(disks, law.law, end / steps, strain, omega * strain)
    for n in range(steps):
        phase = omega * motion.step * (n + np.array([STAGE, 1.0]))
        last = strained(motion, strain * np.sin(phase), strain * omega * np.cos(phase))[1]
    moved = motion.disks.positions - disks.positions
    moved -= np.round(moved @ np.linalg.inv(motion.disks.cell)) @ motion.disks.cell
    expected = Q[:-1].reshape(-1, 3) - disks.positions
    difference = moved - moved.mean(axis=0) - expected + expected.mean(axis=0)
    assert np.abs(difference).max() < 2e-3 * np.abs(expected).max()
    assert last.stress == pytest.approx(stress, rel=2e-3)


def test_forces_and_torques_balance_after_a_step():
    """With three spins, where contacts have opened."""
    law, strain, disks = law_of(BOTH).law, 2e-2, few_spheres()
    motion = MovingContacts(disks, law, 0.05, strain)
    for step in range(20):
        strained(motion, strain * 0.05 * np.array([step + STAGE, step + 1.0]), np.full(2, strain))
    assert len(find_contacts(motion.disks)) != len(find_contacts(disks))
    u, spins = np.split(motion.velocities, 2, axis=1)
    elastic, viscous, torques, *_ = forces(motion.disks, law, strain, u, spins)
    assert np.abs(elastic + viscous).max() < 2e-3 * strain < np.abs(viscous).max()
    assert np.abs(torques).max() < 2e-3 * strain < np.abs(spins).max()


def test_spheres_that_roll_take_few_newton_steps():
    """Between two opposite neighbours a sphere turns far and moves little: its spin must not be held."""
    found = shaken(Drive(0.3, 5e-2, False), law_of(ROLLING))
    assert np.all([found.newton_steps, found.factorisations] <= 1.3 * np.array([703, 208]))


@pytest.mark.parametrize("contacts", ["fixed", "moving"])
def test_factors_that_memory_cannot_hold_are_refused(session, monkeypatch, contacts):
    """Before they are made, all that are held at a time."""
    monkeypatch.setattr(factor_memory, "SPACE_BYTES", 1e12)
    disks, law = few_spheres(), law_of(ROLLING)
    network = network_of(disks, law, session.comm)
    with pytest.raises(InputError, match=r"factor of 84 unknowns: needs .* -osc_factor_mat_mumps_icntl_22 1"):
        sweep_amplitudes(
            disks,
            network,
            law.law,
            omega=[1.0],
            amplitudes=[1e-6],
            control="strain",
            contacts=contacts,
            steps=16,
        )


def test_a_file_is_resumed_printed_and_drawn(session, tmp_path, monkeypatch, capfd):
    """After a point has failed only that one is solved; `info` and `plot` know oscillations of spheres."""
    packing = put(tmp_path / "p.h5", few_spheres(), session.comm)
    job = Oscillate(packing, law_of(ROLLING).law, omega=[0.1, 1.0], strain=[1e-4, 1e-3], alpha=0.7, steps=16)
    to = Outlet(tmp_path / "o.h5", tmp_path / "o.h5", Request(job))
    solve, seen = PointSolver.solve, []

    def failing(solver, drive, *end):
        seen.append(drive)
        if len(seen) == 3:
            raise ConvergenceError("stopped")
        return solve(solver, drive, *end)

    monkeypatch.setattr(PointSolver, "solve", failing)
    with pytest.raises(ConvergenceError, match="1 of 4 points failed"):
        job.work(to)
    job.work(to)
    assert len(seen) == 5
    whole = jampetsc.oscillate(
        few_spheres(), law_of(ROLLING).law, omega=[0.1, 1.0], strain=[1e-4, 1e-3], alpha=0.7, steps=16
    )
    found = jampetsc.load(to.path)
    np.testing.assert_allclose(found["G"], whole["G"], rtol=1e-7)
    assert main.main(["info", str(to.path)]) == 0
    shown = capfd.readouterr().out.split()
    assert shown[shown.index("dimension") + 1] == "3"
    assert main.main(["plot", str(to.path), "--out", str(tmp_path / "o.png")]) == 0
