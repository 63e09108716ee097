"""The lowest eigenpairs of a symmetric A on one rank: Lanczos with (A − σ)⁻¹, every vector kept.

With the vectors V (m, n), T tridiagonal and its eigenpairs θ, s,

    V (A − σ)⁻¹ = T V + β e_m v_{m+1} ,   λ = σ + 1/θ ,   ‖(A − σ)⁻¹Vᵀs − θ Vᵀs‖ = β |s_m|

(Parlett, The Symmetric Eigenvalue Problem, ch. 13). A vector costs a solve, so none is thrown away by restarts: two or
three for each eigenpair are enough. The recurrence leaves the next one orthogonal to all before it but for rounding,
so that one pass over them makes it so, where methods that do not use it need two.
"""

import numpy as np

from jampetsc.errors import ConvergenceError

TOLERANCE = 1e-12  # of θ
ROUNDED = 64.0 * float(np.finfo(float).eps)  # β/|T| of vectors that span an invariant space
LOOK = 2  # vectors for each eigenpair before convergence is looked at
GAIN = 0.4  # decades that each further vector gains, about: tells when to look again
SOONEST, LATEST = 2, 12  # vectors until then
FOR_EACH, BESIDES = 4, 256  # the most vectors: for each eigenpair, and besides


def lowest_eigenpairs(solve, deflated, count: int, shift: float):
    """(λ (m,), φ (m, n)): the m = `count` lowest eigenpairs, λ increasing, |φ| = 1; fewer if there are no more.

    solve      b → (A − σ)⁻¹b, (n,) each, A − σ positive definite
    deflated   (l, n) orthonormal eigenvectors of A that are not to be found
    shift      σ

    Of equal eigenvalues some may be missed. Raises ConvergenceError where the vectors that may be kept do not suffice.
    """
    known, n = deflated.shape
    there = n - known
    most = min(there, FOR_EACH * count + BESIDES)
    basis = np.empty((known + most, n))  # takes its memory row by row, as it is filled
    basis[:known] = deflated
    T = np.zeros((most + 1, most + 1))
    generator = np.random.default_rng(0)
    beta, look = 0.0, min(LOOK * count, most)
    for m in range(1, most + 1):
        before, new = basis[: known + m - 1], basis[known + m - 1]
        if beta == 0.0:  # at the start, and where those before span an invariant space
            w = generator.standard_normal(n)
            size = _orthogonalise(w, before)
        new[:] = w / size
        w = solve(new)
        T[m - 1, m - 1] = along = new @ w
        w -= along * new
        if beta > 0.0:
            w -= beta * before[-1]
        size = _orthogonalise(w, basis[: known + m])
        beta = size if size > ROUNDED * along else 0.0
        T[m, m - 1] = T[m - 1, m] = beta
        if m < look or (beta == 0.0 and m < there):
            continue
        theta, s = np.linalg.eigh(T[:m, :m])
        theta, s = theta[-count:][::-1], np.ascontiguousarray(s[:, -count:].T[::-1])
        worst = (beta * np.abs(s[:, -1]) / theta).max()
        if worst <= TOLERANCE or m == there:
            return shift + 1.0 / theta, s @ basis[known : known + m]
        look = min(most, m + int(np.clip(np.log10(worst / TOLERANCE) / GAIN, SOONEST, LATEST)))
    raise ConvergenceError(
        f"{count} modes are not found with {most} Lanczos vectors: -modes_eps_type krylovschur has SLEPc look for them"
    )


def _orthogonalise(w, basis):
    """|w| without what it has along the rows of `basis`, which is taken from it."""
    w -= (basis @ w) @ basis
    return np.linalg.norm(w)
