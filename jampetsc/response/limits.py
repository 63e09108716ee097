"""Frequencies at which K + iωB can be solved: beyond them K and ωB no longer share a double."""

MIN_OMEGA, MAX_OMEGA = 1e-16, 1e12  # of ω in 1/time, as `--omega`; of ωτ₁ if τ₁ = 1
