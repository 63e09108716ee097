"""Whether this process is one of several that mpirun or mpiexec started together.

The environment alone does not decide it: every process that a rank starts inherits its variables, and Slurm sets some
for tasks that are independent of each other. So `several` is only a reason to start MPI and ask; a process that is
alone according to MPI works alone.

Slurm's srun is left out on purpose: `srun bash -c 'jampetsc plot $SLURM_PROCID.h5 …'` starts independent tasks, and
MPI would make each wait for all others. Commands that need no MPI are run by every task of srun.
"""

import os

# beginnings of variables that Open MPI (through PMIx and PRRTE) and MPICH (hydra) set for the processes they start
INHERITED = (
    *("OMPI_COMM_", "OMPI_UNIVERSE_", "OMPI_APP_CTX_", "OMPI_MCA_ess", "OMPI_MCA_orte_", "OMPI_MCA_pmix"),
    *("PMIX_", "PRTE_", "PMI_", "MPI_LOCAL"),
)


def several() -> bool:
    """Whether the environment looks like that of one of several ranks."""
    hydra = "MPI_LOCALNRANKS" in os.environ  # srun --mpi=pmi2 gives PMI_SIZE as well
    sizes = [os.environ.get("OMPI_COMM_WORLD_SIZE"), os.environ.get("PMI_SIZE") if hydra else None]
    return any(size is not None and size.isdecimal() and int(size) > 1 for size in sizes)


def without_launcher(environment) -> dict:
    """The environment for a process that is no rank of the mpirun above it, if there is one."""
    return {name: value for name, value in environment.items() if not name.startswith(INHERITED)}
