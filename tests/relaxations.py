"""Reference for stress relaxation: linear G(t) from dense K and B, and step strains of any size by an ODE solver.

Shares no code with the package but the contacts' law of force: K and B come from `dense.Reference`.
"""

from itertools import product

import numpy as np
from dense import Reference
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

INSTANT = 1e-9  # of K + B: share of K or of B that is rounding


def linear_relaxation(disks, physics, gradient, times):
    """(G(t) (T,), G(0⁺), G₀) without the Dirac part, from the eigenvectors of B against K + B.

    With B v = ν (K + B) v and λ = (1 − ν)/ν, each mode adds (c − λe)²/(1 − ν) exp(−λt), where c and e are the
    couplings of K and of B to the strain.
    """
    exact = Reference(disks, physics, [gradient])
    m = exact.n * exact.dofs
    K, B = exact.K.astype(float), exact.B.astype(float)
    moves = exact.costless().astype(float)
    both = K[:m, :m] + B[:m, :m] + (moves @ moves.T if moves.size else 0.0)
    nu, v = eigh(B[:m, :m], both)
    c, e = v.T @ K[:m, m], v.T @ B[:m, m]
    stores = nu < 1.0 - INSTANT
    relaxes = stores & (nu > INSTANT)
    G0 = K[m, m] - np.sum(c[stores] ** 2 / (1.0 - nu[stores]))
    nu, c, e = nu[relaxes], c[relaxes], e[relaxes]
    rate = (1.0 - nu) / nu
    weight = (c - rate * e) ** 2 / (1.0 - nu)
    area = float(exact.area)
    G = (G0 + np.exp(-np.outer(times, rate)) @ weight) / area
    return G, (G0 + weight.sum()) / area, G0 / area


class Relaxing:
    """Harmonic disks in a plane without rotations, strained by simple shear and held, contacts opening and closing."""

    def __init__(self, disks, law, strain):
        self.positions, self.radii = disks.positions.copy(), disks.radii.copy()
        self.cell, self.k, self.law = disks.cell.copy(), float(disks.potential.k), law
        self.strain, self.area = strain, float(np.linalg.det(disks.cell))
        images = np.array(list(product((-1, 0, 1), repeat=2)))
        first, second = np.triu_indices(len(self.radii), 1)
        self.i, self.j = np.repeat(first, len(images)), np.repeat(second, len(images))
        self.images = np.tile(images, (len(first), 1))

    def contacts(self, x, gamma):
        """(i, j, r, overlap) of the disks that overlap at affine positions x of the cell at rest plus moves."""
        shear = np.array([[1.0, 0.0], [gamma, 1.0]])
        r = x[self.j] - x[self.i] + self.images @ (self.cell @ shear)
        overlap = self.radii[self.i] + self.radii[self.j] - np.linalg.norm(r, axis=1)
        chosen = overlap > 0.0
        return self.i[chosen], self.j[chosen], r[chosen], overlap[chosen]

    def elastic(self, x, gamma):
        """(forces (N, 2), V σ, U)."""
        i, j, r, overlap = self.contacts(x, gamma)
        pull = (self.k * overlap / np.linalg.norm(r, axis=1))[:, None] * r
        forces = np.zeros_like(x)
        np.add.at(forces, j, pull)
        np.add.at(forces, i, -pull)
        return forces, -np.sum(pull[:, 0] * r[:, 1]), 0.5 * self.k * np.sum(overlap**2)

    def damping(self, x, gamma):
        """(B (2N, 2N), b (2N,)) of the contacts there are and of the drag."""
        i, j, r, _ = self.contacts(x, gamma)
        n = r / np.linalg.norm(r, axis=1)[:, None]
        rows = []
        for weight, axis in ((self.law.normal, n), (self.law.transverse, n[:, ::-1] * [-1.0, 1.0])):
            row, every = np.zeros((len(i), *x.shape)), np.arange(len(i))
            row[every, j], row[every, i] = axis, -axis
            rows.append(np.sqrt(weight) * np.column_stack((row.reshape(len(i), -1), axis[:, 0] * r[:, 1])))
        rows, unit = np.concatenate(rows), self.k * self.law.tau1
        form = unit * rows.T @ rows
        return form[:-1, :-1] + unit * self.law.drag * np.eye(x.size), form[:-1, -1]

    def velocities(self, x, gamma, rate, forces):
        """u of B u + b γ̇ = forces, the least of those there are."""
        B, b = self.damping(x, gamma)
        return np.linalg.lstsq(B, forces.ravel() - rate * b, rcond=1e-10)[0], b

    def step(self, steps):
        """Positions after the instantaneous step, dashpots alone, by Heun's method in the strain."""
        x, h = self.positions.copy(), self.strain / steps
        for n in range(steps):

            def flow(place, gamma):
                u, _ = self.velocities(place, gamma, 1.0, np.zeros_like(place))
                return u.reshape(place.shape) + np.column_stack((place[:, 1], np.zeros(len(place))))

            first = flow(x, n * h)
            x = x + 0.5 * h * (first + flow(x + h * first, (n + 1) * h))
        return x

    def relax(self, times, steps=200):
        """G(t) (T,) and the energies U(t) − U(0⁻) per area."""
        rest, before = self.elastic(self.positions, 0.0)[1:]

        def motion(_, x):
            place = x.reshape(-1, 2)
            return self.velocities(place, self.strain, 0.0, self.elastic(place, self.strain)[0])[0]

        start = self.step(steps).ravel()
        path = solve_ivp(motion, (0.0, times[-1]), start, "RK23", times, rtol=1e-5, atol=1e-9)
        G, energy = [], []
        for x in path.y.T:
            place = x.reshape(-1, 2)
            forces, stress, stored = self.elastic(place, self.strain)
            u, b = self.velocities(place, self.strain, 0.0, forces)
            G.append((stress + b @ u - rest) / self.area / self.strain)
            energy.append((stored - before) / self.area)
        return np.array(G), np.array(energy)
