"""Reference for the mechanics: all of a small packing from its definition, dense, in extended precision.

Shares no code with the package. Contacts come from loops over all pairs and images, K from the pair Hessian
V'' n nᵀ + (V'/r) t tᵀ by the chain rule, with the strain γ as one more coordinate, and null spaces are lifted
by projectors, not held by pins. Numbers are numpy.longdouble, 18 digits on x86, to judge doubles by.
"""

import numpy as np
from scipy.linalg import lu_factor, lu_solve

LONG, COMPLEX = np.longdouble, np.clongdouble
REFINEMENTS = 12


def total(high, low=None):
    """high + low as longdouble."""
    return np.asarray(high, LONG) + (0 if low is None else np.asarray(low, LONG))


def all_pairs(positions, radii, cell, images=2):
    """Overlapping pairs i < j as lists i, j, r (M, 2), by trying every image in turn."""
    found = []
    for a in range(-images, images + 1):
        for b in range(-images, images + 1):
            r = positions[None] - positions[:, None] + a * cell[0] + b * cell[1]
            overlapping = (r**2).sum(axis=-1) < (radii + radii[:, None]) ** 2
            found += [(i, j, r[i, j]) for i, j in np.argwhere(overlapping).tolist() if i < j]
    i, j, r = zip(*found, strict=True) if found else ((), (), ())
    return list(i), list(j), np.array(r, LONG).reshape(-1, 2)


def backbone(n, i, j, force, threshold):
    """Indices of contacts above the threshold between disks with three or more of them, and those disks."""
    alive = {c for c in range(len(i)) if force[c] > threshold}
    disks = set(range(n))
    while True:
        loose = {d for d in disks if sum(d in (i[c], j[c]) for c in alive) < 3}
        if not loose:
            return sorted(alive), sorted(disks)
        disks -= loose
        alive = {c for c in alive if i[c] in disks and j[c] in disks}


def solve(A, b):
    """A⁻¹ b in the precision of A and b: from doubles by refinement, or by elimination where that does not get there.

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
        x[k + 1 :] -= factor * x[k]
    for k in range(len(A) - 1, -1, -1):
        x[k] = (x[k] - A[k, k + 1 :] @ x[k + 1 :]) / A[k, k]
    return x


def without(moves, x):
    """x with its part along every column of `moves` taken out."""
    for move in moves.T:
        x = x - move * (move @ x) / (move @ move)
    return x


class NewtonSteps:
    """What Newton's method takes for a solver, in dense numpy."""

    def factorise(self, indptr, indices, values):
        self.matrix = np.zeros((len(indptr) - 1,) * 2)
        self.matrix[np.repeat(np.arange(len(indptr) - 1), np.diff(indptr)), indices] = values
        self.matrix += np.triu(self.matrix, 1).T
        return bool(np.linalg.eigvalsh(self.matrix)[0] > 0)

    def solve(self, b):
        return np.linalg.solve(self.matrix, b)

    def order(self, n, i, j):
        return np.arange(n, dtype=np.uint32)


