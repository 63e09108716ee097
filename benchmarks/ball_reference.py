"""G* and C* of a small packing or network in ball arithmetic: numbers with a proved radius, by Arb (python-flint).

What is on disk is taken as exact. Contacts and their graph are those of the reference of the tests (tests/dense.py);
bonds, forces, K, B and the solution are made again, and with more bits until each part is known to DIGITS digits. A
part that vanishes has a radius that is small beside |G*|.
"""

import sys
from pathlib import Path

import numpy as np
from flint import acb, acb_mat, arb, arb_mat, ctx

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))  # the dense reference

DIGITS = 40
ZERO = 1e-60  # radius of a part that vanishes, relative to |G*|
BITS = (320, 640, 1280, 2560)  # tried one after the other


class Singular(Exception):
    """K + iωB cannot be told from a singular matrix."""


class BallReference:
    """Balls of K, B and G* of `source` for `physics` under `loads`, displacement gradients (L, D, D).

    masses   `Masses` of the particles; None: without inertia
    """

    def __init__(self, source, physics, loads, masses=None):
        from dense import NetworkReference, Reference

        from jampetsc.packing.packing import Packing

        self.source, self.physics, self.loads, self.masses = source, physics, np.array(loads, float), masses
        self.is_packing = isinstance(source, Packing)
        self.graph = (Reference if self.is_packing else NetworkReference)(source, physics, loads)
        self._made = {}

    def tensor(self, omega) -> list:
        """C*(ω) between all pairs of loads, rows of acb, each part known to DIGITS digits or zero. Raises Singular."""
        for bits in BITS:
            ctx.prec = bits
            C = self._tensor(omega, bits)
            if C is not None and all(_is_known(value) for row in C for value in row):
                return C
        raise Singular

    def _tensor(self, omega, bits):
        Z, volume = self._pencil(omega, bits)
        m, L = len(Z) - len(self.loads), range(len(self.loads))
        relaxed = self._relaxed(Z, [[Z[row][m + load] for row in range(m)] for load in L])
        if relaxed is None:
            return None
        return [[(Z[m + a][m + b] - relaxed[a, b]) / volume for b in L] for a in L]

    def susceptibility(self, omega, probe, particles) -> list:
        """χ(ω) of a wave and its G(k), or of each of the `particles`, acb known to DIGITS digits. Raises Singular."""
        for bits in BITS:
            ctx.prec = bits
            Z, volume = self._pencil(omega, bits)
            columns, weights, factor = self._forces(probe, particles, volume)
            relaxed = self._relaxed(Z, columns)
            if relaxed is None:
                continue
            each = [relaxed[number, number] for number in range(len(columns))]
            chi = [
                sum((each[number] for number in own), acb(0)) * weights
                for own in self._shares(columns, particles)
            ]
            values = chi if factor is None else [*chi, factor / chi[0]]
            if all(map(_is_known, values)):
                return values
        raise Singular

    def _shares(self, columns, particles):
        """Numbers of the columns that make up each χ."""
        if not len(particles):
            return [range(len(columns))]
        D = self.graph.dimension
        return [range(D * number, D * number + D) for number in range(len(particles))]

    def _forces(self, probe, particles, volume):
        """(columns of forces on all unknowns, their weight in χ, (n/V)/k² of a wave or None)."""
        g, D = self.graph, self.graph.dimension
        columns, factor = [], None
        if len(particles):
            for particle in particles:
                for axis in range(D):
                    forces = [[arb(0)] * D for _ in range(g.n)]
                    forces[g.number[int(particle)]][axis] = arb(1)
                    columns.append(forces)
            weight = arb(1) / D
        else:
            positions, cell = self._places()
            k = arb_mat(cell).solve(arb_mat([[2 * arb.pi() * number] for number in probe.numbers]))
            k = [k[axis, 0] for axis in range(D)]
            square = sum((part * part for part in k), arb(0))
            along = [part / square.sqrt() for part in k]
            directions = [along] if probe.polarisation == "longitudinal" else _across(along)
            for direction in directions:
                for wave in (arb.cos, arb.sin):
                    phases = [sum((k[x] * positions[disk][x] for x in range(D)), arb(0)) for disk in g.disks]
                    columns.append([[wave(phase) * part for part in direction] for phase in phases])
            weight, factor = arb(1) / (g.n * len(directions)), g.n / (volume * square)
        for forces in columns:
            for piece in g.pieces():
                disks = [disk for disk, _ in piece]
                for axis in range(D):
                    mean = sum((forces[disk][axis] for disk in disks), arb(0)) / len(disks)
                    for disk in disks:
                        forces[disk][axis] -= mean
        spins = [arb(0)] * (g.dofs - D)
        return [[part for row in forces for part in (*row, *spins)] for forces in columns], weight, factor

    def _pencil(self, omega, bits):
        """(K + iωB with the rows of the loads, V)."""
        if bits not in self._made:
            self._made[bits] = self._matrices()
        K, B, M, volume = self._made[bits]
        s, rows = acb(0, arb(omega)), range(len(K))
        return [[K[a][b] + s * (B[a][b] + s * M[a][b]) for b in rows] for a in rows], volume

    def _relaxed(self, Z, columns):
        """cᵀZ⁻¹c between columns (m,) on the unknowns; None where that cannot be told."""
        free = [row for row in range(len(columns[0])) if row not in self._pins()]
        scale = [1 / (abs(Z[a][a]).mid() + (abs(Z[a][a]).mid() == 0)).sqrt() for a in free]
        pairs = list(zip(free, scale, strict=True))
        A = acb_mat([[Z[a][b] * u * v for b, v in pairs] for a, u in pairs])
        c = acb_mat([[column[a] * u for column in columns] for a, u in pairs])
        try:
            return c.transpose() * A.solve(c)
        except ZeroDivisionError:
            return None

    def _pins(self):
        """One unknown of each move that neither K nor B resists."""
        g, law = self.graph, self.physics.law
        pins = set()
        if self.masses is not None:  # which resist every move
            return pins
        for piece in g.pieces():
            disk, colour = piece[0]
            first = disk * g.dofs
            if not law.drag:
                pins |= set(range(first, first + g.dimension))
            if colour and not law.spin_drag:
                pins |= set(range(first + g.dimension, first + g.dofs))
        return pins

    def _places(self):
        """Positions of all particles and the cell, rows of arb."""
        source = self.source
        if not self.is_packing:
            return _exact(source.positions), _exact(source.cell)
        return _sum(source.base, source.offset), _sum(source.cell_base, source.cell_offset)

    def _bonds(self):
        """(r, f, k) of each contact: the bond vector, a list, its force and its stiffness."""
        g, source = self.graph, self.source
        D, (positions, cell) = g.dimension, self._places()
        if self.is_packing:
            flat = np.array(source.base, float) + source.offset
            edges = np.array(source.cell_base, float) + source.cell_offset
            potential = source.potential
        disks = g.disks
        for c, (i, j) in enumerate(zip(g.i, g.j, strict=True)):
            a, b = disks[i], disks[j]
            if self.is_packing:
                images = np.rint((np.array(g.r[c], float) - (flat[b] - flat[a])) @ np.linalg.inv(edges))
            else:
                images = source.images[c]
            images = [int(number) for number in images]
            r = [
                positions[b][x] - positions[a][x] + sum(images[y] * cell[y][x] for y in range(D))
                for x in range(D)
            ]
            if not self.is_packing:
                yield r, arb(-float(source.tension[c])), arb(float(source.stiffness[c]))
                continue
            distance = sum((x * x for x in r), arb(0)).sqrt()
            sigma = arb(float(source.radii[a])) + arb(float(source.radii[b]))
            length = sigma if potential.stiffness == "inverse-square-diameter" else arb(1)
            k, alpha, x = arb(potential.k), arb(potential.exponent), (sigma - distance) / length
            yield r, k / length * x ** (alpha - 1), k * (alpha - 1) / length**2 * x ** (alpha - 2)

    def _matrices(self):
        """(K, B, M, V): rows of arb, those of the loads last, and the volume."""
        g, law = self.graph, self.physics.law
        D, d, m = g.dimension, g.dofs, g.n * g.dofs
        size, damping = m + len(self.loads), arb(float(g.k)) * arb(float(law.tau1))
        K, B, M = ([[arb(0)] * size for _ in range(size)] for _ in range(3))
        cell = (
            _sum(self.source.cell_base, self.source.cell_offset)
            if self.is_packing
            else _exact(self.source.cell)
        )
        volume = arb(1)
        for axis in range(D):
            volume *= cell[axis][axis]
        spins = np.array(g.spins, int)
        for (r, force, stiffness), i, j in zip(self._bonds(), g.i, g.j, strict=True):
            distance = sum((x * x for x in r), arb(0)).sqrt()
            n = [x / distance for x in r]
            at = [*range(i * d, i * d + d), *range(j * d, j * d + d), *range(m, size)]
            bond = [[arb(0)] * len(at) for _ in range(D)]
            for x in range(D):
                bond[x][x], bond[x][d + x] = arb(-1), arb(1)
                for e, gradient in enumerate(self.loads):
                    bond[x][2 * d + e] = sum((arb(gradient[x][y]) * r[y] for y in range(D)), arb(0))
            bond = arb_mat(bond)
            n = arb_mat([[x] for x in n])
            along = n * n.transpose()
            across = arb_mat([[arb(int(x == y)) - along[x, y] for y in range(D)] for x in range(D)])
            hessian = along * stiffness
            if self.physics.prestress:
                hessian = hessian - across * (force / distance)
            slide = across * bond
            for spin, basis in enumerate(spins):
                turned = arb_mat(basis.tolist()) * n
                for x in range(D):
                    for disk, end in ((i, d - len(spins)), (j, 2 * d - len(spins))):
                        slide[x, end + spin] = -arb(float(g.radii[disk])) * turned[x, 0]
            viscous = bond.transpose() * (along * law.normal + across * law.transverse) * bond
            elastic, sliding = bond.transpose() * hessian * bond, slide.transpose() * slide
            viscous += sliding * arb(float(law.sliding))
            elastic += sliding * (arb(float(self.physics.tangential_stiffness)) * stiffness)
            for a, row in enumerate(at):
                for b, column in enumerate(at):
                    K[row][column] += elastic[a, b]
                    B[row][column] += viscous[a, b] * damping
        radii = (
            [arb(0)] if self.source.radii is None else [arb(float(radius)) for radius in self.source.radii]
        )
        diameter = 2 * sum(radii, arb(0)) / len(radii)
        of_spin = damping * arb(float(law.spin_drag)) * diameter**2
        for row in range(m):
            mass = self._mass(row // d, radii, diameter)
            if row % d < D:
                B[row][row] += damping * arb(float(law.drag))
                M[row][row] += mass
                continue
            turning = mass * radii[g.disks[row // d]] ** 2 * (arb(1) / 2 if D == 2 else arb(2) / 5)
            slip = {row: arb(1)}  # of the spin against the fluid: half the vorticity of each load
            for load, gradient in enumerate(self.loads):
                turn = [
                    (arb(gradient[a][b]) - arb(gradient[b][a])) * int(spins[row % d - D][a][b])
                    for a in range(D)
                    for b in range(D)
                ]
                slip[m + load] = -sum(turn, arb(0)) / 4
            for a, first in slip.items():
                for b, second in slip.items():
                    B[a][b] += of_spin * first * second
                    M[a][b] += turning * first * second
        fluid = self._fluid(D)
        for a in range(len(self.loads)):
            for b in range(len(self.loads)):
                B[m + a][m + b] += damping * arb(float(law.eta_f)) * volume * fluid[a][b]
        return K, B, M, volume

    def _mass(self, disk, radii, diameter):
        """Mass of a disk of the graph, zero without inertia."""
        if self.masses is None:
            return arb(0)
        share = arb(1)
        if self.masses.by == "volume":
            share = (2 * radii[self.graph.disks[disk]] / diameter) ** self.graph.dimension
        return arb(float(self.masses.mass)) * share

    def _fluid(self, D):
        """2 s′ : s″ of the deviators of the loads."""
        deviators = []
        for gradient in self.loads:
            trace = sum((arb(gradient[x][x]) for x in range(D)), arb(0)) / D
            deviators.append(
                [
                    [
                        (arb(gradient[x][y]) + arb(gradient[y][x])) / 2 - (trace if x == y else 0)
                        for y in range(D)
                    ]
                    for x in range(D)
                ]
            )
        pairs = [(x, y) for x in range(D) for y in range(D)]
        return [
            [2 * sum((a[x][y] * b[x][y] for x, y in pairs), arb(0)) for b in deviators] for a in deviators
        ]


def _exact(values):
    """Rows of arb of an array (N, D), exactly."""
    return [[arb(float(x)) for x in row] for row in values]


def _sum(high, low):
    """Rows of arb of high + low, exactly but for what the working precision rounds."""
    return [
        [arb(float(a)) + arb(float(b)) for a, b in zip(*rows, strict=True)]
        for rows in zip(high, low, strict=True)
    ]


def _across(along):
    """Unit vectors across a direction, lists of arb."""
    if len(along) == 2:
        return [[-along[1], along[0]]]
    axis = [arb(int(x == min(range(3), key=lambda place: abs(float(along[place].mid()))))) for x in range(3)]
    first = _cross(along, axis)
    size = sum((part * part for part in first), arb(0)).sqrt()
    first = [part / size for part in first]
    return [first, _cross(along, first)]


def _cross(a, b):
    return [a[(x + 1) % 3] * b[(x + 2) % 3] - a[(x + 2) % 3] * b[(x + 1) % 3] for x in range(3)]


def _is_known(value):
    size = abs(value)
    return all(
        part.rad() <= 10.0**-DIGITS * abs(part) or part.rad() <= ZERO * size
        for part in (value.real, value.imag)
    )


def difference(value: complex, exact) -> tuple[float, float, float]:
    """|value − exact|, of the whole, the real and the imaginary part, each rounded down by the exact one's radius."""
    real, imaginary = arb(value.real) - exact.real, arb(value.imag) - exact.imag
    parts = [float(abs(part).lower()) for part in (real, imaginary)]
    return float(np.hypot(*parts)), *parts
