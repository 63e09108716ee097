"""Frequencies at which K + iωB can be solved: beyond them K and ωB no longer share a double."""

SMALLEST, LARGEST = 1e-16, 1e12  # 1/time, as `--omega` is; what τ₁ makes of them is for the bounds on errors
