"""Numbers out of arrays: scaling, correlations, relaxation spectra, creep. Knows no files and no PETSc."""
