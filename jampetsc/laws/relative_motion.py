"""Linear forms of bonds, rows of `laws.forms`, as coefficients of the unknowns of two disks and of a load.

The distributed K and B, their load columns and the Hessian of a quench are sums of their weighted squares.
"""

import numpy as np

from jampetsc.laws.forms import ALONG, spins_of


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


def linear_forms(forms, normal, rims=None):
    """Coefficients of the `forms` of bonds with normals n (M, D), one entry for each axis of a form.

    rims   (ρ_i (M,), ρ_j (M,)) where disks roll

    Each entry: (on disk i, on disk j), (M, dofs) each; dofs is D, with rims D(D + 1)/2.
    """
    transverse, dimension = transverse_axes(normal), normal.shape[1]
    no_spin = np.zeros((len(normal), 0 if rims is None else spins_of(dimension)))
    coefficients = []
    for form in forms:
        axes = (normal,) if form.axes == ALONG else transverse
        for number, axis in enumerate(axes):
            ends = no_spin, no_spin
            if any(form.turns):
                spin = _spins(transverse)[number]
                ends = [(turn * rim)[:, None] * spin for turn, rim in zip(form.turns, rims, strict=True)]
            coefficients.append(
                (np.hstack((-form.moves * axis, ends[0])), np.hstack((form.moves * axis, ends[1])))
            )
    return coefficients


def load_coefficients(forms, imposed, rotation=None):
    """What a unit amplitude of a load adds to each of `linear_forms`, (M,) each.

    imposed    E r, (M, D): how far the affine flow moves the ends of a bond apart
    rotation   of the spins in the affine flow, (D(D − 1)/2,), where they are relative to it
    """
    dimension = imposed.shape[1]
    added = [sum(on_j[:, axis] * imposed[:, axis] for axis in range(dimension)) for _, on_j in forms]
    if rotation is None:
        return added
    spins = slice(dimension, None)
    return [a + (on_i + on_j)[:, spins] @ rotation for a, (on_i, on_j) in zip(added, forms, strict=True)]


def _spins(transverse):
    """Coefficients of t·(θ × n) on the spins θ, (M, D(D − 1)/2), for each axis t: 1, or n × t = t₂ and −t₁."""
    if len(transverse) == 1:
        return [np.ones((len(transverse[0]), 1))]
    first, second = transverse
    return [second, -first]


def squares(forms, weights):
    """Second derivatives of ½ Σ w a² over the forms of each bond by the unknowns of its disks i and j.

    forms     as `linear_forms` makes them; weights (M, forms), real or complex

    Returns ∂²/∂i∂i and ∂²/∂i∂j (M, dofs, dofs): the entries that a bond adds to the rows of disk i.
    """
    m, dofs = forms[0][0].shape
    near = np.zeros((m, dofs, dofs), weights.dtype)
    far = np.zeros((m, dofs, dofs), weights.dtype)
    for (on_i, on_j), weight in zip(forms, weights.T, strict=True):
        weighted = weight[:, None] * on_i
        near += weighted[:, :, None] * on_i[:, None, :]
        far += weighted[:, :, None] * on_j[:, None, :]
    return near, far


def load_column(forms, weights, added):
    """∂²/∂i∂ε (M, dofs) and ∂²/∂ε² (M,) of the same sum: what a bond adds to the load column at i and to its corner.

    added   (M,) for each form, see `load_coefficients`
    """
    column = np.zeros(forms[0][0].shape, weights.dtype)
    corner = np.zeros(len(column), weights.dtype)
    for (on_i, _), on_load, weight in zip(forms, added, weights.T, strict=True):
        column += weight[:, None] * on_i * on_load[:, None]
        corner += weight * on_load**2
    return column, corner
