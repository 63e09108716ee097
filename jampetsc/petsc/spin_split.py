"""Conjugate gradients on K + sB, or B, preconditioned by a factor of its displacements alone.

In displacements and spins A = K + sB = [[U, C], [Cᵀ, S]], and U has half of the unknowns of spheres. With an
approximation T of S⁻¹, symmetric sweeps over the spins, the preconditioner is

    M⁻¹ = [[1, 0], [−T Cᵀ, 1]] [[U⁻¹, 0], [0, T]] [[1, −C T], [0, 1]] ,

positive definite as U and T are (PETSc's PCFIELDSPLIT of type Schur). If T is exact the condition number of M⁻¹A is
that of U⁻¹(U − C S⁻¹Cᵀ): what a motion costs with spins at zero, over what it costs with the best spins. K does not act
on spins, and near jamming sliding alone holds hardly more than spins can spare. So the number of iterations depends on
the weight of sliding over that of normal motion, not on size, pressure or s: 10 to 40 leave 1e-13 for β ≤ 1, 160 for
β = 100.
"""

from jampetsc.petsc.session import current

SPIN, DISPLACEMENT = "spin", "displacement"
# beginnings of options that ask for the split, and for a solver of the whole matrix
REQUESTS = ("fieldsplit_",), ("pc_", "mat_")
SPLIT_DEFAULTS = {
    "ksp_type": "cg",
    "ksp_rtol": 1e-13,  # what is left is refined, by a whole run of iterations
    "ksp_max_it": 1000,
    "pc_type": "fieldsplit",
    "pc_fieldsplit_type": "schur",
    "pc_fieldsplit_schur_fact_type": "full",
    "pc_fieldsplit_schur_precondition": "a11",  # U, the second block
    "fieldsplit_spin_ksp_type": "preonly",
    "fieldsplit_spin_pc_type": "sor",
    "fieldsplit_spin_pc_sor_local_symmetric": None,
    "fieldsplit_spin_pc_sor_its": 2,
}


def is_requested(prefix: str, default: bool) -> bool:
    """Whether to split: as the options with this prefix have it, and `default` where they leave it open."""
    split, whole = (any(current().has_options(prefix + name) for name in names) for names in REQUESTS)
    return split or (default and not whole)


def split_defaults(factor: dict) -> dict:
    """Defaults of a split with the defaults `factor` for its displacements."""
    return SPLIT_DEFAULTS | {f"fieldsplit_{DISPLACEMENT}_{name}": value for name, value in factor.items()}


def split(ksp, matrix, spins) -> None:
    """Tell a KSP which rows of its matrix are spins, global numbers of those on this rank. Collective."""
    PETSc, comm = current().PETSc, matrix.getComm()
    is_spin = PETSc.IS().createGeneral(spins.astype(PETSc.IntType), comm=comm)
    ksp.getPC().setFieldSplitIS(
        (SPIN, is_spin), (DISPLACEMENT, is_spin.complement(*matrix.getOwnershipRange()))
    )
