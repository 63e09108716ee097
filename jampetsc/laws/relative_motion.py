"""What one bond adds to K and B: weighted squares of its relative motions, linear forms in displacements and strain.

With r = x_j − x_i, n = r/|r| and axes t across n, per unit of displacements ũ, spins θ and shear strain γ

    a∥ = n·(ũ_j − ũ_i) + γ n_x r_y,    a⊥ = t·(ũ_j − ũ_i) + γ t_x r_y,    a⊥ᶜ = a⊥ − t·[(ρ_i θ_i + ρ_j θ_j) × n] .

In two dimensions there is one axis t = ẑ × n and θ = θ ẑ, so that a⊥ᶜ = a⊥ − ρ_i θ_i − ρ_j θ_j. In three there are two
axes t, and three spins.

A bond's part of K is k (a∥)² − (f/r) |a⊥|² (BT eqs. 4, 11); B has the weights of the damping law (`laws`). The
distributed K and B, their border and the Hessian of a quench are sums of these squares.
"""

import numpy as np


def transverse_axes(normal):
    """D − 1 orthonormal axes across normals (M, D), (M, D) each: ẑ × n, or two with n = t₁ × t₂.

    T. Duff et al., Building an orthonormal basis, revisited, J. Comput. Graph. Tech. 6, 1 (2017).
    """
    if normal.shape[1] == 2:
        return (np.column_stack((-normal[:, 1], normal[:, 0])),)
    x, y, z = normal.T
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        np.column_stack((1.0 + sign * x * x * a, sign * b, -sign * x)),
        np.column_stack((b, sign + y * y * a, -y)),
    )


def linear_forms(normal, r_y, rims=None):
    """a∥, D − 1 of a⊥ and, with the rims' radii (ρ_i (M,), ρ_j (M,)), as many of a⊥ᶜ of bonds with n (M, D), r_y (M,).

    Each as its coefficients (on disk i, on disk j, on γ) of shapes (M, dofs), (M, dofs), (M,); dofs is D, with rims
    D(D + 1)/2.
    """
    transverse, dimension = transverse_axes(normal), normal.shape[1]
    no_spin = np.zeros((len(normal), 0 if rims is None else dimension * (dimension - 1) // 2))
    forms = [
        (np.hstack((-axis, no_spin)), np.hstack((axis, no_spin)), axis[:, 0] * r_y)
        for axis in (normal, *transverse)
    ]
    if rims is not None:
        for axis, spin, (*_, on_gamma) in zip(transverse, _spins(transverse), forms[1:], strict=True):
            at_i, at_j = (-rim[:, None] * spin for rim in rims)
            forms.append((np.hstack((-axis, at_i)), np.hstack((axis, at_j)), on_gamma))
    return forms


def _spins(transverse):
    """Coefficients of t·(θ × n) on the spins θ, (M, D(D − 1)/2), for each axis t: 1, or n × t = t₂ and −t₁."""
    if len(transverse) == 1:
        return [np.ones((len(transverse[0]), 1))]
    first, second = transverse
    return [second, -first]


def squares(forms, weights):
    """Second derivatives of ½ Σ w a² over the forms of each bond; weights w (M, forms), real or complex.

    Returns ∂²/∂i∂i and ∂²/∂i∂j (M, dofs, dofs), ∂²/∂i∂γ (M, dofs) and ∂²/∂γ² (M,), i and j the unknowns of the two
    disks: the entries that a bond adds to the rows of disk i and of γ.
    """
    m, dofs = forms[0][0].shape
    near = np.zeros((m, dofs, dofs), weights.dtype)
    far = np.zeros((m, dofs, dofs), weights.dtype)
    border = np.zeros((m, dofs), weights.dtype)
    corner = np.zeros(m, weights.dtype)
    for (on_i, on_j, on_gamma), weight in zip(forms, weights.T, strict=True):
        weighted = weight[:, None] * on_i
        near += weighted[:, :, None] * on_i[:, None, :]
        far += weighted[:, :, None] * on_j[:, None, :]
        border += weighted * on_gamma[:, None]
        corner += weight * on_gamma**2
    return near, far, border, corner
