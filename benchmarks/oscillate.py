"""Steady oscillation under power-law damping against scipy's solve_ivp (BDF, sparse Jacobian) on the same equations.

    .venv/bin/python benchmarks/oscillate.py [--n 256] [--pressure 1e-3] [--alpha 0.5] [--omega 1e-8] [--stress 1e-5]

With --strain contacts move: what each amplitude of a chain costs in time steps, Newton steps, factors, cycles and
seconds of CPU, and how well G' and G'' are known.

Without, contacts are fixed. Velocities are defined by the equations only implicitly, and eliminating them would make
the Jacobian dense. So scipy gets unknowns and velocities, with a mass so small that it does not matter, and the exact
sparse Jacobian. Both start from the equivalent linear damping; scipy goes on until G* of a cycle is that of the one
before, and what both find is compared. Times in one process, one after the other.
"""

import argparse
import time

import numpy as np
import scipy.sparse as sp
from common import machine, packing
from scipy.integrate import solve_ivp

SAME = 1e-3  # change of G* from cycle to cycle, relatively


class Equations:
    """m v̇ = F cos ωt − K Q − Zᵀ f(Z v), Q̇ = v, with the strain as the last unknown and pinned unknowns left out."""

    def __init__(self, pencil, c, alpha, omega, stress):
        compatibility = pencil.compatibility
        indptr, columns, values = compatibility.C.getValuesCSR()
        C = sp.csr_matrix((values, columns, indptr), shape=compatibility.C.getSize())
        self.free = np.setdiff1d(np.arange(pencil.unknowns), pencil.pins)
        length = np.sqrt(pencil.network.volume)
        C = sp.hstack((C[:, self.free], (compatibility.g / length)[:, None])).tocsr()
        self.K = (C.T @ sp.diags(compatibility.w_K) @ C).tocsc()
        weights = compatibility.w_B.reshape(-1, compatibility.forms) / pencil.network.damping(pencil.law)
        kept = np.flatnonzero(weights.ravel())
        self.Z = (sp.diags(np.sqrt(weights.ravel()[kept])) @ C[kept]).tocsr()
        self.forms = np.count_nonzero(weights[0])
        self.c, self.alpha, self.omega, self.force = c, alpha, omega, stress * length
        self.size, self.evaluations = C.shape[1], 0

    def prepare(self, v):
        """Mass and softening from a typical velocity: both far too small to matter."""
        z = (self.Z @ v).reshape(-1, self.forms)
        typical = np.sqrt(np.mean(z**2))
        self.soft = 1e-6 * typical
        self.mass = 1e-6 * self.c * typical ** (self.alpha - 1.0) / self.omega

    def rates(self, t, y):
        """Right-hand side."""
        self.evaluations += 1
        Q, v = np.split(y, 2)
        z = (self.Z @ v).reshape(-1, self.forms)
        f = self.c * (np.sum(z**2, axis=1) + self.soft**2)[:, None] ** ((self.alpha - 1) / 2) * z
        left = -(self.K @ Q) - self.Z.T @ f.ravel()
        left[-1] += self.force * np.cos(self.omega * t)
        return np.concatenate((v, left / self.mass))

    def jacobian(self, t, y):
        """Its derivative, sparse."""
        z = (self.Z @ y[self.size :]).reshape(-1, self.forms)
        size = np.sum(z**2, axis=1) + self.soft**2
        blocks = np.eye(self.forms) + (self.alpha - 1) * z[:, :, None] * z[:, None, :] / size[:, None, None]
        blocks *= self.c * (size ** ((self.alpha - 1) / 2))[:, None, None]
        count = len(blocks)
        D = sp.bsr_matrix((blocks, np.arange(count), np.arange(count + 1)))
        B = self.Z.T @ (D @ self.Z)
        return sp.bmat([[None, sp.identity(self.size)], [-self.K / self.mass, -B / self.mass]]).tocsc()


