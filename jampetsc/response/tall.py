"""Arrays of a few columns with a row per unknown or contact, taken block by block, never copied whole.

They are stored column by column: fields and motions are made one after another.
"""

import numpy as np

BLOCK = 2048  # rows, which stay in the cache


def blocks(rows: int):
    """Slices that cover this number of rows; one that is empty where there are none."""
    return (slice(row, row + BLOCK) for row in range(0, max(rows, 1), BLOCK))


def rotate(columns, rotation) -> None:
    """columns (n, m) ← columns · rotation (m, m), in place."""
    for rows in blocks(len(columns)):
        columns[rows] = columns[rows] @ rotation


def gram(columns, weights, second=None):
    """Σ_i w_i a_ij b_ik, (m, k), of columns a (n, m), weights w (n,) and other columns b (n, k), a if not given."""
    second = columns if second is None else second
    parts = ((columns[rows], weights[rows, None], second[rows]) for rows in blocks(len(columns)))
    return sum(part.T @ (weight * other) for part, weight, other in parts)


def squares(columns, weights):
    """Σ_i w_ki a_ij², (k, m), of columns a (n, m) and weights w (k, n)."""
    return sum(weights[:, rows] @ columns[rows] ** 2 for rows in blocks(len(columns)))


def triangle(columns, scale):
    """T of [a_1, …] / scale = QT, for columns a (n, m_1), …, side by side and scale (n,)."""
    parts = (
        np.linalg.qr(np.column_stack([a[rows] for a in columns]) / scale[rows, None], mode="r")
        for rows in blocks(len(scale))
    )
    return np.linalg.qr(np.vstack(list(parts)), mode="r")
