"""Reference for power-law damping: the motion in time of a small packing, dense, by an ODE solver.

Shares no code with the package. K comes from `dense.Reference`, or forces from the overlaps there are; velocities
are those at which the damping forces of all contacts balance them, found at every instant by Newton's method.
"""

from itertools import product

import numpy as np
from dense import Reference
from scipy.integrate import solve_ivp

from jampetsc.laws.loads import simple_shear
from jampetsc.response.elastic import ElasticResponse


class Motion:
    """A packing under power-law damping, by contacts alone, with the stress σ₀ cos ωt or the strain γ₀ cos ωt."""

    def __init__(self, disks, physics, omega, stress=None, strain=None):
        exact = self.exact = Reference(disks, physics)
        law, self.alpha, self.omega = exact.law, physics.law.exponent, omega
        self.law = law
        self.stress, self.strain, self.area = stress, strain, float(exact.area)
        self.K = exact.K.astype(float)
        self.contacts = len(exact.i)
        self.Z = self._motions(exact.i, exact.j, exact.r.astype(float))
        rho0 = 2.0 * float(disks.radii.mean())
        self.c = float(exact.k) * law.tau1 * (rho0 / law.tau1) ** (1.0 - self.alpha)
        moves = exact.free_moves().astype(float)
        self.held = np.zeros_like(self.K)
        self.held[:-1, :-1] = moves @ moves.T
        self.f = None

    def _motions(self, i, j, r):
        """√w a∥ and the D components of √w a⊥ and √w a⊥ᶜ of contacts, as coefficients (M, f, m + 1)."""
        exact, law, (M, D), n = self.exact, self.law, r.shape, r / np.linalg.norm(r, axis=1)[:, None]
        every, bond, rims = np.arange(M), *np.zeros((2, M, D, exact.n, exact.dofs))
        turned = np.einsum("sab,cb->cas", exact.spins.astype(float), n)  # θ × n
        for end, sign in ((j, 1.0), (i, -1.0)):
            bond[every, :, end, :D] = sign * np.eye(D)
            rims[every, :, end, D:] = -exact.radii.astype(float)[end, None, None] * turned
        strained = r[:, 1, None] * np.eye(D)[0]
        bond, rims = (
            np.concatenate((part.reshape(M, D, -1), last[..., None]), axis=2)
            for part, last in ((bond, strained), (rims, 0.0 * strained))
        )
        across = (np.eye(D) - n[:, :, None] * n[:, None, :]) @ bond
        forms = (law.normal, n[:, None] @ bond), (law.transverse, across), (law.sliding, across + rims)
        return np.concatenate([np.sqrt(weight) * rows for weight, rows in forms if weight], axis=1)

    def elastic(self, Q):
        """∂U/∂Q (m + 1,), the strain last."""
        return self.K @ Q

    def velocities(self, t, Q):
        """(v of all unknowns, strain rate last; stress) at a time."""
        free = slice(None) if self.strain is None else slice(-1)
        Z = self.Z[..., free]
        load = -self.elastic(Q)[free]
        offset = np.zeros(Z.shape[:2])
        if self.strain is None:
            load[-1] += self.stress * self.area * np.cos(self.omega * t)
        else:
            offset = self.Z[..., -1] * (-self.strain * self.omega * np.sin(self.omega * t))
        p = 1.0 / self.alpha
        flat = Z.reshape(-1, Z.shape[-1])
        if self.f is None:
            v = np.linalg.lstsq(flat.T @ flat + self.held[free, free], load, rcond=None)[0]
            z = (Z @ v) + offset
            self.f = self.c * (np.sum(z**2, axis=1, keepdims=True) + 1e-20) ** ((self.alpha - 1) / 2) * z
        f, size = self.f, max(np.abs(load).max(), np.abs(self.f).max())
        for _ in range(60):
            r = np.maximum(np.sqrt(np.sum(f**2, axis=1)), 1e-9 * size)
            y = self.c**-p * r ** (p - 1)
            phi = y[:, None] * f
            outer = f[:, :, None] * f[:, None, :] / r[:, None, None] ** 2
            D = (np.eye(f.shape[1]) - (p - 1) / p * outer) / y[:, None, None]
            weighted = np.einsum("cab,cbx->cax", D, Z).reshape(-1, Z.shape[-1])
            shift = np.einsum("cab,cb->ca", D, offset - phi)
            right = load - np.einsum("cax,ca->x", Z, f + shift)
            v = np.linalg.solve(flat.T @ weighted + y.max() ** -1 * self.held[free, free], right)
            step = np.einsum("cab,cb->ca", D, Z @ v + offset - phi)
            f = f + step
            if np.abs(step).max() < 1e-11 * size:
                break
        self.f = f
        if self.strain is None:
            return v, self.stress * np.cos(self.omega * t)
        rate = -self.strain * self.omega * np.sin(self.omega * t)
        force = self.elastic(Q)[-1] + np.einsum("ca,ca", self.Z[..., -1], f)
        return np.append(v, rate), force / self.area

    def half_cycle(self, Q, start=0.0, rtol=1e-6):
        """(Q half a period later, first harmonics of strain and stress over it) from Q (m + 1,) at t = start."""
        half = np.pi / self.omega
        size = np.abs(Q).max()

        def rates(t, y):
            v, stress = self.velocities(t, y[:-4])
            wave = np.exp(-1j * self.omega * t) * 2.0 / half
            strain = y[-5] * wave
            stress = stress * wave
            return np.concatenate((v, [strain.real, strain.imag, stress.real, stress.imag]))

        done = solve_ivp(
            rates, (start, start + half), np.append(Q, np.zeros(4)), rtol=rtol, atol=rtol * 1e-2 * size
        )
        end = done.y[:, -1]
        return end[:-4], complex(*end[-4:-2]), complex(*end[-2:])