def print_costs(disks, network, law, args):
    """A row for each amplitude of moving contacts, in a chain."""
    from jampetsc.oscillation.amplitude_sweep import sweep_amplitudes

    amplitudes, begun = [float(word) for word in args.strain.split(",")], [time.process_time()]
    print("| γ₀ | G' | G'' | errors, % | repeats | cycles | steps | Newton | factors | CPU, s |")
    print("|---|---|---|---|---|---|---|---|---|---|")

    def print_row(number, record):
        G, error = record["G"], record["G_error"]
        counts = (record[name] for name in ("cycles", "steps_taken", "newton_steps", "factorisations"))
        begun.append(time.process_time())
        print(
            f"| {amplitudes[number]:g} | {G.real:.4g} | {G.imag:.4g} | {100 * error.real / abs(G.real):.1g}, "
            f"{100 * error.imag / abs(G.imag):.1g} | {'yes' if record['repeats'] else 'no'} | "
            + " | ".join(map(str, counts))
            + f" | {begun[-1] - begun[-2]:.0f} |",
            flush=True,
        )

    sweep_amplitudes(
        disks, network, law, omega=[args.omega], amplitudes=amplitudes, control="strain", contacts="moving",
        steps=args.steps, save=print_row,
    )  # fmt: skip
    print(f"\nall: {begun[-1] - begun[0]:.0f} s of CPU")


def main():
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--n", type=int, default=256)
    words.add_argument("--pressure", default="1e-3")
    for name, default in (("alpha", 0.5), ("omega", 1e-8), ("stress", 1e-5), ("rtol", 1e-4)):
        words.add_argument(f"--{name}", type=float, default=default)
    words.add_argument("--steps", type=int, default=32)
    words.add_argument("--strain", help="amplitudes LOW,…,HIGH of moving contacts")
    args = words.parse_args()
    path = packing(args.n, args.pressure)

    from jampetsc.io.packing_file import read_packing
    from jampetsc.laws.damping import damping_law
    from jampetsc.oscillation.drive import Drive
    from jampetsc.oscillation.steady_oscillation import SteadyOscillation
    from jampetsc.petsc import session
    from jampetsc.response.contact_network import build_network

    disks = read_packing(path)
    network = build_network(disks, session.start("real").comm)
    law = damping_law(exponent=args.alpha)
    print(machine())
    if args.strain:
        print_costs(disks, network, law, args)
        return
    oscillation = SteadyOscillation(network, law, 2.0 * float(disks.radii.mean()), args.steps)
    begun = time.perf_counter(), time.process_time()
    found = oscillation.solve(Drive(args.omega, args.stress, stress_controlled=True))
    ours = time.perf_counter() - begun[0], time.process_time() - begun[1]
    print(
        f"jampetsc: {ours[0]:.1f} s ({ours[1]:.1f} s of CPU), {args.steps} steps, G* = {found.G:.6g}, "
        f"error {found.error / abs(found.G):.0e}, Newton {found.newton_steps}, linear {found.linear_iterations}",
        flush=True,
    )

    power, pencil = oscillation.power, oscillation.contacts.pencil
    equations = Equations(pencil, power.coefficient, args.alpha, args.omega, args.stress)
    first = oscillation.equivalent(Drive(args.omega, args.stress, stress_controlled=True))[0].waves
    kept = np.append(equations.free, first.shape[1] - 1)
    Q, v = (first[0] / (1j * args.omega)).real[kept], first[0].real[kept]
    equations.prepare(v)
    end = 2 * np.pi / args.omega
    scale = np.append(np.full(len(Q), np.abs(Q).max()), np.full(len(v), np.abs(v).max()))
    y, G, theirs = np.append(Q, v), [], np.zeros(2)
    while len(G) < 2 or abs(G[-1] - G[-2]) > SAME * abs(G[-1]):
        begun = time.perf_counter(), time.process_time()
        done = solve_ivp(
            equations.rates,
            (0.0, end),
            y,
            method="BDF",
            jac=equations.jacobian,
            rtol=args.rtol,
            atol=args.rtol * 1e-2 * scale,
            t_eval=np.append((np.arange(512) + 0.5) * end / 512, end),
        )
        theirs += time.perf_counter() - begun[0], time.process_time() - begun[1]
        y = done.y[:, -1]
        strain = done.y[equations.size - 1, :-1] / np.sqrt(network.volume)
        G.append(args.stress / (strain @ np.exp(-1j * args.omega * done.t[:-1]) * 2.0 / 512))
        print(
            f"scipy BDF, {len(G)} cycles: {theirs[0]:.1f} s ({theirs[1]:.1f} s of CPU), G* = {G[-1]:.6g}, "
            f"{abs(G[-1] - found.G) / abs(found.G):.0e} away, {equations.evaluations} evaluations",
            flush=True,
        )
    ratios = theirs / ours
    print(
        f"a cycle that repeats to {SAME:g}: ratio of elapsed times {ratios[0]:.1f}, of CPU times {ratios[1]:.1f}; "
        f"{len(G)} cycles, each {ratios[0] / len(G):.1f} and {ratios[1] / len(G):.1f} times as long"
    )


if __name__ == "__main__":
    main()
