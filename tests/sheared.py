"""Steady shear in dense numpy, written from the equations: what `jampetsc.flows` is compared with."""

import numpy as np

from jampetsc.commands import run_files
from jampetsc.flows import flow_run
from jampetsc.flows.steady_shear import SteadyShear
from jampetsc.jamming import stepwise_shear
from jampetsc.laws.damping import Law
from jampetsc.laws.flow_models import MODELS, Model, Scheme
from jampetsc.minimisation.minimise import settle
from jampetsc.minimisation.sizes import radii_of
from jampetsc.packing.contacts import find_contacts
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential

# name -> (weights, mass): Vågberg's six, and laws of the linear part with rolling and with unequal weights
ROWS = {name: (law, 0.7 if massive else 0.0) for name, (law, massive) in MODELS.items()}
ROWS["rolling"] = (Law("rolling", normal=1.3, sliding=0.6), 0.7)
ROWS["unequal"] = (Law("unequal", normal=1.0, transverse=0.3, tau1=1.4), 0.0)
ROWS["both"] = (Law("both", normal=0.5, transverse=0.3, drag=0.8, eta_f=2.0), 0.7)
OVERDAMPED = [name for name, (_, mass) in ROWS.items() if not mass]


def model(name) -> Model:
    law, mass = ROWS[name]
    return Model(law, mass, name=name)


def spheres(n=40, phi=0.7, seed=1, exponent=2.0):
    """Spheres without deep overlaps in a tilted cell that is not a cube, stiffness as Vågberg's."""
    rng = np.random.default_rng(seed)
    radii = 0.6 * radii_of("bidisperse", n) / 0.5
    height = np.cbrt(4.0 / 3.0 * np.pi * np.sum(radii**3) / phi / 1.3)
    cell = height * np.array([[1.3, 0.0, 0.0], [0.2, 1.0, 0.0], [-0.1, 0.3, 1.0]])
    potential = Potential(exponent=exponent, stiffness="inverse-square-diameter")
    return settle(Packing.from_positions(rng.random((n, 3)) @ cell, radii, cell, potential), 1e-3)


def crowd(n=64, phi=0.86, aspect=1.3, tilt=0.2, seed=1, exponent=2.0):
    """Disks without deep overlaps in a tilted cell that is not square, stiffness as Vågberg's."""
    rng = np.random.default_rng(seed)
    radii = 0.6 * radii_of("bidisperse", n) / 0.5
    height = np.sqrt(np.pi * np.sum(radii**2) / phi / aspect)
    cell = np.array([[aspect * height, 0.0], [tilt * height, height]])
    potential = Potential(exponent=exponent, stiffness="inverse-square-diameter")
    return settle(Packing.from_positions(rng.random((n, 2)) @ cell, radii, cell, potential), 1e-3)


def shear(name, disks=None, rate=1e-2, step=0.05, method=None, tolerance=1e-13) -> SteadyShear:
    m = model(name)
    method = method or ("verlet" if m.mass else "heun")
    return SteadyShear(disks or crowd(), m, rate, Scheme(step, method, tolerance))


def stop_after(monkeypatch, saves) -> list:
    """Runs save after every row, and end as if killed when they have so often; [times that are left]."""
    for module in (flow_run, stepwise_shear):
        monkeypatch.setattr(module, "SAVE_INTERVAL", -1.0)
    save, left = run_files.save_rows, [saves]

    def save_and_stop(*what):
        save(*what)
        left[0] -= 1
        if left[0] == 0:
            raise KeyboardInterrupt

    monkeypatch.setattr(run_files, "save_rows", save_and_stop)
    return left


def crossed(spins, n):
    """spins × n of contacts, (M, D): spins (M,) about z in a plane, (M, 3) in space."""
    return np.cross(spins, n) if spins.ndim == 2 else spins[:, None] * np.column_stack((-n[:, 1], n[:, 0]))


def crossed_vectors(n, v):
    """n × v, (M,) in a plane, else (M, 3)."""
    return np.cross(n, v) if n.shape[1] == 3 else n[:, 0] * v[:, 1] - n[:, 1] * v[:, 0]


def forces(disks, law, rate, u, spin, contacts=None):
    """(elastic (N, D), viscous (N, D), torques as `spin`, viscous virial Σ f r (D, D), dissipation in contacts)."""
    c = find_contacts(disks) if contacts is None else contacts
    unit, n = disks.potential.k * law.tau1, c.normal
    velocity = u[c.j] - u[c.i]
    velocity[:, 0] += rate * c.r[:, 1]
    along = np.sum(n * velocity, 1)
    across = velocity - along[:, None] * n
    turning = (disks.radii[c.i] * spin[c.i].T + disks.radii[c.j] * spin[c.j].T).T
    sliding = across - crossed(turning, n)
    on_j = -unit * ((law.normal * along)[:, None] * n + law.transverse * across + law.sliding * sliding)
    elastic, viscous, torques = np.zeros(u.shape), np.zeros(u.shape), np.zeros(spin.shape)
    for end, sign in ((c.j, 1.0), (c.i, -1.0)):
        np.add.at(elastic, end, sign * c.force[:, None] * n)
        np.add.at(viscous, end, sign * on_j)
        np.add.at(torques, end, (unit * law.sliding * disks.radii[end] * crossed_vectors(n, sliding).T).T)
    squares = (
        law.normal * along**2 + law.transverse * np.sum(across**2, 1) + law.sliding * np.sum(sliding**2, 1)
    )
    return elastic, viscous, torques, on_j.T @ c.r, float(unit * np.sum(squares))


def resistance_matrix(disks, law, drag, contacts):
    """(DN, DN): minus the viscous forces of contacts by velocities of disks that do not spin, and drag."""
    c, axes, n = contacts, disks.dimension, disks.n
    along = c.normal[:, :, None] * c.normal[:, None]
    weights = law.normal * along + (law.transverse + law.sliding) * (np.eye(axes) - along)
    matrix = np.zeros((n, n, axes, axes))
    for one, other, sign in ((c.i, c.i, 1), (c.j, c.j, 1), (c.i, c.j, -1), (c.j, c.i, -1)):
        np.add.at(matrix, (one, other), sign * disks.potential.k * law.tau1 * weights)
    return drag * np.eye(axes * n) + matrix.transpose(0, 2, 1, 3).reshape(axes * n, -1)


def overdamped_velocities(disks, law, rate, held=0, contacts=None):
    """u (N, D) with no net force on any disk; the limit of vanishing drag where there is none. u = 0 of the `held`."""
    axes = disks.dimension
    contacts = find_contacts(disks) if contacts is None else contacts
    still = np.zeros((disks.n, axes))
    turned = np.zeros(disks.n) if axes == 2 else np.zeros((disks.n, 3))
    load = sum(forces(disks, law, rate, still, turned, contacts)[:2]).ravel()
    matrix = resistance_matrix(disks, law, law.drag * disks.potential.k * law.tau1, contacts)
    free = slice(axes * held, None)
    still.reshape(-1)[free] = np.linalg.lstsq(matrix[free, free], load[free], rcond=1e-11)[0]
    return still