class Opening(Motion):
    """The same for contacts that open and close, without rotations, under σ₀ sin ωt or γ₀ sin ωt from rest.

    Q are positions in the laboratory and the strain; velocities are non-affine, as everywhere.
    """

    def __init__(self, disks, physics, omega, stress=None, strain=None):
        super().__init__(disks, physics, omega, stress, strain)
        self.k = float(self.exact.k)
        self.radii, self.cell = disks.radii, disks.cell
        self.n, self.counts = disks.n, set()
        self.start = np.append(disks.positions.ravel(), 0.0)

    def _look(self, Q):
        """Pairs (i, j), r and overlaps of what touches."""
        cell, D = self.cell.copy(), len(self.cell)
        x = Q[:-1].reshape(-1, D)
        cell[:, 0] += Q[-1] * cell[:, 1]
        i, j = np.triu_indices(self.n, 1)
        r = x[j] - x[i]
        r -= np.round(np.linalg.solve(cell.T, r.T).T) @ cell
        images = np.array(list(product((-1, 0, 1), repeat=D))) @ cell  # small cells: two may touch
        i, j = (np.tile(end, len(images)) for end in (i, j))
        r = (images[:, None] + r).reshape(-1, D)
        overlap = self.radii[i] + self.radii[j] - np.linalg.norm(r, axis=1)
        touching = overlap > 0.0
        return i[touching], j[touching], r[touching], overlap[touching]

    def elastic(self, Q):
        i, j, r, overlap = self._look(Q)
        force = (self.k * overlap / np.linalg.norm(r, axis=1))[:, None] * r
        total = np.zeros((self.n, r.shape[1]))
        np.add.at(total, i, force)
        np.add.at(total, j, -force)
        return np.append(total.ravel(), -np.sum(force[:, 0] * r[:, 1]))

    def velocities(self, t, Q):
        i, j, r, _ = self._look(Q)
        self.Z = self._motions(i, j, r)
        if self.f is not None and len(self.f) != len(i):
            self.f = None
        self.counts.add(len(i))
        return super().velocities(t - 0.5 * np.pi / self.omega, Q)  # sine

    def until(self, end, rtol=1e-5):
        """(Q, stress) at t = end, from rest."""

        def rates(t, Q):
            v, _ = self.velocities(t, Q)
            shape = self.n, len(self.cell)
            moved = v[:-1].reshape(shape).copy()
            moved[:, 0] += v[-1] * Q[:-1].reshape(shape)[:, 1]
            return np.append(moved.ravel(), v[-1])

        Q = solve_ivp(rates, (0.0, end), self.start, "LSODA", rtol=rtol, atol=1e-3 * rtol).y[:, -1]
        return Q, self.velocities(end, Q)[1]


def slow_moduli(network, disks, alpha, omega, strain):
    """(G', G'') of contacts that move as in slow shear, and of what that dissipates: ∝ ω^α γ₀^(α−1). Collective."""
    shear = ElasticResponse(network).respond(simple_shear())
    total = network.sum(np.sum(np.sum(shear.motions[:, :2] ** 2, axis=1) ** (0.5 * (1 + alpha))))
    phase = (np.arange(100_000) + 0.5) * np.pi / 100_000
    cycle = 2 * np.pi * np.mean(np.sin(phase) ** (1 + alpha))
    c = (2 * disks.radii.mean()) ** (1 - alpha)
    loss = c * cycle * omega**alpha * strain ** (alpha - 1) * total / (np.pi * network.volume)
    return shear.value / network.volume, loss
