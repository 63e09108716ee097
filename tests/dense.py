"""Reference for the mechanics: all of a small packing from its definition, dense, in extended precision.

Shares no code with the package. Contacts come from loops over all pairs and images, K from the pair Hessian
V'' n nᵀ + (V'/r) (1 − n nᵀ) by the chain rule, with the amplitude of each load as one more coordinate, and null
spaces are lifted by projectors, not held by pins. It takes packings in two and in three dimensions, and any loads.
Numbers are numpy.longdouble, 18 digits on x86, to judge doubles by.
"""

from itertools import product

import numpy as np
from scipy.linalg import lu_factor, lu_solve

LONG, COMPLEX = np.longdouble, np.clongdouble
REFINEMENTS = 12
SIMPLE_SHEAR = ((0, 1), (0, 0))  # E = x̂ŷ


def total(high, low=None):
    """high + low as longdouble."""
    return np.asarray(high, LONG) + (0 if low is None else np.asarray(low, LONG))


def all_pairs(positions, radii, cell, images=2):
    """Overlapping pairs i < j as lists i, j, r (M, D), by trying every image in turn."""
    found, touching = [], (radii + radii[:, None]) ** 2
    between = (positions[None] - positions[:, None]).astype(float)  # doubles tell those that are far away
    near = np.triu((1.0 + 1e-6) * touching.astype(float), 1)
    for numbers in product(range(-images, images + 1), repeat=len(cell)):
        shift = np.array(numbers, LONG) @ cell
        for i, j in np.argwhere(((between + shift.astype(float)) ** 2).sum(axis=-1) < near).tolist():
            r = positions[j] - positions[i] + shift
            if (r**2).sum() < touching[i, j]:
                found.append((i, j, r))
    i, j, r = zip(*found, strict=True) if found else ((), (), ())
    return list(i), list(j), np.array(r, LONG).reshape(-1, len(cell))


def backbone(n, i, j, force, threshold, least=3):
    """Indices of contacts above the threshold between disks with `least` or more of them, and those disks."""
    alive = {c for c in range(len(i)) if force[c] > threshold}
    disks = set(range(n))
    while True:
        loose = {d for d in disks if sum(d in (i[c], j[c]) for c in alive) < least}
        if not loose:
            return sorted(alive), sorted(disks)
        disks -= loose
        alive = {c for c in alive if i[c] in disks and j[c] in disks}


def solve(A, b):
    """A⁻¹ b, b (m,) or (m, L), in the precision of A and b: from doubles by refinement, or by elimination if need be.

    Refined means: the solution for a matrix whose elements differ from those of A by a few roundings in this
    precision, real and imaginary parts each (Higham, Accuracy and Stability of Numerical Algorithms, 2002,
    chapter 12). Elimination gives no more.
    """
    low = complex if np.iscomplexobj(A) else float
    factor, x, few = lu_factor(A.astype(low)), np.zeros_like(b), 4 * np.finfo(A.dtype).eps
    sizes = [np.abs(part(A)) for part in (np.real, np.imag)]
    for _ in range(REFINEMENTS):
        rest = b - A @ x
        real, imaginary = np.abs(x.real), np.abs(x.imag)
        same, crossed = sizes[0] @ real + sizes[1] @ imaginary, sizes[0] @ imaginary + sizes[1] @ real
        if np.all(np.abs(rest.real) <= few * (same + np.abs(b.real))) and np.all(
            np.abs(rest.imag) <= few * (crossed + np.abs(b.imag))
        ):
            return x
        x += lu_solve(factor, rest.astype(low))
    return eliminated(A, b)


def eliminated(A, b):
    """A⁻¹ b by elimination with row exchanges, in the precision of A and b."""
    A, x = A.copy(), b.copy()
    for k in range(len(A)):
        p = k + int(np.argmax(np.abs(A[k:, k])))
        A[[k, p]], x[[k, p]] = A[[p, k]], x[[p, k]]
        factor = A[k + 1 :, k] / A[k, k]
        A[k + 1 :, k + 1 :] -= factor[:, None] * A[k, k + 1 :]
        x[k + 1 :] -= np.multiply.outer(factor, x[k])
    for k in range(len(A) - 1, -1, -1):
        x[k] = (x[k] - A[k, k + 1 :] @ x[k + 1 :]) / A[k, k]
    return x


