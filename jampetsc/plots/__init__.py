"""Pictures of results, one module per family; without PETSc, MPI or a display."""
