"""What one bond adds to K and B: weighted squares of its relative motions, linear forms in displacements and strain.

With r = x_j − x_i, n = r/|r| and t = ẑ × n, per unit of displacements ũ, angles θ and shear strain γ

    a∥ = n·(ũ_j − ũ_i) + γ n_x r_y,    a⊥ = t·(ũ_j − ũ_i) + γ t_x r_y,    a⊥ᶜ = a⊥ − ρ_i θ_i − ρ_j θ_j .

A bond's part of K is k (a∥)² − (f/r) (a⊥)² (BT eqs. 4, 11); B has the weights of the damping law (`laws`). The
distributed K and B, their border and the Hessian of a quench are sums of these squares.
"""

import numpy as np


def linear_forms(normal, r_y, rims=None):
    """a∥, a⊥ and, with the rims' radii (ρ_i (M,), ρ_j (M,)), a⊥ᶜ of bonds with n (M, 2) and r_y (M,).

    Each as its coefficients (on disk i, on disk j, on γ) of shapes (M, dofs), (M, dofs), (M,); dofs is 2, or 3
    with rims.
    """
    transverse = np.column_stack((-normal[:, 1], normal[:, 0]))
    no_spin = np.zeros((len(normal), 0 if rims is None else 1))
    forms = [
        (np.hstack((-axis, no_spin)), np.hstack((axis, no_spin)), axis[:, 0] * r_y)
        for axis in (normal, transverse)
    ]
    if rims is not None:
        at_i, at_j = (-rim[:, None] for rim in rims)
        forms.append((np.hstack((-transverse, at_i)), np.hstack((transverse, at_j)), forms[1][2]))
    return forms


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