class Reference:
    """K, B and G* of `disks` for `physics` (law, prestress), rattlers left out.

    Unknowns are interleaved per disk, disks in file order.

    `K` and `B` are (m + 1, m + 1): their last row and column belong to the strain γ.
    """

    def __init__(self, disks, physics):
        self.law, self.prestress = physics.law, physics.prestress
        self.k, potential = LONG(disks.potential.k), disks.potential
        positions, cell = total(disks.base, disks.offset), total(disks.cell_base, disks.cell_offset)
        radii = total(disks.radii)
        self.area = cell[0, 0] * cell[1, 1]
        i, j, r = all_pairs(positions, radii, cell)
        distance = np.sqrt((r**2).sum(axis=1))
        sigma = radii[i] + radii[j]
        alpha = LONG(potential.alpha)
        length = sigma if potential.stiffness == "inverse-square-diameter" else np.ones_like(sigma)
        x = (sigma - distance) / length
        force, stiffness = (
            self.k / length * x ** (alpha - 1),
            self.k * (alpha - 1) / length**2 * x ** (alpha - 2),
        )
        self.energy = (self.k / alpha * x**alpha).sum()
        self.pressure = (force * distance).sum() / (2 * self.area)
        self.stress = -(r * (force / distance)[:, None]).T @ r / self.area
        diameter = 2 * radii.mean()
        threshold = max(1e-6 * self.pressure * diameter, 1e-14 * self.k * diameter)
        kept, self.disks = backbone(len(radii), i, j, force, threshold)
        self.number = {disk: row for row, disk in enumerate(self.disks)}
        self.i, self.j = ([self.number[end[c]] for c in kept] for end in (i, j))
        self.r, self.distance, self.force, self.stiffness = (a[kept] for a in (r, distance, force, stiffness))
        self.radii = radii[self.disks]
        self.n, self.contacts = len(self.disks), len(kept)
        self.dofs = 3 if self.law.sliding > 0 else 2
        self.K, self.B = self._matrices()

    def _matrices(self):
        m, d, law = self.n * self.dofs, self.dofs, self.law
        K, B = np.zeros((m + 1, m + 1), LONG), np.zeros((m + 1, m + 1), LONG)
        damping = self.k * LONG(law.tau1)
        for c, (i, j) in enumerate(zip(self.i, self.j, strict=True)):
            n = self.r[c] / self.distance[c]
            t = np.array([-n[1], n[0]])
            at = [*range(i * d, i * d + d), *range(j * d, j * d + d), m]
            bond = np.zeros((2, 2 * d + 1), LONG)  # what the unknowns and γ do to the bond vector
            bond[:, :2], bond[:, d : d + 2] = -np.eye(2), np.eye(2)
            bond[0, -1] = self.r[c][1]
            hessian = self.stiffness[c] * np.outer(n, n)
            if self.prestress:
                hessian = hessian - self.force[c] / self.distance[c] * np.outer(t, t)
            K[np.ix_(at, at)] += bond.T @ hessian @ bond
            across = t @ bond
            slide = across.copy()
            if d == 3:
                slide[2], slide[5] = -self.radii[i], -self.radii[j]
            forms = (law.normal, n @ bond), (law.transverse, across), (law.sliding, slide)
            for weight, form in forms:
                B[np.ix_(at, at)] += damping * LONG(weight) * np.outer(form, form)
        moves = np.tile([LONG(1), LONG(1), LONG(0)][:d], self.n)  # the fluid does not feel a disk turn
        B += damping * np.diag([*(LONG(law.drag) * moves), LONG(law.eta_f) * self.area])
        return K, B

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
            for axis in range(2):
                column = np.zeros((self.n, self.dofs), LONG)
                column[[disk for disk, _ in piece], axis] = 1
                columns.append(column.ravel())
            if self.dofs == 3 and piece[0][1]:
                column = np.zeros((self.n, 3), LONG)
                for disk, colour in piece:  # gears in mesh: ρ_i θ_i + ρ_j θ_j = 0
                    column[disk, 2] = colour / self.radii[disk]
                columns.append(column.ravel())
        return np.array(columns).T

    def _relax(self, matrix, moves):
        """Minimiser of the quadratic form (m + 1, m + 1) at γ = 1, and the form's value there."""
        A, c = matrix[:-1, :-1], matrix[:-1, -1]
        scale = 1 / np.sqrt(np.abs(np.diag(A)))
        A = A * np.outer(scale, scale)
        for move in moves.T:
            q = move / scale
            A = A + np.outer(q, q) / (q @ q)
        x = scale * solve(A, -(scale * c))
        return x, matrix[-1, -1] + c @ x

    def solution(self, omega):
        """(x, G*) at frequency ω: the field per unit strain, without free moves, and the modulus."""
        x, value = self._relax(self.K + COMPLEX(1j) * LONG(omega) * self.B, self._costless())
        return without(self.free_moves(), x), value / self.area

    def modulus(self, omega):
        """G*(ω), complex double, each part right to the last digit or so.

        The form's stationary value, summed over the squares it is made of: rounding of x counts to second
        order only, and the smaller one of G' and G'' is not the rest of a difference.
        """
        x, _ = self.solution(omega)
        u = x.reshape(-1, self.dofs)
        n = self.r / self.distance[:, None]
        bond = u[self.j, :2] - u[self.i, :2] + np.array([LONG(1), LONG(0)]) * self.r[:, 1:]
        along, across = (n * bond).sum(axis=1), n[:, 0] * bond[:, 1] - n[:, 1] * bond[:, 0]
        slide = across
        if self.dofs == 3:
            slide = across - self.radii[self.i] * u[self.i, 2] - self.radii[self.j] * u[self.j, 2]

        law = self.law

        def forms(part):
            """`part` of all squares in K and in B, summed."""
            K = (self.stiffness * part(along)).sum()
            if self.prestress:
                K -= (self.force / self.distance * part(across)).sum()
            weighted = (
                (law.normal, along),
                (law.transverse, across),
                (law.sliding, slide),
                (law.drag, u[:, :2]),
            )
            B = sum(LONG(weight) * part(motion).sum() for weight, motion in weighted)
            return K, self.k * LONG(self.law.tau1) * B

        omega = LONG(omega)
        (K, B), (K_cross, B_cross) = forms(lambda a: a.real**2 - a.imag**2), forms(lambda a: a.real * a.imag)
        B += self.k * LONG(law.tau1) * LONG(law.eta_f) * self.area
        return complex((K - 2 * omega * B_cross) / self.area, (omega * B + 2 * K_cross) / self.area)

    def quasistatic(self):
        """(ũ (n, 2), G0): the response without any damping."""
        plane = [p for p in range(self.n * self.dofs) if p % self.dofs < 2]
        moves = self.free_moves()[plane]
        moves = moves[:, (moves != 0).any(axis=0)]
        x, value = self._relax(self.K[np.ix_([*plane, -1], [*plane, -1])], moves)
        return without(moves, x).reshape(-1, 2), float(value / self.area)

    def eta0(self):
        """η₀ by identity 2: dissipation of the quasistatic field, disks turning as they like best."""
        u, _ = self.quasistatic()
        if self.dofs == 2:
            x = np.append(u.ravel(), 1)
            return float(x @ self.B @ x / self.area)
        turns = np.arange(2, 3 * self.n, 3)
        fixed = np.zeros((self.n, 3), LONG)
        fixed[:, :2] = u
        rest = np.append(fixed.ravel(), 1)
        form = np.empty((self.n + 1, self.n + 1), LONG)
        form[:-1, :-1] = self.B[np.ix_(turns, turns)]
        form[:-1, -1] = form[-1, :-1] = self.B[turns] @ rest
        form[-1, -1] = rest @ self.B @ rest
        gears = self.free_moves()[turns]
        return float(self._relax(form, gears[:, (gears != 0).any(axis=0)])[1] / self.area)

    def eta_infinity(self):
        """η_∞: the least dissipation that any field allows."""
        return float(self._relax(self.B, self._costless())[1] / self.area)

    def _costless(self):
        """Moves that cost nothing at any frequency: under drag only those in which no disk changes its place."""
        moves = self.free_moves()
        travels = np.abs(moves.reshape(self.n, self.dofs, -1)[:, :2]).max(axis=(0, 1)) > 0
        return moves[:, ~travels] if self.law.drag else moves