def without(moves, x):
    """x with its part along every column of `moves` taken out."""
    for move in moves.T:
        x = x - move * (move @ x) / (move @ move)
    return x


def relaxed(matrix, moves):
    """(x, value): minimiser of the quadratic form (m + 1, m + 1) where its last coordinate is 1, and its value there.

    moves   columns (m, ·) that cost nothing
    """
    A, c = matrix[:-1, :-1], matrix[:-1, -1]
    scale = 1 / np.sqrt(np.abs(np.diag(A)))
    A = A * np.outer(scale, scale)
    for move in moves.T:
        q = move / scale
        A = A + np.outer(q, q) / (q @ q)
    x = scale * solve(A, -(scale * c))
    return x, matrix[-1, -1] + c @ x


def _scaled_solve(A, columns):
    """A⁻¹ columns (m, L), A scaled to a unit diagonal first."""
    scale = 1 / np.sqrt(np.abs(np.diag(A)))
    A = A * np.outer(scale, scale)
    return scale[:, None] * solve(A, scale[:, None] * columns)


class NewtonSteps:
    """What Newton's method takes for a solver, in dense numpy."""

    def factorise(self, indptr, indices, values, order=1):
        self.matrix = np.zeros((len(indptr) - 1,) * 2)
        self.matrix[np.repeat(np.arange(len(indptr) - 1), np.diff(indptr)), indices] = values
        self.matrix += np.triu(self.matrix, 1).T
        return bool(np.linalg.eigvalsh(self.matrix)[0] > 0)

    def solve(self, b):
        return np.linalg.solve(self.matrix, b)

    def order(self, n, i, j):
        return np.arange(n, dtype=np.uint32)


def spin_bases(dimension):
    """Matrices (D, D), one for each component of a spin θ: θ × v = Σ θ_s (basis_s v)."""
    if dimension == 2:
        return np.array([[[0, -1], [1, 0]]], LONG)
    x, y, z = np.eye(3, dtype=LONG)
    return np.array([np.outer(b, a) - np.outer(a, b) for a, b in ((y, z), (z, x), (x, y))])


def symmetric_loads(dimension):
    """E of xx, yy, (zz, yz, xz,) xy, (L, D, D), shears ½(x̂ŷ + ŷx̂)."""
    pairs = {2: ("xx", "yy", "xy"), 3: ("xx", "yy", "zz", "yz", "xz", "xy")}[dimension]
    axes = [["xyz".index(letter) for letter in pair] for pair in pairs]
    unit = np.eye(dimension, dtype=LONG)
    return np.array([(np.outer(unit[a], unit[b]) + np.outer(unit[b], unit[a])) / 2 for a, b in axes])


