"""A rational Krylov space for K + sB + s²M, grown from chains at real shifts, orthonormal in M̂ (see `mass_matrix`).

With x(s) = −Z(s)⁻¹(k + s b), Z(s) = K + sB + s²M̂, and v = x the pair (x, v) obeys an equation of first order with a
constant as a third part, whose Krylov chain at a shift s is

    Z(s) x_n = −s [B x_{n−1} + s M̂ (x_{n−1} + v_{n−1}) + κ_{n−1} b] ,    v_n = x_n + x_{n−1} ,    κ_n = 0 ,

from x₀ = x(s), v₀ = x₀, κ₀ = 1. The x of n steps span what x(s) and its first n − 1 derivatives do: Galerkin's G*
agrees with 2n derivatives of the exact one at s. Pairs are kept as coefficients of one orthonormal basis and made
orthogonal as pairs, which keeps long chains independent (two-level orthogonal Arnoldi, Lu, Su & Bai, SIAM J. Matrix
Anal. 37, 195 (2016)). Chains of several shifts and loads share the basis.
"""

from dataclasses import dataclass, field

import numpy as np

from jampetsc.analysis.reduced_inertia import solve_second_order
from jampetsc.collective import on_root
from jampetsc.errors import ConvergenceError
from jampetsc.response.assembly import Pencil
from jampetsc.response.krylov_basis import bordered

NEW = 1e-9  # least part of a vector outside the space, relative to it
INDEPENDENT = 1e-13  # least part of a pair that is not in those before, relative to it
MAX_REFUSED = 6  # vectors of a chain, one after another, that lie in the space: nothing new is left


@dataclass
class Chain:
    """Pairs of one load at one shift: rows with the coefficients of x_n and v_n in the basis, and κ_n."""

    x: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    v: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    constant: np.ndarray = field(default_factory=lambda: np.empty(0))
    refused: int = 0  # vectors, one after another, that added nothing to the basis

    @property
    def length(self) -> int:
        """Number of pairs."""
        return len(self.constant)

    @property
    def is_complete(self) -> bool:
        """Whether more steps would add nothing."""
        return self.refused >= MAX_REFUSED

    def append(self, coefficients) -> None:
        """Add the pair of x_n, given by its coefficients in the basis as it is now."""
        more = ((0, 0), (0, len(coefficients) - self.x.shape[1]))
        self.x, self.v = np.pad(self.x, more), np.pad(self.v, more)
        previous = self.x[-1] if self.length else 0.0
        pair = np.concatenate((coefficients, coefficients + previous, [0.0 if self.length else 1.0]))
        size = np.linalg.norm(pair)
        pairs = np.column_stack((self.x, self.v, self.constant))
        for _ in range(2):
            pair = pair - (pairs @ pair) @ pairs
        left = np.linalg.norm(pair)
        if not left > INDEPENDENT * size:
            self.refused = MAX_REFUSED
            return
        x, v, constant = np.split(pair / left, [len(coefficients), 2 * len(coefficients)])
        self.x, self.v = np.vstack((self.x, x)), np.vstack((self.v, v))
        self.constant = np.append(self.constant, constant)


