"""What the environment says of launchers, and what Open MPI is told of a process without one."""

import os
import subprocess
import sys

import launch
import pytest

from jampetsc.petsc import launchers

LONE = {"OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "self"}


@pytest.mark.parametrize(
    ("given", "several"),
    [
        ("", False),
        ("OMPI_COMM_WORLD_SIZE=1", False),
        ("OMPI_COMM_WORLD_SIZE=10", True),
        ("OMPI_COMM_WORLD_SIZE=two", False),
        ("OMPI_COMM_WORLD_SIZE=1 MPI_LOCALNRANKS=1 PMI_SIZE=2", True),
        ("MPI_LOCALNRANKS=1 PMI_SIZE=1", False),
        ("MPI_LOCALNRANKS=2", False),
        ("MPI_LOCALNRANKS=1 PMI_SIZE=2", True),
        ("SLURM_NTASKS=2 PMI_SIZE=2", False),  # srun: MPI would have each task wait for the others
    ],
)
def test_what_is_a_reason_to_start_mpi_and_ask(monkeypatch, given, several):
    for name in ("OMPI_COMM_WORLD_SIZE", "MPI_LOCALNRANKS", "PMI_SIZE"):
        monkeypatch.delenv(name, raising=False)
    for word in given.split():
        monkeypatch.setenv(*word.split("="))
    assert launchers.has_several_ranks() == several


def test_what_a_launcher_gives_is_left_out():
    given = {"OMPI_COMM_WORLD_SIZE": "2", "OMPI_UNIVERSE_SIZE": "2", "PMIX_RANK": "0", "PRTE_LAUNCHED": "1",
             "PMI_SIZE": "2", "MPI_LOCALNRANKS": "2", "OMPI_MCA_ess_base": "x", "OMPI_MCA_pmix": "x",
             "OMPI_APP_CTX_NUM_PROCS": "2", "OMPI_MCA_orte_x": "1"}  # fmt: skip
    kept = {"OMPI_MCA_btl": "^openib", "OMPI_ALLOW_RUN_AS_ROOT": "1", "PATH": "/bin", "SLURM_PROCID": "1"}
    assert launchers.without_launcher(given | kept) == kept


@pytest.mark.parametrize(
    "variable",
    [
        *("OMPI_COMM_WORLD_SIZE", "OMPI_MCA_orte_ess_num_procs", "PMIX_RANK", "PMIX_NAMESPACE"),  # Open MPI 4
        *("PRTE_LAUNCHED", "OMPI_UNIVERSE_SIZE", "PMIX_SERVER_URI41"),  # 5
        *("PMI_RANK", "PMI_FD", "MPI_LOCALNRANKS", "MPI_LOCALRANKID", "HYDI_CONTROL_FD"),  # MPICH, Intel
        *("SLURM_STEP_ID", "SLURM_STEPID", "PMI2_RANK", "FLUX_TASK_RANK", "FLUX_JOB_ID"),
        *("PALS_RANKID", "ALPS_APP_PE", "JSM_NAMESPACE_RANK", "MV2_COMM_WORLD_RANK"),
        *("OMPI_MCA_mca_base_param_files", "OMPI_MCA_mca_base_param_file_path"),  # the user's own choice
    ],
)
def test_a_rank_of_any_launcher_keeps_its_networks(variable):
    """Also one of a single rank, and what a rank starts: MPI may be started by the launcher's rules."""
    assert launchers.lone_settings({"PATH": "/bin", variable: "1"}) == {}


@pytest.mark.parametrize(
    "variables",
    [
        *("", "SLURM_JOB_ID=7 SLURM_PROCID=0 SLURM_NTASKS=4", "FLUX_URI=local:///run/flux/local"),
        *("PMIX_MCA_gds=hash", "OMPI_MCA_ess_singleton_isolated=1 OMPI_ALLOW_RUN_AS_ROOT=1"),
        "OMPI_MCA_btl_tcp_disable_family=6",
    ],
)
def test_a_process_without_a_launcher_looks_for_no_networks(variables):
    """Neither inside the script of a job nor with settings of other things."""
    environment = dict(word.split("=") for word in variables.split())
    assert launchers.lone_settings(environment) == LONE and not environment.keys() & LONE.keys()


@pytest.mark.parametrize(
    ("variables", "file", "kinds"),
    [  # kinds of components that are left to jampetsc
        ("OMPI_MCA_pml=cm", "", "btl"),
        ("OMPI_MCA_mtl=psm2", "", "btl"),
        ("OMPI_MCA_btl=tcp,self", "", "pml"),
        ("OMPI_MCA_btl=^openib", "", "pml"),
        ("OMPI_MCA_pml=ob1 OMPI_MCA_btl=self", "", ""),
        ("", "# btl = tcp\npml = ^ucx\nmtl = ^ofi\nbtl = ^uct,openib,ofi\n", "pml btl"),  # Debian's file
        ("", "pml = ucx\n", "btl"),
        ("", "  mtl=psm2 # of the machine\n", "btl"),
        ("", "btl = vader,self\n", "pml"),
        ("", "pml = ^ob1\nbtl=^tcp,self\n", ""),
        ("", "btl_tcp_if_include = eth0\nosc = ^ucx\nno sign of equality\n", "pml btl"),
    ],
)
def test_what_the_user_has_chosen_stays(variables, file, kinds):
    environment = dict(word.split("=") for word in variables.split())
    settings = launchers.lone_settings(environment, ["", file])
    assert settings == {f"OMPI_MCA_{kind}": LONE[f"OMPI_MCA_{kind}"] for kind in kinds.split()}


def test_variables_are_set_while_mpi_starts_and_for_no_process_afterwards(tmp_path, monkeypatch):
    """Ranks that python starts by mpirun must find each other; a file in the user's home is read."""
    for name in [name for name in os.environ if name.startswith("OMPI_MCA_")]:
        monkeypatch.delenv(name)
    for name in set(os.environ) - launchers.without_launcher(os.environ).keys():
        monkeypatch.delenv(name)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("OPAL_PREFIX", str(tmp_path))
    before = dict(os.environ)
    with launchers.lone_process():
        assert os.environ == before | LONE
    for file in (tmp_path / ".openmpi/mca-params.conf", tmp_path / "etc/openmpi-mca-params.conf"):
        file.parent.mkdir()
        file.write_text("btl = tcp,self\n")
        with launchers.lone_process():
            assert os.environ == before | {"OMPI_MCA_pml": "ob1"}
        file.unlink()
    with pytest.raises(KeyError), launchers.lone_process():
        os.environ.clear()
        raise KeyError
    os.environ.update(before)


def test_a_process_with_petsc_starts_ranks_that_find_each_other():
    """With the variables that python knows; Open MPI 4 has put more into those of the process."""
    text = "from mpi4py.MPI import COMM_WORLD as c; ranks = c.allgather(c.rank); c.rank or print(ranks)"
    gather = [*launch.mpirun(2), sys.executable, "-c", text]
    code = f"""
import os, subprocess
from jampetsc.petsc import session
running = session.start("real")
print(running.comm.allgather(running.rank), flush=True)
subprocess.run({gather}, env=dict(os.environ), check=True)"""
    settings = {"env": launch.environment(), "capture_output": True, "text": True, "timeout": 60}
    done = subprocess.run([sys.executable, "-c", code], **settings)
    assert done.stdout.replace("\0", "").splitlines() == ["[0]", "[0, 1]"], done.stderr
