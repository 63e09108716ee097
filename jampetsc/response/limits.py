"""Frequencies at which K + iωB can be solved: beyond them K and ωB no longer share a double."""

SMALLEST, LARGEST = 1e-16, 1e12  # in units of 1/τ₁