class SecondOrderBasis:
    """V of one K, B and M̂ and several loads, with the projected matrices. Methods are collective.

    pencils   of the loads
    K, B      Vᵀ K V and Vᵀ B V, (m, m); Vᵀ M̂ V is the identity
    k, b      (loads, m) the load columns in the space
    chains    {(load, shift): Chain}
    """

    def __init__(self, pencils: list[Pencil]):
        self.pencil, self.mass = pencils[0], pencils[0].mass
        self.columns = [
            tuple(vector.getArray().copy() for vector in (pencil.k_gamma, pencil.b_gamma))
            for pencil in pencils
        ]
        self._V = np.empty((8, len(self.columns[0][0])))
        self.size = 0
        self.K, self.B = np.empty((0, 0)), np.empty((0, 0))
        self.k, self.b = (np.empty((len(pencils), 0)) for _ in range(2))
        self.chains: dict[tuple[int, float], Chain] = {}

    @property
    def vectors(self):
        """Vᵀ, (m, n_local)."""
        return self._V[: self.size]

    def extend(self, solve, load: int, s: float, count: int) -> None:
        """Add up to `count` vectors of the chain of a load at shift s, fewer where nothing new is left.

        solve   (n_local,) → (n_local,), Z(s)⁻¹
        """
        chain = self.chains.setdefault((load, s), Chain())
        for _ in range(count):
            if chain.is_complete:
                return
            source = self._source(chain, load, s)
            size = self.size
            if not self.pencil.network.sum(float(source @ source)):
                chain.refused = MAX_REFUSED
                return
            coefficients = self._append(solve(source), f"s = {s:g}")
            chain.refused = 0 if self.size > size else chain.refused + 1
            chain.append(coefficients)

    def _source(self, chain, load, s):
        k, b = self.columns[load]
        if not chain.length:
            return -(k + s * b)
        x, v = (part[-1] @ self.vectors[: part.shape[1]] for part in (chain.x, chain.v))
        inertial = self.mass.apply(x + v)
        return -s * (self.pencil.times(self.pencil.B, x) + s * inertial + chain.constant[-1] * b)

    def _append(self, w, where):
        """Coefficients of w (n_local,) in the basis, to which its part outside is added if it has enough digits."""
        network = self.pencil.network
        coefficients, length = np.zeros(self.size), None
        for _ in range(2):
            image = self.mass.apply(w)
            products = network.sum(np.append(self.vectors @ image, w @ image))
            length = products[-1] if length is None else length
            coefficients += products[:-1]
            w = w - products[:-1] @ self.vectors
            self.pencil.project(w)  # moves that the fluid holds and no load drives grow from rounding
        norm2 = network.sum(float(w @ self.mass.apply(w)))
        if not np.isfinite(norm2):
            raise ConvergenceError(f"solve at {where}: NaN or Inf. Give another options file.")
        if not norm2 > NEW**2 * length:
            return coefficients
        self._add(w / np.sqrt(norm2))
        return np.append(coefficients, np.sqrt(norm2))

    def restore(self, vectors) -> None:
        """Add vectors (m, n_local) of an earlier basis, orthonormal as they are."""
        for vector in vectors:
            self._add(vector)

    def _add(self, vector):
        m = self.size
        if m == len(self._V):
            self._V = np.concatenate((self._V, np.empty_like(self._V)))
        self._V[m] = vector
        self.size = m + 1
        images = [self.pencil.times(matrix, vector) for matrix in (self.pencil.K, self.pencil.B)]
        columns = np.array([part for pair in self.columns for part in pair]) @ vector
        rows = self.pencil.network.sum(np.concatenate([*(self.vectors @ image for image in images), columns]))
        of_K, of_B, of_columns = np.split(rows, [m + 1, 2 * m + 2])
        self.K, self.B = bordered(self.K, of_K), bordered(self.B, of_B)
        self.k = np.column_stack((self.k, of_columns[::2]))
        self.b = np.column_stack((self.b, of_columns[1::2]))

    def coefficients(self, omega):
        """(M, loads, m) complex: Galerkin's y of (K + sB + s²) y = −(k + s b) in the space, s = iω, at ω (M,)."""
        return on_root(self.pencil.network.comm, lambda: np.array([self._solution(at) for at in omega]))

    def _solution(self, omega):
        return solve_second_order(self.K, self.B, omega, -(self.k + 1j * omega * self.b).T).T

    def fields(self, coefficients):
        """x (…, n_local) complex of coefficients (…, m), as projected as residuals are."""
        fields = coefficients.real @ self.vectors + 1j * (coefficients.imag @ self.vectors)
        for x in fields.reshape(-1, fields.shape[-1]) if self.pencil.projects else ():
            self.pencil.project(x)
        return fields