class Reference:
    """K, B and G* of `disks` for `physics` (law, prestress), rattlers left out.

    Unknowns are interleaved per disk, disks in file order: D displacements and, where something acts on them, spins.
    Spins are absolute: the fluid of a load turns with its vorticity over 2.

    `K` and `B` are (m + L, m + L): their last rows and columns belong to the amplitudes of the `loads`, displacement
    gradients (L, D, D) (default: simple shear γ alone). Moduli are energies along F = 1 + εE.
    """

    def __init__(self, disks, physics, loads=None):
        self.law, self.prestress = physics.law, physics.prestress
        self.springs = LONG(physics.tangential_stiffness)
        self.k, potential = LONG(disks.potential.k), disks.potential
        positions, cell = total(disks.base, disks.offset), total(disks.cell_base, disks.cell_offset)
        radii = total(disks.radii)
        self.dimension = D = len(cell)
        self.loads = np.zeros((1, D, D), LONG) if loads is None else np.array(loads, LONG)
        if loads is None:
            self.loads[0, :2, :2] = SIMPLE_SHEAR
        self.area = np.prod(np.diag(cell))
        i, j, r = all_pairs(positions, radii, cell)
        distance = np.sqrt((r**2).sum(axis=1))
        sigma = radii[i] + radii[j]
        alpha = LONG(potential.exponent)
        length = sigma if potential.stiffness == "inverse-square-diameter" else np.ones_like(sigma)
        x = (sigma - distance) / length
        force, stiffness = (
            self.k / length * x ** (alpha - 1),
            self.k * (alpha - 1) / length**2 * x ** (alpha - 2),
        )
        self.energy = (self.k / alpha * x**alpha).sum()
        self.pressure = (force * distance).sum() / (D * self.area)
        self.stress = -(r * (force / distance)[:, None]).T @ r / self.area
        self.diameter = diameter = 2 * radii.mean()
        threshold = max(1e-6 * self.pressure * diameter ** (D - 1), 1e-14 * self.k * diameter)
        kept, self.disks = backbone(len(radii), i, j, force, threshold, D + 1)
        self.number = {disk: row for row, disk in enumerate(self.disks)}
        self.i, self.j = ([self.number[end[c]] for c in kept] for end in (i, j))
        self.r, self.distance, self.force, self.stiffness = (a[kept] for a in (r, distance, force, stiffness))
        self.radii = radii[self.disks]
        self.n, self.contacts = len(self.disks), len(kept)
        self._assemble()

    def _assemble(self):
        D, law = self.dimension, self.law
        rolls = law.sliding > 0 or law.spin_drag > 0 or self.springs > 0
        self.spins = spin_bases(D) if rolls else np.zeros((0, D, D), LONG)
        self.dofs = D + len(self.spins)
        # half the vorticity of each load as components of a spin, (L, D(D − 1)/2)
        vorticity = (self.loads - self.loads.transpose(0, 2, 1)) / 2
        self.turning = np.einsum("lab,sab->ls", vorticity, self.spins) / 2
        self.K, self.B = self._matrices()

    def _matrices(self):
        m, d, D, law = self.n * self.dofs, self.dofs, self.dimension, self.law
        size = m + len(self.loads)
        K, B = np.zeros((size, size), LONG), np.zeros((size, size), LONG)
        damping = self.k * LONG(law.tau1)
        for c, (i, j) in enumerate(zip(self.i, self.j, strict=True)):
            n = self.r[c] / self.distance[c]
            along = np.outer(n, n)
            across = np.eye(D, dtype=LONG) - along
            at = [*range(i * d, i * d + d), *range(j * d, j * d + d), *range(m, size)]
            bond = np.zeros((D, len(at)), LONG)  # what the unknowns and the loads do to the bond vector
            bond[:, :D], bond[:, d : d + D] = -np.eye(D), np.eye(D)
            bond[:, 2 * d :] = (self.loads @ self.r[c]).T
            hessian = self.stiffness[c] * along
            if self.prestress:
                hessian = hessian - self.force[c] / self.distance[c] * across
            slide = across @ bond
            slide[:, D:d] = -self.radii[i] * (self.spins @ n).T
            slide[:, d + D : 2 * d] = -self.radii[j] * (self.spins @ n).T
            block = np.ix_(at, at)
            K[block] += bond.T @ hessian @ bond + self.springs * self.stiffness[c] * slide.T @ slide
            motions = (law.normal, along @ bond), (law.transverse, across @ bond), (law.sliding, slide)
            for weight, motion in motions:
                if weight:
                    B[block] += damping * LONG(weight) * motion.T @ motion
        moves = np.tile(np.arange(d) < D, self.n)
        B[range(m), range(m)] += damping * LONG(law.drag) * moves
        for row in np.flatnonzero(~moves):
            slip = np.zeros(size, LONG)  # of the spin against the fluid around the disk
            slip[row], slip[m:] = 1, -self.turning[:, row % d - D]
            B += damping * LONG(law.spin_drag) * self.diameter**2 * np.outer(slip, slip)
        B[m:, m:] += damping * LONG(law.eta_f) * self.area * self._fluid()
        return K, B

    def _fluid(self):
        """2 s′ : s″ of the deviators of the loads, (L, L): the dissipation of an incompressible fluid."""
        symmetric = (self.loads + self.loads.transpose(0, 2, 1)) / 2
        trace = np.trace(symmetric, axis1=1, axis2=2) / self.dimension
        deviators = symmetric - trace[:, None, None] * np.eye(self.dimension, dtype=LONG)
        return 2 * np.einsum("aij,bij->ab", deviators, deviators)

    def pieces(self):
        """Connected pieces as lists of (disk, colour); colour is 0 where neighbours cannot alternate."""
        neighbours = [set() for _ in range(self.n)]
        for i, j in zip(self.i, self.j, strict=True):
            neighbours[i].add(j)
            neighbours[j].add(i)
        colour, pieces = {}, []
        for start in range(self.n):
            if start in colour:
                continue
            colour[start], queue = 1, [start]
            for disk in queue:  # grows while it is walked through
                for other in neighbours[disk] - colour.keys():
                    colour[other] = -colour[disk]
                    queue.append(other)
            alternates = all(colour[a] != colour[b] for a in queue for b in neighbours[a])
            pieces.append([(disk, colour[disk] * alternates) for disk in queue])
        return pieces

    def free_moves(self):
        """Orthogonal columns (m, ·): moves that cost no energy and, under contact damping, nothing at all."""
        columns = []
        for piece in self.pieces():
            for axis in range(self.dimension):
                column = np.zeros((self.n, self.dofs), LONG)
                column[[disk for disk, _ in piece], axis] = 1
                columns.append(column.ravel())
            for axis in range(self.dimension, self.dofs) if piece[0][1] else ():
                column = np.zeros((self.n, self.dofs), LONG)
                for disk, colour in piece:  # gears in mesh: ρ_i θ_i + ρ_j θ_j = 0
                    column[disk, axis] = colour / self.radii[disk]
                columns.append(column.ravel())
        return np.array(columns).T

    def _relax(self, matrix, moves, load=0):
        """`relaxed` at unit amplitude of one load; the last rows and columns of `matrix` belong to all loads."""
        rows = [*range(len(matrix) - len(self.loads)), load - len(self.loads)]
        return relaxed(matrix[np.ix_(rows, rows)], moves)

    def solution(self, omega, load=0):
        """(x, G*) at frequency ω: the field per unit strain, without free moves, and the modulus."""
        x, value = self._relax(self.K + COMPLEX(1j) * LONG(omega) * self.B, self.costless(), load)
        return without(self._unresisted(), x), value / self.area

    def modulus(self, omega, load=0):
        """G*(ω), complex double, each part right to the last digit or so."""
        motions = self._motions(omega, load)
        return complex(self._between(omega, (load, motions), (load, motions)))

    def tensor(self, omega):
        """C*(ω) of all pairs of loads, (L, L) complex, V⁻¹ (z_EE′ − z_Eᵀ Z⁻¹ z_E′), in extended precision."""
        solved = [(load, self._motions(omega, load)) for load in range(len(self.loads))]
        return np.array([[self._between(omega, one, other) for other in solved] for one in solved])

    def _massive(self, omega, masses):
        """K + iωB − ω²M (m, m) for masses (n,) of disks; no load drives `costless` moves, which are lifted."""
        d, m = self.dofs, self.n * self.dofs
        inertia = np.repeat(np.asarray(masses, LONG), d).reshape(self.n, d)
        inertia[:, self.dimension :] *= {2: LONG(1) / 2, 3: LONG(2) / 5}[self.dimension] * self.radii[
            :, None
        ] ** 2
        inertia = inertia.ravel()
        A = self.K[:m, :m] + COMPLEX(1j) * LONG(omega) * self.B[:m, :m] - np.diag(LONG(omega) ** 2 * inertia)
        for move in self.costless().T:
            weighted = inertia * move
            A = A + COMPLEX(1j) * np.outer(weighted, weighted) / (move @ weighted)
        return A

    def massive_tensor(self, omega, masses):
        """C*(ω) of all pairs of loads, (L, L), with inertia: masses (n,) of disks; spins are relative to the flow."""
        m = self.n * self.dofs
        K, B = (self.turning_with_loads(matrix) for matrix in (self.K, self.B))
        Z = K + COMPLEX(1j) * LONG(omega) * B
        x = _scaled_solve(self._massive(omega, masses), -Z[:m, m:])
        return (Z[m:, m:] + Z[m:, :m] @ x) / self.area

    def massive_susceptibility(self, omega, forces, masses):
        """χ = fᵀ(K + iωB − ω²M)⁻¹f, complex double, of forces (n, D) without their means; masses (n,)."""
        f = self._without_net_force(forces).ravel()
        return complex(f @ _scaled_solve(self._massive(omega, masses), COMPLEX(1) * f[:, None])[:, 0])

    def _motions(self, omega, load):
        """Relative motions of the contacts and of disks in the fluid under a load: (a∥, a⊥, a⊥ᶜ, ũ, d (θ − Ω))."""
        x, _ = self.solution(omega, load)
        D, u = self.dimension, x.reshape(-1, self.dofs)
        n = self.r / self.distance[:, None]
        bond = u[self.j, :D] - u[self.i, :D] + self.r @ self.loads[load].T
        along = (n * bond).sum(axis=1)
        across = bond - n * along[:, None]
        rims = self.radii[self.i, None] * u[self.i, D:] + self.radii[self.j, None] * u[self.j, D:]
        slide = across - np.einsum("cs,sab,cb->ca", rims, self.spins, n)
        return along, across, slide, u[:, :D], self.diameter * (u[:, D:] - self.turning[load])

    def _between(self, omega, one, other):
        """The modulus between two loads with their motions, in extended precision.

        The form's stationary value, summed over the products it is made of: rounding of the fields counts to second
        order only, and the smaller one of G' and G'' is not the rest of a difference.
        """
        (load, motions), (second, others) = one, other
        law, omega = self.law, LONG(omega)
        damping = self.k * LONG(law.tau1)

        def forms(part):
            """`part` of all products in K and in B, summed."""
            products = [part(a, b) for a, b in zip(motions, others, strict=True)]
            K = (self.stiffness * products[0]).sum()
            if self.prestress:
                K -= (self.force / self.distance * products[1].sum(axis=1)).sum()
            K += self.springs * (self.stiffness * products[2].sum(axis=1)).sum()
            weights = (law.normal, law.transverse, law.sliding, law.drag, law.spin_drag)
            return K, damping * sum(LONG(w) * a.sum() for w, a in zip(weights, products, strict=True))

        K, B = forms(lambda a, b: a.real * b.real - a.imag * b.imag)
        K_cross, B_cross = forms(lambda a, b: a.real * b.imag + a.imag * b.real)
        B += damping * LONG(law.eta_f) * self.area * self._fluid()[load, second]
        return (K - omega * B_cross + COMPLEX(1j) * (omega * B + K_cross)) / self.area

    def susceptibility(self, omega, forces):
        """χ = fᵀ(K + iωB)⁻¹f, complex double, of forces (n, D) on `disks` that nothing holds: without their means."""
        size, f = self.n * self.dofs, self._without_net_force(forces)
        form = np.zeros((size + 1, size + 1), COMPLEX)
        form[:-1, :-1] = self.K[:size, :size] + COMPLEX(1j) * LONG(omega) * self.B[:size, :size]
        form[:-1, -1] = form[-1, :-1] = -f.ravel()
        return complex(-relaxed(form, self.costless())[1])

    def _without_net_force(self, forces):
        """Forces (n, D) on all unknowns, (n, dofs), without the mean of each piece."""
        f = np.zeros((self.n, self.dofs), LONG)
        f[:, : self.dimension] = forces
        for piece in self.pieces():
            rows = [disk for disk, _ in piece]
            f[rows] -= f[rows].mean(axis=0)
        return f

    def quasistatic(self, load=0):
        """(ũ (n, D), G0): the response without any damping."""
        x, value = self._elastic(load)
        return x.reshape(self.n, -1)[:, : self.dimension], value

    def _elastic(self, load):
        """(x, G0) of K alone; x (n · D), with spins where K acts on them, (n · dofs)."""
        size = self.n * self.dofs
        moving = [p for p in range(size) if self.springs or p % self.dofs < self.dimension]
        moves = self.free_moves()[moving]
        moves = moves[:, (moves != 0).any(axis=0)]
        rows = [*moving, *range(size, size + len(self.loads))]
        x, value = self._relax(self.K[np.ix_(rows, rows)], moves, load)
        return without(moves, x), float(value / self.area)

    def eta0(self, load=0):
        """η₀ by identity 2: dissipation of the quasistatic field, disks turning as they like best where K lets them."""
        x, _ = self._elastic(load)
        size, D = self.n * self.dofs, self.dimension
        fixed = np.zeros((self.n, self.dofs), LONG)
        x = x.reshape(self.n, -1)
        fixed[:, : x.shape[1]] = x
        state = np.append(fixed.ravel(), np.arange(len(self.loads)) == load)
        gears = self._gears()
        turns = gears if self.springs else np.eye(size, dtype=LONG)[:, np.arange(size) % self.dofs >= D]
        at_will = turns.shape[1] and (self.law.spin_drag or not self.springs)
        if not at_will:
            return float(state @ self.B @ state / self.area)
        B, free = self.B[:size, :size], np.zeros((turns.shape[1], 0), LONG)
        form = np.empty((turns.shape[1] + 1,) * 2, LONG)
        form[:-1, :-1] = turns.T @ B @ turns
        form[:-1, -1] = form[-1, :-1] = turns.T @ (self.B[:size] @ state)
        form[-1, -1] = state @ self.B @ state
        return float(relaxed(form, free if self.law.spin_drag else turns.T @ gears)[1] / self.area)

    def eta_infinity(self, load=0):
        """η_∞: the least dissipation that any field allows."""
        size = self.n * self.dofs
        felt = np.flatnonzero(np.diag(self.B)[:size] > 0)
        rows = [*felt, *range(size, size + len(self.loads))]
        moves = self.costless()[felt]
        moves = moves[:, (moves != 0).any(axis=0)]
        return float(self._relax(self.B[np.ix_(rows, rows)], moves, load)[1] / self.area)

    def _gears(self):
        """Columns of `free_moves` in which disks turn."""
        moves = self.free_moves()
        return moves[:, [not self._travels(move) for move in moves.T]]

    def _travels(self, move):
        return bool((move.reshape(self.n, self.dofs)[:, : self.dimension] != 0).any())

    def costless(self):
        """Moves that cost nothing at any frequency: not those that the fluid drags."""
        law, moves = self.law, self.free_moves()
        return moves[:, [not (law.drag if self._travels(move) else law.spin_drag) for move in moves.T]]

    def _unresisted(self):
        """Moves whose part in a field is arbitrary or zero: translations, and gears that the fluid does not turn."""
        moves = self.free_moves()
        return moves[:, [self._travels(move) or not self.law.spin_drag for move in moves.T]]

    def turning_with_loads(self, matrix):
        """K or B where spins are counted from the rotation of the loads: θ = θ̃ + Σ ε Ω."""
        change = np.eye(len(matrix), dtype=LONG)
        m = self.n * self.dofs
        for spin in range(len(self.spins)):
            change[self.dimension + spin : m : self.dofs, m:] = self.turning[:, spin]
        return change.T @ matrix @ change


