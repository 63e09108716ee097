"""The mass matrix of a pencil, K + sB + s²M, where moves that K and B let pass are left out.

K and B do not resist the translations t of a connected component, and where disks roll the turning of its gears, unless
the fluid does. Loads do not drive them. Without masses one unknown of each is pinned. With masses the response obeys
tᵀM x = 0, as tᵀ(K + sB) = 0. Fields keep the pinned unknown at zero, x = x̂ + t τ with τ = −tᵀM x̂ / tᵀM t, so that K, B
and the motions of bonds stay as they are, and the mass matrix of x̂ is

    M̂ = M − (M t)(tᵀM t)⁻¹(M t)ᵀ ,

positive definite on what is not pinned. A solve with K + sB + s²M̂ takes a solve with the sparse K + sB + s²M, pins left
out, and by the formula of Woodbury one more for each direction of t, all components at once.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from jampetsc.laws.damping import Law
from jampetsc.laws.masses import GYRATION
from jampetsc.response.contact_network import DistributedNetwork, Pieces


@dataclass(frozen=True, eq=False)
class MassMatrix:
    """M and the moves t that it alone resists. Arrays hold this rank's part; methods are collective.

    Each component has one move of each of q directions, zero where it has none.
    """

    network: DistributedNetwork
    diagonal: np.ndarray  # (n_local,) M
    free: np.ndarray  # (n_local,) whether an unknown is not pinned
    moves: np.ndarray  # (q, n_local) t
    component: np.ndarray  # (n_local,) number of the connected component
    total: np.ndarray  # (components, q) tᵀM t
    are_equal: bool  # whether all particles have one mass

    @cached_property
    def pinned_diagonal(self):
        """M without what is pinned, (n_local,)."""
        return np.where(self.free, self.diagonal, 0.0)

    def along_moves(self, x):
        """tᵀM x, (components, q), for x (n_local,), real or complex."""
        return self.network.sum(self._sums_along(self.moves, self.diagonal * x))

    def _sums_along(self, moves, values):
        """This rank's part of tᵀ values, (components, q)."""
        if len(self.total) == 1:
            return (moves @ values)[None]
        if np.iscomplexobj(values):
            return self._sums_along(moves, values.real) + 1j * self._sums_along(moves, values.imag)
        sums = [np.bincount(self.component, move * values, len(self.total)) for move in moves]
        return np.array(sums).reshape(len(moves), len(self.total)).T

    def moved(self, amplitudes, moves=None):
        """Σ t τ, (n_local,), for amplitudes τ (components, q); moves: other columns than t."""
        moves = self.moves if moves is None else moves
        if len(self.total) == 1:
            return amplitudes[0] @ moves
        return np.einsum("qi,iq->i", moves, amplitudes[self.component])

    def centred(self, x):
        """x with tᵀM x = 0 for x with pinned unknowns at zero, (n_local,)."""
        if not len(self.moves):
            return x
        return x - self.moved(self.along_moves(x) / self.total)

    def apply(self, x):
        """M̂ x, (n_local,), for x with pinned unknowns at zero, real or complex."""
        return self.pinned_diagonal * self.centred(x)

    def terms(self, sizes):
        """Sizes (c, n_local) of the terms that `centred` sums, for |x| (c, n_local)."""
        if not len(self.moves):
            return sizes
        moves = np.abs(self.moves)
        sums = np.array([self._sums_along(moves, self.diagonal * size) for size in sizes])
        means = self.network.sum(sums) / self.total
        return np.array([size + self.moved(mean, moves) for size, mean in zip(sizes, means, strict=True)])

    def move_correction(self, solve, square) -> "MoveCorrection":
        """What makes solves with A + s²M̂ of those with A + s²M without pins.

        solve    (n_local,) → (n_local,), the latter
        square   s²
        """
        return MoveCorrection(self, [solve(self.pinned_diagonal * move) for move in self.moves], square)


class MoveCorrection:
    """The formula of Woodbury for A + s²M̂ = A + s²M − s² (M t)(tᵀM t)⁻¹(M t)ᵀ. Collective.

    moved   (A + s²M)⁻¹ M t, without pins, for each direction of t
    """

    def __init__(self, mass: MassMatrix, moved, square):
        self._mass, self._moved = mass, np.array(moved)
        if len(moved):
            between = np.stack([mass.along_moves(column) for column in moved], axis=2)
            self._schur = np.einsum("pq,qr->pqr", mass.total / square, np.eye(len(moved))) - between

    def correct(self, x):
        """(A + s²M̂)⁻¹f, (n_local,), from (A + s²M)⁻¹f without pins."""
        if not len(self._moved):
            return x
        amplitudes = np.linalg.solve(self._schur, self._mass.along_moves(x)[..., None])[..., 0]
        return x + self._mass.moved(amplitudes, self._moved)


def mass_weighted(pencil):
    """A pencil with M^(−½) K M^(−½) for K; the pencil itself without masses. Collective.

    Its eigenvectors ψ = M^(½)φ are orthonormal, and have the eigenvalues λ of Kφ = λMφ.
    """
    if pencil.mass is None:
        return pencil
    K = pencil.K.copy()
    scale = K.createVecRight()
    scale.setArray(pencil.mass_scale)
    K.diagonalScale(scale, scale)
    return replace(pencil, K=K)


def build_mass_matrix(network: DistributedNetwork, law: Law, pieces: Pieces, pins) -> MassMatrix:
    """M of a network with masses under a law, pinned as its K and B. Collective. Raises InputError as `Masses.of`."""
    D, dofs, own = network.dimension, network.dofs(law), slice(network.first, network.last)
    of_particles = network.masses.of(network.radii, network.n, network.diameter, D)
    values = np.repeat(of_particles[own, None], dofs, axis=1)
    if dofs > D:
        values[:, D:] *= GYRATION[D] * network.radii[own, None] ** 2
    diagonal = values.ravel()
    first = network.first * dofs
    unknowns = np.arange(first, first + len(diagonal))
    moves = []
    if not law.holds_translations:
        moves += list(np.eye(dofs)[:D])
    if dofs > D and not law.holds_spins:
        moves += list(np.eye(dofs)[D:])
    moves = np.array([np.tile(move, len(values)) for move in moves]).reshape(-1, len(diagonal))
    component = np.repeat(pieces.index[own], dofs)
    if dofs > D and not law.holds_spins:
        gears = pieces.gears(network.contact_forms(law))[own]
        moves[-(dofs - D) :] *= np.repeat(gears / network.radii[own], dofs)
    count = len(pieces.roots)
    sums = [np.bincount(component, move * diagonal * move, count) for move in moves]
    total = network.sum(np.array(sums).reshape(-1, count).T)
    total[total == 0.0] = 1.0  # a component without gears, whose moves are zero
    return MassMatrix(
        network,
        diagonal,
        ~np.isin(unknowns, pins),
        moves,
        component,
        total,
        bool(np.ptp(of_particles) == 0.0),
    )
