"""Programs that start ranks, as a process knows them by its environment; and Open MPI of a process without one.

A launcher gives its ranks variables by which MPI finds the others. Without them Open MPI starts alone, and looks for
networks that one process never uses.
"""

import os
import shutil
from contextlib import contextmanager, suppress
from pathlib import Path

# beginnings of variables that Open MPI (through PMIx and PRRTE) and MPICH (hydra) set for the processes they start
LAUNCHER_PREFIXES = (
    *("OMPI_COMM_", "OMPI_UNIVERSE_", "OMPI_APP_CTX_", "OMPI_MCA_ess", "OMPI_MCA_orte_", "OMPI_MCA_pmix"),
    *("PMIX_", "PRTE_", "PMI_", "MPI_LOCAL"),
)
# beginnings of variables of a rank: of Open MPI, PRRTE and PMIx, MPICH and Intel's (hydra), Slurm's srun, Flux, Cray's
# PALS and ALPS, LSF's jsrun, MVAPICH
RANK_PREFIXES = (
    *("OMPI_COMM_", "OMPI_UNIVERSE_", "OMPI_APP_CTX_", "OMPI_MCA_orte_", "PRTE_LAUNCHED", "PMIX_RANK"),
    *("PMIX_NAMESPACE", "PMIX_SERVER_", "PMI_", "PMI2_", "MPI_LOCAL", "HYDI_", "SLURM_STEP", "FLUX_TASK_"),
    *("FLUX_JOB_", "PALS_", "ALPS_APP_", "JSM_NAMESPACE_", "MV2_COMM_"),
)
# for messages and for transfers; a process alone sends to itself only
LONE_COMPONENTS = {"pml": "ob1", "btl": "self"}
# parameters by which a user chooses other components for the same purpose
RIVALS = {"pml": ("pml", "mtl"), "btl": ("btl",)}
OWN_FILES = "OMPI_MCA_mca_base_param_file"  # begins variables by which a user names parameter files


def has_several_ranks() -> bool:
    """Whether the environment looks as if mpirun or mpiexec had started this process as one of several.

    That is only a reason to start MPI and ask it: a process that a rank starts inherits its variables, and Slurm sets
    some for independent tasks. Slurm's srun is left out on purpose: `srun bash -c 'jampetsc plot $SLURM_PROCID.h5 …'`
    starts independent tasks, and MPI would make each wait for all others.
    """
    hydra = "MPI_LOCALNRANKS" in os.environ  # srun --mpi=pmi2 gives PMI_SIZE as well
    sizes = [os.environ.get("OMPI_COMM_WORLD_SIZE"), os.environ.get("PMI_SIZE") if hydra else None]
    return any(size is not None and size.isdecimal() and int(size) > 1 for size in sizes)


def without_launcher(environment) -> dict:
    """The environment for a process that is not a rank of an mpirun above it."""
    return {name: value for name, value in environment.items() if not name.startswith(LAUNCHER_PREFIXES)}


def lone_settings(environment, parameter_files=()) -> dict:
    """Variables that keep Open MPI from looking for networks: {} for a rank of a launcher.

    environment      {name: value} of the process
    parameter_files  texts of Open MPI's files of parameters

    What the user has chosen there stays. A list of what is excluded, as Debian's own file has, is not a choice unless
    it excludes the component.
    """
    if any(name.startswith((*RANK_PREFIXES, OWN_FILES)) for name in environment):
        return {}
    lines = [line.partition("#")[0].partition("=") for text in parameter_files for line in text.splitlines()]
    in_files = [(name.strip(), value.strip()) for name, _, value in lines]

    def is_chosen(kind, component):
        return f"OMPI_MCA_{kind}" in environment or any(
            name == kind and not (value.startswith("^") and component not in value[1:].split(","))
            for name, value in in_files
        )

    return {
        f"OMPI_MCA_{kind}": component
        for kind, component in LONE_COMPONENTS.items()
        if not any(is_chosen(rival, component) for rival in RIVALS[kind])
    }


@contextmanager
def lone_process():
    """While the context lasts, the variables of `lone_settings` are set, for an MPI that starts within it.

    Afterwards they are gone: ranks that this process starts by mpirun need the networks.
    """
    variables = lone_settings(os.environ, _parameter_files())
    os.environ.update(variables)
    try:
        yield
    finally:
        for name in variables:
            os.environ.pop(name, None)


def _parameter_files() -> list[str]:
    """Texts of the files that Open MPI reads: the user's own and the installation's."""
    installation = (
        os.environ.get("OPAL_PREFIX") or Path(shutil.which("mpirun") or "/").resolve().parent.parent
    )
    name = "openmpi-mca-params.conf"
    files = [Path("~/.openmpi/mca-params.conf"), Path(installation, "etc", name)]
    files += Path("/etc").glob(f"openmpi*/{name}")
    texts = []
    for file in files:
        with suppress(OSError, RuntimeError):  # RuntimeError where nobody's home is known
            texts.append(file.expanduser().read_text(errors="replace"))
    return texts