class NetworkReference(Reference):
    """K, B and G* of a network of springs for `physics`, of its arrays alone; nodes without bonds left out."""

    def __init__(self, network, physics, loads=None):
        self.law, self.prestress = physics.law, physics.prestress
        self.springs = LONG(physics.tangential_stiffness)
        self.k, cell = LONG(network.k), np.array(network.cell, LONG)
        self.dimension = D = len(cell)
        self.loads = np.zeros((1, D, D), LONG) if loads is None else np.array(loads, LONG)
        if loads is None:
            self.loads[0, :2, :2] = SIMPLE_SHEAR
        self.area = np.prod(np.diag(cell))
        self.disks = sorted({node for bond in network.bonds.tolist() for node in bond})
        self.number = {node: row for row, node in enumerate(self.disks)}
        self.i, self.j = ([self.number[node] for node in end] for end in network.bonds.T.tolist())
        places = np.array(network.positions, LONG)[self.disks]
        self.r = places[self.j] - places[self.i] + np.array(network.images, LONG) @ cell
        self.distance = np.sqrt((self.r**2).sum(axis=1))
        self.force, self.stiffness = (np.array(a, LONG) for a in (-network.tension, network.stiffness))
        radii = (
            np.zeros(network.n) if network.radii is None else network.radii
        )  # those of nodes that do not roll
        self.diameter = 2 * np.array(radii, LONG).mean()
        self.radii = np.array(radii, LONG)[self.disks]
        self.n, self.contacts = len(self.disks), len(self.i)
        self._assemble()
