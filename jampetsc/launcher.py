"""Whether this process is one of several that mpirun or mpiexec started together.

The environment alone cannot tell: its variables reach every process that a rank starts, and Slurm sets some for
tasks that have nothing to do with each other. So what is found here is a reason to start MPI and ask, no more;
a process that MPI says is alone does its work.

Slurm's srun is left out on purpose: `srun bash -c 'jampetsc plot $SLURM_PROCID.h5 …'` is a farm of tasks, and MPI
would make each wait for all others. What needs no MPI is done by every task of srun.
"""

import contextlib
import os
import re
from pathlib import Path

# what Open MPI (through PMIx and PRRTE) and MPICH (its process manager hydra) give to the processes they start
INHERITED = (
    *("OMPI_COMM_", "OMPI_UNIVERSE_", "OMPI_APP_CTX_", "OMPI_MCA_ess", "OMPI_MCA_orte_", "OMPI_MCA_pmix"),
    *("PMIX_", "PRTE_", "PMI_", "MPI_LOCAL"),
)
ISOLATED = "OMPI_MCA_ess_singleton_isolated"
DAEMONS = re.compile(r"mpirun|mpiexec|orte|prte|hydra|slurmstepd")  # they start ranks


def several() -> bool:
    """Whether the environment is that of one of several ranks."""
    hydra = "MPI_LOCALNRANKS" in os.environ  # srun --mpi=pmi2 gives PMI_SIZE as well
    sizes = [os.environ.get("OMPI_COMM_WORLD_SIZE"), os.environ.get("PMI_SIZE") if hydra else None]
    return any(size is not None and size.isdecimal() and int(size) > 1 for size in sizes)


def without_launcher(environment) -> dict:
    """The environment for a process that is no rank of the mpirun above it, if there is one."""
    return {name: value for name, value in environment.items() if not name.startswith(INHERITED)}


@contextlib.contextmanager
def without_daemon():
    """While MPI starts: a process that nothing launched tells Open MPI 4 that it stays alone.

    It would else start a daemon, orted, for ranks to be spawned later, and that outlives a kill of its process. Open
    MPI 5 and MPICH start theirs when ranks are spawned, and know no such variable. One that the user has set stays,
    and a process of mpirun, or of srun with PMI, is no such one.
    """
    if any(name.startswith(INHERITED) for name in os.environ):
        yield
        return
    os.environ[ISOLATED] = "1"
    try:
        yield
    finally:
        del os.environ[ISOLATED]  # children decide for themselves


def forget_if_inherited() -> None:
    """In a process that a rank started, drop what mpirun gave to that rank: joining in its place would hang."""
    if several() and _started_by_rank():
        for name in set(os.environ) - set(without_launcher(os.environ)):
            del os.environ[name]


def _started_by_rank():
    """Whether a process below mpirun and above this one uses MPI. False where /proc does not tell."""
    pid = os.getppid()
    try:
        while pid > 1:
            folder = Path("/proc", str(pid))
            if DAEMONS.search((folder / "comm").read_text()):
                return False
            if re.search(r"/libmpi[\w-]*\.so", (folder / "maps").read_text()):
                return True
            pid = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        pass
    return False
